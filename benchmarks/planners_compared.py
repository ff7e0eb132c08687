"""Plans of other libraries for the problems of MotionBenchMaker, beside ours.

    pip install toppra roboplan ompl   # VAMP is built from its source distribution
    python benchmarks/planners_compared.py FOLDER --problems 28
    python benchmarks/planners_compared.py FOLDER --choose OMPL --first 91 --problems 7

FOLDER and ``--folder`` are those of `motion_bench_maker`, which has the problems, our own plan and
the judge: the makers' meshes at every sample and halfway between two. All get the same bounds on
velocity and acceleration, ours a bound on jerk too. Time to plan is that of the processor, without
that of building a scene, and includes what times the path.

``--choose`` tries the grid of a planner. VAMP's arms have their hands; the others are bare.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from pydrake.math import RigidTransform

from drake_rnn import Array, JointLimits, load_arm
from kept_cases import cases
from makers_meshes import add_folders, bodies_of
from markdown_table import head, row
from motion_bench_maker import (
    ARMS,
    THERE,
    Problem,
    Solid,
    base_pose,
    bounded,
    judged,
    meshes_of,
    planned,
    problems_of,
)
from shared_options import add_case_options

# Where the arms of the distribution end, and their hands begin.
HANDS = {"panda": "panda_hand_joint", "ur5": "fts_fix"}
BASES = {"panda": "panda_link0", "ur5": "base_link"}
# Time after which a search ends in vain [s].
PATIENCE = 60.0
# Name of the group of joints in roboplan.
ARM = "arm"
OURS = "ours"

#: What a planner returns: positions of joints at samples, shape (k, n) [rad].
Motion = Array
Settings = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """A problem of an arm.

    Attributes:
        name: The arm.
        folder: Folder of the distribution's resources.
        problem: The problem.
        limits: Limits of the joints.
        joints: Names of the joints.
        X_SB: Pose of the arm's base in the frame of its URDF file.
        period: Time between two samples [s].
        seed: Seed of random numbers.
    """

    name: str
    folder: Path
    problem: Problem
    limits: JointLimits
    joints: tuple[str, ...]
    X_SB: RigidTransform
    period: float
    seed: int

    @property
    def solids(self) -> Iterator[tuple[Solid, Array]]:
        """Each obstacle and its pose in the frame of the URDF file, shape (4, 4)."""
        for solid in self.problem.solids:
            yield solid, (self.X_SB @ solid.X_WO).GetAsMatrix4()


@cache
def bare_urdf(folder: Path, name: str) -> str:
    """Return the distribution's URDF of an arm without its hand."""
    root = ElementTree.parse(folder / name / f"{name}.urdf").getroot()
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    queue, gone = [HANDS[name]], set[str]()
    while queue:
        joint = joints.pop(queue.pop())
        child = joint.find("child").get("link")
        gone.add(child)
        queue += [k for k, j in joints.items() if j.find("parent").get("link") == child]
    for part in list(root):
        is_kept = part.tag == "joint" and part.get("name") in joints
        if is_kept or (part.tag == "link" and part.get("name") not in gone):
            continue
        root.remove(part)
    text = ElementTree.tostring(root, encoding="unicode")
    return text.replace("package://", f"{folder / name}/")


def disabled_pairs(folder: Path, name: str) -> set[frozenset[str]]:
    """Return the pairs of links that the distribution's SRDF file disables."""
    root = ElementTree.parse(folder / name / f"{name}.srdf").getroot()
    pairs = root.findall("disable_collisions")
    return {frozenset((pair.get("link1", ""), pair.get("link2", ""))) for pair in pairs}


def interpolate(path: Array, spacing: float) -> Array:
    """Return points of the straight ways between points, at most a spacing apart [rad]."""
    points = [path[:1]]
    for begin, end in pairwise(path):
        count = max(1, int(np.ceil(np.linalg.norm(end - begin) / spacing)))
        points.append(begin + np.arange(1, count + 1)[:, None] / count * (end - begin))
    return np.concatenate(points)


