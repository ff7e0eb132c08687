"""The cells of the cross table: every law on every shipped arm, at both levels; and every system.

Every arm follows, for two laps, a circle that is the same share of its length; or seeks a posture;
or presses along the circle. Laws have the gains of their shipped experiments, or their defaults.

A system is an arm with something else to do, or something else to move: one lap of the same circle
with other keys of the document, whatever law it is given.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from drake_rnn import Arm, SelfMotion, load_arm

Document = dict[str, Any]

LEVELS = ("kinematic", "dynamic")
# Radius of the circle as a share of the arm's length, and time of a lap from rest to rest [s].
_SHARE, _LAP = 0.03, 8.0
# The same of a system [s].
_SYSTEM_LAP = 4.0
_LIMITS = {"velocity": 0.5, "acceleration": 1.0}
# For laws that bound these as well.
_HIGHER = {"jerk": 5.0, "snap": 50.0, "crackle": 500.0}
# Largest joint displacement of the target posture [rad], and time to seek it [s].
_AWAY, _SEEK = 0.3, 4.0
# Postures with the tool straight down, where the home posture is another [rad].
_DOWN = {"ur5": [0.0, -1.8, 1.9, -1.6707963267948966, -1.5707963267948966, 0.0]}
_FORCE, _STIFFNESS = 5.0, 8000.0


def _slc(**changes: Any) -> Document:
    return {"kind": "simultaneous_learning", **changes}


def _jdf(scheme: str) -> Document:
    return {"kind": "joint_drift_free", "scheme": scheme}


def _zeroing(**changes: Any) -> Document:
    return {"law": {"kind": "zeroing", "gain": 200.0, **changes}}


def _projection(**changes: Any) -> Document:
    return {"law": {"kind": "projection", **changes}}


# What a document has of its own, by variant.
_ALONG: dict[str, Document] = {
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
_SEEKING: dict[str, Document] = {
    "null-space adjustment": {"law": {"kind": "null_space_adjustment"}},
    "state adjustment": {"law": {"kind": "state_adjustment"}},
    "modified state adjustment": {"law": {"kind": "state_adjustment", "rise_time": 3.0}},
}
_PRESSING: dict[str, Document] = {
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
# Laws that follow no circle of velocities, which systems are tried with as well.
_ELSEWHERE: dict[str, Document] = {
    "joint stream": {"law": {"kind": "joint_stream"}},
    "joint torque": {"law": {"kind": "joint_torque", "bounds": "joints"}},
    "computed torque": {"law": {"kind": "joint_torque", "network": "none", "torque_weight": 0}},
}
#: All of them.
ALL_VARIANTS = (*VARIANTS, *_ELSEWHERE)


def document(variant: str, arm_name: str, level: str, lap: float = _LAP) -> Document:
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


@dataclass(frozen=True)
class System:
    """A kind of system: what a document has beside its law.

    Attributes:
        says: What it is, for the page.
        keys: Its keys, of an arm and a level.
        measures: Metrics of its errors beside that of the path, by what a column says of them.
        path: Metric of the path.
        lap: Time of its one lap [s].
        levels: Levels at which laws of velocities may have it.
        law: The variant with which it is tried on every arm.
    """

    says: str
    keys: Callable[[str, str], Document]
    measures: dict[str, str] = field(default_factory=dict)
    path: str = "position_error_max_m"
    lap: float = _SYSTEM_LAP
    levels: tuple[str, ...] = LEVELS
    law: str = "adaptive, known J"


def _axis(arm: str, _: str) -> Document:
    """Position, and where the tool's axis points; the turn about it is free."""
    toward = (_arm(arm).kinematics().R_WE(_arm(arm).home) @ [0.0, 0.0, 1.0]).tolist()
    axis = {"kind": "axis", "axis": [0.0, 0.0, 1.0], "toward": toward}
    return {"task": [{"kind": "position"}, axis]}


