"""Streams of joint targets: whatever comes, every bound holds; and what comes is followed."""

import numpy as np
import pytest
from adaptive_helpers import HOME, LIMITS, PANDA, N, excess
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from drake_rnn import Guard, InvalidInputError, JointStream, SampledController, load_arm
from drake_rnn.robot.clearance.arm_clearance import arm_clearance
from drake_rnn.robot.clearance.obstacles import make_obstacles

PERIOD, HELD = 1e-3, 1e-9
WITH_JERK = LIMITS.replace(jerk=30.0)
BOTH = pytest.mark.parametrize("limits", [LIMITS, WITH_JERK], ids=["acceleration", "jerk"])


class Followed:
    """What a guard commanded: positions, shape (k, n), and velocities."""

    def __init__(self, law, targets):
        guard = Guard(law, PERIOD)
        rows = [(guard.command(target), guard.velocity) for target in targets]
        self.q, self.v = (np.array(column) for column in zip(*rows, strict=True))
        self.guard = guard


def wild(seed, count):
    """Targets up to 3 rad away, ten to a hundred times a second, with NaN and gaps."""
    rng = np.random.default_rng(seed)
    targets = [None] * count
    k = 0
    while k < count:
        targets[k] = HOME + rng.uniform(-3.0, 3.0, N) * rng.choice([0.01, 0.3, 1.0])
        if rng.random() < 0.2:
            targets[k][rng.integers(N)] = rng.choice([np.nan, np.inf])
        k += int(rng.choice([10, 50, 100, 400]))
    return targets


@BOTH
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.long) for k in (1, 2))])
def test_whatever_comes_every_bound_is_held(seed, limits):
    motion = Followed(JointStream(limits=limits, home=HOME), wild(seed, 1500))
    assert max(excess(motion, limits).values()) < HELD
    # It is the bounds that hold it back.
    assert excess(motion, limits)["acceleration"] > -1e-9


@pytest.mark.parametrize("limits", [LIMITS, pytest.param(WITH_JERK, marks=pytest.mark.long)])
def test_whatever_comes_nothing_is_touched(limits):
    p = PANDA.p_WE(HOME)
    balls = [{"kind": "ball", "center": [*p[:2], p[2] + z], "radius": 0.05} for z in (-0.2, 0.3)]
    clearance, _ = arm_clearance(load_arm("panda"), make_obstacles(balls), HOME)
    motion = Followed(JointStream(limits=limits, home=HOME, clearance=clearance), wild(0, 1500))
    assert clearance.least_along(motion.q).min() >= 0.005
    assert max(excess(motion, limits).values()) < HELD
    blind = Followed(JointStream(limits=limits, home=HOME), wild(0, 1500))
    assert clearance.least_along(blind.q).min() < 0.0


@pytest.mark.parametrize("limits", [LIMITS, pytest.param(WITH_JERK, marks=pytest.mark.long)])
def test_it_goes_to_a_target_as_fast_as_its_bounds_let_it_and_not_beyond(limits):
    """0.3 rad take 0.3 / V + V / A, and with the jerk A / J more, to within some samples."""
    goal = HOME + 0.3 * np.eye(N)[0]
    motion = Followed(JointStream(limits=limits, home=HOME), [goal] * 1400)
    jerk = 0.0 if limits.jerk is None else 1.0 / 30.0
    fastest = 0.3 / 0.5 + 0.5 / 1.0 + jerk
    arrived = PERIOD * np.argmax(np.abs(motion.q[:, 0] - goal[0]) < 1e-6)
    assert arrived == pytest.approx(fastest, abs=20 * PERIOD)
    assert motion.q[:, 0].max() < goal[0] + 1e-9
    assert motion.q[-1] == pytest.approx(goal, abs=1e-9)
    assert np.abs(motion.v[-1]).max() < 1e-9


@BOTH
def test_a_stream_that_ends_is_a_stop_within_its_bounds(limits):
    """Half a radian per second, and no more targets after half a second."""
    far = HOME + 2.0 * np.eye(N)[0]
    ended = Followed(JointStream(limits=limits, home=HOME), [far] * 500 + [None] * 1000)
    moving = np.flatnonzero(np.abs(ended.v).max(axis=1) > 1e-12)
    jerk = 0.0 if limits.jerk is None else 1.0 / 30.0
    # The timeout, .2 s, and what half a radian per second takes to brake.
    assert PERIOD * moving[-1] == pytest.approx(0.5 + 0.2 + 0.5 + jerk, abs=0.02)
    assert max(excess(ended, limits).values()) < HELD
    assert ended.guard.part("missed").item() == 1000.0


