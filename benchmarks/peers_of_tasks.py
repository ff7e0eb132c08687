"""A base, an axis, a remote centre of motion and two tools: peers and our law on four tasks.

Print the tables: python benchmarks/peers_of_tasks.py [--task base]. It needs the extra ``peers``.
Each task is a shipped experiment without its obstacles. Peers do it with tasks of their library,
beside those of the other comparisons. They are given a target for the next sample, and are
linearised at the sample or at its middle. Of a grid of settings (`GRID`) each has the one with the
least error at the end of the first seconds that keeps all bounds; so has our law, beside a row as
it is shipped.
"""

from __future__ import annotations

import argparse
import logging
from abc import abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import product
from math import atan2, sqrt
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, ClassVar, NamedTuple
from xml.etree import ElementTree

import embodik
import mink
import mujoco
import numpy as np
import pink
import pinocchio
import placo
from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit
from pink.tasks import FrameTask, PostureTask, RelativeFrameTask

from drake_rnn import Array, Experiment, load_experiment, make_experiment
from drake_rnn.robot.rotation import rotation_error
from drake_rnn.robot.task_frame import pose_of
from drake_rnn.signals import AHEAD, SIGNALS, DelayedPath, View
from peer_schemes.mink_scheme import _AccelerationLimit as OwnLimit
from peer_schemes.ours import CompiledLoop
from peer_schemes.scheme import Motion, NoSolutionError, Scheme, run
from peer_schemes.tasks import LEVER, POSITION, POSTURE_RATE, Braking, Task
from peer_schemes.turns import rotated_by, swept, twice_turned

_TOLERANCES = {"primal_tol": 1e-11, "dual_tol": 1e-11}
#: Excess over a bound that is rounding or a solver's tolerance [share of the bound].
_KEPT = 1e-6
#: Angle to its target below which placo's axis task is given one beside it [rad].
_ALIGNED = 1e-11


class Setting(NamedTuple):
    """What is chosen for each peer.

    Attributes:
        weight: Length by which the second objective is weighed against the position, times that at
            which both count the same.
        posture: Weight of the posture beside the task.
        gain: Largest gain of the feedback [1/s].
        depth: How far ahead the point is that the shaft is to pass through, as a multiple of its
            distance; 1 but where a library's derivative asks for another.
    """

    weight: float = 1.0
    posture: float = 1e-6
    gain: float = 1000.0
    depth: float = 1.0

    def __str__(self) -> str:
        text = f"{self.weight:g}, {self.posture:.0e}, {self.gain:g}/s"
        return text if self.depth == 1.0 else f"{text}, depth {self.depth:g}"


#: All settings that are tried.
GRID = tuple(Setting(*each) for each in product((0.3, 1.0, 3.0), (1e-6, 1e-8), (1000.0, 100.0)))
#: The same for our law: the price of the task's error, which is what the posture weighs beside it.
_SOFTNESSES = (1e-6, 1e-8)


class Pose(NamedTuple):
    """A position, shape (3,) [m], and an orientation, shape (3, 3)."""

    p: Array
    R: Array

    def relative_to(self, other: Pose) -> Pose:
        """Return the same as it is seen from another pose."""
        return Pose(other.R.T @ (self.p - other.p), other.R.T @ self.R)


class Aim(NamedTuple):
    """What is to be reached in one sample.

    Attributes:
        tool: Pose of the tool; its orientation is free but for two tools.
        relative: Pose of the second tool, seen from the first; None without one.
        axis: Direction of the tool's z axis, shape (3,); None without one.
        point: Point that this axis is to pass through, shape (3,) [m]; None without one.
    """

    tool: Pose
    relative: Pose | None = None
    axis: Array | None = None
    point: Array | None = None


def _turn_between(a: Array, b: Array) -> Array:
    """Return the rotation vector that turns a direction into another one, shape (3,)."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    normal = np.array((y * w - z * v, z * u - x * w, x * v - y * u))
    size = sqrt(normal @ normal)
    return normal if size == 0.0 else atan2(size, x * u + y * v + z * w) / size * normal


def _beside(pose: Pose, point: Array) -> Array:
    """Return how far a point is beside a tool's z axis, in the world, shape (3,) [m]."""
    way, axis = point - pose.p, pose.R[:, 2]
    return np.asarray(way - (way @ axis) * axis)


