"""Two Pandas hold one tool as seen from the other while their centre moves: peers and ours.

Print a table: python benchmarks/peers_of_two_tools.py. It needs the extra ``peers``. Each peer
has a frame task for the first tool and a relative frame task, with the weights of the other
comparisons, and is asked at each sample, or at the middle of it, for the poses of the next one.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar, NamedTuple
from xml.etree import ElementTree

import mink
import mujoco
import numpy as np
import pink
import pinocchio
import placo
from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit
from pink.tasks import FrameTask, PostureTask, RelativeFrameTask

from drake_rnn import Array, Experiment, load_experiment, make_experiment
from drake_rnn.robot.rotation import rotation_by, rotation_error
from drake_rnn.robot.task_frame import pose_of
from drake_rnn.signals import AHEAD, SIGNALS, DelayedPath, View
from peer_schemes.tasks import LEVER, POSTURE_RATE, POSTURE_WEIGHT

_DURATION, _WINDOW = 10.0, 6.0
_TOLERANCES = {"primal_tol": 1e-11, "dual_tol": 1e-11}


class Pose(NamedTuple):
    """A position, shape (3,) [m], and an orientation, shape (3, 3)."""

    p: Array
    R: Array


def experiment_of_both() -> Experiment:
    """Return the shipped experiment without distances, from a start on its path."""
    document = dict(load_experiment("adaptive_two_tools").document.contents())
    path = {key: value for key, value in document["path"].items() if key != "offset"}
    changes = {"path": path, "duration": _DURATION, "window": [_WINDOW, _DURATION]}
    left_out = {"accept", "obstacles"}
    document = {key: value for key, value in document.items() if key not in left_out}
    return make_experiment({**document, **changes})


def without_shapes(experiment: Experiment) -> str:
    """Return the model of both arms without shapes, with the same joints."""
    root = ElementTree.fromstring(experiment.arm.model_text)
    for link in root.iter("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    return ElementTree.tostring(root, encoding="unicode")


class Peer:
    """A library with a task for the first tool, and one for the second as seen from it.

    Args:
        experiment: Arm, limits, start and path.
        relative: The pose to be held.
    """

    name: ClassVar[str]

    def __init__(self, experiment: Experiment, relative: Pose) -> None:
        self.experiment, self.arm = experiment, experiment.arm
        self.limits, self.period = experiment.limits, experiment.document.period or 0.0
        self.urdf, self.relative_start = without_shapes(experiment), relative

    def poses(self, q: Array) -> tuple[Pose, Pose]:
        """Return the poses of the first tool, and of the second as seen from it."""
        raise NotImplementedError

    def velocity(self, q: Array, v: Array, first: Pose, relative: Pose) -> Array:
        """Return the joint velocity that leads to both poses, shape (14,) [rad/s]."""
        raise NotImplementedError


class Pink(Peer):
    """pink, with its three limits."""

    name = "pink"

    def __init__(self, experiment: Experiment, relative: Pose) -> None:
        super().__init__(experiment, relative)
        model, limits = pinocchio.buildModelFromXML(self.urdf), self.limits
        model.velocityLimit = limits.velocity.copy()
        model.lowerPositionLimit = limits.position_lower.copy()
        model.upperPositionLimit = limits.position_upper.copy()
        self._configuration = pink.Configuration(model, model.createData(), experiment.start)
        first, second = self.arm.frames
        costs = {"position_cost": 1.0, "orientation_cost": LEVER}
        self._first, self._relative = (
            FrameTask(first, **costs),
            RelativeFrameTask(second, first, **costs),
        )
        posture = PostureTask(cost=POSTURE_WEIGHT**0.5, gain=POSTURE_RATE * self.period)
        posture.set_target(experiment.start)
        self._tasks = (self._first, self._relative, posture)
        self._acceleration = AccelerationLimit(model, limits.acceleration)
        self._limits = (ConfigurationLimit(model), VelocityLimit(model), self._acceleration)

    def poses(self, q: Array) -> tuple[Pose, Pose]:
        self._configuration.update(q)
        first, second = map(self._configuration.get_transform_frame_to_world, self.arm.frames)
        relative = first.actInv(second)
        return tuple(Pose(X.translation.copy(), X.rotation.copy()) for X in (first, relative))

    def velocity(self, q: Array, v: Array, first: Pose, relative: Pose) -> Array:
        self._configuration.update(q)
        self._first.set_target(pinocchio.SE3(first.R, first.p))
        self._relative.set_target(pinocchio.SE3(relative.R, relative.p))
        self._acceleration.set_last_integration(v, self.period)
        choices = {"solver": "daqp", "limits": self._limits, "safety_break": False}
        return pink.solve_ik(
            self._configuration, self._tasks, self.period, **choices, **_TOLERANCES
        )


class Mink(Peer):
    """mink, whose limits are of position and velocity."""

    name = "mink, without a bound of acceleration"

    def __init__(self, experiment: Experiment, relative: Pose) -> None:
        super().__init__(experiment, relative)
        root = ElementTree.fromstring(self.urdf)
        compiler = {"fusestatic": "false", "balanceinertia": "true", "boundmass": "1e-3"}
        compiler["boundinertia"] = "1e-6"
        ElementTree.SubElement(ElementTree.SubElement(root, "mujoco"), "compiler", compiler)
        model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
        limits = self.limits
        model.jnt_range[:] = np.stack((limits.position_lower, limits.position_upper), axis=1)
        self._configuration = mink.Configuration(model, q=experiment.start)
        first, second = self.arm.frames
        costs = {"position_cost": 1.0, "orientation_cost": LEVER}
        self._first = mink.FrameTask(first, "body", **costs)
        self._relative = mink.RelativeFrameTask(second, "body", first, "body", **costs)
        posture = mink.PostureTask(model, cost=POSTURE_WEIGHT**0.5, gain=POSTURE_RATE * self.period)
        posture.set_target(experiment.start)
        self._tasks = [self._first, self._relative, posture]
        velocity = dict(zip(self.arm.joints, limits.velocity.tolist(), strict=True))
        self._limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, velocity)]

    def poses(self, q: Array) -> tuple[Pose, Pose]:
        self._configuration.update(q)
        first, second = (
            self._configuration.get_transform_frame_to_world(frame, "body")
            for frame in self.arm.frames
        )
        both = first, first.inverse() @ second
        return tuple(Pose(X.translation(), X.rotation().as_matrix()) for X in both)

    def velocity(self, q: Array, v: Array, first: Pose, relative: Pose) -> Array:
        self._configuration.update(q)
        for task, pose in ((self._first, first), (self._relative, relative)):
            R = mink.SO3.from_matrix(pose.R)
            task.set_target(mink.SE3.from_rotation_and_translation(R, pose.p))
        return mink.solve_ik(
            self._configuration,
            self._tasks,
            self.period,
            "daqp",
            limits=self._limits,
            **_TOLERANCES,
        )


class Placo(Peer):
    """placo, with the acceleration bounded by half-spaces of the joints."""

    name = "placo"

    def __init__(self, experiment: Experiment, relative: Pose) -> None:
        super().__init__(experiment, relative)
        with TemporaryDirectory() as folder:
            file = Path(folder) / "arms.urdf"
            file.write_text(self.urdf)
            robot = placo.RobotWrapper(str(file), placo.Flags.ignore_collisions)
        limits, n = self.limits, self.arm.n
        for k, joint in enumerate(self.arm.joints):
            bounds = float(limits.position_lower[k]), float(limits.position_upper[k])
            robot.set_joint_limits(joint, *bounds)
            robot.set_velocity_limit(joint, float(limits.velocity[k]))
        self._robot, self._solver = robot, placo.KinematicsSolver(robot)
        solver = self._solver
        solver.mask_fbase(True)
        solver.dt = self.period
        solver.enable_velocity_limits(True)
        solver.enable_joint_limits(True)
        first, second = self.arm.frames
        self._position = solver.add_position_task(first, np.zeros(3))
        self._turn = solver.add_orientation_task(first, np.eye(3))
        self._way = solver.add_relative_position_task(first, second, relative.p)
        self._relative_turn = solver.add_relative_orientation_task(first, second, relative.R)
        tasks = (self._position, self._turn, self._way, self._relative_turn)
        for k, (task, weight) in enumerate(zip(tasks, 2 * (1.0, LEVER**2), strict=True)):
            task.configure(f"task {k}", "soft", weight)
        self._posture = solver.add_joints_task()
        self._posture.configure("posture", "soft", POSTURE_WEIGHT)
        # The state begins with the pose of a base that does not move here.
        A = np.zeros((2 * n, robot.state.q.size))
        A[:n, -n:], A[n:, -n:] = np.eye(n), -np.eye(n)
        self._room = self.period**2 * limits.acceleration
        self._bounds = solver.add_joint_space_half_spaces_constraint(A, np.zeros(2 * n))
        self._bounds.configure("acceleration", "hard", 1.0)

    def poses(self, q: Array) -> tuple[Pose, Pose]:
        self._robot.state.q[-q.size :] = q
        self._robot.update_kinematics()
        first, second = map(self._robot.get_T_world_frame, self.arm.frames)
        both = first, np.linalg.inv(first) @ second
        return tuple(Pose(X[:3, 3].copy(), X[:3, :3].copy()) for X in both)

    def velocity(self, q: Array, v: Array, first: Pose, relative: Pose) -> Array:
        self.poses(q)
        self._position.target_world, self._turn.R_world_frame = first
        self._way.target, self._relative_turn.R_a_b = relative
        home = q + POSTURE_RATE * self.period * (self.experiment.start - q)
        self._posture.set_joints(dict(zip(self.arm.joints, home.tolist(), strict=True)))
        coasting = q + self.period * v
        self._bounds.b = np.concatenate((coasting + self._room, self._room - coasting))
        return self._solver.solve(False)[-q.size :] / self.period


def run(peer: Peer, first_at: Callable[[float], Pose], *, in_the_middle: bool) -> tuple[Any, ...]:
    """Return joint positions, velocities, and the CPU time of a step [s]."""
    h, relative = peer.period, peer.relative_start
    q, v = peer.experiment.start.copy(), np.zeros(peer.arm.n)
    positions, velocities, begin = [q], [], time.process_time()
    for k in range(round(_DURATION / h)):
        targets, about = (first_at((k + 1) * h), relative), q
        if in_the_middle:
            about = q + 0.5 * h * v
            ways = zip(targets, peer.poses(q), peer.poses(about), strict=True)
            # As far to go and to turn as from here.
            targets = tuple(
                Pose(there.p + to.p - here.p, rotation_by(rotation_error(here.R, to.R)) @ there.R)
                for to, here, there in ways
            )
        v = peer.velocity(about, v, *targets)
        q = q + h * v
        positions.append(q)
        velocities.append(v)
    cost = (time.process_time() - begin) / len(velocities)
    return np.array(positions), np.array(velocities), cost


def run_ours(experiment: Experiment) -> tuple[Any, ...]:
    """Return the same of the experiment's own law."""
    h, kinematics = experiment.document.period or 0.0, experiment.arm.kinematics()
    reading = experiment.law.sampled(h)
    view = View(experiment.law_task, kinematics, DelayedPath(experiment.desired))

    def signals(q: Array, t: float) -> dict[str, Array]:
        names = reading.inputs.parts
        ahead = {name: AHEAD.get(name, name) for name in names}
        return {
            name: SIGNALS[now].function(view, q, None, t + h * (now != name))
            for name, now in ahead.items()
        }

    q, positions, velocities = experiment.start.copy(), [experiment.start], []
    x = reading.initial_state(np.random.default_rng(0), signals(q, 0.0))
    begin = time.process_time()
    for k in range(round(_DURATION / h)):
        x = reading.step(k * h, x, signals(q, k * h), h)
        velocities.append(reading.commanded_velocity(k * h, x).copy())
        q = q + h * velocities[-1]
        positions.append(q)
    cost = (time.process_time() - begin) / len(velocities)
    return np.array(positions), np.array(velocities), cost


