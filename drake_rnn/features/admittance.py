"""An admittance: a path that gives way along a surface's normal, for any law that follows it.

The keys of ``force`` with ``kind: admittance``, the block that stands between reference and law,
its bound of the force, what is doubtful about that before and after a run, and its series.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, OutputPort

from ..environments import ElasticSurface, Surface, TouchedSurface
from ..errors import InvalidInputError
from ..inputs.fields import (
    Array,
    Length,
    NonNegative,
    Positive,
    Speed,
    Stiffness,
    between,
    validated,
)
from ..inputs.keys import Meaning, Only
from ..laws.guarantee import assumptions_text
from ..measures import Metric, Motion, Yardsticks
from ..robot.joint_stop import gaining
from ..systems.block import Block
from .feature import Assumption, EvaluationSteps, LoopBuild, ports_of
from .obstacles import fastest_of

# What its keys act with.
_YIELDING = (Only("kind", "admittance"),)


@validated
class AdmittanceSettings:
    """What a path gives way with, and the bound of the force that it keeps."""

    mass: Annotated[
        NonNegative,
        between(0.0, 1e4),
        Meaning("Virtual mass.", unit="kg", only=_YIELDING),
    ] = 1.0
    damping: Annotated[
        Positive,
        between(1e-3, 1e7),
        Meaning(
            "Virtual damping; a surface that moves along its normal changes the force by this "
            "times its speed.",
            unit="N s/m",
            only=_YIELDING,
        ),
    ] = 400.0
    stiffness: Annotated[
        NonNegative,
        between(0.0, 1e7),
        Meaning(
            "Virtual stiffness towards the path, an impedance: the tool is off its path by what "
            "the force is off, over this. 0 to keep the force itself.",
            unit="N/m",
            only=_YIELDING,
        ),
    ] = 0.0
    follow: Annotated[
        NonNegative,
        between(0.0, 1e3),
        Meaning(
            "Rate with which, in contact, the damping forgets a speed that lasts, as that of a "
            "surface that moves, rises or falls; 0 for a plain admittance.",
            unit="1/s",
            only=_YIELDING,
        ),
    ] = 0.0
    acceleration: Annotated[
        Positive,
        between(1e-3, 1e3),
        Meaning(
            "Largest acceleration of the path along the normal, which the arm must be able to "
            "follow.",
            unit="m/s^2",
            only=_YIELDING,
        ),
    ] = 1.0
    approach_speed: Annotated[
        Speed,
        Meaning("Largest speed of the path along the normal.", unit="m/s", only=_YIELDING),
    ] = 0.1
    largest: Annotated[
        Positive | None,
        Meaning(
            "Largest force: the path comes only so near and so fast that it can stop before, on "
            "any surface up to ``surface_stiffness``. None for no bound.",
            unit="N",
            only=_YIELDING,
        ),
    ] = None
    surface_stiffness: Annotated[
        Stiffness | None,
        Meaning(
            "Largest stiffness of the surface, up to the largest force.",
            unit="N/m",
            only=_YIELDING,
        ),
    ] = None
    surface_speed: Annotated[
        NonNegative,
        between(0.0, 10.0),
        Meaning("Largest speed of the surface that is counted on.", unit="m/s", only=_YIELDING),
    ] = 0.0
    normal_error: Annotated[
        NonNegative,
        between(0.0, 1.0),
        Meaning(
            "Largest angle between the true normal and the one that is believed, up to the largest "
            "force: a path along the surface then meets it as one that comes nearer.",
            unit="rad",
            only=(*_YIELDING, Only("largest")),
        ),
    ] = 0.0
    tracking: Annotated[
        Length,
        Meaning(
            "How far the tool may be off the path that gives way, along the normal; with a "
            "``normal_error`` the distance along the surface counts by its sine.",
            unit="m",
            only=_YIELDING,
        ),
    ] = 1e-6

    def require_bound(self, desired: float | None) -> None:
        """Raise a ValueError if the bound of the force could not hold.

        Args:
            desired: Largest desired force [N]; None if the path does not give way.
        """
        if (self.largest is None) != (self.surface_stiffness is None):
            missing, given = "largest", "surface_stiffness"
            if self.surface_stiffness is None:
                missing, given = given, missing
            raise ValueError(f"{missing}: must be given with {given}")
        if self.largest is None or desired is None:
            return
        if self.largest <= desired:
            raise ValueError(
                f"largest: must be above the desired force, {desired:g} N, not {self.largest:g}"
            )
        if self.surface_speed > self.approach_speed:
            raise ValueError(
                f"approach_speed: must be at least surface_speed, {self.surface_speed:g} m/s, to "
                f"get out of the way, not {self.approach_speed:g}"
            )

    def start_force(self, surface: Surface) -> float:
        """Return the largest force at the start, of a tool that begins within a surface [N]."""
        k = self.surface_stiffness
        return 0.0 if k is None else k * max(0.0, -surface.gap)

    def counted_speed(self, path_speed: float) -> float:
        r"""Return the speed of the surface towards the path that is counted on [m/s].

        A normal that is off by up to :math:`\theta` turns the speed v along the surface into one
        of :math:`v \sin\theta` into it, and of a speed out of the surface leaves a share of
        :math:`\cos\theta`. So a speed s out of it takes the path away from the surface by
        :math:`\cos\theta (s - s_n)` at least, and one into it brings the two nearer by
        :math:`s_n - s` at most, with :math:`s_n = (s_s + v \sin\theta) / \cos\theta` for a
        surface that itself moves by s_s.

        Args:
            path_speed: Largest speed of the path along the surface [m/s].
        """
        error = self.normal_error
        return (self.surface_speed + path_speed * math.sin(error)) / math.cos(error)

    def assumptions(
        self, touched: TouchedSurface, duration: float, noise: float, frozen: float
    ) -> tuple[Assumption, ...]:
        """Return what the bound of the force rests on.

        Args:
            touched: The surface, and how it moves.
            duration: Duration of the run [s].
            noise: Standard deviation of the sensor's noise [N].
            frozen: Time of the run for which the sensor gives a frozen value [s].
        """
        surface, motion = touched.surface, touched.motion
        is_spring = isinstance(surface, ElasticSurface)
        # Of a surface of bodies neither stiffness nor friction is known.
        stiffness = surface.stiffness if isinstance(surface, ElasticSurface) else None
        speed = 0.0 if motion is None else fastest_of(motion, duration, surface.normal_W)
        assumptions = [
            Assumption(
                *("error of the believed normal", self.normal_error, "rad", surface.normal_error),
                key="force.normal_error",
            ),
            Assumption(
                *("stiffness of the surface", self.surface_stiffness or 0.0, "N/m", stiffness),
                key="force.surface_stiffness",
            ),
            Assumption(
                *("speed of the surface along its normal", self.surface_speed, "m/s", speed),
                key="force.surface_speed",
            ),
            Assumption(
                *("distance of the tool from the path that gives way", self.tracking, "m"),
                key="force.tracking",
                metric=LAG_METRIC.name,
            ),
        ]
        if frozen > 0.0:
            what = "time for which the force sensor is frozen"
            assumptions.append(Assumption(what, 0.0, "s", frozen, "sensor.fails_at"))
        if noise > 0.0:
            assumptions.append(Assumption("error of the force sensor", _SIGMAS * noise, "N"))
        if self.normal_error > 0.0:
            assumptions.append(Assumption("friction", actual=0.0 if is_spring else None))
        return tuple(assumptions)


class ForceSampling(NamedTuple):
    """How the force is measured, and how fast the path goes meanwhile.

    Attributes:
        period: Sampling period [s].
        late: Samples by which the sensor is late; 0 for an ideal one.
        noise: Standard deviation of its noise [N].
        path_speed: Largest speed of the path along the surface [m/s]; it counts with an error of
            the normal alone.
    """

    period: float
    late: int = 0
    noise: float = 0.0
    path_speed: float = 0.0


def add_admittance(
    loop: LoopBuild,
    settings: AdmittanceSettings,
    desired: Callable[[float], float],
    surface: Surface,
    normal_force: OutputPort,
    sampling: ForceSampling,
) -> None:
    """Add the path that gives way, in place of the one of the reference.

    Args:
        loop: The loop.
        settings: What the path gives way with.
        desired: The desired force [N] at a time [s].
        surface: The surface.
        normal_force: The measured force.
        sampling: How it is measured.

    Raises:
        InvalidInputError: If the reference is no path.
    """
    path, names = loop.reference, ("p_WE_desired", "v_WE_desired", "a_WE_desired")
    if not set(names) <= path.keys():
        raise InvalidInputError(
            f"force.kind: admittance needs a path, a reference with the outputs {', '.join(names)}"
        )
    start = loop.body.kinematics.p_WE(loop.body.start), settings.start_force(surface)
    block = Admittance(settings, desired, sampling, *start, preview="p_preview" in path)
    loop.wiring.add("admittance", block)
    normal = loop.given.get("normal_WE", loop.offered["normal_WE"])
    loop.wiring.connect(normal, block.GetInputPort("normal_WE"))
    loop.wiring.connect(normal_force, block.GetInputPort("normal_force"))
    for name, port in ports_of(block).items():
        if name in path:
            loop.wiring.connect(path[name], block.GetInputPort(name))
            loop.offered[name] = port
    loop.recorded["admittance"] = block.GetOutputPort("admittance")


# Standard deviations of a sensor's noise that a bound of the force counts on.
_SIGMAS = 6.0
# Parts of the state before the last advances.
_OWN = 7
# Share of the desired force from which on a tool is in contact.
_TOUCHES = 0.1


class Admittance(Block):
    r"""A path that gives way along the normal of a surface, as a mass would.

    With the outward normal n, the measured force F and the speed s out of the surface,

    .. math:: M \dot s + D (s - s_d) + K n^T (r - p_d) = F - F_d ,

    where s_d is the speed of the path along n with a stiffness K, and 0 without; in contact, the
    mean of s over a time ``1 / follow`` is added to it. Along the surface r is the path p_d. A
    speed is held for a period h, in implicit steps, and follows what was measured a period before.

    **The bound.** G is an upper bound of the true force: it is what the sensor has told, plus
    stiffness k times all advance towards the surface since, which is that of r and of the surface;
    of all such bounds the least. With the largest acceleration a, a relative speed u of approach
    that falls by a h at each period is at rest after the way

    .. math:: S(u) = h \sum_j \max(u - j a h, 0),

    and u is allowed while :math:`G + k (S(u) + 2 e) \le F_{max}`, where e is how far the tool may
    be off r. The next speed of that stop is allowed a period later, because G has grown by k u h at
    most: so there always is one. What is measured along a normal that is off by up to
    :math:`\theta` is at least :math:`\cos\theta` of the force, and the surface counts as one that
    comes nearer, see `AdmittanceSettings.counted_speed`.

    Inputs are ``p_WE_desired``, ``v_WE_desired`` and ``a_WE_desired``, their previews where there
    are any, ``normal_WE``, each of shape (3,), and ``normal_force``, shape (1,) [N]. Outputs are
    the signals of the path, by the same names, and ``admittance``, shape (3,): height of the path
    along the normal [m], its speed out of the surface [m/s], and G [N].

    Args:
        settings: What the path gives way with.
        desired: The desired force [N] at a time [s].
        sampling: How the force is measured.
        p_start: Start of the path, shape (3,) [m].
        start_force: Force at the start that is counted on [N].
        preview: Whether there are previews.
    """

    role = "reference"

    def __init__(
        self,
        settings: AdmittanceSettings,
        desired: Callable[[float], float],
        sampling: ForceSampling,
        p_start: Array,
        start_force: float,
        preview: bool = False,
    ) -> None:
        super().__init__()
        self._settings, self._desired = settings, desired
        self._period, self._late, self._noise = sampling[:3]
        self._surface_speed = settings.counted_speed(sampling.path_speed)
        self._share = math.cos(settings.normal_error)
        names = ["p_WE_desired", "v_WE_desired", "a_WE_desired"]
        names += ["p_preview", "v_preview", "a_preview"] if preview else []
        inputs = {name: self.DeclareVectorInputPort(name, 3) for name in (*names, "normal_WE")}
        self._measured = self.DeclareVectorInputPort("normal_force", 1)
        self._inputs = inputs
        # r, speed, its last rate, bound of the force, speed that the damping forgets, and advances
        # since the newest measurement.
        first = np.concatenate((p_start, (0.0, 0.0, start_force, 0.0), np.zeros(sampling.late)))
        self.DeclareDiscreteState(first)
        for name in names:
            causes = {inputs[name].ticket(), inputs["normal_WE"].ticket(), self.xd_ticket()}
            self.DeclareVectorOutputPort(name, 3, self._output(name), causes)

        def status(context: Context, output: Any) -> None:
            x = context.get_discrete_state_vector().value()
            n = inputs["normal_WE"].Eval(context)
            output.set_value([n.dot(x[:3]), x[3], x[5]])

        self.DeclareVectorOutputPort(
            "admittance", 3, status, {self.xd_ticket(), inputs["normal_WE"].ticket()}
        )
        self.DeclarePeriodicDiscreteUpdateEvent(sampling.period, 0.0, self._update)

    def _output(self, name: str) -> Any:
        """Return what computes a signal of the path that gives way."""
        port, normal = self._inputs[name], self._inputs["normal_WE"]
        period, letter = self._period, name[0]

        def calc(context: Context, output: Any) -> None:
            x = context.get_discrete_state_vector().value()
            n, value = normal.Eval(context), port.Eval(context)
            if name == "p_WE_desired":
                out = n.dot(x[:3])
            elif name == "p_preview":
                out = n.dot(x[:3]) + period * x[3]
            else:
                out = x[3] if letter == "v" else x[4]
            output.set_value(value + (out - n.dot(value)) * n)

        return calc

    def _update(self, context: Context, state: DiscreteValues) -> None:
        x = context.get_discrete_state_vector().CopyToVector()
        n = self._inputs["normal_WE"].Eval(context)
        p_d, v_d = (self._inputs[f"{each}_WE_desired"].Eval(context) for each in "pv")
        measured = float(self._measured.Eval(context)[0])
        h, t, speed, settings = self._period, context.get_time(), float(x[3]), self._settings
        height = float(n.dot(x[:3])) + h * speed
        # Where the path will be when the next speed begins.
        off = height - float(n.dot(p_d + h * v_d))
        path_speed = float(n.dot(v_d)) if settings.stiffness > 0.0 else 0.0
        desired = self._desired(t)
        # Before a touch it would be approached ever faster.
        lasting = 0.0
        if measured > _TOUCHES * desired:
            lasting = float(x[6]) + min(h * settings.follow, 1.0) * (
                speed - path_speed - float(x[6])
            )
        wanted = self._yielding(speed, measured - desired, off, path_speed, lasting)
        most = settings.acceleration * h
        wanted = min(max(wanted, -settings.approach_speed), settings.approach_speed)
        wanted = min(max(wanted, speed - most), speed + most)
        bound, room, advance = self._bound_and_room(x, measured, round(t / h))
        if settings.largest is not None:
            fastest = stopping_speed(room, settings.acceleration, h) - self._surface_speed
            wanted = max(wanted, min(-fastest, speed + most))
        if self._late:
            x[_OWN:] = np.append(advance, x[_OWN:-1])
        along = p_d - n.dot(p_d) * n + h * (v_d - n.dot(v_d) * n)
        x[:3] = along + height * n
        x[3:_OWN] = wanted, (wanted - speed) / h, bound, lasting
        state.set_value(x)

    def _yielding(
        self, speed: float, push: float, off: float, path_speed: float, lasting: float
    ) -> float:
        """Return the next speed out of the surface, by one implicit step [m/s].

        Args:
            speed: The speed now [m/s].
            push: Measured force less the desired one [N].
            off: How far the tool will be off its path when the next speed begins [m].
            path_speed: Speed of the path along the normal [m/s].
            lasting: Speed that the damping forgets [m/s].
        """
        h, settings = self._period, self._settings
        M, D, K = settings.mass, settings.damping, settings.stiffness
        pull = D * (path_speed + lasting) - K * (off - h * path_speed)
        return (M * speed + h * (push + pull)) / (M + h * D + h * h * K)

    def _bound_and_room(self, x: Array, measured: float, sample: int) -> tuple[float, float, float]:
        """Return a bound of the force a period later [N], the way left then, and the advance [m].

        Args:
            x: The state.
            measured: Measured force [N].
            sample: Number of the sample; the first ones of a sensor that is late tell nothing.
        """
        settings, bound = self._settings, float(x[5])
        if settings.largest is None or settings.surface_stiffness is None:
            return bound, 0.0, 0.0
        k = settings.surface_stiffness
        if sample >= self._late:
            since = k * float(x[_OWN:].sum())
            told = max(measured, 0.0) + _SIGMAS * self._noise
            bound = min(bound, told / self._share + since)
        advance = self._period * max(self._surface_speed - float(x[3]), 0.0)
        bound += k * advance
        return bound, (settings.largest - bound) / k - 2.0 * settings.tracking, advance


def stopping_speed(room: float, deceleration: float, period: float) -> float:
    """Return the largest speed, held for a period, from which a stop needs no more way [m/s].

    It falls by ``deceleration`` times ``period`` at each period.

    Args:
        room: The way [m]; of none or less nothing is left but to stand still.
        deceleration: Deceleration [m/s^2].
        period: Period [s].
    """
    step = deceleration * period * period
    return gaining(max(room, 0.0) / step) * step / period


def admittance_doubts(
    settings: AdmittanceSettings,
    surface: Surface,
    path_speed: float,
    assumptions: Iterable[Assumption],
    is_filtered: bool,
) -> list[str]:
    """Return warnings about the bound of the force of a path that gives way.

    Args:
        settings: What the path gives way with.
        surface: The surface.
        path_speed: Largest speed of the path along the surface [m/s].
        assumptions: What the bound rests on.
        is_filtered: Whether the sensor of the force has a filter.

    Raises:
        InvalidInputError: If its bound of the force could not hold from the start.
    """
    if settings.largest is None or settings.surface_stiffness is None:
        return []
    if is_filtered:
        raise InvalidInputError(
            "sensor.low_pass: must be left out with force.largest; a force that is filtered tells "
            "too late"
        )
    k, s = settings.surface_stiffness, settings.counted_speed(path_speed)
    if s > settings.approach_speed:
        raise InvalidInputError(
            f"force.approach_speed: must be at least {s:.4g} m/s, to get out of the way of a "
            f"surface whose normal is off by up to {settings.normal_error:g} rad, along a path of "
            f"up to {path_speed:.4g} m/s, not {settings.approach_speed:g}"
        )
    # A surface that comes at once is met by an arm at rest, which needs this way to be as fast.
    needed = settings.start_force(surface) + k * (
        s * s / (2.0 * settings.acceleration) + 2.0 * settings.tracking
    )
    if needed >= settings.largest:
        raise InvalidInputError(
            f"force.largest: must be above {needed:.4g} N, which a surface of {k:g} N/m may press "
            f"with at the start, not {settings.largest:g}"
        )
    doubts = [
        f"{each.key}: {each.most:g} {each.unit}; the {each.what} is {each.actual:.4g} "
        f"{each.unit}, so that the bound of the force does not hold"
        for each in assumptions
        if each.holds is False
    ]
    if 4.0 * settings.mass * k > settings.damping**2:
        least = 2.0 * math.sqrt(settings.mass * k)
        doubts.append(
            f"force.damping: with {settings.mass:g} kg on {k:g} N/m the force swings; from "
            f"{least:.3g} N s/m on it does not"
        )
    return doubts


def bound_caveats(
    settings: AdmittanceSettings,
    assumptions: Iterable[Assumption],
    metrics: Mapping[str, float],
) -> Iterable[str]:
    """Yield warnings about a bound of the force that did not hold, or need not.

    Args:
        settings: What the path gives way with.
        assumptions: What the bound rests on.
        metrics: Metrics of the run.
    """
    if settings.largest is None:
        return
    lag, peak = metrics.get(LAG_METRIC.name, 0.0), metrics.get("normal_force_peak_N", 0.0)
    if lag > settings.tracking:
        yield (
            f"force.tracking: {settings.tracking:g} m; the tool was off the path that gives way by "
            f"up to {lag:.3g} m, so that the bound of the force need not hold: give as much, or a "
            "smaller force.acceleration"
        )
    if peak > settings.largest:
        wrong = [each for each in assumptions if each.measured(metrics).holds is False]
        why = "the surface is stiffer or faster than was counted on, or the arm does not follow"
        if wrong:
            why = f"it counts on {assumptions_text(each.measured(metrics) for each in wrong)}"
        yield f"force.largest: {settings.largest:g} N; the force reached {peak:.4g} N: {why}"


def admittance_series(experiment: Any, run: EvaluationSteps, normal: Array) -> dict[str, Array]:
    """Return how the path has given way at every step, by the names of series."""
    steps = run.steps
    if "admittance" not in steps.layout:
        return {}
    kinematics = experiment.arm.kinematics()
    n = normal if normal.ndim == 2 else experiment.contact.surface.believed_normal_W[np.newaxis]
    height, speed, bound = steps.series("admittance").T
    path = np.array([experiment.desired.position(t)[0] for t in steps.time.tolist()])
    tip = np.array([kinematics.p_WE(q) for q in run.position])
    lag = (tip * n).sum(axis=1) - height
    if (error := experiment.contact.force.normal_error) > 0.0:
        # Off along the surface, the tool is nearer to one whose normal is another.
        off = tip - path
        off -= (off * n).sum(axis=1)[:, np.newaxis] * n
        lag += np.copysign(math.sin(error) * np.linalg.norm(off, axis=1), lag)
    series = {
        "admittance_offset": height - (path * n).sum(axis=1),
        "admittance_speed": speed,
        "admittance_lag": lag,
    }
    if experiment.contact.force.largest is not None:
        series["normal_force_bound"] = bound
    return series


def _lag(motion: Motion, against: Yardsticks) -> Array | None:
    """Return how far the tool is from the path that gives way; None without one."""
    lag = motion.features.get("admittance_lag")
    return None if lag is None else abs(lag)


#: How closely the arm follows the path that gives way.
LAG_METRIC = Metric(
    "admittance_lag_max_m",
    "how far the tool is from the path that gives way, along the normal, at most",
    shown=("force",),
    of=_lag,
)
