"""A metric is written in one place, and is then taken in Drake, in batches and compiled."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import drake_rnn
from process_helpers import PATIENCE

ENTRY = """_OWN_METRICS: tuple[Metric, ...] = (
    Metric(
        "joint_speed_rms_rad_s",
        "root mean square of the joints' speeds",
        of=lambda motion, against: mean(motion.speed**2),
        by=RootMean,
    ),
"""
RUNS = """
import numpy as np
from drake_rnn import load_experiment, run_campaign, run_many, simulate, value_and_gradient

NAME = "joint_speed_rms_rad_s"
changes = {"duration": 0.05, "window": None, "accept": {NAME: {"at_most": 10.0}}}
experiment = load_experiment("slc_nephroid_known", changes)
drake = simulate(experiment).metrics[NAME]
assert 0.0 < drake < 10.0
assert abs(run_many([experiment]).row(0)[NAME] / drake - 1.0) < 1e-9
document = {"experiment": experiment.document.contents(), "vary": {"law.kappa": [30.0, 60.0]}}
rows = run_campaign(document, "rows", jobs=0).lines
assert len({row.outcome.metrics[NAME] for row in rows}) == 2, rows
try:
    value, slopes = value_and_gradient(experiment, ["law.kappa"], NAME)
except Exception as error:
    assert "needs jax, which is not installed" in str(error), error
else:
    assert abs(value / drake - 1.0) < 1e-9
    assert slopes["law.kappa"] != 0.0
"""


@pytest.fixture
def package(tmp_path):
    """A copy of the package with one more entry in its list of metrics."""
    whole = Path(drake_rnn.__file__).parent
    shutil.copytree(whole, tmp_path / "drake_rnn", ignore=shutil.ignore_patterns("__pycache__"))
    place = tmp_path / "drake_rnn" / "measures" / "metrics.py"
    text = place.read_text()
    assert text.count(ENTRY.splitlines()[0]) == 1
    place.write_text(text.replace(ENTRY.splitlines()[0] + "\n", ENTRY))
    return tmp_path


@pytest.mark.long
def test_a_metric_added_to_the_list_is_taken_everywhere(package):
    done = subprocess.run(
        [sys.executable, "-c", RUNS], cwd=package, capture_output=True, text=True, timeout=PATIENCE
    )
    assert done.returncode == 0, done.stderr
