"""Functions of large arrays, which are loops in C, against JAX."""

import subprocess

import numpy as np
import pytest
from c_helpers import in_c

from drake_rnn import load_arm, require_jax
from drake_rnn.compiled.library import compiler
from drake_rnn.robot.clearance.arm_clearance import arm_clearance
from drake_rnn.robot.clearance.obstacles import BallObstacle

pytest.importorskip("jax")
pytestmark = pytest.mark.skipif(compiler() is None, reason="needs a C compiler")
jax = require_jax()
jnp, lax = jax.numpy, jax.lax

RNG = np.random.default_rng(5)
TABLE = RNG.normal(size=(12, 88, 3))
NUMBERS = RNG.integers(0, 12, 88)
PLACE = jnp.arange(88)


def first_of_least(x, axis):
    return jnp.take_along_axis(x, jnp.expand_dims(jnp.argmin(x, axis=axis), axis), axis=axis)


def active_set(x):
    """Picks the rows of the least entries one by one, in a loop that carries all."""

    def advance(k, carry):
        count, picked, rows = carry
        j = jnp.argmin(rows.min(axis=1) + jnp.where(picked[0] == PLACE, 10.0, 0.0))
        return count + 1, picked.at[count].set(j), rows.at[j].set(10.0 + k)

    carry = (0, jnp.zeros(7, int), x)
    count, picked, rows = lax.fori_loop(0, 7, advance, carry)
    return jnp.concatenate([count[None], picked, x[picked].ravel(), rows.ravel()])


def halving(x):
    """Ends early, and what it carries changes places."""

    def advance(carry):
        k, a, b = carry
        return k + 1, 0.5 * b, jnp.where(k == PLACE, a, b[::-1])

    return jnp.stack(
        lax.while_loop(lambda c: (c[0] < 50) & (abs(c[1]).max() > 1e-3), advance, (0, x, 2.0 * x))[
            1:
        ]
    )


def halved_until_small(x):
    """Ends for each robot at a time of its own."""
    return lax.while_loop(
        lambda c: (c[0] < 20) & (abs(c[1]).max() > 0.1), lambda c: (c[0] + 1, 0.5 * c[1]), (0, x)
    )[1]


def motions(q):
    """Products of seven rotations and translations of 12 postures."""
    R, p, offset = jnp.eye(3), jnp.zeros((12, 3)), jnp.array([0.1, 0.2, 0.3])
    for k in range(7):
        p = p + jnp.einsum("...ij,j->...i", R, offset)
        c, s = jnp.cos(q[:, k]), jnp.sin(q[:, k])
        o, i = jnp.zeros_like(c), jnp.ones_like(c)
        rows = ((c, -s, o), (s, c, o), (o, o, i)) if k % 2 else ((i, o, o), (o, c, -s), (o, s, c))
        R = R @ jnp.stack([jnp.stack(row, axis=-1) for row in rows], axis=-2)
    return jnp.concatenate((R, p[..., None]), axis=-1)


def nested(x):
    def outer(k, y):
        return lax.fori_loop(0, 2, lambda j, z: z + jnp.sin(j * y) + k, y)

    return lax.fori_loop(0, 3, outer, x)


def branch(x):
    """Large results and small ones; one side leaves a large array as it was."""
    y = 2.0 * x
    large, total = lax.cond(
        x[0] > 0.0,
        lambda x: (jnp.sin(x) + y, (jnp.cos(x) * y).sum()),
        lambda x: (y, x[3]),
        x,
    )
    return jnp.concatenate((large[::-1], total[None]))


