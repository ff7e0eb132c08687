r"""Mobile bases: the differential drive, what is measured of a base, and its floor in a playback.

A base is part of an arm (`drake_rnn.robot.arm_description.BaseDescription`): three joints, x, y and
yaw. A holonomic one is moved like any other joints. A differential drive never moves sideways,

.. math::
    \dot x \sin\theta - \dot y \cos\theta = 0,

which no function of the joints expresses. `DifferentialDrive` is a reading around the law's own:
the law chooses the quasi-velocities u (forward) and w (turning), in place of those of x and y. It
sees J in the axes of the base, with a zero column for the way aside, and its box and its stop are
those of u and w, so that all of its bounds hold as they do without a base. For a period h in which
u and w are held, the base goes along an arc; its chord has the direction of the middle of the turn,

.. math::
    (\dot x, \dot y) = u \, \mathrm{sinc}(w h / 2) \, (\cos, \sin)(\theta + w h / 2),

so that at each sample the base is where a drive that never slips would be.

The equation as a row of the law's program was the other way. Its row turns with the base, so that
x and y cannot both brake as hard as they may: the stop that keeps every bound would not be one of
the program's points, and the box could be empty.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from pydrake.geometry import Rgba

from .. import colours
from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..laws.call_checks import without_checks
from ..laws.law import Layout, ReadingWrapper, SampledReading, Signals
from ..measures import Motion
from ..measures.metric import Metric
from ..robot.arm import Arm
from ..robot.limits import JointLimits
from .feature import EvaluationSteps, Feature, LegendEntry, LoopPart, SceneItem, Stage

# Places of the base's joints among an arm's; parts of the state.
_X, _Y, _YAW = 0, 1, 2
_QUASI, _ESTIMATE, _COMMANDED = "quasi_velocity", "J_hat", "commanded"
#: Signals that a law of a differential drive may see.
SEEN = frozenset(
    ("J", "position", *(f"{x}_{of}" for x in "pR" for of in ("WE", "WE_desired", "preview")))
)


def chord(heading: Array, speed: Array, turning: Array, period: float) -> tuple[Array, Array]:
    """Return the velocities of x and y that lead a drive along an arc, shape (...) [m/s].

    Args:
        heading: Yaw where the arc begins, shape (...) [rad].
        speed: Speed along it, shape (...) [m/s].
        turning: Velocity of the yaw, shape (...) [rad/s].
        period: Time for which both are held [s].
    """
    half = 0.5 * period * turning
    along = speed * np.sinc(half / np.pi)
    return along * np.cos(heading + half), along * np.sin(heading + half)


@dataclass(frozen=True)
class DifferentialDrive(ReadingWrapper, LoopPart):
    """What makes the base of an arm a differential drive: a reading around the law's own."""

    def around(self, reading: SampledReading) -> SampledReading:
        """See `ReadingWrapper.around`.

        Raises:
            InvalidInputError: If the law sees what is not in the axes of the base.
        """
        others = set(reading.inputs.parts) - SEEN
        if others or not reading.holds_command:
            what = ", ".join(sorted(others)) or "its command varies between samples"
            raise InvalidInputError(
                f"arm.base.drive: must be holonomic, not differential: with this law ({what})"
            )
        return DriveReading(reading)


