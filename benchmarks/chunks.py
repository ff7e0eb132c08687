"""How chunks of a policy are made safe: by the shield, Ruckig, klimits, a low pass and a clamp.

A policy sends chunks of 8 to 50 targets at 10 to 50 Hz, 0 to 0.8 s after it saw the arm, along a
smooth motion that each chunk mistakes by up to 0.3 rad; with noise, NaN, gaps, and chunks that
overtake each other. Half of the streams are joint positions, half poses of the tool. A third have
nothing near, a third five balls round the arm, a third a scene of MotionBenchMaker::

    python benchmarks/chunks.py FOLDER --streams 300 --kept FILE
    python benchmarks/chunks.py FOLDER --streams 1000 --arms fr3 --judge PYTHON --kept FILE
    python benchmarks/chunks.py FOLDER --first 6151 --streams 10000 --shield-alone --kept FILE
    python benchmarks/chunks.py FOLDER --table --kept FILE

FOLDER is the one of `motion_bench_maker.py`. Panda and UR5 stand in their own scenes, FR3, iiwa
and xArm in those of the Panda that are free where they start. Panda, FR3 and UR5 are led along the
last 1.2 rad of the straight way from start to goal of the problem. Arms are bare; the xArm 7 stands
for a user's arm, of whose meshes `load_arm` makes the shapes. Streams come in groups of 10 that
share a scene. All scenes of an arm share two builds in C, among five balls and among 21 boxes:
those that a scene does not have are 30 m away. Each round of 15 groups, in random order, has each
arm once with each kind of scene. ``--kept`` keeps what was found of each stream, and a run goes on
where one ended.

The shield pursues the way through the chunks. The others, which take no chunks, get at each sample
where the newest chunk is at that time, which is the best that can be given to them; of poses they
get the postures that the poses were made of.

Motions are judged by the meshes of `makers_meshes.SOURCES`, between samples as well: from posture
to posture the arm may move no farther than the distance that Drake's SceneGraph finds there.
SceneGraph takes the convex hull of each mesh; of two hulls nearer than 6 mm, the distance is that
of their triangles. Links that a joint joins are not compared, nor the base with a scene.

With ``--judge PYTHON``, a Python that has franka-sim, its checker of motion limits judges the
commands for the FR3, see `fr3_judge.py`: as velocities, and as the positions that they lead to.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
import traceback
from collections.abc import Iterator
from functools import cache
from itertools import groupby, islice, pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import coal
import numpy as np
from pydrake.geometry import (
    Box,
    CollisionFilterDeclaration,
    Convex,
    Cylinder,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    GeometrySet,
    ProximityProperties,
    SceneGraph,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial import ConvexHull

from drake_rnn import (
    Arm,
    Array,
    InvalidInputError,
    JointLimits,
    Shield,
    ShieldSettings,
    arm_clearance,
    load_arm,
    make_obstacles,
)
from fit_capsules import makers_surfaces
from makers_meshes import INSTALLED, Source, Surface, add_folders, bodies_of, surfaces_of
from markdown_table import head, row
from mesh_distance import Joints, triangles
from motion_bench_maker import SCENARIOS, Solid, problems_of
from shared_options import add_judge, add_kept
from streams import ACCELERATION, JERK, PERIOD, VELOCITY, klimits, low_pass, ruckig

DURATION, ENDS = 4.0, 3.0
KINDS = ("nothing", "balls", "MotionBenchMaker")
# Streams that share a scene.
GROUP = 10
# Users' arms: their models, the frames of their tools, and where they start [rad].
_ROBOTS = ("example-robot-data", "6.0.0")
USERS = {
    "xarm7": (
        Source(*_ROBOTS, "xarm_description/urdf/xarm7.urdf", "link7"),
        (0.0, -0.7, 0.0, 0.9, 0.0, 1.6, 0.0),
    ),
    "so101": (
        Source(*_ROBOTS, "so_arm_description/urdf/so101.urdf", "gripper_frame_link"),
        (0.0, -0.5, 0.5, 0.5, 0.0),
    ),
}
ARMS = ("panda", "fr3", "iiwa14", "ur5", "xarm7")
# Distance that a start needs [m], how many scenes are tried, and how far SceneGraph looks [m].
FREE, TRIES, FAR = 0.02, 40, 0.05
# Hulls that are nearer than that are looked at as triangles [m].
NEAR = 0.006
# Balls and boxes that a scene has at most, and where what is away from it stands [m].
BALLS, BOXES, AWAY = 5, 21, 30.0
# How far the goal of a problem is at most [rad].
LAST = 1.2
# What counts as beyond a limit: of commanded velocities, and of positions that are differentiated.
EXACT, ROUNDED = 1e-9, 1e-6


class Message(NamedTuple):
    """A chunk on its way.

    Attributes:
        arrives: Time at which it comes [s].
        start: Time of its first target [s].
        rate: Targets a second.
        values: The targets as they are sent, shape (k, width).
        postures: The same as postures, shape (k, n) [rad].
    """

    arrives: float
    start: float
    rate: float
    values: Array
    postures: Array


class Scene(NamedTuple):
    """Where an arm stands.

    Attributes:
        start: Its posture at the start, shape (n,) [rad].
        solids: What is round it.
        goal: Where it is led, likewise; by default not far.
    """

    start: Array
    solids: tuple[Solid, ...]
    goal: Array | None = None

    @property
    def obstacles(self) -> list[dict[str, Any]]:
        """The solids as obstacles of a document."""
        return [solid.settings() for solid in self.solids]

    @property
    def padded(self) -> list[dict[str, Any]]:
        """The same, and some far away: as many balls, or as many boxes, as any scene has.

        One build of the steps in C serves all scenes with as many.
        """
        obstacles = self.obstacles
        boxes = any(each["kind"] == "box" for each in obstacles)
        far = {"kind": "box", "size": 3 * [0.1]} if boxes else {"kind": "ball", "radius": 0.1}
        places = range(len(obstacles), BOXES if boxes else BALLS)
        return obstacles + [{**far, "center": [AWAY + k, 0.0, 0.0]} for k in places]


def installed(package: str) -> Path:
    """Return the folder of an installed package of models."""
    places = [Path(folder) / INSTALLED[package] for folder in sys.path]
    return next(place for place in places if place.is_dir())


@cache
def arm_of(name: str) -> Arm:
    """Return an arm without a tool."""
    if name not in USERS:
        return load_arm(name, tool=None)
    source, home = USERS[name]
    robots = installed(source.package)
    packages = {source.package: str(robots.parent)}
    return load_arm(
        robots / source.model, frame=source.frame, home=list(home), packages=packages, tool=None
    )


def surfaces(name: str, folders: list[str]) -> list[Surface]:
    """Return the maker's meshes of an arm's links, from its base on."""
    arm = arm_of(name)
    if name not in USERS:
        return list(makers_surfaces(name, arm, folders).values())
    source, _ = USERS[name]
    found = surfaces_of(arm, source, installed(source.package))
    bodies = [body.name() for body in bodies_of(arm, arm.plant())]
    return [Surface.of([s for s in found if s.body == body]) for body in bodies]


class ArmMeshes:
    """The makers' meshes of an arm, of which SceneGraph takes the hulls.

    Args:
        name: Name of the arm.
        folders: Where packages of meshes lie.

    Attributes:
        points: Corners of the hull of each link where all joints are at zero [m].
        links: Triangles of each link, likewise.
        reach: How far a point of the arm may be from each joint's axis at most [m].
        joined: Pairs of links that are not compared, by their numbers.
        bases: Links that are not compared with a scene.
    """

    def __init__(self, name: str, folders: tuple[str, ...]) -> None:
        joints = Joints(arm_of(name))
        meshes = surfaces(name, list(folders))
        placed = [joints.world(k, s.vertices) for k, s in enumerate(meshes)]
        used = [p[np.unique(s.faces)] for p, s in zip(placed, meshes, strict=True)]
        self.points = [points[ConvexHull(points).vertices] for points in used]
        self.links = [triangles(p, s.faces) for p, s in zip(placed, meshes, strict=True)]
        crosses = [np.cross(np.eye(3), axis) for axis in joints.axes]
        self._turns = [(K, K @ K, at) for K, at in zip(crosses, joints.points, strict=True)]
        ends = [
            [joints.reaches(k, self.points[link], link)[0] for link in range(k + 1, len(meshes))]
            for k in range(len(joints.axes))
        ]
        self.reach = np.array([max(each) for each in ends])
        self.joined, self.bases = [*pairwise(range(len(meshes)))], [0]

    def poses(self, q: Array) -> tuple[Array, Array]:
        """Return how links are moved from where all joints are at zero, from the base on.

        Args:
            q: Postures, shape (..., n) [rad].

        Returns:
            Rotations, shape (..., n + 1, 3, 3), and displacements, shape (..., n + 1, 3) [m].
        """
        R, p = np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3)), np.zeros((*q.shape[:-1], 3))
        rotations, places = [R], [p]
        for k, (K, K_K, point) in enumerate(self._turns):
            angle = q[..., k, None, None]
            turn = np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K_K
            p = (R @ (point - turn @ point)[..., None])[..., 0] + p
            R = R @ turn
            rotations.append(R)
            places.append(p)
        return np.stack(rotations, axis=-3), np.stack(places, axis=-2)


meshes_of = cache(ArmMeshes)


class Recount:
    """Distances of an arm's links from each other and from a scene, by SceneGraph.

    Args:
        meshes: The arm's meshes.
        solids: The scene.
    """

    def __init__(self, meshes: ArmMeshes, solids: tuple[Solid, ...]) -> None:
        self._meshes = meshes
        # What coal takes each geometry for, and the link that moves it.
        self._exact: dict[Any, tuple[Any, int]] = {}
        self._graph = graph = SceneGraph()
        self._source = graph.RegisterSource("arm")
        self._frames, links = [], list[Any]()
        for k, points in enumerate(meshes.points):
            frame = graph.RegisterFrame(self._source, GeometryFrame(f"link {k}"))
            links.append(self._add(frame, Convex(points.T, f"link {k}"), RigidTransform(), k))
            self._frames.append(frame)
        world = graph.world_frame_id()
        things = [self._add(world, _shape(solid), solid.X_WO, k) for k, solid in enumerate(solids)]
        self._exact = {each: (meshes.links[k], k) for k, each in enumerate(links)}
        for each, solid in zip(things, solids, strict=True):
            self._exact[each] = solid.exact(), -1
        poses = [(each.X_WO.rotation().matrix(), each.X_WO.translation()) for each in solids]
        self._things = dict(zip(things, (coal.Transform3s(*each) for each in poses), strict=True))
        apart = CollisionFilterDeclaration()
        if things:
            apart.ExcludeWithin(GeometrySet(things))
            bases = GeometrySet([links[k] for k in meshes.bases])
            apart.ExcludeBetween(bases, GeometrySet(things))
        for one, other in meshes.joined:
            apart.ExcludeBetween(GeometrySet(links[one]), GeometrySet(links[other]))
        graph.collision_filter_manager().Apply(apart)
        self._context = graph.CreateDefaultContext()

    def _add(self, frame: Any, shape: Any, X: RigidTransform, k: int) -> Any:
        instance = GeometryInstance(X, shape, f"{type(shape).__name__} {k} {frame}")
        geometry = self._graph.RegisterGeometry(self._source, frame, instance)
        self._graph.AssignRole(self._source, geometry, ProximityProperties())
        return geometry

    def gap(self, R: Array, p: Array) -> float:
        """Return the least distance of a posture, at most `FAR` [m].

        Args:
            R: Rotations of the links, of `ArmMeshes.poses`.
            p: Their displacements.
        """
        poses = FramePoseVector()
        for frame, turn, place in zip(self._frames, R, p, strict=True):
            poses.set_value(frame, RigidTransform(RotationMatrix(turn), place))
        self._graph.get_source_pose_port(self._source).FixValue(self._context, poses)
        query = self._graph.get_query_output_port().Eval(self._context)
        least = FAR
        for pair in query.ComputeSignedDistancePairwiseClosestPoints(FAR):
            distance = pair.distance
            if distance < NEAR:
                distance = self._of_triangles((pair.id_A, pair.id_B), R, p)
            least = min(least, distance)
        return least

    def _of_triangles(self, pair: tuple[Any, Any], R: Array, p: Array) -> float:
        """Return the distance of two geometries as they are [m], without their hulls."""
        (one, first), (other, second) = (self._exact[each] for each in pair)
        at = [
            self._things[each] if link < 0 else coal.Transform3s(R[link], p[link])
            for each, link in zip(pair, (first, second), strict=True)
        ]
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        return float(coal.distance(one, at[0], other, at[1], request, result))

    def least(self, q: Array) -> tuple[float, bool]:
        """Return the least distance along a motion, and whether something touches.

        Between two postures that are looked at no point of the arm moves farther than what is free
        at one of them; a motion ends where something touches.

        Args:
            q: The motion, shape (k, n) [rad].
        """
        moved = np.abs(np.diff(q, axis=0)) @ self._meshes.reach
        R, p = self._meshes.poses(q)
        way = np.concatenate(((0.0,), np.cumsum(moved)))
        least, k = FAR, 0
        while k < len(q):
            here = self.gap(R[k], p[k])
            far = int(np.searchsorted(way, way[k] + 0.9 * here, side="right"))
            if far <= k + 1 < len(q):
                # The next posture is farther away than what is free here.
                halves = self._meshes.poses(np.linspace(q[k], q[k + 1], 9)[1:-1])
                here = min(here, *map(self.gap, *halves))
            least = min(least, here)
            if here <= 0.0:
                return least, True
            k = max(far - 1, k + 1) if far < len(q) or k == len(q) - 1 else len(q) - 1
        return least, False


def _shape(solid: Solid) -> Any:
    """Return a solid for SceneGraph."""
    if solid.kind == "box":
        return Box(*solid.dimensions)
    if solid.kind == "cylinder":
        return Cylinder(solid.dimensions[1], solid.dimensions[0])
    return Sphere(*solid.dimensions)


def limits_of(arm: Arm) -> JointLimits:
    """Return the limits that are kept."""
    velocity = np.minimum(arm.limits.velocity, VELOCITY)
    return arm.limits.replace(velocity=velocity, acceleration=ACCELERATION, jerk=JERK)


def is_free(name: str, scene: Scene) -> bool:
    """Return whether an arm may start in a scene."""
    arm = arm_of(name)
    if arm.limits.violation(scene.start).any():
        return False
    solids = make_obstacles(scene.obstacles)
    clearance, _ = arm_clearance(arm, solids, arm.home)
    return bool((clearance.gaps(scene.start) - clearance.errors).min() > FREE)


def scene_of(name: str, kind: str, number: int, resources: Path) -> Scene:
    """Return a scene in which an arm may start."""
    arm = arm_of(name)
    if kind == "nothing":
        return Scene(arm.home, ())
    if kind == "balls":
        return _balls(name, number)
    whose = name if name in ("panda", "ur5") else "panda"
    for k in range(TRIES):
        first = 1 + (number // len(SCENARIOS) + 7 * k) % 100
        problems = problems_of(resources, whose, first, len(SCENARIOS))
        problem = problems[(number + k) % len(SCENARIOS)][1]
        scene = Scene(arm.home, problem.solids)
        if name in ("panda", "ur5", "fr3"):
            way = problem.goal - problem.start
            left = min(1.0, LAST / float(np.abs(way).max()))
            scene = Scene(problem.goal - left * way, problem.solids, problem.goal)
        if is_free(name, scene):
            return scene
    raise SystemExit(f"{name}: no scene of {TRIES} is free")


def _balls(name: str, number: int) -> Scene:
    """Return five balls round an arm at home."""
    arm, rng = arm_of(name), np.random.default_rng((number, 1))
    middle = arm.kinematics().p_WE(arm.home)
    balls: list[Solid] = []
    while len(balls) < BALLS:
        way = rng.normal(size=3)
        center = middle + way / np.linalg.norm(way) * rng.uniform(0.1, 0.4)
        ball = Solid("sphere", (rng.uniform(0.03, 0.08),), RigidTransform(center))
        if is_free(name, Scene(arm.home, (*balls, ball))):
            balls.append(ball)
    return Scene(arm.home, tuple(balls))


def motion(rng: np.random.Generator, home: Array, goal: Array | None = None) -> Any:
    """Return a smooth motion, on the way to a goal if there is one, as a function of times."""
    far = np.zeros(home.size) if goal is None else goal - home
    size, rate = rng.uniform(0.02, 0.25, home.size), rng.uniform(0.1, 0.4, home.size)
    phase = rng.uniform(0.0, 2.0 * np.pi, home.size)

    def at(t: Array) -> Array:
        turn = 2.0 * np.pi * rate * np.asarray(t)[..., None] + phase
        part = np.clip(np.asarray(t) / ENDS, 0.0, 1.0)[..., None]
        way = part**2 * (3.0 - 2.0 * part) * far
        return np.asarray(home + way + size * (np.sin(turn) - np.sin(phase)))

    return at


def messages(rng: np.random.Generator, smooth: Any, pose_of: Any) -> list[Message]:
    """Return the chunks of a stream, in the order in which they come."""
    rows, rate = int(rng.integers(8, 51)), rng.uniform(10.0, 50.0)
    delay, wrong = rng.uniform(0.0, 0.8), rng.choice([0.0, 0.05, 0.3])
    every = rng.uniform(0.3, 0.8) * rows / rate
    sent, t = list[Message](), 0.0
    while t < ENDS:
        times = t + np.arange(rows) / rate
        q = smooth(times) + rng.uniform(-wrong, wrong, smooth(times).shape[1])
        q = q + 1e-3 * rng.normal(size=q.shape)
        values = q.copy() if pose_of is None else np.array([pose_of(each) for each in q])
        if rng.random() < 0.2:
            bad = rng.integers(rows)
            values[bad, rng.integers(values.shape[1])] = q[bad] = np.nan
        if rng.random() > 0.05:
            late = 0.5 * rng.random() if rng.random() < 0.1 else 0.0
            sent.append(Message(t + delay + late, t, rate, values, q))
        t += every
    return sorted(sent, key=lambda each: each.arrives)


def clamp(limits: JointLimits, home: Array, _: Any) -> Any:
    """Return what caps each change of the position, as LeRobot's robots can."""
    q = home

    def follow(target: Array | None) -> Array:
        nonlocal q
        if target is not None and np.isfinite(target).all():
            most = VELOCITY * PERIOD
            inside = np.clip(target, limits.position_lower, limits.position_upper)
            q = q + np.clip(inside - q, -most, most)
        return q

    return follow


