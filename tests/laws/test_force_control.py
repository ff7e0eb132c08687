"""The adaptive law where it presses: on a spring, with the kinematics of Drake."""

import numpy as np
import pytest
from adaptive_helpers import HOME, LIMITS, PANDA, PERIOD, N, adaptive, excess, signals

from drake_rnn import Adaptive, ContactLoss, ForceControl, InvalidInputError, OnlineStiffness
from drake_rnn.laws.law import Circumstances
from drake_rnn.laws.parts.surface_task import LOST

STIFFNESS, FORCE = 1000.0, 5.0
TILTED = np.array([0.6, 0.0, 0.8])
FIXED = ForceControl(stiffness=STIFFNESS)


class Pressed:
    """What an arm did on a spring: positions, velocities, forces [N], ways aside [m], states."""

    def __init__(self, law, until, desired=None, normal=TILTED, touches=lambda t: True):
        start = PANDA.p_WE(HOME)
        desired = (lambda t: start) if desired is None else desired
        reading = law.sampled(PERIOD)
        q, v, rows, x = np.array(HOME), np.zeros(N), [], None
        for k in range(round(until / PERIOD)):
            t = k * PERIOD
            u = signals(law, q, desired, t, PERIOD)
            depth = normal.dot(start - u["p_WE"])
            force = STIFFNESS * max(depth, 0.0) if touches(t) else 0.0
            u |= {"normal_WE": normal, "normal_force": np.array([force])}
            u["normal_force_desired"] = np.array([FORCE])
            if x is None:
                x = reading.initial_state(np.random.default_rng(0), u)
            away = desired(t) - u["p_WE"]
            aside = np.linalg.norm(away - normal.dot(away) * normal)
            x = reading.step(t, x, u, PERIOD)
            rows.append((q, v, force, aside, x))
            v = reading.commanded_velocity(t, x)
            q = q + PERIOD * v
        columns = zip(*rows, strict=True)
        self.q, self.v, self.force, self.aside, self.x = (np.array(c) for c in columns)
        self.named = reading.state.by_name(self.x)
        self.told = reading.diagnostics(0.0, self.x, {})


def along(t):
    """A way of 5 cm in 2 s along the tilted surface, from rest to rest."""
    s = np.clip(t / 2.0, 0.0, 1.0)
    share = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
    return PANDA.p_WE(HOME) + 0.05 * share * np.array([0.0, 1.0, 0.0])


@pytest.mark.parametrize("options", [{"task_size": 6}, {"jerk": 50.0}])
def test_it_presses_while_it_follows_a_path_and_keeps_every_bound(options):
    """What a gain of 10/s leaves of 5 N after 1 s is 0.2 mN; aside 1 um, the price of the task.

    The force that is missing at first moves the tool at once, and half a second later it is back.
    """
    limits = LIMITS.replace(jerk=options.pop("jerk", None))
    motion = Pressed(adaptive(force_control=FIXED, limits=limits, **options), 1.5, along)
    assert np.abs(motion.force[1000:] - FORCE).max() < 5e-3
    assert motion.aside[700:].max() < 2e-6
    assert max(excess(motion, limits).values()) <= 1e-9


def test_of_a_path_off_the_surface_only_what_is_along_it_is_followed():
    """The target goes 3 cm away from the surface; the force stays."""

    def away(t):
        return along(t) + 0.03 * min(t, 1.0) * TILTED

    motion = Pressed(adaptive(force_control=FIXED), 1.5, away)
    assert np.abs(motion.force[1000:] - FORCE).max() < 5e-3
    assert motion.aside[200:].max() < 2e-6


def test_a_missing_force_is_approached_so_that_the_arm_can_brake():
    """A stiffness that is far too low asks for 5 m/s; the tool presses no harder than it should."""
    soft = ForceControl(stiffness=10.0, gain=10.0)
    motion = Pressed(adaptive(force_control=soft, braking=0.01), 2.0)
    speed = np.abs([PANDA.J(q) @ v for q, v in zip(motion.q[::20], motion.v[::20], strict=True)])
    # sqrt(2 a d) with the depth that is believed to be missing, 0.5 m.
    assert speed.max() < 1.01 * np.sqrt(2.0 * 0.01 * FORCE / 10.0)


