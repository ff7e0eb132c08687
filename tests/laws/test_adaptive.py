"""The law `adaptive`: what it holds, how well it tracks, and what it refuses and doubts."""

import numpy as np
import pytest
from adaptive_helpers import (
    HOME,
    LIMITS,
    PANDA,
    PERIOD,
    N,
    adaptive,
    circle,
    excess,
    moved,
    signals,
)

from drake_rnn import Circumstances, InvalidInputError, JointLimits, Secondary, load_arm
from drake_rnn.laws.parts import reach_edge as near_singular
from drake_rnn.laws.parts.jacobian import EXACT, KAPPA, MiddleJacobian
from drake_rnn.laws.parts.reach_edge import ReachEdge

JERKY = LIMITS.replace(jerk=20.0)
P_START = PANDA.p_WE(HOME)
#: All bounds, to the accuracy that the house holds them to.
HELD = 1e-9


def order_of_error(periods):
    """Largest errors on a circle, of a dead-beat law at some periods [m]."""
    found = []
    for h in periods:
        law = adaptive(kappa=1.0 / h, softness=1e-10)
        motion = moved(law, circle(radius=0.08, turn=6.0), 8.0, period=h)
        found.append(motion.error[round(4.0 / h) :].max())
    return np.array(found)


def test_halving_the_period_takes_the_error_to_an_eighth(monkeypatch):
    """A sample's chord is off by h^3 with J at its middle, and by h^2 with J at its beginning.

    Dead-beat feedback takes back what the sample before was off. 5 %: the next power of h.
    """
    middle = order_of_error((16e-3, 8e-3, 4e-3))
    np.testing.assert_allclose(middle[:-1] / middle[1:], 8.0, rtol=0.05)

    def at_the_beginning(self, state, u, period):
        return u["J"], {"J_before": u["J"][None]}

    monkeypatch.setattr(MiddleJacobian, "step", at_the_beginning)
    beginning = order_of_error((16e-3, 8e-3, 4e-3))
    np.testing.assert_allclose(beginning[:-1] / beginning[1:], 4.0, rtol=0.05)
    assert beginning[-1] > 100 * middle[-1]


@pytest.mark.parametrize(
    ("changes", "best"),
    [
        ({}, 1e-7),
        pytest.param({"task_size": 6}, 3e-7, marks=pytest.mark.long),
        pytest.param({"limits": JERKY}, 1e-7, marks=pytest.mark.long),
        ({"jacobian": "learned"}, 1e-7),
        pytest.param({"jacobian": "learned", "task_size": 6}, 1e-6, marks=pytest.mark.long),
        pytest.param(
            {"secondary": {"manipulability": 1.0, "low_acceleration": 0.2}},
            1e-7,
            marks=pytest.mark.long,
        ),
    ],
)
def test_a_circle_is_joined_and_tracked(changes, best):
    """Radius 4 cm in 4 s, from 0.1 m off; three to ten times what was measured is allowed."""
    law = adaptive(**changes)
    offset = np.array([0.1, 0.0, 0.0])
    motion = moved(law, circle(centre=P_START + offset), 6.0)
    assert motion.error[0] == pytest.approx(0.1)
    assert motion.error[4500:].max() < best
    assert max(excess(motion, law.limits).values()) < HELD


def jumping(seed, size, every):
    goals = P_START + np.random.default_rng(seed).uniform(-size, size, (100, 3))
    return lambda t: goals[int(t / every) % 100]


def running_away(t):
    return P_START + t * np.array([0.4, 0.3, 0.2])


LAWS = {
    "known": adaptive(),
    "learned": adaptive(jacobian="learned"),
    "pose": adaptive(task_size=6, secondary={"manipulability": 1.0}),
    "jerk": adaptive(limits=JERKY),
    "jerk_learned": adaptive(limits=JERKY, jacobian="learned"),
    "jerk_pose_learned": adaptive(limits=JERKY, jacobian="learned", task_size=6),
    "stiff": adaptive(kappa=1e3, softness=1e-9, secondary={"limits": 0.0, "posture": 20.0}),
}


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize(
    "desired",
    [jumping(1, 0.6, 0.4), jumping(2, 0.05, 0.02), running_away],
    ids=["jumps", "trembles", "runs away"],
)
def test_targets_that_no_arm_can_follow_break_no_bound(name, desired):
    law = LAWS[name]
    motion = moved(law, desired, 0.8)
    assert max(excess(motion, law.limits).values()) < HELD
    # It does try.
    assert np.abs(motion.v).max() > 0.03


