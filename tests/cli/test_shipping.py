"""A law of the package itself: `drake-rnn new law NAME --shipped`, and what works with it then."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from drake_rnn.cli.commands import app

ROOT = Path(__file__).parents[2]
#: What the command adds to, and what it makes; nothing else knows a law.
ENTERED = [
    "drake_rnn/laws/__init__.py",
    "drake_rnn/__init__.pyi",
    "docs/choosing.md",
    "diagrams/experiments/README.md",
    "CHANGELOG.md",
]
MADE = [
    "drake_rnn/laws/{}.py",
    "diagrams/experiments/{}/{}.yaml",
    "tests/laws/test_{}.py",
    "docs/schemes/{}.md",
]


def ship(name, *more):
    return CliRunner().invoke(app, ["new", *more, "law", name, "--shipped"])


@pytest.fixture
def sources(tmp_path, monkeypatch):
    """The files that the command adds to, and the folders that it writes to."""
    for file in ENTERED:
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, tmp_path / file)
    for folder in ("tests/laws", "docs/schemes"):
        (tmp_path / folder).mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_it_says_all_the_places_that_know_a_law(sources):
    result = ship("dual_net_2")
    assert result.exit_code == 0, result.stderr
    places = [file.format("dual_net_2", "dual_net_2") for file in MADE] + ENTERED
    *told, last = result.stdout.splitlines()
    assert told == [f"written  {place}" for place in places]
    assert last.startswith("next     fill in what says FILL IN; python docs/make_schemes.py; ")
    for place in places:
        text = (sources / place).read_text()
        assert re.search("dual_net_2|DualNet2|Dual net 2", text), place
        old = (ROOT / place).read_text() if place in ENTERED else ""
        assert len(re.findall("(?i)my_?law|my law", text)) == len(
            re.findall("(?i)my_?law|my law", old)
        )
    added = [
        line
        for file in ENTERED[:2]
        for line in (sources / file).read_text().splitlines()
        if line not in (ROOT / file).read_text().splitlines()
    ]
    assert [line.strip() for line in added] == [
        "from .dual_net_2 import DualNet2",
        '"dual_net_2": DualNet2,',
        '"DualNet2",',
        "DualNet2 as DualNet2,",
    ]


@pytest.mark.parametrize("name", ["absolutely_first", "motion_forces", "zz_last"])
def test_imports_and_names_stay_in_their_order(sources, name):
    assert ship(name).exit_code == 0
    ruff = [sys.executable, "-m", "ruff", "check", "--no-cache", "--isolated", "--line-length=100"]
    # The stub lends several names in a line.
    order = ["--select=I,RUF022,E501", "--config", "lint.isort.combine-as-imports=true"]
    files = [*ENTERED[:2], MADE[0].format(name), MADE[2].format(name)]
    subprocess.run([*ruff, *order, *files], check=True, capture_output=True)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("recursive", "name: drake_rnn has Recursive already; take another"),
        ("circle", "name: drake_rnn has Circle already; take another"),
        ("my-law", "name: must be a module's name in lower case, e.g. my_law, not 'my-law'"),
    ],
)
def test_a_name_that_is_taken_or_none_is_refused(sources, name, said):
    result = ship(name)
    assert result.exit_code == 2
    assert result.stderr == f"error {said}\n"
    assert not list(sources.glob("docs/schemes/*"))


def test_without_sources_or_for_a_path_it_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = ship("mine")
    assert result.exit_code == 2
    assert "--shipped: needs the sources of drake_rnn in the current folder" in result.stderr
    result = CliRunner().invoke(app, ["new", "path", "mine", "--shipped"])
    assert "--shipped: is for a law, not for path" in result.stderr
    assert not list(tmp_path.iterdir())


def test_a_name_of_a_package_of_laws_is_refused(sources):
    """A package hides a module of its name."""
    (sources / "drake_rnn/laws/parts").mkdir()
    assert ship("parts").stderr.startswith("error drake_rnn/laws/parts: is there already")


def test_without_a_file_that_every_law_is_entered_in_it_is_refused(sources):
    (sources / "CHANGELOG.md").unlink()
    assert ship("mine").stderr.endswith("in the current folder; CHANGELOG.md is not there\n")


def test_a_file_that_is_there_or_has_no_place_is_named_and_nothing_is_written(sources):
    choosing = sources / "docs/choosing.md"
    text = choosing.read_text()
    choosing.write_text("# Another page\n")
    before = {file: file.read_text() for file in sources.rglob("*") if file.is_file()}
    result = ship("mine")
    assert result.exit_code == 2
    assert result.stderr.startswith("error docs/choosing.md: has no '")
    assert before == {file: file.read_text() for file in sources.rglob("*") if file.is_file()}
    choosing.write_text(text)
    (sources / "docs/schemes/mine.md").write_text("# Mine\n")
    assert "docs/schemes/mine.md: is there already" in ship("mine").stderr


# A whole tree.


#: A law in the places of the template's own.
LAW = '''
from ..arrays.algebra import clip, matvec, vecmat
from ..inputs.fields import Array, Gain, GainOrZero, validated
from ..inputs.keys import Meaning
from ..robot.limits import JointLimits
from .law import Layout, SampledLaw, Signals


@validated
class GradientNetwork(SampledLaw):
    """A network that descends along the gradient of the task's error, its velocity clipped."""

    kind: Literal["gradient_network"] = "gradient_network"
    limits: Annotated[JointLimits, Meaning("Limits of the joints.")]
    feedback: Annotated[
        GainOrZero, Meaning("Gain k of the feedback of the position.", unit="1/s")
    ] = 20.0
    rate: Annotated[Gain, Meaning("Rate of the network.", unit="1/(s m^2)")] = 400.0

    takes_many = True

    @property
    def keeps(self) -> tuple[str, ...]:
        """See `Law.keeps`."""
        return ("velocity",)

    @property
    def loop_gains(self) -> Mapping[str, float]:
        return {"feedback": self.feedback}

    @cached_property
    def state(self) -> Layout:
        return Layout(v=(self.limits.size,))

    @cached_property
    def inputs(self) -> Layout:
        return Layout(p_WE=(3,), p_WE_desired=(3,), v_WE_desired=(3,), J=(3, self.limits.size))

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        v_WE = u["v_WE_desired"] + self.feedback * (u["p_WE_desired"] - u["p_WE"])
        missing = v_WE - matvec(u["J"], x)
        bound = self.limits.velocity
        return clip(x + self.rate * period * vecmat(missing, u["J"]), -bound, bound)
