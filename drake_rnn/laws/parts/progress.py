r"""How much of its speed a tool may want, so that an arm rests where it gets no further.

What leads a tool may not know what is in its way: a table before the pose that it is to reach, or
the end of its reach while its Jacobian is learned. The nearest velocities that are possible slide
aside, the feedback leads back, and the arm would swing there for ever.

Progress is the work of what is wanted, :math:`\int b \cdot V \, dt`, of the task velocity b that
is wanted and that of the tool, V. To a pose at rest b is the gradient of a function of the error,
and along a constant twist it is constant: so a motion to and fro adds nothing beyond the largest
value so far. While that does not grow by a tenth of what b alone would make of it, the speed falls,
after a while in which the arm may just be starting or turning round, to a three-hundredth. With
that the arm feels its way, and is as fast as before half a second after the way is free; what
hardly counts as progress, along a wall, does not make it faster. A tool
that was on its way elsewhere has lost some of that work as it turns round: once it has gone well
along b for a while with all of its speed, progress counts from there; what one that feels its way
has slid back, it first makes good. What asks for something else has all of the speed.
Joints may be too slow for b: it counts as no more than what their limits can make of it by then.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import exp, sqrt
from typing import Any, NamedTuple

import numpy as np

from ...arrays.algebra import dot, functions_of, is_one, join, larger, root, select
from ...inputs.fields import Array
from ...robot.limits import JointLimits
from ..law import Signals, State

# Share of the work of what is wanted that is progress, and that makes a tool faster.
_LEAST_GAIN, _FREE = 0.1, 0.25
#: Time over which progress is a mean [s].
MEAN = 0.1
# In which the speed falls and grows by a factor of e [s].
_FALL, _GROWTH = 0.15, 0.08
#: Least share of its speed that a tool wants.
LEAST = 3e-3
#: Share of the work with which a tool goes well along what is wanted.
WELL = 0.5
# For how long it must [s].
_LONG = 0.3
#: Time without progress after which the speed to a pose falls [s]: the tool may first go astray.
POSE_PATIENCE = 0.8
# A tool is not led by less than this [m/s].
_NOTHING = 1e-3
# At the edge of reach b counts as no less than this: a tenth, a millimetre a second, is none [m/s].
_SLOW = 1e-2


class Progress(NamedTuple):
    """What a tool has got on along what is wanted of it, in numbers or arrays of shape (..., 1).

    Attributes:
        share: Share of its speed that it may want.
        blocked: Time for which it has not got on [s].
        gained: How far it has got on by the last sample [m].
        ahead: How far the work is behind its largest value so far, 0 or negative [m^2/s].
        rate: How fast that value has grown of late [m^2/s^2].
        since: Time for which it has not got on with the speed that it may want [s].
        well: Time for which it has gone well along what is wanted [s].
        age: Time since the same is wanted [s].
    """

    share: Any = 1.0
    blocked: Any = 0.0
    gained: Any = 0.0
    ahead: Any = 0.0
    rate: Any = 0.0
    since: Any = 0.0
    well: Any = 0.0
    age: Any = 0.0


#: Before anything is wanted, or something else than before.
NO_PROGRESS = Progress()


def advance(
    progress: Progress,
    wanted: Array,
    V_tool: Array,
    period: float,
    patience: float,
    fastest: Callable[[Any], Any],
) -> Progress:
    """Return the progress a sample later; while nothing is wanted it stays as it is.

    Args:
        progress: That until now.
        wanted: Task velocity b that is wanted, of rows that are lengths, shape (..., m) [m/s].
        V_tool: That of the tool, likewise.
        period: Time between two samples [s].
        patience: Time without progress after which the speed falls [s].
        fastest: Returns how fast the limits of the joints let a tool be at most, in any direction,
            of rows that are lengths [m/s], a time after it rested [s]; see `fastest_tool`.
    """
    power, square = dot(wanted, V_tool), dot(wanted, wanted)
    if is_one(wanted):
        if square < _NOTHING**2:
            return progress
        return _advance_led(progress, power, sqrt(square), period, patience, fastest)
    xp, is_led = functions_of(square), square >= _NOTHING**2
    size = root(xp.maximum(square, _NOTHING**2))
    after = _advance_led(progress, power, size, period, patience, fastest)
    return Progress(*(xp.where(is_led, *pair) for pair in zip(after, progress, strict=True)))


def _advance_led(
    progress: Progress,
    power: Any,
    size: Any,
    period: float,
    patience: float,
    fastest: Callable[[Any], Any],
) -> Progress:
    """Return the progress of a tool that is led, of numbers or of arrays; see `advance`.

    Args:
        progress: That until now.
        power: Work that is done now [m^2/s^2].
        size: Length of what is wanted [m/s].
        period: See `advance`, as the others.
        patience: See there.
        fastest: See there.
    """
    share, blocked, _, ahead, rate, since, well, age = progress
    age = age + period
    square = size * size
    # What is more than the joints can make of it by then does not count.
    square = select(
        power >= WELL * share * square,
        lambda: square,
        lambda: size * _smaller(size, fastest(age)),
    )
    well = _where(power >= WELL * share * square, well + period, 0.0)
    is_on_its_way = (well >= _LONG) & (share == 1.0)
    work = period * power + _where(is_on_its_way, 0.0, ahead)
    gained = larger(0.0, work)
    rate = rate + (gained - period * rate) / (MEAN + period)
    blocked = _where(rate >= _LEAST_GAIN * square, 0.0, blocked + period)
    gets_on = rate >= _LEAST_GAIN * share * square
    since = _where(gets_on, 0.0, since + period)
    # One that turns round goes well again before the speed falls.
    falls = (since > patience) & ((well == 0.0) | (share < 1.0))
    lower = _where(falls, larger(LEAST, share * exp(-period / _FALL)), share)
    is_free = rate >= _FREE * share * square
    higher = _where(is_free, _smaller(1.0, share * exp(period / _GROWTH)), share)
    share = _where(gets_on, higher, lower)
    return Progress(share, blocked, gained / size, work - gained, rate, since, well, age)


def _where(condition: Any, one: Any, other: Any) -> Any:
    """Return one value or another one, numbers or arrays of shape (..., 1)."""
    if isinstance(condition, (bool, np.bool_)):
        return one if condition else other
    return functions_of(condition).where(condition, one, other)


def _smaller(one: Any, other: Any) -> Any:
    return _where(other < one, other, one)


def fastest_tool(J: Array, limits: JointLimits, age: Any) -> Any:
    """Return how fast the limits let a tool be a time after it rested, a number or (..., 1) [m/s].

    Args:
        J: Jacobian of the task, of rows that are lengths, shape (..., m, n).
        limits: Limits of the joints.
        age: The time [s].
    """
    v = limits.sides("velocity").largest
    if limits.acceleration is not None:
        v = functions_of(J).minimum(v, limits.sides("acceleration").largest * age)
    return dot(v, root((J * J).sum(axis=-2)))


def asks_for_nothing(wanted: Array) -> bool:
    """Return whether a task velocity, of rows that are lengths, leads no tool, shape (m,) [m/s]."""
    return bool(dot(wanted, wanted) < _NOTHING**2)


class Look(NamedTuple):
    """What a law wants of its tool at a sample, of rows that are lengths.

    Attributes:
        wanted: Task velocity b that is wanted, shape (..., m) [m/s].
        possible: What the law makes of it near the edge of reach, likewise: b counts as no more
            than that.
        V_tool: Velocity of the tool, likewise.
        J: Jacobian of the rows, shape (..., m, n).
    """

    wanted: Array
    possible: Array
    V_tool: Array
    J: Array


@dataclass(frozen=True)
class ShareOfSpeed:
    """The share of its speed that a task may want whose target rests; see `Component`.

    Attributes:
        limits: Limits of the joints.
        acts: Whether it does; else it remembers nothing.
        exact: 1 where measurements are exact and in time, else 0, a number or shape (..., 1).
    """

    limits: JointLimits
    acts: bool
    exact: Any

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state: `Progress`, in order."""
        return {"progress": (len(NO_PROGRESS),)} if self.acts else {}

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the initial state; see `Component.init`."""
        return {"progress": np.array(NO_PROGRESS)} if self.acts else {}

    def step(
        self, state: State, u: Signals, period: float, rests: Any, look: Callable[[], Look]
    ) -> tuple[Any, State]:
        """Return the share, a number or shape (..., 1); see `Component.step`.

        Args:
            state: Parts of the law's state, by name.
            u: Signals at the sample.
            period: Time until the next sample [s].
            rests: Whether the target rests, shape (..., 1).
            look: Returns what is wanted; it is not called if no target rests.
        """
        before, none = state["progress"], np.array(NO_PROGRESS)
        acts = rests & (self.exact > 0.0)
        if type(acts) is np.ndarray and not acts.any():
            return 1.0, {"progress": none + 0.0 * before}
        wanted, possible, V, J = look()
        size = larger(_NOTHING, root(dot(wanted, wanted)))
        most = larger(_SLOW, dot(wanted, possible) / size)

        def fastest(age: Any) -> Any:
            return _smaller(fastest_tool(J, self.limits, age), most)

        one = is_one(before)
        parts = before.tolist() if one else (before[..., k, None] for k in range(none.size))
        after = advance(Progress(*parts), wanted, V, period, POSE_PATIENCE, fastest)
        if one:
            return after.share, {"progress": np.array(after)}
        chosen = functions_of(before).where(acts, join(after), none)
        return chosen[..., :1], {"progress": chosen}

    def resumed(self, state: State) -> State:
        """Return its parts of the state after a pause: progress counts anew."""
        if not self.acts:
            return {}
        return {"progress": 0.0 * state["progress"] + np.array(NO_PROGRESS)}