def toppra_timing(task: Task, settings: Settings) -> Callable[[Array], Motion]:
    """Return what times a path, shape (k, n) [rad], by TOPP-RA, along a cubic spline.

    Args:
        task: The problem.
        settings: ``spacing``, the largest distance of the spline's points [rad], None for those of
            the path alone; ``gridpoints``, the number of points at which a speed is chosen.
    """
    import toppra
    from toppra import algorithm, constraint

    toppra.setup_logging("ERROR")
    v, a = task.limits.velocity, np.broadcast_to(task.limits.acceleration, len(task.joints))
    bounds = [
        constraint.JointVelocityConstraint(np.column_stack((-v, v))),
        constraint.JointAccelerationConstraint(
            np.column_stack((-a, a)),
            discretization_scheme=constraint.DiscretizationType.Interpolation,
        ),
    ]

    def timed(path: Array) -> Motion:
        points = path if settings["spacing"] is None else interpolate(path, settings["spacing"])
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        points = points[np.concatenate(([True], lengths > 1e-6))]
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        at = np.concatenate(([0.0], np.cumsum(lengths)))
        timing = algorithm.TOPPRA(
            bounds,
            toppra.SplineInterpolator(at, points, bc_type="natural"),
            gridpoints=np.linspace(0.0, at[-1], settings["gridpoints"]),
            solver_wrapper="seidel",
            parametrizer="ParametrizeConstAccel",
        )
        if (motion := timing.compute_trajectory(0.0, 0.0)) is None:
            raise NoPlanError("TOPP-RA found no timing")
        times = task.period * np.arange(int(np.ceil(motion.duration / task.period)) + 1)
        return np.asarray(motion(np.minimum(times, motion.duration)))

    return timed


class NoPlanError(Exception):
    """A planner found none."""


def validity(task: Task, margin: float) -> Callable[[Any], bool]:
    """Return what tells whether a state of OMPL is free, by Pinocchio and the meshes of the arm.

    Args:
        task: The problem.
        margin: How far things are to be apart [m].
    """
    import pinocchio as pin

    text, off = bare_urdf(task.folder, task.name), disabled_pairs(task.folder, task.name)
    model = pin.buildModelFromXML(text)
    geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    names = [model.frames[each.parentFrame].name for each in geometry.geometryObjects]
    for one, other in combinations(range(len(names)), 2):
        if frozenset((names[one], names[other])) not in off:
            geometry.addCollisionPair(pin.CollisionPair(one, other))
    moving = [k for k, name in enumerate(names) if name != BASES[task.name]]
    for number, (solid, X) in enumerate(task.solids):
        placed = pin.GeometryObject(f"solid {number}", 0, 0, pin.SE3(X), solid.exact())
        index = geometry.addGeometryObject(placed)
        for link in moving:
            geometry.addCollisionPair(pin.CollisionPair(link, index))
    data, found = model.createData(), geometry.createData()
    for request in found.collisionRequests:
        request.security_margin = margin
    order = [model.joints[model.getJointId(name)].idx_q for name in task.joints]
    q = np.zeros(model.nq)

    def is_valid(state: Any) -> bool:
        for k, joint in enumerate(order):
            q[joint] = state[k]
        return not pin.computeCollisions(model, data, geometry, found, q, True)

    return is_valid


def by_ompl(task: Task, settings: Settings) -> Callable[[], Motion]:
    """Return what plans with RRT-Connect of OMPL."""
    from ompl import base, geometric, util

    joints = range(len(task.joints))
    space, box = base.RealVectorStateSpace(len(joints)), base.RealVectorBounds(len(joints))
    for k, (low, high) in enumerate(zip(*task.limits.resting, strict=True)):
        box.setLow(k, float(low))
        box.setHigh(k, float(high))
    space.setBounds(box)
    util.setLogLevel(util.LogLevel.LOG_NONE)
    util.RNG.setSeed(task.seed + 1)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(validity(task, settings["margin"]))
    setup.getSpaceInformation().setStateValidityCheckingResolution(settings["resolution"])
    ends = [space.allocState(), space.allocState()]
    for state, q in zip(ends, (task.problem.start, task.problem.goal), strict=True):
        for k in joints:
            state[k] = float(q[k])
    setup.setStartAndGoalStates(*ends)
    setup.setPlanner(geometric.RRTConnect(setup.getSpaceInformation()))
    setup.setup()
    timed = toppra_timing(task, settings)

    def plan() -> Motion:
        setup.solve(PATIENCE)
        if not setup.haveExactSolutionPath():
            raise NoPlanError("none found")
        setup.simplifySolution(settings["simplify"])
        states = setup.getSolutionPath().getStates()
        path = np.array([[state[k] for k in joints] for state in states])
        return timed(path)

    return plan


