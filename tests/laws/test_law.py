"""The defaults of a law, and which readings it has."""

import numpy as np
import pytest

from drake_rnn import (
    LAWS,
    Circumstances,
    ContinuousLaw,
    InvalidInputError,
    JointLimits,
    Law,
    Layout,
    Recursive,
    SampledController,
    SampledLaw,
    make_experiment,
    validated,
)
from drake_rnn.laws import ContinuousReading, SampledReading

N = 3


class Steps(SampledLaw):
    """A law of state, inputs and step alone; velocities are not the first part of its state."""

    state = Layout(other=(2,), v=(N,))
    inputs = Layout(position=(N,))

    def step(self, t, x, u, period):
        return x + period


class Flows(ContinuousLaw):
    state = Layout(v=(N,))
    inputs = Layout(position=(N,))

    def derivatives(self, t, x, u):
        return -x


class Both(Steps, ContinuousLaw):
    def derivatives(self, t, x, u):
        return np.ones(5)


def test_a_law_of_state_inputs_and_step_is_sampled():
    law = Steps()
    assert isinstance(law, SampledReading)
    assert not isinstance(law, ContinuousReading)
    for period in (1e-6, 1e-3, 10.0):
        assert law.sampled(period) is law
    message = "^integrator: Steps is not a differential equation; give a period instead$"
    with pytest.raises(InvalidInputError, match=message):
        law.continuous()


def test_a_law_of_derivatives_alone_is_integrated():
    law = Flows()
    assert isinstance(law, ContinuousReading)
    assert not isinstance(law, SampledReading)
    assert law.continuous() is law
    message = "^period: Flows cannot be sampled; give an integrator instead$"
    with pytest.raises(InvalidInputError, match=message):
        law.sampled(1e-3)


def test_a_law_with_both_is_read_either_way():
    law = Both()
    assert law.sampled(1e-3) is law.continuous() is law


def test_its_defaults():
    """It starts at rest, holds its command, tells nothing, and warns of nothing."""
    law, x = Steps(), np.arange(5.0)
    np.testing.assert_array_equal(law.initial_state(np.random.default_rng(0), {}), np.zeros(5))
    for t in (0.0, 7.0):
        np.testing.assert_array_equal(law.commanded_velocity(t, x), [2.0, 3.0, 4.0])
    assert law.holds_command
    assert law.integration_scheme == "explicit_euler"
    assert law.observables.size == 0
    assert law.diagnostics(0.0, x, {"position": np.zeros(N)}) == {}
    assert law.loop_gains == {}
    assert law.joint_preview is None
    assert not law.stays_on_path
    assert law.levels_are_derivatives
    assert law.doubts(Circumstances()) == law.caveats({"saturated_fraction": 1.0}) == []


@pytest.mark.parametrize("base", [Law, SampledLaw, ContinuousLaw])
def test_a_law_that_lacks_what_makes_it_one_cannot_be_made(base):
    class Nothing(base):
        state = Layout(v=(N,))

    with pytest.raises(TypeError, match="inputs"):
        Nothing()


def test_in_no_special_circumstances_nothing_delays_the_loop_presses_or_turns():
    assert Circumstances() == (0.0, False, None, False, *[None] * 6)


def test_laws_that_run_along_their_path_at_any_speed():
    on_path = {kind for kind, law in LAWS.items() if law.stays_on_path}
    assert {"joint_drift_free", "pseudoinverse", "recursive"} <= on_path
    # These slow down or leave the path to keep their bounds.
    assert not on_path & {"simultaneous_learning", "receding_horizon", "motion_force"}


@pytest.mark.parametrize(("reading", "fields"), [("printed", {}), ("filters", {"time_constants"})])
def test_levels_are_derivatives_in_the_printed_network_alone(reading, fields):
    gains = np.array([4.0, 5.0])
    limits = JointLimits.unlimited(N).replace(velocity=1.0, acceleration=1.0)
    law = Recursive(
        limits=limits, gains=gains, reading=reading, **{name: 0.1 * gains for name in fields}
    )
    assert law.levels_are_derivatives == (reading == "printed")


def test_a_command_that_varies_with_time_is_not_held_and_moves_the_arm():
    """No law has to say so: its own ``commanded_velocity`` does."""

    class Accelerates(Steps):
        def commanded_velocity(self, t, x):
            return np.full(N, 0.1 * t)

    law = Accelerates()
    assert not law.holds_command
    assert law.integration_scheme == "runge_kutta2"
    controller = SampledController(law, 1.0)
    context = controller.CreateDefaultContext()
    controller.set_state(context, np.zeros(law.state.size))
    port, seen = controller.GetOutputPort("commanded_velocity"), []
    for t in (0.0, 0.5):
        context.SetTime(t)
        seen.append(port.Eval(context)[0])
    assert seen == [0.0, 0.05]


def test_a_law_may_take_a_task_of_any_size(monkeypatch):
    @validated
    class AnySize(SampledLaw):
        limits: JointLimits
        task_size: int = 3

        @property
        def state(self):
            return Layout(v=(self.limits.size,))

        @property
        def inputs(self):
            return Layout(p_WE=(self.task_size,))

        def step(self, t, x, u, period):
            return x

    monkeypatch.setitem(LAWS, "any_size", AnySize)
    document = {"arm": "planar6", "path": {"kind": "rest"}, "period": 1e-3, "duration": 1}
    for task, size in (("xyz", 3), ("xy", 2)):
        made = make_experiment({**document, "task": task, "law": {"kind": "any_size"}})
        assert made.law.task_size == size


def test_a_layout_lists_its_parts():
    layout = Layout(v=(7,), J=(3, 7))
    assert list(layout) == ["v", "J"]
    assert len(layout) == 2
    assert repr(layout) == "Layout(v=(7,), J=(3, 7))"