class Job(Task):
    """A shipped experiment as a task of peers.

    Args:
        experiment: Name of the experiment.
        kind: ``base``, ``axis``, ``remote centre`` or ``two tools``.
    """

    #: Name of the experiment of each kind, what is off there with its unit, and seconds of a trial.
    kinds: ClassVar[dict[str, tuple[str, tuple[str, ...], float]]] = {
        "base": ("adaptive_base", ("position [nm]",), 6.0),
        "axis": ("adaptive_upright", ("position [nm]", "axis [nrad]"), 4.0),
        "remote centre": ("adaptive_remote_centre", ("tip [nm]", "shaft [nm]"), 3.0),
        "two tools": (
            "adaptive_two_tools",
            ("centre [nm]", "centre [nrad]", "relative [nm]", "relative [nrad]"),
            3.0,
        ),
    }

    def __init__(self, kind: str, duration: float | None = None) -> None:
        name, self.columns, _ = self.kinds[kind]
        document = dict(load_experiment(name).document.contents())
        if kind == "two tools":
            # From a start on the path.
            document["path"] = {k: v for k, v in document["path"].items() if k != "offset"}
            document |= {"duration": 10.0, "window": [6.0, 10.0]}
        if duration is not None:
            document |= {"duration": duration, "window": [0.75 * duration, duration]}
        left_out = {"accept", "obstacles"}
        experiment = make_experiment({k: v for k, v in document.items() if k not in left_out})
        super().__init__(kind, experiment, 1.0, oriented=False)
        self.kind = kind
        kinematics = experiment.arm.kinematics()
        self.first = Pose(kinematics.p_WE(self.start), np.asarray(kinematics.R_WE(self.start)))
        self.relative: Pose | None = None
        if kind == "two tools":
            names = ("first", "relative", "centre")
            first, relative, centre = (pose_of(kinematics, self.start, each) for each in names)
            self.first = Pose(first.p_WE, np.asarray(first.R))
            self.relative = Pose(relative.p_WE, np.asarray(relative.R))
            # The centre keeps its orientation: with the relative pose held, the tool goes along.
            self.p_WE = self.p_WE + first.p_WE - centre.p_WE
        axis, depth = self.first.R[:, 2], 0.2
        self.axis = np.array([0.0, 0.0, -1.0]) if kind == "axis" else None
        self.point = self.first.p - depth * axis if kind == "remote centre" else None
        self.urdf = urdf_of(experiment, self.point)
        # Length at which an angle counts as much as a position does.
        self.lever = 1.0 if kind == "remote centre" else LEVER

    def aim(self, k: int, tool: Pose, braking: Braking) -> Aim:
        """Return where all is to be at sample ``k + 1``."""
        R = tool.R if self.relative is None else self.first.R
        p, axis, point = self.target(k, tool.p, braking), self.axis, self.point
        if axis is not None:
            turn = _turn_between(tool.R[:, 2], axis)
            share = braking.share(sqrt(turn @ turn), self.period)
            axis = rotated_by(share * turn, tool.R)[:, 2]
        if point is not None:
            beside = _beside(tool, point)
            share = braking.share(sqrt(beside @ beside), self.period)
            point = point - (1.0 - share) * beside
        return Aim(Pose(p, R), self.relative, axis, point)

    def errors(self, motion: Motion) -> list[float]:
        """Return the largest errors in the window, by Drake's kinematics [m, rad]."""
        kinematics, h = self.arm.kinematics(), self.period
        held = (
            {each: pose_of(kinematics, self.start, each) for each in ("centre", "relative")}
            if (self.relative)
            else {}
        )
        worst = np.zeros(len(self.columns))
        for k in range(self.window.start, self.window.stop):
            q = motion.position[k]
            aim = self.experiment.desired.position(k * h)[0]
            if self.relative is not None:
                places = zip(held, (aim, held["relative"].p_WE), strict=True)
                found = []
                for name, p in places:
                    pose = pose_of(kinematics, q, name)
                    turn = rotation_error(pose.R, held[name].R)
                    found += [np.linalg.norm(pose.p_WE - p), np.linalg.norm(turn)]
            else:
                tool = Pose(kinematics.p_WE(q), np.asarray(kinematics.R_WE(q)))
                found = [np.linalg.norm(tool.p - aim)]
                if self.axis is not None:
                    found.append(np.linalg.norm(_turn_between(tool.R[:, 2], self.axis)))
                if self.point is not None:
                    found.append(np.linalg.norm(_beside(tool, self.point)))
            worst = np.maximum(worst, found)
        return worst.tolist()

    def excess(self, motion: Motion) -> float:
        """Return by which share a bound of position, velocity or acceleration is exceeded."""
        v, limits = motion.velocity, self.limits
        before = np.vstack((np.zeros((1, v.shape[1])), v[:-1]))
        ratios = np.abs(v) / limits.velocity, np.abs(v - before) / self.period / limits.acceleration
        beyond = np.maximum(
            limits.position_lower - motion.position, motion.position - limits.position_upper
        )
        return float(max(*(each.max() - 1.0 for each in ratios), beyond.max()))


