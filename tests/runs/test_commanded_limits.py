"""What is said of an arm that passes a limit which the law keeps of its command alone."""

from io import StringIO

import pytest
from rich.console import Console

from drake_rnn.cli.tables import metrics_table
from drake_rnn.playback.page import outcome_of
from shared_runs import shared_run

SHORT = {"duration": 0.6, "window": None, "accept": None}


def _table(result):
    console = Console(width=200, file=StringIO())
    console.print(metrics_table(result))
    lines = console.file.getvalue().splitlines()
    return {line.split()[0]: " ".join(line.split()) for line in lines if line.split()}


@pytest.mark.long
def test_motors_that_pass_the_commands_limits_are_told_in_the_warning_the_table_and_the_playback():
    result = shared_run("slc_nephroid_known", {**SHORT, "level": "dynamic"})
    assert result.metrics["limit_ratio_2_max"] > 1.001
    said = f"acceleration by {result.metrics['acceleration_violation_max_rad_s2']:.3g} rad/s^2"
    assert any(said in warning and "of the command" in warning for warning in result.warnings)
    assert "≤ 1 (command) the arm passed it" in _table(result)["limit_ratio_2_max"]
    limits = {limit["name"]: limit for limit in outcome_of(result)["limits"]}
    assert not limits["acceleration"]["kept"]
    assert "the law keeps it of its command alone" in limits["acceleration"]["text"]


def test_an_arm_that_moves_as_commanded_has_a_bound_instead():
    result = shared_run("slc_nephroid_known", SHORT)
    assert result.warnings == []
    row = _table(result)["limit_ratio_2_max"]
    assert "≤ 1 ok" in row
    assert row.endswith("ok")