def _remote_centre(arm: str, _: str) -> Document:
    """A long tool that passes through a point, 0.2 m behind its tip."""
    tool = {"length": 0.35, "ball": 0.004, "mass": 0.2}
    return {
        "arm": {"model": arm, "tool": tool},
        "task": [{"kind": "position"}, {"kind": "remote_centre", "depth": 0.2}],
        **_down(arm),
    }


def _two_tools(arm: str, level: str) -> Document:
    """Two arms face to face: their centre is led, one tool stays as the other one sees it."""
    x, y, _ = 2.3 * _arm(arm).kinematics().p_WE(_arm(arm).home)
    base = {"translation": [x, y, 0.0], "rpy": [0.0, 0.0, np.pi]}
    task: list[Document] = [{"kind": "position"}, {"kind": "orientation"}]
    return {
        "arm": {"model": arm, "pair": {"arm": arm, "base": base}},
        "task": [*task, *({**objective, "of": "relative"} for objective in task)],
    }


def _based(drive: str) -> Callable[[str, str], Document]:
    def keys(arm: str, _: str) -> Document:
        circle = {"kind": "circle", "size": _BASE_SHARE * _length(_arm(arm)), "period": _BASE_LAP}
        return {
            "arm": {"model": arm, "base": {**_BASE, "drive": drive}},
            "path": {**circle, "plane": "xy", "timing": "sin2", "laps": 1},
        }

    return keys


def _eye_in_hand(arm: str, _: str) -> Document:
    """A camera on the tool that sees three points, which stand 0.3 to 0.4 m before it."""
    kinematics = _arm(arm).kinematics()
    p, R = kinematics.p_WE(_arm(arm).home), kinematics.R_WE(_arm(arm).home)
    seen = ([0.05, 0.1, 0.35], [-0.1, -0.05, 0.3], [0.05, -0.12, 0.4])
    points = [(p + R @ np.array(point)).tolist() for point in seen]
    camera = {"mount": "tool", "position": [0.06, 0.0, -0.05], "look_at": [0.0, 0.0, 0.3]}
    return {"camera": {**camera, "points": points}, "period": 1e-2}


def _touch(arm: str, level: str) -> Document:
    """A path that gives way until the tool presses, from 5 mm before the surface."""
    surface = _SURFACES.get(level, _SURFACES["dynamic"])
    force = {"kind": "admittance", "value": _FORCE, "largest": 8, "surface_stiffness": 12000}
    return {
        "arm": {"model": arm, "frame": _arm(arm).frame},
        "environment": {**surface, "gap": 5e-3},
        "force": {**force, "tracking": 3e-5},
        "feedback": "measured" if level != "kinematic" else "commanded",
        **_down(arm),
    }


_BASE = {"model": "cart"}
# Radius of the circle of a mobile base as a share of the arm's length, and time of its lap [s].
_BASE_SHARE, _BASE_LAP = 0.15, 8.0
#: Kinds of systems by name.
SYSTEMS = {
    "part of a pose": System(
        "position, and where the tool's axis points", _axis, {"axis [rad]": "axis_error_max_rad"}
    ),
    "remote centre": System(
        "a tool of 0.35 m passes through a point 0.2 m behind its tip",
        _remote_centre,
        {"centre [m]": "remote_centre_error_max_m"},
    ),
    "two tools": System(
        "two arms face to face: their centre is led, one tool stays as the other one sees it",
        _two_tools,
        {"between tools [m]": "frame_position_error_max_m"},
    ),
    "mobile base": System("a holonomic cart carries the arm", _based("holonomic"), lap=_BASE_LAP),
    "differential base": System(
        "the same cart, which cannot move sideways",
        _based("differential"),
        {"slip [m/s]": "base_slip_max_m_s"},
        lap=_BASE_LAP,
    ),
    "eye in hand": System(
        "the tool's camera sees three points that stand, at 100 Hz",
        _eye_in_hand,
        {"image [px]": "pixel_error_max_px"},
        law="adaptive, learned",
    ),
    "touch": System(
        "an admittance presses with 5 N, from 5 mm away, on the surfaces above",
        _touch,
        {"force [N]": "force_error_max_N"},
        "lateral_error_max_m",
    ),
    "torques": System(
        "the arm with mass, led by torques alone",
        lambda arm, level: {},
        {"torque / limit [-]": "torque_ratio_max"},
        levels=("torque",),
        law="joint torque",
    ),
}
#: Variants of laws that each system is given, and the arm with which it is.
SYSTEM_VARIANTS = (
    *("slc, known J", "slc, learned by warm-up", "adaptive, known J", "adaptive, learned"),
    *("naljdf", "recursive, n = 1", "pseudoinverse", "pseudoinverse, filtered"),
    *("receding horizon", "zeroing", "zeroing, learned", "projection, lvi"),
    *("null-space adjustment", "state adjustment", "motion-force, known J", *_ELSEWHERE),
)
SYSTEM_ARM = "panda"


