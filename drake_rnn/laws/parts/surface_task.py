r"""What is asked of a tool's tip: to follow a path along a surface, and to press against it.

- Detection of a lost contact, and the reaction to it.
- Settings of a force that a law keeps along the normal of a surface.

The stiffness of a contact: given, or learned from the force and the depth of the tip.

A ball pressed into a plane is not a linear spring: its force F grows as d^p with the depth d,
where p is 2 for Drake's hydroelastic contact and 3/2 for Hertz's. F^(1/p) is then proportional to
d, with one slope s for all forces, and

.. math:: d - d_d = (F^{1/p} - F_d^{1/p}) / s

is how much too deep the tip is, however far F is from F_d. With p = 1, s is a stiffness.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from ...arrays.algebra import clip, dot, functions_of, is_one, join, outer, scale
from ...errors import InvalidInputError
from ...inputs.fields import Array, Gain, NonNegative, Positive, Speed, Stiffness, validated
from ...inputs.keys import Meaning, Only
from ..law import Signals, State

APPROACHING, IN_CONTACT, LOST = 0.0, 1.0, 2.0


@validated
class ContactLoss:
    """Settings for the loss of a contact: hardly any force for a while, once contact was made."""

    reaction: Annotated[
        Literal["hold", "retreat"],
        Meaning(
            "``hold`` keeps the end effector where it is; ``retreat`` first moves it off the "
            "surface.",
        ),
    ] = "hold"
    threshold: Annotated[
        float,
        Field(strict=True, gt=0, lt=1),
        Meaning("Fraction of the desired force below which there is no contact."),
    ] = 0.05
    floor: Annotated[
        NonNegative,
        Meaning(
            "Force below which there is no contact, whatever force is desired; above the noise "
            "of the sensor.",
            unit="N",
        ),
    ] = 0.05
    patience: Annotated[
        NonNegative,
        Meaning("Time without contact after which it counts as lost.", unit="s"),
    ] = 0.05
    retreat_speed: Annotated[
        Speed,
        Meaning(
            "Speed of the retreat along the normal.",
            unit="m/s",
            only=(Only("reaction", "retreat"),),
        ),
    ] = 0.02
    retreat_distance: Annotated[
        NonNegative,
        Meaning("Length of the retreat.", unit="m", only=(Only("reaction", "retreat"),)),
    ] = 0.02

    #: Size of the state: phase, time without contact [s], distance retreated [m].
    size = 3

    def start(self) -> Array:
        """Return the initial state, shape (3,): not yet in contact."""
        return np.array([APPROACHING, 0.0, 0.0])

    def update(self, state: Array, force: Any, desired: Any, period: float) -> Array:
        """Return the state one period later, shape (..., 3).

        Args:
            state: State, shape (..., 3).
            force: Measured force [N], a float, or one for each robot, shape (..., 1).
            desired: Desired force [N], likewise.
            period: Sampling period [s].
        """
        if not is_one(state):
            return self._update(state, force, desired, period)
        phase, missing, distance = state.tolist()
        touching = force > max(self.threshold * desired, self.floor)
        if phase == LOST:
            return np.array([LOST, missing, distance + period * self.retreat(state)])
        if touching:
            return np.array([IN_CONTACT, 0.0, 0.0])
        missing += period
        loses_contact = phase == IN_CONTACT and missing > self.patience
        return np.array([LOST if loses_contact else phase, missing, 0.0])

    def _update(self, state: Array, force: Any, desired: Any, period: float) -> Array:
        """Return what `update` does, of many robots."""
        xp = functions_of(state, force)
        phase, missing, distance = (state[..., k, None] for k in range(3))
        touching = force > xp.maximum(self.threshold * desired, self.floor)
        is_gone = phase == LOST
        away = distance + period * self.retreat(state)
        longer = missing + period
        loses_contact = (phase == IN_CONTACT) & (longer > self.patience)
        phase = xp.where(
            is_gone | loses_contact & ~touching, LOST, xp.where(touching, IN_CONTACT, phase)
        )
        missing = xp.where(is_gone, missing, xp.where(touching, 0.0, longer))
        return join((phase, missing, xp.where(is_gone, away, 0.0)))

    def retreat(self, state: Array) -> Any:
        """Return the speed off the surface after a loss of contact [m/s]; 0 to stay in place.

        It is a float, or an array of shape (..., 1) of many robots.
        """
        if self.reaction == "hold":
            return 0.0
        if not is_one(state):
            is_away = state[..., 2, None] >= self.retreat_distance
            return functions_of(state).where(is_away, 0.0, self.retreat_speed)
        return 0.0 if state[2] >= self.retreat_distance else self.retreat_speed

    def check(self, key: str, pressing_force: float | None) -> None:
        """Raise an InvalidInputError if the desired force would count as no contact.

        Args:
            key: Key of these settings, for the message.
            pressing_force: Desired pressing force [N]; None without a contact.
        """
        if pressing_force is not None and self.floor >= pressing_force:
            raise InvalidInputError(
                f"{key}.floor: must be below force.value, {pressing_force:g} N, not {self.floor:g}"
            )

    def caveats(self, key: str, metrics: Mapping[str, float]) -> list[str]:
        """Return a sentence on what is done, after a run with these metrics that lost its contact.

        Args:
            key: Key of these settings, for the message.
            metrics: Metrics of the run, by name.
        """
        if "contact_lost_time_s" not in metrics:
            return []
        does = {"hold": "holds still", "retreat": "retreats"}[self.reaction]
        return [f"{key}: without contact the end effector {does}"]


# Marks a missing last sample; the root of a real one is positive.
_NONE = -1.0


@validated
class OnlineStiffness:
    """Recursive least squares for the slope s of F^(1/p) over the depth."""

    initial: Annotated[
        Stiffness,
        Meaning(
            "Stiffness assumed at first, at ``initial_force``. If it is too high, the force "
            "converges slowly; if it is too low, the force overshoots.",
            unit="N/m",
        ),
    ] = 1e4
    initial_force: Annotated[
        Positive,
        Meaning("Force at which ``initial`` holds; unused for an exponent of 1.", unit="N"),
    ] = 5.0
    floor: Annotated[
        float,
        Field(strict=True, gt=0, le=1),
        Meaning("Lower bound of the estimate, as a fraction of its initial value."),
    ] = 0.1
    exponent: Annotated[
        float,
        Field(strict=True, ge=1, le=3),
        Meaning("Exponent p."),
    ] = 2.0
    forgetting: Annotated[
        float,
        Field(strict=True, gt=0, le=1),
        Meaning("Forgetting factor of the least squares, applied at each sample."),
    ] = 0.9
    step: Annotated[
        Positive,
        Meaning("Smallest change of depth that makes a new sample.", unit="m"),
    ] = 2e-6
    learn_above: Annotated[
        float,
        Field(strict=True, ge=0, lt=1),
        Meaning(
            "Fraction of the desired force above which it learns; the first touch is softer than "
            "the rest, even in terms of F^(1/p).",
        ),
    ] = 0.2

    #: Size of the state: slope [N^(1/p)/m], its covariance, and of the last sample the root of
    #: the force [N^(1/p)], -1 without contact, and the depth [m].
    size = 4

    @property
    def _initial_slope(self) -> Any:
        p = self.exponent
        return self.initial / (p * self.initial_force ** ((p - 1.0) / p))

    def start(self) -> Array:
        """Return the initial state, shape (4,)."""
        return np.array([self._initial_slope, 1.0, _NONE, 0.0])

    def update(self, state: Array, force: Any, desired: Any, depth: Any) -> Array:
        """Return the state after one more sample, shape (..., 4).

        Args:
            state: State, shape (..., 4).
            force: Measured force [N], a float, or one for each robot, shape (..., 1); without
                contact nothing is learned.
            desired: Desired force [N], likewise.
            depth: Depth of the tip in the surface, from an arbitrary zero [m], likewise.
        """
        if not is_one(state):
            return self._update(state, force, desired, depth)
        slope, covariance, last_root, last_depth = state.tolist()
        if force <= self.learn_above * desired:
            return np.array([slope, covariance, _NONE, 0.0])
        root = force ** (1.0 / self.exponent)
        if last_root == _NONE:
            return np.array([slope, covariance, root, depth])
        if abs(depth - last_depth) < self.step:
            return state
        slope, covariance = self._fit(slope, covariance, root - last_root, depth - last_depth)
        slope = max(slope, self.floor) * self._initial_slope
        return np.array([slope, covariance, root, depth])

    def _update(self, state: Array, force: Any, desired: Any, depth: Any) -> Array:
        """Return what `update` does, of many robots."""
        xp = functions_of(state, force)
        slope, covariance, last_root, last_depth = (state[..., k, None] for k in range(4))
        presses = force > self.learn_above * desired
        root = xp.where(presses, force, 1.0) ** (1.0 / self.exponent)
        relative, narrower = self._fit(slope, covariance, root - last_root, depth - last_depth)
        still = (last_root != _NONE) & (xp.abs(depth - last_depth) < self.step)
        learns = presses & (last_root != _NONE) & ~still
        holds = presses & still
        return join(
            (
                xp.where(learns, xp.maximum(relative, self.floor) * self._initial_slope, slope),
                xp.where(learns, narrower, covariance),
                xp.where(holds, last_root, xp.where(presses, root, _NONE)),
                xp.where(holds, last_depth, xp.where(presses, depth, 0.0)),
            )
        )

    def _fit(self, slope: Any, covariance: Any, rise: Any, way: Any) -> tuple[Any, Any]:
        """Return the slope, relative to its initial value, and its covariance after a sample.

        Args:
            slope: Slope before [N^(1/p)/m].
            covariance: Its covariance before.
            rise: Change of the root of the force [N^(1/p)].
            way: Change of depth [m].
        """
        # Scaled by the step and the initial slope, so that neither affects the tuning.
        x = way / self.step
        y = rise / (self.step * self._initial_slope)
        gain = covariance * x / (self.forgetting + covariance * x * x)
        relative = slope / self._initial_slope
        relative = relative + gain * (y - relative * x)
        # At most 1, as x is at least 1 in size.
        return relative, (covariance - gain * x * covariance) / self.forgetting

    def retreat_speed(self, state: Array, force: Any, desired: Any, gain: Any) -> Any:
        """Return the speed out of the surface that corrects the force error [m/s].

        Args:
            state: State, shape (..., 4).
            force: Measured force [N].
            desired: Desired force [N].
            gain: Gain of the feedback [1/s].
        """
        return gain * self.depth_error(state, force, desired)

    def depth_error(self, state: Array, force: Any, desired: Any) -> Any:
        """Return how much too deep the tip is for the desired force [m]."""
        inverse = 1.0 / self.exponent
        if not is_one(state):
            return (_power(force, inverse) - _power(desired, inverse)) / state[..., :1]
        return float((max(force, 0.0) ** inverse - max(desired, 0.0) ** inverse) / state[0])


def _power(force: Any, exponent: Any) -> Any:
    """Return forces, shape (..., 1), to a power; 0 where they pull."""
    where = functions_of(force).where
    # No derivative of a root at 0.
    return where(force > 0.0, where(force > 0.0, force, 1.0) ** exponent, 0.0)


@dataclass(frozen=True)
class FixedStiffness:
    """A linear spring: force is proportional to depth.

    Args:
        value: Stiffness [N/m].
    """

    value: Any

    #: Size of the state: nothing is stored.
    size = 0

    def start(self) -> Array:
        """Return the initial state, shape (0,)."""
        return np.zeros(0)

    def update(self, state: Array, force: Any, desired: Any, depth: Any) -> Array:
        """Return the state unchanged, because nothing is learned."""
        return state

    def retreat_speed(self, state: Array, force: Any, desired: Any, gain: Any) -> Any:
        """Return the speed out of the surface that corrects the force error [m/s].

        Args:
            state: State, shape (..., 0).
            force: Measured force [N].
            desired: Desired force [N].
            gain: Gain of the feedback [1/s].
        """
        return gain * (force - desired) / self.value

    def depth_error(self, state: Array, force: Any, desired: Any) -> Any:
        """Return how much too deep the tip is for the desired force [m]."""
        return (force - desired) / self.value


_NOTHING = np.zeros(0)


def surface_split(normal_WE: Array, stiffness: Any) -> Array:
    """Return the rows that split a tip velocity into pressing and sliding, shape (..., 6, 3).

    Args:
        normal_WE: Outward normal of the surface, of length 1, shape (..., 3).
        stiffness: Scale of the pressing rows [N/m].
    """
    n = normal_WE
    P_n = outer(n, n)
    return functions_of(n).concatenate((scale(stiffness, P_n), np.eye(3) - P_n), axis=-2)


def printed_orientation_rows(J_omega: Array, R_WE: Array) -> Array:
    """Return the Jacobian of the paper's w = [b2, b3, c2, c3], shape (..., 4, n).

    Args:
        J_omega: Jacobian of the tool's angular velocity, shape (..., 3, n).
        R_WE: Orientation of the tool with the axes a, b, c as columns, shape (..., 3, 3).
    """
    # The columns b and c of R rotate with the angular velocity: b' = omega x b.
    xp = functions_of(J_omega, R_WE)
    axes_rates = [
        xp.cross(J_omega, R_WE[..., :, axis, np.newaxis], axis=-2)[..., 1:, :] for axis in (1, 2)
    ]
    return xp.concatenate(axes_rates, axis=-2)


class SurfaceTask(NamedTuple):
    """Motion along a surface and force along its normal, with what is learned of the contact.

    Its state has the parts ``stiffness`` and ``contact``, each only if it is needed.

    Attributes:
        gain: Gain of the position and force feedback [1/s].
        surface: Stiffness of the contact, given or learned.
        measured: Whether the force is measured, and not computed from the depth of the tip.
        approach_speed: Largest speed along the normal [m/s]; None for no bound.
        contact_loss: Reaction to a lost contact; None to ignore it.
    """

    gain: Any
    surface: FixedStiffness | OnlineStiffness
    measured: bool
    approach_speed: Any
    contact_loss: ContactLoss | None

    @property
    def learns_stiffness(self) -> bool:
        """Whether the stiffness is learned."""
        return self.surface.size > 0

    @property
    def stiffness(self) -> Any:
        """The given stiffness [N/m], for options with which it cannot be learned."""
        assert isinstance(self.surface, FixedStiffness)
        return self.surface.value

    @property
    def inputs(self) -> dict[str, tuple[int, ...]]:
        """Shapes of the signals of the contact that it sees, by name."""
        signals: dict[str, tuple[int, ...]] = {"normal_WE": (3,), "normal_force_desired": (1,)}
        return signals | ({"normal_force": (1,)} if self.measured else {})

    @property
    def observables(self) -> dict[str, tuple[int, ...]]:
        """Shapes of what `diagnostics` returns, by name."""
        return {} if self.contact_loss is None else {"contact_lost": (1,)}

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        parts: dict[str, tuple[int, ...]] = {}
        if self.learns_stiffness:
            parts["stiffness"] = (self.surface.size,)
        if self.contact_loss is not None:
            parts["contact"] = (ContactLoss.size,)
        return parts

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the initial state; see `Component.init`."""
        parts = {}
        if self.learns_stiffness:
            parts["stiffness"] = self.surface.start()
        if self.contact_loss is not None:
            parts["contact"] = self.contact_loss.start()
        return parts

    def step(self, state: State, u: Signals, period: float) -> tuple[State, State]:
        """Return what is known after one more sample of the force: its parts of the next state.

        See `Component.step`.
        """
        if not self.shapes:
            return {}, {}
        force, desired = _number(u["normal_force"]), _number(u["normal_force_desired"])
        parts: State = {}
        if self.learns_stiffness:
            depth = -dot(u["normal_WE"], u["p_WE"])
            stiffness = self.surface.update(state["stiffness"], force, desired, depth)
            parts["stiffness"] = stiffness
        if self.contact_loss is not None:
            contact = self.contact_loss.update(state["contact"], force, desired, period)
            parts["contact"] = contact
        return parts, parts

    def tip_velocity(self, state: Signals, u: Signals) -> Array:
        """Return the desired velocity of the tip, shape (..., 3) [m/s].

        Args:
            state: Parts of the law's state, by name.
            u: Signals at the sample.
        """
        n = u["normal_WE"]
        along = u["v_WE_desired"] + self.gain * (u["p_WE_desired"] - u["p_WE"])
        out = dot(n, along)
        pressing = along + (self._rise(state, u, out) - out) * n
        return self.unless_lost(state, pressing, n)

    def depth_error(self, state: Signals, u: Signals) -> Any:
        """Return how much too deep the tip is for the desired force [m], a float or (..., 1).

        Args:
            state: Parts of the law's state, by name.
            u: Signals at the sample.
        """
        force, desired = _number(u["normal_force"]), _number(u["normal_force_desired"])
        return self.surface.depth_error(self._estimate(state), force, desired)

    def unless_lost(self, state: Signals, pressing: Array, normal_WE: Array) -> Array:
        """Return a velocity of the tip where it has contact, and that of the reaction elsewhere.

        Args:
            state: Parts of the law's state, by name.
            pressing: Velocity of a tip that has not lost its contact, shape (..., 3) [m/s].
            normal_WE: Outward normal of the surface, shape (..., 3).
        """
        if self.contact_loss is None:
            return pressing
        contact = state["contact"]
        away = self.contact_loss.retreat(contact) * normal_WE
        if is_one(contact):
            return away if contact[0] == LOST else pressing
        return functions_of(contact, pressing).where(contact[..., :1] == LOST, away, pressing)

    def diagnostics(self, state: Signals) -> State:
        """Return the observables, by name, from the parts of the law's state."""
        if self.contact_loss is None:
            return {}
        return {"contact_lost": (state["contact"][..., :1] == LOST).astype(float)}

    def check(self, key: str, pressing_force: float | None) -> None:
        """Raise an InvalidInputError if the desired force would count as no contact.

        Args:
            key: Key of the reaction to a lost contact, for the message.
            pressing_force: Desired pressing force [N]; None without a contact.
        """
        if self.contact_loss is not None:
            self.contact_loss.check(key, pressing_force)

    def caveats(self, key: str, metrics: Mapping[str, float]) -> list[str]:
        """Return what to say after a run with these metrics.

        Args:
            key: Key of the reaction to a lost contact, for the message.
            metrics: Metrics of the run, by name.
        """
        return [] if self.contact_loss is None else self.contact_loss.caveats(key, metrics)

    def _rise(self, state: Signals, u: Signals, out: Any) -> Any:
        """Return the speed out of the surface that the force asks for [m/s].

        Args:
            state: Parts of the law's state, by name.
            u: Signals at the sample.
            out: Speed out of the surface that the path asks for [m/s].
        """
        desired = _number(u["normal_force_desired"])
        if self.measured:
            force, stiffness = _number(u["normal_force"]), self._estimate(state)
            rise = self.surface.retreat_speed(stiffness, force, desired, self.gain)
        else:
            rise = out - self.gain * desired / self.stiffness
        return rise if self.approach_speed is None else _limit(rise, self.approach_speed)

    def _estimate(self, state: Signals) -> Array:
        """Return what is known of the stiffness; nothing if it is given."""
        return state["stiffness"] if self.learns_stiffness else _NOTHING


