"""One experiment at many values."""

import csv
import io
import re

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from drake_rnn import (
    InvalidInputError,
    SimulationError,
    load_experiment,
    run_campaign,
    simulate,
    sweep,
)
from drake_rnn.cli import tables
from drake_rnn.cli.commands import app
from drake_rnn.cli.tables import WIDE, sheet_tables, sweep_sheet, varying_metrics
from drake_rnn.errors import InterruptedRunError
from drake_rnn.figures.campaign import sweep_figure
from drake_rnn.jobs import campaign as performing
from drake_rnn.jobs.campaign import InterruptedSweepError, parse_axis, write_csv
from drake_rnn.jobs.requests import Row
from drake_rnn.runs import simulation
from drake_rnn.tables import Cell, Column, Heading, Sheet

KNOWN = "slc_nephroid_known"
SHORT = {"duration": 0.05}


@pytest.mark.parametrize(
    ("text", "axis"),
    [
        ("law.kappa=1,2e0, 4", ("law.kappa", [1, 2.0, 4])),
        ("dither.model=actuated,virtual", ("dither.model", ["actuated", "virtual"])),
        ("limits=none,{velocity: 1, acceleration: 2}", None),
        ("path.offset=[0, 0, 0],[0.1, 0, 0]", ("path.offset", [[0, 0, 0], [0.1, 0, 0]])),
        (" seed =3", ("seed", [3])),
    ],
)
def test_values_are_read_as_yaml(text, axis):
    axis = axis or ("limits", ["none", {"velocity": 1, "acceleration": 2}])
    assert parse_axis(text) == axis


@pytest.mark.parametrize("text", ["law.kappa", "=1", "law.kappa=", "law.kappa= "])
def test_an_axis_needs_key_and_values(text):
    with pytest.raises(InvalidInputError, match=r"--over: must be KEY=v1,v2,\.\.\., not"):
        parse_axis(text)


def test_values_that_are_no_yaml_are_refused():
    with pytest.raises(InvalidInputError, match="--over seed: not a YAML document"):
        parse_axis("seed=1,{2")


def test_rows_come_in_the_order_of_the_values_with_the_metrics_of_each_run():
    told = []
    rows = sweep(KNOWN, {"law.kappa": [8, 2, 4]}, SHORT, progress=told.append)
    assert [row.values for row in rows] == [(8,), (2,), (4,)]
    assert rows == told
    for row in rows:
        alone = simulate(load_experiment(KNOWN, {**SHORT, "law.kappa": row.values[0]}))
        assert row.metrics == alone.metrics
        assert row.failure is None


def test_two_axes_give_every_pair_the_last_one_fastest():
    rows = sweep(KNOWN, {"law.kappa": [1, 2], "path.size": [0.02, 0.04]}, SHORT)
    assert [row.values for row in rows] == [(1, 0.02), (1, 0.04), (2, 0.02), (2, 0.04)]
    errors = {row.metrics["position_error_rms_m"] for row in rows}
    assert len(errors) == 4


def test_a_sweep_is_a_campaign_over_lists(tmp_path):
    """Row by row, bit for bit."""
    over = {"law.kappa": [1, 2], "path.size": [0.02, 0.04]}
    document = {"experiment": KNOWN, "changes": SHORT, "vary": over, "method": "simulate"}
    lines = run_campaign(document, tmp_path, jobs=0).lines
    rows = sweep(KNOWN, over, SHORT)
    assert [tuple(line.values.values()) for line in lines] == [row.values for row in rows]
    assert [line.record.metrics for line in lines] == [row.metrics for row in rows]
    assert [line.record.not_met for line in lines] == [row.not_met for row in rows]


def test_every_combination_is_checked_before_the_first_runs(monkeypatch):
    def simulate(experiment, **how):
        raise AssertionError("simulated")

    monkeypatch.setattr(performing, "simulate", simulate)
    with pytest.raises(InvalidInputError, match=r"law\.kappa: must be greater than 0, not -1"):
        sweep(KNOWN, {"law.kappa": [1, 2, -1]}, SHORT)


