r"""What joints do besides their task: objectives with weights, in a list.

An objective is an object that says which velocity the joints prefer; of the velocities that do the
task, the law takes the one nearest to their sum. Adaptive laws have these, and those of a user's
own, which extend `Objective` and are named in ``law.secondary.objectives``:

======================  ======================================================================
key                     preferred velocity
======================  ======================================================================
``posture``             weight times the way to a posture, or what can be braked on it
``limits``              away from position limits: from 0 at the edge of a zone before each
                        limit to the weight at the limit, as the square of the way into the zone
``manipulability``      weight times the gradient of ln sqrt(det J J^T), which leads away from
                        singular postures
``objectives``          what they say
``low_acceleration``    all of these, smoothed with this time constant
``obstacles``           away from obstacles that the law avoids, along the slope of their distance:
                        from 0 at the edge of a zone to the weight where they touch, as the square
                        of the way into the zone; not smoothed
======================  ======================================================================

Joints that make way before they have to: away from what is near, as far as a task leaves it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np

from ...arrays.algebra import (
    acts,
    clip,
    functions_of,
    is_foreign,
    is_one,
    matmul,
    root,
    scale,
    solve,
    transpose,
)
from ...errors import InvalidInputError
from ...inputs.fields import (
    Array,
    Gain,
    GainOrZero,
    Length,
    NonNegative,
    Vector,
    between,
    validated,
)
from ...inputs.keys import Meaning, Only
from ...inputs.kinds import Kinds, at, naming
from ...inputs.messages import short
from ...robot.limits import JointLimits
from ..call_checks import is_sound
from ..checks import flaw
from ..law import Circumstances, Layout, Signals

# Keeps the gradient of the manipulability finite in a singular posture [m^2].
_REGULAR = 1e-6


#: Stands for an acceleration that is not bounded [rad/s^2].
NO_BOUND = 1e6
# Stands for no pull [1/s].
_LEAST_PULL = 1e-9
_TARGET = "law.secondary.target"


class Moment(NamedTuple):
    """What an objective sees at a sample, of one robot or, with leading axes, of many.

    Attributes:
        t: Time [s].
        q: Joint positions that are commanded, shape (..., n) [rad].
        v: Joint velocities until now, shape (..., n) [rad/s].
        J: Jacobian of the task, known or learned, shape (..., m, n).
        u: Signals that the law sees, by name.
        period: Time until the next sample [s].
    """

    t: float
    q: Array
    v: Array
    J: Array
    u: Signals
    period: float


class Objective(ABC):
    """Something that the joints prefer besides their task.

    One of a user's own extends this class and is decorated with `validated`, which makes its fields
    the keys of an entry of ``law.secondary.objectives``. Fields called ``limits``, ``home`` and
    ``arm`` are filled from the limits, the start and the arm of the experiment. Nothing may change
    from call to call: an objective has no memory.
    """

    #: Whether `velocity` takes leading axes of robots, in NumPy or JAX, as `Reading.takes_many`
    #: says of laws. Else the law takes one robot at a time.
    takes_many = False

    @property
    def inputs(self) -> Mapping[str, tuple[int, ...]]:
        """Shapes of the signals that it sees, by name; those that the law sees need no mention."""
        return {}

    @abstractmethod
    def velocity(self, moment: Moment) -> Array:
        """Return the joint velocities that it prefers, weighted, shape (..., n) [rad/s].

        Args:
            moment: What it sees; its arrays must not be modified.
        """

    def doubts(self, circumstances: Circumstances) -> list[str]:
        """Return warnings to show before a run.

        Raises:
            InvalidInputError: If it cannot run in these circumstances.
        """
        return []


#: Objectives of a user's own that `law.secondary.objectives` may name by their ``kind``.
OBJECTIVES: Kinds[Objective] = Kinds("objective", Objective, {})


@validated
class Secondary:
    """Weights of the secondary objectives, 0 to leave one out, and objectives of a user's own."""

    posture: Annotated[GainOrZero, Meaning("Pull towards the posture.", unit="1/s")] = 1.0
    target: Annotated[
        Vector | None,
        Meaning(
            "The posture, shape (n,); by default that of the start.",
            unit="rad",
            only=(Only("posture"),),
        ),
    ] = None
    limits: Annotated[
        GainOrZero,
        Meaning("Speed with which a joint at a position limit prefers to leave.", unit="rad/s"),
    ] = 3.0
    limits_zone: Annotated[
        Gain,
        Meaning(
            "Way before a position limit in which a joint is pushed back.",
            unit="rad",
            only=(Only("limits"),),
        ),
    ] = 0.3
    manipulability: Annotated[
        GainOrZero,
        Meaning(
            "Weight of the manipulability's gradient; needs a known Jacobian and ``task`` xyz or "
            "pose.",
            unit="rad^2/s",
        ),
    ] = 0.0
    low_acceleration: Annotated[
        NonNegative,
        between(0.0, 100.0),
        Meaning("Time constant of what is preferred.", unit="s"),
    ] = 0.0
    obstacles: Annotated[
        GainOrZero,
        Meaning(
            "Weight of the slope of the distance to an obstacle that is touched.",
            unit="rad^2/(m s)",
            only=(Only("avoidance"),),
        ),
    ] = 2.0
    obstacles_zone: Annotated[
        Length,
        Meaning(
            "Distance below which the joints make way for an obstacle.",
            unit="m",
            only=(Only("obstacles"),),
        ),
    ] = 0.1

    objectives: Annotated[
        tuple[Objective, ...],
        Meaning("Objectives of your own, each with its ``kind`` and its keys."),
    ] = ()

    @property
    def seeks_manipulability(self) -> bool:
        """Whether the joints are led away from singular postures."""
        return acts(self.manipulability)

    @property
    def repulsion(self) -> ObstacleRepulsion | None:
        """How the joints make way for obstacles; None if they do not."""
        if not acts(self.obstacles):
            return None
        return ObstacleRepulsion(self.obstacles, self.obstacles_zone)

    @property
    def takes_many(self) -> bool:
        """Whether all objectives of a user's own take leading axes of robots."""
        return all(objective.takes_many for objective in self.objectives)

    def preference(self, limits: JointLimits, home: Array) -> Preference:
        """Return the sum of the objectives.

        Args:
            limits: Limits of the joints.
            home: Posture at the start, shape (n,) [rad].
        """
        return Preference(tuple(self._objectives(limits, home)), self.low_acceleration)

    def _objectives(self, limits: JointLimits, home: Array) -> Iterator[Objective]:
        key, target = ("start", home) if self.target is None else (_TARGET, self.target)
        yield Posture(self.posture, target, limits, key)
        if acts(self.limits):
            yield LimitRepulsion(self.limits, self.limits_zone, limits)
        if self.seeks_manipulability:
            yield Manipulability(self.manipulability, limits.size)
        for number, objective in enumerate(self.objectives):
            yield CheckedObjective(objective, number)


