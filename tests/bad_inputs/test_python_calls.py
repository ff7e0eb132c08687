"""What a user may hand over by mistake in Python is refused by name."""

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.trajectories import PiecewisePolynomial
from refusing import lots, refusal, table

import drake_rnn as d
from drake_rnn import JointLimits
from row_helpers import assert_each

ARM = d.load_arm("panda")
LIMITS = ARM.limits.replace(acceleration=10.0)
TIMES = [0.0, 1.0, 2.0]
POINTS = np.array([[0.3, 0.4, 0.5], [0.0, 0.0, 0.1], [0.5, 0.5, 0.5]])
#: Stands for a signal that is missing.
GONE = object()
#: Mappings in one another.
DEEP = {"a": 1}
for _ in range(3000):
    DEEP = {"a": DEEP}
#: A list that is in itself.
SELF = []
SELF += [SELF, SELF]


def given(law, changes):
    """Signals of the right shapes, but for those that are changed."""
    u = {name: np.zeros(shape) for name, (_, shape) in law.inputs.parts.items()}
    return {name: value for name, value in (u | changes).items() if value is not GONE}


def step(law, t=0.0, x=..., period=1e-3, u=..., **changes):
    x = np.zeros(law.state.size) if x is ... else x
    return law.step(t, x, given(law, changes) if u is ... else u, period)


def rates(law, t=0.0, x=..., u=..., **changes):
    x = np.zeros(law.state.size) if x is ... else x
    return law.derivatives(t, x, given(law, changes) if u is ... else u)


NAMES = {name: getattr(d, name) for name in d.__all__} | {
    "np": np,
    "PiecewisePolynomial": PiecewisePolynomial,
    "DiagramBuilder": DiagramBuilder,
    "DEEP": DEEP,
    "SELF": SELF,
    "ARM": ARM,
    "KINEMATICS": ARM.kinematics(),
    "EXPERIMENT": d.load_experiment("pinv_line"),
    "CIRCLE": d.Circle(size=0.02, period=2.0),
    "TIMES": TIMES,
    "POINTS": POINTS,
    "LINE": PiecewisePolynomial.FirstOrderHold(TIMES, POINTS),
    "LAW": d.SimultaneousLearning(limits=LIMITS, home=ARM.home, jacobian="known"),
    "LEARNING": d.SimultaneousLearning(limits=LIMITS, home=ARM.home),
    "PRESSING": d.MotionForce(limits=LIMITS, stiffness=1000.0),
    "RETURNING": d.JointDriftFree(limits=LIMITS, home=ARM.home, scheme="moaljdf", alpha=0.5),
    "RIGHT_INVERSE": d.Pseudoinverse(limits=LIMITS),
    "CHAIN": d.Recursive(limits=LIMITS, gains=[1.0, 10.0]),
    "ADJUSTING": d.StateAdjustment(limits=LIMITS, target=ARM.home),
    "UPRIGHT": d.NullSpaceAdjustment(limits=LIMITS, target=ARM.home),
    "SHIELD": d.Shield(ARM, 0.01, start=ARM.home, limits=LIMITS),
    "GONE": GONE,
    "step": step,
    "rates": rates,
}


@pytest.mark.parametrize("rows", lots(table("python_calls.txt")))
def test_each_is_refused_by_name(tmp_path, rows):
    def assert_refused(call, said):
        message = refusal(lambda: eval(call, NAMES | {"FOLDER": tmp_path}))
        assert message.replace(str(tmp_path), "FOLDER").startswith(said), message

    assert_each(assert_refused, rows)


@pytest.mark.parametrize("name", ["LAW", "LEARNING", "PRESSING", "RIGHT_INVERSE", "CHAIN"])
def test_what_is_right_is_taken(name):
    law = NAMES[name]
    assert step(law).shape == (law.state.size,)


def test_a_run_does_without_these_checks():
    """It has checked its ports, and checks what comes back."""
    seen = []

    @d.validated
    class Watched(d.SampledLaw):
        limits: JointLimits
        state = property(lambda self: d.Layout(v=(7,)))
        inputs = property(lambda self: seen.append("asked") or d.Layout(position=(7,)))

        def step(self, t, x, u, period):
            return x

    controller = d.SampledController(Watched(limits=LIMITS), 1e-3)
    context = controller.CreateDefaultContext()
    controller.GetInputPort("position").FixValue(context, np.zeros(7))
    controller.set_state(context, np.zeros(7))
    asked = len(seen)
    controller.EvalUniquePeriodicDiscreteUpdate(context)
    assert len(seen) == asked
