"""What would hang, or means nothing, is refused before a run, with what it may be."""

import pytest
from typer.testing import CliRunner

from drake_rnn.cli.commands import app
from drake_rnn.runs import simulation

SHORT = ("--duration", "0.1", "--set", "window=null", "--set", "accept=null")

#: Experiment, changes, and what is said of them.
REFUSED = {
    "a period of picoseconds": (
        "slc_nephroid_known",
        ["period=1e-12"],
        "period: 1e-12 s makes 1e+11 steps in 0.1 s, which may take 1.4e+03 hours",
    ),
    "a network that is too fast": (
        "slc_nephroid_known",
        ["law.rate=1e12"],
        "law.rate: 1e+12 /s: the network would need about 1e+09 substeps per period; it may "
        "take at most 10000",
    ),
    "more substeps than a machine makes": (
        "slc_nephroid_known",
        ["law.substeps=100000"],
        "law.substeps: 100000: the network would need about 1e+05 substeps",
    ),
    "a time constant of femtoseconds": (
        "state_adjustment",
        ["law.time_constant=1e-15", "period=1e-3"],
        "law.time_constant: 1e-15 s: the network would need about 1e+12 substeps",
    ),
    "a plant's step of nanoseconds": (
        "slc_nephroid_dynamic",
        ["plant.time_step=1e-9"],
        "plant.time_step: 1e-09 s makes 1e+08 steps in 0.1 s, which may take 5.6 hours",
    ),
    "an integrator's step of picoseconds": (
        "slc_nephroid_known_continuous",
        ["integrator.accuracy=null", "integrator.step=1e-12"],
        "integrator.step: 1e-12 s makes 1e+11 steps",
    ),
    "noise that changes every nanosecond": (
        "slc_nephroid_continuous",
        ["dither.hold=1e-10"],
        "dither.hold: 1e-10 s makes 1e+09 steps",
    ),
    "an accuracy that Euler's method does not control": (
        "slc_nephroid_known_continuous",
        ["integrator.scheme=explicit_euler"],
        "integrator.accuracy: explicit_euler does not estimate its error; give a step",
    ),
    "an accuracy that Runge-Kutta 2 does not control": (
        "slc_nephroid_known_continuous",
        ["integrator.scheme=runge_kutta2"],
        "integrator.accuracy: runge_kutta2 does not estimate its error",
    ),
    "a step longer than the run": (
        "slc_nephroid_known_continuous",
        ["integrator.accuracy=null", "integrator.step=5"],
        "integrator.step: may be at most the duration, 0.1 s, not 5",
    ),
    "no sample within the run": (
        "slc_nephroid_known",
        ["log_period=1e9"],
        "log_period: may be at most the duration, 0.1 s, not 1e+09",
    ),
    "more samples than fit": (
        "slc_nephroid_known",
        ["log_period=1e-9"],
        "log_period: 1e-09 s stores 1e+08 samples in 0.1 s",
    ),
    "a key that is set twice": (
        "slc_nephroid_known",
        ["law.kappa=8", "law.kappa=4"],
        "--set: law.kappa is given twice, as 8 and 4",
    ),
    "no value": ("slc_nephroid_known", ["law.kappa="], "--set: must be KEY=VALUE, or KEY=null"),
    "an empty name": ("slc_nephroid_known", ["name="], "--set: must be KEY=VALUE"),
    "the removal of no key": (
        "slc_nephroid_known",
        ["law.foo=null"],
        "law.foo: no such key; it may be kind, limits, home",
    ),
    "the removal of no section": (
        "slc_nephroid_known",
        ["acept=null"],
        "acept: no such key; nearest: accept",
    ),
    "friction as of no two bodies": (
        "contact_circle",
        ["environment.friction=50"],
        "environment.friction: must be less than or equal to 10, not 50",
    ),
    "a path of atoms": (
        "slc_nephroid_known",
        ["path.size=1e-12"],
        "path.size: must be greater than or equal to 0.000001, not 1e-12",
    ),
}

PLANAR = """\
arm: planar6
path: {kind: circle, size: 0.05, period: 5}
law: {kind: motion_force, stiffness: 1000}
environment: {kind: elastic_surface, stiffness: 1000}
force: {value: 1}
period: 1e-3
duration: 0.1
"""
#: Documents, and what is said of them.
DOCUMENTS = {
    "a normal along which the arm cannot move": (
        PLANAR,
        "environment.normal: the arm cannot move its tool along [0.0, 0.0, 1.0] from its start",
    ),
    "a sweep over no key": (
        PLANAR + "over: {lwa.kappa: [1, 2]}\n",
        "over.lwa.kappa: no such key; nearest: law",
    ),
    "a document without an end": ("arm: &a\n  model: *a\n", "refers to itself"),
    "a document 3000 deep": (f"arm: {'[' * 3000}{']' * 3000}", "nested too deeply"),
}


@pytest.fixture(autouse=True)
def nothing_runs(monkeypatch):
    def start(*arguments):
        raise AssertionError("a run was started")

    monkeypatch.setattr(simulation, "_advance", start)


def sentence(*arguments):
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 2, (result.stdout, result.stderr, result.exception)
    (line,) = result.stderr.splitlines()
    return line.removeprefix("error ")


@pytest.mark.parametrize(("name", "changes", "message"), REFUSED.values(), ids=REFUSED)
def test_it_is_refused(tmp_path, name, changes, message):
    options = [part for change in changes for part in ("--set", change)]
    assert sentence("run", name, *SHORT, *options, "--out", tmp_path).startswith(message)
    assert not list(tmp_path.rglob("run.json"))


@pytest.mark.parametrize(("text", "message"), DOCUMENTS.values(), ids=DOCUMENTS)
def test_a_document_is_refused(tmp_path, text, message):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    assert message in sentence("run", file, "--out", tmp_path)


def test_what_takes_long_runs_if_it_is_told_to(tmp_path):
    options = ("--set", "period=1e-12", *SHORT, "--out", tmp_path, "--no-playback", "--anyway")
    result = CliRunner().invoke(app, ["run", "slc_nephroid_known", *map(str, options)])
    assert isinstance(result.exception, AssertionError)
    assert "a run was started" in str(result.exception)
