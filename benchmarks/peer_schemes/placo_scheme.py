"""placo: tasks and constraints over Pinocchio in C++, a quadratic program for each sample."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import placo

from drake_rnn import Array
from peer_schemes.scheme import Aim, AimedScheme, NoSolutionError, braked, in_the_middle
from peer_schemes.tasks import LEVER, POSTURE_RATE, POSTURE_WEIGHT, Task
from peer_schemes.urdf import without_shapes


class PlacoWithoutAcceleration(AimedScheme):
    """Frame and joints task, limits of position and velocity."""

    name = "placo"
    setting = "velocity and joint limits"

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        robot, limits, self._frame = self._read(task), task.limits, task.arm.frame
        for joint, *bounds in zip(
            task.arm.joints, limits.position_lower, limits.position_upper, strict=True
        ):
            robot.set_joint_limits(joint, *map(float, bounds))
        for joint, bound in zip(task.arm.joints, limits.velocity, strict=True):
            robot.set_velocity_limit(joint, float(bound))
        self._robot, self._solver = robot, placo.KinematicsSolver(robot)
        self._solver.mask_fbase(True)
        self._solver.dt = task.period
        self._solver.enable_velocity_limits(True)
        self._solver.enable_joint_limits(True)
        self._position = self._solver.add_position_task(self._frame, np.zeros(3))
        self._position.configure("position", "soft", 1.0)
        if task.oriented:
            self._orientation = self._solver.add_orientation_task(self._frame, np.eye(3))
            self._orientation.configure("orientation", "soft", LEVER**2)
        self._posture = self._solver.add_joints_task()
        self._posture.configure("posture", "soft", POSTURE_WEIGHT)

    def _read(self, task: Task) -> placo.RobotWrapper:
        with TemporaryDirectory() as folder:
            file = Path(folder) / "arm.urdf"
            file.write_text(without_shapes(task.arm))
            return placo.RobotWrapper(str(file), placo.Flags.ignore_collisions)

    def pose(self, q: Array) -> tuple[Array, Array]:
        self._robot.state.q[-q.size :] = q
        self._robot.update_kinematics()
        X_WE = self._robot.get_T_world_frame(self._frame)
        return X_WE[:3, 3], X_WE[:3, :3]

    def towards(self, aim: Aim, q: Array, v: Array) -> Array:
        task = self.task
        self._position.target_world = aim.p_target
        if task.oriented:
            self._orientation.R_world_frame = aim.R_target
        home = aim.q + POSTURE_RATE * task.period * (task.start - aim.q)
        self._posture.set_joints(dict(zip(task.arm.joints, home.tolist(), strict=True)))
        try:
            way = self._solver.solve(False)
        except RuntimeError as error:
            raise NoSolutionError from error
        return way[-q.size :] / task.period


class Placo(PlacoWithoutAcceleration):
    """The same with the acceleration bounded: placo has no limit of it, but half-spaces."""

    setting = "velocity and joint limits, acceleration as joint-space half-spaces"

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        n = task.arm.n
        # The state begins with the pose of a base that does not move here.
        A = np.zeros((2 * n, self._robot.state.q.size))
        A[:n, -n:], A[n:, -n:] = np.eye(n), -np.eye(n)
        self._room = task.period**2 * task.limits.acceleration
        self._bounds = self._solver.add_joint_space_half_spaces_constraint(A, np.zeros(2 * n))
        self._bounds.configure("acceleration", "hard", 1.0)

    def towards(self, aim: Aim, q: Array, v: Array) -> Array:
        coasting = aim.q + self.task.period * v
        self._bounds.b = np.concatenate((coasting + self._room, self._room - coasting))
        return super().towards(aim, q, v)


_PlacoInTheMiddle = in_the_middle(Placo)

SCHEMES = (Placo, _PlacoInTheMiddle, braked(_PlacoInTheMiddle, 0.08))
