"""Streams of joint targets: whatever comes, every bound holds; and what comes is followed."""

from importlib import import_module

import numpy as np
import pytest
from adaptive_helpers import HOME, LIMITS, PANDA, N, excess
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from drake_rnn import (
    Guard,
    InvalidInputError,
    JointLimits,
    JointStream,
    SampledController,
    load_arm,
    load_experiment,
    simulate,
)
from drake_rnn.compiled.library import native_step
from drake_rnn.robot.clearance.arm_clearance import arm_clearance
from drake_rnn.robot.clearance.obstacles import make_obstacles

PERIOD, HELD = 1e-3, 1e-9
LONG = pytest.mark.long
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
@pytest.mark.parametrize(
    "seed", [0, pytest.param(1, marks=pytest.mark.long), pytest.param(2, marks=pytest.mark.nightly)]
)
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


def test_the_guard_is_found_where_it_was():
    with pytest.warns(
        DeprecationWarning, match=r"laws\.guard\.Guard is now drake_rnn\.drive\.guard"
    ):
        assert import_module("drake_rnn.laws.guard").Guard is Guard
    with pytest.warns(DeprecationWarning, match=r"laws\.Guard is now drake_rnn\.drive\.guard"):
        assert import_module("drake_rnn.laws").Guard is Guard


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


# Joints that turn without end.


def test_a_joint_with_limits_takes_the_nearest_turn_within_them():
    """At its limit of two turns it goes back a turn, as the arm must."""
    limits = JointLimits(position_lower=[-7.0], position_upper=[7.0], velocity=[1.0])
    endless = np.array([True])
    for near, target, there in ((6.0, -0.2, -0.2 + 2 * np.pi), (6.9, 1.0, 1.0), (0.0, 6.2, -0.083)):
        found = limits.nearest_turn(np.array([target]), np.array([near]), endless)
        np.testing.assert_allclose(found, [there], atol=1e-3)
    never = limits.nearest_turn(np.array([6.2]), np.array([0.0]), np.array([False]))
    np.testing.assert_array_equal(never, [6.2])


ENDLESS = JointLimits(
    position_lower=[-np.inf, -2.0],
    position_upper=[np.inf, 2.0],
    velocity=[1.0, 1.0],
    acceleration=[4.0, 4.0],
)


def across(count):
    """Targets of a joint that goes on past half a turn, named from -pi to pi, at 20 Hz."""
    angles = 3.0 + 0.4 * np.arange(count) * PERIOD
    wrapped = (angles + np.pi) % (2.0 * np.pi) - np.pi
    return [
        np.array([angle, 0.0]) if k % 50 == 0 else None for k, angle in enumerate(wrapped)
    ], angles


def test_a_continuous_joint_goes_on_past_half_a_turn():
    """Before, it unwound a whole turn at full speed."""
    targets, angles = across(1500)
    motion = Followed(JointStream(limits=ENDLESS, home=[3.0, 0.0]), targets)
    assert np.abs(motion.q[:, 0] - angles).max() < 0.1
    assert motion.v[:, 0].min() >= 0.0


def test_turns_that_are_streamed_are_made():
    """Two turns in small steps are two turns; a jump by two turns is none."""
    steps = [np.array([2.0 * k * PERIOD, 0.0]) if k % 50 == 0 else None for k in range(7000)]
    fast = ENDLESS.replace(velocity=3.0)
    motion = Followed(JointStream(limits=fast, home=[0.0, 0.0], timeout=2.0), steps)
    assert motion.q[-1, 0] > 4.0 * np.pi
    jump = [np.array([4.0 * np.pi, 0.0])] * 200
    assert np.abs(Followed(JointStream(limits=fast, home=[0.0, 0.0]), jump).q).max() < 1e-12


def test_a_joint_that_is_not_endless_takes_targets_as_they_are():
    """A slide without limits, and a joint with limits."""
    law = JointStream(limits=ENDLESS, home=[0.0, 0.0], endless=[False, False])
    motion = Followed(law, [np.array([5.0, 0.0])] * 300)
    assert (np.diff(motion.q[:, 0]) >= 0.0).all()
    assert motion.q[-1, 0] > 0.1
    with pytest.raises(InvalidInputError, match="endless: must have 2 entries, not 1"):
        JointStream(limits=ENDLESS, home=[0.0, 0.0], endless=[True])


