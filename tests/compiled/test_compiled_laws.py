"""Laws whose steps are compiled: the same commands, the same limits, and what is refused."""

import json
from dataclasses import dataclass

import numpy as np
import pytest

from drake_rnn import (
    Adaptive,
    CompiledStep,
    Guard,
    InvalidInputError,
    JointStream,
    Layout,
    Pseudoinverse,
    Result,
    SampledController,
    SampledLaw,
    arm_clearance,
    check_experiment,
    load_arm,
    load_experiment,
    make_obstacles,
    simulate,
)
from drake_rnn.compiled import library
from drake_rnn.compiled.library import NativeLaw, compiler, law_step
from drake_rnn.law_files import write_law
from drake_rnn.runs.series import RunOptions
from limit_helpers import OF_FIVE_JOINTS

pytest.importorskip("jax")
needs_compiler = pytest.mark.skipif(compiler() is None, reason="needs a C compiler")

N = 5
LIMITS = OF_FIVE_JOINTS.replace(snap=None, crackle=None)
# Laws of each kind in the long test of all bounds, and starts with each.
LAWS, STARTS = 20, 125
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


def against(step, reading, period, rng, start, samples):
    """Return the commanded velocities, where J, path and measurements are drawn again and again.

    In half of the time the target rests, where the law measures its progress. The arm is at rest
    before, at a start; the first two velocities are those.
    """
    shapes = {name: shape for name, (_, shape) in reading.inputs.parts.items()}
    q, draw, velocities = start, {}, [np.zeros(N)] * 2
    for k in range(samples):
        if k % rng.choice([1, 10, 200]) == 0:
            draw = {name: 0.5 * rng.normal(size=shape) for name, shape in shapes.items()}
            if "progress" in reading.state.parts and k % 200 > 100:
                draw["p_preview"] = draw["p_WE_desired"]
        u = {**draw, "position": q}
        x = reading.initial_state(rng, u) if k == 0 else x  # noqa: F821  of the round before
        x = step(k * period, x, u, period)
        v = reading.commanded_velocity(k * period, x)
        q = q + period * v
        velocities.append(v)
    return np.array(velocities)


def excesses(limits, period, start, v):
    """The excess of a position [rad], of its derivatives as a share of their limits."""
    assert np.isfinite(v).all()
    found = {"position": limits.violation(start + np.cumsum(period * v, axis=0)).max()}
    for order, name in enumerate(("velocity", "acceleration", "jerk")):
        if limits.bounds[name] is not None:
            size = np.abs(np.diff(v, n=order, axis=0)) / period**order
            found[name] = (size / limits.bounds[name]).max() - 1.0
    return found


@needs_compiler
@pytest.mark.parametrize(
    ("jacobian", "jerk", "period", "fast"),
    [
        ("known", True, 5e-3, 0.5),
        ("known", False, 1e-3, 0.5),
        ("learned", True, 1e-2, 0.5),
        ("known", True, 5e-4, 0.5),
        # Where the learned Jacobian becomes so large that rounding makes systems singular.
        ("learned", False, 5e-4, 0.1),
    ],
)
@pytest.mark.long
def test_every_bound_holds_in_c_whatever_the_inputs_are(jacobian, jerk, period, fast):
    limits = LIMITS if jerk else LIMITS.replace(jerk=None)
    reading = Adaptive(limits=limits, home=np.zeros(N), jacobian=jacobian).sampled(period)
    step, start = NativeLaw(reading, period), np.zeros(N)
    for seed in range(2):
        rng, samples = np.random.default_rng(seed), max(1000, round(1.0 / period))
        v = against(step, reading, period, rng, start, samples)
        assert max(excesses(limits, period, start, v).values()) <= 1e-9
        assert (np.abs(v) / LIMITS.velocity).max() > fast


def random_limits(rng, jerk):
    """Limits of five joints; those on derivatives are up to a factor of three from the usual."""
    names = ["velocity", "acceleration", "jerk"] if jerk else ["velocity", "acceleration"]
    other = {name: LIMITS.bounds[name] * np.exp(rng.uniform(-1.1, 1.1, N)) for name in names}
    return LIMITS.replace(**{"jerk": None, **other})