@dataclass(frozen=True, eq=False)
class DriveReading(SampledReading):
    """A reading around another one, whose first three velocities are those of a drive.

    The part ``v`` of its state is what moves the joints; ``quasi_velocity`` what the other one has
    chosen: forward, aside, which counts for nothing, and turning, shape (3,) [m/s, m/s, rad/s].

    Attributes:
        reading: The other one.
    """

    reading: SampledReading

    @cached_property
    def state(self) -> Layout:
        return Layout(**self._own.shapes, **{_QUASI: (3,)})

    @cached_property
    def inputs(self) -> Layout:
        # The heading, also for a law that does not look at joint positions.
        return Layout(**{"position": self._own.shapes["v"], **self.reading.inputs.shapes})

    @property
    def observables(self) -> Layout:
        return self.reading.observables

    @property
    def integration_scheme(self) -> str:
        return self.reading.integration_scheme

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        x = self.reading.initial_state(rng, self._view(u, u["position"]))
        return np.concatenate((x, np.zeros(3)))

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        own = self._law_state(x)
        commanded = self._own.part(own, _COMMANDED) if _COMMANDED in self._own else u["position"]
        after = np.asarray(self._step(t, own, self._view(u, commanded), period))
        v = np.array(self._own.part(after, "v"))
        quasi = v[:3].copy()
        v[_X], v[_Y] = chord(u["position"][_YAW], quasi[0], quasi[2], period)
        parts = {"v": v}
        if _COMMANDED in self._own and _ESTIMATE not in self._own:
            # What the law counts as the way forward has no place to return to.
            counted = np.array(self._own.part(after, _COMMANDED))
            counted[:2] = self._own.part(own, _COMMANDED)[:2]
            parts[_COMMANDED] = counted
        return np.concatenate((self._own.with_parts(after, **parts), quasi))

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        own = x[..., : self._own.size]
        return self.reading.diagnostics(t, own, self._view(u, u["position"]))

    def caveats(self, metrics: Mapping[str, float]) -> list[str]:
        return self.reading.caveats(metrics)

    @property
    def _own(self) -> Layout:
        return self.reading.state

    @cached_property
    def _step(self) -> Any:
        return without_checks(self.reading.step)

    def _law_state(self, x: Array) -> Array:
        """Return the state of the law, whose velocities are its own."""
        own, quasi = x[: self._own.size], x[self._own.size :]
        v = np.concatenate((quasi, self._own.part(own, "v")[3:]))
        own = self._own.with_parts(own, v=v)
        if _ESTIMATE not in self._own:
            return own
        estimate = np.array(self._own.part(own, _ESTIMATE))
        estimate[..., _Y] = 0.0
        return self._own.with_parts(own, **{_ESTIMATE: estimate})

    def _view(self, u: Signals, commanded: Array) -> Signals:
        """Return the signals in the axes of the base.

        Args:
            u: The signals.
            commanded: Where the law counts its joints, whose first one is the way forward.
        """
        position = np.array(u["position"])
        heading = np.asarray(position[..., _YAW])[..., None]
        seen = {**u, "position": position}
        position[..., :2] = commanded[..., :2]
        if "J" in u:
            J = np.array(u["J"])
            J[..., _X] = np.cos(heading) * u["J"][..., _X] + np.sin(heading) * u["J"][..., _Y]
            J[..., _Y] = 0.0
            seen["J"] = J
        return seen


def drive_of(arm: Arm) -> DifferentialDrive | None:
    """Return what makes the base of an arm a differential drive; None if it is none."""
    is_one = arm.base is not None and arm.base.drive == "differential"
    return DifferentialDrive() if is_one else None


def implied_limits(arm: Arm) -> Arm:
    """Return an arm with the bounds of x and y that follow from those of a differential drive.

    The speed forward and its acceleration a, with the turning w, bound the accelerations of x and y
    by a + u w. Of higher derivatives no bounds are said.
    """
    if drive_of(arm) is None:
        return arm
    bounds = {name: bound for name, bound in arm.limits.bounds.items() if bound is not None}
    speed, turning = arm.limits.velocity[_X], arm.limits.velocity[_YAW]
    changes = {"velocity": np.array(bounds["velocity"])}
    changes["velocity"][:2] = speed
    for name in ("acceleration", "jerk", "snap", "crackle"):
        if name in bounds:
            changes[name] = np.array(bounds[name])
            is_first = name == "acceleration"
            changes[name][:2] = bounds[name][_X] + speed * turning if is_first else np.inf
    return arm.with_limits(arm.limits.replace(**changes))


_METRICS = (
    Metric(
        "base_slip_max_m_s",
        "largest speed of a differential drive's base to its side, in the middle of a step",
        shown=("path",),
        of=lambda motion, against: _values(motion, "base_motion", 1),
    ),
    Metric(
        "base_speed_ratio_max",
        "largest speed of a differential drive, forward or turning, over its limit",
        shown=("path",),
        of=lambda motion, against: _values(motion, "base_motion", 3),
    ),
    Metric(
        "base_acceleration_ratio_max",
        "largest acceleration of a differential drive, forward or turning, over its limit",
        shown=("path",),
        of=lambda motion, against: _values(motion, "base_motion", 4),
    ),
)


