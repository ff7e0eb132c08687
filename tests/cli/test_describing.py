"""What the command line tells of an arm."""

import io
import logging
import re

import pytest
from cli_helpers import call, metrics
from rich.console import Console

from drake_rnn import load_arm
from drake_rnn.cli import tables
from drake_rnn.cli.console import errors
from drake_rnn.cli.presenting import chosen_claims, claims_sheet
from drake_rnn.cli.tables import WIDE, arm_joints_sheet, fitted, sheet_tables
from drake_rnn.models import MODELS
from drake_rnn.robot.load_arm import arm_report

pytestmark = pytest.mark.usefixtures("undrawn")


def test_arm_shows_what_a_shipped_arm_is(tmp_path):
    result = call("arm", "planar6", "--out", tmp_path)
    assert result.exit_code == 0, result.stderr
    for text in ("joint6", "unknown", "home: [0.261799, ", "planar6/limits.yaml", "yes"):
        assert text in result.stdout
    assert result.stderr.startswith("warning acceleration: not known for all joints")
    assert (tmp_path / "planar6.png").stat().st_size > 5000


def test_arm_is_described_where_nothing_can_draw(tmp_path, monkeypatch):
    monkeypatch.setattr("drake_rnn.playback.arm_drawing.rendering_fault", lambda: "no EGL here")
    monkeypatch.chdir(tmp_path)
    result = call("arm", "planar6", "--out", ".")
    assert result.exit_code == 0
    assert "warning no picture planar6.png: no EGL here\n" in result.stderr
    assert "joint6" in result.stdout
    assert not list(tmp_path.iterdir())


def test_arm_lists_the_named_postures_of_an_srdf_file(tmp_path):
    joints = "".join(f'<joint name="joint{k}" value="0.1"/>' for k in range(1, 7))
    (tmp_path / "a.srdf").write_text(
        '<robot name="planar6"><group_state name="ready" group="arm">'
        f"{joints}</group_state></robot>"
    )
    assert list(load_arm("planar6", srdf=str(tmp_path / "a.srdf")).postures)
    result = call("arm", "planar6", "--set", f"srdf={tmp_path}/a.srdf", "--no-picture")
    assert re.search(r"named postures +arm/ready, ready", result.stdout)


@pytest.mark.parametrize("kind", [RuntimeError, SystemExit])
def test_arm_is_described_where_drake_cannot_draw_the_model(tmp_path, monkeypatch, kind):
    """Not so where the file cannot be written, which is refused."""

    def refuse(arm, q):
        raise kind("no such\n mesh")

    monkeypatch.setattr("drake_rnn.playback.arm_drawing._draw_arm", refuse)
    monkeypatch.chdir(tmp_path)
    result = call("arm", "planar6", "--out", ".")
    assert result.exit_code == 0
    told = "warning no picture planar6.png: Drake cannot draw planar6: no such mesh\n"
    assert result.stderr.endswith(told)
    assert "joint6" in result.stdout
    assert not list(tmp_path.iterdir())
    (tmp_path / "file").write_text("")
    assert call("arm", "planar6", "--out", "file").exit_code != 0


@pytest.mark.long
def test_arm_proposes_a_home_that_runs(tmp_path):
    """What it prints is pasted into an experiment; there is a tool, and a joint is locked."""
    model = MODELS / "ur5" / "ur5.urdf"
    tool, lock = "{length: 0.15, mass: 0.3}", "lock={wrist_3_joint: 0.5}"
    arguments = ("--frame", "tool0", "--tool", tool, "--set", lock, "--set", "mass_scale=1.0")
    result = call("arm", model, *arguments, "--no-picture", "--out", tmp_path)
    assert result.exit_code == 0, result.stderr
    assert "0.3 kg on tool0, ball of 12 mm at tip" in result.stdout
    home = re.search(r"home, proposed +(home: \[.*\])", result.stdout)[1]
    file = tmp_path / "mine.yaml"
    file.write_text(
        f"arm: {{model: {model}, frame: tool0, tool: {tool}, lock: {{wrist_3_joint: 0.5}}, "
        f"{home}}}\npath: {{kind: circle, size: 0.02, period: 4}}\nlaw: {{kind: pseudoinverse}}\n"
        "period: 1e-3\nduration: 0.1\n"
    )
    assert call("run", file, "--out", tmp_path, "--no-playback").exit_code == 0
    assert metrics(tmp_path / "mine")["position_error_max_m"] < 1e-3
    assert not list(tmp_path.glob("*.png"))


@pytest.mark.parametrize("width", [60, 80, 120])
def test_no_number_of_an_arm_is_cut_on_a_terminal(width):
    report = arm_report(load_arm("panda"), 10)
    sheet, stream = arm_joints_sheet(report), io.StringIO()
    for part in sheet_tables(sheet, 1, width):
        Console(file=stream, width=WIDE).print(part)
    text = stream.getvalue()
    assert max(map(len, text.splitlines())) <= width
    for row in sheet.rows:
        assert all(each in text for each in row)
    assert "…" not in text


@pytest.mark.parametrize("width", [80, 120, 200])
def test_no_name_in_a_claim_is_broken_on_a_terminal(width, monkeypatch):
    """A table where it has room, else a record for each claim."""
    stream = io.StringIO()
    monkeypatch.setattr(tables, "out", Console(file=stream, width=width, force_terminal=True))
    ((paper, claims),) = chosen_claims(["jdf-T1", "jdf-F2a"])
    sheet = claims_sheet(paper, claims)
    tables.out.print(fitted(sheet))
    words = stream.getvalue().split()
    for row in sheet.rows:
        assert all(word in words for entry in row for word in entry.split())


def test_warnings_of_drake_are_lines_of_ours_each_once(capsys, monkeypatch):
    """Python printed them as WARNING:drake:, also what is idle without deformable bodies."""
    log = logging.getLogger("drake")
    # Whatever this process has set before.
    monkeypatch.setattr(log, "disabled", False)
    monkeypatch.setattr(log, "level", log.level)
    log.setLevel(logging.WARNING)
    handlers, propagates = list(log.handlers), log.propagate
    with errors(), errors():
        log.warning("Meshcat does not display HalfSpace geometry (yet).")
        log.warning("Meshcat does not display HalfSpace geometry (yet).")
        log.warning(
            "Rigid (non-deformable) half spaces are not currently supported for deformable "
            "contact; registration is allowed, but no contact data will be reported."
        )
        log.info("nothing")
    assert capsys.readouterr().err == (
        "warning Drake: Meshcat does not display HalfSpace geometry (yet).\n"
    )
    assert (log.handlers, log.propagate) == (handlers, propagates)
