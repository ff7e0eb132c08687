"""How experts of environments made by others do behind a shield.

In ``SO101PickPlace-v0`` of lerobot-env-so101 a simulated SO-101 picks a block up and places it,
both anywhere. Its scripted expert moves the tool; the environment makes joint positions of that,
ten times a second, and those go to the motors at once or by a shield, which commands every 2 ms.
In ``FetchPickAndPlace-v4`` of gymnasium-robotics a tool is moved, 25 times a second; the script of
the expert is that of OpenAI's baselines for this environment. The shield follows the poses of the
tool with the joints of a Fetch, every 5 ms, and where these take the tool is what the environment
gets::

    python benchmarks/shielded_environments.py --seeds 40 --kept FILE
    python benchmarks/shielded_environments.py --environment fetch --seeds 40 --kept FILE

It needs ``pip install lerobot-env-so101 gymnasium-robotics "mujoco<3.3"``. With ``wait`` the expert
looks on while a joint is more than ``--behind`` from its target, for at most 1 s each time. Speeds
are those of the simulated joints, as shares of the limits.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from drake_rnn import Array, JointLimits, Shield, ShieldSettings, load_arm
from kept_cases import cases
from markdown_table import head, row
from shared_options import add_case_options

# Steps of the expert, of 0.1 s, and how long it waits at most [s].
STEPS, WAIT = 300, 1.0
# Limits of the velocity, the acceleration and the jerk of all joints [rad, s].
LIMITS = {"slow": (1.0, 5.0, 100.0), "quick": (2.0, 20.0, 400.0)}
# Those of a Fetch: its own velocities, and the acceleration and jerk of the others.
FETCH = (1.256, 1.454, 1.571, 1.521, 1.571, 2.268, 2.268)
# Ways in which targets go to the motors.
WAYS = {
    "bare": None,
    "shield": {"wait": 0.0},
    "shield, wait": {"wait": WAIT},
    "shield, on its path": {"wait": 0.0, "on_path": True},
}


def environment() -> tuple[Any, Any]:
    """Return the environment and a new expert; it imports LeRobot, if that is installed."""
    find = importlib.util.find_spec
    importlib.util.find_spec = lambda name, *more: None if name == "lerobot" else find(name, *more)
    import gymnasium
    import lerobot_env_so101 as made
    from lerobot_env_so101.policy import DEFAULT_ACTION_SCALE
    from lerobot_env_so101.scripted import PickPlaceController

    env = gymnasium.make(
        made.PICK_PLACE_ENV_ID,
        random_block_position=True,
        action_scale=DEFAULT_ACTION_SCALE,
        max_episode_steps=STEPS,
    )
    return env, PickPlaceController()


class Motors:
    """Takes the joint positions of the environment to its motors, by a shield or at once.

    Args:
        env: The environment.
        way: One of `WAYS`.
        limits: Limits of the joints.
    """

    def __init__(
        self, env: Any, way: dict[str, Any] | None, limits: JointLimits | None, behind: float
    ) -> None:
        self._env, self._apply, self._count = env, env.apply_action, env._n_substeps
        self._way, self._behind, self.shield = way, behind, None
        self.asked, self.speeds, self.waits = list[Array](), list[Array](), 0
        if way is not None:
            arm = load_arm(_model(), frame="gripper_frame_link")
            self.shield = Shield(
                arm,
                env.physics_dt,
                ShieldSettings(on_path=way.get("on_path", False), compiled=True),
                start=np.array(env._data.qpos[env._arm_dof_ids]),
                limits=limits,
                collisions=False,
            )
        env.apply_action = self.apply

    def apply(self, action: Array) -> None:
        """Let a step of the environment pass."""
        import mujoco

        env = self._env
        # The environment makes joint positions of the action, and lets no time pass.
        env._n_substeps = 0
        self._apply(action)
        env._n_substeps = self._count
        target = np.array(env._data.ctrl[env._arm_ctrl_ids])
        self.asked.append(target)
        waited = 0.0
        while True:
            if self.shield is not None:
                self.shield.follow_positions(target)
            for _ in range(self._count):
                if self.shield is not None:
                    env._data.ctrl[env._arm_ctrl_ids] = self.shield.command()
                mujoco.mj_step(env._model, env._data)
                self.speeds.append(np.abs(env._data.qvel[env._arm_dof_ids]))
            waited += env.control_dt
            if self._way is None or self.shield.status.behind <= self._behind:
                break
            if waited > self._way["wait"] + 1e-9:
                break
            self.waits += 1

    def close(self) -> None:
        """Give the environment its own motors back."""
        self._env.apply_action = self._apply


def _model() -> Path:
    import lerobot_env_so101

    return Path(lerobot_env_so101.__file__).parent / "assets" / "so101_new_calib.urdf"


def so101(seed: int, way: str, limits: str, behind: float) -> dict[str, Any]:
    """Return what an episode of the SO-101 comes to."""
    env, expert = environment()
    bare = env.unwrapped
    env.reset(seed=seed)
    v, a, jerk = LIMITS[limits]
    joints = load_arm(_model(), frame="gripper_frame_link").limits
    bounded = joints.replace(velocity=np.full(joints.size, v), acceleration=a, jerk=jerk)
    motors = Motors(bare, WAYS[way], bounded, behind)
    succeeded, k, ended = False, 0, False
    while not ended and k < STEPS:
        block = bare._data.sensor("block_pos").data.copy()
        action = expert.act(bare.ik_point_pos, block, bare.goal_pos)
        _, reward, ends, cut, _ = env.step(action)
        succeeded, ended, k = reward > 0.0, ends or cut, k + 1
    steps = np.abs(np.diff(np.array(motors.asked), axis=0)) / bare.control_dt
    return {
        "succeeded": bool(succeeded),
        "steps": k,
        "seconds": bare.control_dt * (k + motors.waits),
        "waits": motors.waits,
        "asked": float(steps.max()) / v,
        "beyond": int((steps > v).any(axis=1).sum()),
        "speed": float(np.max(motors.speeds)) / v,
        "phase": expert.phase.name,
    }


class FetchTool:
    """The tool of the environment, moved as a shield lets the joints of a Fetch move it.

    Args:
        env: The environment, after a reset.
        way: One of `WAYS`.
        limits: Acceleration and jerk of all joints [rad, s].
        behind: How far a joint is from its target where the expert waits [rad].
    """

    def __init__(
        self, env: Any, way: dict[str, Any], limits: tuple[float, float], behind: float
    ) -> None:
        import gymnasium_robotics

        self._data, self._gripper = env.data, env.model.body("robot0:gripper_link").id
        assets = Path(gymnasium_robotics.__file__).parent / "envs" / "assets" / "fetch"
        at = {name: env.data.qpos[env.model.joint(name).qposadr[0]] for name in _names(env)}
        held = [name for name in at if "slide" in name or "torso" in name]
        # The simulated torso stands below its own limit.
        torso = "robot0:torso_lift_joint"
        at[torso] = max(at[torso], env.model.joint(torso).range[0])
        arm = load_arm(
            assets / "pick_and_place.xml",
            frame="robot0:gripper_link",
            joints=[name for name in at if name not in held],
            lock={name: float(at[name]) for name in held},
        )
        bounds = arm.limits.replace(velocity=FETCH, acceleration=limits[0], jerk=limits[1])
        start = np.array([at[name] for name in arm.joints])
        settings = ShieldSettings(on_path=way.get("on_path", False), compiled=True)
        self._way, self._behind, self._kinematics = way, behind, arm.kinematics()
        self.shield = Shield(arm, 5e-3, settings, start=start, limits=bounds, collisions=False)
        self._quaternion = env.data.xquat[self._gripper].copy()
        # The model stands elsewhere than the simulated robot by what is held.
        self._offset = env.data.xpos[self._gripper] - self._kinematics.p_WE(start)

    def action(self, asked: Array, dt: float) -> Array:
        """Return the action in place of one that is asked for, of a step that takes ``dt`` [s]."""
        here = self._data.xpos[self._gripper]
        target = here + 0.05 * np.clip(asked[:3], -1.0, 1.0) - self._offset
        self.shield.follow_poses([*target, *self._quaternion])
        for _ in range(round(dt / self.shield.period)):
            q = self.shield.command()
        moved = self._kinematics.p_WE(q) + self._offset - here
        return np.array([*np.clip(moved / 0.05, -1.0, 1.0), asked[3]])

    def is_behind(self) -> bool:
        """Return whether the expert is to wait."""
        return bool(self._way["wait"]) and self.shield.status.behind > self._behind


def _names(env: Any) -> list[str]:
    """Return the joints from base to tool."""
    names = [env.model.joint(k).name for k in range(env.model.njnt)]
    return [name for name in names if not any(x in name for x in ("head", "finger", "object"))]


def fetch(seed: int, way: str, limits: str, behind: float) -> dict[str, Any]:
    """Return what an episode of the Fetch comes to."""
    import gymnasium
    import gymnasium_robotics

    gymnasium.register_envs(gymnasium_robotics)
    env = gymnasium.make("FetchPickAndPlace-v4", max_episode_steps=STEPS)
    seen, _ = env.reset(seed=seed)
    bare, dt, waits, phase, k = env.unwrapped, env.unwrapped.dt, 0, 0, 0
    settings = WAYS[way]
    bounds = LIMITS[limits][1:]
    tool = None if settings is None else FetchTool(bare, settings, bounds, behind)
    joints = [bare.model.joint(name).dofadr[0] for name in _names(bare)[-len(FETCH) :]]
    speeds, succeeded = list[Array](), False
    while not succeeded and k < 100:
        action, phase = _picked(seen, phase)
        given, waited = action if tool is None else tool.action(action, dt), 0.0
        while True:
            seen, _, _, _, info = env.step(given)
            speeds.append(np.abs(bare.data.qvel[joints]) / FETCH)
            waited += dt
            if tool is None or not tool.is_behind() or waited > settings["wait"]:
                break
            waits, given = waits + 1, tool.action(np.array([0.0, 0.0, 0.0, action[3]]), dt)
        succeeded, k = bool(info["is_success"]), k + 1
    return {
        "succeeded": succeeded,
        "steps": k,
        "seconds": dt * (k + waits),
        "waits": waits,
        "asked": float(np.max(speeds)),
        "beyond": int((np.array(speeds) > 1.0).any(axis=1).sum()),
        "speed": float(np.max(speeds)),
        "phase": ("above", "down", "grasp", "carry")[phase],
    }


def _picked(seen: dict[str, Array], phase: int) -> tuple[Array, int]:
    """Return the expert's action, and where it is in its script."""
    hand, block, goal = seen["observation"][:3], seen["achieved_goal"], seen["desired_goal"]
    open_width = seen["observation"][9:11].sum()
    if phase == 0 and np.linalg.norm(block - hand + [0.0, 0.0, 0.03]) < 0.005:
        phase = 1
    if phase == 1 and np.linalg.norm(block - hand) < 0.005:
        phase = 2
    if phase == 2 and open_width < 0.055:
        phase = 3
    way = (block - hand + [0.0, 0.0, 0.03], block - hand, np.zeros(3), goal - block)[phase]
    return np.array([*np.clip(6.0 * way, -1.0, 1.0), 1.0 if phase < 2 else -1.0]), phase


