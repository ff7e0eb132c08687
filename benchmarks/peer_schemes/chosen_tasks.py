"""The tasks of the comparison, and our rows in its tables."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.math import RotationMatrix
from pydrake.trajectories import PiecewisePolynomial

from drake_rnn import Experiment, TrajectoryPath, load_experiment
from drake_rnn.robot.rotation import rotation_by
from peer_schemes.behind import JERK, JERK_GAIN
from peer_schemes.ours import Ours
from peer_schemes.tasks import POSITION as POSITION_FEEDBACK
from peer_schemes.tasks import Task

BASE = "slc_nephroid_known"
_LAP = 8.0
_PINV = {"law": {"kind": "pseudoinverse"}}
# Half the opening of the cone [rad], and the time between the knots of its spline [s].
_CONE, _KNOTS = np.deg2rad(20.0), 0.05

POSITION, HELD, CONE = "position", "orientation held", "cone"
_JERK = {"limits.jerk": JERK, "law.kappa": JERK_GAIN}
_ALL = (POSITION, HELD, CONE)
#: Our rows.
OURS = (
    Ours("ours: SLC, J known", "as shipped, kappa 4", BASE),
    Ours(
        "ours: SLC, J known, fast",
        "kappa 30, feedback_limit 0.1",
        BASE,
        changes={"law.kappa": 30.0, "law.feedback_limit": 0.1},
    ),
    Ours(
        "ours: NALJDF",
        "composite_gain 3",
        BASE,
        changes={"law": {"kind": "joint_drift_free", "scheme": "naljdf", "composite_gain": 3.0}},
    ),
    Ours("ours: SLC, J unknown", "as shipped, warm-up", "slc_nephroid_warm_up"),
    Ours("ours: adaptive, J known", "as shipped", "adaptive_nephroid_known"),
    Ours(
        "ours: adaptive, J unknown",
        "braking 0.05, as all rows",
        "adaptive_nephroid",
        changes={"law.braking": POSITION_FEEDBACK.deceleration},
    ),
    Ours("ours: adaptive, J unknown, braking 0.08", "as shipped", "adaptive_nephroid"),
    Ours("ours: adaptive, jerk", "as shipped, 20 rad/s^3, feedback 100", "adaptive_jerk"),
    Ours("ours: adaptive, pose", "as shipped", "adaptive_pose", (CONE,)),
    Ours(
        "ours: adaptive, pose",
        "as shipped",
        "adaptive_pose",
        (HELD,),
        {"path.size": 0.04, "path.cone": 0.0},
    ),
    Ours("ours: adaptive, pose, jerk", "20 rad/s^3, feedback 100", "adaptive_pose", (CONE,), _JERK),
    Ours(
        "ours: adaptive, pose, jerk",
        "20 rad/s^3, feedback 100",
        "adaptive_pose",
        (HELD,),
        {**_JERK, "path.size": 0.04, "path.cone": 0.0},
    ),
    Ours("ours: adaptive, pose, J unknown", "as shipped", "adaptive_pose_learned", (CONE,)),
    Ours("ours: pseudoinverse", "feedback 10, no bounds", BASE, _ALL, _PINV),
)


def chosen_tasks() -> dict[str, Callable[[], Task]]:
    """Return what makes each task, by name."""
    return {
        POSITION: lambda: Task(POSITION, load_experiment(BASE), _LAP, oriented=False),
        HELD: lambda: Task(HELD, _with_pose({}), _LAP, oriented=True),
        CONE: _cone,
    }


def _with_pose(changes: dict[str, float]) -> Experiment:
    return load_experiment(BASE, {"accept": None, "task": "pose", **_PINV, **changes})


def _cone() -> Task:
    """Return half the nephroid, along which the flange's axis moves on a cone and does not spin."""
    experiment = _with_pose({"path.size": 0.02})
    times = np.arange(0.0, experiment.document.duration + 2.0 * _KNOTS, _KNOTS)
    p_WE = np.array([experiment.desired.position(t)[0] for t in times])
    phase = 2.0 * np.pi / _LAP * times
    turn = _CONE * np.stack((np.sin(phase), 1.0 - np.cos(phase), 0.0 * phase), axis=1)
    path = TrajectoryPath(
        trajectory=_spline(times, p_WE),
        orientation=_spline(times, _quaternions(turn, experiment)),
    )
    return Task(CONE, experiment, _LAP, oriented=True, path=path)


def _spline(times: np.ndarray, values: np.ndarray) -> PiecewisePolynomial:
    return PiecewisePolynomial.CubicWithContinuousSecondDerivatives(times, values.T)


def _quaternions(turn: np.ndarray, experiment: Experiment) -> np.ndarray:
    """Return the quaternions of turned orientations, shape (k, 4), without jumps of their sign."""
    found = np.array(
        [RotationMatrix(R @ experiment.R_WE_start).ToQuaternion().wxyz() for R in rotation_by(turn)]
    )
    turns = np.sum(found[1:] * found[:-1], axis=1) < 0.0
    found[1:] *= np.where(np.cumsum(turns) % 2 == 1, -1.0, 1.0)[:, None]
    return found