class _Model:
    """The arm's model in URDF without shapes, to which links and joints are added."""

    def __init__(self, experiment: Experiment) -> None:
        self._experiment, self.arm = experiment, experiment.arm
        self.root = ElementTree.fromstring(self.arm.model_text)
        for link in self.root.iter("link"):
            for shape in (*link.findall("visual"), *link.findall("collision")):
                link.remove(shape)
        self.links = {link.attrib["name"] for link in self.root.findall("link")}
        children = {joint.find("child").attrib["link"] for joint in self.root.findall("joint")}
        (self._first,) = self.links - children

    def _link(self, name: str, parent: str, place: Array, joint: str = "", axis: str = "") -> None:
        """Add a link, on a joint that moves if it has an axis."""
        ElementTree.SubElement(self.root, "link", name=name)
        self._join(name, parent, place, joint, axis)

    def _join(self, name: str, parent: str, place: Array, joint: str = "", axis: str = "") -> None:
        kind = {"": "fixed", "0 0 1": "revolute"}.get(axis, "prismatic")
        element = ElementTree.SubElement(self.root, "joint", name=joint or f"{name}_on", type=kind)
        text = " ".join(repr(float(x)) for x in place)
        ElementTree.SubElement(element, "origin", xyz=text, rpy="0 0 0")
        ElementTree.SubElement(element, "parent", link=parent)
        ElementTree.SubElement(element, "child", link=name)
        if axis:
            ElementTree.SubElement(element, "axis", xyz=axis)
            bounds = {"lower": "-100", "upper": "100", "velocity": "100", "effort": "1000"}
            ElementTree.SubElement(element, "limit", bounds)

    def _way(self, parent: str | None, child: str) -> Array:
        """Return where a frame stands on another one, which it is not turned against [m]."""
        plant = self.arm.plant()
        frame = plant.world_frame() if parent is None else plant.GetFrameByName(parent)
        context = plant.CreateDefaultContext()
        X = plant.CalcRelativeTransform(context, frame, plant.GetFrameByName(child))
        assert np.allclose(X.rotation().matrix(), np.eye(3), rtol=0.0, atol=1e-12)
        return np.asarray(X.translation())

    def add_base(self) -> None:
        """Add the joints of a mobile base below the arm."""
        place = self._way(None, self._first)
        ElementTree.SubElement(self.root, "link", name="floor")
        parent = "floor"
        for joint, axis in zip(self.arm.joints, ("1 0 0", "0 1 0", "0 0 1"), strict=False):
            self._link(f"{joint}_link", parent, np.zeros(3), joint, axis)
            parent = f"{joint}_link"
        self._join(self._first, parent, place)

    def add_tool(self, port: Array) -> None:
        """Add the tool and, to the world, the port that its shaft goes through."""
        self._link(self.arm.frame, "panda_link8", self._way("panda_link8", self.arm.frame))
        self._link("port", self._first, port)


def urdf_of(experiment: Experiment, port: Array | None) -> str:
    """Return the arm's model without shapes, on the joints of its base, with tool and port."""
    model = _Model(experiment)
    if experiment.arm.base is not None:
        model.add_base()
    if port is not None:
        model.add_tool(port)
    return ElementTree.tostring(model.root, encoding="unicode")