def system_variants(system: str, arm_name: str) -> tuple[str, ...]:
    """Return the variants with which a system is tried on an arm."""
    return SYSTEM_VARIANTS if arm_name == SYSTEM_ARM else (SYSTEMS[system].law,)


def system_levels(system: str, variant: str, arm_name: str) -> tuple[str, ...]:
    """Return the levels at which a system is tried with a law; the first one on other arms."""
    if law_of(variant)["kind"] == "joint_torque":
        return ("torque",)
    levels = SYSTEMS[system].levels
    return levels if arm_name == SYSTEM_ARM else levels[:1]


def system_document(system: str, variant: str, arm_name: str, level: str) -> Document:
    """Return the document of a cell of a system.

    Args:
        system: One of `SYSTEMS`.
        variant: One of `SYSTEM_VARIANTS`.
        arm_name: Name of a shipped arm.
        level: One of `system_levels`.
    """
    kind, own = SYSTEMS[system], _own(variant)
    circle = {"kind": "circle", "size": _SHARE * _length(_arm(arm_name)), "period": kind.lap}
    contents: Document = {
        "name": f"{system}, {variant}, {arm_name}, {level}",
        "arm": arm_name,
        "path": {**circle, "timing": "sin2", "laps": 1},
        "level": level,
        "period": 1e-3,
        "duration": kind.lap,
        "window": [kind.lap / 2, kind.lap],
    }
    contents |= {**own, **kind.keys(arm_name, level)}
    if level == "torque":
        contents |= {"feedback": "measured", "period": 1e-3}
    if variant in _SEEKING:
        based = isinstance(contents["arm"], dict) and "base" in contents["arm"]
        contents["law"] = {**own["law"], "target": _target(arm_name, based).tolist()}
        del contents["path"]
    contents["limits"] = {**_LIMITS, **own.get("limits", {})}
    return contents


def _own(variant: str) -> Document:
    """Return what documents of a variant have of their own."""
    return {**_ALONG, **_SEEKING, **_PRESSING, **_ELSEWHERE}[variant]


def law_of(variant: str) -> Document:
    """Return the section of a variant's law."""
    return dict(_own(variant)["law"])


def _down(arm_name: str) -> Document:
    return {"start": _DOWN[arm_name]} if arm_name in _DOWN else {}


@cache
def _arm(name: str) -> Arm:
    arm = load_arm(name)
    return arm.replace(frame=arm.tip)


@cache
def _target(arm_name: str, based: bool = False) -> np.ndarray:
    arm = load_arm(arm_name, base=_BASE) if based else _arm(arm_name)
    return SelfMotion(arm, arm.home, "xy" if arm_name == "planar6" else "xyz").somewhere(_AWAY)


def _length(arm: Arm) -> float:
    """Return the length of the arm along its bodies, from the base to the task frame [m]."""
    skeleton = arm.kinematics().skeleton(arm.home)
    return float(np.linalg.norm(np.diff(skeleton, axis=0), axis=1).sum())
