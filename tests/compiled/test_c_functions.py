"""Operations, choices and loops in C, against JAX."""

import numpy as np
import pytest
from c_helpers import in_c

from drake_rnn import InvalidInputError, require_jax
from drake_rnn.compiled.library import compiler

pytest.importorskip("jax")
pytestmark = pytest.mark.skipif(compiler() is None, reason="needs a C compiler")
jax = require_jax()
jnp, lax = jax.numpy, jax.lax


def loop(x):
    """Newton's iterations for a square root, as many as they need."""

    def goes_on(carry):
        k, y = carry
        return (k < 60) & (jnp.abs(y * y - x[0]) > 1e-15 * x[0])

    return jnp.stack([*lax.while_loop(goes_on, lambda c: (c[0] + 1, 0.5 * (c[1] + x[0] / c[1])),
                                      (0, 1.0 + x[0]))]).astype(float)  # fmt: skip


def loop_in_loop(x):
    def inner(k, y):
        return y + lax.fori_loop(0, 3, lambda j, z: z + jnp.sin(x[1] + j * z), y * k)

    return lax.fori_loop(0, 4, inner, x[0])[None]


def swap(x):
    """What is carried changes places: each takes the value that the other had."""
    return jnp.stack(lax.fori_loop(0, 5, lambda _, c: (c[1], c[0] + c[1]), (x[0], x[1])))


def branches(x):
    """A branch that is worth one, within another, whose value is used outside too."""
    far = jnp.sum(jnp.sqrt(jnp.abs(jnp.sin(x) * x[0] + x[1])))
    near = jnp.sum(jnp.cos(x * x[2]) / (1.0 + x * x))
    deep = jnp.where(x[1] > 0.0, near + jnp.sum(jnp.sin(3.0 * x)), far)
    return jnp.stack([jnp.where(x[0] > 0.0, far, deep), deep, jnp.where(x[2] > 0, near, 0.0)])


@pytest.mark.parametrize(
    "function",
    [
        lambda x: x[::-1] * 2.0 - x / 3.0 + 1.0 / (1.0 + x * x),
        lambda x: jnp.stack([x.max(), x.min(), x.sum(), x.prod(), jnp.abs(x).max()]),
        lambda x: jnp.clip(x, -0.3, 0.7) + jnp.sign(x) + jnp.maximum(x, x[0]) - jnp.minimum(x, 0.1),
        lambda x: jnp.floor(3.0 * x) + jnp.ceil(x) + jnp.round(2.5 * x) + (5.0 * x) % 1.5,
        lambda x: jnp.where(jnp.isfinite(x / 0.0) | (x > 0.2), x, -x),
        lambda x: jnp.argmax(x) * x + x[jnp.argmin(x)],
        lambda x: jnp.sort(x) + jnp.argsort(x) + jnp.cumsum(x),
        lambda x: x.at[1].set(7.0) + jnp.roll(x, 2) + jnp.pad(x[:2], (1, 2)),
        lambda x: jnp.outer(x, x) @ x + jnp.einsum("i,j->i", x, x),
        lambda x: x**3 + jnp.exp(x) + jnp.tanh(x) + jnp.cbrt(x),
        lambda x: jnp.signbit(x) * 1.0 + lax.cond(x[0] > 0, jnp.sin, jnp.cos, x),
        lambda x: lax.scan(lambda c, y: (c + y, c * y), x[0], x)[1],
        lambda x: lax.dynamic_slice(x, ((x[0] > 0).astype(int),), (2,)),
        loop,
        loop_in_loop,
        swap,
        branches,
    ],
)
def test_c_computes_what_jax_does(function):
    call, by_jax = in_c(function, (5,))[0], jax.jit(function)
    rng = np.random.default_rng(3)
    for _ in range(8):
        x = rng.normal(size=5)
        if function is loop:
            x = abs(x)
        expected = np.asarray(by_jax(x), float)
        np.testing.assert_allclose(call(x), expected, rtol=3e-14, atol=3e-15)


def test_what_is_no_number_stays_none():
    """A bound must not hide it, whichever side it is on."""
    call, _ = in_c(
        lambda x: jnp.stack(
            [jnp.maximum(x[0], 1.0), jnp.minimum(x[1], x[0]), jnp.maximum(x[0], x[1]), x.max()]
        ),
        (2,),
    )
    assert np.isnan(call(np.array([np.nan, 1.0]))).all()
    assert np.isnan(call(np.array([1.0, np.nan]))[1:]).all()


@pytest.mark.parametrize("n", [2, 3, 6])
def test_small_systems_and_eigenvalues(n):
    """Eigenvalues to rounding of the largest, of singular matrices too; a pivot that is zero."""
    solve, text = in_c(jnp.linalg.solve, (n, n), (n,))
    assert "factors" in text
    rng = np.random.default_rng(n)
    A, b = rng.normal(size=(n, n)), rng.normal(size=n)
    A[0, 0] = 0.0
    np.testing.assert_allclose(solve(A, b), np.linalg.solve(A, b), rtol=1e-11)
    eigen, _ = in_c(lambda A: jnp.concatenate([x.ravel() for x in jnp.linalg.eigh(A)]), (n, n))
    for rank in (n, n - 1, 1, 0):
        J = rng.normal(size=(n, max(rank, 1))) * 10.0 ** rng.uniform(-3, 3) * (rank > 0)
        gram = J @ J.T
        result = eigen(gram)
        w, V = result[:n], result[n:].reshape(n, n)
        size = max(np.linalg.norm(gram), 1e-300)
        np.testing.assert_allclose(w, np.linalg.eigvalsh(gram), atol=4e-16 * n * size)
        np.testing.assert_allclose(V @ V.T, np.eye(n), atol=1e-14)
        np.testing.assert_allclose(V * w @ V.T, gram, atol=1e-14 * size)


def test_what_does_not_change_in_a_loop_is_evaluated_before_it():
    _, text = in_c(lambda x: lax.fori_loop(0, 9, lambda _, y: y + jnp.sin(x[0]), x[1])[None], (2,))
    assert text.index("sin(") < text.index("for (")


def test_constants_and_zeros_cost_nothing():
    table = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    call, text = in_c(lambda x: table @ x + (np.sqrt(4.0) - 2.0), (3,))
    assert not {"*", "+"} & set(text.partition("{")[2])
    assert call(np.array([3.0, 4.0, 5.0])).tolist() == [3.0, -4.0]


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda x: jnp.linalg.qr(x.reshape(2, 2))[1], r"functions.py line \d+: operation 'qr'"),
        (lambda x: jnp.sort(jnp.outer(x, jnp.arange(125.0)).ravel()), "an order of 500"),
    ],
)  # fmt: skip
def test_what_c_has_not_is_refused(function, message):
    with pytest.raises(InvalidInputError, match=message):
        in_c(function, (4,))


def test_a_branch_that_each_joint_has_is_one_function_with_the_same_bits():
    def function(x, y):
        xp = np if isinstance(x, np.ndarray) else jnp
        z = x
        for k in range(12):
            z = xp.sqrt(1.0 + z * z) * (y + 0.1 * k) / (1.0 + xp.abs(z - y))
        return xp.stack((xp.where(x > 0.0, z, -x), xp.where(x > 0.0, z * z, y)))

    call, source = in_c(function, (7,), (7,))
    assert source.count("static void block_0(") == 1
    # It is called where it stood, behind the condition of its joint.
    assert source.count(" block_0(") == 1 + 7
    rng = np.random.default_rng(0)
    for x, y in rng.normal(size=(200, 2, 7)):
        assert np.array_equal(call(x, y), function(x, y))
