"""What is commanded of what a law wants: within every bound, and free; else as it is."""

from dataclasses import dataclass

import numpy as np
import pytest
from adaptive_helpers import HOME, LIMITS, PANDA, N, excess, moved

from drake_rnn import (
    Avoidance,
    InvalidInputError,
    Layout,
    Safety,
    SampledController,
    SampledLaw,
    load_arm,
)
from drake_rnn.laws.safety import nearest
from drake_rnn.robot.clearance.arm_clearance import arm_clearance
from drake_rnn.robot.clearance.obstacles import make_obstacles

HELD = 1e-9
WITH_JERK = LIMITS.replace(jerk=30.0)


def clearance_of(*balls):
    obstacles = [{"kind": "ball", "center": list(p), "radius": 0.05} for p in balls]
    return arm_clearance(load_arm("panda"), make_obstacles(obstacles), HOME)[0]


@dataclass(frozen=True)
class Wild(SampledLaw):
    """Wants any velocity, and another one every tenth of a second; sums up what it wanted."""

    seed: int = 0
    size: float = 3.0

    state = Layout(v=(N,), wanted=(N,))
    inputs = Layout(J=(3, N), p_WE=(3,), p_WE_desired=(3,), p_preview=(3,), position=(N,))
    task_size = 3

    def step(self, t, x, u, period):
        rng = np.random.default_rng([self.seed, int(t / 0.1 + 1e-6)])
        v = self.size * rng.uniform(-1.0, 1.0, N)
        return np.concatenate((v, x[N:] + period * v))


class Safely:
    """A law as `moved` takes it, with a safety around its reading."""

    def __init__(self, law, safety):
        self.law, self.safety = law, safety
        self.inputs, self.task_size = law.inputs, 3

    def sampled(self, period):
        return self.safety.around(self.law.sampled(period), period)


def still(_):
    return PANDA.p_WE(HOME)


@pytest.mark.parametrize("limits", [LIMITS, WITH_JERK], ids=["acceleration", "jerk"])
def test_whatever_a_law_wants_every_bound_is_held_and_without_safety_is_not(limits):
    safely = moved(Safely(Wild(), Safety(limits)), still, 1.0)
    assert max(excess(safely, limits).values()) < HELD
    wildly = moved(Wild(), still, 1.0)
    assert excess(wildly, limits)["velocity"] > 1.0
    assert excess(wildly, limits)["acceleration"] > 100.0


@pytest.mark.parametrize(
    ("seed", "limits"),
    [(0, LIMITS), pytest.param(1, WITH_JERK, marks=pytest.mark.long)],
)
def test_whatever_a_law_wants_nothing_is_touched_and_without_safety_is(seed, limits):
    away = np.array([[0.0, 0.16, 0.0], [0.2, 0.0, 0.0], [0.0, 0.0, -0.18]])
    clearance = clearance_of(*(PANDA.p_WE(HOME) + away))
    law = Wild(seed, 0.5)
    safely = moved(Safely(law, Safety(limits, clearance)), still, 1.2)
    assert clearance.least_along(safely.q).min() >= Avoidance().floor
    assert max(excess(safely, limits).values()) < HELD
    bounded = moved(Safely(law, Safety(limits)), still, 1.2)
    assert clearance.least_along(bounded.q).min() < 0.0


def test_a_velocity_that_is_safe_stays_as_it_is_to_the_last_bit():
    rng = np.random.default_rng(0)
    within = Safety(LIMITS, clearance_of([-0.6, 0.0, 0.8])).within(1e-3)
    state = {"commanded": HOME, "v": np.zeros(N), **within.init({"position": HOME}, None)}
    for _ in range(20):
        wanted = 1e-3 * rng.uniform(-1.0, 1.0, N)
        for J in (None, rng.normal(size=(3, N)), rng.normal(size=(6, N))):
            v, _ = within.step(state, {}, 1e-3, nearest(wanted, J))
            assert np.array_equal(v, wanted)


def test_the_law_goes_on_with_its_own_state():
    """What it wanted is its next velocity; an outer one would be another law's."""
    reading = Safely(Wild(), Safety(LIMITS)).sampled(1e-3)
    motion = moved(Safely(Wild(), Safety(LIMITS)), still, 0.05)
    rng = np.random.default_rng([0, 0])
    wanted = 3.0 * rng.uniform(-1.0, 1.0, N)
    assert reading.state.part(motion.x, "safe_wanted") == pytest.approx(wanted, abs=0.0)
    assert reading.state.part(motion.x, "wanted") == pytest.approx(0.05 * wanted)
    assert np.abs(reading.state.part(motion.x, "v")).max() < 0.06


def test_joints_make_way_where_the_task_allows_it():
    """Of a task velocity, what one joint may not do others do, if J is known."""
    J = np.eye(3, N) + np.eye(3, N, 3)
    wanted = np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    within = Safety(LIMITS.replace(acceleration=300.0)).within(1e-3)
    rest = {"commanded": HOME, "v": np.zeros(N), **within.init({"position": HOME}, None)}
    alone, _ = within.step(rest, {}, 1e-3, nearest(wanted))
    helped, _ = within.step(rest, {}, 1e-3, nearest(wanted, J))
    assert J @ alone == pytest.approx([0.3, 0.0, 0.0])
    assert J @ helped == pytest.approx([0.5, 0.0, 0.0], abs=1e-5)


def test_what_cannot_be_kept_is_refused():
    with pytest.raises(InvalidInputError, match="safety: has limits of 7 joints; the law moves 2"):
        Safety(LIMITS).around(Small(), 1e-3)
    with pytest.raises(InvalidInputError, match="safety: Ramp varies its command between samples"):
        Safety(LIMITS).around(Ramp(), 1e-3)
    with pytest.raises(InvalidInputError, match=r"start: tool and ball 1 are .* apart"):
        moved(Safely(Wild(), Safety(LIMITS, clearance_of(PANDA.p_WE(HOME)))), still, 0.1)
    with pytest.raises(InvalidInputError, match="clearance: is of an arm of 7 joints; the limits"):
        Safety(LIMITS.select([0, 1]), clearance_of())
    with pytest.raises(InvalidInputError, match="safety: must be of class Safety or None"):
        SampledController(Wild(), 1e-3, safety=True)
    assert Safety(LIMITS).keeps_distance is None
    assert Safety(WITH_JERK).keeps == ("position", "velocity", "acceleration", "jerk")


class Small(SampledLaw):
    state, inputs = Layout(v=(2,)), Layout(position=(2,))

    def step(self, t, x, u, period):
        return x


class Ramp(Wild):
    def commanded_velocity(self, t, x):
        return x[:N]