def pushed_back(q: Array, limits: JointLimits, weight: Any, zone: Any) -> Array:
    """Return velocities away from the position limits, shape (..., n) [rad/s].

    Args:
        q: Joint positions, shape (..., n) [rad].
        limits: Limits of the joints.
        weight: Speed at a limit [rad/s].
        zone: Way before a limit in which it acts [rad].
    """
    if is_one(q) and not is_in_zone(q, limits, zone):
        return 0.0 * q
    xp = functions_of(q)
    gaps = q - limits.position_lower, limits.position_upper - q
    into = [xp.maximum(1.0 - gap / zone, 0.0) for gap in gaps]
    return weight * (into[0] * into[0] - into[1] * into[1])


def is_in_zone(q: Array, limits: JointLimits, zone: float) -> bool:
    """Return whether a joint of one robot is within a zone before where it has to rest.

    Args:
        q: Joint positions, shape (n,) [rad].
        limits: Limits of the joints.
        zone: Way before a limit [rad].
    """
    # Plain floats: NumPy's overhead would take several times as long.
    lower, upper = (bound.tolist() for bound in limits.resting)
    for x, low, high in zip(q.tolist(), lower, upper, strict=True):
        if x - low < zone or high - x < zone:
            return True
    return False


def manipulability_gradient(J: Array, J_omega: Array) -> Array:
    r"""Return the gradient of ln sqrt(det J J^T) by the joint positions, shape (..., n).

    It is tr(J^+ dJ/dq_j). In a chain, moving joint j turns all that follows it: it changes column i
    of the translation by z_j x J_i if i >= j, and by z_i x J_j otherwise, and z_i by z_j x z_i if
    i > j, where z are the columns of the rotation, zero for joints that slide.

    Args:
        J: Jacobian of the task, shape (..., m, n), of 3 rows of translation, or those of the
            rotation before them.
        J_omega: Jacobian of the rotation, shape (..., 3, n).
    """
    xp = functions_of(J)
    J_T = transpose(J)
    regular = scale(_REGULAR, np.eye(J.shape[-2]))
    # Rows of the transposed pseudoinverse.
    P = solve(matmul(J, J_T) + regular, J)
    J_v, P_v, z = J[..., -3:, :], P[..., -3:, :], J_omega
    products = cross_columns(J_v, P_v)
    if J.shape[-2] == 6:
        products = products + cross_columns(J[..., :3, :], P[..., :3, :])
    after = xp.flip(xp.cumsum(xp.flip(products, -1), axis=-1), -1)
    lever = cross_columns(P_v, z)
    before = xp.cumsum(lever, axis=-1) - lever
    sums = z * after + J_v * before
    return sums[..., 0, :] + sums[..., 1, :] + sums[..., 2, :]