OTHERS = {"Ruckig": ruckig, "klimits": klimits, "low pass of 3 Hz": low_pass, "clamp": clamp}


def _others(sent: list[Message]) -> list[Array | None]:
    """Return where the newest chunk is at each sample, for those that take no chunks."""
    targets, newest, k = list[Array | None](), None, 0
    for t in PERIOD * np.arange(round(DURATION / PERIOD)):
        while k < len(sent) and sent[k].arrives <= t:
            if newest is None or sent[k].start >= newest.start:
                newest = sent[k]
                whole = np.isfinite(newest.postures).all(axis=1)
                times = (newest.start + np.arange(len(whole)) / newest.rate)[whole]
                rows = newest.postures[whole]
            k += 1
        if newest is None:
            targets.append(None)
            continue
        after = min(max(int(np.searchsorted(times, t)), 1), len(times) - 1)
        share = (t - times[after - 1]) / (times[after] - times[after - 1])
        share = min(max(share, 0.0), 1.0)
        targets.append((1.0 - share) * rows[after - 1] + share * rows[after])
    return targets


class Stream(NamedTuple):
    """A stream for an arm in a scene."""

    arm: Arm
    scene: Scene
    limits: JointLimits
    by_poses: bool
    smooth: Any
    sent: list[Message]


