"""The sections ``obstacles`` and ``safety``: what an arm is to stay clear of.

- What an arm is to stay clear of, and how it moves.
- What is kept of the command of any law, as a document says.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field
from pydrake.geometry import Box, Capsule, Cylinder, Meshcat, Rgba, Shape, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, System

from .. import colours
from ..errors import InvalidInputError
from ..inputs.fields import Array, validated
from ..inputs.keys import Meaning, Only
from ..laws import Avoidance, Law, Safety
from ..laws.checks import sampled_reading
from ..laws.guarantee import distance_assumptions
from ..laws.law import Layout
from ..measures import Motion, RunMetrics, Steps
from ..paths import Path, PlacedPath, RelativePath
from ..robot.clearance import Clearance
from ..robot.clearance.obstacles import (
    BallObstacle,
    BoxObstacle,
    CapsuleObstacle,
    CylinderObstacle,
    HalfSpaceObstacle,
    Obstacle,
)
from ..robot.limits import JointLimits
from ..systems.block import Block
from .feature import (
    SECOND_PREFIX,
    Assumption,
    DrawnRobot,
    EvaluationSteps,
    Feature,
    Frames,
    Guarantee,
    LegendEntry,
    SceneItem,
    Stage,
)
from .sensing import Stream, WhiteNoise

# A joint that goes less far than this from one step to the next stands still [rad].
_MOTION_TOLERANCE = 1e-12
# Distance that is no rounding error [m].
_BEYOND = 1e-6

# At how many times of a run speeds are looked at, and what they may be beyond by.
_LOOKED, _ROUNDING = 4001, 1e-9


#: Makes the path that a section of a document describes, of a key.
MakePath = Callable[[Mapping[str, Any], str], Path]


def obstacle_motions(
    obstacles: Sequence[Obstacle],
    clearance: Clearance | None,
    duration: float,
    make_path: MakePath,
) -> ObstacleMotions | None:
    """Return how the obstacles move that may, in the order of their signal; None without any.

    Args:
        obstacles: The obstacles, in the order of the document.
        clearance: What the arm is to stay clear of, which counts those that may move.
        duration: Duration of the run [s].
        make_path: Makes the path of an obstacle.

    Raises:
        InvalidInputError: If a path is wrong, has a place of its own, or leads faster than the
            speed that is counted on.
    """
    if clearance is None or not clearance.solids.moving.size:
        return None
    numbers = {obstacle.name: k for k, obstacle in enumerate(obstacles)}
    indices = [numbers[clearance.solids.names[k]] for k in clearance.solids.moving]
    items = [(f"obstacles[{k}]", obstacles[k]) for k in indices]
    paths = tuple(_path(key, each, duration, make_path) for key, each in items)
    return ObstacleMotions(paths, np.array([each.error for _, each in items]))


def make_motion(section: Mapping[str, Any], key: str, what: str, make_path: MakePath) -> PlacedPath:
    """Return the path on which something moves from where it is.

    Args:
        section: The path, with its ``kind`` and fields.
        key: Its key in the document.
        what: What moves.
        make_path: Makes the path.

    Raises:
        InvalidInputError: If it is wrong, or has a place of its own.
    """
    path = make_path(section, key)
    if not isinstance(path, RelativePath) or path.frame != "base":
        raise InvalidInputError(
            f"{key}: must be a path along the axes of the base, which begins where the {what} is"
        )
    return path.placed(np.zeros(3))


def fastest_of(path: PlacedPath, duration: float, direction: Array | None = None) -> float:
    """Return the largest speed on a path [m/s].

    Args:
        path: The path.
        duration: Time from 0 at which it is looked at [s].
        direction: Unit vector along which alone the speed counts, shape (3,); None for all.
    """
    if direction is None:
        return fastest_across(path, duration)
    times = np.linspace(0.0, duration, _LOOKED)
    return float(max(abs(path.position(float(t))[1] @ direction) for t in times))


def fastest_across(path: PlacedPath, duration: float, normal: Array | None = None) -> float:
    """Return the largest speed on a path across a normal [m/s].

    Args:
        path: The path.
        duration: Time from 0 at which it is looked at [s].
        normal: Unit vector along which the speed does not count, shape (3,); None for none.
    """
    times = np.linspace(0.0, duration, _LOOKED)
    velocities = np.array([path.position(float(t))[1] for t in times])
    if normal is not None:
        velocities -= np.outer(velocities @ normal, normal)
    return float(np.linalg.norm(velocities, axis=1).max())


def _path(key: str, obstacle: Obstacle, duration: float, make_path: MakePath) -> PlacedPath | None:
    if obstacle.moves is None or obstacle.speed is None:
        return None
    placed_path = make_motion(obstacle.moves, f"{key}.moves", "obstacle", make_path)
    fastest = fastest_of(placed_path, duration)
    if fastest > obstacle.speed * (1.0 + _ROUNDING):
        raise InvalidInputError(
            f"{key}.moves: reaches {fastest:.3g} m/s, where speed counts on at most "
            f"{obstacle.speed:g} m/s"
        )
    return placed_path


@dataclass(frozen=True, eq=False)
class ObstacleMotions:
    """How far obstacles have gone from where they are stated.

    Attributes:
        paths: The path of each of the m obstacles that may move; None for one that does not.
        errors: Largest error of each one's measured position, shape (m,) [m].
    """

    paths: tuple[PlacedPath | None, ...]
    errors: Array

    def at(self, t: float) -> Array:
        """Return p_WO, shape (m, 3) [m].

        Args:
            t: Time [s].
        """
        p_WO = np.zeros((len(self.paths), 3))
        for k, path in enumerate(self.paths):
            if path is not None:
                p_WO[k] = path.position(t)[0] - path.position(0.0)[0]
        return p_WO

    def along(self, times: Array) -> Array:
        """Return p_WO at times, shape (k, m, 3) [m]."""
        return np.array([self.at(float(t)) for t in times]).reshape(-1, len(self.paths), 3)


class MeasuredPlaces:
    """Where obstacles are measured to be.

    Each one's position has the largest error that it may have, in a direction of its own at each
    sample.

    Args:
        motions: How the obstacles move.
        period: Sampling period [s].
        seed: Seed of the errors.
    """

    def __init__(self, motions: ObstacleMotions, period: float, seed: int = 0) -> None:
        self.motions, self._period = motions, period
        self._noise = WhiteNoise(3 * len(motions.paths), seed, Stream.OBSTACLES)

    def at(self, t: float) -> Array:
        """Return p_WO at a time [s], shape (m, 3) [m]."""
        away = self._noise.sample(round(t / self._period)).reshape(-1, 3)
        away = away / np.linalg.norm(away, axis=1, keepdims=True)
        return np.asarray(self.motions.at(t) + self.motions.errors[:, None] * away)


class ObstacleSource(Block):
    """Source of where obstacles are measured to be: the output ``p_WO``, shape (m * 3,) [m].

    Arguments are those of `MeasuredPlaces`.
    """

    def __init__(self, motions: ObstacleMotions, period: float, seed: int = 0) -> None:
        super().__init__()
        places = MeasuredPlaces(motions, period, seed)

        def measured(context: Context, output: Any) -> None:
            output.set_value(places.at(context.get_time()).ravel())

        size = 3 * len(motions.paths)
        self.DeclareVectorOutputPort("p_WO", size, measured, {self.time_ticket()})


def least_distances(
    clearance: Clearance, motions: ObstacleMotions | None, position: Array, time: Array
) -> dict[str, Array]:
    """Return the least distances since the step before, and those while the arm moves [m].

    Of two arms that one law moves, those of their links from each other are among them.

    Args:
        clearance: What the arm is to stay clear of.
        motions: How obstacles move; None if none may.
        position: Joint positions, shape (k, n) [rad].
        time: Times of the steps, shape (k,) [s].
    """
    arms = clearance.between_arms
    between = {} if arms is None else {"arms_distance": arms.least_along(position)}
    if motions is None:
        return {"distance": clearance.least_along(position), **between}
    least = clearance.least_along(position, motions.along(time))
    is_moving = (
        np.abs(np.diff(position, axis=0, prepend=position[:1])).max(axis=1) > _MOTION_TOLERANCE
    )
    moving = np.where(is_moving, least, np.inf)
    return {"distance": least, "distance_moving": moving, **between}


def distance_caveats(metrics: Mapping[str, float], floor: float) -> Iterable[str]:
    """Yield a warning if the arm collided, or came nearer than the law lets its command come.

    Args:
        metrics: Metrics of the run.
        floor: Distance that its command keeps [m]; 0 if it keeps none.
    """
    distance = metrics.get("distance_min_m", np.inf)
    moving = metrics.get("distance_moving_min_m", distance)
    if distance < floor <= moving:
        yield (
            f"obstacles: one comes as near as {distance:.3g} m to the arm while that stands still"
        )
    elif distance < 0.0:
        yield f"obstacles: the arm collides, by up to {-distance:.3g} m"
    elif distance < floor - _BEYOND:
        yield (
            f"obstacles: the arm comes as near as {distance:.3g} m; of its command the law keeps "
            f"{floor:g} m"
        )


_SOLID = Rgba(*colours.components(colours.SURFACE))
# Of a half-space, which would hide what is behind it: a sheet of this size and thickness [m].
_SHEET = Rgba(*colours.components(colours.SURFACE), 0.4)
_SIZE, _THICKNESS = 1.6, 0.004


def pose_of(obstacle: Obstacle) -> RigidTransform:
    """Return the pose at which an obstacle is drawn, where it begins."""
    return _draw(obstacle)[1]


def shape_of(obstacle: Obstacle) -> Shape:
    """Return the shape in which an obstacle is drawn, at `pose_of`."""
    return _draw(obstacle)[0]


def _draw(obstacle: Obstacle) -> tuple[Shape, RigidTransform]:
    """Return an obstacle's shape and pose."""
    if isinstance(obstacle, BallObstacle):
        return Sphere(obstacle.radius), RigidTransform(obstacle.center)
    if isinstance(obstacle, BoxObstacle):
        return Box(obstacle.size), RigidTransform(RotationMatrix(obstacle.R_WO), obstacle.center)
    if isinstance(obstacle, CapsuleObstacle):
        return capsule_between(*obstacle.ends, obstacle.radius)
    if isinstance(obstacle, CylinderObstacle):
        shape, axis = Cylinder(obstacle.radius, obstacle.length), obstacle.axis_W
        return shape, RigidTransform(RotationMatrix.MakeFromOneVector(axis, 2), obstacle.center)
    if isinstance(obstacle, HalfSpaceObstacle):
        n = obstacle.normal_W
        middle = n.dot(obstacle.point) * n - 0.5 * _THICKNESS * n
        R = RotationMatrix.MakeFromOneVector(n, 2)
        return Box(_SIZE, _SIZE, _THICKNESS), RigidTransform(R, middle)
    raise TypeError(f"no drawing of a {type(obstacle).__name__}")