class Peer(Scheme):
    """A library with its tasks for a job.

    Args:
        task: The job.
        setting: What is chosen.
    """

    task: Job
    does: ClassVar[frozenset[str]] = frozenset(Job.kinds)
    in_the_middle: ClassVar[bool] = False
    #: Whether the library takes the way to a target for a twist, see `AimedScheme`.
    follows_twists: ClassVar[bool] = False
    #: Multiples of the depth that are tried for a remote centre.
    depths: ClassVar[tuple[float, ...]] = (1.0,)

    def __init__(self, task: Job, setting: Setting) -> None:
        super().__init__(task)
        self.chosen = setting
        self.braking = replace(POSITION, gain=setting.gain)
        self.frames = task.arm.frames

    @abstractmethod
    def poses(self, q: Array) -> tuple[Pose, Pose | None]:
        """Return the poses of the tool, and of the second one as seen from it."""

    def home(self, q: Array) -> Array:
        """Return where the posture is to be in a sample, no faster than joints may be."""
        most, h = self.task.limits.velocity, self.task.period
        return q + h * np.clip(POSTURE_RATE * (self.task.start - q), -most, most)

    @abstractmethod
    def towards(self, aim: Aim, q: Array, v: Array, tool: Pose) -> Array:
        """Return the velocity that leads to an aim, from a posture at which the library is."""

    def pose(self, q: Array) -> tuple[Array, Array]:
        return self.poses(q)[0]

    def velocity(self, k: int, q: Array, v: Array) -> Array:
        job, h = self.task, self.task.period
        here, seen = self.poses(q)
        aim = job.aim(k, here, self.braking)
        if not self.in_the_middle:
            return self.towards(aim, q, v, here)
        middle = q + 0.5 * h * v
        there, seen_there = self.poses(middle)
        way, free = aim.tool.p - here.p, job.relative is None
        turn = twice_turned(here.R, there.R) if free else rotation_error(here.R, aim.tool.R)
        if self.follows_twists:
            way = swept(way, turn)
        relative, axis, point = aim.relative, aim.axis, aim.point
        if relative is not None and seen is not None and seen_there is not None:
            turned = rotated_by(rotation_error(seen.R, relative.R), seen_there.R)
            relative = Pose(seen_there.p + relative.p - seen.p, turned)
        if axis is not None:
            axis = rotated_by(_turn_between(here.R[:, 2], axis), there.R)[:, 2]
        if point is not None:
            off = there.R @ here.R.T @ _beside(here, point)
            point = point + off - _beside(there, point)
        R = rotated_by(turn, there.R)
        return self.towards(Aim(Pose(there.p + way, R), relative, axis, point), middle, v, there)


def in_the_middle(kind: type[Peer]) -> type[Peer]:
    """Return a peer that is linearised at the middle of the sample."""
    about = {"name": f"{kind.name}, midpoint", "in_the_middle": True}
    return type(f"{kind.__name__}InTheMiddle", (kind,), about)