def stream_of(seed: tuple[int, ...], name: str, scene: Scene) -> Stream:
    """Return a stream; the last number of its seed says whether it is of poses."""
    arm, rng = arm_of(name), np.random.default_rng(seed)
    kinematics, by_poses = arm.kinematics(), seed[-1] % 2 == 1

    def pose_of(q: Array) -> Array:
        R = RotationMatrix(kinematics.R_WE(q))
        return np.concatenate((kinematics.p_WE(q), R.ToQuaternion().wxyz()))

    smooth = motion(rng, scene.start, scene.goal)
    sent = messages(rng, smooth, pose_of if by_poses else None)
    return Stream(arm, scene, limits_of(arm), by_poses, smooth, sent)


def shielded(stream: Stream, *, on_path: bool) -> dict[str, Any]:
    """Return what a shield commands, and what it says of it."""
    settings = ShieldSettings(on_path=on_path, compiled=True)
    shield = Shield(
        stream.arm,
        PERIOD,
        settings,
        start=stream.scene.start,
        limits=stream.limits,
        obstacles=stream.scene.padded,
    )
    follow = shield.follow_poses if stream.by_poses else shield.follow_positions
    q, v, k, refused = [shield.position], [np.zeros(stream.arm.n)] * 3, 0, list[str]()
    took = 0.0
    for t in PERIOD * np.arange(round(DURATION / PERIOD)):
        began = time.process_time()
        while k < len(stream.sent) and stream.sent[k].arrives <= t:
            message = stream.sent[k]
            try:
                follow(message.values, message.rate, message.start, t)
            except InvalidInputError as error:
                refused.append(str(error))
            k += 1
        q.append(shield.command(t))
        took += time.process_time() - began
        v.append(shield.velocity)
    velocities = np.array(v)
    return {
        "q": np.array(q),
        "took": took,
        "refused": refused,
        "uncertified": shield.uncertified,
        "exact": _beyond(velocities, stream.limits),
        "summed": float(np.abs(q[0] + PERIOD * np.cumsum(velocities[3:], 0) - q[1:]).max()),
    }


