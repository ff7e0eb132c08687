"""EmbodiK: prioritised or weighted tasks within a box of velocities, over Pinocchio in C++."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar

import embodik
import numpy as np

from drake_rnn import Array
from drake_rnn.robot.rotation import rotation_error
from peer_schemes.scheme import Aim, AimedScheme, NoSolutionError, in_the_middle
from peer_schemes.tasks import LEVER, POSTURE_RATE, POSTURE_WEIGHT, Task
from peer_schemes.urdf import without_shapes

_FOUND = embodik.SolverStatus.SUCCESS
_LEAST_ERROR = embodik.TaskSolveMode.MIN_ERROR


class _EmbodiK(AimedScheme):
    """The arm as EmbodiK reads it, with the bounds of the task."""

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        limits, self._frame = task.limits, task.arm.frame
        with TemporaryDirectory() as folder:
            file = Path(folder) / "arm.urdf"
            file.write_text(without_shapes(task.arm))
            self._robot = embodik.RobotModel(str(file))
        self._robot.set_joint_limits(limits.position_lower, limits.position_upper)

    def pose(self, q: Array) -> tuple[Array, Array]:
        self._robot.update_configuration(q)
        X_WE = self._robot.get_frame_pose(self._frame)
        return X_WE.translation, X_WE.rotation

    def _goals(self, aim: Aim) -> list[Array]:
        """Return the velocities wanted of the tool: translation and, if asked for, rotation."""
        h = self.task.period
        goals = [(aim.p_target - aim.p) / h]
        if self.task.oriented:
            goals.append(rotation_error(aim.R, aim.R_target) / h)
        return goals


class EmbodiKWeighted(_EmbodiK):
    """Its constrained solution of weighted objectives, with the weights of all peers.

    The tolerance is the largest of a grid with which it keeps the bounds to rounding; by default it
    exceeds them by a thousandth.
    """

    name = "EmbodiK"
    setting = "weighted velocities in a box of the user's, solver_tolerance 1e-9"

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self._eye = np.asfortranarray(np.eye(task.arm.n))
        orientation = [LEVER**2] if task.oriented else []
        self._weights = [1.0, *orientation, POSTURE_WEIGHT]
        self._rows = [slice(0, 3), slice(3, 6)][: 1 + task.oriented]
        self._room = task.period * task.limits.acceleration

    def towards(self, aim: Aim, q: Array, v: Array) -> Array:
        h, limits = self.task.period, self.task.limits
        if not self.in_the_middle:
            self._robot.update_configuration(q)
        J = self._robot.get_frame_jacobian(self._frame)
        lower = np.maximum(limits.position_lower - aim.q, -h * limits.velocity) / h
        upper = np.minimum(limits.position_upper - aim.q, h * limits.velocity) / h
        found = embodik.computeConstrainedWeightedVelocitySolutionEigen(
            goals=[*self._goals(aim), POSTURE_RATE * (self.task.start - aim.q)],
            jacobians=[*(np.asfortranarray(J[rows]) for rows in self._rows), self._eye],
            C=self._eye,
            lower_limits=np.maximum(lower, v - self._room),
            upper_limits=np.minimum(upper, v + self._room),
            objective_weights=self._weights,
            solver_tolerance=1e-9,
        )
        if found.status != _FOUND:
            raise NoSolutionError
        return np.array(found.solution)


class EmbodiKWithoutPosture(_EmbodiK):
    """Frame task, and all three limits that its solver has; no pull to the posture.

    Of tolerances, dampings and modes those with the least error in a grid; a smaller tolerance
    changes nothing.
    """

    name = "EmbodiK, no posture"
    setting = "KinematicsSolver, its limits, MIN_ERROR, tolerance 1e-3, no posture task"
    tolerance: ClassVar[float | None] = 1e-3

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self._solver = solver = embodik.KinematicsSolver(self._robot)
        solver.dt = task.period
        solver.enable_position_limits(True)
        solver.enable_velocity_limits(True)
        for joint, bound in enumerate(task.limits.velocity.tolist()):
            solver.set_joint_velocity_limit(joint, bound)
        solver.enable_acceleration_limits(True)
        solver.set_acceleration_limits(task.limits.acceleration)
        if self.tolerance is not None:
            solver.set_tolerance(self.tolerance)
        types = embodik.TaskType
        kind = types.FRAME_POSE if task.oriented else types.FRAME_POSITION
        self._tool = solver.add_frame_task("tool", self._frame, kind)
        self._tool.priority, self._tool.solve_mode = 0, _LEAST_ERROR

    def towards(self, aim: Aim, q: Array, v: Array) -> Array:
        self._tool.set_target_velocity(np.concatenate(self._goals(aim)))
        self._solver.set_previous_joint_velocities(v)
        found = self._solver.solve_velocity(aim.q)
        if found.status != _FOUND:
            raise NoSolutionError(found.status_message)
        return found.joint_velocities


class EmbodiKByDefault(EmbodiKWithoutPosture):
    """The same with its own tolerance: singular values below 0.1 are damped."""

    name = "EmbodiK, no posture, default tolerance"
    setting = "KinematicsSolver, its limits, MIN_ERROR, no posture task"
    tolerance: ClassVar[float | None] = None


class EmbodiKPrioritised(EmbodiKWithoutPosture):
    """The same with a posture task of the second priority."""

    name = "EmbodiK, prioritised"
    setting = "KinematicsSolver, its limits, MIN_ERROR, tolerance 1e-3, posture task second"

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self._posture = self._solver.add_posture_task("posture")
        self._posture.priority, self._posture.solve_mode = 1, _LEAST_ERROR

    def towards(self, aim: Aim, q: Array, v: Array) -> Array:
        self._posture.set_target_velocity(POSTURE_RATE * (self.task.start - aim.q))
        return super().towards(aim, q, v)


_PrioritisedInTheMiddle = in_the_middle(EmbodiKPrioritised)
# It has no row without the midpoint.
_PrioritisedInTheMiddle.setting = f"{EmbodiKPrioritised.setting}, linearised at the middle"

SCHEMES = (
    EmbodiKWeighted,
    in_the_middle(EmbodiKWeighted),
    EmbodiKWithoutPosture,
    in_the_middle(EmbodiKWithoutPosture),
    EmbodiKByDefault,
    _PrioritisedInTheMiddle,
)
