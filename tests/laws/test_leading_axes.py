"""Laws with leading axes: a robot moves among many as it moves alone."""

import numpy as np
import pytest
from many_helpers import GAINS, LAWS, LIMITS, moment, readings, row, signals, states

from drake_rnn import InvalidInputError, RecedingHorizon
from drake_rnn.arrays.algebra import (
    robots_first,
    robots_last,
)
from drake_rnn.laws.checks import (
    stack,
    with_gains,
)
from row_helpers import each

CASES = [(name, method) for name, law in LAWS.items() for method in readings(law)]
#: In the warm-up, between two pulses of it, and in the task.
TIMES = (0.0, 0.3, 2.0)
COUNT = 37
#: Of rounding, where sums are added in another order. The implicit step of a joint-drift-free law
#: solves equations whose condition is up to 1e6.
CLOSE = {"rtol": 1e-10, "atol": 1e-12}


def case_of(name, method):
    """Return a reading, and states and signals of many robots."""
    rng = np.random.default_rng([7, len(name), len(method)])
    reading = readings(LAWS[name])[method]
    return reading, states(reading, rng, COUNT), signals(reading.inputs, rng, COUNT)


def times_of(step, x, u, *moment):
    """Return the times at which a method is tried: all, or one if it does not depend on the time.

    Many robots tell whether it does: to the last bit.
    """
    first, *others = (step(t, x, u, *moment) for t in TIMES)
    return TIMES if any((first != other).any() for other in others) else TIMES[-1:]


@each("name, method", CASES)
def test_each_robot_does_what_it_does_alone(name, method):
    reading, x, u = case_of(name, method)
    step, when = getattr(reading, method), moment(method)
    for t in times_of(step, x, u, *when):
        many = step(t, x, u, *when)
        assert many.shape == x.shape
        alone = [step(t, x[k], row(u, k), *when) for k in range(COUNT)]
        scale = np.abs(alone).max(axis=0)
        np.testing.assert_allclose(many / (scale + 1.0), alone / (scale + 1.0), **CLOSE)


@each("name, method", CASES)
def test_company_changes_no_bit(name, method):
    reading, x, u = case_of(name, method)
    step, when = getattr(reading, method), moment(method)
    for t in times_of(step, x, u, *when):
        many = step(t, x, u, *when)
        for k in (0, 5, COUNT - 1):
            just_one = {name: value[k : k + 1] for name, value in u.items()}
            np.testing.assert_array_equal(step(t, x[k : k + 1], just_one, *when)[0], many[k])
        # Robots side by side in memory, as kinematics for many return them; and two leading axes.
        lying = {name: _side_by_side(value) for name, value in u.items()}
        np.testing.assert_array_equal(step(t, _side_by_side(x), lying, *when), many)
        grid = {name: value[:36].reshape(4, 9, *value.shape[1:]) for name, value in u.items()}
        folded = step(t, x[:36].reshape(4, 9, -1), grid, *when)
        np.testing.assert_array_equal(folded.reshape(36, -1), many[:36])


def _side_by_side(value):
    return robots_first(robots_last(value, value.ndim - 1), value.ndim - 1)


@each("name, method", CASES)
def test_commands_and_observables_of_many(name, method):
    reading, x, u = case_of(name, method)
    commands = reading.commanded_velocity(0.3, x)
    for k in range(COUNT):
        np.testing.assert_array_equal(commands[k], reading.commanded_velocity(0.3, x[k]))
    desired = {name.replace("_preview", "_WE_desired"): value for name, value in u.items()}
    told = reading.diagnostics(0.3, x, {**desired, **u})
    for name, (_, shape) in reading.observables.parts.items():
        assert told[name].shape == (COUNT, *shape)


@each("name", GAINS)
def test_gains_of_their_own(name):
    rng = np.random.default_rng([8, len(name)])
    law, count = LAWS[name], 6
    laws = [with_gains(law, _other_gains(law, name, rng)) for _ in range(count)]
    for method in readings(law):
        each = [readings(law)[method] for law in laws]
        together = stack(each)
        x = states(each[0], rng, count)
        u = signals(each[0].inputs, rng, count)
        for t in TIMES:
            many = getattr(together, method)(t, x, u, *moment(method))
            for k, own in enumerate(each):
                one = getattr(own, method)(t, x[k], row(u, k), *moment(method))
                np.testing.assert_allclose(many[k], one, rtol=1e-9, atol=1e-9 * np.abs(one).max())


def _other_gains(law, name, rng):
    gains = {}
    for path in GAINS[name]:
        value = law
        for part in path.split("."):
            value = value[int(part)] if part.isdecimal() else getattr(value, part)
        gains[path] = value * (1.0 - 0.3 * rng.random(np.shape(value)))
    return gains


def test_laws_that_differ_in_more_than_numbers_are_refused():
    law = LAWS["slc_known"]
    with pytest.raises(InvalidInputError, match=r"laws\[1\]\.jacobian: must be as in laws\[0\]"):
        stack([law, LAWS["slc_learned"]])
    with pytest.raises(InvalidInputError, match=r"laws\[1\]\.feedback_limit: .* only numbers may"):
        stack([law, LAWS["slc_slow_feedback"]])
    with pytest.raises(InvalidInputError, match=r"laws\[1\]: must be as in laws\[0\]"):
        stack([law, LAWS["naljdf"]])
    with pytest.raises(InvalidInputError, match="laws: must be given"):
        stack([])


@pytest.mark.parametrize("path", ["kapa", "jacobian", "substeps", "kappa.rho", "limits"])
def test_gains_that_a_law_does_not_have_are_refused(path):
    with pytest.raises(InvalidInputError, match=rf"law\.{path}: is no number"):
        with_gains(LAWS["slc_known"], {path: np.ones(3)})


def test_a_horizon_is_planned_for_one_robot_at_a_time():
    bounded = LIMITS.replace(position_lower=-4.0, position_upper=4.0)
    law = RecedingHorizon(limits=bounded, horizon=40)
    for refused in (lambda: stack([law, law]), lambda: with_gains(law, {"rate": 1.0})):
        with pytest.raises(InvalidInputError, match="RecedingHorizon runs one robot at a time"):
            refused()
    x = np.zeros((2, law.state.size))
    u = {name: np.zeros((2, *shape)) for name, (_, shape) in law.inputs.parts.items()}
    with pytest.raises(InvalidInputError, match="RecedingHorizon runs one robot at a time"):
        law.step(0.0, x, u, 1e-2)