class Pink(Peer):
    """pink: frame tasks with costs along each axis, and its three limits."""

    name = "pink"
    setting = ""
    follows_twists = True
    # At twice the depth its derivative of the logarithm is that of the way beside the shaft.
    depths = (1.0, 2.0)

    def __init__(self, task: Job, setting: Setting) -> None:
        super().__init__(task, setting)
        model, limits = pinocchio.buildModelFromXML(task.urdf), task.limits
        model.velocityLimit = limits.velocity.copy()
        model.lowerPositionLimit = limits.position_lower.copy()
        model.upperPositionLimit = limits.position_upper.copy()
        self._configuration = pink.Configuration(model, model.createData(), task.start)
        first, weight = self.frames[0], task.lever * setting.weight
        held = task.relative is not None
        self._tool = FrameTask(first, position_cost=1.0, orientation_cost=LEVER if held else 0.0)
        self._posture = PostureTask(cost=setting.posture**0.5, gain=1.0)
        self._tasks: list[Any] = [self._tool, self._posture]
        if held:
            costs = {"position_cost": 1.0, "orientation_cost": weight}
            self._second: Any = RelativeFrameTask(self.frames[1], first, **costs)
        elif task.axis is not None:
            self._second = FrameTask(
                first, position_cost=0.0, orientation_cost=[weight, weight, 0.0]
            )
        elif task.point is not None:
            self._second = FrameTask(
                first, position_cost=[weight, weight, 0.0], orientation_cost=0.0
            )
        if task.kind != "base":
            self._tasks.append(self._second)
        self._acceleration = AccelerationLimit(model, limits.acceleration)
        self._limits = (ConfigurationLimit(model), VelocityLimit(model), self._acceleration)

    def poses(self, q: Array) -> tuple[Pose, Pose | None]:
        self._configuration.update(q)
        places = map(self._configuration.get_transform_frame_to_world, self.frames)
        tools = [Pose(X.translation.copy(), X.rotation.copy()) for X in places]
        return tools[0], tools[1].relative_to(tools[0]) if len(tools) == 2 else None

    def towards(self, aim: Aim, q: Array, v: Array, tool: Pose) -> Array:
        task = self.task
        self._tool.set_target(pinocchio.SE3(aim.tool.R, aim.tool.p))
        if aim.relative is not None:
            self._second.set_target(pinocchio.SE3(aim.relative.R, aim.relative.p))
        if aim.axis is not None:
            turned = rotated_by(_turn_between(tool.R[:, 2], aim.axis), tool.R)
            self._second.set_target(pinocchio.SE3(turned, tool.p))
        if aim.point is not None:
            way, axis = aim.point - tool.p, tool.R[:, 2]
            ahead = (self.chosen.depth - 1.0) * (way @ axis)
            self._second.set_target(pinocchio.SE3(tool.R, aim.point + ahead * axis))
        self._posture.set_target(self.home(q))
        self._acceleration.set_last_integration(v, task.period)
        choices = {"solver": "daqp", "limits": self._limits, "safety_break": False}
        try:
            return pink.solve_ik(
                self._configuration, self._tasks, task.period, **choices, **_TOLERANCES
            )
        except pink.exceptions.NoSolutionFound as error:
            raise NoSolutionError from error


class Mink(Peer):
    """mink: frame, axis and look-at tasks; of accelerations it has no limit but the user's own."""

    name = "mink, own limit"
    setting = ""
    follows_twists = True

    def __init__(self, task: Job, setting: Setting) -> None:
        super().__init__(task, setting)
        root = ElementTree.fromstring(task.urdf)
        compiler = {"fusestatic": "false", "balanceinertia": "true", "boundmass": "1e-3"}
        compiler["boundinertia"] = "1e-6"
        ElementTree.SubElement(ElementTree.SubElement(root, "mujoco"), "compiler", compiler)
        model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
        limits = task.limits
        is_bounded = np.isfinite(limits.position_upper - limits.position_lower)
        model.jnt_limited[:] = is_bounded
        bounds = np.stack((limits.position_lower, limits.position_upper), axis=1)
        model.jnt_range[is_bounded] = bounds[is_bounded]
        self._configuration = mink.Configuration(model, q=task.start)
        first, weight = self.frames[0], task.lever * setting.weight
        held = task.relative is not None
        self._tool = mink.FrameTask(
            first, "body", position_cost=1.0, orientation_cost=LEVER if held else 0.0
        )
        self._posture = mink.PostureTask(model, cost=setting.posture**0.5, gain=1.0)
        self._tasks: list[Any] = [self._tool, self._posture]
        if held:
            costs = {"position_cost": 1.0, "orientation_cost": weight}
            self._second: Any = mink.RelativeFrameTask(
                self.frames[1], "body", first, "body", **costs
            )
        elif task.axis is not None:
            self._second = mink.AxisAlignTask(first, "body", [0.0, 0.0, 1.0], weight)
        elif task.point is not None:
            # It looks back along the shaft; an angle at the depth of the point.
            self._second = mink.LookAtTask(first, "body", [0.0, 0.0, -1.0], 0.2 * weight)
        if task.kind != "base":
            self._tasks.append(self._second)
        velocity = dict(zip(task.arm.joints, limits.velocity.tolist(), strict=True))
        self._own = OwnLimit(limits.acceleration)
        self._limits = [
            *(mink.ConfigurationLimit(model), mink.VelocityLimit(model, velocity), self._own)
        ]

    def poses(self, q: Array) -> tuple[Pose, Pose | None]:
        self._configuration.update(q)
        places = (
            self._configuration.get_transform_frame_to_world(frame, "body") for frame in self.frames
        )
        tools = [Pose(X.translation(), X.rotation().as_matrix()) for X in places]
        return tools[0], tools[1].relative_to(tools[0]) if len(tools) == 2 else None

    def towards(self, aim: Aim, q: Array, v: Array, tool: Pose) -> Array:
        same = not self.in_the_middle and aim.relative is None
        # At the present orientation its derivative ignores the rotation; another free one will do.
        self._set(self._tool, Pose(aim.tool.p, self.task.R_WE[0] if same else aim.tool.R))
        if aim.relative is not None:
            self._set(self._second, aim.relative)
        for target in (aim.axis, aim.point):
            if target is not None:
                self._second.set_target(target)
        self._posture.set_target(self.home(q))
        self._own.last = v
        try:
            return mink.solve_ik(
                *(self._configuration, self._tasks, self.task.period, "daqp"),
                limits=self._limits,
                **_TOLERANCES,
            )
        except mink.NoSolutionFound as error:
            raise NoSolutionError from error

    @staticmethod
    def _set(task: Any, pose: Pose) -> None:
        R = mink.SO3.from_matrix(pose.R)
        task.set_target(mink.SE3.from_rotation_and_translation(R, pose.p))