def by_vamp(task: Task, settings: Settings) -> Callable[[], Motion]:
    """Return what plans with VAMP: its RRT-Connect, its simplification, its spheres and hand."""
    import vamp
    from scipy.spatial.transform import Rotation

    robot, planner, plan_settings, simplify_settings = vamp.configure_robot_and_planner_with_kwargs(
        task.name, "rrtc"
    )
    simplify_settings.operations = [
        getattr(vamp.SimplifyRoutine, each) for each in settings["operations"]
    ]
    scene: dict[str, Any] = {"sphere": [], "cylinder": [], "box": [], "problem": ""}
    for number, (solid, X) in enumerate(task.solids):
        kind, size = solid.kind, solid.dimensions
        given = {
            "name": str(number),
            "position": X[:3, 3].tolist(),
            "orientation_euler_xyz": Rotation.from_matrix(X[:3, :3]).as_euler("xyz").tolist(),
        }
        if kind == "box":
            given["half_extents"] = [0.5 * each for each in size]
        else:
            given |= {"radius": size[-1], "length": size[0]}
        scene[kind].append(given)
    # Its cylinders are capsules; where an object is to be grasped from above it takes boxes.
    scene["problem"] = "box" if settings["cylinders"] == "boxes" else ""
    environment, sampler = vamp.problem_dict_to_vamp(scene), robot.halton()
    start, goal = (each.astype(np.float32) for each in (task.problem.start, task.problem.goal))
    timed = toppra_timing(task, settings)

    def plan() -> Motion:
        found = planner(start.tolist(), goal.tolist(), environment, plan_settings, sampler)
        if not found.solved:
            fault = [
                what
                for what, q in (("start", start), ("goal", goal))
                if not robot.validate(q.tolist(), environment)
            ]
            raise NoPlanError(f"{' and '.join(fault) or 'path'} not free")
        simple = robot.simplify(found.path, environment, simplify_settings, sampler)
        path = np.array(simple.path.numpy(), dtype=float)
        return timed(path)

    return plan


def scene_of_roboplan(task: Task) -> Any:
    """Return roboplan's scene of a problem."""
    from roboplan import core

    root = ElementTree.fromstring(bare_urdf(task.folder, task.name))
    root.set("version", "1.2")  # bounds of acceleration are read from this version on
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    bounds = {
        "lower": task.limits.resting[0],
        "upper": task.limits.resting[1],
        "velocity": task.limits.velocity,
        "acceleration": np.broadcast_to(task.limits.acceleration, len(task.joints)),
    }
    for k, name in enumerate(task.joints):
        for key, bound in bounds.items():
            joints[name].find("limit").set(key, repr(float(bound[k])))
    text = ElementTree.tostring(root, encoding="unicode")
    scene = core.Scene(task.name, core.loadUrdfSceneDescriptionFromXml(text, []))
    links = {link.get("name") for link in root.findall("link")}
    apart = [tuple(pair) for pair in disabled_pairs(task.folder, task.name) if pair <= links]
    shapes = {
        "box": lambda size: (scene.addBoxGeometry, core.Box(*size)),
        "cylinder": lambda size: (scene.addCylinderGeometry, core.Cylinder(size[1], size[0])),
        "sphere": lambda size: (scene.addSphereGeometry, core.Sphere(size[0])),
    }
    names = list[str]()
    for number, (solid, X) in enumerate(task.solids):
        add, shape = shapes[solid.kind](solid.dimensions)
        names.append(f"solid {number}")
        add(names[-1], "universe", shape, np.asfortranarray(X), np.full(4, 0.5))
    # Things that stand may touch each other.
    apart += combinations([BASES[task.name], *names], 2)
    scene.setCollisions(apart, False)
    scene.addGroup(ARM, list(task.joints))
    scene.setRngSeed(task.seed)
    return scene