def figures(experiment: Experiment, positions: Array, velocities: Array) -> list[str]:
    """Return the largest errors of both poses after 6 s, and by how much bounds are exceeded."""
    kinematics, h = experiment.arm.kinematics(), experiment.document.period or 0.0
    start = {name: pose_of(kinematics, experiment.start, name) for name in ("centre", "relative")}
    errors = np.zeros(4)
    for k in range(round(_WINDOW / h), len(positions)):
        poses = [pose_of(kinematics, positions[k], name) for name in start]
        aims = experiment.desired.position(k * h)[0], start["relative"].p_WE
        for place, (pose, aim, held) in enumerate(zip(poses, aims, start.values(), strict=True)):
            turn = np.linalg.norm(rotation_error(pose.R, held.R))
            found = np.linalg.norm(pose.p_WE - aim), turn
            errors[2 * place : 2 * place + 2] = np.maximum(errors[2 * place :][:2], found)
    before = np.vstack((np.zeros((1, velocities.shape[1])), velocities[:-1]))
    share = np.abs(velocities - before).max(axis=0) / h / experiment.limits.acceleration
    return [f"{1e9 * error:.2g}" for error in errors] + [f"{share.max() - 1.0:.0e}"]


def main() -> None:
    """Print the table."""
    experiment = experiment_of_both()
    kinematics, start = experiment.arm.kinematics(), experiment.start
    first, relative, centre = (
        pose_of(kinematics, start, name) for name in ("first", "relative", "centre")
    )

    def first_at(t: float) -> Pose:
        # The centre keeps its orientation: with the relative pose held, the tool goes along.
        return Pose(experiment.desired.position(t)[0] + first.p_WE - centre.p_WE, first.R)

    print("| scheme | centre [nm] | [nrad] | relative [nm] | [nrad] | a beyond | us a step |")
    print("|---|---|---|---|---|---|---|")
    for kind in (Placo, Pink, Mink):
        for in_the_middle in (False, True):
            peer = kind(experiment, Pose(relative.p_WE, np.asarray(relative.R)))
            positions, velocities, cost = run(peer, first_at, in_the_middle=in_the_middle)
            cells = figures(experiment, positions, velocities)
            name = f"{kind.name}{', midpoint' if in_the_middle else ''}"
            print(f"| {name} | {' | '.join(cells)} | {1e6 * cost:.0f} |")
    positions, velocities, cost = run_ours(experiment)
    cells = figures(experiment, positions, velocities)
    print(f"| ours: adaptive, NumPy | {' | '.join(cells)} | {1e6 * cost:.0f} |")


if __name__ == "__main__":
    main()