class Placo(Peer):
    """placo: position, orientation, axis and relative tasks; accelerations as half-spaces."""

    name = "placo"
    setting = ""
    #: Whether it holds an axis by its own task, and not by an orientation of which one is free.
    has_axis_task: ClassVar[bool] = False

    def __init__(self, task: Job, setting: Setting) -> None:
        super().__init__(task, setting)
        with TemporaryDirectory() as folder:
            file = Path(folder) / "arms.urdf"
            file.write_text(task.urdf)
            robot = placo.RobotWrapper(str(file), placo.Flags.ignore_collisions)
        limits, n, weight = task.limits, task.arm.n, task.lever * setting.weight
        for k, joint in enumerate(task.arm.joints):
            bounds = limits.position_lower[k], limits.position_upper[k]
            if np.isfinite(bounds).all():
                robot.set_joint_limits(joint, *map(float, bounds))
            robot.set_velocity_limit(joint, float(limits.velocity[k]))
        self._robot, self._solver = robot, placo.KinematicsSolver(robot)
        solver = self._solver
        solver.mask_fbase(True)
        solver.dt = task.period
        solver.enable_velocity_limits(True)
        solver.enable_joint_limits(True)
        self._add_tasks(task, weight)
        self._posture = solver.add_joints_task()
        self._posture.configure("posture", "soft", setting.posture)
        # The state begins with the pose of a base that does not move here.
        A = np.zeros((2 * n, robot.state.q.size))
        A[:n, -n:], A[n:, -n:] = np.eye(n), -np.eye(n)
        self._room = task.period**2 * limits.acceleration
        self._bounds = solver.add_joint_space_half_spaces_constraint(A, np.zeros(2 * n))
        self._bounds.configure("acceleration", "hard", 1.0)

    def _add_tasks(self, task: Job, weight: float) -> None:
        solver, first = self._solver, self.frames[0]
        self._position = solver.add_position_task(first, np.zeros(3))
        self._position.configure("position", "soft", 1.0)
        if task.relative is not None:
            second = self.frames[1]
            self._turn = solver.add_orientation_task(first, np.eye(3))
            self._turn.configure("orientation", "soft", LEVER**2)
            self._way = solver.add_relative_position_task(first, second, task.relative.p)
            self._way.configure("way", "soft", 1.0)
            self._seen = solver.add_relative_orientation_task(first, second, task.relative.R)
            self._seen.configure("seen", "soft", weight**2)
        if task.axis is not None and self.has_axis_task:
            ends = np.array([0.0, 0.0, 1.0]), task.axis
            self._axis = solver.add_axisalign_task(first, *ends)
            self._axis.configure("axis", "soft", weight**2)
        elif task.axis is not None:
            self._turn = solver.add_orientation_task(first, np.eye(3))
            self._turn.mask.set_axises("xy", "local")
            self._turn.configure("axis", "soft", weight**2)
        if task.point is not None:
            self._port = solver.add_relative_position_task(first, "port", np.zeros(3))
            self._port.mask.set_axises("xy")
            self._port.configure("port", "soft", weight**2)

    def poses(self, q: Array) -> tuple[Pose, Pose | None]:
        self._robot.state.q[-q.size :] = q
        self._robot.update_kinematics()
        places = map(self._robot.get_T_world_frame, self.frames)
        tools = [Pose(X[:3, 3].copy(), X[:3, :3].copy()) for X in places]
        return tools[0], tools[1].relative_to(tools[0]) if len(tools) == 2 else None

    def towards(self, aim: Aim, q: Array, v: Array, tool: Pose) -> Array:
        task = self.task
        self._position.target_world = aim.tool.p
        if aim.relative is not None:
            self._turn.R_world_frame = aim.tool.R
            self._way.target, self._seen.R_a_b = aim.relative
        if aim.axis is not None and not self.has_axis_task:
            self._turn.R_world_frame = rotated_by(_turn_between(tool.R[:, 2], aim.axis), tool.R)
        elif aim.axis is not None:
            # Its rows are of the cross product of both axes, and not numbers where that is zero.
            turn = _turn_between(tool.R[:, 2], aim.axis)
            aligned = turn @ turn < _ALIGNED**2
            self._axis.targetAxis_world = aim.axis + _ALIGNED * tool.R[:, 0] * aligned
        if aim.point is not None:
            # The port stands: where it is to be, seen from the tool, is what the point is off by.
            self._port.target = tool.R.T @ (task.point - aim.point)
        home = self.home(q).tolist()
        self._posture.set_joints(dict(zip(task.arm.joints, home, strict=True)))
        coasting = q + task.period * v
        self._bounds.b = np.concatenate((coasting + self._room, self._room - coasting))
        try:
            return self._solver.solve(False)[-q.size :] / task.period
        except RuntimeError as error:
            raise NoSolutionError from error