def by_roboplan(task: Task, settings: Settings) -> Callable[[], Motion]:
    """Return what plans with roboplan: its RRT-Connect, its shortcuts and its TOPP-RA."""
    from roboplan import core, rrt, toppra

    scene, step = scene_of_roboplan(task), settings["step"]
    options = rrt.RRTOptions(
        group_name=ARM,
        max_nodes=1_000_000,
        max_connection_distance=settings["connection"],
        collision_check_step_size=step,
        max_planning_time=PATIENCE,
        rrt_connect=True,
    )
    planner = rrt.RRT(scene, options)
    planner.setRngSeed(task.seed)
    shorter = core.PathShortcuttingOptions(ARM, step, settings["shortcuts"])
    shortcuts = core.PathShortcutter(scene, shorter)
    timing = toppra.PathParameterizerTOPPRA(scene, ARM)
    how = toppra.TOPPRAOptions(
        dt=task.period, mode=getattr(toppra.SplineFittingMode, settings["mode"])
    )
    ends = [
        core.JointConfiguration(list(task.joints), q)
        for q in (task.problem.start, task.problem.goal)
    ]

    def plan() -> Motion:
        try:
            path = shortcuts.shortcut(planner.plan(*ends))
            return np.array(timing.generate(path, how).positions)
        except RuntimeError as error:
            raise NoPlanError(str(error)) from None

    return plan


@dataclass(frozen=True)
class Planner:
    """A planner beside ours.

    Attributes:
        prepare: Builds a scene, and returns what plans in it.
        shapes: Its shapes of the arm, in words.
        best: The settings that were best.
        grid: Other values of each that were tried.
    """

    prepare: Callable[[Task, Settings], Callable[[], Motion]]
    shapes: str
    best: Settings
    grid: dict[str, tuple[Any, ...]]


PLANNERS = {
    "OMPL": Planner(
        by_ompl,
        "meshes, bare arm",
        {"margin": 0.005, "resolution": 0.005, "simplify": 1.0, "spacing": 0.1, "gridpoints": 1000},
        {"margin": (0.0, 0.01), "spacing": (None, 0.05), "resolution": (0.002,)},
    ),
    "VAMP": Planner(
        by_vamp,
        "spheres, with hand",
        {
            "operations": ("REDUCE", "SHORTCUT", "PERTURB"),
            "cylinders": "boxes",
            "spacing": 0.1,
            "gridpoints": 1000,
        },
        {
            "operations": (("SHORTCUT", "BSPLINE"), ("REDUCE", "SHORTCUT", "BSPLINE")),
            "cylinders": ("capsules",),
            "spacing": (None, 0.05, 0.2),
        },
    ),
    "roboplan": Planner(
        by_roboplan,
        "meshes, bare arm",
        {"connection": 3.0, "step": 0.05, "shortcuts": 100, "mode": "LinearBlend"},
        {
            "mode": ("Hermite", "Cubic", "Adaptive"),
            "step": (0.02,),
            "connection": (1.0,),
            "shortcuts": (400,),
        },
    ),
}


def of_other(
    number: int, options: argparse.Namespace, name: str, which: str, settings: Settings
) -> dict[str, Any]:
    """Return what a problem comes to with another planner."""
    given = problems_of(options.resources, name, options.first, options.problems)
    case, problem = given[number]
    arm = load_arm(name, tool=None)
    base = bodies_of(arm, arm.plant())[0].name()
    task = Task(
        name,
        options.resources.resolve(),
        problem,
        bounded(arm, None),
        arm.joints,
        base_pose(options.resources / name / f"{name}.urdf", base),
        options.period,
        number,
    )
    began = time.process_time()
    try:
        plan = PLANNERS[which].prepare(task, settings)
        began = time.process_time()
        q = plan()
    except NoPlanError as error:
        took = time.process_time() - began
        return {"problem": case, "refused": str(error), "planning": took}
    planning = time.process_time() - began
    meshes = meshes_of(name, tuple(options.folder))
    return {
        "problem": case,
        "planning": planning,
        **judged(q, problem, task.limits, options.period, meshes),
    }


