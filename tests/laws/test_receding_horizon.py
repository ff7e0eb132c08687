"""The receding horizon: six bounds at every instant, and a chain that the arm truly follows."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.solvers import ClarabelSolver, MathematicalProgram
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder

from drake_rnn import (
    AddLoop,
    IdealArm,
    InvalidInputError,
    JointLimits,
    RecedingHorizon,
    SampledController,
    SimulationError,
    load_arm,
)
from drake_rnn.laws.call_checks import without_checks
from drake_rnn.paths import Circle, Square
from drake_rnn.robot.limits import DERIVATIVE_UNITS
from drake_rnn.systems.sources import (
    JointReference,
    followed_path,
    held_posture,
)

PERIOD = 0.01
BOUNDS = {"circle": (0.2, 0.1, 0.1, 0.2, 0.2), "square": (0.1, 0.15, 0.2, 0.4, 0.5)}
START = np.array([0.4, 0.8, -0.3, -1.2, 0.5, 0.9, 0.2])
PATHS = {
    "circle": Circle(size=0.15, period=30.0, plane="yz"),
    "square": Square(size=0.2, period=40.0, plane="yz"),
}


def limits(shape="circle", n=1, **changes):
    bounds = dict(zip(DERIVATIVE_UNITS, BOUNDS[shape], strict=True))
    bounds |= {"position_lower": -2.0, "position_upper": 2.0} | changes
    return JointLimits(
        **{name: None if b is None else np.full(n, float(b)) for name, b in bounds.items()}
    )


def make(shape="circle", n=1, **fields):
    return RecedingHorizon(limits=limits(shape, n), **fields)


def begin(law, q):
    return law.initial_state(np.random.default_rng(0), {"position": np.asarray(q, dtype=float)})


def run(law, x, desired, duration, since=0.0):
    """Positions, shape (k, n), and derivatives over their bounds, (k, 5, n), every 10 ms."""
    positions, ratios = [], []
    bounds = np.array([getattr(law.limits, name) for name in DERIVATIVE_UNITS])
    for k in range(round(duration / PERIOD)):
        t = since + k * PERIOD
        shown = np.broadcast_to(desired(t), (law.horizon, law.limits.size))
        seen = {"position": law.planned_position(t, x), "position_preview": shown}
        x = law.step(t, x, seen, PERIOD)
        positions.append(law.planned_position(t + PERIOD, x))
        ratios.append(np.vstack((law.state.part(x, "v"), law.state.part(x, "levels"))) / bounds)
    return np.array(positions), np.abs(ratios), x


def fallbacks(law, x):
    return law.state.part(x, "fallbacks").sum()


# What it does.


@pytest.mark.parametrize(("shape", "settles"), [("circle", 9.25), ("square", 11.54)])
@pytest.mark.long
def test_a_step_of_one_radian_settles_within_all_bounds(shape, settles):
    law = make(shape, 2)
    q, ratios, x = run(law, begin(law, [0.0, 0.5]), lambda t: np.array([1.0, -0.5]), 16.0)
    late = np.flatnonzero((np.abs(q - [1.0, -0.5]) > 0.01).any(axis=1))[-1]
    assert (late + 1) * PERIOD == pytest.approx(settles, abs=0.02)
    assert ratios.max() <= 1.0
    assert ratios.max() > 0.99  # no slower than it must be
    assert np.abs(q).max() <= 2.0
    # The duality gap at which the solver stops leaves this much.
    np.testing.assert_allclose(q[-1], [1.0, -0.5], atol=1e-3)
    assert fallbacks(law, x) == 0


@pytest.mark.parametrize("shape", BOUNDS)
def test_what_lies_beyond_a_limit_ends_inside_it(shape):
    law = make(shape)
    q, ratios, _ = run(law, begin(law, [0.8]), lambda t: np.array([5.0]), 20.0)
    assert q.max() <= 2.0
    assert q[-1, 0] == pytest.approx(2.0, abs=2e-3)
    assert ratios.max() <= 1.0


@pytest.mark.long
@settings(max_examples=6)
@given(seed=st.integers(0, 2**31), shape=st.sampled_from(list(BOUNDS)))
def test_no_reference_breaks_a_bound(seed, shape):
    rng = np.random.default_rng(seed)
    law = make(shape, 2)
    jumps = rng.uniform(-6.0, 6.0, (20, law.horizon, 2)) * rng.choice([1e-3, 1.0, 1e3], (20, 1, 1))
    q, ratios, _ = run(law, begin(law, rng.uniform(-2, 2, 2)), lambda t: jumps[int(t / 0.4)], 8.0)
    assert ratios.max() <= 1.0 + 1e-9  # rounding of fifth differences
    assert np.abs(q).max() <= 2.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_start_at_the_very_limit_can_leave_it(side):
    law = make("square")
    q, ratios, _ = run(law, begin(law, [2.0 * side]), lambda t: np.array([1.5 * side]), 12.0)
    assert np.abs(q).max() <= 2.0
    assert ratios.max() <= 1.0
    assert q[-1, 0] == pytest.approx(1.5 * side, abs=1e-2)


def test_where_no_bound_is_met_the_reference_is_followed():
    law = make("square")
    ahead = law.interval * np.arange(1, law.horizon + 1)[:, np.newaxis]

    def wave(t):
        # Leaves rest with four derivatives zero.
        s = np.minimum(t + ahead, 20.0) / 20.0
        return 0.5 * s**5 * (126 - 420 * s + 540 * s**2 - 315 * s**3 + 70 * s**4)

    q, ratios, _ = run(law, begin(law, [0.0]), wave, 22.0)
    times = np.minimum(PERIOD * np.arange(1, len(q) + 1), 20.0) / 20.0
    desired = 0.5 * times**5 * (126 - 420 * times + 540 * times**2 - 315 * times**3 + 70 * times**4)
    assert ratios.max() < 0.95
    assert np.abs(q[:, 0] - desired).max() < 1e-3


def test_a_plan_is_as_good_as_clarabels():
    """The same program, put to another solver as differences of spline coefficients."""
    law = make("square", horizon=40)
    _, _, x = run(law, begin(law, [0.1]), lambda t: np.array([0.6]), 1.5)
    plan = law.state.part(x, "plan")
    before = np.concatenate((plan[1:], plan[-1:]))
    desired = np.linspace(0.3, 0.2, law.horizon)[:, np.newaxis]
    found, solved = law._program.improve(before, desired)
    assert solved.all()

    knots = np.array([1.0, 26.0, 66.0, 26.0, 1.0]) / 120.0

    def levels(c):
        c = np.concatenate((c, np.repeat(c[-1:], 5)))
        return [np.diff(c, n=i) / law.interval**i for i in range(6)]

    def cost(c):
        top = levels(c)
        at_knots = np.convolve(top[0], knots, mode="valid")[1 : law.horizon + 1]
        u = top[5][: law.horizon] / BOUNDS["square"][4]
        return np.sum((at_knots - desired[:, 0]) ** 2) + law.effort * np.sum(u**2)

    program = MathematicalProgram()
    free = program.NewContinuousVariables(law.horizon - 4)
    unit = np.eye(law.horizon + 1)
    maps = [np.array([levels(row)[i] for row in unit]).T for i in range(6)]
    bounds = (2.0, *(law.margin * b for b in BOUNDS["square"]))
    for rows, bound in zip(maps, bounds, strict=True):
        offset = (rows[:, :5] @ before[:5])[:, 0]
        movable = np.abs(rows[:, 5:]).sum(axis=1) > 0
        scale = 1.0 / bound
        program.AddLinearConstraint(
            scale * rows[movable, 5:],
            scale * (-bound - offset[movable]),
            scale * (bound - offset[movable]),
            free,
        )
    at_knots = np.array([np.convolve(r, knots, mode="valid")[1:][: law.horizon] for r in maps[0].T])
    u = maps[5][: law.horizon] / BOUNDS["square"][4]
    terms = np.vstack((at_knots.T, np.sqrt(law.effort) * u))
    goal = np.concatenate((desired[:, 0], np.zeros(len(u)))) - terms[:, :5] @ before[:5, 0]
    program.Add2NormSquaredCost(terms[:, 5:], goal, free)
    answer = ClarabelSolver().Solve(program)
    assert answer.is_success()
    best = cost(np.concatenate((before[:5, 0], answer.GetSolution(free))))
    assert cost(found[:, 0]) <= best + 1e-5  # duality gap


# What the arm does.


def test_the_velocity_is_the_rate_of_the_planned_position():
    law = make("square", 2)
    _, _, x = run(law, begin(law, [0.0, 1.0]), lambda t: np.array([1.0, 0.0]), 3.05)
    t, step = 3.02, 1e-4
    secant = (law.planned_position(t + step, x) - law.planned_position(t - step, x)) / (2 * step)
    np.testing.assert_allclose(law.commanded_velocity(t, x), secant, atol=1e-9)


def test_before_the_first_plan_it_rests():
    law = make()
    assert law.commanded_velocity(0.0, begin(law, [0.3])) == 0.0


def simulated(shape, positions_at, duration, scheme=None):
    """Times, positions, velocities and states of the law at all steps; and the law."""
    arm = load_arm("iiwa14").with_limits(limits(shape, 7))
    law = RecedingHorizon(limits=arm.limits)
    builder = DiagramBuilder()
    reference = JointReference(positions_at, 7, law.interval, law.horizon)
    builder.AddNamedSystem("reference", reference)
    controller = SampledController(law, PERIOD)
    loop = AddLoop(builder, IdealArm(arm, START), controller, reference)
    simulator = Simulator(builder.Build())
    config = SimulatorConfig()
    config.integration_scheme = scheme or law.integration_scheme
    config.max_step_size, config.use_error_control = PERIOD, False
    ApplySimulatorConfig(config, simulator)
    steps = []

    def monitor(root):
        arm_context = loop.arm.GetMyContextFromRoot(root)
        position, velocity = (
            loop.arm.GetOutputPort(n).Eval(arm_context) for n in ("position", "velocity")
        )
        state = controller.state(controller.GetMyContextFromRoot(root))
        steps.append((root.get_time(), position.copy(), velocity.copy(), state))

    simulator.set_monitor(monitor)
    simulator.AdvanceTo(duration)
    return law, *(np.array(values) for values in zip(*steps, strict=True))


def test_the_arm_is_where_the_plan_says():
    law, t, q, v, x = simulated("circle", held_posture(START + 0.3), 2.0)
    assert np.abs(q[-1] - START).max() > 0.01
    assert np.abs(law.diagnostics(t, x, {"position": q})["slip"]).max() < 1e-12
    np.testing.assert_allclose(v[2:], law.state.part(x, "v")[2:], atol=1e-13)


def test_the_trapezoidal_rule_would_not_do():
    """Heun's integral of a velocity that is no ramp is off by h^2 a / 12."""
    law, t, q, _, x = simulated("circle", held_posture(START + 0.3), 2.0, "runge_kutta2")
    slip = np.abs(law.diagnostics(t, x, {"position": q})["slip"]).max()
    assert 1e-8 < slip < PERIOD**2 / 12 * 2 * BOUNDS["circle"][1]


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("shape", "duration", "error"), [("circle", 30, 1e-2), ("square", 40, 5e-3)]
)
def test_raw_paths_are_reached_within_all_bounds(shape, duration, error):
    path = PATHS[shape]
    arm = load_arm("iiwa14")
    reference = followed_path(path, arm, START, duration + 8.0)
    law, t, q, v, x = simulated(shape, reference, float(duration))
    kinematics = arm.kinematics()
    origin = path.start_point(kinematics.p_WE(START))
    off = [
        np.linalg.norm(kinematics.p_WE(posture) - origin - path.evaluate(time)[0])
        for time, posture in zip(t, q, strict=True)
    ]
    assert max(np.array(off)[t > 8.0]) <= error
    assert max(off) < 0.04  # the optimum of any law: 3.4e-2 / 1.6e-2 m
    bounds = BOUNDS[shape]
    for order, bound in enumerate(bounds):
        # Rounding of the velocity makes 1e-7 of the fifth derivative, far inside the margin.
        derivative = np.diff(v[1:], n=order, axis=0) / PERIOD**order
        assert np.abs(derivative).max() <= bound
    assert np.abs(law.diagnostics(t, x, {"position": q})["slip"]).max() < 1e-9
    assert fallbacks(law, x[-1]) == 0