class PlacoAxis(Placo):
    """placo with its task of an axis."""

    name = "placo, axis task"
    does = frozenset({"axis"})
    has_axis_task = True


class EmbodiK(Peer):
    """EmbodiK's weighted solution, within a box of the user's, with rows of its frame Jacobian."""

    name = "EmbodiK"
    setting = ""
    does = frozenset({"base", "axis"})

    def __init__(self, task: Job, setting: Setting) -> None:
        super().__init__(task, setting)
        with TemporaryDirectory() as folder:
            file = Path(folder) / "arm.urdf"
            file.write_text(task.urdf)
            self._robot = embodik.RobotModel(str(file))
        self._eye = np.asfortranarray(np.eye(task.arm.n))
        axis = [] if task.axis is None else [(task.lever * setting.weight) ** 2]
        self._weights = [1.0, *axis, setting.posture]

    def poses(self, q: Array) -> tuple[Pose, Pose | None]:
        self._robot.update_configuration(q)
        X = self._robot.get_frame_pose(self.frames[0])
        return Pose(X.translation, X.rotation), None

    def towards(self, aim: Aim, q: Array, v: Array, tool: Pose) -> Array:
        h, limits = self.task.period, self.task.limits
        J = self._robot.get_frame_jacobian(self.frames[0])
        goals, rows = [(aim.tool.p - tool.p) / h], [J[:3]]
        if aim.axis is not None:
            # The axis points down: turns about it are those about the world's z.
            goals.append(_turn_between(tool.R[:, 2], aim.axis)[:2] / h)
            rows.append(J[3:5])
        room, here = h * limits.acceleration, q if not self.in_the_middle else q - 0.5 * h * v
        lower = np.maximum((limits.position_lower - here) / h, -limits.velocity)
        upper = np.minimum((limits.position_upper - here) / h, limits.velocity)
        found = embodik.computeConstrainedWeightedVelocitySolutionEigen(
            goals=[*goals, (self.home(q) - q) / h],
            jacobians=[*map(np.asfortranarray, rows), self._eye],
            C=self._eye,
            lower_limits=np.maximum(lower, v - room),
            upper_limits=np.minimum(upper, v + room),
            objective_weights=self._weights,
            solver_tolerance=1e-9,
        )
        if found.status != embodik.SolverStatus.SUCCESS:
            raise NoSolutionError
        return np.array(found.solution)


