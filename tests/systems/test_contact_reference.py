"""How hard a surface is to be pressed."""

import numpy as np
import pytest

from drake_rnn import ForceProfile, InvalidInputError
from drake_rnn.features.contact import ContactReference


def test_a_force_is_there_at_once_unless_it_rises():
    assert [ForceProfile(value=5.0).at(t) for t in (0.0, 1.0, 100.0)] == [5.0] * 3


def test_it_rises_from_its_initial_value_without_a_jump_or_a_kink():
    """Never beyond either end; half-way at half time; rate and its rate 0 at both ends."""
    profile = ForceProfile(value=5.0, rise_time=2.0, initial=1.0)
    t = np.linspace(-0.5, 3.0, 3501)
    F = np.array([profile.at(instant) for instant in t])
    assert profile.at(0.0) == 1.0
    assert profile.at(2.0) == profile.at(50.0) == 5.0
    assert profile.at(1.0) == pytest.approx(3.0)
    assert (np.diff(F) >= 0.0).all()
    # 4 N in 2 s: rates of 3.75 N/s and 5.8 N/s^2 at most.
    rate = np.gradient(F, t)
    assert rate.max() == pytest.approx(3.75, rel=1e-3)
    assert np.abs(np.gradient(rate, t)).max() < 6.0


def test_a_force_may_fall_to_its_value_as_well():
    profile = ForceProfile(value=1.0, rise_time=1.0, initial=5.0)
    assert (profile.at(0.0), profile.at(0.5), profile.at(1.0)) == (5.0, 3.0, 1.0)


def test_its_ports_are_normal_and_profile():
    n, profile = np.array([0.6, 0.0, 0.8]), ForceProfile(value=5.0, rise_time=2.0)
    reference = ContactReference(n, profile)
    context = reference.CreateDefaultContext()
    for t in (0.0, 0.7, 2.5):
        context.SetTime(t)
        np.testing.assert_array_equal(reference.GetOutputPort("normal_WE").Eval(context), n)
        desired = reference.GetOutputPort("normal_force_desired").Eval(context)
        np.testing.assert_array_equal(desired, [profile.at(t)])


@pytest.mark.parametrize(
    ("fields", "name"),
    [
        ({"value": 0.0}, "value"),
        ({"value": 5.0, "rise_time": 0.0}, "rise_time"),
        ({"value": 5.0, "initial": -1.0}, "initial"),
        ({"value": 5.0, "initial": 1.0}, "initial: must be 0 without rise_time, not 1"),
    ],
)
def test_what_it_cannot_be_is_refused_by_name(fields, name):
    with pytest.raises(InvalidInputError, match=name):
        ForceProfile(**fields)
