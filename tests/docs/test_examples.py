"""Every example runs, and says what it is meant to."""

import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
# The last length, angle or force that each prints, and the largest it may be.
LARGEST = {
    "own_diagram.py": 1e-2,
    "plain_loop.py": 1e-3,
    "own_law.py": 1e-3,
    "posture_target.py": 1e-6,
    "hold_in_diagram.py": 1e-6,
    "own_environment.py": 0.2,
    "own_trajectory.py": 2e-6,
    "campaign_on_cluster.py": 1e-8,
    "pose_stream.py": 3e-3,
}


#: Run with robots: `tests/drive/test_policy_to_fr3.py`.
OF_ROBOTS = {"policy_to_fr3.py"}


def test_every_example_is_listed():
    assert {file.name for file in EXAMPLES.glob("*.py")} == set(LARGEST) | OF_ROBOTS


@pytest.mark.long
@pytest.mark.parametrize("name", LARGEST)
@pytest.mark.usefixtures("registries")
def test_example_runs(name, capsys):
    """In this process, but for the one whose own processes import it."""
    if name == "campaign_on_cluster.py":
        line = [sys.executable, EXAMPLES / name]
        said = subprocess.run(line, stdout=subprocess.PIPE, text=True, check=True).stdout
    else:
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        said = capsys.readouterr().out
    *_, number = re.findall(r"(\d[-+.e\d]*) (?:rad|m|N)\b", said)
    assert float(number) <= LARGEST[name]


def test_the_page_of_python_shows_the_examples_as_they_are():
    """So that what the page promises is what runs."""
    page = (EXAMPLES.parent / "docs" / "python.md").read_text()
    for name in ("own_diagram.py", "plain_loop.py"):
        code = (EXAMPLES / name).read_text().split('"""\n', 1)[1].strip()
        assert code in page
