"""Arms: a robot model with a task frame, controlled joints and their limits.

- Joints that an arm does not control: each becomes a weld where the joint stands.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Iterable, Mapping
from copy import copy
from dataclasses import replace
from difflib import get_close_matches
from functools import cached_property, partial
from pathlib import Path
from types import NoneType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BodyIndex,
    Frame,
    FrameIndex,
    Joint,
    ModelInstanceIndex,
    PrismaticJoint,
    WeldJoint,
)
from pydrake.systems.framework import Context

from ..errors import InvalidInputError
from ..inputs.documents import construct, read_yaml
from ..inputs.fields import Array
from ..inputs.files import is_file
from ..inputs.messages import nearest, plural, require_type
from ..inputs.packages import html_table
from ..models import MODELS
from .arm_description import (
    GRIPPER,
    ArmDescription,
    LinkErrorSettings,
    PairDescription,
    ToolDescription,
    looks_file,
)
from .kinematics import ArmKinematics, PairKinematics, joints_to, nearest_frame
from .limits import FIELD_UNITS, MOST, JointLimits
from .limits_file import (
    LimitsFile,
    Srdf,
    limits_beside,
    read_limits,
    read_srdf,
)
from .model import LostMesh, Mimic, Model, displace_joints, moving_joints, read_model, read_shapes
from .model.model import in_urdf, place_beside, quiet_drake

#: Endings of the names of model files.
MODEL_SUFFIXES = frozenset({".urdf", ".sdf", ".xml", ".xacro"})
#: What the names of links, joints and frames of a second arm begin with.
SECOND = "second_"
# A joint that follows another is where it should be if it is this close [rad or m].
_SAME = 1e-6


def poses_where_held(
    plant: MultibodyPlant,
    joint_names: Collection[str],
    lock: Mapping[str, float],
    mimics: Mapping[str, Mimic],
) -> dict[str, RigidTransform]:
    """Return the pose of each joint that is not controlled: its child's frame in its parent's.

    Args:
        plant: Finalized plant of the whole model.
        joint_names: Names of the controlled joints.
        lock: Positions of some of the other joints [rad or m]; the rest are held at the model's
            default.
        mimics: Joints that follow others, which are held where they follow a held one.
    """
    context = lock_context(plant, joint_names, lock, mimics)
    return {
        joint.name(): joint.frame_on_child().CalcPose(context, joint.frame_on_parent())
        for joint in map(plant.get_joint, plant.GetJointIndices())
        if joint.num_positions() and joint.name() not in joint_names
    }


def lock_context(
    plant: MultibodyPlant,
    joint_names: Collection[str],
    lock: Mapping[str, float],
    mimics: Mapping[str, Mimic],
) -> Context:
    """Return a context in which joints are where they are held; see `poses_where_held`."""
    joints = map(plant.get_joint, plant.GetJointIndices())
    moving = {joint.name(): joint for joint in joints if joint.num_positions()}
    fixed_joints = [joint for name, joint in moving.items() if name not in joint_names]
    context = plant.CreateDefaultContext()
    positions = plant.GetPositions(context)
    single = {name: joint for name, joint in moving.items() if joint.num_positions() == 1}
    stands = {name: float(positions[joint.position_start()]) for name, joint in single.items()}
    stands |= lock
    # A joint may follow one that follows another.
    for _ in mimics:
        for name, mimic in mimics.items():
            if name not in lock and name in stands and mimic.joint not in joint_names:
                stands[name] = mimic.multiplier * stands.get(mimic.joint, 0.0) + mimic.offset
    for joint in fixed_joints:
        if joint.name() in stands:
            positions[joint.position_start()] = stands[joint.name()]
    plant.SetPositions(context, positions)
    return context


def weld_joints(
    plant: MultibodyPlant, instance: ModelInstanceIndex, poses: Mapping[str, RigidTransform]
) -> None:
    """Replace joints of a model by welds of the same name, before the plant is finalized.

    Motors of these joints are removed. The plant must have no constraints.
    """
    for motor in map(plant.get_joint_actuator, plant.GetJointActuatorIndices()):
        if motor.model_instance() == instance and motor.joint().name() in poses:
            plant.RemoveJointActuator(motor)
    for name, X_PC in poses.items():
        joint = plant.GetJointByName(name, instance)
        parent, child = joint.frame_on_parent(), joint.frame_on_child()
        plant.RemoveJoint(joint)
        plant.AddJoint(WeldJoint(name, parent, child, X_PC))


def move_welds(
    plant: MultibodyPlant,
    instance: ModelInstanceIndex,
    X_FB: RigidTransform,
    frame: Frame | None = None,
    joints: Collection[str] = (),
) -> None:
    """Move what a model welds to the world, before the plant is finalized.

    Args:
        plant: The plant.
        instance: The model's instance.
        X_FB: Where the world frame of the model comes to be in a frame.
        frame: The frame; by default the world's.
        joints: Names of joints that stay.

    Raises:
        InvalidInputError: If another joint that moves is fixed to the world.
    """
    world = plant.world_body().index()
    for joint in [plant.get_joint(index) for index in plant.GetJointIndices(instance)]:
        if joint.parent_body().index() != world or joint.name() in joints:
            continue
        if not isinstance(joint, WeldJoint):
            key = "X_WB" if frame is None else "arm.base"
            raise InvalidInputError(
                f"{key}: the model fixes {joint.name()!r}, which moves, to the world itself; give "
                "its base a link"
            )
        name, child, X_PC = joint.name(), joint.frame_on_child(), joint.X_FM()
        X_WP = joint.frame_on_parent().GetFixedPoseInBodyFrame()
        plant.RemoveJoint(joint)
        plant.AddJoint(WeldJoint(name, frame or plant.world_frame(), child, X_FB @ X_WP @ X_PC))


def _with_nearest(name: str, names: Iterable[str]) -> str:
    """Return a name that is not there, with the one that was likely meant, if there is one."""
    close = get_close_matches(name, sorted(names), n=1, cutoff=0.85)
    return f"{name} (nearest: {close[0]})" if close else name


def shipped_arms() -> list[str]:
    """Return the names of the arms that come with this package."""
    return sorted(path.parent.name for path in MODELS.glob("*/arm.yaml"))


def named_arm(model: str, changes: Mapping[str, Any]) -> Arm:
    """Return an arm; see `drake_rnn.robot.load_arm.load_arm`.

    Args:
        model: A shipped name, or a model file.
        changes: Fields of `ArmDescription` to set.
    """
    folder, names = MODELS / model, shipped_arms()
    if model in names:
        description = read_yaml(folder / "arm.yaml")
        description["model"] = str(folder / description["model"])
        description["limits"] = str(folder / "limits.yaml")
        description["capsules"] = str(folder / "capsules.yaml")
        arm = Arm(construct(ArmDescription, description, "arm"), model)
        return arm.replace(**changes) if changes else arm
    if Path(model).suffix.lower() not in MODEL_SUFFIXES:
        raise InvalidInputError(
            f"arm: no arm {model!r}; {nearest(model, names)}, or a .urdf, .sdf, .xml or .xacro file"
        )
    fields = {"model": model, **changes}
    if "limits" not in changes and (beside := limits_beside(Path(model))) is not None:
        fields["limits"] = str(beside)
    return Arm(construct(ArmDescription, fields, "arm"), Path(model).stem)


def _other_arm(section: str | Mapping[str, Any]) -> Arm:
    """Return the second arm of a pair by itself."""
    fields = {"model": section} if isinstance(section, str) else dict(section)
    if not isinstance(model := fields.pop("model", None), str):
        raise InvalidInputError("arm.pair.arm.model: must be given: a shipped arm or a URDF file")
    if fields.get("pair") is not None:
        raise InvalidInputError("arm.pair.arm.pair: must be left out; a pair is of two arms")
    if fields.get("base") is not None:
        raise InvalidInputError("arm.pair.arm.base: must be left out; arms of a pair stand still")
    try:
        return named_arm(model, fields)
    except InvalidInputError as error:
        raise InvalidInputError(f"arm.pair.{error}") from None


class Arm:
    """A robot model with n controlled joints and a task frame E.

    Args:
        description: Model file, task frame, joints and properties of the arm.
        name: Name in figures and messages.
        limits: Limits of the controlled joints; by default those of the description's file and of
            the model.

    Attributes:
        frame: Name of the task frame E; of two tools, the frame of the first one.
        tip: Name of the frame at the tool's contact point, or None.
        tool: The tool that was added to the model, or None.
        joints: Names of the n controlled joints.
        units: Units of their positions: ``rad``, or ``m`` for one that slides.
        limits: Limits of the controlled joints.
        endless: Which joints turn without end, shape (n,).
        home: Home posture, shape (n,) [rad], or None.
        looks: Model file whose meshes are drawn in place of the arm's shapes, or None.
        triangles: Number of triangles to which these meshes are simplified.
        base: Mobile base that carries it, complete, or None.
        warnings: Changes that the model's file needed, and warnings of Drake.

    Raises:
        InvalidInputError: If the file, a frame or a joint does not exist, or sizes differ.
    """

    def __init__(
        self, description: ArmDescription, name: str, limits: JointLimits | None = None
    ) -> None:
        require_type("description", description, ArmDescription)
        require_type("name", name, str)
        require_type("limits", limits, JointLimits, NoneType)
        self.description = description = description.with_named_mount()
        self.name = name
        self.model = Path(description.model)
        self._of_gripper = frozenset[str]()
        stated = read_model(self.model, description.packages, description.xacro_arguments)
        gripped = self._with_gripper(stated, read_model)
        self._stated = self._with_other(gripped, lambda other: other._model)
        self._model = self._with_errors()
        self._held: Mapping[str, RigidTransform] = {}
        self.looks, without = looks_file(description.looks, self.model)
        if description.capsules is not None and not is_file(description.capsules):
            raise InvalidInputError(f"arm.capsules: no file {description.capsules!r}")
        self.triangles = description.triangles
        self.warnings = (*self._model.warnings, *((without,) if without else ()))
        self.frame = description.frame
        self.tool = description.tool
        self.base = None if description.base is None else description.base.complete()
        self.tip = description.tip if self.tool is None else self.tool.tip
        self.gravity = description.gravity

        plant = self.plant()
        for frame, key in zip(self.frames, ("frame", "pair.frame"), strict=False):
            self._require_frame(plant, frame, key)
        if self.tip is not None:
            self._require_frame(plant, self.tip, "tip")
        self.joints = self._controlled_joints(plant)
        types = [plant.GetJointByName(name).type_name() for name in self.joints]
        self.units = tuple("m" if kind == PrismaticJoint.kTypeName else "rad" for kind in types)
        self._held = poses_where_held(plant, self.joints, self._lock, self._model.mimics)
        self._warn_of_followers()
        self._published = self._read_limits(plant)
        limits_known = self._known_limits(plant)
        self.limits = limits if limits is not None else limits_known
        self.endless = self._turning(limits_known)
        self._require_size("limits", self.limits.size)
        self._semantics = self._read_semantics(plant)
        self.home = self._home_of_both(self._stated_home())
        if self.home is not None:
            self._require_size("home", self.home.size)

    def __repr__(self) -> str:
        tool = "" if self.tool is None else f", with a ball of {self.tool.ball * 1e3:g} mm"
        if (gripper := self.description.gripper) is not None:
            tool = f", with {Path(gripper.model).name}{tool}"
        frame = self.frame
        if (pair := self.description.pair) is not None:
            frame = f"{pair.task_frame} of {self.frames[0]} and {self.frames[1]}"
        return f"<Arm {self.name}: {self.n} joints, task frame {frame}{tool}>"

    def _repr_html_(self) -> str:
        bounds = {
            f"{name} [{unit}]": bound
            for name, unit in FIELD_UNITS.items()
            if (bound := self.limits.bounds[name]) is not None
        }
        rows = [
            (
                joint if unit == "rad" else f"{joint} (in m)",
                *(f"{bound[k]:.4g}" for bound in bounds.values()),
            )
            for k, (joint, unit) in enumerate(zip(self.joints, self.units, strict=True))
        ]
        return html_table(repr(self)[1:-1], ("joint", *bounds), rows)

    @property
    def n(self) -> int:
        """Number of controlled joints."""
        return len(self.joints)

    @property
    def _own(self) -> int:
        """Number of controlled joints without those of a second arm."""
        return self.n if self.other is None else self.n - self.other.n

    @cached_property
    def begins(self) -> tuple[int, ...]:
        """The first joint of each of its chains, which follow one another among its joints."""
        if self.description.pair is None:
            return (0,)
        if self.other is not None:
            return (0, self._own)
        plant = self._own_plant
        first, second = (
            [j.name() for j in joints_to(plant, plant.GetFrameByName(frame).body())]
            for frame in self.frames
        )
        ways = [[name for name in way if name in self.joints] for way in (first, second)]
        return (0, len(ways[0])) if tuple(ways[0] + ways[1]) == self.joints else (0,)

    @property
    def parts(self) -> tuple[Arm, ...]:
        """Each arm of a pair by itself, with its joints, limits and tool; else this arm alone.

        Their models are that of the pair, in which the joints of the other one stand at the model's
        default. So their kinematics are in the world frame of the pair.

        Raises:
            InvalidInputError: If a joint moves both tools of a pair, or neither.
        """
        if self.description.pair is None:
            return (self,)
        if len(self.begins) == 1:
            raise InvalidInputError(f"arm.joints: {self._shared_joint()}")
        blocks = slice(0, self.begins[1]), slice(self.begins[1], self.n)
        return tuple(self._part(k, block) for k, block in enumerate(blocks))

    def _shared_joint(self) -> str:
        """Return which joint does not move one tool of a pair alone, and what may be done."""
        plant = self._own_plant
        ways = [
            {joint.name() for joint in joints_to(plant, plant.GetFrameByName(frame).body())}
            for frame in self.frames
        ]
        for name in self.joints:
            if (count := sum(name in way for way in ways)) != 1:
                return (
                    f"{name!r} moves {'both tools' if count else 'neither tool'} of arm.pair; each "
                    "joint must move one of them; hold it where it is by arm.lock"
                )
        return "must be those that move the first tool, and then those that move the second one"

    def _part(self, k: int, block: slice) -> Arm:
        """Return one arm of a pair, see `parts`; its joints are some of those of the pair."""
        arm, frame, indices = copy(self), self.frames[k], range(self.n)[block]
        arm.description = replace(self.description, pair=None, frame=frame)
        arm.frame, arm.tool = frame, self._second_tool if k else self.tool
        if k and self.other is not None:
            arm.name = self.other.name
        if k:
            arm.tip = None if arm.tool is None else arm.tool.tip
        arm.joints, arm.units = self.joints[block], self.units[block]
        arm.limits, arm.endless = self.limits.select(indices), self.endless[block]
        arm.home = None if self.home is None else self.home[block]
        vars(arm).update(
            frames=(frame,), begins=(0,), effort=self.effort[block], _own_plant=self._own_plant
        )
        vars(arm).pop("memo", None)
        return arm

    def _with_gripper(self, model: Model, read: Callable[..., Model]) -> Model:
        """Return a model together with that of its gripper, which a function reads.

        Raises:
            InvalidInputError: If the gripper cannot be read or added, or has no such joint or link.
        """
        if (gripper := self.description.gripper) is None:
            return model
        try:
            own = read(Path(gripper.model), gripper.packages, gripper.xacro_arguments)
        except InvalidInputError as error:
            raise InvalidInputError(str(error).replace("arm.", "arm.gripper.", 1)) from None
        told = (warning.replace("arm.model", "arm.gripper", 1) for warning in own.warnings)
        own = in_urdf(replace(own, warnings=tuple(told)), "arm.gripper")
        whole = place_beside(model, own, GRIPPER, gripper.X_MG, "arm.gripper", gripper.mount)
        joints = moving_joints(own)
        for name in gripper.lock:
            if name not in joints:
                raise InvalidInputError(
                    f"arm.gripper.lock: no movable joint {name!r} in {own.file.name}; "
                    + (nearest(name, joints) if joints else "it has none")
                )
        if gripper.capsules is not None and not is_file(gripper.capsules):
            raise InvalidInputError(f"arm.gripper.capsules: no file {gripper.capsules!r}")
        self._of_gripper = frozenset(GRIPPER + name for name in joints)
        return whole

    def with_gripper_at(self, lock: Mapping[str, float]) -> Arm:
        """Return the same arm with joints of its gripper held elsewhere.

        Args:
            lock: Where they are held, by their names in the gripper's file [rad or m].

        Raises:
            InvalidInputError: If there is no gripper, or it has no such joint or position.
        """
        if (gripper := self.description.gripper) is None:
            raise InvalidInputError("arm.gripper: must be given, a gripper whose joints move")
        moved = replace(gripper, lock={**gripper.lock, **lock})
        return Arm(replace(self.description, gripper=moved), self.name, self.limits)

    @cached_property
    def gripper_plant(self) -> MultibodyPlant:
        """The arm and its gripper with all joints free."""
        plant = MultibodyPlant(0.0)
        with quiet_drake(logging.ERROR):
            self._model.add_to(plant)
        plant.Finalize()
        return plant

    def gripper_contexts(self, locks: Iterable[Mapping[str, float]]) -> list[Context]:
        """Return contexts of `gripper_plant` with the gripper's joints where they are held.

        Args:
            locks: Positions by joint, as for `with_gripper_at`; each in turn.
        """
        return [
            lock_context(
                self.gripper_plant,
                self.joints,
                {**self._lock, **{GRIPPER + name: q for name, q in lock.items()}},
                self._model.mimics,
            )
            for lock in locks
        ]

    def _with_other(self, model: Model, of_other: Callable[[Arm], Model]) -> Model:
        """Return a model together with that of the second arm, if there is one."""
        pair, other = self.description.pair, self.other
        if other is None or pair is None or pair.base is None:
            return model
        X_AB = RigidTransform(RollPitchYaw(pair.base.rpy), pair.base.translation)
        return place_beside(model, of_other(other), SECOND, X_AB)

    @cached_property
    def other(self) -> Arm | None:
        """The second arm of a pair by itself; None without one."""
        pair = self.description.pair
        return None if pair is None or pair.arm is None else _other_arm(pair.arm)

    @cached_property
    def frames(self) -> tuple[str, ...]:
        """Names of the frames of its tools."""
        pair = self.description.pair
        return (self.frame,) if pair is None else (self.frame, self._frame_of_second(pair))

    @cached_property
    def _lock(self) -> dict[str, float]:
        """Positions of the joints that are held still, of all models [rad or m]."""
        others = {} if self.other is None else self.other._lock
        gripper = {} if self.description.gripper is None else self.description.gripper.lock
        return {
            **self.description.lock,
            **{GRIPPER + name: q for name, q in gripper.items()},
            **{SECOND + name: q for name, q in others.items()},
        }

    def _home_of_both(self, home: Array | None) -> Array | None:
        """Return the home posture, that of a second arm behind the given one."""
        if self.other is None or home is None or home.size != self._own:
            return home
        return None if self.other.home is None else np.concatenate((home, self.other.home))

    @property
    def model_text(self) -> str:
        """Its model as Drake reads it, that of a second arm included, without added tools."""
        text = self._model.text
        return self.model.read_text() if text is None else text

    @property
    def tools(self) -> tuple[ToolDescription, ...]:
        """The tools that were added to its models."""
        return tuple(tool for tool in (self.tool, self._second_tool) if tool is not None)

    @cached_property
    def _second_tool(self) -> ToolDescription | None:
        """The tool to be added for the second frame of a pair."""
        pair = self.description.pair
        if pair is None:
            return None
        tool = pair.tool if self.other is None else self.other.tool
        if tool is None:
            return None
        mount = str(tool.mount or pair.frame) if self.other is None else f"{SECOND}{tool.mount}"
        return replace(tool, name=SECOND + tool.name, tip=SECOND + tool.tip, mount=mount)

    def _frame_of_second(self, pair: PairDescription) -> str:
        """Return the name of the frame of the second tool."""
        if self.other is not None:
            return SECOND + self.other.frame
        if self._second_tool is not None and pair.tool is not None and pair.tool.mount is None:
            return self._second_tool.tip
        return str(pair.frame)

    @cached_property
    def _R_21(self) -> Array:
        """R_21 of `drake_rnn.robot.task_frame.Tools`, of the model as it is stated, at home.

        Without a home posture it is that in the middle of the position limits.
        """
        plant = MultibodyPlant(0.0)
        self._add(self._stated, plant)
        plant.Finalize()
        limits = self.limits
        middle = 0.5 * (limits.position_lower + limits.position_upper)
        home = np.where(np.isfinite(middle), middle, 0.0) if self.home is None else self.home
        first, second = (
            ArmKinematics(plant, frame, self.joints).R_WE(home) for frame in self.frames
        )
        return np.asarray(second.T @ first)

    @property
    def _of_base(self) -> dict[str, float]:
        """Where each controlled joint of the base starts, by name [m or rad]."""
        if self.base is None or self.base.start is None:
            return {}
        stands = zip(self.base.joints, self.base.start.tolist(), strict=True)
        return {name: position for name, position in stands if name in self.joints}

    def _stated_home(self) -> Array | None:
        home, of_base = self.description.home, [*self._of_base.values()]
        if isinstance(home, str):
            return self.named_posture("arm.home", home)
        if home is None or home.size != self._own - len(of_base) or not of_base:
            return home
        # A posture of the model alone stands on the base where that starts.
        return np.concatenate((of_base, home))

    @cached_property
    def effort(self) -> Array:
        """Torque limit of each joint's motor, shape (n,) [Nm]; infinite where none is known."""
        plant = self._own_plant
        motors = map(plant.get_joint_actuator, plant.GetJointActuatorIndices())
        efforts = {motor.joint().name(): motor.effort_limit() for motor in motors}
        own_efforts = np.array([efforts.get(name, np.inf) for name in self.joints])
        if self.other is not None:
            own_efforts[self._own :] = self.other.effort
        if self._published is None:
            return own_efforts
        efforts_of_maker = np.full(self.n, np.nan)
        own = self.joints[: self._own]
        efforts_of_maker[: self._own] = self._published.values("effort", own)
        return np.where(np.isnan(efforts_of_maker), own_efforts, efforts_of_maker)

    def replace(self, **changes: Any) -> Arm:
        """Return the same arm with other fields of its description, e.g. ``frame="tip"``.

        Joints that remain controlled keep their limits and their part of ``home``. Joints that are
        no longer controlled are held at the position in ``lock``, otherwise at home. A joint that
        ``lock`` names is no longer controlled, unless ``joints`` is changed as well.

        Raises:
            InvalidInputError: As `Arm` does.
        """
        if "pair" in changes:
            rest = {key: value for key, value in changes.items() if key != "pair"}
            arm = self.replace(**rest) if rest else self
            home = None if arm.home is None else arm.home[: arm._own]
            description = arm.description.with_changes({"pair": changes["pair"]})
            return Arm(replace(description, home=home), self.name)
        description = self.description.with_changes(changes)
        if "model" in changes:
            return Arm(description, self.name)
        if "joints" not in changes and description.joints is not None:
            joints = [name for name in description.joints if name not in description.lock]
            description = replace(description, joints=joints)
        arm = Arm(replace(description, home=changes.get("home")), self.name)
        carried = [name for name in arm.joints if "base" not in changes or name not in arm._of_base]
        if not set(carried) <= set(self.joints):
            return arm
        indices = [self.joints.index(name) for name in carried]
        home = arm.home
        if self.home is not None:
            at_home = {n: q for n, q in zip(self.joints, self.home, strict=True)}
            former = () if self.base is None or "base" not in changes else self.base.joints
            locks = {n: q for n, q in at_home.items() if n not in (*arm.joints, *former)}
            description = replace(description, lock={**locks, **description.lock})
            home = self.home[indices] if home is None else home
        if "base" in changes:
            return Arm(replace(description, home=home), self.name)
        limits = None if "limits" in changes else self.limits.select(indices)
        return Arm(replace(description, home=home), self.name, limits)

    def with_limits(self, limits: JointLimits) -> Arm:
        """Return the same arm with other limits.

        Raises:
            InvalidInputError: If the limits are for another number of joints, or no `JointLimits`.
        """
        require_type("limits", limits, JointLimits)
        self._require_size("limits", limits.size)
        arm = copy(self)
        arm.limits = limits
        # It is the same model: experiments that share an arm need not make its plant each.
        vars(arm).update(_own_plant=self._own_plant, memo=self.memo)
        return arm

    def with_link_errors(self, errors: LinkErrorSettings | None) -> Arm:
        """Return the same arm with links that differ from the model's.

        Args:
            errors: The errors, which replace the arm's present ones; None for none.

        Raises:
            InvalidInputError: If the model cannot be written as URDF.
        """
        require_type("errors", errors, LinkErrorSettings, type(None))
        arm = copy(self)
        arm.description = replace(self.description, link_errors=errors)
        arm._model = arm._with_errors()
        return arm

    def _with_errors(self) -> Model:
        """Return the model with the errors of its links."""
        if (settings := self.description.link_errors) is None:
            return self._stated
        stated = in_urdf(self._stated)
        errors = settings.draw(len(moving_joints(stated)))
        return displace_joints(stated, errors.translation[:-1], errors.rotation[:-1])

    def add_to(
        self, plant: MultibodyPlant, X_WB: RigidTransform | None = None
    ) -> ModelInstanceIndex:
        """Parse the model into ``plant``, before it is finalized, and weld it to the world.

        A base that the model leaves free is welded at the pose that the model gives it. Joints that
        are not controlled are welded where they stand, and constraints of the model are left out.

        Args:
            plant: The plant; it may hold other models, also this one.
            X_WB: Pose in the world of the arm's base frame B, which is the world frame of its model
                file; by default both are the same. Paths, kinematics and gravity of the arm are
                expressed in B.

        Raises:
            InvalidInputError: If such joints exist and the plant already has constraints, or a
                joint of the model that moves is fixed to the world and cannot be placed.
        """
        require_type("plant", plant, MultibodyPlant)
        require_type("X_WB", X_WB, RigidTransform, NoneType)
        if self._held and plant.num_constraints():
            raise InvalidInputError(
                f"plant: has constraints, and Drake removes no joints then; add {self.name}, whose "
                f"joint {next(iter(self._held))!r} is held, before what has constraints"
            )
        return self._add(self._model, plant, X_WB)

    def add_shapes_to(self, plant: MultibodyPlant, whole: bool = False) -> tuple[LostMesh, ...]:
        """Parse the model with all of its collision meshes into ``plant``, to look at its shapes.

        Bodies, frames and joints are those of `add_to`, without errors of links, and so are drawn
        shapes and the tool.

        Args:
            plant: A plant that is not finalized, registered with a SceneGraph.
            whole: Whether meshes of URDF and SDF stay what they are; else they are convex hulls.

        Returns:
            Meshes of links that cannot be read.

        Raises:
            InvalidInputError: As `add_to` does, or if a file cannot be read any more.
        """
        model = self._with_other(self._shapes(whole), lambda other: other._shapes(whole))
        self._add(model, plant)
        return model.lost

    def _shapes(self, whole: bool) -> Model:
        """Return the model with all of its collision meshes."""
        description = self.description
        arguments = description.xacro_arguments
        model = read_shapes(self.model, description.packages, arguments, whole)
        return self._with_gripper(model, partial(read_shapes, whole=whole))

    def _add(
        self, model: Model, plant: MultibodyPlant, X_WB: RigidTransform | None = None
    ) -> ModelInstanceIndex:
        # The parser already gave its warnings when this arm was constructed.
        with quiet_drake(logging.ERROR):
            bodies_before, constraints_before = plant.num_bodies(), plant.GetConstraintIds()
            instance = model.add_to(plant)
        for constraint in plant.GetConstraintIds():
            if constraint not in constraints_before:
                plant.RemoveConstraint(constraint)
        for tool in self.tools:
            tool.add_to(plant, instance, self.model.name)
        if (payload := self.description.payload) is not None:
            name = payload.frame or self.frame
            self._require_frame(plant, name, "payload.frame")
            payload.add_to(plant, instance, plant.GetFrameByName(name, instance))
        bodies = [bodies_before + number for number, _ in self._floating_bases]
        free = [plant.get_body(BodyIndex(number)) for number in bodies]
        place, deck = RigidTransform() if X_WB is None else X_WB, plant.world_frame()
        if self.base is not None:
            place, deck = RigidTransform(), self.base.add_to(plant, instance, place)
            move_welds(plant, instance, place, deck, self.base.joints)
        elif X_WB is not None:
            move_welds(plant, instance, X_WB)
        for body, (_, X_BF) in zip(free, self._floating_bases, strict=True):
            plant.WeldFrames(deck, body.body_frame(), place @ X_BF)
        weld_joints(plant, instance, self._held)
        return instance

    def plant(self, time_step: float = 0.0) -> MultibodyPlant:
        """Return a finalized plant of this arm alone, with its gravity.

        Args:
            time_step: Time step of a discrete plant [s]; 0 for a continuous one.
        """
        plant = MultibodyPlant(time_step)
        self.add_to(plant)
        plant.mutable_gravity_field().set_gravity_vector(self.gravity)
        plant.Finalize()
        return plant

    def pose_in_base(self, frame: str) -> RigidTransform | None:
        """Return the pose in the base frame of a frame that does not move; None of an unknown one.

        Args:
            frame: Name of the frame.

        Raises:
            InvalidInputError: If the frame moves with the arm, or seems to be of one of its links
                that the model has not.
        """
        plant = self._own_plant
        frames = [plant.get_frame(FrameIndex(k)) for k in range(plant.num_frames())]
        own = next((each for each in frames if each.name() in (frame, GRIPPER + frame)), None)
        context, world = plant.CreateDefaultContext(), plant.world_frame()
        if own is not None and plant.IsAnchored(own.body()):
            return own.CalcPose(context, world)
        links = [plant.get_body(BodyIndex(k)) for k in range(1, plant.num_bodies())]
        beginning = f"{frame.partition('_')[0]}_"
        alike = sum(link.name().startswith(beginning) for link in links)
        if own is None and 2 * alike <= len(links):
            return None
        what = f"moves with {self.name}" if own is not None else f"may be a link of {self.name}"
        bases = [
            link.name()
            for link in links
            if plant.IsAnchored(link)
            and link.body_frame().CalcPose(context, world).IsNearlyIdentity(_SAME)
        ]
        raise InvalidInputError(f"{frame!r}, which {what}; its base is {(bases or ['world'])[0]}")

    def each(self, key: str, value: float | Array) -> Array:
        """Return a number for each joint, shape (n,), from one for all joints or one per joint.

        Args:
            key: Key of the value in a document, for the message.
            value: The number or numbers.

        Raises:
            InvalidInputError: If there are not as many numbers as joints.
        """
        array = np.asarray(value, dtype=float)
        if array.ndim and array.size != self.n:
            raise InvalidInputError(
                f"{key}: must have {self.n} entries, one per joint of {self.name}, not {array.size}"
            )
        return np.broadcast_to(array, self.n)

    def posture(self, plant: MultibodyPlant, q: Array) -> Array:
        """Return all positions of ``plant``, shape (nq,), with the controlled joints at ``q``.

        Args:
            plant: Plant with this arm.
            q: Positions of the controlled joints, shape (n,) [rad].
        """
        positions = plant.GetDefaultPositions()
        for name, position in zip(self.joints, q, strict=True):
            positions[plant.GetJointByName(name).position_start()] = position
        return np.asarray(positions, dtype=float)

    @property
    def postures(self) -> dict[str, Array]:
        """Named postures of the controlled joints, each shape (n,) [rad].

        They are the states of the SRDF file, as ``group/name`` and, where no other group has one of
        the name, as ``name``; and the keyframes of MJCF. Those that leave out a joint are none.
        """
        postures = {} if self._semantics is None else dict(self._semantics.postures)
        short = [name.partition("/")[2] for name in postures if self._poses(postures[name])]
        once = {n.partition("/")[2]: p for n, p in postures.items() if self._poses(p)}
        postures |= {name: posture for name, posture in once.items() if short.count(name) == 1}
        every = {**self._model.postures, **postures}
        return {
            name: np.array([posture.get(joint, self._of_base.get(joint)) for joint in self.joints])
            for name, posture in every.items()
            if self._poses(posture)
        }

    def _poses(self, posture: Mapping[str, float]) -> bool:
        """Return whether a posture says where each controlled joint is."""
        return set(self.joints) <= {*posture, *self._of_base}

    def named_posture(self, key: str, name: str) -> Array:
        """Return a posture of the robot's files, shape (n,) [rad].

        Args:
            key: Key of the name in a document, for the message.
            name: Name of a posture; ``home`` is the home posture unless another has that name.

        Raises:
            InvalidInputError: If there is no such posture of all controlled joints.
        """
        postures = self.postures
        if name in postures:
            return postures[name]
        if name == "home" and key != "arm.home" and self.home is not None:
            return self.home
        self._refuse_part(key, name)
        if postures:
            raise InvalidInputError(
                f"{key}: no posture {name!r}; {nearest(name, sorted(postures))}"
            )
        if self._semantics is not None:
            raise InvalidInputError(
                f"{key}: no posture {name!r}; {self._semantics.file.name} of arm.srdf names none "
                f"of all {plural(self.n, 'joint')}"
            )
        raise InvalidInputError(
            f"{key}: no posture {name!r}; {self.model.name} names none of "
            f"all {plural(self.n, 'joint')}: "
            "give their positions, or an SRDF file in arm.srdf"
        )

    def _refuse_part(self, key: str, name: str) -> None:
        """Raise an InvalidInputError for a posture of the SRDF file that leaves out joints."""
        semantics = self._semantics
        if semantics is None or not (missing := semantics.joints_missing(name, self.joints)):
            return
        some = ", ".join(missing[:4]) + (f" and {len(missing) - 4} more" if missing[4:] else "")
        raise InvalidInputError(
            f"{key}: the posture {name!r} of {semantics.file.name} leaves out {some}"
        )

    @property
    def disabled_pairs(self) -> Mapping[frozenset[str], str]:
        """Pairs of bodies that the SRDF file disables, each with its reason."""
        own = {} if self._semantics is None else self._semantics.disabled
        if self.other is None:
            return own
        others = self.other.disabled_pairs.items()
        return {**own, **{frozenset(SECOND + n for n in pair): why for pair, why in others}}

    def kinematics(self) -> ArmKinematics:
        """Return the arm's kinematics and dynamics as functions of the controlled joints."""
        scale = self.description.mass_scale
        if (pair := self.description.pair) is not None:
            frames = self.frames[0], self.frames[1]
            return PairKinematics(
                self._own_plant, frames, self.joints, pair.task_frame, self._R_21, scale
            )
        return ArmKinematics(self._own_plant, self.frame, self.joints, scale)

    def believed_dynamics(self) -> ArmKinematics:
        """Return the dynamics that a law is given, whose masses may differ from the arm's."""
        tool = self.description.tool
        if tool is not None and tool.believed_mass is not None:
            as_believed = replace(tool, mass=tool.believed_mass, believed_mass=None)
            return self.replace(tool=as_believed).believed_dynamics()
        mass_scale = self.description.believed_mass_scale
        scale = self.description.mass_scale if mass_scale is None else mass_scale
        return ArmKinematics(self._own_plant, self.frame, self.joints, scale)

    @cached_property
    def memo(self) -> dict[object, Any]:
        """Results of pure functions of the model, by what else they depend on."""
        return {}

    @cached_property
    def _own_plant(self) -> MultibodyPlant:
        """A plant of this arm alone, which is not changed: its file is read once."""
        return self.plant()

    def __getstate__(self) -> dict[str, Any]:
        # Copies, whose model may differ, and other processes make a plant of their own.
        return {key: x for key, x in vars(self).items() if key not in ("_own_plant", "memo")}

    @cached_property
    def _floating_bases(self) -> list[tuple[int, RigidTransform]]:
        """Free bodies of the model, numbered from its first one, and their default poses."""
        plant = MultibodyPlant(0.0)
        bodies_before = plant.num_bodies()
        with quiet_drake(logging.ERROR):
            self._model.add_to(plant)
        plant.Finalize()
        bodies = [plant.get_body(index) for index in plant.GetFloatingBaseBodies()]
        return [
            (int(body.index()) - bodies_before, plant.GetDefaultFloatingBaseBodyPose(body))
            for body in bodies
        ]

    def _require_size(self, key: str, size: int) -> None:
        if size != self.n:
            raise InvalidInputError(
                f"arm.{key}: has {plural(size, 'entry', 'entries')} for {plural(self.n, 'joint')}"
            )

    def _require_frame(self, plant: MultibodyPlant, name: str, key: str) -> None:
        if plant.HasFrameNamed(name):
            return
        gripper = self.description.gripper
        if gripper is not None and gripper.frame is not None and name == GRIPPER + gripper.frame:
            frames = (plant.get_frame(FrameIndex(k)).name() for k in range(plant.num_frames()))
            own = [each.removeprefix(GRIPPER) for each in frames if each.startswith(GRIPPER)]
            raise InvalidInputError(
                f"arm.gripper.frame: no frame {gripper.frame!r} in {Path(gripper.model).name}; "
                + nearest(gripper.frame, own)
            )
        raise InvalidInputError(
            f"arm.{key}: no frame {name!r} in {self.model.name}; {nearest_frame(plant, name)}"
        )

    def _controlled_joints(self, plant: MultibodyPlant) -> tuple[str, ...]:
        joints = map(plant.get_joint, plant.GetJointIndices())
        movable = {joint.name(): joint for joint in joints if joint.num_positions()}
        self._require_movable(list(movable))
        joint_choice = self.description.joints
        joints_used = list(joint_choice or ())
        if joint_choice is None:
            frames = self.frames if self.other is None else self.frames[:1]
            moving = [
                joint.name()
                for frame in frames
                for joint in joints_to(plant, plant.GetFrameByName(frame).body())
                if joint.num_positions()
            ]
            held = {*self._lock, *self._of_gripper}
            joints_used = [name for name in dict.fromkeys(moving) if name not in held]
        elif self.base is not None:
            carrying = [name for name in self.base.joints if name not in self._lock]
            joints_used = [*(n for n in carrying if n not in joints_used), *joints_used]
        if self.other is not None:
            joints_used += [SECOND + name for name in self.other.joints]
        if len(set(joints_used)) < len(joints_used):
            twice = next(name for name in joints_used if joints_used.count(name) > 1)
            raise InvalidInputError(f"arm.joints: {twice!r} is given twice")
        if both := set(joints_used) & set(self._lock):
            raise InvalidInputError(f"arm.lock: {sorted(both)[0]!r} is also a controlled joint")
        if not joints_used:
            raise InvalidInputError(
                f"arm.frame: no movable joint between the base and {self.frame!r}"
            )
        for key, names in (("joints", joints_used), ("lock", self._lock)):
            self._require_single(key, [movable[name] for name in names])
        self._require_independent(joints_used)
        self._require_lockable(movable)
        return tuple(joints_used)

    def _require_single(self, key: str, joints: Collection[Joint]) -> None:
        """Raise an InvalidInputError for a joint of several degrees of freedom."""
        for joint in joints:
            if joint.num_positions() == joint.num_velocities() == 1:
                continue
            what = f"{joint.name()!r} is a {joint.type_name()} joint and must have one degree of "
            remedy = "it is held where the model has it: leave it out"
            if key == "joints":
                remedy = (
                    "name the other joints in arm.joints, and it is held where the model has it"
                )
            raise InvalidInputError(f"arm.{key}: {what}freedom; {remedy}")

    def _turning(self, limits: JointLimits) -> NDArray[np.bool_]:
        """Return which controlled joints turn without end, shape (n,).

        Args:
            limits: Limits of the model and of its file.
        """
        turns = np.array([unit == "rad" for unit in self.units])
        if (endless_names := self.description.endless) is None:
            free = np.isinf(limits.position_lower) & np.isinf(limits.position_upper)
            return np.asarray(turns & free)
        for name in endless_names:
            if name not in self.joints and name not in self._held:
                raise InvalidInputError(
                    f"arm.endless: no movable joint {name!r}; {nearest(name, list(self.joints))}"
                )
        chosen = np.array([name in endless_names for name in self.joints])
        if self.other is not None:
            chosen[self._own :] = self.other.endless
        return np.asarray(turns & chosen)

    def _require_independent(self, joints: list[str]) -> None:
        """Raise an InvalidInputError if a controlled joint follows another one."""
        for name in joints:
            if (mimic := self._model.mimics.get(name)) is not None:
                if not mimic.joint:
                    raise InvalidInputError(
                        f"arm.joints: {name!r} is held at {mimic.offset:g} by the model, so it "
                        "cannot be controlled; hold it there in arm.lock"
                    )
                raise InvalidInputError(
                    f"arm.joints: {name!r} follows {mimic.joint!r} (mimic), so it cannot be "
                    "controlled; hold it in arm.lock, or take a frame before it"
                )

    def _require_movable(self, movable: list[str]) -> None:
        """Raise an InvalidInputError if a joint named in the description is not movable."""
        keys = (("lock", self.description.lock), ("joints", self.description.joints or ()))
        for key, names in keys:
            for name in names:
                if name not in movable:
                    raise InvalidInputError(
                        f"arm.{key}: no movable joint {name!r} in {self.model.name}; "
                        + nearest(name, movable)
                    )

    def _require_lockable(self, movable: Mapping[str, Joint]) -> None:
        """Raise an InvalidInputError if a joint is locked outside its position limits."""
        for name, value in self._lock.items():
            (lower,) = movable[name].position_lower_limits()
            (upper,) = movable[name].position_upper_limits()
            if not lower <= value <= upper:
                raise InvalidInputError(
                    f"{self._lock_key(name)}: may be {lower:g} to {upper:g}, not {value:g}"
                )
            self._require_followed(name, value)

    def _lock_key(self, name: str) -> str:
        """Return the key in a document that holds a joint, for messages."""
        gripper, own = self.description.gripper, name.removeprefix(GRIPPER)
        if gripper is not None and own != name and own in gripper.lock:
            return f"arm.gripper.lock.{own}"
        return f"arm.lock.{name}"

    def _warn_of_followers(self) -> None:
        """Add a warning about held joints that should follow a controlled one."""
        if still := [n for n, m in self._model.mimics.items() if m.joint in self.joints]:
            self.warnings += (
                f"arm.model: {self.model.name}: {', '.join(still[:4])} should follow a controlled "
                "joint (mimic), and is held still",
            )

    def _require_followed(self, name: str, value: float) -> None:
        """Raise an InvalidInputError if a joint is locked elsewhere than where it follows."""
        mimic = self._model.mimics.get(name)
        leads = self._lock.get("" if mimic is None else mimic.joint)
        # Only joints of a gripper are held for certain, at zero where they are not locked.
        is_held = name in self._of_gripper or leads is not None
        if mimic is None or (mimic.joint and not is_held):
            return
        there = mimic.multiplier * (leads or 0.0) + mimic.offset
        if abs(value - there) > _SAME:
            own, leader = (each.removeprefix(GRIPPER) for each in (name, mimic.joint))
            why, instead = "is held", "leave it out"
            if leader and leads is None:
                why, instead = (
                    f"follows {leader!r} (mimic), which is not locked,",
                    f"lock {leader!r} instead",
                )
            elif leader:
                why = f"follows {leader!r} (mimic), which is locked"
            raise InvalidInputError(
                f"{self._lock_key(name)}: {own!r} {why} and is at {there:g} then, not {value:g}; "
                + instead
            )

    def _read_semantics(self, plant: MultibodyPlant) -> Srdf | None:
        """Return what the SRDF file says; what is not used of it becomes a warning."""
        description = self.description
        if description.srdf is None:
            return None
        file = Path(description.srdf)
        read = read_srdf(file, description.packages, description.xacro_arguments)
        bodies = {plant.get_body(BodyIndex(k)).name() for k in range(plant.num_bodies())}
        joints = {plant.get_joint(index).name() for index in plant.GetJointIndices()}
        links = {name for pair in read.disabled for name in pair}
        joint_names = {name for posture in read.postures.values() for name in posture}
        if (links or joint_names) and not (links & bodies or joint_names & joints):
            raise InvalidInputError(
                f"arm.srdf: {file.name} is that of another robot: {self.model.name} has none of "
                "its links and joints"
            )
        absent = sorted(links - bodies)
        unknown = [_with_nearest(name, joints) for name in sorted(joint_names - joints)]
        text = [f"not used: {', '.join(read.unused)}"] if read.unused else []
        text += [f"links that the model has not: {', '.join(absent)}"] if absent else []
        if unknown:
            text.append(f"joints that the model has not: {', '.join(unknown)}")
        own = plant.GetModelInstanceName(plant.GetJointByName(self.joints[0]).model_instance())
        if read.robot and read.robot != own:
            text.append(f"it is that of {read.robot}, by its name, and the model that of {own}")
        if text:
            self.warnings += (f"arm.srdf: {file.name}: {'; '.join(text)}",)
        return read

    def _read_limits(self, plant: MultibodyPlant) -> LimitsFile | None:
        if self.description.limits is None:
            return None
        every = map(plant.get_joint, plant.GetJointIndices())
        types = {joint.name(): joint.type_name() for joint in every if joint.num_positions()}
        sliding = [name for name, kind in types.items() if kind == PrismaticJoint.kTypeName]
        file = Path(self.description.limits)
        read = read_limits(file, list(types), self.joints[: self._own], sliding)
        self.warnings += tuple(f"arm.limits: {file.name}: {warning}" for warning in read.warnings)
        return read

    def _known_limits(self, plant: MultibodyPlant) -> JointLimits:
        """Return the limits of the limits file, and the model's where the file states none."""
        own_limits, own = self._stated_limits(plant), self.joints[: self._own]
        if self.other is not None:
            own_limits = own_limits.select(list(range(self._own)))
        if self._published is not None:
            file = str(self.description.limits)
            own_limits = self._published.over(own_limits, own, file)
        if self.base is not None and (jerk := self.base.jerk) is not None:
            # Drake's joints have none.
            stated = own_limits.jerk
            bounds = np.full(len(own), np.inf) if stated is None else np.array(stated)
            for name, bound in zip(self.base.joints, jerk, strict=True):
                if name in own:
                    bounds[own.index(name)] = bound
            own_limits = own_limits.replace(jerk=bounds)
        if self.other is None:
            return own_limits
        return JointLimits.beside(own_limits, self.other.limits)

    def _stated_limits(self, plant: MultibodyPlant) -> JointLimits:
        joints = [plant.GetJointByName(name) for name in self.joints]
        velocity = np.array([joint.velocity_upper_limits()[0] for joint in joints])
        acceleration = np.array([joint.acceleration_upper_limits()[0] for joint in joints])
        # Models write such numbers for no bound.
        velocity[velocity > MOST["velocity"]] = np.inf
        acceleration[acceleration > MOST["acceleration"]] = np.inf
        return construct(
            JointLimits,
            {
                "position_lower": np.array([joint.position_lower_limits()[0] for joint in joints]),
                "position_upper": np.array([joint.position_upper_limits()[0] for joint in joints]),
                "velocity": velocity,
                "acceleration": acceleration if np.isfinite(acceleration).any() else None,
            },
            "arm.model",
        )
