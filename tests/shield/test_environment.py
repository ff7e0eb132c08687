"""A shield around an environment of Gymnasium: one of three joints here, with a gripper."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, Shield, ShieldSettings, load_arm

gymnasium = pytest.importorskip("gymnasium")
ARM = load_arm("planar6")
LIMITS = ARM.limits.replace(velocity=1.0, acceleration=4.0, jerk=80.0)
STEP = 0.05


class Reaching(gymnasium.Env):
    """Joints that go where they are told at once, and a gripper; the goal is a posture."""

    def __init__(self):
        n = ARM.n
        self.action_space = gymnasium.spaces.Box(-10.0, 10.0, (n + 1,), dtype=np.float32)
        self.observation_space = gymnasium.spaces.Box(-10.0, 10.0, (n,), dtype=np.float64)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.q, self.taken, self.goal = ARM.home, [], ARM.home + 0.5
        return self.q, {}

    def step(self, action):
        self.taken.append(action)
        self.q = action[:-1].astype(float)
        arrived = bool(np.abs(self.q - self.goal).max() < 0.02)
        return self.q, float(arrived), arrived, False, {}


def shielded(**options):
    from drake_rnn.shield.environment import ShieldedEnvironment

    def make_shield(q):
        settings = ShieldSettings(on_path=False)
        return Shield(ARM, 0.01, settings, start=q, limits=LIMITS, collisions=False)

    options = {"make_shield": make_shield, "joints": range(ARM.n), **options}
    return ShieldedEnvironment(Reaching(), posture=lambda env, q: q, interval=STEP, **options)


def test_a_jump_of_a_policy_reaches_the_arm_within_its_bounds_and_the_gripper_as_it_is():
    env = shielded()
    env.reset(seed=0)
    action = np.append(ARM.home + 0.5, 0.7)
    for _ in range(40):
        _, _, ends, _, info = env.step(action)
        if ends:
            break
    assert ends
    taken = np.array(env.unwrapped.taken, dtype=float)
    np.testing.assert_allclose(taken[:, -1], 0.7, rtol=1e-6)
    speeds = np.diff(np.vstack((ARM.home, taken[:, :-1])), axis=0) / STEP
    assert np.abs(speeds).max() <= 1.0 + 1e-5
    assert len(taken) > 0.5 / (1.0 * STEP)
    assert info["intervention"] < 0.03
    assert info["shield"].behind < 0.03


def test_while_the_arm_is_behind_the_policy_waits_but_no_longer_than_it_is_told():
    action = np.append(ARM.home + 0.5, 0.0)
    for wait, steps in ((0.0, 1), (0.2, 5), (5.0, 20)):
        env = shielded(wait=wait)
        env.reset()
        env.step(action)
        assert len(env.unwrapped.taken) <= steps
        assert len(env.unwrapped.taken) == steps or wait == 5.0


def test_velocities_are_actions_too():
    env = shielded(kind="velocities")
    env.reset()
    assert env.action_space.shape == (ARM.n + 1,)
    for _ in range(20):
        q, *_ = env.step(np.append(np.full(ARM.n, 0.1), 0.0))
    np.testing.assert_allclose(q - ARM.home, 0.1, atol=0.02)


def test_what_does_not_fit_is_refused_by_name():
    env = shielded()
    with pytest.raises(InvalidInputError, match="reset: must be called before a step"):
        env.step(np.zeros(ARM.n + 1))
    env.reset()
    with pytest.raises(InvalidInputError, match="action: must be of shape"):
        env.step(np.zeros(ARM.n))
    with pytest.raises(InvalidInputError, match="behind: must be"):
        shielded(behind=float("nan"))
    with pytest.raises(InvalidInputError, match="kind: may be positions, velocities, poses, twi"):
        shielded(kind="torques")


def test_joints_have_the_places_that_are_given_in_any_order():
    """Actions in another order come out in that order, bit for bit."""
    order = np.random.default_rng(1).permutation(ARM.n + 1)
    action = np.append(ARM.home + 0.3 * np.arange(1, ARM.n + 1), 0.7)
    taken = []
    for places in (np.arange(ARM.n + 1), order):
        env = shielded(joints=places[: ARM.n])
        env.reset()
        mixed = np.empty(ARM.n + 1)
        mixed[places] = action
        env.step(mixed)
        taken.append(env.unwrapped.taken[0][places])
    np.testing.assert_array_equal(*taken)
    for joints in ([0, 0, 1], [0.5], "ab", [ARM.n + 1], [-1]):
        with pytest.raises(InvalidInputError, match="joints: must be different places in an act"):
            shielded(joints=joints)


def test_obstacles_that_move_are_seen_once_in_a_step_of_the_environment():
    cup = {"kind": "ball", "name": "cup", "center": [3, 0, 0], "radius": 0.1, "speed": 0.2}

    def make_shield(q):
        return Shield(ARM, 0.01, start=q, limits=LIMITS, obstacles=[cup])

    env = shielded(make_shield=make_shield)
    action = np.append(ARM.home + 0.1, 0.0)
    env.reset()
    env.step(action)
    assert not env.shield.velocity.any()
    env.place_obstacles({"cup": [0.01, 0.0, 0.0]})
    env.step(action)
    assert np.abs(env.shield.velocity).max() > 0.05
    env.place_obstacles({"cap": [0.0, 0.0, 0.0]})
    with pytest.raises(InvalidInputError, match="p_WO: 'cap' is the name of no obstacle"):
        env.step(action)