@pytest.mark.parametrize(
    ("period", "lasts"),
    [
        pytest.param(1e-3, 3.0, marks=pytest.mark.long),
        *(pytest.param(period, 20.0, marks=pytest.mark.nightly) for period in (1e-3, 4e-3, 1e-2)),
    ],
)
@pytest.mark.parametrize("name", LAWS)
def test_no_bound_is_broken_in_a_narrow_cage(name, period, lasts):
    """Each joint may move by 0.1 rad to either side, while the target jumps."""
    law = LAWS[name]
    cage = law.limits.replace(position_lower=HOME - 0.1, position_upper=HOME + 0.1)
    law = adaptive(**{f: getattr(law, f) for f in ("jacobian", "task_size")}, limits=cage)
    motion = moved(law, jumping(3, 0.4, 0.3), lasts, period=period)
    assert max(excess(motion, cage, period).values()) < HELD
    assert (np.abs(motion.q - HOME).max(axis=0) > 0.099).sum() >= 4


def test_the_jerk_is_held_because_it_is_limited():
    desired = jumping(1, 0.6, 0.4)
    free = excess(moved(adaptive(), desired, 1.5), JERKY)
    assert free["jerk"] > 10.0
    assert free["acceleration"] < HELD
    assert excess(moved(adaptive(limits=JERKY), desired, 1.5), JERKY)["jerk"] < HELD


def within(width, **changes):
    return adaptive(
        limits=LIMITS.replace(position_lower=HOME - width, position_upper=HOME + width), **changes
    )


@pytest.mark.parametrize("jacobian", ["known", pytest.param("learned", marks=pytest.mark.long)])
def test_behind_its_position_limits_an_arm_waits_and_comes_back_with_the_target(jacobian):
    """0.02 rad/s: the other joints still creep to the posture that is nearest.

    A learned J, wrong along directions that the bounds keep it from, lets some move on.
    """
    law = within(0.15, jacobian=jacobian)

    def desired(t):
        return P_START + (np.array([0.3, 0.0, 0.0]) if t < 3.0 else 0.0)

    motion = moved(law, desired, 6.0)
    waiting = slice(2500, 2990)
    assert motion.error[waiting].min() > 0.2
    if jacobian == "known":
        # No further from the target than with joints that go to their limits at once, 242.5289 mm.
        assert motion.error[2990] < 0.242529
    # One is at its limit; others creep there, and are 0.06 and 0.43 mrad before theirs.
    assert (np.abs(np.abs(motion.q[2990] - HOME) - 0.15) < 5e-4).sum() >= 2
    if jacobian == "known":
        assert np.abs(motion.v[waiting]).max() < 0.02
    assert motion.error[-100:].max() < 1e-6
    assert max(excess(motion, law.limits).values()) < HELD


@pytest.mark.long
def test_stretched_out_towards_what_is_out_of_reach_it_comes_to_rest(monkeypatch):
    """Without braking and the softer task near the singular posture it passes to and fro there.

    Whether it comes back with the target depends on where the elbow is left, which may straighten
    on into its limit: a local law does not plan.
    """
    out = P_START + np.array([0.5, 0.0, 0.0])
    motion = moved(adaptive(), lambda t: out, 10.0)
    assert np.abs(motion.v[-1000:]).max() < 0.02
    assert max(excess(motion, LIMITS).values()) < HELD
    monkeypatch.setattr(near_singular, "_MOST", 0.0)
    monkeypatch.setattr(ReachEdge, "at", lambda *_: None)
    restless = moved(adaptive(), lambda t: out, 10.0)
    assert np.abs(restless.v[-1000:]).max() > 0.3
    assert max(excess(restless, LIMITS).values()) < HELD


def test_dead_beat_feedback_is_the_fastest():
    assert adaptive(kappa=1.0 / PERIOD).sampled(PERIOD).law.kappa == 1000.0
    with pytest.raises(
        InvalidInputError, match=r"^law\.kappa: may be at most 1000 /s at a period of 0\.001 s"
    ):
        adaptive(kappa=1001.0).sampled(PERIOD)
    with pytest.raises(InvalidInputError, match=r"^law\.kappa: may be at most 50 /s"):
        adaptive(kappa=100.0).sampled(0.02)
    assert adaptive().sampled(0.02).law.kappa == 50.0


