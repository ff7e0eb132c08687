"""The law `adaptive` among obstacles: nothing is touched, and no bound is broken."""

from functools import cache

import numpy as np
import pytest
from adaptive_helpers import HOME, LIMITS, PANDA, N, adaptive, circle, excess, moved

from drake_rnn import InvalidInputError, load_arm
from drake_rnn.arrays.algebra import require_jax
from drake_rnn.laws.parts import safe_velocity as held_clear
from drake_rnn.laws.parts.programs import (
    Rows,
    cheapest,
    within_box,
    within_rows,
)
from drake_rnn.laws.parts.safe_velocity import Avoidance
from drake_rnn.laws.parts.secondary import Secondary
from drake_rnn.laws.parts.world import Certificate
from drake_rnn.robot.clearance.arm_clearance import arm_clearance
from drake_rnn.robot.clearance.obstacles import make_obstacles
from row_helpers import each

HELD = 1e-9
P_START = PANDA.p_WE(HOME)
AHEAD = np.array([0.0, 0.12, 0.0])
FLOOR = Avoidance().floor


def clearance_of(*obstacles):
    found, _ = arm_clearance(load_arm("panda"), make_obstacles(list(obstacles)), HOME)
    return found


def ball(center, radius=0.03):
    return {"kind": "ball", "center": np.asarray(center).tolist(), "radius": radius}


def pushed(way, after=0.2):
    """A point that runs through an obstacle: the tool's start, moved on along a way."""

    def desired(t):
        return P_START + np.asarray(way) * np.clip((t - after) / 1.0, 0.0, 1.0)

    return desired


@cache
def stopped(**changes):
    """An arm that is told to go to the middle of a ball 0.12 m ahead of its tool."""
    clearance = clearance_of(ball(P_START + AHEAD))
    law = adaptive(clearance=clearance, kappa=100.0, **changes)
    return clearance, law, moved(law, pushed(AHEAD), 2.0)


def test_an_arm_that_is_told_to_go_into_a_ball_stops_before_it_with_every_bound_held():
    clearance, law, motion = stopped()
    assert clearance.least_along(motion.q).min() >= FLOOR
    assert max(excess(motion, LIMITS).values()) < HELD
    # Rows stop it at `distance`; hardly anything is held back.
    assert law.sampled(1e-3).state.part(motion.x, "held_back").item() < 100.0
    assert clearance.gaps(motion.q[-1]).min() == pytest.approx(Avoidance().distance, abs=2e-3)


@pytest.mark.long
def test_joints_that_make_way_glide_slower_before_a_ball():
    """Without that they go on along it, from one row to the next; flange and tool both meet it."""
    made_way, stayed = (
        np.abs(motion.v[-1000:]).max()
        for _, _, motion in (stopped(), stopped(secondary=Secondary(obstacles=0.0)))
    )
    assert made_way < 0.2 < stayed


@pytest.mark.parametrize(
    "jerk", [20.0, *(pytest.param(jerk, marks=pytest.mark.long) for jerk in (5.0, 100.0))]
)
def test_so_does_one_whose_jerk_is_bounded(jerk):
    limits = LIMITS.replace(jerk=jerk)
    clearance, terms = clearance_of(ball(P_START + AHEAD)), Secondary(obstacles=0.0)
    law = adaptive(clearance=clearance, secondary=terms, kappa=100.0, limits=limits)
    motion = moved(law, pushed(AHEAD), 1.6)
    assert law.clearance.least_along(motion.q).min() >= FLOOR
    assert max(excess(motion, limits).values()) < HELD
    # Rows, for the velocity that the acceleration leads to, do here what they do without the jerk.
    assert law.sampled(1e-3).state.part(motion.x, "held_back").item() < 100.0
    assert law.clearance.gaps(motion.q[-1]).min() == pytest.approx(Avoidance().distance, abs=2e-3)


def test_without_avoidance_the_same_arm_goes_through_it():
    clearance, _, motion = stopped(avoidance="none")
    assert clearance.least_along(motion.q).min() < -0.02
    assert motion.error[-1] < 1e-6


