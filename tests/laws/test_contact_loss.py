"""When a contact counts as lost, and what is done then."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drake_rnn import ContactLoss, InvalidInputError
from drake_rnn.laws.parts.surface_task import (
    APPROACHING,
    IN_CONTACT,
    LOST,
)

PERIOD = 1e-3


def after(loss, forces, desired=5.0, state=None):
    """The states after each sample."""
    state, states = loss.start() if state is None else state, []
    for force in forces:
        state = loss.update(state, force, desired, PERIOD)
        states.append(state)
    return np.array(states)


def test_a_contact_never_made_is_never_lost():
    assert (after(ContactLoss(patience=0.01), np.zeros(500))[:, 0] == APPROACHING).all()


def test_it_is_lost_once_the_force_has_been_away_for_longer_than_its_patience():
    """The sample after 50 ms without a force, not that before."""
    phases = after(ContactLoss(patience=0.0505), [5.0] * 3 + [0.0] * 60)[:, 0]
    assert (phases[:3] == IN_CONTACT).all()
    assert np.argmax(phases == LOST) == 3 + 50
    assert (phases[53:] == LOST).all()


def test_unless_told_otherwise_it_is_lost_after_50_ms():
    """As `contact_lost_time_s` counts it; at 50 ms itself, rounding decides."""
    phases = after(ContactLoss(), [5.0] * 3 + [0.0] * 60)[:, 0]
    assert 3 + 48 <= np.argmax(phases == LOST) <= 3 + 51


def test_a_gap_shorter_than_the_patience_is_forgotten():
    """However many there are."""
    phases = after(ContactLoss(patience=0.0505), ([5.0] + [0.0] * 50) * 10)[:, 0]
    assert (phases == IN_CONTACT).all()


def test_a_share_of_the_desired_force_counts_as_contact():
    loss = ContactLoss(threshold=0.1, patience=0.0)
    assert after(loss, [0.49])[-1, 0] == APPROACHING
    assert after(loss, [0.51])[-1, 0] == IN_CONTACT


@given(st.lists(st.floats(-10.0, 50.0), max_size=50))
def test_once_lost_it_stays_lost(forces):
    loss = ContactLoss(reaction="retreat")
    states = after(loss, forces, state=np.array([LOST, 0.1, 0.0]))
    assert (states[:, 0] == LOST).all() if forces else True


@pytest.mark.parametrize("distance", [0.0, 0.01, 0.0203])
def test_it_retreats_by_its_distance_and_then_stays(distance):
    """To within what one sample moves."""
    loss = ContactLoss(reaction="retreat", retreat_speed=0.02, retreat_distance=distance)
    state, moved = np.array([LOST, 0.1, 0.0]), 0.0
    for _ in range(2000):
        moved += loss.retreat(state) * PERIOD
        state = loss.update(state, 0.0, 5.0, PERIOD)
    assert distance - 1e-12 <= moved <= distance + 0.02 * PERIOD
    assert loss.retreat(state) == 0.0
    assert state[2] == pytest.approx(moved, abs=1e-12)


def test_who_holds_does_not_move_at_all():
    states = after(ContactLoss(patience=0.0), [5.0] + [0.0] * 100)
    assert (states[1:, 0] == LOST).all()
    assert all(ContactLoss().retreat(state) == 0.0 for state in states)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"reaction": "panic"}, "reaction.*hold.*retreat"),
        ({"threshold": 0.0}, "threshold"),
        ({"patience": -1.0}, "patience"),
        ({"retreat_speed": 0.0}, "retreat_speed"),
        ({"retreat_distance": float("inf")}, "retreat_distance"),
    ],
)
def test_what_it_cannot_be_is_refused_by_name(fields, message):
    with pytest.raises(InvalidInputError, match=message):
        ContactLoss(**fields)
