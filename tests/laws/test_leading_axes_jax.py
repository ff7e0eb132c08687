"""Laws with leading axes in JAX: the same source, compiled, mapped and differentiated."""

from functools import partial

import numpy as np
import pytest
from many_helpers import GAINS, LAWS, moment, readings, row, signals, states

from drake_rnn import require_jax
from drake_rnn.arrays.algebra import reversible
from drake_rnn.laws.checks import (
    stack,
    with_gains,
)

pytest.importorskip("jax")
jax = require_jax()
jnp = jax.numpy

COUNT = 5
#: Most of the time goes into compilations; what runs is the same program, with slower code.
jit = partial(jax.jit, compiler_options={"xla_backend_optimization_level": 0})
#: Of each kind of law one or two; compilations take long.
LONG = (
    "slc_known",
    "naljdf_all",
    "adaptive_pose_learned",
    "slc_warm_up",
    "moaljdf",
    "recursive_filters",
    "motion_force_contact",
    "msa",
)


def _mark(name):
    return pytest.mark.long if name in LONG else pytest.mark.nightly


def _marked(name, *more):
    """Return the parameters of a test of a law, with the mark of that law."""
    return pytest.param(name, *more, marks=_mark(name))


#: Every reading of every law, by the method that steps it. Compiled runs and batches take steps,
#: which most laws make of their derivatives.
CASES = [
    pytest.param(
        (name, method),
        marks=_mark(name if method == "step" or name == "slc_known" else ""),
        id=f"{name}-{method}",
    )
    for name, law in LAWS.items()
    for method in readings(law)
]


@pytest.fixture(params=CASES)
def case(request):
    """A method of a reading, that reading, and states and signals of a few robots."""
    name, method = request.param
    rng = np.random.default_rng([9, len(name), len(method)])
    reading = readings(LAWS[name])[method]
    return method, reading, states(reading, rng, COUNT), signals(reading.inputs, rng, COUNT)


def _close(found, wanted):
    """Compare to 1e-9 of the largest number: rounding, and the condition of implicit steps."""
    wanted = np.asarray(wanted)
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())


def test_compiled_with_leading_axes_and_mapped(case):
    method, reading, x, u = case

    def step(t, x, u):
        return getattr(reading, method)(t, x, u, *moment(method))

    with_axes, mapped = jit(step), jit(jax.vmap(step, (None, 0, 0)))
    # Time is traced: in the warm-up and after it.
    for t in (0.3, 2.0):
        wanted = step(t, x, u)
        found = with_axes(t, x, u)
        assert found.dtype == np.float64
        _close(found, wanted)
        _close(mapped(t, x, u), wanted)
        _close(with_axes(t, x[0], row(u, 0)), wanted[0])


def test_commands_and_observables(case):
    _, reading, x, u = case
    command = jit(reading.commanded_velocity)
    _close(command(0.3, x), reading.commanded_velocity(0.3, x))
    desired = {name.replace("_preview", "_WE_desired"): value for name, value in u.items()}
    seen = {**desired, **u}
    wanted = reading.diagnostics(0.3, x, seen)
    for name, found in jit(partial(reading.diagnostics, 0.3))(x, seen).items():
        _close(found, wanted[name])


def test_derivatives_are_finite_in_both_modes_and_agree(case):
    method, reading, x, u = case

    def total(x, u):
        return getattr(reading, method)(2.0, x, u, *moment(method)).sum()

    with reversible(most=24):
        backward = jit(jax.grad(total, (0, 1)))(x, u)
    assert all(np.isfinite(part).all() for part in jax.tree.leaves(backward))
    tangent = np.random.default_rng(3).normal(size=x.shape)
    still = {name: np.zeros_like(value) for name, value in u.items()}
    _, forward = jit(lambda x: jax.jvp(total, (x, u), (tangent, still)))(x)
    # Of a sum of numbers of both signs.
    scale = np.abs(backward[0] * tangent).sum()
    assert forward == pytest.approx(np.sum(backward[0] * tangent), abs=1e-9 * scale)


#: A number of a law, and a time at which it matters [s].
SLOPES = [
    ("adaptive", "limits.acceleration", 2.0),
    ("adaptive_jerk", "limits.jerk", 2.0),
    ("slc_known", "kappa", 2.0),
    ("slc_learned", "return_gain", 2.0),
    ("slc_warm_up", "warm_up.acceleration", 0.32),
    ("galjdf", "composite_gain", 2.0),
    ("naljdf_all", "position_gain", 2.0),
    ("recursive_filters", "time_constants", 2.0),
    ("motion_force", "gain", 2.0),
    ("motion_force_contact", "stiffness.initial", 2.0),
    ("msa", "rise_time", 0.3),
    ("nsa_pose", "ramp_time", 0.3),
]


@pytest.mark.parametrize(
    ("name", "path", "t"),
    [_marked(*slope) for slope in SLOPES],
)
def test_derivatives_with_respect_to_gains_are_those_of_differences(name, path, t):
    """Central differences, 1e-4 of a gain: rounding is 1e-12 of the state, curvature 1e-8."""
    law, rng = LAWS[name], np.random.default_rng(11)
    value, reading = _number(law, path), readings(law)["step"]
    x, u = states(reading, rng, COUNT), signals(reading.inputs, rng, COUNT)

    def after(factor, namespace=jnp):
        held = {key: namespace.asarray(signal) for key, signal in u.items()}
        varied = with_gains(reading, {path: namespace.asarray(factor * value)})
        return varied.step(t, namespace.asarray(x), held, 1e-3)

    found = jit(jax.jacfwd(after))(1.0)
    difference = (after(1.0 + 1e-4, np) - after(1.0 - 1e-4, np)) / 2e-4
    largest = np.abs(difference).max()
    assert largest > 1e-8
    assert found == pytest.approx(difference, rel=1e-4, abs=1e-5 * largest)


def _number(law, path):
    for part in path.split("."):
        law = getattr(law, part)
    return law


@pytest.mark.parametrize("name", [_marked(name) for name in GAINS])
def test_gains_of_their_own_are_those_of_numpy(name):
    law, rng = LAWS[name], np.random.default_rng(12)
    gains = {}
    for path in GAINS[name]:
        value = _number(law, path)
        gains[path] = value * (1.0 - 0.3 * rng.random((COUNT, *np.shape(value))))
    reading = readings(law)["step"]
    x, u = states(reading, rng, COUNT), signals(reading.inputs, rng, COUNT)

    def after(gains, x, u):
        return with_gains(reading, gains).step(0.3, x, u, 1e-3)

    _close(jit(after)(gains, x, u), after(gains, x, u))
    _close(jit(jax.vmap(after))(gains, x, u), after(gains, x, u))


def test_a_network_that_needs_more_steps_than_were_allowed_says_so():
    reading = LAWS["slc_known"]
    rng = np.random.default_rng(13)
    x, u = states(reading, rng, 2), signals(reading.inputs, rng, 2)
    u["J"][1] *= 10.0

    def step(x, u):
        return reading.step(0.0, x, u, 1e-3)

    with reversible(most=8):
        found = jit(step)(x, u)
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1]).all()


def test_stacked_laws_compile():
    laws = [with_gains(LAWS["slc_known"], {"kappa": kappa}) for kappa in (2.0, 4.0)]
    rng = np.random.default_rng(14)
    x, u = states(laws[0], rng, 2), signals(laws[0].inputs, rng, 2)
    together = stack(laws)
    found = jit(lambda x, u: together.step(0.0, x, u, 1e-3))(x, u)
    _close(found, together.step(0.0, x, u, 1e-3))
