"""Measures of the claims about motion-force control that no metric gives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...inputs.fields import Array
from ...laws.parts.programs import PrimalDual
from ..claims import (
    Run,
    signals_of_structure,
)

# Size of the random programs: joints, rows, and the box of velocities [rad/s].
_JOINTS, _ROWS, _BOX = 7, 6, 0.2


def true_jacobians(run: Run, name: str, position_only: bool = False) -> float:
    """True Jacobians among a law's inputs, a number; J of the position alone, or J_omega too.

    Args:
        run: Not needed.
        name: Experiment of the law.
        position_only: Whether J of the position alone counts.
    """
    return signals_of_structure(name, {"J"} if position_only else {"J", "J_omega"})


def effort(run: Run, name: str, changes: Mapping[str, Any] | None = None) -> float:
    """Integral over the run of the squared norm of the joint velocities [rad^2/s].

    Args:
        run: Makes a run.
        name: Experiment.
        changes: Its changes.
    """
    result = run(name, changes)
    return _integral((result.series["velocity"] ** 2).sum(axis=1), result.time)


def work(run: Run, name: str, changes: Mapping[str, Any] | None = None) -> float:
    """Work of all joints against gravity over the run, each taken as positive [J].

    Args:
        run: Makes a run.
        name: Experiment.
        changes: Its changes.
    """
    result = run(name, changes)
    arm = result.experiment.arm.kinematics()
    torque = np.array([arm.gravity(q) for q in result.series["position"]])
    return _integral(np.abs(torque * result.series["velocity"]).sum(axis=1), result.time)


def network_speed(run: Run, name: str, changes: Mapping[str, Any] | None = None) -> float:
    """Largest joint velocity of the network, before noise is added, over its bound [1].

    Args:
        run: Makes a run.
        name: Experiment.
        changes: Its changes.
    """
    result = run(name, changes)
    bound = result.experiment.limits.require("velocity", "the claim")
    return float((np.abs(result.series["network_velocity"]) / bound).max())


def tip_off_the_start(run: Run, name: str, changes: Mapping[str, Any] | None = None) -> float:
    """Distance of the tip along the surface, at the end of the run, from its start [m].

    Args:
        run: Makes a run.
        name: Experiment, on a horizontal surface.
        changes: Its changes.
    """
    p_WE = run(name, changes).series["p_WE"]
    return float(np.linalg.norm(p_WE[-1, :2] - p_WE[0, :2]))


def third_element_apart(run: Run, squared: bool = False) -> float:
    """Largest distance of two rotations with the same w, in the elements that w leaves out [1].

    Of random rotations R, and of diag(-1, 1, 1) R diag(-1, 1, 1), whose b and c differ from those
    of R in the signs of b1 and c1 alone.

    Args:
        run: Not needed.
        squared: Whether the squares of these elements are compared.
    """
    rng, apart = np.random.default_rng(0), 0.0
    flip = np.diag([-1.0, 1.0, 1.0])
    for _ in range(100):
        R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        one, other = R[0, 1:], (flip @ R @ flip)[0, 1:]
        if squared:
            one, other = one**2, other**2
        apart = max(apart, float(np.abs(one - other).max()))
    return apart


def residual_at_rest(run: Run, seconds: float) -> float:
    """Largest residual of the constraints, network held for a time, of three programs [m/s].

    The programs are drawn, have a solution, and most have active bounds. Where both network and
    residual are at rest, its velocity is the program's optimum, which is convex.

    Args:
        run: Not needed.
        seconds: Time from zero multipliers, at a time constant of 1 ms [s].
    """
    worst = 0.0
    box = np.full(_JOINTS, _BOX)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        rows = 0.6 * rng.normal(size=(_ROWS, _JOINTS))
        aims = rows @ (_BOX * rng.choice([-0.98, 0.5, 0.98], _JOINTS))
        network = PrimalDual(rows, rows, aims, -box, box, 1e-3)
        z = network.after(np.zeros(_JOINTS + _ROWS), seconds)
        worst = max(worst, float(np.abs(rows @ z[:_JOINTS] - aims).max()))
    return worst


def _integral(values: Array, time: Array) -> float:
    return float((values[1:] + values[:-1]) @ np.diff(time) / 2.0)
