"""The velocity within a box that does a task best, against all sets of joints at their bounds."""

from itertools import product

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from drake_rnn.laws.parts.programs import (
    unbounded_velocity,
    within_box,
)
from row_helpers import each

SIZES = [(2, 2), (2, 4), (3, 3), (3, 5), (3, 7), (6, 6), (6, 7), (2, 7)]
SOFT = 1e-6


def cost(v, J, b, g, S):
    error = J @ v - b
    return 0.5 * np.sum((v - g) ** 2) + 0.5 * error @ np.linalg.solve(S, error)


def best_of_all(J, b, g, S, lower, upper):
    """The solution, by trying every choice of free joints and of bounds for the others."""
    n = g.size
    H = np.eye(n) + J.T @ np.linalg.solve(S, J)
    f = g + J.T @ np.linalg.solve(S, b)
    found, least = None, np.inf
    for sides in product((0, 1, 2), repeat=n):
        sides = np.array(sides)
        v = np.select([sides == 1, sides == 2], [lower, upper], 0.0)
        free = sides == 0
        if free.any():
            right = f[free] - H[np.ix_(free, ~free)] @ v[~free]
            v[free] = np.linalg.solve(H[np.ix_(free, free)], right)
        if (v >= lower - 1e-9).all() and (v <= upper + 1e-9).all():
            v = np.clip(v, lower, upper)
            if (now := cost(v, J, b, g, S)) < least:
                found, least = v, now
    return found


def program(rng, m, n, kind="plain"):
    """A random program; ``kind`` says what is degenerate about it."""
    J = 0.5 * rng.normal(size=(m, n))
    lower = -rng.uniform(0.01, 1.0, n)
    upper = rng.uniform(0.01, 1.0, n)
    g = rng.normal(size=n)
    b = rng.normal(size=m) * 10.0 ** rng.uniform(-2, 1)
    if kind == "equal":
        held = rng.random(n) < 0.5
        upper = np.where(held, lower, upper)
    elif kind == "at_bounds":
        g, b = np.where(rng.random(n) < 0.5, lower, upper), 0.0 * b
    elif kind == "rank_one":
        J = np.outer(rng.normal(size=m), rng.normal(size=n))
    elif kind == "zero":
        J, b = 0.0 * J, b * (rng.random() < 0.5)
    elif kind == "aside":
        lower, upper = lower + 1.5, upper + 1.5
    elif kind == "tight":
        lower, upper = 1e-4 * lower, 1e-4 * upper
    return J, b, g, SOFT * np.diag(10.0 ** rng.uniform(0, 2, m)), lower, upper


KINDS = ("plain", "equal", "at_bounds", "rank_one", "zero", "aside", "tight")


@each("kind", KINDS)
@each(("m", "n"), [s for s in SIZES if s[1] < 6])
def test_it_is_the_best_of_all_choices_of_joints_at_their_bounds(m, n, kind):
    """1e-6 rad/s: the reference solves for v, whose equations have the condition 1/softness."""
    rng = np.random.default_rng([3, m, n, len(kind)])
    for _ in range(4):
        given_ = program(rng, m, n, kind)
        v, wished = within_box(*given_), best_of_all(*given_)
        np.testing.assert_allclose(v, wished, rtol=0, atol=1e-6)


def assert_solved(v, J, b, g, S, lower, upper):
    """A velocity in the box meets the conditions of the solution to 1e-8 rad/s.

    At a bound a joint wants to go on, elsewhere it wants what it has. An error of a velocity makes
    up to 1/softness as much of what is wanted, so this is divided by the Hessian. Of 16,800
    programs of each size the worst is off by 4e-9 to 7e-9, where J has rank one, as one or another
    of four processors adds.
    """
    assert (v >= lower).all()
    assert (v <= upper).all()
    H = np.eye(v.size) + J.T @ np.linalg.solve(S, J)
    more = (g + J.T @ np.linalg.solve(S, b - J @ v) - v) / np.diag(H)
    held = lower == upper
    assert (more[(v == lower) & ~held] <= 1e-8).all()
    assert (more[(v == upper) & ~held] >= -1e-8).all()
    inside = (v > lower) & (v < upper)
    if inside.any():
        missing = np.linalg.solve(H[np.ix_(inside, inside)], (np.diag(H) * more)[inside])
        assert np.abs(missing).max() <= 1e-8


@each("kind", KINDS)
@each(("m", "n"), SIZES)
def test_joints_at_a_bound_want_beyond_it_and_all_others_have_what_they_want(m, n, kind):
    rng = np.random.default_rng([4, m, n, len(kind)])
    for _ in range(60):
        given_ = program(rng, m, n, kind)
        assert_solved(within_box(*given_), *given_)


@settings(max_examples=150)
@given(st.integers(0, 2**32 - 1), st.sampled_from(SIZES), st.sampled_from(KINDS))
def test_any_program_is_solved_in_the_box(seed, size, kind):
    given_ = program(np.random.default_rng(seed), *size, kind)
    assert_solved(within_box(*given_), *given_)


@each(("m", "n"), SIZES)
def test_one_program_and_many_have_the_same_solution(m, n):
    """1e-9: sums in another order, and softness of 1e-6 beneath them."""
    rng = np.random.default_rng([5, m, n])
    each = [program(rng, m, n, kind) for kind in KINDS for _ in range(20)]
    together = within_box(*(np.array(values) for values in zip(*each, strict=True)))
    alone = np.array([within_box(*given_) for given_ in each])
    np.testing.assert_allclose(together, alone, rtol=0, atol=1e-9)


def test_within_a_wide_box_it_is_what_the_program_without_one_gives():
    rng = np.random.default_rng(6)
    J, b, g, S, lower, upper = program(rng, 3, 7)
    v = within_box(J, b, g, S, 1e3 * lower, 1e3 * upper)
    np.testing.assert_array_equal(v, unbounded_velocity(J, b, g, S))
    # The equations for v itself, whose condition is 1e6.
    H = np.eye(7) + J.T @ np.linalg.solve(S, J)
    np.testing.assert_allclose(v, np.linalg.solve(H, g + J.T @ np.linalg.solve(S, b)), atol=1e-8)


def test_without_bounds_on_some_joints_the_others_keep_theirs():
    rng = np.random.default_rng(7)
    for _ in range(50):
        J, b, g, S, lower, upper = program(rng, 3, 7, "tight")
        free = np.arange(7) % 2 == 0
        bounds = np.where(free, -np.inf, lower), np.where(free, np.inf, upper)
        v = within_box(J, b, g, S, *bounds)
        # Four free joints do the three rows.
        assert np.abs(J @ v - b).max() < 1e-2 * np.abs(b).max() + 1e-3
        assert_solved(v, J, b, g, S, *bounds)


def test_a_task_that_the_box_does_not_allow_is_done_as_well_as_it_can_be():
    """Two joints push along one line, the second no more than 0.1: the first takes its part."""
    J, S = np.array([[1.0, 1.0]]), np.array([[1e-9]])
    v = within_box(J, np.array([1.0]), np.zeros(2), S, -np.ones(2), np.array([1.0, 0.1]))
    np.testing.assert_allclose(v, [0.9, 0.1], atol=1e-8)
    beyond = within_box(J, np.array([9.0]), np.zeros(2), S, -np.ones(2), np.array([1.0, 0.1]))
    np.testing.assert_array_equal(beyond, [1.0, 0.1])