@needs_compiler
@pytest.mark.nightly
@pytest.mark.parametrize("jerk", [False, True])
@pytest.mark.parametrize("jacobian", ["known", "learned"])
def test_no_bound_breaks_in_c_in_ten_thousand_cases(jacobian, jerk):
    """2500 of each of four kinds: 20 laws with 125 starts each, a third of the joints at limits."""
    rng, worst, fastest = np.random.default_rng([jerk, jacobian == "known"]), {}, []
    for _ in range(LAWS):
        limits, period = random_limits(rng, jerk), np.exp(rng.uniform(*np.log([5e-4, 1e-2])))
        reading = Adaptive(limits=limits, home=np.zeros(N), jacobian=jacobian).sampled(period)
        step, ends = NativeLaw(reading, period), (limits.position_lower, limits.position_upper)
        for _ in range(STARTS):
            start = rng.uniform(*ends)
            at = rng.random(N) < 1 / 3
            start[at] = np.where(rng.random(N) < 0.5, *ends)[at]
            v = against(step, reading, period, rng, start, min(1000, round(1.0 / period)))
            for name, excess in excesses(limits, period, start, v).items():
                worst[name] = max(worst.get(name, -1.0), excess)
            fastest.append((np.abs(v) / limits.velocity).max())
    print(f"J {jacobian}, jerk bounded: {jerk}; largest excess: {worst}")
    assert set(worst) == {"position", "velocity", "acceleration"} | ({"jerk"} if jerk else set())
    assert max(worst.values()) <= 1e-9
    # They are against limits of accelerations and velocities.
    assert min(worst["acceleration"], worst["velocity"]) > -1e-3
    assert np.quantile(fastest, 0.9) > 0.3


@pytest.mark.long
def test_among_many_balls_commands_are_those_of_numpy():
    """More pairs matter than few, of which a compiled step looks at no others."""
    arm = load_arm("panda")
    angles = 2.0 * np.pi * np.arange(12) / 12
    balls = [
        {"kind": "ball", "center": [0.5, 0.3 * np.cos(a), 0.45 + 0.3 * np.sin(a)], "radius": 0.06}
        for a in angles
    ]
    balls[3] |= {"speed": 0.2, "error": 0.002}
    clearance, _ = arm_clearance(arm, make_obstacles(balls), arm.home)
    limits = arm.limits.replace(velocity=1.0, acceleration=5.0, jerk=200.0)
    law = JointStream(limits=limits, home=np.asarray(arm.home), clearance=clearance)
    in_c, by_numpy = (Guard(law, 0.005, compiled=compiled) for compiled in (True, False))
    rng, p_WO = np.random.default_rng(3), np.zeros((1, 3))
    for k in range(600):
        if k % 60 == 0:
            target = arm.home + rng.uniform(-1.2, 1.2, 7)
        p_WO = p_WO + 0.0005 * rng.uniform(-1.0, 1.0, (1, 3))
        q, right = (np.array(guard.command(target, p_WO)) for guard in (in_c, by_numpy))
        np.testing.assert_allclose(q, right, atol=1e-9, err_msg=str(k))
    assert in_c.part("uncertified") == by_numpy.part("uncertified")


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
    monkeypatch.setattr(library, "_NATIVE", [])
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
            lambda: SampledController(ADAPTIVE, 1e-3, compiled=True, tunable=True),
            "compiled: must be left out with tunable",
        ),
        (lambda: CompiledStep("slc_nephroid_known", backend="fortran"), "backend: no 'fortran'"),
        (lambda: SampledController(ADAPTIVE, 1e-3, compiled=1), "compiled: must be of class bool"),
    ],
)
def test_what_is_not_compiled_is_refused(make, message):
    with pytest.raises(InvalidInputError) as refusal:
        make()
    assert str(refusal.value).startswith(message)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("adaptive_locked_joint", "faults: must be left out of a compiled law; what sees "),
        ("horizon_circle", "law: RecedingHorizon plans ahead, which is written for NumPy alone"),
        ("slc_nephroid_known_continuous", "integrator: is Drake's; a compiled law is sampled: "),
    ],
)
def test_the_table_of_pairs_refuses_before_anything_is_traced(name, said, monkeypatch, tmp_path):
    monkeypatch.setattr(library, "Sample", None)
    experiment = load_experiment(name)
    for attempt in (
        lambda: simulate(experiment, compiled=True),
        lambda: check_experiment(experiment, compiled=True),
        lambda: write_law(experiment, tmp_path / "law"),
    ):
        with pytest.raises(InvalidInputError) as refusal:
            attempt()
        assert str(refusal.value).startswith(said)
    assert not (tmp_path / "law").exists()


@needs_compiler
def test_a_result_says_that_its_steps_were_compiled(tmp_path):
    """Here, in its folder, where it is read again and in words."""
    compiled = simulate(shorten("pinv_line", 0.02), compiled=True, series="thin")
    plain = simulate(shorten("pinv_line", 0.02))
    assert compiled.options == RunOptions(series="thin", compiled=True)
    assert plain.options == RunOptions()
    saved = compiled.save(tmp_path)
    assert json.loads((saved / "run.json").read_text())["options"]["compiled"] is True
    assert Result.load(saved).options == compiled.options
    assert "complete, 0.02 s with compiled steps, " in repr(Result.load(saved))
    assert "compiled" not in repr(plain)
