"""Every example runs, and says what it is meant to."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
# The number each prints, and the largest it may be.
LARGEST = {
    "own_diagram.py": 1e-2,
    "plain_loop.py": 1e-3,
    "own_law.py": 1e-3,
    "posture_target.py": 1e-6,
    "hold_in_diagram.py": 1e-6,
    "own_environment.py": 0.2,
}


def test_every_example_is_listed():
    assert {file.name for file in EXAMPLES.glob("*.py")} == set(LARGEST)


@pytest.mark.parametrize("name", LARGEST)
def test_example_runs(name):
    run = subprocess.run(
        [sys.executable, EXAMPLES / name], capture_output=True, text=True, timeout=120, check=False
    )
    assert run.returncode == 0, run.stderr
    number = float(re.search(r"[-+.e\d]*\d(?= (?:rad|m|N)$)", run.stdout.strip()).group())
    assert number <= LARGEST[name]


def test_the_readme_shows_the_examples_as_they_are():
    """So that what the README promises is what runs."""
    readme = (EXAMPLES.parent / "README.md").read_text()
    for name in ("own_diagram.py", "plain_loop.py"):
        code = (EXAMPLES / name).read_text().split('"""\n', 1)[1].strip()
        assert code in readme