# Of each row of a cross product, those that it multiplies.
_ROWS = np.array(((1, 2, 0), (2, 0, 1)))


def cross_columns(a: Array, b: Array) -> Array:
    """Return the cross products of columns, shape (..., 3, n)."""
    if type(a) is type(b) is np.ndarray:
        # The same bits in a third of the time; steps in C and in JAX have no rows to take.
        one, other = _ROWS
        return a.take(one, -2) * b.take(other, -2) - a.take(other, -2) * b.take(one, -2)
    (ax, ay, az), (bx, by, bz) = ((m[..., 0, :], m[..., 1, :], m[..., 2, :]) for m in (a, b))
    return functions_of(a).stack((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx), axis=-2)


# A posture this close to a limit [rad], or with so small a singular value, is doubted.
_NEAR_LIMIT, _SINGULAR = 0.1, 0.05


def posture_doubts(
    key: str, target: Array, limits: JointLimits, task_J: Callable[[Array], Array] | None
) -> list[str]:
    """Return sentences on what may go wrong, with remedies.

    Args:
        key: What gives the posture, for messages.
        target: The posture, shape (n,) [rad].
        limits: Limits of the joints.
        task_J: Jacobian of the task, shape (m, n), of joint positions; None if it is not known.
    """
    gap = np.minimum(target - limits.position_lower, limits.position_upper - target)
    doubts = []
    if gap.min() < _NEAR_LIMIT:
        doubts.append(
            f"{key}: joint {int(gap.argmin()) + 1} is pulled to {max(gap.min(), 0.0):.2g} rad "
            "from its limit, and may be held there; consider another law.secondary.target, or "
            "law.secondary.posture: 0"
        )
    if task_J is not None:
        J, aside = (task_J(q) for q in (target, target + 0.1 * np.cos(np.arange(target.size))))
        # What no joint moves, as the height of a planar arm's tool, is not lost there.
        moved = np.abs([J, aside]).max(axis=(0, 2)) > 1e-12
        least = float(np.linalg.svd(J[moved], compute_uv=False)[-1])
        if least < _SINGULAR:
            doubts.append(
                f"{key}: the arm is pulled towards a posture that is singular for its task "
                f"(smallest singular value {least:.2g}), where it loses the task; consider "
                "law.secondary.target with the joints some 0.1 rad away, or "
                "law.secondary.posture: 0"
            )
    return doubts


