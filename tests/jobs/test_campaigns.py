"""Campaigns as they are run: in this process, in two, and by the command line."""

import csv
import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import active_children
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from drake_rnn import InvalidInputError, simulate
from drake_rnn.cli.commands import app
from drake_rnn.cli.tables import groups_sheet
from drake_rnn.experiment import load_experiment, parse_change
from drake_rnn.figures.campaign import distribution_figure, sensitivity_figure, strongest
from drake_rnn.inputs.documents import to_yaml
from drake_rnn.jobs import RunRecord, pool, run_campaign
from drake_rnn.jobs import campaign as execution
from drake_rnn.jobs.pool import ThisProcess
from drake_rnn.jobs.summary import Line, format_values, group_by, read_lines
from drake_rnn.tables import Cell
from process_helpers import PATIENCE, assert_gone, wait_for

DAMPING = {"kind": "log_uniform", "low": 1e-6, "high": 1e-2}
LINE = {
    "name": "lines",
    "method": "simulate",
    "experiment": "pinv_line",
    "changes": {"duration": 0.05, "accept": {"position_error_max_m": {"at_most": 1e-8}}},
    "vary": {"law.damping": DAMPING, "path.by": [[0.1, 0.2, 0.1], [0.05, 0.1, 0.0]]},
    "samples": 3,
}
#: Of each fate one, among others that live.
FATAL = {
    "name": "fates",
    "experiment": "pinv_line",
    "changes": {"duration": 0.05, "law.kind": "fatal_law:Fatal"},
    "vary": {"law.fate": ["live", "kill", "fail", "live"], "seed": [1, 2, 3, 4]},
    "together": [["law.fate", "seed"]],
}


