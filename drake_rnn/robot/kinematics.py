"""An arm's kinematics and dynamics as functions.

- What a plant consists of: the joints that hold its bodies, and its frames.
- Tasks: the part of the end effector's motion that is controlled.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    Body,
    BodyIndex,
    Frame,
    FrameIndex,
    JacobianWrtVariable,
    Joint,
    ModelInstanceIndex,
    SpatialInertia,
)
from pydrake.systems.framework import Context

from ..errors import InvalidInputError
from ..inputs.fields import Array, checked, each, instance, number
from ..inputs.messages import nearest, require_type, short
from .task_frame import Pose, ToolFrame, Tools, pose_of


def holders(plant: MultibodyPlant) -> dict[BodyIndex, Joint]:
    """Return the joint that holds each body of a plant, by the index of the body."""
    joints = map(plant.get_joint, plant.GetJointIndices())
    return {joint.child_body().index(): joint for joint in joints}


def joints_to(plant: MultibodyPlant, body: Body) -> list[Joint]:
    """Return the joints from the world to a body, welds included, in that order."""
    holders_of, joints = holders(plant), list[Joint]()
    while (joint := holders_of.get(body.index())) is not None:
        joints.insert(0, joint)
        body = joint.parent_body()
    return joints


def nearest_frame(
    plant: MultibodyPlant, name: str, instance: ModelInstanceIndex | None = None
) -> str:
    """Return a hint which frame to name in place of one that a plant does not have.

    Args:
        plant: The plant.
        name: The name that was given.
        instance: Model whose frames are named; by default all models of the plant.
    """
    every = map(plant.get_frame, map(FrameIndex, range(plant.num_frames())))
    names = {frame.name() for frame in every if instance in (None, frame.model_instance())}
    return nearest(name, sorted(names - {""}))


class ArmKinematics:
    """Kinematics and dynamics of an arm as pure functions of its controlled joints.

    Positions ``q`` and velocities ``v`` have shape (n,) [rad, rad/s]; W is the world frame,
    to which the base is welded, E the arm's task frame. Repeated calls at the same posture
    share Drake's cached results.

    Args:
        plant: Finalized plant that holds only the arm.
        frame: Name of E.
        joints: Names of the n controlled joints.
        mass_scale: Factor on all masses and inertias.
    """

    #: The two tools of a pair, see `drake_rnn.robot.task_frame.Tools`; None for one tool.
    tools: Tools | None = None

    @checked(
        plant=instance(MultibodyPlant),
        frame=instance(str),
        joints=each(str),
        mass_scale=number(above=0.0),
    )
    def __init__(
        self,
        plant: MultibodyPlant,
        frame: str,
        joints: Sequence[str],
        mass_scale: float = 1.0,
    ) -> None:
        _require_named(plant, frame, joints)
        self._plant = plant
        self._context: Context = plant.CreateDefaultContext()
        self._frame: Frame = plant.GetFrameByName(frame)
        world: Frame = plant.world_frame()
        # What Drake's Jacobians of E's origin in W are asked for with.
        self._origin = (JacobianWrtVariable.kV, self._frame, np.zeros((3, 1)), world, world)
        self._positions = np.asarray(plant.GetDefaultPositions(), dtype=float)
        joints_controlled = [plant.GetJointByName(name) for name in joints]
        self._indices = np.array([joint.position_start() for joint in joints_controlled])
        self._velocity_indices = np.array([joint.velocity_start() for joint in joints_controlled])
        self._bodies = [joint.child_body() for joint in joints_to(plant, self._frame.body())]
        self._is_whole = np.array_equal(self._indices, np.arange(plant.num_positions()))
        self._at_q = b""
        # X_WE and the spatial Jacobian at that posture, computed when first needed.
        self._X_WE: Array | None = None
        self._J_spatial: Array | None = None
        if mass_scale != 1.0:
            _scale_masses(plant, self._context, mass_scale)

    def _set(self, q: Array) -> None:
        q = _numbers("position", q)
        key = q.tobytes()
        if key == self._at_q:
            return
        # Drake would abort the process.
        if q.shape != self._indices.shape or not isfinite(sum(q.tolist())):
            raise InvalidInputError(
                f"position: must be {self._indices.size} finite numbers, not {q.tolist()}"
            )
        if self._is_whole:
            self._plant.SetPositions(self._context, q)
        else:
            self._positions[self._indices] = q
            self._plant.SetPositions(self._context, self._positions)
        self._at_q = key
        self._X_WE = self._J_spatial = None

    def _set_velocity(self, v: Array) -> None:
        v = _numbers("velocity", v)
        if v.shape != self._velocity_indices.shape or not isfinite(sum(v.tolist())):
            raise InvalidInputError(
                f"velocity: must be {self._velocity_indices.size} finite numbers, not {v.tolist()}"
            )
        if self._is_whole:
            self._plant.SetVelocities(self._context, v)
            return
        velocities = np.zeros(self._plant.num_velocities())
        velocities[self._velocity_indices] = v
        self._plant.SetVelocities(self._context, velocities)

    def _pose(self, q: Array) -> Array:
        """Return [R_WE, p_WE], shape (3, 4)."""
        self._set(q)
        if self._X_WE is None:
            X_WE = self._frame.CalcPoseInWorld(self._context)
            self._X_WE = np.asarray(X_WE.GetAsMatrix34())
        return self._X_WE

    def _columns(self, J: Array) -> Array:
        return J if self._is_whole else J[:, self._velocity_indices]

    def p_WE(self, q: Array) -> Array:
        """Return the position of E's origin in W, shape (3,) [m]."""
        return self._pose(q)[:, 3].copy()

    def skeleton(self, q: Array) -> Array:
        """Return the origins of all bodies from the base to E, and E's, shape (k, 3) [m]."""
        self._set(q)
        poses = [body.EvalPoseInWorld(self._context) for body in self._bodies]
        return np.array([*(X_WB.translation() for X_WB in poses), self.p_WE(q)])

    def R_WE(self, q: Array) -> Array:
        """Return the orientation of E in W, a rotation matrix of shape (3, 3)."""
        return self._pose(q)[:, :3].copy()

    def X_WF(self, q: Array, frame: str) -> RigidTransform:
        """Return the pose in W of any frame F of the model, by its name.

        Raises:
            InvalidInputError: If the model has no such frame.
        """
        require_type("frame", frame, str)
        if not self._plant.HasFrameNamed(frame):
            hint = nearest_frame(self._plant, frame)
            raise InvalidInputError(f"frame: no frame {frame!r} in the model; {hint}")
        self._set(q)
        return self._plant.GetFrameByName(frame).CalcPoseInWorld(self._context)

    def J(self, q: Array) -> Array:
        """Return the Jacobian of E's origin, shape (3, n) [m], with v_WE = J v."""
        self._set(q)
        if self._J_spatial is not None:
            return self._J_spatial[3:].copy()
        J = self._plant.CalcJacobianTranslationalVelocity(self._context, *self._origin)
        return self._columns(J)

    def J_omega(self, q: Array) -> Array:
        """Return the Jacobian of E's angular velocity, shape (3, n)."""
        self._set(q)
        if self._J_spatial is None:
            # Callers of this method usually need J as well: compute both.
            J = self._plant.CalcJacobianSpatialVelocity(self._context, *self._origin)
            self._J_spatial = self._columns(J)
        return self._J_spatial[:3].copy()

    def Jdot_v(self, q: Array, v: Array) -> Array:
        """Return the part of E's acceleration not due to joint accelerations, (3,) [m/s^2]."""
        self._set(q)
        self._set_velocity(v)
        bias = self._plant.CalcBiasTranslationalAcceleration(self._context, *self._origin)
        return bias.ravel()

    def M(self, q: Array) -> Array:
        """Return the mass matrix, shape (n, n) [kg m^2]."""
        self._set(q)
        M = self._plant.CalcMassMatrixViaInverseDynamics(self._context)
        return M[np.ix_(self._velocity_indices, self._velocity_indices)]

    def bias(self, q: Array, v: Array) -> Array:
        """Return the Coriolis and centrifugal torques C(q, v) v, shape (n,) [Nm]."""
        self._set(q)
        self._set_velocity(v)
        return np.asarray(self._plant.CalcBiasTerm(self._context))[self._velocity_indices]

    def gravity(self, q: Array) -> Array:
        """Return the torques that gravity exerts on the joints, shape (n,) [Nm]."""
        self._set(q)
        torques = self._plant.CalcGravityGeneralizedForces(self._context)
        return np.asarray(torques)[self._velocity_indices]