def _values(motion: Motion, name: str, column: int) -> Array | None:
    series = motion.features.get(name)
    return None if series is None else np.abs(series[..., column])


class DrawnFloor(SceneItem):
    """The way of a mobile base over its floor.

    Args:
        stage: Where it is drawn.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    @property
    def corners(self) -> Array:
        way = self._way
        return np.concatenate((way.min(axis=0)[None], way.max(axis=0)[None])) if len(way) else way

    @property
    def _way(self) -> Array:
        arm = self._stage.arm.arm
        position = np.asarray(self._stage.motion.position)
        names = () if arm.base is None else arm.base.joints[:2]
        places = [arm.joints.index(name) for name in names if name in arm.joints]
        if len(places) < 2:
            return np.zeros((0, 3))
        way = np.zeros((len(position), 3))
        way[:, :2] = position[:, places]
        return way

    def draw(self) -> list[str]:
        way = self._way
        if len(way) > 1:
            lift = np.array([0.0, 0.0, 2e-3])
            points = (way[:: max(1, len(way) // 500)] + lift).T
            ink = Rgba(*colours.components(colours.BOUND), 1.0)
            self._stage.meshcat.SetLine("/base_way", points, 3.0, ink)
        return []


_NO_ACCELERATION = (
    "arm.base.acceleration: no limit is given for {}, so nothing bounds or judges how fast the "
    "base starts and stops; give it there or in limits.acceleration"
)


class BaseFeature(Feature):
    """A mobile base, of the section ``arm``."""

    key = "arm"
    metrics = _METRICS

    def doubts(self, experiment: Any) -> list[str]:
        if experiment.arm.base is None:
            return []
        if drive_of(experiment.arm) is not None:
            experiment.limits.require_one_bound("a base with a differential drive")
        arm, known = experiment.arm, experiment.limits.acceleration
        free = [
            name
            for joint, name in enumerate(arm.base.joints)
            if known is None or not np.isfinite(known[joint])
        ]
        # Of a differential drive the limits of x and y follow from that of the way forward.
        return [_NO_ACCELERATION.format(", ".join(free))] if free else []

    def observe(self, experiment: Any, run: EvaluationSteps) -> Mapping[str, Any]:
        if drive_of(experiment.arm) is None:
            return {}
        v = run.steps.series("velocity")
        return {"base_motion": _motion(experiment, run.steps.time, run.position, v)}

    def items(self, stage: Stage) -> Iterable[SceneItem]:
        if stage.experiment.arm.base is not None:
            yield DrawnFloor(stage)

    def legend(self, experiment: Any) -> Sequence[LegendEntry]:
        if experiment.arm.base is None:
            return ()
        return (LegendEntry("line way", "way of the base", sign="—", colour=colours.BOUND),)


def _motion(experiment: Any, time: Array, position: Array, velocity: Array) -> Array:
    """Return what a drive does in each step, shape (k, 5).

    These are the speeds forward and aside [m/s] and of turning [rad/s], and the largest of them and
    of their changes over the limits.
    """
    law: JointLimits = experiment.law.limits
    period = experiment.document.period
    w = velocity[:, _YAW]
    half = 0.5 * period * w
    # Recorded velocities are those of the step that ends at a row.
    middle = position[:, _YAW] - half
    c, s = np.cos(middle), np.sin(middle)
    forward = (c * velocity[:, _X] + s * velocity[:, _Y]) / np.sinc(half / np.pi)
    aside = c * velocity[:, _Y] - s * velocity[:, _X]
    speeds = np.stack((forward, w), axis=1)
    most = law.velocity[[_X, _YAW]]
    ratio = (np.abs(speeds) / most).max(axis=1, initial=0.0)
    change = np.zeros(len(w))
    if law.acceleration is not None and len(w) > 1:
        steps = np.diff(time)[:, None]
        rates = np.abs(np.diff(speeds, axis=0)) / np.where(steps > 0.0, period, np.inf)
        change[1:] = (rates / law.acceleration[[_X, _YAW]]).max(axis=1)
    return np.column_stack((forward, aside, w, ratio, change))
