"""Laws whose steps are compiled: the same commands, the same limits, and what is refused."""

from dataclasses import dataclass

import numpy as np
import pytest

from drake_rnn import (
    Adaptive,
    CompiledStep,
    InvalidInputError,
    JointLimits,
    Layout,
    Pseudoinverse,
    SampledController,
    SampledLaw,
    load_experiment,
    simulate,
)
from drake_rnn.compiled import library
from drake_rnn.compiled.library import NativeLaw, compiler, law_step

pytest.importorskip("jax")
needs_compiler = pytest.mark.skipif(compiler() is None, reason="needs a C compiler")

N, M = 5, 3
LIMITS = JointLimits(
    position_lower=-np.array([1.0, 0.5, 1.0, 0.2, 2.0]),
    position_upper=np.array([1.0, 0.6, 0.3, 1.0, 2.0]),
    velocity=np.array([0.5, 0.3, 1.0, 0.5, 0.7]),
    acceleration=np.array([1.0, 2.0, 1.5, 3.0, 1.0]),
    jerk=np.full(N, 10.0),
)
ADAPTIVE = Adaptive(limits=LIMITS.replace(jerk=None), home=np.zeros(N))


def shorten(name, duration, **changes):
    return load_experiment(name, {"duration": duration, "window": None, **changes})


@needs_compiler
@pytest.mark.parametrize(
    ("name", "most"), [("slc_nephroid_known", 1e-12), ("naljdf_clover", 1e-12)]
)
def test_a_run_is_that_of_numpy(name, most):
    """Positions, and all metrics to their printed digits."""
    experiment = shorten(name, 0.3)
    plain, compiled = simulate(experiment), simulate(experiment, compiled=True)
    off = np.abs(plain.series["position"] - compiled.series["position"]).max()
    assert off <= most
    assert np.ptp(plain.series["position"], axis=0).max() > 1e-3
    assert compiled.metrics == pytest.approx(plain.metrics, rel=1e-6, abs=1e-9, nan_ok=True)
    assert compiled.series.keys() == plain.series.keys()


@needs_compiler
@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "most"),
    [
        ("slc_nephroid_guarded", 1e-12),
        # Near its start this law is sensitive to rounding: other starts by 1e-15 differ as much.
        ("adaptive_moving_obstacle", 1e-5),
        ("adaptive_two_arms", 1e-6),
    ],
)
def test_a_run_among_obstacles_is_that_of_numpy(name, most):
    """Obstacles that move, another arm and a safety filter as well: decisions are the same."""
    experiment = shorten(name, 0.4)
    plain, compiled = simulate(experiment), simulate(experiment, compiled=True)
    off = np.abs(plain.series["position"] - compiled.series["position"]).max()
    assert off <= most
    assert compiled.metrics["distance_min_m"] == pytest.approx(
        plain.metrics["distance_min_m"], abs=most
    )


@needs_compiler
@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["adaptive_jerk", "adaptive_letter", "zeroing_clover", "pinv_waypoints"]
)
def test_a_longer_run_is_that_of_numpy(name):
    experiment = shorten(name, 3.0)
    plain, compiled = simulate(experiment), simulate(experiment, compiled=True)
    assert np.abs(plain.series["position"] - compiled.series["position"]).max() <= 1e-12


def against(law, period, seed, samples):
    """Return the commanded velocities, where J, path and measurements are drawn again and again."""
    rng, reading = np.random.default_rng(seed), law.sampled(period)
    step = NativeLaw(reading, period)
    shapes = {name: shape for name, (_, shape) in reading.inputs.parts.items()}
    q, draw, velocities = np.zeros(N), {}, [np.zeros(N)]
    for k in range(samples):
        if k % rng.choice([1, 10, 200]) == 0:
            draw = {name: 0.5 * rng.normal(size=shape) for name, shape in shapes.items()}
        u = {**draw, "position": q}
        x = reading.initial_state(rng, u) if k == 0 else x  # noqa: F821  of the round before
        x = step(k * period, x, u, period)
        v = reading.commanded_velocity(k * period, x)
        q = q + period * v
        velocities.append(v)
    return np.array(velocities)