def test_a_sampled_law_has_all_of_its_numbers():
    reading = adaptive(jacobian="learned").sampled(PERIOD)
    found = reading.law
    assert (found.kappa, found.softness) == (KAPPA, EXACT.softness)
    assert (found.variance, found.wander) == (EXACT.variance, EXACT.wander)
    assert (reading.samples, reading.late) == (1, 0)
    noisy = adaptive(jacobian="learned", measurement={"error": 1e-5, "delay": 5e-3})
    reading = noisy.sampled(PERIOD)
    assert (reading.samples, reading.late) == (10, 5)
    assert (reading.law.kappa, reading.law.softness) == (30.0, 1e-4)
    assert (reading.law.wander, reading.law.variance > EXACT.variance) == (0.1, True)
    # What is given stays.
    own = adaptive(jacobian="learned", kappa=7.0, softness=2e-5, variance=3e-3, wander=0.4)
    found = own.sampled(PERIOD).law
    assert (found.kappa, found.softness, found.variance, found.wander) == (7.0, 2e-5, 3e-3, 0.4)
    # A known Jacobian has nothing to learn from errors; only its feedback is slower.
    known = adaptive(measurement={"error": 1e-5})
    found = known.sampled(PERIOD).law
    assert (found.kappa, found.softness) == (pytest.approx(6.0), EXACT.softness)
    assert known.loop_gains == {"kappa": found.kappa}
    assert adaptive(limits=LIMITS.replace(jerk=5.0)).loop_gains == {"kappa": 25.0}


def test_a_jerk_that_no_period_reaches_is_no_bound():
    """At 1 rad/s^2 and 1 kHz the acceleration changes by 2 rad/s^2 at most: 2000 rad/s^3."""
    beyond = adaptive(limits=LIMITS.replace(jerk=2000.0)).sampled(PERIOD)
    assert beyond.law.limits.jerk is None
    assert "a" not in beyond.state
    some = np.full(N, 2500.0)
    some[3] = 100.0
    reading = adaptive(limits=LIMITS.replace(jerk=some)).sampled(PERIOD)
    np.testing.assert_array_equal(reading.law.limits.jerk, np.minimum(some, 2000.0))
    assert "a" in reading.state


@pytest.mark.long
@pytest.mark.parametrize(
    "known", [{"jerk": 20.0}, {"jerk": 20.0, "acceleration": np.inf}, {"jerk": np.inf}, {}]
)
def test_without_a_bound_on_the_acceleration_the_others_are_held(known):
    limits = JointLimits(**{**LIMITS.bounds, "acceleration": None})
    limits = limits.replace(position_lower=HOME - 0.1, position_upper=HOME + 0.1, **known)
    law = adaptive(limits=limits)
    motion = moved(law, jumping(1, 0.6, 0.4), 1.5)
    assert max(excess(motion, limits).values()) < HELD
    assert ("jerk" in law.keeps) == ("jerk" in known)
    assert "position" in law.keeps


def test_a_joint_without_any_limit_moves_beside_those_that_have_theirs():
    bounds = {name: np.array(bound) for name, bound in JERKY.bounds.items() if bound is not None}
    for name, bound in bounds.items():
        bound[6] = -np.inf if name == "position_lower" else np.inf
    free = JointLimits(**bounds)
    motion = moved(adaptive(limits=free), jumping(1, 0.6, 0.4), 1.5)
    assert np.isfinite(motion.q).all()
    assert max(excess(motion, free).values()) < HELD


def test_it_names_the_limits_that_it_keeps():
    assert adaptive().keeps == ("position", "velocity", "acceleration")
    assert adaptive(limits=JERKY).keeps == ("position", "velocity", "acceleration", "jerk")
    free = JointLimits.unlimited(N)
    assert adaptive(limits=free).keeps == ("position", "velocity")
    assert "snap" in adaptive().limits_remedy


def test_late_measurements_that_it_knows_of_limit_no_gain():
    assert adaptive().loop_gains == {"kappa": 100.0}
    assert adaptive(kappa=7.0).loop_gains == {"kappa": 7.0}
    assert adaptive(measurement={"delay": 2e-3}).loop_gains == {}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"home": HOME[:5]}, "home: must have 7 entries, one per joint, not 5"),
        ({"secondary": {"target": [0.0, 1.0]}}, "secondary: target must have 7 entries, one per"),
        (
            {"secondary": {"manipulability": 1.0}, "jacobian": "learned"},
            "secondary: manipulability needs jacobian: known and task: xyz or pose; leave it out",
        ),
        (
            {"secondary": {"manipulability": 1.0}, "task_size": 2},
            "secondary: manipulability needs jacobian: known and task: xyz or pose; leave it out",
        ),
        ({"task_size": 4}, "task_size: "),
        ({"jacobian": "guessed"}, "jacobian: "),
        ({"kappa": 0.0}, "kappa: "),
        ({"lever": -0.3}, "lever: "),
        ({"secondary": {"low_acceleration": 1e3}}, "low_acceleration: may be at most 100"),
        ({"secondary": {"posture": -1.0}}, "posture: "),
        ({"measurement": {"delay": np.inf}}, "delay: "),
    ],
)
def test_what_it_cannot_do_is_refused_by_name(changes, message):
    with pytest.raises(InvalidInputError) as refused:
        adaptive(**changes)
    assert message in str(refused.value)


def test_a_delay_between_two_samples_is_refused():
    late = adaptive(measurement={"delay": 2.5e-3})
    with pytest.raises(
        InvalidInputError, match=r"sensing\.delay: must be a multiple of the period"
    ):
        late.sampled(PERIOD)
    assert late.sampled(0.5e-3).late == 5