class PairKinematics(ArmKinematics):
    """Kinematics and dynamics of an arm with two tools, of whose frames one is E.

    Its methods are those of `ArmKinematics`.

    Args:
        plant: Finalized plant that holds only the arm.
        frames: Names of the frames of the first and the second tool.
        joints: Names of the n controlled joints.
        task_frame: Which frame of the pair is E.
        R_21: See `drake_rnn.robot.task_frame.Tools`.
        mass_scale: Factor on all masses and inertias.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        frames: tuple[str, str],
        joints: Sequence[str],
        task_frame: ToolFrame,
        R_21: Array,
        mass_scale: float = 1.0,
    ) -> None:
        super().__init__(plant, frames[0], joints, mass_scale)
        first, second = (ArmKinematics(plant, frame, joints, mass_scale) for frame in frames)
        self.tools = Tools(first, second, task_frame, R_21)
        self._last: tuple[bytes, Pose] = (b"", pose_of(self, np.zeros(len(joints))))

    def _E(self, q: Array) -> Pose:
        q = _numbers("position", q)
        if (key := q.tobytes()) != self._last[0]:
            self._last = key, pose_of(self, q.copy())
        return self._last[1]

    def p_WE(self, q: Array) -> Array:
        """Return the position of E, shape (3,) [m]."""
        return np.array(self._E(q).p)

    def R_WE(self, q: Array) -> Array:
        """Return the orientation of E, shape (3, 3)."""
        return np.array(self._E(q).R)

    def J(self, q: Array) -> Array:
        """Return the Jacobian of its origin, shape (3, n) [m]."""
        return np.array(self._E(q).J)

    def J_omega(self, q: Array) -> Array:
        """Return that of its angular velocity."""
        return np.array(self._E(q).J_omega)

    def Jdot_v(self, q: Array, v: Array) -> Array:
        """Return its acceleration at constant joint velocities, shape (3,) [m/s^2]."""
        return np.array(self._E(q).rates(_numbers("velocity", v)).a)

    def skeleton(self, q: Array) -> Array:
        """Return the origins of all bodies from one tool to the other, shape (k, 3) [m]."""
        assert self.tools is not None
        first, second = (tool.skeleton(q) for tool in (self.tools.first, self.tools.second))
        return np.concatenate((first[::-1], second))


class AutoDiffKinematics(ArmKinematics):
    """Kinematics and dynamics of an arm for arrays of AutoDiffXd, with exact derivatives.

    Its methods are those of `ArmKinematics`. The arrays that they take and return are of objects.

    Args:
        kinematics: The same kinematics for floats.
    """

    def __init__(self, kinematics: ArmKinematics) -> None:
        if kinematics.tools is not None:
            raise InvalidInputError(
                "arm.pair: the frame between two tools is not converted to AutoDiffXd"
            )
        self.__dict__.update(kinematics.__dict__)
        plant = kinematics._plant.ToAutoDiffXd()
        self._plant = plant
        self._context = plant.CreateDefaultContext()
        # With the masses, which may be scaled.
        self._context.SetTimeStateAndParametersFrom(kinematics._context)
        self._frame = plant.get_frame(kinematics._frame.index())
        world = plant.world_frame()
        self._origin = (JacobianWrtVariable.kV, self._frame, np.zeros((3, 1)), world, world)
        self._bodies = [plant.get_body(body.index()) for body in kinematics._bodies]
        self._positions = np.array([AutoDiffXd(q) for q in kinematics._positions])

    def _set(self, q: Array) -> None:
        self._require_finite("position", q)
        positions = self._positions.copy()
        positions[self._indices] = q
        self._plant.SetPositions(self._context, positions)
        self._X_WE = self._J_spatial = None

    def _set_velocity(self, v: Array) -> None:
        self._require_finite("velocity", v)
        velocities = np.array([AutoDiffXd(0.0)] * self._plant.num_velocities())
        velocities[self._velocity_indices] = v
        self._plant.SetVelocities(self._context, velocities)

    def _require_finite(self, name: str, numbers: Array) -> None:
        """Raise an InvalidInputError unless numbers are finite: Drake would abort the process."""
        values = [x.value() for x in numbers]
        if len(values) != self._indices.size or not isfinite(sum(values)):
            raise InvalidInputError(
                f"{name}: must be {self._indices.size} finite numbers, not {values}"
            )


def _numbers(name: str, values: Array) -> Array:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name}: must be finite numbers, not {short(values)}") from None


def _require_named(plant: MultibodyPlant, frame: str, joints: Sequence[str]) -> None:
    """Raise an InvalidInputError unless a plant has a frame and joints of these names."""
    if not plant.HasFrameNamed(frame):
        raise InvalidInputError(
            f"frame: no frame {frame!r} in the model; {nearest_frame(plant, frame)}"
        )
    for joint in joints:
        if not plant.HasJointNamed(joint):
            raise InvalidInputError(f"joints: no joint {joint!r} in the model")


def _scale_masses(plant: MultibodyPlant, context: Context, scale: float) -> None:
    for index in range(1, plant.num_bodies()):
        body = plant.get_body(BodyIndex(index))
        inertia = body.CalcSpatialInertiaInBodyFrame(context)
        inertia_scaled = SpatialInertia(
            scale * inertia.get_mass(), inertia.get_com(), inertia.get_unit_inertia()
        )
        body.SetSpatialInertiaInBodyFrame(context, inertia_scaled)