@needs_compiler
@pytest.mark.parametrize(
    ("jacobian", "jerk", "period"),
    [("known", True, 5e-3), ("known", False, 1e-3), ("learned", True, 1e-2), ("known", True, 5e-4)],
)
@pytest.mark.long
def test_every_bound_holds_in_c_whatever_the_inputs_are(jacobian, jerk, period):
    limits = LIMITS if jerk else LIMITS.replace(jerk=None)
    law = Adaptive(limits=limits, home=np.zeros(N), jacobian=jacobian)
    for seed in range(2):
        v = against(law, period, seed, max(1000, round(1.0 / period)))
        q = np.cumsum(period * v, axis=0)
        a, j = np.diff(v, axis=0) / period, np.diff(v, n=2, axis=0) / period**2
        assert LIMITS.violation(q).max() <= 1e-9
        for size, bound in ((v, LIMITS.velocity), (a, LIMITS.acceleration), (j, LIMITS.jerk)):
            if size is not j or jerk:
                assert (np.abs(size) / bound).max() <= 1.0 + 1e-9
        assert (np.abs(v) / LIMITS.velocity).max() > 0.5


@needs_compiler
def test_one_library_serves_all_who_build_the_same(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    law = Pseudoinverse(limits=LIMITS)
    first = NativeLaw(law.sampled(1e-3), 1e-3)
    (file,) = (tmp_path / "drake_rnn" / "compiled").iterdir()
    build_time = file.stat().st_mtime_ns
    NativeLaw(law.sampled(1e-3), 1e-3)
    assert file.stat().st_mtime_ns == build_time
    # The period is compiled in.
    NativeLaw(law.sampled(2e-3), 2e-3)
    assert len(list(file.parent.iterdir())) <= 2
    assert "malloc" not in first.source
    assert "static double" not in first.source.replace("static double larger", "").replace(
        "static double smaller", ""
    )


def test_without_a_compiler_jax_makes_the_steps(monkeypatch):
    monkeypatch.setattr(library, "compiler", lambda: None)
    reading = Pseudoinverse(limits=LIMITS).sampled(1e-3)
    step, rng = law_step(reading, 1e-3), np.random.default_rng(0)
    u = {name: rng.normal(size=shape) for name, (_, shape) in reading.inputs.parts.items()}
    x = reading.initial_state(rng, u)
    assert step(0.0, x, u, 1e-3) == pytest.approx(reading.step(0.0, x, u, 1e-3), rel=1e-12)
    with pytest.raises(InvalidInputError, match="compiled: no C compiler is found; install gcc"):
        NativeLaw(reading, 1e-3)


@dataclass(frozen=True)
class Deciding(SampledLaw):
    """A law with a branch of Python."""

    takes_many = False

    @property
    def state(self):
        return Layout(v=(N,))

    @property
    def inputs(self):
        return Layout(position=(N,))

    def step(self, t, x, u, period):
        if u["position"][0] > 0.5:  # DECIDES
            return 0.0 * x
        return x + period


@dataclass(frozen=True)
class Smooth(Deciding):
    """A law of a user's own that NumPy and JAX both take, written for one robot."""

    def step(self, t, x, u, period):
        return x + period * (0.1 - u["position"]) * (1.0 + t)


def test_a_law_with_control_flow_of_python_is_refused_with_its_line():
    with open(__file__) as file:
        lines = file.read().splitlines()
    line = 1 + next(k for k, text in enumerate(lines) if text.endswith("# DECIDES"))
    with pytest.raises(InvalidInputError) as refusal:
        SampledController(Deciding(), 1e-3, compiled=True)
    assert str(refusal.value).startswith(f"Deciding.step, line {line}: decides by numbers which")
    assert SampledController(Deciding(), 1e-3).compiled is False


@needs_compiler
def test_a_law_of_ones_own_compiles():
    step, q = law_step(Smooth(), 1e-2), np.linspace(-1.0, 1.0, N)
    x = step(3.0, np.ones(N), {"position": q}, 1e-2)
    assert x == pytest.approx(Smooth().step(3.0, np.ones(N), {"position": q}, 1e-2), abs=1e-16)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: simulate(shorten("horizon_circle", 0.1), compiled=True),
            "RecedingHorizon.step, receding_horizon.py line ",
        ),
        (
            lambda: SampledController(ADAPTIVE, 1e-3, compiled=True, tunable=True),
            "compiled: must be left out with tunable",
        ),
        (
            lambda: simulate(shorten("slc_nephroid_known_continuous", 0.1), compiled=True),
            "compiled: a law that Drake integrates is not compiled; give a period",
        ),
        (lambda: CompiledStep("slc_nephroid_known", backend="fortran"), "backend: no 'fortran'"),
        (lambda: SampledController(ADAPTIVE, 1e-3, compiled=1), "compiled: must be of class bool"),
    ],
)
def test_what_is_not_compiled_is_refused(make, message):
    with pytest.raises(InvalidInputError) as refusal:
        make()
    assert str(refusal.value).startswith(message)