GROUPS = {
    "entries": (
        [(12, 88, 3), (12, 3), (88, 3), (88,)],
        [
            lambda x, a, b, c: jnp.where(x > 0.3, x * TABLE, x - TABLE[:1]) + jnp.sqrt(abs(x)),
            lambda x, a, b, c: a[:, None] * b + TABLE,
            lambda x, a, b, c: jnp.clip(x, -0.5, 0.5) + jnp.sign(x) + x**3 + jnp.floor(x),
            lambda x, a, b, c: x * (c.argmax() == PLACE)[:, None] + (PLACE % 3)[:, None],
            lambda x, a, b, c: jnp.sort(x, axis=-1),
            lambda x, a, b, c: jnp.where(jnp.isfinite(c / 0.0) | (c > 0.2), c, -c),
        ],
    ),
    "moves": (
        [(12, 88, 3), (12, 50), (12, 38)],
        [
            lambda x, a, b: x[1:] - x[:-1] + x[::-1][1:],
            lambda x, a, b: x[:, NUMBERS, ::-1] * 1.5,
            lambda x, a, b: x.reshape(88, 12, 3) * 2.0 + x.reshape(-1)[5],
            lambda x, a, b: jnp.transpose(x, (1, 2, 0)) * 2.0,
            lambda x, a, b: jnp.concatenate((a, 2.0 * b, jnp.zeros((12, 5))), axis=1) + 1.0,
            lambda x, a, b: jnp.stack((a, 2.0 * a), axis=1),
            lambda x, a, b: jnp.concatenate(jnp.split(x, 4, axis=1)[::-1], axis=1) - x,
            lambda x, a, b: jnp.pad(x[..., 0], ((1, 2), (0, 0))) * 3.0,
            lambda x, a, b: jnp.stack([a[0, :7] * k for k in range(12)]).sum(axis=1),
        ],
    ),
    "sums": (
        [(12, 88), (12, 89), (12, 88, 3), (100,)],
        [
            lambda x, y, z, w: jnp.stack([x.sum(0), x.max(0), x.min(0), x.prod(0)]),
            lambda x, y, z, w: jnp.stack([x.sum(1), y.max(1), y.min(1), (y > 2.0).any(1) * 1.0]),
            lambda x, y, z, w: jnp.stack([z.sum(2), z.max(2), z.argmax(2) * 1.0]),
            lambda x, y, z, w: jnp.stack([z.sum(), z.max(), z.min(), z.argmin(), z.argmax()]),
            lambda x, y, z, w: jnp.stack([(z < 9.0).all(), (z > 9.0).any(), (w > 0.0).sum()]),
            lambda x, y, z, w: jnp.concatenate([x.argmin(0), y.argmax(1), w.argmin()[None]]),
            lambda x, y, z, w: jnp.cumsum(x, 0) + lax.cummax(x, 1) + lax.cummin(x, 0, reverse=True),
            lambda x, y, z, w: jnp.logical_xor(x > 0.0, x < 1.0).sum(0),
            lambda x, y, z, w: jnp.linalg.norm(z, axis=-1) + jnp.linalg.norm(w),
        ],
    ),
    "products": (
        [(12, 7), (7, 88), (12, 88, 3, 3), (12, 88, 3), (88,)],
        [
            lambda q, a, R, x, w: q @ a,
            lambda q, a, R, x, w: (R @ x[..., None])[..., 0],
            lambda q, a, R, x, w: jnp.einsum("...i,...i->...", x, x[::-1]),
            lambda q, a, R, x, w: a @ w,
            lambda q, a, R, x, w: a @ (w[:, None] * a.T),
            lambda q, a, R, x, w: jnp.linalg.solve(R[0] + 9.0 * jnp.eye(3), x[0, :, :, None]),
            lambda q, a, R, x, w: jnp.linalg.eigvalsh(R[1] + jnp.swapaxes(R[1], -1, -2)),
            lambda q, a, R, x, w: motions(q),
            lambda q, a, R, x, w: jax.nn.one_hot(jnp.argsort(w[:7]), 88) @ w,
        ],
    ),
    "indices": (
        [(12, 88, 3), (12, 88), (88,), (7, 3)],
        [
            lambda x, y, w, s: first_of_least(y, 0),
            lambda x, y, w, s: first_of_least(y, 1),
            lambda x, y, w, s: first_of_least(x, 2),
            lambda x, y, w, s: jnp.concatenate((x[:, w.argmax()], x[w.argmax() // 8, ::8]), axis=0),
            lambda x, y, w, s: x[w.argmax() // 8, w.argmax()],
            lambda x, y, w, s: jnp.take(x, 3 * jnp.argsort(w[:5]), axis=1),
            lambda x, y, w, s: lax.dynamic_slice(x, (w.argmax() // 9, 3, 0), (2, 80, 3)),
            lambda x, y, w, s: lax.dynamic_update_slice(x, x[5:7], (w.argmax() // 8, 0, 0)),
            lambda x, y, w, s: lax.dynamic_update_slice(w, s[:, 0], (w.argmax(),)),
            lambda x, y, w, s: x[0].at[w.argmax()].set(s[0]).at[3].set(1.0),
            lambda x, y, w, s: s.at[jnp.argmax(s[:, 0])].set(5.0).at[jnp.array([1, 2])].set(s[0]),
            lambda x, y, w, s: w.at[w.argmin()].add(2.0).at[w.argmax()].set(0.0),
            lambda x, y, w, s: jnp.sort(y, axis=1) + jnp.sort(w) + jnp.argsort(jnp.round(w)),
            lambda x, y, w, s: w[lax.top_k(-w, 16)[1]],
            lambda x, y, w, s: jax.vmap(lambda r: r.at[r.argmax()].set(0.0))(y),
            lambda x, y, w, s: jnp.interp(w, jnp.linspace(-1.0, 1.0, 20), jnp.arange(20.0) ** 2),
        ],
    ),
    "loops": (
        [(88,), (88, 3), (100, 2), (30, 88)],
        [
            lambda w, x, r, y: active_set(x),
            lambda w, x, r, y: jax.vmap(active_set)(x[None])[0],
            lambda w, x, r, y: halving(w),
            lambda w, x, r, y: nested(w),
            lambda w, x, r, y: jax.vmap(halved_until_small)(r[:12]),
            lambda w, x, r, y: branch(w),
            lambda w, x, r, y: branch(-w),
            lambda w, x, r, y: lax.switch(w[:3].argmax(), [jnp.sin, jnp.cos, lambda x: 0.0 * x], w),
            lambda w, x, r, y: lax.scan(lambda c, e: (c + e.sum(), (e * c, c)), 0.1, r)[1][0],
            lambda w, x, r, y: lax.scan(lambda c, e: (c + e, c * e), w, y, reverse=True)[1],
            lambda w, x, r, y: lax.scan(lambda c, e: (c + e, c * e), w, y[:7])[0],
            lambda w, x, r, y: lax.scan(lambda c, e: (0.9 * c + e, c[:2]), x[0], x)[1],
        ],
    ),
}


def together(functions):
    return lambda *arrays: jnp.concatenate(
        [jnp.asarray(each(*arrays), float).ravel() for each in functions]
    )


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.long] * (name not in ("sums", "moves")))
        for name in GROUPS
    ],
)
def test_c_computes_what_jax_does(name):
    """Functions one by one, of the same arrays, in one program in C."""
    shapes, functions = GROUPS[name]
    call, text = in_c(together(functions), *shapes)
    by_jax = jax.jit(lambda *arrays: [each(*arrays) for each in functions])
    for _ in range(3):
        arrays = [RNG.normal(size=shape) for shape in shapes]
        expected = [np.asarray(each, float).ravel() for each in by_jax(*arrays)]
        found = np.split(call(*arrays), np.cumsum([each.size for each in expected])[:-1])
        for k, (each, right) in enumerate(zip(found, expected, strict=True)):
            size = max(1.0, abs(right).max())
            np.testing.assert_allclose(each, right, rtol=1e-14, atol=2e-14 * size, err_msg=str(k))
    assert text.count("\n") < 2500


def test_entries_are_one_loop():
    """A chain of operations goes through memory only where it must."""
    _, text = in_c(lambda x, y: jnp.sqrt(jnp.sum((x - y) ** 2, axis=-1)) * 2.0, (88, 3), (88, 3))
    # The loop, and that in which the results are copied.
    assert text.count("for (") == 2


def test_what_one_side_needs_is_in_its_branch():
    def choose(x):
        return lax.cond(x[0] > 0.0, lambda x: jnp.exp(x).sum(), lambda x: x[1], x)[None]

    call, text = in_c(choose, (88,))
    assert text.index("if (") < text.index("exp(")
    assert call(np.r_[-1.0, 7.0, np.zeros(86)]) == 7.0


def test_rounds_that_a_flag_leaves_out_are_not_made():
    """What is chosen by one flag of a lane is computed with the flag alone, and sums go on."""

    def choose(x, y):
        flags = x[0] > 0.0
        length = jnp.sqrt((x * x).sum(axis=0) + y * y)
        parts = jnp.where(flags, x[:1] / length / (1.0 + length) + jnp.tanh(y), -jnp.inf)
        sums = jnp.cumsum(jnp.where(flags, jnp.exp(y) / (1.0 + length) / length, 0.0), axis=1)
        none = lax.cond(x[1, 0] > 0.0, lambda: -0.0 * jnp.ones((7, 88)), lambda: jnp.zeros((7, 88)))
        return jnp.concatenate((parts, sums, jnp.copysign(1.0, none)))

    call, text = in_c(choose, (3, 88), (7, 88))
    assert text.index("if (n") < text.index("tanh(")
    for sign in (1.0, -1.0):
        x, y = RNG.normal(size=(3, 88)), RNG.normal(size=(7, 88))
        x[1, 0] = sign
        parts = np.ones((3, 7, 88))
        flags, length = x[0] > 0.0, np.sqrt((x * x).sum(axis=0) + y * y)
        parts[0] = np.where(flags, x[:1] / length / (1.0 + length) + np.tanh(y), -np.inf)
        parts[1] = np.cumsum(np.where(flags, np.exp(y) / (1.0 + length) / length, 0.0), axis=1)
        parts[2] *= -sign
        np.testing.assert_allclose(call(x, y).reshape(parts.shape), parts, rtol=1e-13)


def test_tables_are_constants():
    _, text = in_c(lambda x: x * TABLE[0, :, 0], (88,))
    assert text.count("static const double") == 1


def clearance_of_a_panda():
    """The distances of all pairs of a Panda with hand among five balls, and their least."""
    arm, centers = load_arm("panda"), RNG.uniform(-0.8, 0.8, (5, 3)) + np.array([0.0, 0.0, 0.6])
    balls = [
        BallObstacle(name=f"ball {k}", center=each, radius=0.05) for k, each in enumerate(centers)
    ]
    clearance, _ = arm_clearance(arm, balls, arm.home)
    pairs = clearance._every
    capsules, sides = pairs.arm, pairs.sides
    turns, rotations, _, constants = capsules.poses._parts

    def dot(a, b):
        return jnp.einsum("...i,...i->...", a, b)

    def ends(q):
        p = q.T[:, :, None, None]
        each = constants + jnp.sin(p) * turns + (1.0 - jnp.cos(p)) * rotations
        X = [jnp.broadcast_to(constants[0], each[0].shape), each[0]]
        for k in range(1, 7):
            X.append(X[-1] @ each[k])
        X = jnp.stack(X, axis=1)[:, capsules.links]
        return jnp.swapaxes((X @ capsules._columns)[..., :3, :], -1, -2)

    def distances(A, B):
        p, q = A[..., 0, :], B[..., 0, :]
        d, e, r = A[..., 1, :] - p, B[..., 1, :] - q, p - q
        a, f, b, c, g = dot(d, d), dot(e, e), dot(d, e), dot(d, r), dot(e, r)
        det = a * f - b * b
        s = jnp.clip((b * g - c * f) / jnp.where(det > 1e-14 * a * f, det, jnp.inf), 0.0, 1.0)
        t = jnp.clip((b * s + g) / jnp.maximum(f, 1e-300), 0.0, 1.0)
        s = jnp.clip((b * t - c) / jnp.maximum(a, 1e-300), 0.0, 1.0)
        apart = p + s[..., None] * d - q - t[..., None] * e
        return jnp.sqrt(dot(apart, apart))

    def function(q):
        links = ends(q)
        fixed = jnp.broadcast_to(sides.fixed, (len(q), *sides.fixed.shape))
        second = jnp.concatenate((links[:, sides.own_second], fixed), axis=1)
        gaps = distances(links[:, sides.round_first], second) - pairs.radii
        return jnp.concatenate((gaps.min(axis=0), gaps.min()[None], gaps.argmin()[None]))

    return clearance, function


def test_distances_of_an_arm_are_compact():
    clearance, function = clearance_of_a_panda()
    call, text = in_c(function, (12, 7))
    assert len(text) < 40_000
    q = load_arm("panda").home + RNG.uniform(-1.0, 1.0, (12, 7))
    gaps = clearance.gaps(q)
    expected = [*gaps.min(axis=0), gaps.min(), gaps.argmin()]
    np.testing.assert_allclose(call(q), expected, rtol=0.0, atol=1e-14)


MAIN = """\
#include <stdio.h>
int f(const double *given, double *found);
int main(void)
{
    static double given[%d], found[%d];
    for (int k = 0; k < %d; ++k) {
        given[k] = 0.001 * ((37 * k) %% 1999) - 1.0;
    }
    return f(given, found);
}
"""


@pytest.mark.long
@pytest.mark.parametrize("name", GROUPS)
def test_no_sanitizer_finds_fault(name, tmp_path):
    shapes, functions = GROUPS[name]
    _, text = in_c(together(functions), *shapes)
    size = sum(int(np.prod(shape)) for shape in shapes) + 1
    (tmp_path / "f.c").write_text(text)
    (tmp_path / "main.c").write_text(MAIN % (size, 100_000, size))
    options = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-ffp-contract=off"]
    files = [str(tmp_path / each) for each in ("f.c", "main.c")]
    for extra in (["-O2"], ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]):
        command = [*compiler(), *options, *extra, "-o", str(tmp_path / "f"), *files, "-lm"]
        built = subprocess.run(command, capture_output=True, text=True, check=False)
        if "sanitize" in extra[-1] and built.returncode and "lasan" in built.stderr:
            pytest.skip("the compiler has no sanitizers")
        assert built.returncode == 0, built.stderr
        assert subprocess.run([str(tmp_path / "f")], check=False).returncode == 0
