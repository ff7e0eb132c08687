"""A stiffness that is given instead of learned."""

from inspect import getmembers, isfunction, signature

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drake_rnn import OnlineStiffness
from drake_rnn.laws.parts.surface_task import FixedStiffness

forces = st.floats(0.0, 100.0)


def methods(kind):
    """Parameters of the public methods, by name."""
    every = getmembers(kind, isfunction)
    return {name: [*signature(f).parameters] for name, f in every if not name.startswith("_")}


def test_both_kinds_have_the_same_methods():
    learned = methods(OnlineStiffness)
    assert methods(FixedStiffness) == learned
    assert learned.keys() == {"start", "update", "retreat_speed", "depth_error"}


@pytest.mark.parametrize("surface", [FixedStiffness(800.0), OnlineStiffness()])
def test_its_state_has_the_size_it_says(surface):
    state = surface.start()
    assert state.shape == (surface.size,)
    assert surface.update(state, 4.0, 5.0, 1e-3).shape == (surface.size,)


@given(forces, forces, st.floats(-1e-2, 1e-2))
def test_it_learns_nothing(force, desired, depth):
    surface = FixedStiffness(800.0)
    assert surface.size == 0
    assert surface.update(surface.start(), force, desired, depth).size == 0
    assert surface.value == 800.0


@given(forces, forces, st.floats(10.0, 1e5), st.floats(0.1, 50.0))
def test_it_retreats_as_fast_as_a_learned_spring_of_that_stiffness(force, desired, K, gain):
    """The gain times how much too deep the tip is."""
    fixed, learned = FixedStiffness(K), OnlineStiffness(exponent=1.0)
    speed = fixed.retreat_speed(fixed.start(), force, desired, gain)
    assert speed == pytest.approx(gain * (force - desired) / K, rel=1e-12)
    known = np.array([K, 1.0, -1.0, 0.0])
    assert speed == pytest.approx(learned.retreat_speed(known, force, desired, gain), rel=1e-12)
    assert speed == pytest.approx(gain * fixed.depth_error(fixed.start(), force, desired))
