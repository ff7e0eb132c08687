"""Steps in C that come while an arm moves, and steps that were built before."""

import os
import time
from dataclasses import replace

import numpy as np
import pytest

from drake_rnn import Guard, JointStream, load_arm
from drake_rnn.compiled import builds
from drake_rnn.compiled.builds import Steps, step_key
from drake_rnn.compiled.library import compiler
from drake_rnn.errors import InvalidInputError
from drake_rnn.laws import LAWS
from drake_rnn.shield import Shield, ShieldSettings

needs_compiler = pytest.mark.skipif(compiler() is None, reason="needs a C compiler")
PERIOD = 1e-3


@pytest.fixture
def background(monkeypatch, tmp_path):
    """Steps are made as where nobody says how, and nothing was built before."""
    monkeypatch.delenv(builds.VARIABLE)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


@pytest.fixture
def other_compilers(monkeypatch):
    """Return a function that has a compiler looked for again."""
    compiler.cache_clear()
    yield compiler.cache_clear
    monkeypatch.undo()
    compiler.cache_clear()


def stream(**fields):
    """Return the law of two joints whose stop is to be certified step by step."""
    arm = load_arm("planar6")
    limits = arm.limits.replace(velocity=1.0, acceleration=4.0, jerk=60.0)
    return JointStream(limits=limits, home=arm.home, **fields)


def follow(guard, others=(), until=lambda k: k >= 400, most=100_000):
    """Return the velocities of a guard that is led to and fro, and what others command at most."""
    velocities, farthest = [], 0.0
    for k in range(most):
        target = guard.law.home + 0.4 * np.sin(0.02 * (k // 50)) if k % 50 == 0 else None
        q = guard.command(target)
        velocities.append(guard.velocity)
        farthest = max([farthest, *(np.abs(other.command(target) - q).max() for other in others)])
        if until(k):
            return np.array(velocities), farthest
    pytest.fail("the library did not come")


@needs_compiler
@pytest.mark.long
def test_a_step_in_c_takes_over_between_two_samples(background):
    """All bounds hold across it, and commands are those of NumPy but for rounding."""
    law = stream()
    guard, by_numpy = Guard(law, PERIOD), Guard(law, PERIOD, compiled=False)
    assert guard.steps.startswith("NumPy until")
    begin, was_slow, after = time.perf_counter(), True, []

    def until(k):
        nonlocal was_slow
        if was_slow and k % 20 == 0:
            was_slow = not guard.steps.startswith("C (")
            time.sleep(2e-3)
            assert time.perf_counter() - begin < 100.0, guard.steps
        after.append(was_slow)
        return after.count(False) > 500

    v, farthest = follow(guard, [by_numpy], until)
    assert after[0]
    assert farthest < 1e-12
    a, limits = np.diff(v, axis=0) / PERIOD, law.limits
    assert (np.abs(v) <= limits.velocity * (1.0 + 1e-9)).all()
    assert (np.abs(a) <= limits.acceleration * (1.0 + 1e-9)).all()
    assert (np.abs(np.diff(a, axis=0)) / PERIOD <= limits.jerk * (1.0 + 1e-9)).all()
    # What was built makes the steps of the next one from the first, and with the same bits.
    guards = [Guard(law, PERIOD) for _ in range(2)]
    assert all(each.steps.endswith("from the cache") for each in guards)
    first, second = (follow(each)[0] for each in guards)
    assert np.array_equal(first, second)


def test_a_step_is_found_by_all_that_its_code_depends_on():
    """Not by numbers that it is given, and never where code is a user's own."""
    arm = load_arm("panda")

    def key(settings=PERIOD, **fields):
        obstacles = fields.pop("obstacles", [ball(0.6)])
        world = {"limits": fields.pop("limits", arm.limits), "obstacles": obstacles}
        start = arm.home + fields.pop("away", 0.0)
        shield = Shield(arm, settings, ShieldSettings(compiled=False), start=start, **world)
        if fields.pop("of_tool", False):
            return step_key(shield._tool._reading, settings)
        return step_key(replace(shield._guard._reading, **fields), settings)

    def ball(x):
        return {"kind": "ball", "center": [x, 0.3, 0.4], "radius": 0.08}

    same = key()
    assert key(obstacles=[ball(0.5)]) == same
    # Nor are there builds of their own for other starts, with obstacles or without.
    assert key(away=0.1) == same
    for way in ({"obstacles": []}, {"of_tool": True}):
        assert key(**way) == key(**way, away=0.1)
    others = [
        key(2e-3),
        key(tolerance=0.0),
        key(obstacles=[ball(0.6), ball(0.5)]),
        key(limits=arm.limits.replace(velocity=1.0)),
        key(limits=arm.limits.replace(velocity=np.nextafter(1.0, 2.0))),
    ]
    assert len({same, *others}) == 6

    class Own(JointStream):
        pass

    law = Own(limits=arm.limits, home=arm.home)
    assert step_key(law.sampled(PERIOD), PERIOD) is None
    LAWS.pop("own", None)


def test_without_a_compiler_steps_are_made_by_numpy(background, other_compilers, monkeypatch):
    """A line says what would help; it is no warning."""
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr("drake_rnn.inputs.packages.find_spec", lambda name: None)
    guard = Guard(stream(), PERIOD)
    assert guard.steps.startswith("NumPy: no C compiler is found: pip install ")
    assert "ziglang" in guard.steps
    plain = Guard(stream(), PERIOD, compiled=False)
    assert plain.steps == "NumPy"
    assert np.array_equal(follow(guard)[0], follow(plain)[0])
    monkeypatch.setenv("CC", "no_such_compiler")
    other_compilers()
    assert Guard(stream(), PERIOD).steps.startswith("NumPy: CC: must name a C compiler")


@pytest.mark.long
def test_a_wheel_brings_a_compiler(background, other_compilers, monkeypatch):
    """The one of PyPI's ziglang."""
    pytest.importorskip("ziglang")
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "")
    guard = Guard(stream(), PERIOD, compiled=True)
    assert guard.steps.startswith("C (ziglang), built in")
    assert follow(guard, [Guard(stream(), PERIOD, compiled=False)])[1] < 1e-12


@needs_compiler
@pytest.mark.long
def test_a_build_that_fails_is_told(background, other_compilers, monkeypatch, tmp_path):
    """The arm goes on by NumPy."""
    broken = tmp_path / "cc"
    broken.write_text("#!/bin/sh\necho 'no space left' >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setenv("CC", str(broken))
    guard = Guard(stream(), PERIOD)
    until = time.perf_counter() + 100.0
    while guard.steps.startswith("NumPy until"):
        guard.command()
        assert time.perf_counter() < until
        time.sleep(0.05)
    assert guard.steps == "NumPy: compiled: cc refuses the step: no space left"


def test_the_environment_says_how_steps_are_made(monkeypatch):
    assert os.environ[builds.VARIABLE] == "never"
    monkeypatch.setenv(builds.VARIABLE, "always")
    with pytest.raises(InvalidInputError, match="DRAKE_RNN_COMPILE: may be never, wait, backg"):
        Guard(stream(), PERIOD)
    assert Steps(False).text == "NumPy"