def rows(folder):
    with (folder / "table.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture
def in_this_process(monkeypatch):
    """Commands run their campaigns here: a process of its own imports everything first."""
    monkeypatch.setattr(pool, "Processes", lambda jobs: ThisProcess())


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The folder of a campaign that ran through, in this process."""
    folder = tmp_path_factory.mktemp("undisturbed")
    assert run_campaign(LINE, folder, jobs=0).ending == "complete"
    return folder


def test_a_table_has_a_row_for_each_with_the_numbers_of_that_run_alone(undisturbed):
    table = rows(undisturbed)
    assert [row["row"] for row in table] == [str(k) for k in range(6)]
    for row in table:
        changes = {"law.damping": float(row["law.damping"]), "path.by": json.loads(row["path.by"])}
        alone = simulate(load_experiment("pinv_line", LINE["changes"] | changes))
        for name, value in alone.metrics.items():
            assert float(row[name]) == value
        assert row["status"] == "complete"
        assert (row["not_kept"] == "") is alone.verdicts[0].met


@pytest.mark.long
def test_two_processes_make_the_same_table_to_the_last_bit(undisturbed, tmp_path):
    result = run_campaign(LINE, tmp_path, jobs=2)
    assert result.ending == "complete"
    assert (tmp_path / "table.csv").read_bytes() == (undisturbed / "table.csv").read_bytes()


@pytest.mark.long
def test_any_executor_will_do(undisturbed, tmp_path):
    with ThreadPoolExecutor(1) as executor:
        run_campaign(LINE, tmp_path, executor=executor)
    assert (tmp_path / "table.csv").read_bytes() == (undisturbed / "table.csv").read_bytes()


def test_it_goes_on_where_it_was_interrupted_and_runs_nothing_twice(
    undisturbed, tmp_path, simulated
):
    ended = []

    def interrupt(number, runs, outcome):
        ended.append(number)
        if number == 2:
            raise KeyboardInterrupt

    first = run_campaign(LINE, tmp_path, jobs=0, progress=interrupt)
    assert (first.ending, first.missing, len(rows(tmp_path))) == ("interrupted", 4, 2)
    second = run_campaign(LINE, tmp_path, jobs=0)
    assert (second.ending, second.kept, len(simulated)) == ("complete", 2, 6)
    assert (tmp_path / "table.csv").read_bytes() == (undisturbed / "table.csv").read_bytes()
    run_campaign(LINE, tmp_path, jobs=0)
    assert len(simulated) == 6


def test_more_samples_run_only_what_is_new(tmp_path, simulated):
    run_campaign(LINE, tmp_path, jobs=0)
    run_campaign({**LINE, "samples": 4}, tmp_path, jobs=0)
    assert len(simulated) == 8
    # Rows of another document are there, and not in the table.
    run_campaign({**LINE, "samples": 1}, tmp_path, jobs=0)
    assert (len(simulated), len(rows(tmp_path))) == (8, 2)


def test_a_worse_row_is_repeated_by_its_command(undisturbed):
    result = run_campaign(LINE, undisturbed, jobs=0)
    (errors,) = [m for m in result.summary.metrics if m.name == "position_error_max_m"]
    assert errors.worst[0].value == errors.largest
    words = shlex.split(errors.worst[0].command)
    changes = dict(parse_change(change) for change in words[4::2])
    again = simulate(load_experiment(words[2], changes))
    assert again.metrics["position_error_max_m"] == errors.largest
    # The damping decides about the error, more than where the line leads.
    assert strongest(errors) == "law.damping"


@pytest.mark.long
def test_a_run_that_fails_or_is_refused_is_a_row(tmp_path):
    vary = {"law.fate": ["live", "fail"], "path.by": [[0.1, 0.2, 0.1], [3.0, 0.0, 0.0]]}
    changes = {"duration": 4.5, "law.kind": "fatal_law:Fatal"}
    campaign = {**FATAL, "vary": vary, "changes": changes, "together": []}
    result = run_campaign(campaign, tmp_path, jobs=0)
    assert result.ending == "complete"
    found = rows(tmp_path)
    assert [row["status"] for row in found] == ["complete", "refused", "failed", "refused"]
    assert found[1]["failure"].startswith("path: out of reach")
    assert found[2]["failure"].startswith("controller: Fatal.step raised ValueError: its time has")
    # What it had until then is there.
    assert float(found[2]["until_s"]) == pytest.approx(0.011, abs=2e-3)
    assert found[2]["position_error_max_m"]
    assert result.summary.shares["all bounds"].value == 0.25


@pytest.mark.long
def test_a_run_that_kills_its_worker_is_named_and_disturbs_no_other(tmp_path, undisturbed):
    result = run_campaign(FATAL, tmp_path, jobs=2)
    assert result.ending == "complete"
    statuses = [row["status"] for row in rows(tmp_path)]
    assert statuses == ["complete", "killed its worker", "failed", "complete"]
    assert run_campaign(FATAL, tmp_path, jobs=2).kept == 4


@pytest.mark.long
def test_a_run_that_loses_its_worker_once_is_run_again(tmp_path):
    changes = {**FATAL["changes"], "law.mark": str(tmp_path / "mark")}
    campaign = {**FATAL, "changes": changes, "vary": {"law.fate": ["live", "once"]}, "together": []}
    run_campaign(campaign, tmp_path, jobs=1)
    assert [row["status"] for row in rows(tmp_path)] == ["complete", "complete"]


def test_a_worker_of_other_versions_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(execution, "stamp", lambda: "drake-rnn 9")
    with pytest.raises(InvalidInputError, match=r"^worker: has drake-rnn 9; the campaign was"):
        run_campaign(LINE, tmp_path, jobs=0)


def test_what_is_no_executor_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match="executor: must have a method submit; int has"):
        run_campaign(LINE, tmp_path, executor=3)


# The command line.


@pytest.fixture
def file(tmp_path):
    """A campaign's document."""
    file = tmp_path / "lines.yaml"
    file.write_text(to_yaml(LINE))
    return file


def call(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.mark.long
def test_the_command_writes_table_and_summary(file, tmp_path):
    result = call("campaign", file, "--out", tmp_path, "--samples", 2)
    assert result.exit_code == 0, result.stderr
    folder = tmp_path / "campaign_lines"
    assert {each.name for each in folder.iterdir()} == {
        *("rows", "table.csv", "summary.html", "campaign.json"),
        *("campaign.yaml", "experiment.yaml"),
    }
    assert result.stdout.startswith("lines: 4 rows: 4 complete\n")
    page = (folder / "summary.html").read_text()
    assert "position_error_max_m" in page
    assert "drake-rnn run" in page
    assert page.count("data:image/png;base64,") == 2
    assert "http" not in page
    # What it has written runs again, without a run.
    again = call("campaign", folder / "campaign.yaml", "--out", tmp_path)
    assert again.stdout.startswith("lines: 4 rows: 4 complete, 4 of them from before\n")


@pytest.mark.usefixtures("in_this_process")
def test_with_check_a_bound_that_is_not_kept_ends_with_3(file, tmp_path):
    options = ("--out", tmp_path, "--samples", 1, "--check")
    loose = "accept={position_error_max_m: {at_most: 1}}"
    assert call("campaign", file, *options, "--set", loose).exit_code == 0
    tight = "accept={position_error_max_m: {at_most: 1e-30}}"
    assert call("campaign", file, *options, "--set", tight).exit_code == 3


@pytest.mark.usefixtures("in_this_process")
def test_json_holds_the_summary_alone(file, tmp_path):
    result = call("campaign", file, "--out", tmp_path, "--samples", 1, "--json")
    found = json.loads(result.stdout)
    assert found["statuses"] == {"complete": 2}
    assert found["metrics"]["position_error_max_m"]["quantiles"]["0.5"]["low"] is None
    assert result.stderr == ""


def test_a_dry_run_counts_and_runs_nothing(file, tmp_path):
    result = call("campaign", file, "--out", tmp_path, "--dry-run", "--json")
    plan = json.loads(result.stdout)
    assert (plan["rows"], plan["runs"], plan["kept"]) == (6, 6, 0)
    assert plan["expected_time_s"] > 0
    assert not (tmp_path / "campaign_lines").exists()
    assert "6 rows; about" in call("campaign", file, "--out", tmp_path, "--dry-run").stdout


@pytest.mark.usefixtures("in_this_process")
def test_quiet_is_quiet(file, tmp_path):
    result = call("campaign", file, "--out", tmp_path, "--samples", 1, "--quiet")
    assert (result.exit_code, result.output) == (0, "")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nowhere",), "campaign: no campaign 'nowhere'"),
        (("line_starts", "--set", "law.damping=3"), "--set: 'law.damping' varies in this"),
        (("line_starts", "--set", "law.dampign=3"), "law.dampign: no such key"),
        (
            ("line_starts", "--scheduler", "tcp://127.0.0.1:1"),
            "--scheduler: no scheduler answers at",
        ),
    ],
)
def test_bad_input_is_one_sentence(arguments, message, tmp_path, monkeypatch):
    monkeypatch.setattr("drake_rnn.jobs.pool._PATIENCE", 0.5)
    result = call("campaign", *arguments, "--samples", 1, "--out", tmp_path)
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"error {message}")