RUNS = {"so101": so101, "fetch": fetch}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--environment", default="so101", choices=list(RUNS))
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--behind", type=float, default=0.02, help="when the expert waits [rad]")
    parser.add_argument("--ways", nargs="+", default=list(WAYS), choices=list(WAYS))
    parser.add_argument("--limits", nargs="+", default=list(LIMITS), choices=list(LIMITS))
    add_case_options(parser, jobs=1)
    options = parser.parse_args()
    beyond = ("largest speed asked for", "steps beyond the limit", "of")
    head("limits", "targets by", "succeeded", *beyond, "speed reached", "s", "waits")
    for limits in options.limits:
        for way in options.ways:
            run = RUNS[options.environment]
            task = partial(run, way=way, limits=limits, behind=options.behind)
            key = f"{options.environment}, {way}, {limits}, {options.behind}"
            found = cases(task, range(options.seeds), options.jobs, options.kept, key)
            good = [each for each in found if each["succeeded"]]
            row(
                f"{limits}: {', '.join(f'{x:g}' for x in LIMITS[limits])}",
                way,
                f"{len(good)} of {len(found)}",
                f"{max(each['asked'] for each in found):.1f}",
                sum(each["beyond"] for each in found),
                sum(each["steps"] for each in found),
                f"{max(each['speed'] for each in found):.2f}",
                f"{np.median([each['seconds'] for each in good or found]):.1f}",
                sum(each["waits"] for each in found),
            )
            for seed, each in enumerate(found):
                if not each["succeeded"]:
                    print(f"{limits}, {way}, seed {seed}: {each}", file=sys.stderr)
            sys.stdout.flush()


if __name__ == "__main__":
    main()