@pytest.mark.long
@pytest.mark.parametrize("jerk", [None, 20.0])
def test_what_is_certified_is_free_at_all_times_and_no_pair_is_nearer_than_is_known(
    monkeypatch, jerk
):
    """On the way into a ball, with the certificate alone to stop the arm: the program has no rows.

    Whatever that says, the floor is kept and every bound is held. Most pairs are known by the way
    that the joints have gone since they were looked at: never nearer than that, in all samples.
    What is certified is looked at twice a sample of its stop.
    """
    looked = {True: 0, False: 0}
    is_given = Certificate.is_given

    def checked(self, u, q, left, along, stop, world):
        found = is_given(self, u, q, left, along, stop, world)
        looked[found] += 1
        assert (left <= clearance.gaps(q) + 1e-12).all()
        if found and looked[True] % 9 == 0:
            k = np.arange(0.0, stop.samples(u) + 0.5, 0.5)
            assert clearance.gaps(q + stop.travel(u, k)).min() >= FLOOR - 1e-12
        return found

    monkeypatch.setattr(Certificate, "is_given", checked)
    monkeypatch.setattr(held_clear.WithinClear, "_rows", lambda *_: None)
    clearance, terms = clearance_of(ball(P_START + AHEAD)), Secondary(obstacles=0.0)
    limits = LIMITS.replace(jerk=jerk)
    law = adaptive(clearance=clearance, secondary=terms, kappa=100.0, limits=limits)
    motion = moved(law, pushed(AHEAD), 1.5)
    assert looked[True] > 400
    assert looked[False] > 50
    assert clearance.least_along(motion.q).min() >= FLOOR
    assert max(excess(motion, limits).values()) < HELD
    assert law.sampled(1e-3).state.part(motion.x, "held_back").item() > 100.0


@pytest.mark.long
def test_rows_alone_stop_later_than_they_are_told(monkeypatch):
    """Without the certificate the arm stays off the ball too, but nothing promises it."""
    clearance = clearance_of(ball(P_START + AHEAD))
    monkeypatch.setattr(Certificate, "is_given", lambda *_: True)
    motion = moved(adaptive(clearance=clearance, kappa=100.0), pushed(AHEAD), 1.5)
    assert clearance.least_along(motion.q).min() == pytest.approx(Avoidance().distance, abs=2e-3)


def test_with_nothing_near_the_arm_moves_as_without_avoidance_to_the_last_bit():
    free = moved(adaptive(kappa=1000.0), circle(), 1.5)
    far = clearance_of(ball([-0.6, 0.0, 0.8]))
    kept = moved(adaptive(kappa=1000.0, clearance=far), circle(), 1.5)
    assert np.array_equal(free.q, kept.q)


@pytest.mark.parametrize(
    "seed", [0, pytest.param(1, marks=pytest.mark.long), pytest.param(2, marks=pytest.mark.nightly)]
)
def test_targets_that_jump_among_balls_touch_nothing_and_break_no_bound(seed):
    rng = np.random.default_rng(seed)
    obstacles = []
    while len(obstacles) < 3:
        found = ball(P_START + rng.uniform(-0.15, 0.15, 3))
        if clearance_of(found).gaps(HOME).min() > 0.015:
            obstacles.append(found)
    clearance = clearance_of(*obstacles)
    jumps = P_START + rng.uniform(-0.2, 0.2, (20, 3))
    motion = moved(adaptive(clearance=clearance), lambda t: jumps[int(t / 0.15) % 20], 1.5)
    assert clearance.least_along(motion.q).min() >= FLOOR
    assert max(excess(motion, LIMITS).values()) < HELD


def test_the_stop_that_was_certified_is_taken_where_nothing_else_is_free(monkeypatch):
    """Even if the program returned the worst corner of its box at every sample."""
    monkeypatch.setattr(held_clear, "within_box", lambda J, b, g, s, low, high: high)
    monkeypatch.setattr(held_clear, "within_rows", lambda v, J, b, g, s, low, high, rows: high)
    clearance = clearance_of()
    motion = moved(adaptive(clearance=clearance), pushed([0, 0, 0]), 1.5)
    assert clearance.least_along(motion.q).min() >= FLOOR
    assert max(excess(motion, LIMITS).values()) < HELD