def test_recorded_targets_of_a_continuous_joint_are_followed_the_shorter_way(tmp_path):
    """Metrics see the same targets as the law; a warning counts the jumps."""
    chain = "".join(
        f'<link name="l{k + 1}"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" '
        f'izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j{k + 1}" '
        f'type="{kind}"><parent link="l{k}"/><child link="l{k + 1}"/><origin xyz="0 0 0.3"/>'
        f'<axis xyz="{axis}"/><limit lower="-2" upper="2" velocity="2" effort="50"/></joint>'
        for k, (kind, axis) in enumerate(
            (("continuous", "0 0 1"), ("revolute", "0 1 0"), ("revolute", "0 1 0"))
        )
    )
    chain = chain.replace('lower="-2" upper="2" ', "", 1)
    (tmp_path / "turn.urdf").write_text(f'<robot name="turn"><link name="l0"/>{chain}</robot>')
    targets, angles = across(1000)
    rows = (
        "".join(
            f"{k * PERIOD:.3f},{target[0]!r},0.5,0.5\n"
            for k, target in enumerate(targets)
            if target is not None
        )
        .replace("np.float64(", "")
        .replace(")", "")
    )
    (tmp_path / "wrap.csv").write_text("t,q1,q2,q3\n" + rows)
    (tmp_path / "turn.yaml").write_text(
        "arm: {model: turn.urdf, frame: l3}\nstart: [3, 0.5, 0.5]\nlaw: {kind: joint_stream}\n"
        "targets: {file: wrap.csv}\nlimits: {velocity: 1, acceleration: 4}\nperiod: 4e-3\n"
        "duration: 1\n"
    )
    experiment = load_experiment(tmp_path / "turn.yaml")
    assert experiment.warnings[0] == (
        "targets: j1 jumps by more than half a turn (1 time), and turns without end: it takes "
        "the shorter way"
    )
    result = simulate(experiment)
    assert result.metrics["target_error_max_rad"] < 0.1
    assert result.series["position"][-1, 0] == pytest.approx(angles[-1], abs=0.1)


def outside(arm, rng):
    """A posture of which joints are up to 0.2 rad beyond a limit, and one well inside."""
    lower, upper = arm.limits.position_lower, arm.limits.position_upper
    lower, upper = np.where(np.isfinite(lower), lower, -3.0), np.where(np.isfinite(upper), upper, 3)
    side, by = rng.integers(-1, 2, arm.n), rng.uniform(0.0, 0.2, arm.n)
    side[rng.integers(arm.n)] = 1
    free = rng.uniform(lower, upper)
    q = np.where(side > 0, upper + by, np.where(side < 0, lower - by, free))
    return q, 0.5 * (lower + upper)