'''
TEST = '''"""The network descends until the end effector moves as it is asked to."""

import numpy as np

from drake_rnn import GradientNetwork, JointLimits


def test_it_comes_to_the_velocity_that_is_asked_for():
    law = GradientNetwork(limits=JointLimits.unlimited(4))
    J = np.random.default_rng(0).normal(size=(3, 4))
    asked, rest, v = np.array([0.1, 0.0, -0.2]), np.zeros(3), np.zeros(4)
    for _ in range(5000):
        u = {"p_WE": rest, "p_WE_desired": rest, "v_WE_desired": asked, "J": J}
        v = law.step(0.0, v, u, 1e-3)
    np.testing.assert_allclose(J @ v, asked, atol=1e-6)
'''
#: Runs that a user makes with any law.
RUNS = """
from drake_rnn import load_experiment, run_many, simulate, sweep, tune, why_not

short = {"duration": 1.0, "accept": None}
experiments = [load_experiment("gradient_network", {**short, "law.rate": rate})
               for rate in (300.0, 400.0, 500.0)]
assert why_not(experiments[0]) is None
many = run_many(experiments)
assert many.status == ("complete",) * 3
one = simulate(experiments[1]).metrics
assert abs(many.row(1)["position_error_max_m"] - one["position_error_max_m"]) < 1e-9
assert one["limit_ratio_1_max"] <= 1.0 + 1e-9
rows = sweep(experiments[0], {"law.rate": [300.0, 500.0]})
assert len(rows) == 2
moved = simulate(load_experiment("gradient_network", {**short, "level": "dynamic"}))
assert moved.metrics["position_error_max_m"] < 1e-3
least = "position_error_rms_m"
tuned = tune(experiments[0], ["law.rate"], least, steps=5)
assert tuned.after.metrics[least] < tuned.before.metrics[least]
print("all runs made")
"""


@pytest.mark.long
def test_a_law_of_thirty_lines_is_a_law_like_the_others(tmp_path):
    pytest.importorskip("jax")
    tree = tmp_path / "tree"
    left_out = shutil.ignore_patterns(".*", "__pycache__", "out", "build", "dist", "*.egg-info")
    shutil.copytree(ROOT, tree, symlinks=True, ignore=left_out)

    def call(*command):
        done = subprocess.run(
            [sys.executable, *command],
            cwd=tree,
            env={**os.environ, "PYTHONPATH": str(tree)},
            capture_output=True,
            text=True,
            timeout=1500,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    name = "gradient_network"
    assert "written" in call("-m", "drake_rnn", "new", "law", name, "--shipped")
    law = tree / f"drake_rnn/laws/{name}.py"
    head, _, _ = law.read_text().partition("\nfrom ..arrays")
    law.write_text(head + LAW)
    (tree / f"tests/laws/test_{name}.py").write_text(TEST)
    page = tree / f"docs/schemes/{name}.md"
    page.write_text(
        re.sub(r".*`damping`.*", "| $r$ | `rate` | 1/(s m^2) | | rate |", page.read_text())
    )
    for file in (*(file.format(name, name) for file in MADE), *ENTERED):
        text = (tree / file).read_text()
        (tree / file).write_text(re.sub(r"FILL IN[^|\n]*", "filled in.", text))
    call("docs/make_schemes.py")
    call("-m", "ruff", "check", "--no-cache", ".")
    # What looks at every law, looked at with this one.
    every = ["test_kept_limits", "test_leading_axes", "test_leading_axes_jax", f"test_{name}"]
    laws = [f"tests/laws/{file}.py" for file in every]
    pages = ["tests/docs/test_scheme_pages.py", "tests/docs/test_site.py", "tests/mutants"]
    of_all = "(every or made or filled or reached or module or public) and not wrong"
    chosen = f"{name} or ({of_all}) and (test_scheme_pages or test_site or mutants)"
    test = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "-n", "0", "-k", chosen)
    assert " passed" in call(*test, *laws, *pages)
    assert "all runs made" in call("-c", RUNS)
