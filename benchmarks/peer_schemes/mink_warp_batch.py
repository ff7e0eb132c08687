"""mink-warp: tasks and limits over MuJoCo Warp, many robots in one call, in single precision."""

from __future__ import annotations

from collections.abc import Sequence

import mink_warp as mw
import mujoco
import numpy as np
import warp as wp
from mink_warp.limits.limit import Limit

from drake_rnn import Array, Experiment
from peer_schemes.tasks import POSTURE_RATE, Braking
from peer_schemes.urdf import without_shapes

wp.config.quiet = True


@wp.kernel
def _within_reach(
    v: wp.array2d(dtype=float),
    room: wp.array(dtype=float),
    h: float,
    lower: wp.array2d(dtype=float),
    upper: wp.array2d(dtype=float),
):
    robot, joint = wp.tid()
    way = h * v[robot, joint]
    lower[robot, joint] = wp.max(lower[robot, joint], way - room[joint])
    upper[robot, joint] = wp.min(upper[robot, joint], way + room[joint])


@wp.kernel
def _aim(
    position: wp.array2d(dtype=wp.vec3),
    frame: int,
    p_WE: wp.array2d(dtype=wp.vec3),
    sample: wp.array(dtype=int),
    numbers: wp.vec4,
    target: wp.array2d(dtype=float),
):
    """Write where the tool is to be at the next sample, as `Braking.share` has it.

    The numbers are the period and what belongs to `Braking`, in its order.
    """
    h = numbers[0]
    deceleration = numbers[1]
    most = numbers[2]
    gain = numbers[3]
    robot = wp.tid()
    k = sample[0]
    error = position[robot, frame] - p_WE[k, robot]
    distance = wp.max(wp.length(error), 1e-12)
    share = gain
    if distance * gain * gain > 2.0 * deceleration:
        share = wp.min(wp.sqrt(2.0 * deceleration / distance), most / distance)
    aim = p_WE[k + 1, robot] + (1.0 - h * share) * error
    for axis in range(3):
        target[robot, 4 + axis] = aim[axis]


@wp.kernel
def _count(sample: wp.array(dtype=int)):
    sample[0] = sample[0] + 1


class AccelerationLimit(Limit):
    """A limit of the user's own: |v - last| <= a h; mink-warp has none.

    Args:
        acceleration: Bound, shape (n,) [rad/s^2].
        last: Velocities of the last sample, shape (robots, n).
        period: Sampling period [s].
    """

    box_capable = True
    n_inequalities = 0

    def __init__(self, acceleration: Array, last: wp.array, period: float) -> None:
        self._last = last
        self._room = wp.array(period**2 * acceleration, dtype=float, device=last.device)

    def apply_box(
        self, configuration: mw.Configuration, dt: float, lo: wp.array, hi: wp.array
    ) -> None:
        wp.launch(
            _within_reach, dim=lo.shape, inputs=[self._last, self._room, dt], outputs=[lo, hi],
            device=configuration.device,
        )  # fmt: skip


class MinkWarp:
    """Robots side by side, each with a start and a path of its own.

    Args:
        experiments: What each robot is to do; they differ in nothing but their starts.
        p_WE: Desired positions, shape (samples + 1, robots, 3) [m].
        bounded: Whether the bounds of position, velocity and acceleration are given.
        device: ``cpu`` or ``cuda``.
        posture_cost: Weight of the posture.
        admm_iters: Number of iterations of the solver with bounds.
    """

    def __init__(
        self,
        experiments: Sequence[Experiment],
        p_WE: Array,
        braking: Braking,
        *,
        bounded: bool = True,
        device: str = "cpu",
        posture_cost: float = 1e-3,
        admm_iters: int = 10,
    ) -> None:
        experiment = experiments[0]
        arm, limits, h = experiment.arm, experiment.limits, experiment.document.period
        spec = mujoco.MjSpec.from_string(without_shapes(arm))
        # MuJoCo fuses links without a joint of their own unless told not to, and the flange with
        # them.
        spec.compiler.fusestatic = False
        model = spec.compile()
        model.jnt_range[:] = np.stack((limits.position_lower, limits.position_upper), axis=1)
        q = np.array([each.start for each in experiments])
        self._configuration = mw.Configuration(model, q, len(q), device=device)
        self._tool = mw.FrameTask(arm.frame, "body", position_cost=1.0, orientation_cost=0.0)
        posture = mw.PostureTask(model, cost=posture_cost, gain=POSTURE_RATE * h)
        posture.set_target(q, configuration=self._configuration)
        self._h, self._device, self._tasks = h, device, [self._tool, posture]
        self._frame = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, arm.frame)
        pose = self._configuration.get_transform_frame_to_world(arm.frame, "body")
        self._target = wp.clone(pose)
        self._way = wp.array(p_WE, dtype=wp.vec3, device=device)
        self._sample = wp.zeros(1, dtype=int, device=device)
        self._braking, self._graph = braking, None
        self._configuration.set_integration_dt(h)
        if not bounded:
            self._solver = mw.IKSolver(self._configuration)
            return
        velocity = dict(zip(arm.joints, limits.velocity.tolist(), strict=True))
        self._solver = mw.ConstrainedSolver(
            self._configuration,
            limits=[mw.ConfigurationLimit(model, gain=1.0), mw.VelocityLimit(model, velocity)],
            admm_iters=admm_iters,
        )
        own = AccelerationLimit(limits.acceleration, self._solver.v, h)
        self._solver.limits.append(own)

    @property
    def q(self) -> Array:
        """Joint positions, shape (robots, n) [rad]."""
        return self._configuration.q.numpy()

    def restart(self, q: Array) -> None:
        """Put the robots, at rest, into postures, shape (robots, n) [rad]."""
        self._configuration.update(q)
        self._solver.v.zero_()
        self._sample.zero_()

    def step(self) -> None:
        """Make the next sample."""
        if self._device == "cpu":
            self._enqueue()
            return
        if self._graph is None:
            # The first call builds the kernels, which a graph cannot.
            q = self._configuration.q.numpy()
            self._enqueue()
            self.restart(q)
            with wp.ScopedDevice(self._device), wp.ScopedCapture() as capture:
                self._enqueue()
            self._graph = capture.graph
        wp.capture_launch(self._graph)

    def finish(self) -> None:
        """Wait until all samples have been made."""
        wp.synchronize()

    def _enqueue(self) -> None:
        b = self._braking
        numbers = wp.vec4(self._h, b.deceleration, b.limit, min(b.gain, 1.0 / self._h))
        place = self._configuration.wp_data.xpos
        with wp.ScopedDevice(self._device):
            wp.launch(
                _aim, dim=place.shape[0],
                inputs=[place, self._frame, self._way, self._sample, numbers],
                outputs=[self._target],
            )  # fmt: skip
            wp.launch(_count, dim=1, inputs=[self._sample])
        self._tool.set_target(self._target, configuration=self._configuration)
        self._solver.solve(self._tasks, self._h)
        self._configuration.integrate_inplace(self._solver.v)
