"""Block principal pivoting: who changes sides, and when."""

import numpy as np

from drake_rnn.arrays import algebra as pivoting


def after(sides, ought, fewest, patience):
    sides, ought = np.array(sides, dtype=float), np.array(ought, dtype=float)
    found = pivoting.update_sides(sides, ought, np.array([fewest]), np.array([patience]))
    return [part.tolist() for part in found]


def test_all_that_are_wrong_change_at_once_while_fewer_are_wrong_than_ever():
    assert after([0, 0, 1], [-1, 1, 1], 3.0, 0.0) == [[-1, 1, 1], [2.0], [1.0], [False]]


def test_once_more_though_not_fewer_are_wrong_and_then_the_last_one_alone():
    assert after([0, 0, 1], [-1, 1, 1], 2.0, 1.0) == [[-1, 1, 1], [2.0], [0.0], [False]]
    assert after([0, 0, 1], [-1, 1, 1], 2.0, 0.0)[0] == [0, 1, 1]


def test_it_ends_once_none_is_wrong():
    fewest, patience = pivoting.first(np.zeros(3))
    assert (fewest.tolist(), patience.tolist()) == ([4.0], [pivoting.PATIENCE])
    assert after([0, -1, 1], [0, -1, 1], 4.0, 1.0) == [[0, -1, 1], [0.0], [1.0], [True]]