def run(
    stream: Stream, recount: Recount, *, beside: bool
) -> tuple[dict[str, Any], dict[str, Array]]:
    """Return what a stream comes to, and the motions, by who follows it."""
    found, motions = dict[str, Any](), dict[str, Array]()
    # On the path alone postures wait; the way of poses goes on.
    for on_path in (False,) if stream.by_poses else (False, True):
        name = "shield, on its path" if on_path else "shield"
        try:
            made = shielded(stream, on_path=on_path)
        except Exception:
            found[name] = {"exception": traceback.format_exc()}
            continue
        motions[name] = q = made.pop("q")
        took = made.pop("took")
        found[name] = {**figures(q, took, stream, recount), **made}
    targets = _others(stream.sent) if beside else []
    for name, follower in OTHERS.items() if beside else ():
        other, began = follower(stream.limits, stream.scene.start, None), time.process_time()
        q = np.array([stream.scene.start, *(other(target) for target in targets)])
        found[name] = figures(q, time.process_time() - began, stream, recount)
        motions[name] = q
    return found, motions


def _beyond(v: Array, limits: JointLimits) -> list[float]:
    """Return by which shares velocities pass the limits of v, a and jerk."""
    orders = (limits.velocity, limits.acceleration, limits.jerk)
    return [
        float((np.abs(np.diff(v, n=k, axis=0)) / PERIOD**k / bound).max() - 1.0)
        for k, bound in enumerate(orders)
    ]