def print_figures(name: str, which: str, shapes: str, found: list[dict[str, Any]]) -> None:
    """Print the row of a planner."""
    went = [each for each in found if "refused" not in each]
    there = [each for each in went if each["error"] < THERE]
    free = [each for each in there if each["mesh"] > 0.0]
    for each in found:
        if each not in free:
            text = each.get("refused") or f"{1e3 * each['mesh']:.2f} mm, {each['error']:.3g} rad"
            print(f"# {name} {which} {each['problem']}: {text}", file=sys.stderr)
    times = (
        "{:.3g}, {:.3g}".format(*np.quantile([each[key] for each in there], (0.5, 0.95)))
        for key in ("planning", "motion")
    )
    row(
        f"`{name}`",
        which,
        shapes,
        len(found),
        len(there),
        len(there) - len(free),
        len(free),
        *times,
        f"{1e3 * min(each['mesh'] for each in there):.2f}",
        f"{max(each['beyond'] for each in there):.0e}",
        f"{max(each['jerk'] for each in there):.3g}",
    )


def choose(options: argparse.Namespace) -> None:
    """Print what a planner comes to with each value of its grid beside its best settings."""
    planner = PLANNERS[options.choose]
    others = [{key: value} for key, values in planner.grid.items() for value in values]
    for change in ({}, *others):
        settings = {**planner.best, **change}
        for name in options.arms:
            found = outcomes(options, name, options.choose, settings)
            print_figures(name, f"{options.choose} {change or 'best'}", planner.shapes, found)


def outcomes(
    options: argparse.Namespace, name: str, which: str, settings: Settings
) -> list[dict[str, Any]]:
    """Return what the problems of an arm come to."""
    if which == OURS:
        task = partial(planned, options=options, name=name)
    else:
        task = partial(of_other, options=options, name=name, which=which, settings=settings)
    key = f"{which} {name}, {options.first}, {options.period}, {settings}"
    return cases(task, range(options.problems), options.jobs, options.kept, key)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("resources", metavar="FOLDER", type=Path, help="the unpacked distribution")
    parser.add_argument("--problems", type=int, default=28, help="number of problems of each arm")
    parser.add_argument("--first", type=int, default=1, help="number of the first one")
    parser.add_argument("--period", type=float, default=0.01, help="time between samples [s]")
    parser.add_argument("--steps", type=int, default=20_000, help="longest search of our plan")
    parser.add_argument("--arms", nargs="+", choices=ARMS, default=ARMS)
    parser.add_argument("--rows", nargs="+", choices=(OURS, *PLANNERS), default=(OURS, *PLANNERS))
    parser.add_argument("--choose", choices=PLANNERS, help="try the grid of a planner")
    add_folders(parser)
    add_case_options(parser)
    options = parser.parse_args()
    options.resources = options.resources / "resources"
    head(
        "arm",
        "planner",
        "its shapes of the arm",
        "problems",
        "plans to the goal",
        "collide by the meshes",
        "reached free",
        "planning, s of the processor, median and 95 %",
        "motion, median and 95 % [s]",
        "least distance by the meshes [mm]",
        "bounds beyond by",
        "largest jerk [rad/s^3]",
    )
    if options.choose:
        return choose(options)
    for name in options.arms:
        for which in options.rows:
            shapes = "fine capsules, bare arm" if which == OURS else PLANNERS[which].shapes
            best = {} if which == OURS else PLANNERS[which].best
            print_figures(name, which, shapes, outcomes(options, name, which, best))
    return None


if __name__ == "__main__":
    main()
