"""Accelerations over the ticks for which a velocity is held, and where a run may be cut."""

import numpy as np
import pytest

from drake_rnn.measures import last_end
from drake_rnn.measures.motion import secant

# 1/64 s between steps, held for two of them: exact in binary.
STEP, TICK = 1 / 64, 1 / 32
TIME = STEP * np.arange(9)
# The step at the end of a tick still has its value.
HELD = np.array([0, 1, 1, 3, 3, 2, 2, 2, 2.0])[:, np.newaxis]


@pytest.mark.parametrize("began", [0.0, 2.0, -0.5])
def test_a_held_velocity_changes_over_its_tick_and_not_within_it(began):
    """By 1, 2 and -1 rad/s, over 1/32 s each, wherever the run begins."""
    found = secant(TIME + began, HELD, TICK, began)[:, 0]
    np.testing.assert_array_equal(found, 32.0 * np.array([1, 1, 2, 2, -1, -1, 0, 0]))


def test_a_velocity_that_is_not_held_changes_over_each_step():
    found = secant(TIME, HELD, None, 0.0)[:, 0]
    np.testing.assert_array_equal(found, 64.0 * np.array([1, 0, 2, 0, -1, 0, 0, 0]))


@pytest.mark.parametrize("late", [1e-12, -1e-12])
def test_where_a_step_ends_a_rounding_error_off_it_belongs_to_the_tick_it_ends(late):
    time = TIME.copy()
    time[2::2] += late
    found = secant(time, HELD, TICK, 0.0)[:, 0]
    np.testing.assert_array_equal(found, 32.0 * np.array([1, 1, 2, 2, -1, -1, 0, 0]))


def test_a_second_step_at_the_end_of_a_tick_begins_the_next_one():
    """An event a rounding error after a tick's end shows what is held from then on."""
    time, held = np.insert(TIME, 3, TIME[2] + 1e-12), np.insert(HELD, 3, 3.0, axis=0)
    found = secant(time, held, TICK, 0.0)[:, 0]
    np.testing.assert_array_equal(found, 32.0 * np.array([1, 1, 2, 2, 2, -1, -1, 0, 0]))


@pytest.mark.parametrize("k", [0, 1])
def test_one_step_changes_nothing(k):
    assert secant(TIME[:k], HELD[:k], TICK, 0.0).shape == (0, 1)
    assert last_end(TIME[:k], [TICK], 0.0) == 0


def test_two_steps_are_a_change():
    np.testing.assert_array_equal(secant(TIME[:2], HELD[:2], None, 0.0), [[64.0]])
    assert last_end(TIME[:2], [None], 0.0) == 0


@pytest.mark.parametrize("began", [0.0, 2.0])
def test_a_run_is_cut_where_ticks_of_every_kind_end(began):
    """Ticks of 2 and 3 steps end together at the sixth; which has begun the next is the seventh."""
    assert last_end(TIME + began, [2 * STEP], began) == 6
    assert last_end(TIME + began, [2 * STEP, 3 * STEP], began) == 6
    assert last_end(TIME[:6] + began, [2 * STEP, 3 * STEP], began) == 0
    assert last_end(TIME + began, [STEP, None], began) == 7


def test_without_ticks_to_end_nothing_is_cut():
    assert last_end(TIME, [1.0], 0.0) == 0