@dataclass(frozen=True, eq=False)
class Posture(Objective):
    """A pull towards a posture, at most as fast as half of the acceleration brakes on the way.

    A joint that is pulled in proportion to a longer way comes too fast to stop there.

    Attributes:
        weight: Velocity per way to it [1/s].
        target: The posture, shape (n,) [rad].
        limits: Limits of the joints, near which it is doubted.
        key: Key of the posture in a document, for messages.
    """

    weight: Any
    target: Array
    limits: JointLimits
    key: str

    takes_many = True

    def velocity(self, moment: Moment) -> Array:
        # A law that makes detours is told where the last one has led.
        pull: Array = self.weight * (moment.u.get("posture", self.target) - moment.q)
        if self._fastest is None:
            return pull
        size = abs(pull)
        if is_one(size) and not is_foreign(size) and (size <= self._fastest).all():
            return pull
        xp = functions_of(pull)
        braked = xp.sign(pull) * root(self._fastest * size)
        return xp.where(size > self._fastest, braked, pull)

    @cached_property
    def _fastest(self) -> Array | None:
        """Speeds up to which the whole acceleration brakes what is in proportion to the way."""
        if self.limits.acceleration is None or not acts(self.weight):
            return None
        most = self.limits.sides("acceleration").least
        xp = functions_of(most)
        return xp.minimum(most, NO_BOUND) / xp.maximum(self.weight, _LEAST_PULL)

    def doubts(self, circumstances: Circumstances) -> list[str]:
        """See `Objective.doubts`; of a target near a limit, or singular for the task."""
        if not acts(self.weight):
            return []
        return posture_doubts(self.key, self.target, self.limits, circumstances.task_J)


@dataclass(frozen=True, eq=False)
class LimitRepulsion(Objective):
    """A push away from position limits; see `pushed_back`.

    Attributes:
        weight: Speed at a limit [rad/s].
        zone: Way before a limit in which it acts [rad].
        limits: Limits of the joints.
    """

    weight: Any
    zone: Any
    limits: JointLimits

    takes_many = True

    def velocity(self, moment: Moment) -> Array:
        return pushed_back(moment.q, self.limits, self.weight, self.zone)


@dataclass(frozen=True, eq=False)
class Manipulability(Objective):
    """A way out of singular postures; see `manipulability_gradient`.

    Attributes:
        weight: Weight of the gradient [rad^2/s].
        size: Number n of joints.
    """

    weight: Any
    size: int

    takes_many = True

    @property
    def inputs(self) -> Mapping[str, tuple[int, ...]]:
        return {"J_omega": (3, self.size)}

    def velocity(self, moment: Moment) -> Array:
        gradient = manipulability_gradient(moment.J, moment.u["J_omega"])
        climb: Array = self.weight * gradient
        return climb