# When there is no plan.


class _Broken:
    """A solver that returns what it was told to."""

    def __init__(self, change, solved):
        self.change, self.solved = change, solved

    def improve(self, plan, desired):
        found = plan.copy()
        found[5:] += self.change
        return found, np.full(plan.shape[1], self.solved)


@pytest.mark.parametrize(
    ("change", "solved"), [(0.0, False), (1e-3, True), (np.nan, True), (10.0, True)]
)
def test_without_a_plan_that_holds_the_bounds_the_old_one_is_followed(change, solved):
    law = make("circle")
    _, _, x = run(law, begin(law, [0.0]), lambda t: np.array([1.0]), 3.0)
    end = law.state.part(x, "plan")[-1].copy()
    law.__dict__["_program"] = _Broken(change, solved)
    q, ratios, x = run(law, x, lambda t: np.array([1.0]), 9.0, since=3.0)
    assert fallbacks(law, x) == 90
    assert ratios.max() <= 1.0
    np.testing.assert_allclose(q[-1], end, atol=1e-12)
    assert law.state.part(x, "v") == pytest.approx(0.0, abs=1e-12)


def test_the_same_state_has_the_same_successor():
    law = make("circle", 3)
    goal = np.array([1.0, -0.3, 5.0])
    _, _, x = run(law, begin(law, [0.0, 0.5, 1.0]), lambda t: goal, 2.0)
    u = {"position": np.zeros(3), "position_preview": np.tile(goal, (law.horizon, 1))}
    given = x.copy()
    first = law.step(2.0, x, u, PERIOD)
    assert np.array_equal(first, law.step(2.0, x, u, PERIOD))
    assert np.array_equal(first, make("circle", 3).step(2.0, x, u, PERIOD))
    assert np.array_equal(x, given)


