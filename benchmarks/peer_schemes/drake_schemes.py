"""Drake's own differential inverse kinematics, as a function and as a system."""

from __future__ import annotations

import logging
from typing import ClassVar

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.inverse_kinematics import (
    DifferentialInverseKinematicsParameters,
    DifferentialInverseKinematicsStatus,
    DifferentialInverseKinematicsSystem,
    DoDifferentialInverseKinematics,
)
from pydrake.multibody.math import SpatialVelocity
from pydrake.planning import DofMask, JointLimits, RobotDiagramBuilder, SceneGraphCollisionChecker
from pydrake.solvers import OsqpSolver
from pydrake.systems.framework import BusValue

from drake_rnn import Array
from drake_rnn.robot.model.model import quiet_drake
from drake_rnn.robot.rotation import rotation_error
from peer_schemes.scheme import Aim, AimedScheme, NoSolutionError, in_the_middle
from peer_schemes.tasks import POSTURE_RATE, Task

_FOUND = DifferentialInverseKinematicsStatus.kSolutionFound


class _DrakeScheme(AimedScheme):
    """A scheme whose kinematics are those of a plant of its own."""

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self._kinematics = task.arm.kinematics()
        self._rows = np.ones(6) if task.oriented else np.repeat((0.0, 1.0), 3)

    def pose(self, q: Array) -> tuple[Array, Array]:
        return self._kinematics.p_WE(q), self._kinematics.R_WE(q)

    def _wanted(self, aim: Aim) -> Array:
        """Return the spatial velocity that is wanted, rotation first, shape (6,)."""
        V = np.zeros(6)
        V[3:] = (aim.p_target - aim.p) / self.task.period
        if self.task.oriented:
            V[:3] = rotation_error(aim.R, aim.R_target) / self.task.period
        return V


class DrakeFunction(_DrakeScheme):
    """`DoDifferentialInverseKinematics` with velocity and position limits."""

    name = "Drake, function"
    setting = "DoDifferentialInverseKinematics, velocity limits, joint centering"

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        limits, n = task.limits, task.arm.n
        parameters = DifferentialInverseKinematicsParameters(n, n)
        parameters.set_time_step(task.period)
        parameters.set_joint_position_limits((limits.position_lower, limits.position_upper))
        parameters.set_joint_velocity_limits((-limits.velocity, limits.velocity))
        parameters.set_end_effector_velocity_flag(self._rows.astype(bool))
        parameters.set_nominal_joint_position(task.start)
        parameters.set_joint_centering_gain(POSTURE_RATE * np.eye(n))
        self._parameters = parameters
        self._plant = task.arm.plant()
        self._context = self._plant.CreateDefaultContext()
        self._frame = self._plant.GetFrameByName(task.arm.frame)

    def towards(self, aim: Aim, q: Array, v: Array) -> Array:
        self._plant.SetPositions(self._context, aim.q)
        self._plant.SetVelocities(self._context, v)
        found = DoDifferentialInverseKinematics(
            self._plant, self._context, self._wanted(aim), self._frame, self._parameters
        )
        # One that is stuck has velocities as well.
        if found.joint_velocities is None or found.status != _FOUND:
            raise NoSolutionError
        return found.joint_velocities


class DrakeFunctionBounded(DrakeFunction):
    """The same with acceleration limits, for which OSQP's own tolerances are too wide."""

    name = "Drake, function, bounded"
    setting = "the same, acceleration limits, OSQP to 1e-9"
    tolerances: ClassVar[dict[str, float]] = {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 20000}

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        bound = task.limits.acceleration
        self._parameters.set_joint_acceleration_limits((-bound, bound))
        # From rest the arm can hardly move within one sample; it is not stuck for that.
        self._parameters.set_maximum_scaling_to_report_stuck(1e-9)
        for name, value in self.tolerances.items():
            self._parameters.get_mutable_solver_options().SetOption(OsqpSolver.id(), name, value)


class DrakeFunctionByDefault(DrakeFunctionBounded):
    """The same with the solver's own tolerances."""

    name = "Drake, function, bounded, default tolerance"
    setting = "the same, acceleration limits, OSQP"
    tolerances: ClassVar[dict[str, float]] = {}


class DrakeSystem(_DrakeScheme):
    """`DifferentialInverseKinematicsSystem` with velocity limits."""

    name = "Drake, system"
    setting = "DifferentialInverseKinematicsSystem, velocity limits, joint centering"

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        builder = RobotDiagramBuilder(time_step=0.0)
        instance = task.arm.add_to(builder.plant())
        builder.plant().Finalize()
        robot = builder.Build()
        with quiet_drake(logging.ERROR):
            checker = SceneGraphCollisionChecker(
                model=robot, robot_model_instances=[instance], edge_step_size=0.1
            )
        plant, limits, n = robot.plant(), task.limits, task.arm.n
        self._frame = plant.GetFrameByName(task.arm.frame).scoped_name().get_full()
        masks = {self._frame: self._rows}
        system = DifferentialInverseKinematicsSystem
        least_squares = system.LeastSquaresCost.Config()
        least_squares.cartesian_axis_masks = masks
        centering = system.JointCenteringCost.Config()
        centering.cartesian_axis_masks, centering.posture_gain = masks, POSTURE_RATE
        margins = system.JointVelocityLimitConstraint.Config()
        margins.min_margin, margins.influence_margin = 0.0, 0.01
        bounds = JointLimits(
            limits.position_lower, limits.position_upper, -limits.velocity, limits.velocity,
            -limits.acceleration, limits.acceleration,
        )  # fmt: skip
        recipe = system.Recipe()
        recipe.AddIngredient(system.LeastSquaresCost(least_squares))
        recipe.AddIngredient(system.JointCenteringCost(centering))
        recipe.AddIngredient(system.JointVelocityLimitConstraint(margins, bounds))
        self._system = system(
            recipe, plant.world_frame().scoped_name().get_full(), checker, DofMask(n, True),
            task.period, 1.0, SpatialVelocity(np.full(3, 100.0), np.full(3, 100.0)),
        )  # fmt: skip
        self._context = self._system.CreateDefaultContext()
        self._system.get_input_port_nominal_posture().FixValue(self._context, task.start)
        self._position = self._system.get_input_port_position().FixValue(self._context, task.start)
        self._wish = self._system.get_input_port_desired_cartesian_velocities()

    def towards(self, aim: Aim, q: Array, v: Array) -> Array:
        V = self._wanted(aim)
        wish = BusValue()
        wish.Set(self._frame, Value(SpatialVelocity(V)))
        self._wish.FixValue(self._context, Value(wish))
        self._position.GetMutableData().get_mutable_value().SetFromVector(aim.q)
        try:
            return self._system.get_output_port_commanded_velocity().Eval(self._context)
        except RuntimeError as error:
            raise NoSolutionError from error


SCHEMES = (
    DrakeFunction,
    DrakeFunctionBounded,
    in_the_middle(DrakeFunctionBounded),
    DrakeFunctionByDefault,
    DrakeSystem,
    in_the_middle(DrakeSystem),
)