def capsule_between(one: Array, other: Array, radius: float) -> tuple[Shape, RigidTransform]:
    """Return the capsule round a segment, a ball if its ends are one, and its pose.

    Args:
        one: One end of the segment, shape (3,) [m].
        other: The other end, shape (3,) [m].
        radius: Radius [m].
    """
    length = float(np.linalg.norm(other - one))
    if length < 1e-6:
        return Sphere(radius), RigidTransform(one)
    R = RotationMatrix.MakeFromOneVector((other - one) / length, 2)
    return Capsule(radius, length), RigidTransform(R, 0.5 * (one + other))


_OPACITY = 0.45
# A first layer fills the depth buffer and leaves no colour: where capsules overlap, only the
# nearest one is seen.
_LAYERS = (
    ("depth", 1.0, {"material.colorWrite": False, "renderOrder": 2.0}),
    ("tint", _OPACITY, {"renderOrder": 3.0}),
)


def draw_capsules(
    meshcat: Meshcat,
    robot: DrawnRobot,
    clearance: Clearance | None,
) -> list[str]:
    """Draw the capsules of an arm, hidden.

    Args:
        meshcat: Meshcat with the scene.
        robot: The arm in the scene.
        clearance: What the arm is to stay clear of, with its capsules; None if nothing is.

    Returns:
        Scene paths of the capsules. Those of links of which nothing is drawn are left out.
    """
    if clearance is None:
        return []
    arm, places = clearance.arm, list[str]()
    robot.set_posture(np.zeros(robot.arm.n))
    # Those of an arm beside it come behind its own.
    own = list(zip(arm.bodies, arm.ends, arm.radii, strict=True))[: clearance.alone]
    for k, (name, ends, radius) in enumerate(own):
        if (carrier := robot.carrier(name)) is None:
            continue
        place = f"{robot.place(carrier)}/capsules/{k}"
        shape, X_WC = capsule_between(ends[0], ends[1], float(radius))
        meshcat.SetTransform(place, robot.X_WB(carrier).inverse() @ X_WC)
        for layer, opacity, look in _LAYERS:
            rgba = Rgba(*colours.components(colours.CAPSULE), opacity)
            meshcat.SetObject(f"{place}/{layer}", shape, rgba)
            for key, value in {"castShadow": False, **look}.items():
                meshcat.SetProperty(f"{place}/{layer}/<object>", key, value)
        meshcat.SetProperty(place, "visible", False)
        places.append(place)
    return places