def figures(q: Array, took: float, stream: Stream, recount: Recount) -> dict[str, Any]:
    """Return how a motion keeps limits and distances, and how it follows."""
    arm, limits = stream.arm, stream.limits
    kinematics = arm.kinematics()
    v = np.diff(np.vstack((q[:1],) * 3 + (q,)), axis=0) / PERIOD
    t = PERIOD * np.arange(len(q))
    some = slice(round(1.0 / PERIOD), round(ENDS / PERIOD))
    late, step = range(0, 1000, 10), PERIOD
    true, real = stream.smooth(t), q
    if stream.by_poses:
        true, real = (np.array([kinematics.p_WE(each) for each in x[::5]]) for x in (true, q))
        some, late, step = slice(some.start // 5, some.stop // 5), range(0, 200, 2), 5.0 * PERIOD
    errors = [
        ((real[some] - true[some.start - k : some.stop - k]) ** 2).sum(axis=1).mean() for k in late
    ]
    least, collided = recount.least(q)
    return {
        "limits": [float(limits.violation(q).max()), *_beyond(v, limits)],
        "distance": least,
        "collided": collided,
        "error": float(np.sqrt(errors[0])),
        "delay": step * late[int(np.argmin(errors))],
        "us": 1e6 * took / len(q),
    }


def seeds(options: argparse.Namespace) -> list[tuple[int, int, int, int]]:
    """Return round, arm, kind of scene and number of each stream, in the order of runs."""
    return list(islice(_all_seeds(options.arms), options.first - 1, options.streams))


def _all_seeds(arms: list[str]) -> Iterator[tuple[int, int, int, int]]:
    for number in range(10_000):
        groups = [(arm, kind) for arm in range(len(ARMS)) for kind in range(len(KINDS))]
        for k in np.random.default_rng(number).permutation(len(groups)):
            arm, kind = groups[k]
            for each in range(GROUP) if ARMS[arm] in arms else ():
                yield number, arm, kind, each


def run_all(options: argparse.Namespace) -> None:
    """Run the streams that are not kept yet."""
    known = _kept(options.kept)
    left = [seed for seed in seeds(options) if seed not in known]
    for place, group in groupby(left, lambda seed: seed[:3]):
        number, name, kind = place[0], ARMS[place[1]], KINDS[place[2]]
        scene = scene_of(name, kind, number, options.resources)
        recount = Recount(meshes_of(name, tuple(options.folder)), scene.solids)
        judge, waiting = options.judge if name == "fr3" else None, []
        for seed in group:
            stream = stream_of(seed, name, scene)
            found, motions = run(stream, recount, beside=not options.shield_alone)
            found = {"seed": seed, "poses": stream.by_poses, **found}
            waiting.append((found, motions))
            if judge is None:
                _keep(options.kept, [waiting.pop()[0]])
        if waiting:
            _judge(judge, waiting)
            _keep(options.kept, [found for found, _ in waiting])


def _judge(python: str, streams: list[tuple[dict[str, Any], dict[str, Array]]]) -> None:
    """Add what franka-sim objects to in motions: as velocities, and as positions."""
    ways = [(found[name], q) for found, motions in streams for name, q in motions.items()]
    with TemporaryDirectory() as folder:
        file = Path(folder) / "commands.npz"
        velocity = [np.diff(q, axis=0) / PERIOD for _, q in ways]
        np.savez(file, start=[q[0] for _, q in ways], velocity=velocity)
        judge = Path(__file__).with_name("fr3_judge.py")
        done = subprocess.run([python, judge, file], capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"--judge: {python} could not judge: {done.stderr.strip()[-400:]}")
    for (found, _), judged in zip(ways, json.loads(done.stdout), strict=True):
        found["objections"] = judged


def _keep(file: Path, streams: list[dict[str, Any]]) -> None:
    with file.open("a") as lines:
        lines.writelines(json.dumps(each) + "\n" for each in streams)


def _kept(file: Path) -> dict[tuple[int, ...], dict[str, Any]]:
    """Return what is kept of streams, by their seeds."""
    lines = map(json.loads, file.read_text().splitlines()) if file.exists() else ()
    return {tuple(line["seed"]): line for line in lines}


def print_table(options: argparse.Namespace) -> None:
    """Print a table of streams of joint positions and one of poses."""
    known = _kept(options.kept)
    streams = [known[seed] for seed in seeds(options) if seed in known]
    for by_poses, unit in ((False, "mrad"), (True, "mm")):
        some = [each for each in streams if each["poses"] == by_poses]
        if not some:
            continue
        print()
        errors = (f"rms error [{unit}]", "delay [ms]", "µs")
        beyond = ("streams beyond q", "v", "a", "jerk")
        head("by", "streams", *beyond, "collided", "least distance [mm]", *errors)
        for name in ("shield", "shield, on its path", *OTHERS):
            if all(name in each for each in some):
                _print_row(name, [each[name] for each in some])

    judged = [each for each in streams if "objections" in each.get("Ruckig", {})]
    if judged:
        print()
        head("by", "streams of an FR3", "reflexes by velocities", "by positions", "the first")
    for name in ("shield", "shield, on its path", *OTHERS) if judged else ():
        said = [each[name]["objections"] for each in judged if name in each]
        counts = [sum(each[way][0] > 0 for each in said) for way in ("velocity", "position")]
        words = [each["position"][1] or each["velocity"][1] for each in said]
        row(name, len(said), *counts, next((word for word in words if word), "-"))


def _print_row(name: str, streams: list[dict[str, Any]]) -> None:
    """Print the row of one that follows."""
    failed = [each for each in streams if "exception" in each]
    went = [each for each in streams if "exception" not in each]
    of = {key: np.array([each[key] for each in went]) for key in ("distance", "collided")}
    medians = {key: np.nanmedian([each[key] for each in went]) for key in ("error", "delay", "us")}
    beyond = [[each["limits"][0] > EXACT, *_passed(each)] for each in went]
    row(
        name + (f" ({len(failed)} exceptions)" if failed else ""),
        len(streams),
        *np.sum(beyond, axis=0),
        int(of["collided"].sum()),
        f"{1e3 * of['distance'].min():.2f}",
        *(f"{1e3 * medians['error']:.1f}", f"{1e3 * medians['delay']:.0f}"),
        f"{medians['us']:.0f}",
    )


def _passed(stream: dict[str, Any]) -> list[bool]:
    """Return whether limits of v, a and jerk are passed."""
    if "exact" in stream:
        return [beyond > EXACT for beyond in stream["exact"]]
    return [beyond > ROUNDED for beyond in stream["limits"][1:]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("resources", metavar="FOLDER", type=Path, help="the unpacked distribution")
    parser.add_argument("--streams", type=int, default=300, help="number of the last stream")
    parser.add_argument("--first", type=int, default=1, help="number of the first")
    parser.add_argument("--arms", nargs="+", choices=ARMS, default=list(ARMS))
    parser.add_argument("--shield-alone", action="store_true", help="the others are left out")
    parser.add_argument("--table", action="store_true", help="print what is kept, and run nothing")
    add_folders(parser)
    add_judge(parser)
    add_kept(parser)
    options = parser.parse_args()
    options.resources = options.resources / "resources"
    if options.kept is None:
        parser.error("--kept is needed")
    if not options.table:
        run_all(options)
    print_table(options)


if __name__ == "__main__":
    main()