def test_a_run_that_fails_takes_a_row_and_the_others_run(monkeypatch):
    def simulate_or_fail(experiment, **how):
        if experiment.document.seed == 2:
            error = SimulationError("controller: state v is no longer finite", 0.01)
            error.result = simulate(experiment)
            raise error
        return simulate(experiment)

    monkeypatch.setattr(performing, "simulate", simulate_or_fail)
    rows = sweep(KNOWN, {"seed": [1, 2, 3]}, SHORT)
    assert [row.failure is None for row in rows] == [True, False, True]
    assert rows[1].failure == "controller: state v is no longer finite (at t = 0.01 s)"
    assert "joint_velocity_max_rad_s" in rows[1].metrics


def test_a_path_out_of_reach_is_refused_before_anything_runs():
    done = []
    with pytest.raises(InvalidInputError, match="path: out of reach"):
        sweep(
            KNOWN, {"path.size": [0.04, 2]}, {"duration": 1, "law.kappa": 5}, progress=done.append
        )
    assert not done


def test_a_key_that_is_swept_may_not_be_set_as_well():
    with pytest.raises(InvalidInputError, match=r"--over: 'law\.kappa' is also set"):
        sweep(KNOWN, {"law.kappa": [1, 2]}, {"law.kappa": 3})


@pytest.mark.long
def test_numbers_do_not_depend_on_how_many_run_at_a_time():
    """Bit for bit."""
    over = {"law.kappa": [2, 4, 8]}
    one = sweep("slc_nephroid", over, {"duration": 0.02})
    two = sweep("slc_nephroid", over, {"duration": 0.02}, processes=2)
    assert [row.values for row in one] == [row.values for row in two]
    for a, b in zip(one, two, strict=True):
        assert a.metrics == b.metrics


def test_the_table_holds_every_value_and_metric_to_the_last_bit(tmp_path):
    rows = [
        Row((1, "none"), {"a_m": 1 / 3, "b_s": 2e-9}),
        Row((2, [0.1, 0.0]), {"a_m": -0.1}, 'failed, "here"\nand there'),
    ]
    write_csv(tmp_path / "sweep.csv", ["law.kappa", "limits"], rows)
    with (tmp_path / "sweep.csv").open(newline="") as stream:
        first, second = csv.DictReader(stream)
    assert list(first) == ["law.kappa", "limits", "a_m", "b_s", "failure"]
    assert first["law.kappa"] == "1"
    assert (float(first["a_m"]), float(first["b_s"])) == (1 / 3, 2e-9)
    assert first["failure"] == ""
    assert second["limits"] == "[0.1, 0.0]"
    assert (float(second["a_m"]), second["b_s"]) == (-0.1, "")
    assert second["failure"] == 'failed, "here"\nand there'


def test_a_table_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match="is a folder; only a regular file is written"):
        write_csv(tmp_path, ["a"], [])


def test_a_tables_numbers_are_those_of_the_runs(tmp_path):
    rows = sweep(KNOWN, {"law.kappa": [1, 2]}, SHORT)
    write_csv(tmp_path / "sweep.csv", ["law.kappa"], rows)
    with (tmp_path / "sweep.csv").open(newline="") as stream:
        read = [float(line["position_error_rms_m"]) for line in csv.DictReader(stream)]
    np.testing.assert_array_equal(read, [row.metrics["position_error_rms_m"] for row in rows])


# The picture.


def rows(*found):
    return [Row((k + 1, "a"), {"error": value}) for k, value in enumerate(found)]


def test_the_picture_has_a_panel_for_each_metric(tmp_path):
    file = sweep_figure(["x", "y"], rows(1.0, 2.0, 4.0), ["error"], tmp_path / "sweep.png")
    assert file.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("table", "metrics"),
    [
        (rows(1.0), []),
        ([Row(("left",), {"error": 1.0})], ["error"]),
        ([Row((1,), {}, "failed")], ["error"]),
    ],
)
def test_there_is_no_picture_of_nothing(tmp_path, table, metrics):
    assert sweep_figure(["x"], table, metrics, tmp_path / "sweep.png") is None
    assert not (tmp_path / "sweep.png").exists()


