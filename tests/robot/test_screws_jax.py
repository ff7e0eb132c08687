"""Kinematics for many robots in JAX: the same numbers, compiled, in loops and differentiated."""

from dataclasses import replace

import numpy as np
import pytest

from drake_rnn import (
    InvalidInputError,
    load_arm,
    random_link_errors,
    require_jax,
    screws_of,
    with_link_errors,
)
from screw_helpers import all_of, askew, assert_close, motions

pytest.importorskip("jax")
jax = require_jax()


@pytest.fixture(params=["panda", pytest.param("askew", marks=pytest.mark.long)])
def screws(request, tmp_path):
    arm = load_arm("panda") if request.param == "panda" else askew(tmp_path / "askew.urdf")
    return screws_of(arm)


def test_jax_says_what_numpy_says_without_being_compiled(screws):
    """1e-13: some hundred roundings, of which a few are seen."""
    q, v = motions(screws.n, ())
    plain = all_of(screws, jax.numpy.asarray(q), jax.numpy.asarray(v))
    assert all(isinstance(value, jax.Array) for value in plain.values())
    assert_close(plain, all_of(screws, q, v), 1e-13)


def test_jax_says_what_numpy_says_compiled_for_many(screws):
    """1e-13, as above."""
    q, v = motions(screws.n, (37,))
    found = jax.jit(lambda q, v: all_of(screws, q, v))(q, v)
    assert_close(found, all_of(screws, q, v), 1e-13)


@pytest.mark.long
def test_robots_may_have_arms_of_their_own_and_be_mapped():
    """1e-13, as above; all axes are askew, which takes another way through the compiler."""
    screws = screws_of(load_arm("ur5"))
    own = with_link_errors(screws, random_link_errors(screws, np.random.default_rng(1), 8))
    q, v = motions(screws.n, (8,))
    wanted = all_of(own, q, v)
    assert_close(jax.jit(lambda q, v: all_of(own, q, v))(q, v), wanted, 1e-13)

    def one(axes, offsets, R_WE, q, v):
        return all_of(replace(screws, axes=axes, offsets=offsets, R_WE=R_WE), q, v)

    mapped = jax.jit(jax.vmap(one))(own.axes, own.offsets, own.R_WE, q, v)
    assert_close(mapped, wanted, 1e-13)


@pytest.mark.long
def test_the_derivatives_of_position_and_velocity_are_the_jacobian_and_the_bias(screws):
    """1e-13: some hundred roundings."""
    q, v = motions(screws.n, ())
    J = jax.jacfwd(lambda q: screws.at(q).p_WE)(q)
    np.testing.assert_allclose(J, screws.at(q).J, atol=1e-13)
    back = jax.jacrev(lambda q: screws.at(q).p_WE)(q)
    np.testing.assert_allclose(back, J, atol=1e-13)
    _, J_rate = jax.jvp(lambda q: screws.at(q).J, (q,), (v,))
    np.testing.assert_allclose(J_rate @ v, screws.at(q).Jdot_v(v), atol=1e-13)


@pytest.mark.long
def test_the_derivative_with_respect_to_an_offset_is_how_the_links_are_turned(screws):
    q, _ = motions(screws.n, ())

    def tip(offsets):
        return screws_with(offsets).at(jax.numpy.asarray(q)).p_WE

    def screws_with(offsets):
        return replace(screws, offsets=offsets)

    by_tool = jax.jacfwd(tip)(jax.numpy.asarray(screws.offsets))[:, -1]
    turned = screws.at(q).R_WE @ screws.R_WE.T
    np.testing.assert_allclose(by_tool, turned, atol=1e-13)


@pytest.mark.long
def test_a_loop_in_jax_goes_where_the_same_loop_in_numpy_goes(screws):
    """1e-12: 200 steps, each adding some roundings."""
    q, _ = motions(screws.n, (8,))

    def step(q):
        moved = screws.at(q)
        return q - 0.01 * (moved.J * (moved.p_WE - 0.2)[..., None]).sum(axis=-2)

    wanted = q
    for _ in range(200):
        wanted = step(wanted)
    found, _ = jax.lax.scan(lambda q, _: (step(q), None), jax.numpy.asarray(q), length=200)
    assert np.abs(wanted - q).max() > 0.05
    np.testing.assert_allclose(found, wanted, atol=1e-12)


def test_arrays_of_32_bits_are_refused(screws):
    q = jax.numpy.zeros(screws.n, dtype=jax.numpy.float32)
    with pytest.raises(InvalidInputError, match=r"^position: must be of float64, not float32; in"):
        screws.at(q)
