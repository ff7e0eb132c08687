"""Laws with leading axes in JAX: the same source, compiled, mapped and differentiated."""

from functools import partial

import numpy as np
import pytest
from many_helpers import GAINS, LAWS, moment, readings, row, signals, states

from drake_rnn import require_jax
from drake_rnn.arrays.substeps import reversible
from drake_rnn.laws.stacked import stacked, with_gains

pytest.importorskip("jax")
jax = require_jax()
jnp = jax.numpy

CASES = [(name, method) for name, law in LAWS.items() for method in readings(law)]
COUNT = 5


@pytest.fixture(params=CASES, ids="-".join)
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

    with_axes, mapped = jax.jit(step), jax.jit(jax.vmap(step, (None, 0, 0)))
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
    command = jax.jit(reading.commanded_velocity)
    _close(command(0.3, x), reading.commanded_velocity(0.3, x))
    desired = {name.replace("_preview", "_WE_desired"): value for name, value in u.items()}
    seen = {**desired, **u}
    wanted = reading.diagnostics(0.3, x, seen)
    for name, found in jax.jit(partial(reading.diagnostics, 0.3))(x, seen).items():
        _close(found, wanted[name])


def test_derivatives_are_finite_in_both_modes_and_agree(case):
    method, reading, x, u = case

    def total(x, u):
        return getattr(reading, method)(2.0, x, u, *moment(method)).sum()

    with reversible(most=16):
        backward = jax.jit(jax.grad(total, (0, 1)))(x, u)
    assert all(np.isfinite(part).all() for part in jax.tree.leaves(backward))
    tangent = np.random.default_rng(3).normal(size=x.shape)
    still = {name: np.zeros_like(value) for name, value in u.items()}
    _, forward = jax.jit(lambda x: jax.jvp(total, (x, u), (tangent, still)))(x)
    _close(forward, np.sum(backward[0] * tangent))


@pytest.mark.parametrize("name", GAINS)
def test_derivatives_with_respect_to_gains_are_those_of_differences(name):
    """Central differences of 1e-6, of gains that are shared and of each robot's own."""
    law = LAWS[name]
    rng = np.random.default_rng(11)
    path = GAINS[name][0]
    value = law
    for part in path.split("."):
        value = getattr(value, part)
    reading = readings(law)["step"]
    x, u = states(reading, rng, COUNT), signals(reading.inputs, rng, COUNT)
    t = 0.3 if "warm_up" in path else 2.0

    def after(gain):
        return with_gains(reading, {path: gain}).step(t, jnp.asarray(x), _arrays(u), 1e-3)

    found = jax.jit(jax.jacfwd(after))(jnp.asarray(value))
    assert np.isfinite(found).all()
    small = 1e-6 * value
    difference = (after(jnp.asarray(value + small)) - after(jnp.asarray(value - small))) / 2e-6
    assert np.abs(difference).max() > 0.0
    np.testing.assert_allclose(
        found * value, difference, rtol=1e-4, atol=1e-5 * np.abs(difference).max()
    )


def _arrays(u):
    return {name: jnp.asarray(value) for name, value in u.items()}


@pytest.mark.parametrize("name", GAINS)
def test_gains_of_their_own_are_those_of_numpy(name):
    law, rng = LAWS[name], np.random.default_rng(12)
    gains = {}
    for path in GAINS[name]:
        value = law
        for part in path.split("."):
            value = getattr(value, part)
        gains[path] = value * (1.0 - 0.3 * rng.random((COUNT, *np.shape(value))))
    reading = readings(law)["step"]
    x, u = states(reading, rng, COUNT), signals(reading.inputs, rng, COUNT)

    def after(gains, x, u):
        return with_gains(reading, gains).step(0.3, x, u, 1e-3)

    _close(jax.jit(after)(gains, x, u), after(gains, x, u))
    _close(jax.jit(jax.vmap(after))(gains, x, u), after(gains, x, u))


def test_a_network_that_needs_more_steps_than_were_allowed_says_so():
    reading = LAWS["slc_known"]
    rng = np.random.default_rng(13)
    x, u = states(reading, rng, 2), signals(reading.inputs, rng, 2)
    u["J"][1] *= 10.0

    def step(x, u):
        return reading.step(0.0, x, u, 1e-3)

    with reversible(most=8):
        found = jax.jit(step)(x, u)
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1]).all()


def test_stacked_laws_compile():
    laws = [with_gains(LAWS["slc_known"], {"kappa": kappa}) for kappa in (2.0, 4.0)]
    rng = np.random.default_rng(14)
    x, u = states(laws[0], rng, 2), signals(laws[0].inputs, rng, 2)
    together = stacked(laws)
    found = jax.jit(lambda x, u: together.step(0.0, x, u, 1e-3))(x, u)
    _close(found, together.step(0.0, x, u, 1e-3))
