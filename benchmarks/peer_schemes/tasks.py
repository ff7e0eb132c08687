"""What all schemes are asked to do, and the feedback that all peers are given."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from drake_rnn import Array, Experiment, Path
from drake_rnn.robot.rotation import rotation_error
from peer_schemes.turns import rotated_by


@dataclass(frozen=True)
class Braking:
    """Feedback with which an error goes to zero, and brakes in time.

    The error decreases at min(e / h, sqrt(2 b e), limit): dead-beat when it is small, unless a gain
    kappa e takes the place of e / h.

    Attributes:
        deceleration: Deceleration b [m/s^2 or rad/s^2].
        limit: Largest speed of the feedback [m/s or rad/s].
        gain: Largest gain kappa of the feedback [1/s], where one sample must not take back all.
    """

    deceleration: float
    limit: float
    gain: float = inf

    def share(self, error: float, period: float) -> float:
        """Return which share of an error is taken back in one period, 0 to 1."""
        gain = min(self.gain, 1.0 / period)
        if error * gain * gain <= 2.0 * self.deceleration:
            return period * gain
        return period * min(sqrt(2.0 * self.deceleration / error), self.limit / error)


POSITION, ROTATION = Braking(0.05, 0.1), Braking(0.25, 0.5)
#: Length by which an orientation error is weighed against a position error [m].
LEVER = 0.3
#: Weight of the posture beside the task, and the rate of its return [1/s].
POSTURE_WEIGHT, POSTURE_RATE = 1e-6, 1.0


class Task:
    """A desired motion, sampled, and the bounds within which it is to be made.

    Args:
        name: Its name.
        experiment: Arm with its limits, start, path, period, duration and window.
        lap: Time in which the path is passed once [s].
        oriented: Whether the orientation is a part of the task.
        path: Path made in Python, in place of that of the experiment; None without one.

    Attributes:
        p_WE: Desired positions at the samples and one more, shape (steps + 2, 3) [m].
        R_WE: Desired orientations, shape (steps + 2, 3, 3).
    """

    def __init__(
        self,
        name: str,
        experiment: Experiment,
        lap: float,
        *,
        oriented: bool,
        path: Path | None = None,
    ) -> None:
        self.path = path
        experiment = experiment if path is None else experiment.with_path(path)
        document = experiment.document
        self.name, self.experiment, self.oriented = name, experiment, oriented
        self.arm, self.limits, self.start = experiment.arm, experiment.limits, experiment.start
        self.period = document.period
        self.steps = round(document.duration / self.period)
        self.window = slice(round(document.window[0] / self.period), self.steps + 1)
        self.lap = round(lap / self.period)
        times = self.period * np.arange(self.steps + 2)
        desired = experiment.desired
        self.p_WE = np.array([desired.position(t)[0] for t in times])
        self.R_WE = np.array([desired.orientation(t)[0] for t in times])

    def target(self, k: int, p_WE: Array, braking: Braking = POSITION) -> Array:
        """Return where the end effector should be at sample ``k + 1``, shape (3,) [m]."""
        ahead = self.p_WE[k + 1]
        x, y, z = (p_WE - self.p_WE[k]).tolist()
        share = braking.share(sqrt(x * x + y * y + z * z), self.period)
        if share == 1.0:
            return ahead
        return ahead + (1.0 - share) * (p_WE - self.p_WE[k])

    def orientation_target(self, k: int, R_WE: Array, braking: Braking = ROTATION) -> Array:
        """Return how the end effector should be oriented at sample ``k + 1``, shape (3, 3)."""
        error = rotation_error(self.R_WE[k], R_WE)
        share = braking.share(sqrt(error @ error), self.period)
        if share == 1.0:
            return self.R_WE[k + 1]
        return rotated_by((1.0 - share) * error, self.R_WE[k + 1])