def test_it_is_no_differential_equation():
    with pytest.raises(InvalidInputError):
        adaptive().continuous()


def test_the_state_has_what_the_options_ask_for():
    base = {"v", "commanded"}
    assert {*adaptive().sampled(PERIOD).state.parts} == base | {"J_before"}
    jerk = adaptive(limits=JERKY).sampled(PERIOD).state
    assert {*jerk.parts} == base | {"J_before", "a", "a_path", "v_path"}
    learned = adaptive(jacobian="learned", task_size=6, measurement={"delay": 3e-3})
    state = learned.sampled(PERIOD).state
    before = {"q_before", "p_before", "R_before", "q_late"}
    assert {*state.parts} == base | {"J_hat", "covariance", "progress"} | before
    assert state.parts["q_late"][1] == (3, N)
    assert "J" not in learned.inputs
    assert "R_preview" in learned.inputs
    assert "J_omega" in adaptive(secondary={"manipulability": 0.5}).inputs
    assert "J_omega" not in adaptive().inputs


@pytest.mark.parametrize("begins", ["uniform", "zero"])
def test_it_begins_at_rest_where_the_arm_is(begins):
    law = adaptive(jacobian="learned", J_hat_initial=begins)
    reading = law.sampled(PERIOD)
    u = signals(law, HOME, circle(), 0.0, PERIOD)
    first, again = (reading.initial_state(np.random.default_rng(s), u) for s in (0, 0))
    np.testing.assert_array_equal(first, again)
    part = reading.state.part
    assert (part(first, "v") == 0.0).all()
    np.testing.assert_array_equal(part(first, "commanded"), HOME)
    assert (part(first, "J_hat") == 0.0).all() == (begins == "zero")


def test_a_jacobian_of_zero_is_learned_only_once_the_joints_move():
    """Pulled to its posture the arm moves, and learns; at its posture it has no reason to."""
    still = moved(adaptive(jacobian="learned", J_hat_initial="zero"), lambda t: P_START + 0.05, 2.0)
    assert (still.v == 0.0).all()
    target = HOME + 0.2
    pulled = adaptive(jacobian="learned", J_hat_initial="zero", secondary={"target": target})
    assert moved(pulled, lambda t: P_START + 0.05, 6.0).error[-1] < 1e-4


def test_of_velocities_that_do_the_task_it_takes_those_towards_its_posture():
    """After a circle the joints are where they began; without a pull they are not."""
    laps, period = circle(radius=0.08, turn=3.0), 3 * PERIOD
    drift = {
        pull: np.abs(
            moved(adaptive(secondary={"posture": pull}), laps, 9.0, period).q[[1000, -1]] - HOME
        )
        for pull in (0.0, 1.0)
    }
    assert drift[1.0][1].max() < 1e-3
    assert drift[0.0][1].max() > 10 * drift[1.0][1].max()


def doubted(law, J=None):
    return law.doubts(Circumstances(task_J=J))


def test_a_posture_near_a_limit_is_doubted_with_its_joint_and_a_remedy():
    near = HOME.copy()
    near[1] = LIMITS.position_upper[1] - 0.04
    (doubt,) = doubted(adaptive(home=near))
    assert doubt.startswith("start: joint 2 is pulled to 0.04 rad from its limit")
    assert "law.secondary.target" in doubt
    assert "law.secondary.posture: 0" in doubt
    (doubt,) = doubted(adaptive(secondary={"target": near}))
    assert doubt.startswith("law.secondary.target: joint 2")
    assert doubted(adaptive(home=near, secondary={"posture": 0.0})) == []
    assert doubted(adaptive()) == []


def test_a_first_guess_that_moves_nothing_is_doubted():
    (doubt,) = doubted(adaptive(jacobian="learned", J_hat_initial="zero"))
    assert doubt.startswith("law.J_hat_initial: zero moves no joint")
    assert doubted(adaptive(jacobian="learned")) == []


def test_a_singular_posture_is_doubted_with_a_remedy():
    iiwa = load_arm("iiwa14")
    kinematics = iiwa.kinematics()

    def task_J(q):
        return np.vstack((kinematics.J_omega(q), kinematics.J(q)))

    limits = iiwa.limits
    law = adaptive(limits=limits, home=np.zeros(N), task_size=6)
    (doubt,) = doubted(law, task_J)
    assert "singular for its task (smallest singular value" in doubt
    assert "some 0.1 rad away" in doubt
    away = adaptive(
        limits=limits, home=np.zeros(N), task_size=6, secondary=Secondary(target=HOME.clip(-1, 1))
    )
    assert doubted(away, task_J) == []
    assert doubted(law) == []