@each("seed", range(20))
def test_the_program_with_rows_costs_least_among_what_is_allowed(seed):
    rng = np.random.default_rng(seed)
    m, n, k = 3, 7, rng.integers(1, 6)
    J, b, g = rng.normal(size=(m, n)), 0.1 * rng.normal(size=m), rng.normal(size=n)
    lower, upper = -rng.uniform(0, 1, n), rng.uniform(0, 1, n)
    A = rng.normal(size=(k, n))
    A /= np.linalg.norm(A, axis=1, keepdims=True)
    within = rng.uniform(lower, upper)
    c = A @ within - rng.uniform(0.0, 0.1, k)
    v = cheapest(J, b, g, 1e-3 * np.eye(m), lower, upper, Rows(A, c))
    assert (v >= lower).all()
    assert (v <= upper).all()
    assert (A @ v - c).min() > -1e-6
    share = rng.uniform(0.0, 1.0, (4000, 1)) ** 4
    others = within + share * (rng.uniform(lower, upper, (4000, n)) - within)
    others = np.concatenate((others, v + share * (others - v)))
    others = others[(others @ A.T >= c).all(axis=1)]
    assert len(others) > 100

    def cost(v):
        return ((v - g) ** 2).sum(axis=-1) + 1e3 * ((v @ J.T - b) ** 2).sum(axis=-1)

    assert cost(v) <= cost(others).min() + 1e-5


def random_program(rng, k):
    """A program of 7 joints and k rows, some of them much alike, tight or impossible to keep."""
    n, kind = 7, rng.integers(6)
    J, b = 0.4 * rng.normal(size=(3, n)), rng.choice([0.01, 0.1, 1.0]) * rng.normal(size=3)
    size = rng.choice([1e-3, 1e-2, 1.0])
    lower, upper = -size * rng.uniform(0, 1, n), size * rng.uniform(0, 1, n)
    A = rng.normal(size=(k, n))
    if kind == 0:
        A = A[rng.integers(0, 3, k)] + 1e-3 * rng.normal(size=(k, n))
    A /= np.linalg.norm(A, axis=1, keepdims=True)
    within = lower if kind == 1 else rng.uniform(lower, upper)
    c = A @ within - size * rng.uniform(0, 0.1, k) * rng.choice([0, 1], k)
    c += size * rng.uniform(0, 2, k) * (kind == 2)
    g, softness = 0.3 * rng.normal(size=n), rng.choice([1e-6, 1e-4]) * np.eye(3)
    return J, b, g, softness, lower, upper, Rows(A, c)


@pytest.mark.long
def test_the_program_that_compiles_agrees_with_daqp_and_knows_when_there_is_no_solution():
    """Its rounds are JAX's; C makes the same."""
    jax = pytest.importorskip("jax")
    require_jax()
    solve = jax.jit(lambda *program: cheapest(*program[:6], Rows(*program[6:])))
    rng, found = np.random.default_rng(3), {True: 0, False: 0}
    for _ in range(150):
        *program, rows = random_program(rng, 40)
        expected = cheapest(*program, rows)
        velocity = np.array(solve(*program, *rows))
        found[bool(np.isfinite(expected).all())] += 1
        assert np.isfinite(velocity).all() == np.isfinite(expected).all()
        assert np.allclose(velocity, expected, rtol=0.0, atol=1e-9, equal_nan=True)
    assert min(found.values()) > 10


def test_a_task_that_rows_keep_from_being_done_has_a_price_that_is_bounded():
    """A row stops the way along x; to gain 1 mm/s of it, no joint moves at 1 rad/s."""
    program = (np.array([[1.0, 1e-3]]), np.array([0.1]), np.zeros(2), 1e-6 * np.eye(1))
    given = (*program, -np.ones(2), np.ones(2))
    stopped = Rows(np.array([[-1.0, 0.0]]), np.zeros(1))
    assert cheapest(*given, stopped)[1] > 0.9
    # It goes on as it went until now, but for 5 m/s of multiplier at a price of 101.
    for v in (np.zeros(2), np.array([0.0, 0.3])):
        expected = [0.0, (100.0 * v[1] + 5e-3) / 101.0]
        assert within_rows(v, *given, stopped) == pytest.approx(expected, abs=1e-4)
    # Where the row is not in the way, the task is done.
    done = within_box(*given)
    assert Rows(-stopped.A, stopped.c).hold(done)
    assert given[0] @ done == pytest.approx([0.1], abs=1e-6)


def test_what_a_law_with_obstacles_cannot_do_is_refused():
    with pytest.raises(InvalidInputError, match=r"start: tool and ball 1 are .* apart"):
        adaptive(clearance=clearance_of(ball(P_START)))
    with pytest.raises(InvalidInputError, match="distance: must be greater than floor"):
        Avoidance(floor=0.01, distance=0.01)
    law = adaptive(clearance=clearance_of())
    assert law.keeps_distance == FLOOR
    assert law.takes_many
    assert adaptive().keeps_distance is None
    assert law.state.parts.keys() == {"v"}
    assert law.limits.size == N