class DrawnObstacles(SceneItem):
    """What stands in an arm's way, below "/obstacles", and the arm's capsules.

    Args:
        stage: Where they are drawn.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    @property
    def corners(self) -> Array:
        """Corners of boxes round all obstacles, where they begin, shape (k, 3) [m]."""
        obstacles = self._stage.experiment.obstacles
        return np.concatenate([np.zeros((0, 3)), *(each.corners for each in obstacles)])

    def draw(self) -> list[str]:
        """Draw obstacles; of a half-space, a part of its plane near the base."""
        meshcat, experiment = self._stage.meshcat, self._stage.experiment
        for k, obstacle in enumerate(experiment.obstacles):
            shape, pose = _draw(obstacle)
            place = f"/obstacles/{k}"
            sheet = isinstance(obstacle, HalfSpaceObstacle)
            meshcat.SetObject(place, shape, _SHEET if sheet else _SOLID)
            meshcat.SetTransform(place, pose)
        return draw_capsules(meshcat, self._stage.arm, experiment.clearance)

    def record(self, frames: Frames) -> None:
        """Record how obstacles move."""
        experiment = self._stage.experiment
        if experiment.motions is None or experiment.clearance is None:
            return
        solids = experiment.clearance.solids
        numbers = {obstacle.name: k for k, obstacle in enumerate(experiment.obstacles)}
        p_WO = experiment.motions.along(self._stage.begin + frames.time)
        for m, k in enumerate(solids.moving):
            number = numbers[solids.names[k]]
            _, pose = _draw(experiment.obstacles[number])
            frames.move(f"/obstacles/{number}", pose.translation() + p_WO[:, m])


# Radius of a mark of the nearest points of two arms [m].
_MARK = 0.008


class DrawnGap(SceneItem):
    """Where two arms that one law moves are nearest each other, while rows of it are in force.

    Args:
        stage: Where it is drawn.
        arms: The pairs of both arms.
        outer: Distance below which they are in force [m].
    """

    places = ("/gap/0", "/gap/1")

    def __init__(self, stage: Stage, arms: Clearance, outer: float) -> None:
        self._stage, self._arms, self._outer = stage, arms, outer

    def draw(self) -> list[str]:
        for place in self.places:
            rgba = Rgba(*colours.components(colours.BOUND))
            self._stage.meshcat.SetObject(place, Sphere(_MARK), rgba)
        return []

    def record(self, frames: Frames) -> None:
        """Record where they are, and when they are seen."""
        motion = self._stage.motion
        each = [self._arms.nearest_surfaces(q) for q in motion.at(frames.time, motion.position)]
        is_near = np.array([gap < self._outer for gap, _ in each])
        changes = np.flatnonzero(np.diff(is_near, prepend=~is_near[:1])).tolist()
        for number, place in enumerate(self.places):
            frames.move(place, np.array([points[number] for _, points in each]))
            for frame in changes:
                frames.recording.SetProperty(frame, place, "visible", bool(is_near[frame]))


class ObstaclesFeature(Feature):
    """The section ``obstacles``."""

    key = "obstacles"

    def signal_sources(
        self, experiment: Any, inputs: Layout
    ) -> Mapping[str, tuple[System, Sequence[str]]]:
        """Return where obstacles that may move are measured to be."""
        motions, document = experiment.motions, experiment.document
        if "p_WO" not in inputs or motions is None or document.period is None:
            return {}
        return {"obstacles": (ObstacleSource(motions, document.period, document.seed), ["p_WO"])}

    def doubts(self, experiment: Any) -> list[str]:
        """Return a warning if a law does not look at what is in the way, or learns how it moves."""
        if experiment.clearance is None:
            return []
        if experiment.guarantees.command.distance is None:
            return [experiment.law.distance_doubt]
        errors = experiment.arm.description.link_errors is not None
        if not (errors or experiment.law.learns_jacobian):
            return []
        why = "the law learns its Jacobian" if not errors else "its links differ from the model's"
        return [
            f"obstacles: {why}, but the distances that are kept are certified with the kinematics "
            "that the simulated arm has; of a robot this is promised only if they are known"
        ]

    def assumptions(self, experiment: Any) -> Mapping[str, Sequence[Assumption]]:
        """Return what the least distance rests on."""
        if experiment.clearance is None:
            return {}
        actual = 0.0 if experiment.level.is_simulated else None
        assumptions = distance_assumptions(experiment.clearance, actual)
        if experiment.law.neighbour is not None:
            other = "deviation of the other arm from its command"
            assumptions = (*assumptions, Assumption(other, 0.0, "rad", actual))
        return {"distance": assumptions}

    def observe(self, experiment: Any, run: EvaluationSteps) -> Mapping[str, Any]:
        """Return the least distances since the step before, and those while the arm moves [m]."""
        clearance, motions, steps = experiment.clearance, experiment.motions, run.steps
        if clearance is None or run.virtual:
            return {}
        if (handling := experiment.handling) is not None:
            return {"distance": handling.least_along(steps.series("position"), steps.time)}
        position = own = steps.series("position")
        if clearance.alone is not None:
            position = np.concatenate((own, steps.series(f"{SECOND_PREFIX}position")), axis=1)
        return least_distances(clearance, motions, position, steps.time)

    def series(self, motion: Motion, steps: Steps) -> Mapping[str, Array]:
        both = {"distance": motion.distance, "arms_distance": motion.arms_distance}
        return {name: values for name, values in both.items() if values is not None}

    def caveats(
        self, experiment: Any, metrics: Mapping[str, float], run: RunMetrics
    ) -> Iterable[str]:
        return distance_caveats(metrics, experiment.guarantees.command.distance or 0.0)

    def items(self, stage: Stage) -> Iterable[SceneItem]:
        yield DrawnObstacles(stage)
        experiment = stage.experiment
        arms = None if experiment.clearance is None else experiment.clearance.between_arms
        if arms is not None and (thresholds := experiment.law.arms_thresholds) is not None:
            yield DrawnGap(stage, arms, thresholds[0])

    def legend(self, experiment: Any) -> Sequence[LegendEntry]:
        count = len(experiment.obstacles)
        text = "obstacle" if count == 1 else "obstacles"
        solids = [LegendEntry("solid", text, "■", colours.SURFACE)] if count else []
        if experiment.law.arms_thresholds is None:
            return solids
        return [*solids, LegendEntry("held", "where arms are nearest", colour=colours.BOUND)]


@validated
class SafetySettings:
    """What is kept of the command, whatever the law is."""

    bounds: Annotated[
        bool,
        Meaning(
            "Whether the limits of the joints are kept: of position and velocity, and those of "
            "acceleration and jerk that are given.",
        ),
    ] = True
    collisions: Annotated[
        bool,
        Meaning("Whether the arm is kept clear of itself and of ``obstacles``."),
    ] = False
    avoidance: Annotated[
        Avoidance,
        Meaning("How near it may come.", only=(Only("collisions"),)),
    ] = Field(default_factory=Avoidance)

    def __post_init__(self) -> None:
        if not self.bounds:
            raise ValueError(
                "bounds: must be true; a stop that is certified keeps them. Leave safety out to "
                "keep nothing"
            )


def make_safety(
    settings: SafetySettings | None,
    law: Law,
    limits: JointLimits,
    period: float | None,
    start: Array,
    clearance: Clearance | None,
) -> Safety | None:
    """Return what is kept of a law's command; None if the law's own is taken as it is.

    Args:
        settings: What the document says.
        law: The law.
        limits: Limits of the joints in the experiment.
        period: Sampling period [s]; None for a law that an integrator runs.
        start: Start posture, shape (n,) [rad].
        clearance: What the arm is to stay clear of, if that is looked at.

    Raises:
        InvalidInputError: If nothing can be kept of such a command, or the arm starts too near to
            something.
    """
    if settings is None or period is None:
        return None
    safety = Safety(limits, clearance if settings.collisions else None, settings.avoidance)
    safety.check_start(start)
    safety.around(sampled_reading(law, period), period)
    return safety


def command_guarantee(law: Law, safety: Safety | None) -> Guarantee:
    """Return what the command of a law keeps, or what safety makes of it.

    Args:
        law: The law, which declares what it keeps.
        safety: What bounds the law's command; None if it is taken as it is.
    """
    if safety is None:
        return law.guarantee
    # What safety changes keeps no higher limit that the law's own command kept.
    distances = (law.keeps_distance, safety.keeps_distance)
    return Guarantee(safety.keeps, max((d for d in distances if d is not None), default=None))


class SafetyFeature(Feature):
    """The section ``safety``; what it guarantees is what the command keeps."""

    key = "safety"
