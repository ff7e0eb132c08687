"""How stiff a contact is, learned from how its force answers to depth."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drake_rnn import InvalidInputError, OnlineStiffness

DESIRED = 5.0


def learned(known, law, depths, noise=0.0, offset=0.0, seed=0):
    """The slope after touching ``law`` at each of these depths, measured from ``offset``."""
    rng = np.random.default_rng(seed)
    state = known.start()
    for depth in depths:
        force = law(depth) + noise * rng.standard_normal()
        state = known.update(state, force, DESIRED, depth + offset)
    return state[0]


# From 2 to 8 N and back again, in steps of 5 um.
def depths(deepest, steps=200):
    share = 0.7 + 0.3 * np.sin(np.linspace(0.0, 4.0 * np.pi, steps))
    return deepest * share


@given(st.floats(1e3, 3e4), st.floats(-1.0, 1.0))
def test_it_finds_the_stiffness_of_a_spring_wherever_depth_is_counted_from(stiffness, offset):
    """1e-5: rounding of an offset of 1 m over steps of some um."""
    known = OnlineStiffness(initial=1e4, exponent=1.0)
    found = learned(known, lambda d: stiffness * d, depths(8.0 / stiffness), offset=offset)
    assert found == pytest.approx(stiffness, rel=1e-5)


@given(st.floats(1e6, 3e7))
def test_it_finds_the_slope_of_a_ball_on_a_plane(c):
    """F = c d^2: the slope of its root is that of c, at any force."""
    known = OnlineStiffness(initial=1e4, exponent=2.0)
    found = learned(known, lambda d: c * d * d, depths(np.sqrt(8.0 / c)))
    assert found == pytest.approx(np.sqrt(c), rel=1e-6)


def test_what_is_learned_from_a_noisy_sensor_is_about_right():
    """10 %: 0.02 N of noise over steps of some 0.2 N, with a memory of ten samples."""
    for exponent, law, slope, deepest in (
        (1.0, lambda d: 1e4 * d, 1e4, 8e-4),
        (2.0, lambda d: 1e7 * d * d, np.sqrt(1e7), np.sqrt(8e-7)),
    ):
        known = OnlineStiffness(initial=2e4, exponent=exponent)
        found = [
            learned(known, law, depths(deepest, steps=90), noise=0.02, seed=seed)
            for seed in range(5)
        ]
        np.testing.assert_allclose(found, slope, rtol=0.1)


@given(st.lists(st.tuples(st.floats(-10.0, 100.0), st.floats(-1e-3, 1e-3)), max_size=30))
def test_whatever_it_is_shown_no_slope_below_the_floor_is_believed(samples):
    known = OnlineStiffness(initial=1e4, floor=0.25)
    state = known.start()
    floor = 0.25 * state[0]
    for force, depth in samples:
        state = known.update(state, force, DESIRED, depth)
        assert state[0] >= floor * (1.0 - 1e-12)
        assert np.isfinite(state).all()


def test_a_surface_softer_than_the_floor_is_taken_for_the_floor():
    known = OnlineStiffness(initial=1e4, exponent=1.0, floor=0.5)
    assert learned(known, lambda d: 1e3 * d, depths(8e-3)) == 5e3


@given(st.floats(0.1, 20.0), st.floats(0.1, 20.0), st.sampled_from([1.0, 1.5, 2.0]))
def test_for_the_true_law_the_depth_error_is_exact(force, desired, exponent):
    known = OnlineStiffness(exponent=exponent)
    slope = 3e3
    state = np.array([slope, 1.0, -1.0, 0.0])

    def depth(F):
        return F ** (1.0 / exponent) / slope

    expected = depth(force) - depth(desired)
    assert known.depth_error(state, force, desired) == pytest.approx(expected, abs=1e-12)


def test_what_is_assumed_at_first_is_the_stiffness_at_the_initial_force():
    """dF/dd of F = (s d)^p where F is ``initial_force``."""
    for exponent in (1.0, 1.5, 2.0):
        known = OnlineStiffness(initial=8e3, initial_force=5.0, exponent=exponent)
        slope = known.start()[0]
        depth, h = 5.0 ** (1 / exponent) / slope, 1e-8
        after, before = ((slope * (depth + way * h)) ** exponent for way in (1, -1))
        assert (after - before) / (2 * h) == pytest.approx(8e3, rel=1e-5)


def test_without_contact_or_without_a_step_nothing_is_learned():
    known = OnlineStiffness(initial=1e4, exponent=1.0, step=2e-6)
    slope = known.start()[0]
    off = learned(known, lambda d: 0.0, depths(1e-3))
    still = learned(known, lambda d: 5.0 + 1e6 * d, 1e-6 * np.tile([0.0, 1.0], 50))
    assert off == still == slope


def test_a_jump_across_a_lost_contact_is_no_sample():
    """The surface may be another one after it."""
    known = OnlineStiffness(initial=1e4, exponent=1.0)
    state = known.start()
    for force, depth in ((5.0, 0.0), (0.0, -1e-2), (6.0, 1e-4)):
        state = known.update(state, force, DESIRED, depth)
        assert state[0] == known.start()[0]


@pytest.mark.parametrize(
    ("fields", "name"),
    [
        ({"initial": 0.0}, "initial"),
        ({"floor": 0.0}, "floor"),
        ({"floor": 1.1}, "floor"),
        ({"exponent": 0.5}, "exponent"),
        ({"exponent": float("nan")}, "exponent"),
        ({"forgetting": 0.0}, "forgetting"),
        ({"step": -1e-6}, "step"),
    ],
)
def test_what_it_cannot_be_is_refused_by_name(fields, name):
    with pytest.raises(InvalidInputError, match=name):
        OnlineStiffness(**fields)


@pytest.mark.parametrize("stiffness", [3e3, 3e4])
def test_one_change_of_ten_steps_is_enough_to_know_a_spring(stiffness):
    """To 1 % of what was wrong, and from the side of what was assumed."""
    known = OnlineStiffness(initial=1e4, exponent=1.0, step=2e-6)
    state = known.start()
    for depth in (2e-3, 2.02e-3):
        state = known.update(state, stiffness * depth, DESIRED, depth)
    left = (state[0] - stiffness) / (1e4 - stiffness)
    assert 0.0 <= left < 0.01