@pytest.mark.parametrize(
    "count",
    [1, pytest.param(6, marks=pytest.mark.long), pytest.param(40, marks=pytest.mark.nightly)],
)
@pytest.mark.parametrize("name", ["panda", "iiwa14", "ur5", "gen3", "puma560"])
def test_an_arm_that_was_pushed_outside_its_limits_comes_back_within_all_others(name, count):
    """In no sample farther outside than before, to 1e-12 rad; inside after 0.2 rad at 0.2 V."""
    arm, rng = load_arm(name), np.random.default_rng(count)
    for k in range(count):
        jerk = 40.0 if k % 2 == 0 else None
        limits = arm.limits.replace(velocity=0.8, acceleration=2.0, jerk=jerk)
        start, middle = outside(arm, rng)
        guard = Guard(JointStream(limits=limits, home=start), 5e-3)
        targets = [*(start + rng.uniform(-1, 1, arm.n) for _ in range(8)), middle]
        q, v, a = start, np.zeros(arm.n), np.zeros(arm.n)
        for i in range(500):
            before, v_before, a_before = q, v, a
            q = guard.command(targets[min(i // 40, 8)])
            v = guard.velocity
            a = (v - v_before) / 5e-3
            worse = limits.violation(q) - limits.violation(before)
            assert worse.max() <= 1e-12
            assert (np.abs(v) <= 0.8 * (1 + HELD)).all()
            assert (np.abs(a) <= 2.0 * (1 + HELD)).all()
            assert jerk is None or (np.abs(a - a_before) <= jerk * 5e-3 * (1 + HELD)).all()
        assert not limits.violation(q).any()


@pytest.mark.parametrize("jerk", [None, 40.0])
def test_an_arm_that_comes_back_from_outside_its_limits_touches_nothing_on_its_way(jerk):
    """A ball where the last joint's turn leads the tool, which does not hold it outside."""
    start = np.array(HOME)
    start[0] = LIMITS.position_upper[0] + 0.15
    p = PANDA.p_WE(start - 0.5 * np.eye(N)[0])
    ball = {"kind": "ball", "center": [*p[:2], p[2] + 0.05], "radius": 0.05}
    clearance, _ = arm_clearance(load_arm("panda"), make_obstacles([ball]), start)
    limits = LIMITS.replace(velocity=0.8, acceleration=2.0, jerk=jerk)
    law = JointStream(limits=limits, home=start, clearance=clearance)
    target = start - 1.2 * np.eye(N)[0]
    guard = Guard(law, 5e-3)
    q = np.array([start, *(guard.command(target) for _ in range(400))])
    assert clearance.least_along(q).min() >= 0.005
    assert not limits.violation(q[-1]).any()
    # Without the ball in its clearance it is hit.
    blind = Guard(JointStream(limits=limits, home=start), 5e-3)
    q = np.array([start, *(blind.command(target) for _ in range(400))])
    assert clearance.least_along(q).min() < 0.0


def test_to_pursue_targets_needs_an_interval():
    with pytest.raises(InvalidInputError, match=r"pursues: needs an interval"):
        JointStream(limits=LIMITS, home=HOME, pursues=True)


def test_an_arm_farther_outside_its_limits_is_refused():
    start = np.array(HOME)
    start[0] = LIMITS.position_upper[0] + 0.21
    with pytest.raises(InvalidInputError, match=r"^start: joint 1 is at .* rad; it may be"):
        Guard(JointStream(limits=LIMITS, home=start), PERIOD)


# The step compiled to C.

TWO = JointLimits(
    position_lower=[-np.inf, -1.5],
    position_upper=[np.inf, 1.5],
    velocity=[1.0, 0.8],
    acceleration=[4.0, 3.0],
    jerk=[80.0, 60.0],
)


def at_times(rng, count, period):
    """Times of calls: most on time, some late or early, a few by several periods."""
    chances = [0.6, 0.15, 0.15, 0.1]
    return np.cumsum(period * (1.0 + rng.choice([0.0, 0.2, -0.1, 3.0], count, p=chances)))


def commanded(law, seed, count, *, timed, compiled):
    """What a guard commands of wild targets, half of them late; it is resumed on the way."""
    rng, n = np.random.default_rng(seed), law.limits.size
    times = at_times(rng, count, PERIOD).tolist() if timed else [None] * count
    guard = Guard(law, PERIOD, t=0.0 if timed else None, compiled=compiled)
    rows = []
    for k, t in enumerate(times):
        target = None
        if rng.random() < 0.03:
            target = law.home + rng.uniform(-3.0, 3.0, n) * rng.choice([0.01, 0.3, 1.0, 1e300])
            target[rng.integers(n)] = rng.choice([0.0, 0.3, np.nan, np.inf])
        if k == count // 2:
            guard.resume(guard.position, 0.5 * guard.velocity, np.zeros(n), t)
            t = None if t is None else t + 1e-9
        q = guard.command(target, t=t)
        rows.append([*q, *guard.velocity, *guard.part("missed"), *guard.part("since")])
    return np.array(rows), guard.late_stops


def require_compiler():
    pytest.importorskip("jax", reason="needs the extra jax")


# Time and lateness are the guard's; in C there are joints, bounds of the jerk and an interval.
CASES = [
    pytest.param(JointStream(limits=TWO, home=[0.2, 0.5]), [True], marks=LONG),
    pytest.param(JointStream(limits=TWO, home=[0.2, 0.5], interval=0.05), [False], marks=LONG),
    pytest.param(JointStream(limits=LIMITS, home=HOME), [False, True], marks=LONG),
    pytest.param(JointStream(limits=LIMITS, home=HOME, interval=0.05), [True], marks=LONG),
    pytest.param(JointStream(limits=WITH_JERK, home=HOME, interval=0.05), [False], marks=LONG),
]


@pytest.mark.parametrize(("law", "ways"), CASES)
def test_compiled_it_commands_the_same(law, ways):
    require_compiler()
    for timed in ways:
        plain, compiled = (
            commanded(law, 3, 1500, timed=timed, compiled=compiled) for compiled in (False, True)
        )
        np.testing.assert_allclose(compiled[0], plain[0], rtol=0.0, atol=1e-12)
        assert compiled[1] == plain[1]
        assert not timed or plain[1] > 0


@pytest.mark.parametrize(
    ("interval", "seeds"),
    [
        (0.0, [0]),
        pytest.param(0.0, range(2, 20, 2), marks=LONG),
        pytest.param(0.05, range(1, 20, 2), marks=LONG),
    ],
)
def test_compiled_every_bound_is_held_whatever_comes(interval, seeds):
    """One guard, built once, is resumed at rest for each draw of targets."""
    require_compiler()
    law = JointStream(limits=TWO, home=[0.2, 0.5], interval=interval)
    guard = Guard(law, PERIOD, compiled=True)
    for seed in seeds:
        guard.resume(law.home, np.zeros(2), np.zeros(2))
        check_bounds(guard, law, np.random.default_rng(seed))


def check_bounds(guard, law, rng):
    """No bound is broken by what a guard commands of wild targets, and some are reached."""
    rows = [np.zeros(2)] * 3
    for _ in range(3000):
        target = law.home + rng.uniform(-3.0, 3.0, 2) if rng.random() < 0.03 else None
        if target is not None and rng.random() < 0.3:
            target[rng.integers(2)] = np.nan
        q = guard.command(target)
        assert not TWO.violation(q).any()
        rows.append(guard.velocity)
    v = np.array(rows)
    for order, name in enumerate(("velocity", "acceleration", "jerk")):
        size = np.abs(np.diff(v, n=order, axis=0)) / PERIOD**order
        assert (size <= TWO.bounds[name] * (1.0 + HELD)).all(), name
        # It is the bounds that hold it back.
        assert (size.max(axis=0) >= TWO.bounds[name] * (1.0 - 1e-6)).any(), name


@pytest.mark.long
def test_a_process_traces_laws_of_the_same_values_once():
    require_compiler()

    laws = [JointStream(limits=TWO, home=[0.2, 0.5]).sampled(PERIOD) for _ in range(2)]
    first, again = (native_step(law, PERIOD)[0] for law in laws)
    assert first is again
    other = JointStream(limits=TWO.replace(velocity=0.3), home=[0.2, 0.5]).sampled(PERIOD)
    assert native_step(other, PERIOD)[0] is not first


@pytest.mark.long
def test_beside_a_ball_a_compiled_guard_commands_what_numpy_does():
    """To 1e-12 rad, although one looks at all pairs and the other at those that may matter."""
    require_compiler()
    p = PANDA.p_WE(HOME)
    balls = [{"kind": "ball", "center": [*p[:2], p[2] + z], "radius": 0.05} for z in (-0.2, 0.3)]
    clearance, _ = arm_clearance(load_arm("panda"), make_obstacles(balls), HOME)
    law = JointStream(limits=LIMITS, home=HOME, clearance=clearance)
    guards = Guard(law, PERIOD), Guard(law, PERIOD, compiled=True)
    rows = np.array([[guard.command(target) for guard in guards] for target in wild(0, 1500)])
    np.testing.assert_allclose(rows[:, 1], rows[:, 0], rtol=0.0, atol=1e-12)
    assert clearance.least_along(rows[:, 1]).min() >= 0.005


def test_compiled_is_true_or_false():
    law = JointStream(limits=LIMITS, home=HOME)
    with pytest.raises(InvalidInputError, match=r"^compiled: must be of class bool"):
        Guard(law, PERIOD, compiled=1)