def _number(signal: Array) -> Any:
    """Return a signal of one entry: a float, or an array of shape (..., 1) of many robots."""
    return float(signal[0]) if is_one(signal) else signal


def _limit(value: Any, largest: Any) -> Any:
    if isinstance(value, float):
        return min(max(value, -largest), largest)
    return clip(value, -largest, largest)


@validated
class ForceControl:
    """How the error of a pressing force becomes a speed along the normal."""

    stiffness: Annotated[
        Stiffness | OnlineStiffness,
        Meaning(
            "Stiffness of the surface [N/m], or an `OnlineStiffness` that learns it.",
            unit="N/m",
        ),
    ]
    gain: Annotated[Gain, Meaning("Gain of the force feedback.", unit="1/s")] = 10.0
    approach_speed: Annotated[
        Speed | None,
        Meaning("Largest speed along the normal; None for no bound.", unit="m/s"),
    ] = None
    contact_loss: Annotated[
        ContactLoss | None,
        Meaning("Reaction to a lost contact; None to ignore it."),
    ] = None

    @property
    def task(self) -> SurfaceTask:
        """The task along the surface and its normal, with a force that is measured."""
        stiffness = self.stiffness
        surface = stiffness if isinstance(stiffness, OnlineStiffness) else FixedStiffness(stiffness)
        return SurfaceTask(self.gain, surface, True, self.approach_speed, self.contact_loss)