@BOTH
def test_a_target_out_of_this_world_breaks_nothing(limits):
    """The largest number that there is, as some sources mean none by it."""
    far = np.full(N, np.finfo(float).max)
    law = JointStream(limits=limits, home=HOME, interval=0.05)
    motion = Followed(law, [far] * 100 + [HOME] * 200)
    assert np.isfinite(motion.q).all()
    assert max(excess(motion, limits).values()) < HELD


def test_what_is_not_a_number_is_not_followed():
    none = np.full(N, np.nan)
    motion = Followed(JointStream(limits=LIMITS, home=HOME), [none] * 300)
    assert np.array_equal(motion.q, np.tile(HOME, (300, 1)))
    one = np.where(np.arange(N) == 2, np.inf, HOME + 0.1)
    motion = Followed(JointStream(limits=LIMITS, home=HOME), [HOME + 0.1, *[one] * 199])
    assert motion.guard.part("missed").item() == 199.0
    assert motion.q[-1, 0] > HOME[0]


def test_a_target_beyond_the_limits_is_gone_to_as_far_as_they_allow():
    motion = Followed(JointStream(limits=LIMITS, home=HOME), [HOME + 9.0 * np.eye(N)[5]] * 5500)
    assert motion.q[-1, 5] == pytest.approx(LIMITS.position_upper[5], abs=1e-9)
    assert max(excess(motion, LIMITS).values()) < HELD


def test_with_an_interval_the_motion_is_smoother():
    """Of targets at 20 Hz, the accelerations; without it the arm stops and goes at each."""

    def sent(k):
        return HOME + 0.1 * np.sin(2.0 * k * PERIOD) if k % 50 == 0 else None

    quick, targets = LIMITS.replace(acceleration=5.0), [sent(k) for k in range(2000)]
    at_once, smooth = (
        Followed(JointStream(limits=quick, home=HOME, interval=interval), targets)
        for interval in (0.0, 0.05)
    )
    rough = [np.abs(np.diff(each.v[300:], axis=0)).mean() for each in (at_once, smooth)]
    assert rough[1] < 0.2 * rough[0]
    assert max(excess(smooth, quick).values()) < HELD


def test_in_a_diagram_it_commands_what_the_guard_does():
    law, goal = JointStream(limits=WITH_JERK, home=HOME), HOME + 0.2
    builder = DiagramBuilder()
    controller = builder.AddSystem(SampledController(law, PERIOD))
    for name, value in (("position", HOME), ("target", goal)):
        source = builder.AddSystem(ConstantVectorSource(value))
        builder.Connect(source.get_output_port(), controller.GetInputPort(name))
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.3 - 0.5 * PERIOD)
    context = controller.GetMyContextFromRoot(simulator.get_context())
    motion = Followed(law, [goal] * 300)
    assert np.array_equal(controller.GetOutputPort("commanded").Eval(context), motion.q[-1])


def test_bad_input_is_refused():
    law = JointStream(limits=LIMITS, home=HOME)
    with pytest.raises(InvalidInputError, match="target: must be 7 numbers, one per joint"):
        Guard(law, PERIOD).command(np.zeros(3))
    with pytest.raises(InvalidInputError, match="target: must be 7 numbers, one per joint"):
        Guard(law, PERIOD).command("home")
    with pytest.raises(InvalidInputError, match="start: must be finite"):
        Guard(law, PERIOD, np.full(N, np.nan))
    with pytest.raises(InvalidInputError, match=r"start: joint 1 is at 9 rad; it may be"):
        Guard(law, PERIOD, HOME + 9.0 * np.eye(N)[0])
    with pytest.raises(InvalidInputError, match="period: must be a positive time"):
        Guard(law, 0.0)
    with pytest.raises(InvalidInputError, match=r"timeout: must be longer than interval, 0.5 s"):
        JointStream(limits=LIMITS, home=HOME, interval=0.5)
    with pytest.raises(InvalidInputError, match="law: must be of class JointStream"):
        Guard(None, PERIOD)
    with pytest.raises(InvalidInputError, match="home: must have 7 entries"):
        JointStream(limits=LIMITS, home=np.zeros(3))