@dataclass(frozen=True, eq=False)
class CheckedObjective(Objective):
    """An objective of a user's own, with errors that name it.

    Attributes:
        own: The objective.
        number: Its place in ``law.secondary.objectives``.
    """

    own: Objective
    number: int

    @property
    def takes_many(self) -> bool:  # type: ignore[override]
        """See `Objective.takes_many`."""
        return self.own.takes_many

    @property
    def inputs(self) -> Mapping[str, tuple[int, ...]]:
        with self._naming("inputs"):
            inputs: object = self.own.inputs
            if not isinstance(inputs, Mapping):
                raise InvalidInputError(
                    f"{_place(self, 'inputs')}: must be a mapping of names to shapes, a property "
                    f"or a field, not {short(inputs)}"
                )
            return dict(Layout(**inputs).shapes)

    def velocity(self, moment: Moment) -> Array:
        """Return its velocity.

        Raises:
            InvalidInputError: If it fails, or returns something else than a finite velocity.
        """
        place, t = _place(self, "velocity"), moment.t
        with self._naming("velocity", t if isinstance(t, float) else None):
            v = self.own.velocity(moment)
        if is_sound(v, moment.q.shape) or is_foreign(v):
            return v
        if complaint := flaw(v, moment.q.shape):
            raise InvalidInputError(f"{place}: must return {complaint}{at(t)}")
        if not np.isfinite(v).all():
            raise InvalidInputError(f"{place}: must be finite, not {short(v)}{at(t)}")
        return v

    def doubts(self, circumstances: Circumstances) -> list[str]:
        """Return its warnings.

        Raises:
            InvalidInputError: If it fails, cannot run so, or returns something else than texts.
        """
        place = _place(self, "doubts")
        with self._naming("doubts"):
            sentences = self.own.doubts(circumstances)
        if isinstance(sentences, list) and all(isinstance(text, str) for text in sentences):
            return sentences
        raise InvalidInputError(f"{place}: must return a list of texts, not {short(sentences)}")

    def _naming(self, member: str, t: float | None = None) -> AbstractContextManager[None]:
        key = f"law.secondary.objectives[{self.number}]"
        return naming(_place(self, member), t, key=key, own=type(self.own))


def _place(objective: Objective, member: str) -> str:
    """Return what a member of an objective is called in messages."""
    own = objective.own if isinstance(objective, CheckedObjective) else objective
    return f"{type(own).__name__}.{member}"


@dataclass(frozen=True, eq=False)
class Preference:
    """The sum of objectives, smoothed if that is asked for.

    Attributes:
        objectives: The objectives, one or more.
        time_constant: Time constant of the sum [s]; 0 for none.
    """

    objectives: tuple[Objective, ...]
    time_constant: Any

    def velocity(self, moment: Moment) -> Array:
        """Return the joint velocities preferred among those that do the task, shape (..., n)."""
        first, *others = self.objectives
        g = first.velocity(moment)
        for objective in others:
            g = g + objective.velocity(moment)
        if acts(self.time_constant):
            v, period = moment.v, moment.period
            g = v + (g - v) * (period / (self.time_constant + period))
        return g

    def inputs(self, available: Mapping[str, tuple[int, ...]]) -> dict[str, tuple[int, ...]]:
        """Return the shapes of the signals of a law, by name, and of those that objectives see.

        Args:
            available: Shapes of the law's own signals, by name.

        Raises:
            InvalidInputError: If an objective sees a signal of the law in another shape.
        """
        signals = dict(available)
        for objective in self.objectives:
            for name, shape in objective.inputs.items():
                if signals.setdefault(name, shape) != shape:
                    raise InvalidInputError(
                        f"{_place(objective, 'inputs')}: {name} has the shape {signals[name]} "
                        f"here, not {shape}"
                    )
        return signals

    def doubts(self, circumstances: Circumstances) -> list[str]:
        """Return the warnings of all objectives; see `Objective.doubts`."""
        return [text for each in self.objectives for text in each.doubts(circumstances)]


@dataclass(frozen=True)
class ObstacleRepulsion:
    """An objective of distances: away from what is near, along the slope of its distance.

    Attributes:
        weight: Weight with which they do of what they touch [rad^2/(m s)]; less of what is farther
            away, as the square of the way into the zone.
        zone: Distance below which they do [m].
    """

    weight: Any
    zone: Any

    def velocity(self, gaps: Array, slopes: Array) -> Array:
        """Return the velocities that they prefer, shape (n,) [rad/s].

        Args:
            gaps: Distances of what they make way for, shape (r,) [m].
            slopes: Derivatives of these with respect to the joints, shape (r, n) [m/rad].
        """
        into = clip(1.0 - gaps / self.zone, 0.0, 1.0)
        return self.weight * (into * into) @ slopes