# What is refused.


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"crackle": None}, "limits.crackle: not known for this arm"),
        ({"jerk": np.inf}, "limits.jerk: must be finite"),
        ({"position_upper": np.inf}, "limits.position_upper: must be finite"),
    ],
)
def test_needs_all_bounds(changes, message):
    with pytest.raises(InvalidInputError, match=message):
        RecedingHorizon(limits=limits(**changes))


@pytest.mark.parametrize(
    ("seen", "message"),
    [
        ({"position": np.array([0.0, 2.1])}, "start: joint 2 is at 2.1 rad"),
        (
            {"position": np.zeros(2), "velocity": np.array([0.0, 0.1])},
            "start: .* must start at rest",
        ),
    ],
)
def test_starts_at_rest_inside_the_limits(seen, message):
    with pytest.raises(InvalidInputError, match=message):
        make(n=2).initial_state(np.random.default_rng(0), seen)


def test_the_period_divides_the_interval():
    law = make()
    assert law.sampled(0.02) is law
    for period in (0.03, 0.2):
        with pytest.raises(InvalidInputError, match="period: must divide law"):
            SampledController(make(), period)


def test_a_reference_that_is_not_finite_stops_the_run():
    law = make()
    shown = {"position_preview": np.full((law.horizon, 1), np.nan)}
    with pytest.raises(SimulationError, match="position_preview is not finite"):
        without_checks(law.step)(0.0, begin(law, [0.0]), shown, PERIOD)