class OurLoop(Scheme):
    """The experiment's own law in a loop, with signals as the diagram has them."""

    name, setting = "ours", ""

    def __init__(self, task: Job, experiment: Experiment) -> None:
        super().__init__(task)
        self._kinematics = experiment.arm.kinematics()
        self._reading = experiment.law.sampled(task.period)
        self._view = View(experiment.law_task, self._kinematics, DelayedPath(experiment.desired))
        self._ahead = {name: AHEAD.get(name, name) for name in self._reading.inputs.parts}
        start = self._signals(task.start, 0.0)
        self._x = self._reading.initial_state(np.random.default_rng(0), start)

    def _signals(self, q: Array, t: float) -> dict[str, Array]:
        h = self.task.period
        return {
            name: SIGNALS[now].function(self._view, q, None, t + h * (now != name))
            for name, now in self._ahead.items()
        }

    def pose(self, q: Array) -> tuple[Array, Array]:
        return self._kinematics.p_WE(q), self._kinematics.R_WE(q)

    def velocity(self, k: int, q: Array, v: Array) -> Array:
        t, h = k * self.task.period, self.task.period
        self._x = self._reading.step(t, self._x, self._signals(q, t), h)
        return self._reading.commanded_velocity(t, self._x).copy()


PEERS = (Placo, PlacoAxis, Pink, Mink, EmbodiK)


def settings_of(kind: type[Peer], job: Job) -> Iterator[Setting]:
    """Yield what is tried of the grid; without a second objective its weight says nothing."""
    depths = kind.depths if job.point is not None else (1.0,)
    for setting, depth in product(GRID, depths):
        if job.kind != "base" or setting.weight == 1.0:
            yield setting._replace(depth=depth)


def best_setting(kind: type[Peer], job: Job) -> Setting:
    """Return the setting with the least error in the trial, of those that keep all bounds."""
    return min(settings_of(kind, job), key=lambda setting: _score(job, kind(job, setting)))


def _score(job: Job, scheme: Scheme) -> float:
    """Return the largest error of a trial; infinite if a bound is exceeded."""
    motion = run(scheme)
    return max(job.errors(motion)) if job.excess(motion) < _KEPT else np.inf


def softened(job: Job, softness: float) -> Experiment:
    """Return the experiment of a job with another price of the task's error."""
    document = dict(job.experiment.document.contents())
    return make_experiment({**document, "law": {**document["law"], "softness": softness}})


class Row(NamedTuple):
    """A row of a table: its name and setting, and how a scheme that has begun nothing is made."""

    name: str
    setting: str
    begin: Callable[[], Scheme]


def rows_of(kind: str, job: Job) -> list[Row]:
    """Return the rows of a task, each with its best setting."""
    trial, rows = Job(kind, Job.kinds[kind][2]), []
    for peer in PEERS:
        for scheme in (peer, in_the_middle(peer)) if kind in peer.does else ():
            setting = best_setting(scheme, trial)
            rows.append(Row(scheme.name, str(setting), partial(scheme, job, setting)))
    softness = min(
        _SOFTNESSES, key=lambda each: _score(trial, CompiledLoop(trial, softened(trial, each)))
    )
    best, text = softened(job, softness), f"softness {softness:.0e}"
    return [
        *rows,
        Row("ours: adaptive", text, partial(OurLoop, job, best)),
        Row("ours: adaptive, in C", text, partial(CompiledLoop, job, best)),
        Row("ours: adaptive, shipped, in C", "", partial(CompiledLoop, job, job.experiment)),
    ]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", choices=Job.kinds, action="append", help="only this task")
    parser.add_argument(
        "--rounds", type=int, default=2, help="runs, of which the least cost counts"
    )
    arguments = parser.parse_args()
    # pink tells of each sample in which a joint is beyond a limit, and that takes time.
    logging.disable(logging.WARNING)
    for kind in arguments.task or Job.kinds:
        job = Job(kind)
        rows = rows_of(kind, job)
        rounds = [[run(row.begin()) for row in rows] for _ in range(arguments.rounds)]
        heads = ("scheme", "setting", *job.columns, "beyond a bound", "failures", "u a step")
        print(f"\n{kind}: {job.experiment.name}\n")
        print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
        for row, motions in zip(rows, zip(*rounds, strict=True), strict=True):
            excess, errors = job.excess(motions[0]), job.errors(motions[0])
            costs = min(median(each.costs) for each in motions)
            cells = (row.name, row.setting, *(f"{1e9 * error:.2g}" for error in errors))
            counts = (f"{excess:.0e}" if excess > 0.0 else "0", f"{motions[0].failures}")
            print(f"| {' | '.join((*cells, *counts, f'{costs:.3g}'))} |", flush=True)


if __name__ == "__main__":
    main()