def test_no_faster_than_the_approach_speed():
    control = ForceControl(stiffness=100.0, approach_speed=2e-3)
    motion = Pressed(adaptive(force_control=control), 1.0, touches=lambda t: False)
    rise = [TILTED @ PANDA.J(q) @ v for q, v in zip(motion.q[200:], motion.v[200:], strict=True)]
    np.testing.assert_allclose(rise, -2e-3, rtol=1e-3)


def test_a_stiffness_that_is_not_known_is_learned():
    learning = ForceControl(stiffness=OnlineStiffness(initial=300.0, exponent=1.0))
    motion = Pressed(adaptive(force_control=learning), 1.5)
    assert motion.named["stiffness"][-1, 0] == pytest.approx(STIFFNESS, rel=1e-3)
    assert abs(motion.force[-1] - FORCE) < 5e-3


@pytest.mark.parametrize(("reaction", "way"), [("hold", 0.0), ("retreat", 0.01)])
def test_without_contact_it_holds_still_or_retreats_and_follows_nothing(reaction, way):
    """The surface is gone at 1 s; 50 ms later that counts as a loss."""
    loss = ContactLoss(reaction=reaction, retreat_distance=0.01)
    control = ForceControl(stiffness=STIFFNESS, contact_loss=loss)
    law = adaptive(force_control=control)
    motion = Pressed(law, 2.5, along, touches=lambda t: t < 1.0)
    lost = motion.named["contact"][:, 0] == LOST
    assert np.argmax(lost) == pytest.approx(1050, abs=2)
    np.testing.assert_array_equal(motion.told["contact_lost"][:, 0], lost)
    left = PANDA.p_WE(motion.q[-1]) - PANDA.p_WE(motion.q[np.argmax(lost)])
    # Braking at 1 rad/s^2 from the 47 mm/s of the path takes a millimetre.
    np.testing.assert_allclose(left, way * TILTED, atol=1.5e-3)
    (said,) = law.sampled(PERIOD).caveats({"contact_lost_time_s": 1.05})
    assert said.startswith("law.force_control.contact_loss: ")
    assert excess(motion, LIMITS)["acceleration"] <= 1e-9


def test_where_bounds_leave_no_way_to_do_both_the_force_is_kept_and_the_path_waits():
    """Joints of 0.01 rad/s: the target runs away aside, the force stays within 1 %."""
    slow = LIMITS.replace(velocity=0.01)

    def fast(t):
        return PANDA.p_WE(HOME) + 0.2 * min(t, 1.0) * np.array([0.0, 1.0, 0.0])

    motion = Pressed(adaptive(force_control=FIXED, limits=slow), 2.0, fast)
    assert motion.aside[1000:].min() > 0.05
    assert np.abs(motion.force[1000:] - FORCE).max() < 0.05
    assert excess(motion, slow)["velocity"] <= 1e-9


def test_a_bound_of_the_jerk_lets_it_have_half_the_gain_that_it_has_in_the_air():
    limits = LIMITS.replace(jerk=20.0)
    free, pressing = (adaptive(limits=limits, force_control=f) for f in (None, FIXED))
    assert pressing.loop_gains["kappa"] == 0.5 * free.loop_gains["kappa"]


def test_it_sees_the_contact_only_if_it_presses():
    seen = {"normal_WE", "normal_force", "normal_force_desired"}
    assert seen <= adaptive(force_control=FIXED).inputs.parts.keys()
    assert not seen & adaptive().inputs.parts.keys()


def test_what_it_cannot_do_is_refused():
    with pytest.raises(InvalidInputError, match=r"force_control: needs task: xyz or pose"):
        Adaptive(limits=LIMITS, home=HOME, task_size=2, force_control=FIXED)
    floor = ForceControl(stiffness=1e3, contact_loss=ContactLoss(floor=0.5))
    message = r"law\.force_control\.contact_loss\.floor: must be below force\.value, 0\.5 N"
    with pytest.raises(InvalidInputError, match=message):
        adaptive(force_control=floor).doubts(Circumstances(pressing_force=0.5))
