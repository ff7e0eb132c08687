"""The cells of the cross table: every law on every shipped arm, at both levels.

Every arm follows, for two laps, a circle that is the same share of its length; or seeks a posture;
or presses along the circle. Laws have the gains of their shipped experiments, or their defaults.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from drake_rnn import Arm, SelfMotion, load_arm

LEVELS = ("kinematic", "dynamic")
# Radius of the circle as a share of the arm's length, and time of a lap from rest to rest [s].
_SHARE, _LAP = 0.03, 8.0
_LIMITS = {"velocity": 0.5, "acceleration": 1.0}
# For laws that bound these as well.
_HIGHER = {"jerk": 5.0, "snap": 50.0, "crackle": 500.0}
# Largest joint displacement of the target posture [rad], and time to seek it [s].
_AWAY, _SEEK = 0.3, 4.0
# Postures with the tool straight down, where the home posture is another [rad].
_DOWN = {"ur5": [0.0, -1.8, 1.9, -1.6707963267948966, -1.5707963267948966, 0.0]}
_FORCE, _STIFFNESS = 5.0, 8000.0


def _slc(**changes: Any) -> dict[str, Any]:
    return {"kind": "simultaneous_learning", **changes}


def _jdf(scheme: str) -> dict[str, Any]:
    return {"kind": "joint_drift_free", "scheme": scheme}


def _zeroing(**changes: Any) -> dict[str, Any]:
    return {"law": {"kind": "zeroing", "gain": 200.0, **changes}}


def _projection(**changes: Any) -> dict[str, Any]:
    return {"law": {"kind": "projection", **changes}}


# What a document has of its own, by variant.
_ALONG: dict[str, dict[str, Any]] = {
    "slc, known J": {"law": _slc(jacobian="known")},
    "slc, learned by warm-up": {
        "law": _slc(
            kappa=15.0,
            feedback_limit=0.1,
            rho=1e-3,
            warm_up={"pulse": 0.2, "acceleration": 0.5},
        )
    },
    "slc, learned from noise": {
        "law": _slc(),
        "dither": {"model": "actuated", "sigma": 0.03, "hold": 1e-3},
    },
    "adaptive, known J": {"law": {"kind": "adaptive"}},
    "adaptive, learned": {"law": {"kind": "adaptive", "jacobian": "learned"}},
    "man": {"law": _jdf("man")},
    "galjdf": {"law": _jdf("galjdf")},
    "naljdf": {"law": _jdf("naljdf")},
    "moaljdf": {"law": _jdf("moaljdf")},
    "recursive, n = 1": {"law": {"kind": "recursive", "gains": [300.0]}},
    "recursive, n = 5": {
        "law": {
            "kind": "recursive",
            "reading": "filters",
            "gains": [300.0, 1e4, 2e4, 2e4, 2e4],
            "time_constants": [1e-4, 0.9, 0.8, 0.7, 0.7],
        },
        "limits": _HIGHER,
    },
    "pseudoinverse": {"law": {"kind": "pseudoinverse"}},
    "pseudoinverse, filtered": {
        "law": {"kind": "pseudoinverse"},
        "limits": _HIGHER,
        "filter": {"kind": "moving_average", "precompensate": True},
        "feedback": "unfiltered",
    },
    "receding horizon": {"law": {"kind": "receding_horizon"}, "limits": _HIGHER, "period": 1e-2},
    "zeroing": _zeroing(),
    "zeroing, noise-tolerant": _zeroing(integral_gain=50.0),
    "zeroing, four step": _zeroing(discretization="four_step"),
    "zeroing, prescribed": _zeroing(prescribed={}),
    "zeroing, learned": _zeroing(jacobian="learned"),
    "projection, lvi": _projection(),
    "projection, dual": _projection(network="dual"),
    "projection, simplified": _projection(network="simplified_lvi", bounds="velocity"),
    "projection, iterated": _projection(discretization="iterated", bounds="velocity"),
}
_SEEKING: dict[str, dict[str, Any]] = {
    "null-space adjustment": {"law": {"kind": "null_space_adjustment"}},
    "state adjustment": {"law": {"kind": "state_adjustment"}},
    "modified state adjustment": {"law": {"kind": "state_adjustment", "rise_time": 3.0}},
}
_PRESSING: dict[str, dict[str, Any]] = {
    "motion-force, known J": {"law": {"kind": "motion_force", "stiffness": _STIFFNESS}},
    "motion-force, learned J": {
        "law": {"kind": "motion_force", "stiffness": _STIFFNESS, "jacobian": "learned"},
        "dither": {"model": "actuated", "sigma": 5e-3, "hold": 1e-3},
    },
}
#: Surfaces that the tool presses against, by level.
_SURFACES = {
    "kinematic": {"kind": "elastic_surface", "stiffness": _STIFFNESS},
    "dynamic": {"kind": "plate", "friction": 0.3},
}
#: Names of the laws' variants.
VARIANTS = (*_ALONG, *_SEEKING, *_PRESSING)


def document(variant: str, arm_name: str, level: str, lap: float = _LAP) -> dict[str, Any]:
    """Return the document of a cell.

    Args:
        variant: One of `VARIANTS`.
        arm_name: Name of a shipped arm.
        level: One of `LEVELS`.
        lap: Time of a lap [s].
    """
    arm = _arm(arm_name)
    contents = {
        "name": f"{variant}, {arm_name}, {level}",
        "arm": {"model": arm_name, "frame": arm.tip},
        "task": "xy" if arm_name == "planar6" else "xyz",
        "level": level,
        "period": 1e-3,
    }
    if variant in _SEEKING:
        own = _SEEKING[variant]
        law = {**own["law"], "target": _target(arm_name).tolist()}
        contents |= {"duration": _SEEK, "law": law}
    else:
        own = _ALONG.get(variant) or _PRESSING[variant]
        circle = {"kind": "circle", "size": _SHARE * _length(arm), "period": lap}
        contents |= {"path": {**circle, "timing": "sin2", "laps": 2}, "law": own["law"]}
        contents |= {"duration": 2 * lap, "window": [lap, 2 * lap]}
    if variant in _PRESSING:
        contents["environment"] = _SURFACES[level]
        contents["force"] = {"value": _FORCE, "rise_time": 1.0}
        if arm_name in _DOWN:
            contents["start"] = _DOWN[arm_name]
    limits = {**_LIMITS, **own.get("limits", {})}
    return {**contents, **{k: v for k, v in own.items() if k != "law"}, "limits": limits}


@cache
def _arm(name: str) -> Arm:
    arm = load_arm(name)
    return arm.replace(frame=arm.tip)


@cache
def _target(arm_name: str) -> np.ndarray:
    arm = _arm(arm_name)
    return SelfMotion(arm, arm.home, "xy" if arm_name == "planar6" else "xyz").somewhere(_AWAY)


def _length(arm: Arm) -> float:
    """Return the length of the arm along its bodies, from the base to the task frame [m]."""
    skeleton = arm.kinematics().skeleton(arm.home)
    return float(np.linalg.norm(np.diff(skeleton, axis=0), axis=1).sum())