def test_without_dask_its_option_says_what_to_install(tmp_path, monkeypatch):
    # What stands as None among the modules cannot be imported.
    monkeypatch.setitem(sys.modules, "distributed", None)
    result = call("campaign", "line_starts", "--scheduler", "tcp://x:1", "--out", tmp_path)
    assert result.stderr == (
        "error --scheduler: needs distributed, which is not installed: "
        "pip install 'distributed>=2024.8'\n"
    )


# Signals, in processes of their own.


def started(file, out, *options):
    command = [sys.executable, "-m", "drake_rnn", "campaign", file, "--out", out, *options]
    return subprocess.Popen(
        [str(word) for word in command],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def kept(out):
    return len(list((out / "campaign_lines" / "rows").rglob("*.json")))


def wait_while(process, condition):
    """Wait until a condition holds, or the process has ended."""
    assert wait_for(lambda: condition() or process.poll() is not None)


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_what_is_stopped_says_what_was_not_run_and_leaves_no_process(file, tmp_path, number):
    process = started(file, tmp_path, "--jobs", 1, "--samples", 40)
    wait_while(process, lambda: kept(tmp_path) >= 2)
    # As Ctrl-C in a terminal, to all of its processes.
    os.killpg(process.pid, number)
    _, complained = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, complained
    ended = kept(tmp_path)
    assert f"not run {80 - ended} of 80 rows: interrupted; run the same command again" in complained
    assert len(rows(tmp_path / "campaign_lines")) == ended >= 2
    assert "Traceback" not in complained
    assert_gone(process.pid)


def disturbed(file, out, victims):
    """Run a campaign and kill it each time a number of rows are kept, until it ends."""
    for count in victims:
        process = started(file, out, "--jobs", 2)
        wait_while(process, lambda count=count: kept(out) >= count)
        process.kill()
        process.communicate()
        assert_gone(process.pid)
    process = started(file, out, "--jobs", 2)
    process.communicate()
    assert process.returncode == 0


@pytest.mark.long
def test_killed_with_9_it_goes_on_and_the_table_is_the_same(file, tmp_path, undisturbed):
    disturbed(file, tmp_path / "out", [2])
    table = (tmp_path / "out" / "campaign_lines" / "table.csv").read_bytes()
    assert table == (undisturbed / "table.csv").read_bytes()


@pytest.mark.nightly
def test_killed_at_ten_moments_the_table_is_the_same(tmp_path):
    """The process itself and its workers, at random, by fixed seeds."""
    campaign = {**LINE, "samples": 30}
    (tmp_path / "lines.yaml").write_text(to_yaml(campaign))
    run_campaign(campaign, tmp_path / "alone", jobs=0)
    rng = np.random.default_rng(0)
    disturbed(tmp_path / "lines.yaml", tmp_path / "out", np.sort(rng.integers(1, 55, 5)).tolist())
    table = (tmp_path / "out" / "campaign_lines" / "table.csv").read_bytes()
    assert table == (tmp_path / "alone" / "table.csv").read_bytes()
    killed = []

    def kill(ended, runs, outcome):
        children = [child.pid for child in active_children()]
        if ended % 12 == 5 and children:
            killed.append(ended)
            os.kill(children[int(rng.integers(len(children)))], signal.SIGKILL)

    run_campaign(campaign, tmp_path / "workers", jobs=2, progress=kill)
    assert len(killed) == 5
    assert (tmp_path / "workers" / "table.csv").read_bytes() == table


@pytest.mark.long
def test_a_worker_killed_with_9_costs_nothing(tmp_path, undisturbed):
    killed = []

    def kill(ended, runs, outcome):
        if ended == 2:
            killed.extend(child.pid for child in active_children())
            for pid in killed:
                os.kill(pid, signal.SIGKILL)

    result = run_campaign(LINE, tmp_path, jobs=2, progress=kill)
    assert killed
    assert result.summary.statuses == {"complete": 6}
    assert (tmp_path / "table.csv").read_bytes() == (undisturbed / "table.csv").read_bytes()


# Groups.

GROUPS = LINE | {
    "name": "groups",
    "vary": {
        "law": [
            {"kind": "pseudoinverse", "damping": 1e-3},
            {"kind": "pseudoinverse", "damping": 1e-2},
            {"kind": "zeroing"},
        ],
        "path.by": {"kind": "uniform", "low": [0.05, 0.1, 0.0], "high": [0.1, 0.2, 0.1]},
    },
    "samples": 3,
    "metrics": ["position_error_max_m", "joint_velocity_max_rad_s"],
}


@pytest.fixture(scope="module")
def groups(tmp_path_factory):
    """A campaign over laws of two kinds, as a document and the folder that it was run to."""
    folder = tmp_path_factory.mktemp("groups")
    (folder / "groups.yaml").write_text(to_yaml(GROUPS))
    return folder / "groups.yaml", run_campaign(GROUPS, folder / "campaign", jobs=0)


def test_rows_are_grouped_by_what_varies_and_what_is_inside_of_it(groups):
    _, result = groups
    one, other = result.groups("law.kind")
    assert (one.values, one.rows, one.complete) == (("pseudoinverse",), 6, 6)
    assert (other.values, other.rows, other.complete) == (("zeroing",), 3, 3)
    # The numbers are those of the table.
    table = [row for row in rows(result.folder) if '"zeroing"' in row["law"]]
    values = np.array([float(row["position_error_max_m"]) for row in table])
    spread = other.metrics["position_error_max_m"]
    assert spread.mean == pytest.approx(values.mean(), rel=1e-14)
    assert spread.deviation == pytest.approx(np.std(values, ddof=1), rel=1e-12)
    assert spread.quantiles[0.5] == np.median(values)
    assert [group.values for group in result.groups("law.kind", "law.damping")] == [
        ("pseudoinverse", "0.001"), ("pseudoinverse", "0.01"), ("zeroing", "-"),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("by", "message"),
    [
        (("law.knid",), "by: law.knid does not vary; nearest: law.kind, law, law.damping"),
        (("arm",), "by: arm does not vary; it may be law, law.kind, law.damping, path.by"),
        (("law", "law"), "by: law is given twice"),
    ],
)
def test_what_does_not_vary_is_refused(groups, by, message):
    with pytest.raises(InvalidInputError) as refused:
        groups[1].groups(*by)
    assert str(refused.value) == message


def test_one_run_has_no_deviation_and_failures_are_counted_apart():
    values = {"law.kind": "zeroing"}
    ended = [
        Line(0, values, RunRecord("complete", metrics={"position_error_max_m": 2.0})),
        Line(1, values, RunRecord("failed", "it fell", metrics={"position_error_max_m": 9.0})),
    ]
    (group,) = group_by(ended, ["law.kind"], ["position_error_max_m"])
    spread = group.metrics["position_error_max_m"]
    assert (group.rows, group.complete, spread.count, spread.mean) == (2, 1, 1, 2.0)
    assert np.isnan(spread.deviation)
    assert groups_sheet(["law.kind"], [group], ["position_error_max_m"], "mean").rows == [
        ("zeroing", "1 of 2", Cell((2.0,)))
    ]


def test_a_table_is_read_back_as_it_was_written(groups):
    _, result = groups
    read = read_lines(result.folder / "table.csv")
    assert [line.values for line in read] == [line.values for line in result.lines]
    assert [line.record.metrics for line in read] == [
        {name: line.record.metrics[name] for name in GROUPS["metrics"]} for line in result.lines
    ]
    assert [line.record.not_met for line in read] == [line.record.not_met for line in result.lines]


def test_a_kept_campaign_is_grouped_into_a_table_and_a_figure_without_a_run(groups, tmp_path):
    _, result = groups
    shutil.copytree(result.folder, tmp_path / "kept")
    # Whoever receives it needs neither the rows nor the experiment.
    shutil.rmtree(tmp_path / "kept/rows")
    (tmp_path / "kept/experiment.yaml").unlink()
    tables = [part for end in ("md", "tex") for part in ("--table", tmp_path / f"by.{end}")]
    found = call("campaign", tmp_path / "kept", "--by", "law.kind,law.damping", *tables)
    assert found.exit_code == 0, (found.stderr, found.exception)
    assert "groups: 9 rows, from before" in found.stdout
    assert "mean ± standard deviation" in found.stdout
    (head, *lines) = (tmp_path / "by.md").read_text().splitlines()[:5]
    assert head.startswith("| law.kind | law.damping | runs | position error max [")
    assert lines[1].startswith("| pseudoinverse | 0.001 | 3 | ")
    assert " ± " in lines[1]
    assert r"$\pm$" in (tmp_path / "by.tex").read_text()
    assert (tmp_path / "kept/groups.png").stat().st_size > 5000
    with (tmp_path / "kept/groups.csv").open(newline="") as stream:
        (first, *_) = csv.DictReader(stream)
    group = result.groups("law.kind", "law.damping")[0]
    assert float(first["deviation"]) == group.metrics[first["metric"]].deviation
    by_law = ("campaign", tmp_path / "kept", "--by", "law.kind")
    labels = ("--labels", "law.kind=Law,ours,theirs", "--table", tmp_path / "named.tex")
    assert call(*by_law, *labels).exit_code == 0
    _, _, _, head, _, row, *_ = (tmp_path / "named.tex").read_text().splitlines()
    assert head.startswith("Law & runs & ")
    assert row.startswith("ours & 6 & ")
    with (tmp_path / "kept/groups.csv").open(newline="") as stream:
        assert next(csv.DictReader(stream))["law.kind"] == "pseudoinverse"
    refused = call(*by_law, "--labels", "ours")
    assert refused.stderr.startswith("error --labels: must have one name for each of 2 groups (")
    wrong = call("campaign", tmp_path / "kept", "--by", "law.knid")
    assert wrong.stderr == "error by: law.knid does not vary; nearest: law.kind, law, law.damping\n"


@pytest.mark.long
def test_options_that_choose_what_is_shown_do_not_change_what_is_stored(tmp_path):
    document = {name: value for name, value in GROUPS.items() if name != "metrics"}
    (tmp_path / "shown.yaml").write_text(to_yaml({**document, "name": "shown", "samples": 1}))
    arguments = ("campaign", tmp_path / "shown.yaml", "--out", tmp_path)
    folder = tmp_path / "campaign_shown"
    options = ("--by", "law.kind", "--statistic", "quantiles", "--metrics", "position_error_max_m")
    found = call(*arguments, *options)
    assert found.exit_code == 0, (found.stderr, found.exception)
    assert "position_error_max_m" in found.stdout
    assert "joint_velocity_max_rad_s" not in found.stdout
    assert "metrics:" not in (folder / "campaign.yaml").read_text()
    again = call("campaign", folder, "--by", "law.kind", "--metrics", "joint_velocity_max_rad_s")
    assert again.exit_code == 0, (again.stderr, again.exception)
    assert "velocity" in again.stdout
    missing = ("--metrics", "pixel_error_max_px")
    message = "error --metrics: no row of shown has pixel_error_max_px; "
    assert call("campaign", folder, *missing).stderr.startswith(message)


def test_campaigns_are_compared(groups, tmp_path):
    _, result = groups
    shutil.copytree(result.folder, tmp_path / "other")
    arguments = ("--labels", "a,b", "--statistic", "quantiles", "--out", tmp_path)
    found = call("compare", result.folder, tmp_path / "other", *arguments)
    assert found.exit_code == 0, (found.stderr, found.exception)
    assert "0.5 quantile [0.05, 0.95]" in found.stdout
    folder = tmp_path / "compare_a_b"
    assert {file.name for file in folder.iterdir()} == {"comparison.csv", "comparison.png"}
    with (folder / "comparison.csv").open(newline="") as stream:
        lines = list(csv.DictReader(stream))
    assert [line["run"] for line in lines] == ["a", "a", "b", "b"]
    assert lines[0]["mean"] == lines[2]["mean"]
    (wrong,) = call("compare", result.folder, "pinv_line").stderr.splitlines()
    assert wrong == (
        "error compare: pinv_line: there is no such folder; beside a campaign, give folders of "
        "runs or campaigns"
    )


def test_campaigns_are_compared_group_by_group(groups, tmp_path):
    _, result = groups
    shutil.copytree(result.folder, tmp_path / "other")
    table = tmp_path / "table.md"
    options = ("--labels", "a,b", "--by", "law.kind", "--out", tmp_path, "--table", table)
    found = call("compare", result.folder, tmp_path / "other", *options)
    assert found.exit_code == 0, (found.stderr, found.exception)
    rows = [line.split(" | ")[:3] for line in table.read_text().splitlines()[2:6]]
    kinds = ("pseudoinverse", "zeroing")
    assert rows == [[f"| {k}", n, "6" if k == kinds[0] else "3"] for k in kinds for n in "ab"]
    wrong = call("compare", result.folder, tmp_path / "other", "--by", "law.knid").stderr
    assert wrong.startswith("error by: law.knid does not vary; nearest: law.kind")
    wrong = call("compare", "pinv_line", "pinv_csv", "--by", "law.kind").stderr
    assert wrong == "error --by: groups rows of campaigns, and none of these is one\n"


def test_groups_are_in_the_order_of_their_keys_and_numbers_are_short():
    noise = [1.2345678901234567e-05, 0.1, 2.0, 10.0]
    lines = [
        Line(0, {"arm": arm, "noise": x, "law": {"kind": kind}}, RunRecord("complete"))
        for x in reversed(noise)
        for arm in ("ur5", "panda")
        for kind in ("b", "a")
    ]
    grouped = group_by(lines, ["law.kind", "noise"], [])
    expected = [(kind, json.dumps(x)) for kind in "ba" for x in noise]
    assert [group.values for group in grouped] == expected
    assert format_values(grouped)[0] == ("b", "1.235e-05")
    # Digits that tell groups apart stay.
    near = [Line(0, {"x": x}, RunRecord("complete")) for x in (1.00001, 1.00002)]
    assert format_values(group_by(near, ["x"], [])) == [("1.00001",), ("1.00002",)]


@pytest.mark.parametrize(
    ("mean", "deviation", "text"),
    [
        (7.13512, 0.0007126, "7.13512 ± 0.00071"),
        (1.0, 5.559e-14, "1 ± 0"),
        (2.0, 0.0, "2 ± 0"),
        (0.0123456, 0.00456, "0.0123 ± 0.0046"),
        (2.3661e-05, 1.2345e-07, "2.366e-05 ± 1.2e-07"),
        (123456.0, 7890.0, "123500 ± 7900"),
        (0.0, 0.5, "0.00 ± 0.50"),
        (9.99e-6, 3e-3, "0.0000 ± 0.0030"),
    ],
)
def test_digits_of_a_mean_end_where_those_of_its_deviation_do(mean, deviation, text):
    assert str(Cell((mean, deviation), "{} ± {}")) == text


@pytest.mark.long
def test_the_folder_of_a_stopped_campaign_says_how_to_go_on(groups, tmp_path):
    """And that command runs only what is missing, to the same table."""
    _, result = groups
    folder = tmp_path / "campaign_groups"
    shutil.copytree(result.folder, folder)
    table = (folder / "table.csv").read_bytes()
    (folder / "table.csv").unlink()
    for record in list((folder / "rows").rglob("*.json"))[:2]:
        record.unlink()
    (said,) = call("campaign", folder, "--by", "law.kind").stderr.splitlines()
    command = f"drake-rnn campaign {folder}/campaign.yaml --out {tmp_path}"
    assert said == (
        f"error campaign: {folder} is the folder of a campaign that was stopped; `{command}` "
        "goes on with it"
    )
    found = call(*command.split()[1:])
    assert found.exit_code == 0, (found.stderr, found.exception)
    assert "7 of them from before" in found.stdout
    assert (folder / "table.csv").read_bytes() == table
    (said,) = call("run", folder).stderr.splitlines()
    assert "is the folder of a campaign; `drake-rnn campaign` and `compare` take it" in said


def test_figures_of_runs_that_diverged_to_the_largest_numbers_are_drawn(tmp_path):
    """As an unstable network's accelerations are, 1e307 rad/s^2; a margin beyond has no number."""
    name, key = "joint_acceleration_max_rad_s2", "law.gain"
    values = [3.0, 10.0, 7.8e307, 20.0, 5.0, 1.7e308]
    lines = [
        SimpleNamespace(
            values={key: float(k)},
            record=SimpleNamespace(complete=True, status="complete", metrics={name: value}),
        )
        for k, value in enumerate(values)
    ]
    metric = SimpleNamespace(name=name, count=len(values), correlations={key: 0.5})
    summary = SimpleNamespace(metrics=[metric])
    assert distribution_figure(summary, lines, {}, tmp_path / "distribution.png")
    assert sensitivity_figure(summary, lines, {}, tmp_path / "sensitivity.png")
