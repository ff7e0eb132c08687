"""What a page shows of a running experiment: numbers of each moment, and peaks since the last."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..experiment import Experiment
from ..inputs.fields import Array
from ..measures import Steps
from ..robot.rotation import rotation_error
from .segment import Segment

# Derivatives of the commanded positions of which shares of the bounds are shown.
_DERIVATIVES = ("velocity", "acceleration", "jerk")


@dataclass(frozen=True)
class Shown:
    """A number that is shown over time, as the page draws it.

    Attributes:
        key: Name in the page.
        name: Name that the page shows.
        unit: SI unit; "1" for a ratio.
        log: Whether a logarithmic axis suits it.
        bound: Upper bound, or lower bound if ``above``; None without one.
        above: Whether the values must stay above the bound.
    """

    key: str
    name: str
    unit: str
    log: bool = False
    bound: float | None = None
    above: bool = False

    def as_data(self) -> dict[str, Any]:
        """Return it as the page reads it."""
        scale = "log" if self.log else "linear"
        told = {"key": self.key, "name": self.name, "unit": self.unit, "scale": scale}
        return {**told, "bound": self.bound, "above": self.above}


def shown_numbers(experiment: Experiment) -> tuple[Shown, ...]:
    """Return the numbers that are shown of an experiment and of its variants, in their order."""
    pressed = experiment.contact is not None
    found = []
    if pressed:
        found += [Shown("force", "contact force", "N")]
        found += [Shown("force_desired", "desired force", "N")]
    name = "error along the surface" if pressed else "position error"
    found += [Shown("position_error", name, "m", log=True)]
    if experiment.holds_orientation:
        found += [Shown("orientation_error", "orientation error", "rad", log=True)]
    if experiment.clearance is not None:
        found += [Shown("distance", "least distance", "m", bound=0.0, above=True)]
    found += [Shown("jacobian_error", "error of Ĵ", "m", log=True)]
    for name in _DERIVATIVES:
        bound = experiment.limits.bounds[name]
        if bound is not None and np.isfinite(bound).any():
            found += [Shown(f"{name}_ratio", f"{name} / bound", "1", bound=1.0)]
    found += [Shown("margin", "to nearest joint limit", "rad", bound=0.0, above=True)]
    return tuple(found)


class Peaks:
    """The largest shares of bounds that the command has used since they were last asked for.

    Args:
        experiment: The experiment, with the limits of the joints.
    """

    def __init__(self, experiment: Experiment) -> None:
        self._limits = experiment.limits
        self.clear()

    def clear(self) -> None:
        """Begin anew."""
        self._ratios, self._margin = dict.fromkeys(_DERIVATIVES, 0.0), np.inf
        self._before: tuple[Array, Array] | None = None

    def add(self, steps: Steps, v: Array) -> None:
        """Add steps, the first of which ended the steps before.

        Args:
            steps: Recorded steps.
            v: Velocity that the law commanded at each, shape (k, n) [rad/s].
        """
        held = np.diff(steps.time)[:, None]
        if not held.size:
            return
        a = np.diff(v, axis=0) / held
        first = a[:1] if self._before is None else self._before[0]
        jerk = np.diff(np.concatenate((first, a)), axis=0) / held
        self._before = a[-1:], v[-1:]
        values = {"velocity": v, "acceleration": a, "jerk": jerk}
        for name, each in values.items():
            if (bound := self._limits.bounds[name]) is not None:
                share = float((np.abs(each) / bound).max())
                self._ratios[name] = max(self._ratios[name], share)
        commanded = "position_commanded" in steps.layout
        q = steps.series("position_commanded" if commanded else "position")
        limits = self._limits
        room = np.minimum(q - limits.position_lower, limits.position_upper - q)
        self._margin = min(self._margin, float(room.min()))

    def taken(self) -> dict[str, float]:
        """Return the shares and the least distance to a joint limit, and begin anew."""
        found = {f"{name}_ratio": share for name, share in self._ratios.items()}
        found["margin"] = self._margin
        before = self._before
        self.clear()
        self._before = before
        return found


def numbers_now(segment: Segment, t: float) -> dict[str, float]:
    """Return the numbers of this moment, by key.

    Args:
        segment: The simulation that runs.
        t: Time of the segment [s].
    """
    experiment, loop, root = segment.experiment, segment.loop, segment.root
    body = loop.arm.GetMyContextFromRoot(root)
    q = loop.arm.GetOutputPort("position").Eval(body)
    kinematics = loop.arm.kinematics
    p_WE, away = kinematics.p_WE(q), np.zeros(3)
    axes = list(experiment.task.axes)
    away[axes] = (p_WE - experiment.desired.position(t)[0])[axes]
    found: dict[str, float] = {}
    if experiment.contact is not None:
        n = experiment.contact.surface.normal_W
        away = away - n.dot(away) * n
        force = loop.arm.GetOutputPort("contact_force").Eval(body)
        found["force"] = float(n.dot(force))
        found["force_desired"] = experiment.contact.force.at(t)
    found["position_error"] = float(np.linalg.norm(away))
    if experiment.holds_orientation:
        turned = rotation_error(kinematics.R_WE(q), experiment.desired.orientation(t)[0])
        found["orientation_error"] = float(np.linalg.norm(turned))
    if experiment.clearance is not None:
        motions = experiment.motions
        gaps = experiment.clearance.gaps(q, None if motions is None else motions.at(t))
        found["distance"] = float(gaps.min(initial=np.inf))
    layout = loop.controller.reading.state
    if "J_hat" in layout:
        J_hat = layout.part(segment.x, "J_hat")
        found["jacobian_error"] = float(np.linalg.norm(J_hat - experiment.task.J(kinematics, q)))
    return found
