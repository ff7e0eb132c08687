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
        self._room = wp.array(period**2 * acceleration, dtype=float, device="cpu")

    def apply_box(
        self, configuration: mw.Configuration, dt: float, lo: wp.array, hi: wp.array
    ) -> None:
        wp.launch(
            _within_reach, dim=lo.shape, inputs=[self._last, self._room, dt], outputs=[lo, hi],
            device="cpu",
        )  # fmt: skip


class MinkWarp:
    """Robots side by side, each with a start and a path of its own.

    Args:
        experiments: What each robot is to do; they differ in nothing but their starts.
        p_WE: Desired positions, shape (samples + 1, robots, 3) [m].
        bounded: Whether the bounds of position, velocity and acceleration are given.
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
        posture_cost: float = 1e-3,
        admm_iters: int = 10,
    ) -> None:
        experiment = experiments[0]
        arm, limits, self._h = experiment.arm, experiment.limits, experiment.document.period
        spec = mujoco.MjSpec.from_string(without_shapes(arm))
        # MuJoCo fuses links without a joint of their own unless told not to, and the flange with
        # them.
        spec.compiler.fusestatic = False
        model = spec.compile()
        model.jnt_range[:] = np.stack((limits.position_lower, limits.position_upper), axis=1)
        q = np.array([each.start for each in experiments])
        self._configuration = mw.Configuration(model, q, len(q), device="cpu")
        self._tool = mw.FrameTask(arm.frame, "body", position_cost=1.0, orientation_cost=0.0)
        posture = mw.PostureTask(model, cost=posture_cost, gain=POSTURE_RATE * self._h)
        posture.set_target(q, configuration=self._configuration)
        self._tasks = [self._tool, posture]
        self._p_WE, self._braking = p_WE, braking
        self._pose = self._configuration.get_transform_frame_to_world(arm.frame, "body").numpy()
        self._target = wp.array(self._pose, dtype=float, device="cpu")
        # On a CPU both are views of the same memory.
        self._p_target = self._target.numpy()[:, 4:]
        if not bounded:
            self._solver = mw.IKSolver(self._configuration)
            return
        velocity = dict(zip(arm.joints, limits.velocity.tolist(), strict=True))
        self._solver = mw.ConstrainedSolver(
            self._configuration,
            limits=[mw.ConfigurationLimit(model, gain=1.0), mw.VelocityLimit(model, velocity)],
            admm_iters=admm_iters,
        )
        own = AccelerationLimit(limits.acceleration, self._solver.v, self._h)
        self._solver.limits.append(own)

    @property
    def q(self) -> Array:
        """Joint positions, shape (robots, n) [rad]."""
        return self._configuration.q.numpy()

    def restart(self, q: Array) -> None:
        """Put the robots, at rest, into postures, shape (robots, n) [rad]."""
        self._configuration.update(q)
        self._solver.v.zero_()

    def step(self, k: int) -> None:
        """Make sample ``k``."""
        pose = self._configuration.get_transform_frame_to_world(
            self._tool.frame_name, self._tool.frame_type
        )
        error = pose.numpy()[:, 4:] - self._p_WE[k]
        share = self._shares(np.sqrt(np.einsum("ij,ij->i", error, error)))
        self._p_target[:] = self._p_WE[k + 1] + (1.0 - share)[:, None] * error
        self._tool.set_target(self._target, configuration=self._configuration)
        self._solver.solve_and_integrate(self._tasks, self._h)

    def _shares(self, errors: Array) -> Array:
        """Return what `Braking.share` does of each error."""
        h, b = self._h, self._braking
        gain = min(b.gain, 1.0 / h)
        errors = np.maximum(errors, 1e-12)
        far = np.minimum(np.sqrt(2.0 * b.deceleration / errors), b.limit / errors)
        return h * np.where(errors * gain * gain <= 2.0 * b.deceleration, gain, far)
