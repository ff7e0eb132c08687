"""A LeRobot robot that stands between a policy and another robot with joint positions.

LeRobot finds this package by its name. A policy's or a teleoperator's actions go to a
`drake_rnn.Shield`; its commands go to the robot, at a rate of their own, so that they go on
where the policy stalls. They keep the limits of position, velocity, acceleration and jerk, and the
arm clear of itself and of the obstacles.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from lerobot.robots import Robot, RobotConfig
from lerobot.robots.utils import make_robot_from_config

from drake_rnn import Shield, ShieldSettings, load_arm

# Speed below which an arm rests [rad/s], and time that it is given for it [s].
_REST, _STOPS = 1e-3, 5.0


@RobotConfig.register_subclass("shielded")
@dataclass(kw_only=True)
class ShieldedConfig(RobotConfig):
    """What stands behind the shield, and what the shield keeps.

    Attributes:
        robot: The robot behind it.
        arm: Name of an arm of drake_rnn, or a URDF, SDF or MJCF file of the robot.
        frame: Frame of the end effector in that file.
        joints: Names of the robot's motors, in the order of the arm's joints; by default those of
            the same names or, if none is, the first ones of its actions. All others, such as the
            gripper, are passed on as they are.
        degrees: Whether the robot's positions are in degrees.
        zeros: What the robot calls zero, in the arm's joint positions [rad], in the same order; by
            default zero.
        signs: 1 or -1 for each joint, in the same order; by default 1.
        rate: Commands a second.
        velocity, acceleration, jerk: Limits of each joint [rad/s, rad/s^2, rad/s^3].
        obstacles: Obstacles, each with ``kind`` and what belongs to it.
        on_path: Whether the arm keeps its way and slows down where it is behind.
    """

    robot: RobotConfig
    arm: str
    frame: str | None = None
    joints: list[str] = field(default_factory=list)
    degrees: bool = True
    zeros: list[float] = field(default_factory=list)
    signs: list[float] = field(default_factory=list)
    rate: float = 100.0
    velocity: float = 1.0
    acceleration: float = 5.0
    jerk: float = 100.0
    obstacles: list[dict[str, Any]] = field(default_factory=list)
    on_path: bool = False


class Shielded(Robot):
    """The robot; see `ShieldedConfig`."""

    config_class = ShieldedConfig
    name = "shielded"

    def __init__(self, config: ShieldedConfig) -> None:
        super().__init__(config)
        self.config = config
        self.robot = make_robot_from_config(config.robot)
        self.arm = load_arm(config.arm, **({"frame": config.frame} if config.frame else {}))
        names = [key.removesuffix(".pos") for key in self.robot.action_features]
        self.joints = config.joints or _motors_of(self.arm.joints, names)
        unknown = [name for name in self.joints if f"{name}.pos" not in self.robot.action_features]
        if unknown or len({*self.joints}) != self.arm.n or len(self.joints) != self.arm.n:
            raise ValueError(
                f"joints: must be {self.arm.n} motors of {', '.join(names)}, in the order of "
                f"{', '.join(self.arm.joints)}; not {self.joints}"
            )
        self._zeros = np.array(config.zeros or [0.0] * self.arm.n)
        self._signs = np.array(config.signs or [1.0] * self.arm.n)
        self.shield: Shield | None = None
        self._rest: dict[str, Any] = {}
        self._lock, self._ends = threading.RLock(), threading.Event()
        self._error: BaseException | None = None
        self._thread: threading.Thread | None = None

    @property
    def observation_features(self) -> dict[str, Any]:
        return self.robot.observation_features

    @property
    def action_features(self) -> dict[str, Any]:
        return self.robot.action_features

    @property
    def is_connected(self) -> bool:
        return self.robot.is_connected

    @property
    def is_calibrated(self) -> bool:
        return self.robot.is_calibrated

    def calibrate(self) -> None:
        self.robot.calibrate()

    def configure(self) -> None:
        self.robot.configure()

    def connect(self, calibrate: bool = True) -> None:
        """Connect the robot, and begin where its arm stands."""
        self.robot.connect(calibrate)
        config, period = self.config, 1.0 / self.config.rate
        seen = self.robot.get_observation()
        # Until an action comes, the gripper and so on are told to stay where they are.
        others = set(self.robot.action_features) - {f"{name}.pos" for name in self.joints}
        self._rest = {key: seen[key] for key in others if key in seen}
        limits = self.arm.limits.replace(
            velocity=np.minimum(self.arm.limits.velocity, config.velocity),
            acceleration=config.acceleration,
            jerk=config.jerk,
        )
        self.shield = Shield(
            self.arm,
            period,
            ShieldSettings(on_path=config.on_path),
            start=self._posture(seen),
            limits=limits,
            obstacles=config.obstacles,
        )
        self._ends.clear()
        self._thread = threading.Thread(target=self._command, args=(period,), daemon=True)
        self._thread.start()

    def get_observation(self) -> dict[str, Any]:
        with self._lock:
            return self.robot.get_observation()

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Have the shield follow an action, and return what the robot was sent last."""
        if self.shield is None:
            raise ConnectionError("connect must be called before send_action")
        if self._error is not None:
            raise self._error
        with self._lock:
            self.shield.follow_positions(self._posture(action))
            own = {f"{name}.pos" for name in self.joints}
            self._rest = {key: value for key, value in action.items() if key not in own}
            return self._action(self.shield.position)

    @property
    def status(self) -> Any:
        """The `ShieldStatus` now; None before `connect`."""
        return None if self.shield is None else self.shield.status

    def disconnect(self) -> None:
        """Let the arm come to rest, and disconnect the robot."""
        if self._thread is not None:
            self._ends.set()
            self._thread.join(_STOPS + 1.0)
        self.robot.disconnect()

    def _command(self, period: float) -> None:
        """Send commands until the end, and then until the arm rests."""
        shield = self.shield
        assert shield is not None
        due, last = time.monotonic(), np.inf
        try:
            while time.monotonic() < last:
                with self._lock:
                    if self._ends.is_set() and last == np.inf:
                        last = time.monotonic() + _STOPS
                        shield.follow_velocities(np.zeros(self.arm.n))
                    self.robot.send_action(self._action(shield.command()))
                    if last < np.inf and np.abs(shield.velocity).max() < _REST:
                        return
                due += period
                time.sleep(max(due - time.monotonic(), 0.0))
        except BaseException as error:  # told to whoever sends the next action
            self._error = error

    def _posture(self, positions: dict[str, Any]) -> Any:
        """Return joint positions of the arm [rad], of an action or an observation."""
        own = np.array([float(positions[f"{name}.pos"]) for name in self.joints])
        return self._zeros + self._signs * (np.deg2rad(own) if self.config.degrees else own)

    def _action(self, q: Any) -> dict[str, Any]:
        own = self._signs * (q - self._zeros)
        own = np.rad2deg(own) if self.config.degrees else own
        arm = {f"{name}.pos": float(x) for name, x in zip(self.joints, own, strict=True)}
        return {**self._rest, **arm}


def _motors_of(joints: Any, names: list[str]) -> list[str]:
    """Return the motors of an arm's joints: by name if any has one, else the first ones."""
    return list(joints) if set(joints) & set(names) else names[: len(joints)]
