"""A second arm beside that of an experiment: what its document says, and what both know."""

# No postponed annotations: pydantic resolves those of fields.
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import MatrixGain

from .. import colours
from ..errors import InvalidInputError
from ..inputs.documents import construct
from ..inputs.fields import Array
from ..inputs.messages import (
    field_names,
    nearest,
    short,
)
from ..laws import Law
from ..laws.law import Layout
from ..laws.parts.bounded_velocity import reached_limits
from ..laws.parts.safe_velocity import require_free
from ..paths.path import LedPath
from ..robot.arm_description import Base as Base
from ..robot.clearance import Clearance
from ..robot.clearance.clearance import (
    Neighbour,
    beside,
    stood,
)
from ..robot.kinematics import ArmKinematics
from ..robot.limits import JointLimits
from ..signals import DESIRED_POSITION, SIGNALS
from ..systems.block import Block
from ..systems.controllers import SampledController
from .feature import (
    SECOND_PREFIX,
    Feature,
    Frames,
    LegendEntry,
    Ports,
    SceneItem,
    Stage,
    ports_of,
)
from .obstacles import draw_capsules
from .pairs import SIDE_BY_SIDE

#: What both arms share.
COMMON_KEYS = (
    *("second", "obstacles", "detour", "period", "integrator", "duration", "log_period", "seed"),
    *("name", "over", "environment", "force", "sensor", "level", "plant", "safety", "filter"),
    *("dither", "disturbance", "camera"),
)


class StandingArm(NamedTuple):
    """What is known of an arm that stands beside another one.

    Attributes:
        law: Its law.
        clearance: What it is to stay clear of.
        start: Its start posture, shape (n,) [rad].
        limits: Limits of its joints.
    """

    law: Law
    clearance: Clearance
    start: Array
    limits: JointLimits


class SecondDocument(NamedTuple):
    """What the section ``second`` says.

    Attributes:
        document: Document of the second arm by itself.
        base: Where that arm stands.
        follows: Whether its path goes along with the first arm's tool.
    """

    document: Any
    base: Base
    follows: bool


def second_document(document: Any) -> SecondDocument:
    """Return what the section ``second`` of a document says.

    What the section ``second`` leaves out is as for the first arm.

    Args:
        document: A `drake_rnn.ExperimentDocument`.

    Raises:
        InvalidInputError: If it has a key that both arms share, or a wrong one; or if the document
            has an environment.
    """
    values = dict(document.second or {})
    base = construct(Base, values.pop("base", {}), "second.base")
    follows = values.pop("follows", False)
    if not isinstance(follows, bool):
        raise InvalidInputError(f"second.follows: must be true or false, not {short(follows)}")
    kind = type(document)
    _require_own(values, list(field_names(kind)))
    contents: dict[str, Any] = document.contents()
    contents.pop("second")
    own = {**contents, **values, "obstacles": []}
    if document.name:
        own["name"] = f"{document.name}_second"
    if "accept" not in values:
        own.pop("accept", None)
    try:
        return SecondDocument(construct(kind, own, ""), base, follows)
    except InvalidInputError as error:
        raise InvalidInputError(f"second.{error}") from None


def _require_own(section: Mapping[str, Any], keys: list[str]) -> None:
    """Raise an InvalidInputError for a key that the second arm cannot have."""
    for name in section:
        if name in COMMON_KEYS:
            raise InvalidInputError(f"second.{name}: is shared by both arms; leave it out")
        if name not in keys:
            allowed_keys = ["base", "follows", *keys]
            raise InvalidInputError(f"second.{name}: no such key; {nearest(name, allowed_keys)}")


def side_by_side(
    first: StandingArm, second: StandingArm, base: Base, period: float | None
) -> tuple[StandingArm, StandingArm]:
    """Return both arms with laws that count with each other; the first one chooses first.

    Args:
        first: The first arm.
        second: The second arm, as if it stood alone.
        base: Where it stands.
        period: Period of both laws [s].

    Raises:
        InvalidInputError: If a law cannot, or the arms start too near to each other.
    """
    there = stood(second.clearance, base.R, base.translation)
    # Obstacles are stated in the world of the first arm, and count for both.
    there = replace(there, solids=first.clearance.solids)
    entries = []
    for own, other, mine, theirs in (
        (first, second, first.clearance, there),
        (second, first, there, first.clearance),
    ):
        floor, clearance = own.law.keeps_distance, beside(mine, theirs.arm)
        if period is None or floor is None:
            raise InvalidInputError(SIDE_BY_SIDE)
        # The second one sees what the first has just chosen.
        neighbour = Neighbour(reached_limits(other.limits, period), has_chosen=own is second)
        if (law := own.law.beside(clearance, neighbour)) is None:
            raise InvalidInputError(SIDE_BY_SIDE)
        require_free(clearance, floor, np.concatenate((own.start, other.start)))
        entries.append(own._replace(law=law, clearance=clearance))
    return entries[0], entries[1]


class NeighbourSource(Block):
    """Source of the signals by which a law sees another arm, from the state of that arm's law.

    Its input ``state`` is the other controller's ``state``, or its ``next_state`` if that arm
    chooses first. Until that state is initialized the arm rests where it starts.

    Args:
        neighbour: The other arm, as the law knows it.
        layout: Layout of the other law's state.
        start: Where the other arm starts, shape (n,) [rad].
    """

    def __init__(self, neighbour: Neighbour, layout: Layout, start: Array) -> None:
        super().__init__()
        port = self.DeclareVectorInputPort("state", layout.size)
        at_rest = {name: np.zeros(start.size) for name in ("commanded", "v", "a")}
        at_rest["commanded"] = start
        for signal, part in neighbour.parts.items():
            at, _ = layout.parts[part]

            def calc(
                context: Context, output: Any, at: slice = at, first: Array = at_rest[part]
            ) -> None:
                state = port.Eval(context)[at]
                output.set_value(first if np.isnan(state).any() else state)

            self.DeclareVectorOutputPort(signal, start.size, calc, {port.ticket()})


