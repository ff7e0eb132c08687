"""Follow poses that a hand-held device sends at 50 Hz, here made up.

Held poses alone are a path at rest between jumps: the law then joins it anew each time, at up to
`feedback_limit` and with the deceleration `braking`, and trails behind. With the velocity from the
last two poses it follows at the speed of the hand.
"""

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from drake_rnn import Adaptive, AddLoop, IdealArm, SampledController, load_arm

BETWEEN, PERIOD = 0.02, 0.002


class HandHeld(LeafSystem):
    """Positions that come every `BETWEEN` seconds.

    Args:
        p_WE: Position at a time, shape (3,) [m].
        with_velocity: Whether the velocity is the difference of the last two.
    """

    def __init__(self, p_WE, with_velocity):
        super().__init__()

        def newest(t):
            k = np.floor(t / BETWEEN + 1e-9)
            p, before = p_WE(BETWEEN * k), p_WE(BETWEEN * max(k - 1, 0))
            return p, with_velocity * (p - before) / BETWEEN

        def position(context, output):
            output.SetFromVector(newest(context.get_time())[0])

        def velocity(context, output):
            output.SetFromVector(newest(context.get_time())[1])

        def preview(context, output):
            p, v = newest(context.get_time())
            output.SetFromVector(p + PERIOD * v)

        ports = {"p_WE_desired": position, "v_WE_desired": velocity, "p_preview": preview}
        for name, calc in ports.items():
            self.DeclareVectorOutputPort(name, 3, calc, {self.time_ticket()})


def largest_error(with_velocity, duration=3.0, speed=0.2, **gains):
    """Return how far a Panda's tool is from the hand at most [m]."""
    arm = load_arm("panda")
    limits = arm.limits.replace(acceleration=10.0, jerk=None)
    kinematics, law = arm.kinematics(), Adaptive(limits=limits, home=arm.home, **gains)
    begin = kinematics.p_WE(arm.home)

    def hand(t):
        """A circle of 10 cm, at full speed after 1 s."""
        turn = speed / 0.1 * (0.5 * t**2 if t < 1.0 else t - 0.5)
        return begin + 0.1 * np.array([0.0, np.sin(turn), 1.0 - np.cos(turn)])

    builder, body = DiagramBuilder(), IdealArm(arm)
    source = builder.AddNamedSystem("hand", HandHeld(hand, with_velocity))
    AddLoop(builder, body, SampledController(law, period=PERIOD), source)
    simulator = Simulator(builder.Build())
    errors = []
    for t in np.arange(BETWEEN, duration, BETWEEN):
        simulator.AdvanceTo(t)
        context = body.GetMyContextFromRoot(simulator.get_context())
        q = body.GetOutputPort("position").Eval(context)
        errors.append(np.linalg.norm(kinematics.p_WE(q) - hand(t)))
    return max(errors)


if __name__ == "__main__":
    rows = {
        "poses alone": largest_error(False),
        "poses alone, braking 2, feedback_limit 1": largest_error(
            False, braking=2.0, feedback_limit=1.0
        ),
        "with velocities": largest_error(True),
    }
    for name, error in rows.items():
        print(f"{name}: {error:.4f} m")