@pytest.mark.parametrize("decades", [0.91, 1.0, 1.4, 2.3, 6.0])
@pytest.mark.parametrize("start", [1e-5, 1.05e-5, 2.1e-5, 9.5e-5])
def test_a_logarithmic_axis_has_two_labels(decades, start, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("drake_rnn.figures.campaign.save", lambda figure, _: drawn.append(figure))
    values = start * np.geomspace(1.0, 10**decades, 12)
    table = [Row((float(v),), {"error": 3.0 * float(v)}) for v in values]
    sweep_figure(["x"], table, ["error"], tmp_path / "sweep.png")
    (ax,) = drawn[0].get_axes()
    assert ax.get_xscale() == ax.get_yscale() == "log"
    for axis, (low, high) in ((ax.xaxis, ax.get_xlim()), (ax.yaxis, ax.get_ylim())):
        places = axis.get_majorticklocs()
        texts = axis.get_major_formatter().format_ticks(places)
        labels = [text for at, text in zip(places, texts, strict=True) if low <= at <= high]
        assert sum(map(bool, labels)) >= 2, labels
        assert len(labels) <= 9


# The table on a terminal.


NAMES = ("position_error_max_m", "orientation_error_max_rad", "velocity_error_max_m_s")


def printed(width, table):
    """Lines of the tables on a terminal, without its rules."""
    stream = io.StringIO()
    console = Console(file=stream, width=WIDE)
    sheet = sweep_sheet(["law.kappa"], table, varying_metrics(table))
    for part in sheet_tables(sheet, 1, width):
        console.print(part)
    return [line for line in stream.getvalue().splitlines() if set(line) - set(" ─")]


def test_a_bound_that_is_broken_has_a_mark_without_colours(monkeypatch):
    table = [Row((1,), {"position_error_max_m": 9.9e-6}, None, ("position_error_max_m",))]
    sheet = sweep_sheet(["law.kappa"], table, ["position_error_max_m"])
    stream = io.StringIO()
    monkeypatch.setattr(tables, "out", Console(file=stream, width=80, force_terminal=False))
    monkeypatch.setattr("drake_rnn.cli.console.out", tables.out)
    tables.print_sheet(sheet)
    assert "9.9 µm †" in stream.getvalue()
    assert "† violates its acceptance bound" in stream.getvalue()


def test_no_number_nor_name_of_a_comparison_is_broken_on_a_terminal():
    names = ["adaptive_jerk", "adaptive_moving_obstacle", "slc_nephroid_warm_up"]
    sheet = Sheet((Column(Heading("metric")), *(Column(Heading(n), right=True) for n in names)))
    metrics = ["held_jerk_violation_max_rad_s3", "velocity_bound_joint"]
    for metric in metrics:
        cells = (Cell((1.234e-7 * k,), bound="≤ 1 nrad", kept=k < 2) for k in (1, 2, 3))
        sheet.rows.append((Heading(metric, unit="rad"), *cells))
    stream = io.StringIO()
    parts = sheet_tables(sheet, 1, 80)
    for part in parts:
        Console(file=stream, width=WIDE).print(part)
    text = stream.getvalue()
    assert max(map(len, text.splitlines())) <= 80
    for whole in (*metrics, "0.1234 µrad (≤ 1 nrad)", "0.3702 µrad † (≤ 1 nrad)"):
        # A name is told again with each part of the table, a number once in each of its rows.
        assert text.count(whole) == (len(parts) if whole in metrics else len(metrics))


def test_the_picture_has_the_acceptance_bound(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("drake_rnn.figures.campaign.save", lambda figure, _: drawn.append(figure))
    name, accept = "position_error_max_m", {"position_error_max_m": {"at_most": 3e-6}}
    table = [Row((k,), {name: 1e-6 * k}) for k in (1, 2, 4)]
    sweep_figure(["x"], table, [name], tmp_path / "sweep.png", accept=accept)
    (ax,) = drawn[0].get_axes()
    assert [line.get_ydata()[0] for line in ax.lines if len(line.get_ydata()) == 2] == [3e-6]
    assert ax.get_title("right") == "accepted ≤ 3 µm"


@pytest.mark.parametrize("width", [20, 30, 42, 43, 60, 200])
def test_a_narrow_table_breaks_no_number_and_no_word(width):
    table = [Row((k,), {name: 4.344e-05 * (k + j) for j, name in enumerate(NAMES)}) for k in (1, 2)]
    lines = printed(width, table)
    # The swept value and one metric are always beside one another.
    assert max(map(len, lines)) <= max(width, 30)
    tokens = " ".join(lines).split()
    numbers = {"43.44", "86.88", "0.08688", "0.1303", "0.1738"}
    assert numbers | {"µm", "mrad", "mm/s"} <= {*tokens}
    parts = {f"{part}_" for name in NAMES for part in name.split("_")}
    parts |= {name.split("_")[-1] for name in NAMES}
    for token in {*tokens} - numbers - {"law.kappa", "1", "2", "µm", "mrad", "mm/s"}:
        assert set(re.findall("[^_]*_|[^_]+", token)) <= parts, token
    # What does not fit beside it is told below, with the values it belongs to.
    assert tokens.count("law.kappa") == {20: 3, 30: 3, 42: 3, 43: 2, 60: 1, 200: 1}[width]


def test_a_run_that_failed_is_told_in_each_table():
    table = [Row((1,), {name: 1.0 for name in NAMES}), Row((2,), {}, "lost")]
    assert sum("failed" in line for line in printed(30, table)) == 3


# What is interrupted.


def interrupt_at(monkeypatch, number):
    """Let the run of a number, from 0, be interrupted; return the names of what is simulated."""
    begun = []

    def simulated(experiment, **how):
        begun.append(experiment.document.law["kappa"])
        if len(begun) == number + 1:
            raise InterruptedRunError("interrupted", 0.01)
        return simulate(experiment, **how)

    monkeypatch.setattr(performing, "simulate", simulated)
    return begun


def test_an_interrupted_sweep_has_the_rows_so_far_and_goes_on(tmp_path, monkeypatch):
    begun, told = interrupt_at(monkeypatch, 2), []
    over, keep = {"law.kappa": [1, 2, 4, 8]}, tmp_path / "rows"
    with pytest.raises(InterruptedSweepError, match="2 of 4 runs have ended") as caught:
        sweep(KNOWN, over, SHORT, progress=told.append, keep=keep)
    assert [row.values for row in caught.value.rows] == [(1,), (2,)]
    assert caught.value.missing == [(4,), (8,)]
    again = sweep(KNOWN, over, SHORT, progress=told.append, keep=keep)
    assert begun == [1, 2, 4, 4, 8]
    assert [row.metrics for row in again] == [row.metrics for row in sweep(KNOWN, over, SHORT)]
    # Rows that were kept are told of again, in their place.
    assert [row.values[0] for row in told] == [1, 2, 1, 2, 4, 8]
    # All have ended, so the next sweep is a new one.
    assert not keep.exists()


@pytest.mark.long
def test_an_interrupted_command_writes_what_it_has_and_goes_on(tmp_path, monkeypatch):
    begun = interrupt_at(monkeypatch, 1)
    words = ["sweep", KNOWN, "--over", "law.kappa=1,2,4", "--duration", "0.05", "--out"]
    first = CliRunner().invoke(app, [*words, str(tmp_path)])
    assert first.exit_code == 1
    assert (
        "not run law.kappa=2; law.kappa=4; run the same command again to continue" in first.stderr
    )
    (table,) = tmp_path.rglob("sweep.csv")
    assert len(table.read_text().splitlines()) == 2
    second = CliRunner().invoke(app, [*words, str(tmp_path)])
    assert second.exit_code == 0
    assert begun == [1, 2, 2, 4]
    assert len(table.read_text().splitlines()) == 4
    assert {file.name for file in table.parent.iterdir()} == {"sweep.csv", "sweep.png"}


def test_a_path_is_followed_once_for_all_combinations_that_share_it(monkeypatch):
    """To follow it takes most of the time of a check."""
    followed, follow = [], simulation.check_reach
    monkeypatch.setattr(simulation, "check_reach", lambda e: followed.append(e) or follow(e))
    sweep(KNOWN, {"law.kappa": [1, 2], "path.size": [0.02, 0.04]}, {"duration": 0.01})
    assert len(followed) == 2
