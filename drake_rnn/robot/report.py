"""A report on an arm from its model: limits, reach, inertia, weight, and missing data."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import (
    Array,
    checked,
    instance,
    whole,
)
from .arm import Arm
from .clearance.arm_clearance import arm_clearance
from .postures import conditioning, proposed_home, random_postures, structural_rank

# A home posture closer than this to a limit [rad], or with a singular value of the Jacobian this
# small relative to the largest one, makes a poor start.
_NEAR = 0.05
_SINGULAR = 0.02
# Smallest eigenvalue of the mass matrix relative to the largest below which a body has no mass.
_MASSLESS = 1e-7


@dataclass(frozen=True, eq=False)
class ArmReport:
    """Figures of an arm; those of many postures are over random ones within the position limits.

    Attributes:
        arm: The arm.
        home: Its home posture; if it has none, the one that `proposed_home` proposes, shape (n,)
            [rad].
        home_is_proposed: Whether the arm has no home posture.
        p_WE_home: Position of E there in the base frame, shape (3,) [m].
        reach: Smallest and largest distance of E from the base's origin [m].
        mass: Mass of the whole model, base and tool included [kg].
        inertia: Smallest and largest eigenvalue of the mass matrix [kg m^2].
        weight_torque: Largest torque that gravity exerts on each joint, shape (n,) [Nm].
        weight_at_home: Torques that gravity exerts in the home posture, shape (n,) [Nm].
        postures: Number of random postures.
        warnings: Missing data and likely problems, each in one sentence.
    """

    arm: Arm
    home: Array
    home_is_proposed: bool
    p_WE_home: Array
    reach: tuple[float, float]
    mass: float
    inertia: tuple[float, float]
    weight_torque: Array
    weight_at_home: Array
    postures: int
    warnings: tuple[str, ...]

    @property
    def weight_share(self) -> Array:
        """Largest torque of the weight over each motor's limit, shape (n,); 0 without a limit."""
        return self.weight_torque / self.arm.effort

    @property
    def carries_itself(self) -> bool:
        """Whether the motors hold the arm and its tool in all of the random postures."""
        return bool((self.weight_share <= 1.0).all())


# Random postures of which figures are taken.
_MOST_POSTURES = 10**6


@checked(arm=instance(Arm), postures=whole(1, _MOST_POSTURES), seed=whole())
def arm_report(arm: Arm, postures: int = 1000, seed: int = 0) -> ArmReport:
    """Return figures of an arm, and warnings about missing data.

    Args:
        arm: The arm.
        postures: Number of random postures.
        seed: Seed of the random numbers.
    """
    kinematics = arm.kinematics()
    drawn = random_postures(arm, postures, seed)
    home = proposed_home(arm) if arm.home is None else arm.home
    distances = [float(np.linalg.norm(kinematics.p_WE(q))) for q in drawn]
    eigenvalues = np.array([np.linalg.eigvalsh(kinematics.M(q)) for q in drawn])
    torques = np.abs([kinematics.gravity(q) for q in drawn])
    reach = (min(distances), max(distances))
    inertia = (float(eigenvalues.min()), float(eigenvalues.max()))
    plant = arm.plant()
    warnings = [
        *arm.warnings,
        *_unknown(arm),
        *_home_doubts(arm, reach[1]),
        *_weight_doubts(arm, drawn, torques),
        *_model_doubts(arm, inertia),
        *_shape_doubts(arm, home),
    ]
    return ArmReport(
        arm=arm,
        home=home,
        home_is_proposed=arm.home is None,
        p_WE_home=kinematics.p_WE(home),
        reach=reach,
        mass=arm.description.mass_scale * plant.CalcTotalMass(plant.CreateDefaultContext()),
        inertia=inertia,
        weight_torque=torques.max(axis=0),
        weight_at_home=kinematics.gravity(home),
        postures=postures,
        warnings=tuple(warnings),
    )


def _unknown(arm: Arm) -> list[str]:
    """Return a sentence about each kind of limit that is missing for some joints."""
    limits = arm.limits
    found = []
    for name, bound, means in (
        ("velocity", limits.velocity, "laws that bound the velocity let them go at any speed"),
        ("effort", arm.effort, "their motors have no limit at level: dynamic"),
    ):
        if names := _names(arm, ~np.isfinite(bound)):
            found.append(f"{name}: not known for {names}: {means}; give it in a file of limits")
    acceleration = np.full(arm.n, np.inf) if limits.acceleration is None else limits.acceleration
    if names := _names(arm, ~np.isfinite(acceleration)):
        found.append(
            f"acceleration: not known for {names}; a law that needs it is refused without it: give "
            "it in a file of limits, or in the experiment's limits"
        )
    return found


def _home_doubts(arm: Arm, reach: float) -> list[str]:
    if arm.home is None:
        return ["home: not given; an experiment needs it or a start, e.g. the one proposed"]
    limits, found = arm.limits, []
    room = np.minimum(arm.home - limits.position_lower, limits.position_upper - arm.home)
    if names := _names(arm, room < _NEAR):
        found.append(f"home: less than {_NEAR:g} rad from the limits of {names}")
    kinematics = arm.kinematics()
    rank = structural_rank(kinematics, random_postures(arm, 50), reach)
    smallest = float(conditioning(kinematics, arm.home, reach)[rank - 1])
    if smallest < _SINGULAR:
        found.append(
            f"home: near-singular; the smallest singular value of J is {smallest:.2g} of the "
            "largest"
        )
    return found


def _weight_doubts(arm: Arm, drawn: Array, torques: Array) -> list[str]:
    found = []
    for k in np.flatnonzero((torques > arm.effort).any(axis=0)):
        worst = int(np.argmax(torques[:, k]))
        unit = "Nm" if arm.units[k] == "rad" else "N"
        posture = ", ".join(f"{angle:.2f}" for angle in drawn[worst])
        found.append(
            f"effort: the motor of {arm.joints[k]} cannot hold the weight: it may exert "
            f"{arm.effort[k]:g} {unit}, and {torques[worst, k]:.4g} {unit} are needed at "
            f"[{posture}]"
        )
    return found


def _model_doubts(arm: Arm, inertia: tuple[float, float]) -> list[str]:
    found = []
    if inertia[0] < _MASSLESS * inertia[1]:
        found.append(
            f"mass: the smallest eigenvalue of the mass matrix is {inertia[0]:.2g} kg m^2: a joint "
            "moves bodies without mass, which level: dynamic cannot simulate"
        )
    if arm.tip is None:
        found.append("tool: none; to press on a surface give one, e.g. tool: {length: 0.1}")
    return found


def _shape_doubts(arm: Arm, home: Array) -> list[str]:
    """Return what of the arm cannot be kept clear of obstacles and of the arm itself."""
    try:
        return list(arm_clearance(arm, (), home)[1])
    except InvalidInputError as error:
        return [str(error)]


def _names(arm: Arm, chosen: Iterable[object]) -> str:
    """Return the names of the joints that are chosen, empty for none."""
    names = [name for name, flag in zip(arm.joints, chosen, strict=True) if flag]
    return "all joints" if len(names) == arm.n else ", ".join(names)