class LedSource(Block):
    """Source of the desired position, now and at the next sample, by what the leading arm commands.

    Its inputs are ``now`` and ``next``, the joint positions of the leading arm at a sample and at
    the next one, shape (n,) [rad]; until they are known it rests at its start.

    Args:
        path: The path.
        kinematics: Kinematics of the leading arm.
        start: Where that arm starts, shape (n,) [rad].
        period: Sampling period [s].
        axes: Axes of the task.
    """

    def __init__(
        self,
        path: LedPath,
        kinematics: ArmKinematics,
        start: Array,
        period: float,
        axes: Sequence[int],
    ) -> None:
        super().__init__()
        rows = list(axes)
        for port, signal, ahead in (
            ("now", DESIRED_POSITION, 0.0),
            ("next", SIGNALS[DESIRED_POSITION].ahead, period),
        ):
            joints = self.DeclareVectorInputPort(port, start.size)

            def calc(
                context: Context, output: Any, joints: Any = joints, ahead: float = ahead
            ) -> None:
                q = joints.Eval(context)
                q = start if np.isnan(q).any() else q
                t = context.get_time() + ahead
                output.set_value(path.beside(t, kinematics.p_WE(q))[rows])

            tickets = {joints.ticket(), self.time_ticket()}
            self.DeclareVectorOutputPort(signal, len(rows), calc, tickets)


def add_neighbour(
    builder: DiagramBuilder, neighbour: Neighbour, layout: Layout, start: Array
) -> NeighbourSource:
    """Add what the law of one arm sees of the other one; see `NeighbourSource`."""
    name = f"{SECOND_PREFIX if neighbour.has_chosen else ''}neighbour"
    return builder.AddNamedSystem(name, NeighbourSource(neighbour, layout, start))


def add_led(builder: DiagramBuilder, first: Any, second: Any, leader: SampledController) -> Ports:
    """Add and return the desired positions of a second arm that goes along with the first one.

    Args:
        builder: Diagram builder that the systems are added to.
        first: The `drake_rnn.Experiment` of the first arm.
        second: That of the second one.
        leader: Controller of the first arm.
    """
    if not isinstance(second.desired, LedPath):
        return {}
    kinematics = first.arm.kinematics()
    axes = second.task.axes
    source = LedSource(second.desired, kinematics, first.start, leader.period, axes)
    builder.AddNamedSystem("led", source)
    at, _ = leader.reading.state.parts["commanded"]
    for state, joints in (("state", "now"), ("next_state", "next")):
        port = leader.GetOutputPort(state)
        part = np.eye(port.size())[at]
        selector = builder.AddNamedSystem(f"led_{joints}", MatrixGain(part))
        builder.Connect(port, selector.get_input_port())
        builder.Connect(selector.get_output_port(), source.GetInputPort(joints))
    return ports_of(source)


_PLACE = "/second"


class DrawnSecond(SceneItem):
    """The second arm below "/second" in the scene.

    Args:
        stage: Where it is drawn.
        base: Where it stands.
    """

    def __init__(self, stage: Stage, base: Base) -> None:
        self._stage = stage
        self._motion = _in_first_base(stage.replay(stage.motion.result.second), base)
        self._experiment = self._motion.result.experiment
        self._X_WB = RigidTransform(RotationMatrix(base.R), base.translation)
        self._drawn = stage.draw_arm(self._experiment.arm, f"{_PLACE}/arm")
        self.motions = (self._motion,)
        stage.meshcat.SetTransform(_PLACE, self._X_WB)

    @property
    def corners(self) -> Array:
        """Corners of boxes round it in several postures, shape (k, 3) [m]."""
        corners = self._stage.corners(self._motion, self._drawn)
        return np.asarray(corners @ self._X_WB.rotation().matrix().T + self._X_WB.translation())

    def draw(self) -> list[str]:
        """Draw its capsules."""
        clearance = self._experiment.clearance
        return draw_capsules(self._stage.meshcat, self._drawn, clearance)

    def record(self, frames: Frames) -> None:
        """Draw it at the time of each frame, while the scene records."""
        for frame, q in enumerate(self._motion.at(frames.time, self._motion.position)):
            self._drawn.draw(q, (frame + 0.5) / frames.rate)


def _in_first_base(motion: Any, base: Base) -> Any:
    """Return the motion of the second arm in the base frame of the first one."""
    R, p = base.R, base.translation
    trace, path_points, course = (
        each @ R.T + p for each in (motion.traced, motion.desired, motion.course)
    )
    return replace(motion, traced=trace, desired=path_points, course=course)


class SecondFeature(Feature):
    """The section ``second``."""

    key = "second"

    def items(self, stage: Stage) -> Iterable[SceneItem]:
        base = stage.experiment.base
        if base is not None and stage.motion.result.second is not None:
            yield DrawnSecond(stage, base)

    def legend(self, experiment: Any) -> Sequence[LegendEntry]:
        entry = LegendEntry("second", "second arm", "■", colours.SECOND)
        return () if experiment.base is None else (entry,)
