"""The motion of arms and their laws, step by step.

- What a camera sees of a tool, step by step.
- Ticks: the times for which a velocity is held, and its changes from one to the next.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays.algebra import AnyArray, along, lengths, sizes, transform
from ..errors import OldName
from ..inputs.fields import Array


@dataclass(frozen=True)
class ImageMotion:
    """Pixels of points on a tool over k steps.

    Attributes:
        pixels: Pixels of the points, one point after the other, shape (k, 2 points) [px].
        desired: Their desired values, likewise.
        J: Image Jacobian, of pixels that are taken to be metres, shape (k, 2 points, n) [m].
        margin: How far the points are from the edge of the image, shape (k,) [px]; less than 0
            where one is out of it.
        swapped: Times at which the camera is swapped first and last [s]; None if it never is.
    """

    pixels: Array
    desired: Array
    J: Array
    margin: Array
    swapped: tuple[float, float] | None

    @cached_property
    def error(self) -> Array:
        """Distance of each point from where it is to be seen, shape (k, points) [px]."""
        away = (self.pixels - self.desired).reshape(len(self.pixels), -1, 2)
        return np.asarray(np.linalg.norm(away, axis=-1))

    @cached_property
    def farthest(self) -> Array:
        """Distance of the point that is farthest off, shape (k,) [px]."""
        return np.asarray(self.error.max(axis=-1))


def secant(time: Array, values: Array, tick: float | None, origin: float) -> Array:
    """Return difference quotients over ticks, shape (k - 1, ...), for the tick each step ends in.

    Without a tick they are taken over the steps themselves; steps that events split a rounding
    error apart are merged.

    Args:
        time: Time of each step, shape (k,) [s]; the first is that of the run or ends a tick.
        values: Values at these, shape (k, ...).
        tick: Time for which a value is held [s]; None if it changes at every step.
        origin: Time at which the first tick begins [s].
    """
    if time.size < 2:
        return np.zeros((0, *values.shape[1:]))
    last, ends = tick_ends(time, tick, origin)
    lengths = np.diff(ends).reshape(-1, *(1,) * (values.ndim - 1))
    if last.size == time.size:
        return np.asarray(np.diff(values, axis=0) / lengths)
    quotients = np.diff(values[last], axis=0) / lengths
    return np.asarray(quotients[np.searchsorted(last, np.arange(1, time.size)) - 1])


def tick_ends(time: Array, tick: float | None, origin: float) -> tuple[NDArray[np.int_], Array]:
    """Return the last step of each tick and the time at which the tick ends [s].

    Args:
        time: Time of each step, shape (k,) [s], of at least two; see `secant`.
        tick: Time for which a value is held [s]; None if it changes at every step.
        origin: Time at which the first tick begins [s].
    """
    number = _numbers(time, tick, origin)
    last = np.flatnonzero(np.diff(number, append=number[-1] + 1))
    ends = time[last] if tick is None else np.asarray(number[last] * tick, dtype=float)
    return last, ends


def last_end(time: Array, ticks: Iterable[float | None], origin: float) -> int:
    """Return the number of the last step known to end a tick of each kind; 0 if none is.

    Args:
        time: Time of each step, shape (k,) [s].
        ticks: Times for which values are held [s]; None for one that changes at every step.
        origin: Time at which the first ticks begin [s].
    """
    if time.size < 2:
        return 0
    ends = np.all([np.diff(_numbers(time, tick, origin)) > 0 for tick in ticks], axis=0)
    return int(np.flatnonzero(ends)[-1]) if ends.any() else 0


def _numbers(time: Array, tick: float | None, origin: float) -> NDArray[np.int_]:
    """Return the number of the tick that each step ends in, shape (k,)."""
    if tick is None:
        step = np.diff(time)
        # In a long run, the rounding error of the time exceeds that of a step.
        apart = step >= max(1e-9 * step.max(), 4.0 * np.spacing(time[-1]))
        # A change at the start counts as one over the first step.
        apart[: np.argmax(apart) + 1] = False
        return np.concatenate(([0], 1 + np.cumsum(apart)))
    # A tick includes its end, where its value still holds; a step that ends a rounding error
    # later belongs to the next tick.
    ticks = (time - origin) / tick
    number = np.ceil(ticks - 1e-6).astype(int)
    is_whole = number - ticks < 1e-6
    number[1:] += is_whole[:-1] & (number[1:] == number[:-1])
    return number


#: Share of the desired force at which a force has risen.
RISE_SHARE = 0.95
#: Joint speed above which an arm moves [rad/s].
MOVING = 1e-6


@dataclass(frozen=True)
class Pressing:
    """The contact of tools with surfaces over k steps; axes as those of a `Motion`.

    Attributes:
        normal: Outward unit normal of the surface, shape (..., 3); of a curved one that a single
            robot presses on, shape (k, 3).
        force: Pressing force along the normal, shape (k, ...) [N].
        desired: Desired pressing force, shape (k, ...) [N].
        desired_end: Desired pressing force when the run ends, shape (...) [N].
    """

    normal: AnyArray
    force: AnyArray
    desired: AnyArray
    desired_end: AnyArray

    @property
    def error(self) -> AnyArray:
        """The pressing force minus the desired one, shape (k, ...) [N]."""
        return self.force - self.desired

    @property
    def touching(self) -> AnyArray:
        """Whether there is any force, shape (k, ...)."""
        return self.force > 0.0

    @property
    def has_risen(self) -> AnyArray:
        """Whether the force is 95 % of what is desired in the end, shape (k, ...)."""
        return self.force >= RISE_SHARE * self.desired_end


@dataclass(frozen=True)
class Motion:
    """The motion of arms with n joints and of their laws over k steps, for m position axes.

    The first axis of every series is steps. The motion of robots side by side has a second axis,
    robots; the motion of one arm does not: below, ``...`` stands for that axis or for nothing.
    Fields that do not vary from step to step have no axis of steps. Arrays are NumPy's; a single
    step may also be JAX's.

    The steps are those of a run, or of a part of it. A part that does not begin the run begins with
    the last step of the part before it, at which a tick of the arm and of the law ends.

    Attributes:
        time: Time of each step, shape (k,) [s].
        position, velocity: Joint positions and velocities of the arm, shape (k, ..., n)
            [rad, rad/s].
        network_velocity: The law's own joint velocities, shape (k, ..., n) [rad/s].
        p_WE, v_WE: Position and velocity of the end effector, shape (k, ..., m) [m, m/s].
        p_WE_desired, v_WE_desired: Their desired values, shape (k, ..., m) [m, m/s].
        J: Jacobian, shape (k, ..., m, n); for a pose task, three rotation rows come first.
        J_hat: Learned Jacobian, shape (k, ..., m, n); None without learning.
        target: Target posture, shape (..., n) [rad], or the newest of those that came until each
            step, shape (k, ..., n); None without one.
        orientation_error: Angle between the orientation of the end effector and the desired one,
            shape (k, ...) [rad]; None if the orientation is left free.
        task: What a task of objectives is measured by, of the worst objective, by the names of
            `drake_rnn.signals.TASK_MEASURES`, shape (k, ...) each; empty without objectives.
        pressing: Contact with a surface; None without one. With a contact, position errors are
            those along the surface.
        returns: Whether the desired path ends where it began, so that the joints should as well,
            shape (...).
        lap_start: Time at which the last whole lap of the run begins, shape (...) [s]; NaN or None
            without one.
        until: Time at which the run is to end [s]; None if these steps end it.
        position_commanded: Joint positions that motors are told to follow, shape (k, ..., n) [rad];
            None for an arm that is where it is commanded to be.
        p_WE_commanded: Position of the end effector at the commanded joint positions,
            shape (k, ..., m) [m]; None for such an arm.
        tick, network_tick: Time for which the arm's and the law's velocities are held [s];
            None if they change at every step.
        origin: Time of the run's first step [s]; None if it is the first of these.
        observed: Observables of the law, by name, each of shape (k, ..., size).
        features: What features observe besides the fields of a motion, by name, each of shape
            (k, ...).
        distance: Least distance of the arm from itself and from obstacles, since the step before,
            shape (k,) [m]; None if distances are not looked at.
        distance_moving: The same where the arm has moved since, infinite elsewhere; None without
            obstacles that move.
        arms_distance: Least distance of links of two arms that one law moves, likewise; None for
            one arm.
        locked: Times at which the first and the last joint lock [s]; None if none does.
        image: What a camera sees; None without one. ``J`` is then the image Jacobian, of pixels
            that are taken to be metres.
        virtual: Motion of the virtual arm ahead of a filter, where the law sees that arm and learns
            its Jacobian; None where the law sees this arm.
    """

    time: AnyArray
    position: AnyArray
    velocity: AnyArray
    network_velocity: AnyArray
    p_WE: AnyArray
    v_WE: AnyArray
    p_WE_desired: AnyArray
    v_WE_desired: AnyArray
    J: AnyArray
    J_hat: AnyArray | None = None
    target: AnyArray | None = None
    orientation_error: AnyArray | None = None
    task: Mapping[str, AnyArray] = field(default_factory=dict)
    pressing: Pressing | None = None
    returns: AnyArray = True
    lap_start: AnyArray | None = None
    until: float | None = None
    position_commanded: AnyArray | None = None
    p_WE_commanded: AnyArray | None = None
    tick: float | None = None
    network_tick: float | None = None
    origin: float | None = None
    observed: Mapping[str, AnyArray] = field(default_factory=dict)
    features: Mapping[str, AnyArray] = field(default_factory=dict)
    distance: AnyArray | None = None
    distance_moving: AnyArray | None = None
    arms_distance: AnyArray | None = None
    locked: tuple[float, float] | None = None
    image: ImageMotion | None = None
    virtual: Motion | None = None

    @property
    def motion_seen_by_law(self) -> Motion:
        """The motion of the arm that the law sees."""
        return self.virtual or self

    @cached_property
    def error(self) -> AnyArray:
        """Position error; in contact, its part along the surface, shape (k, ..., m) [m]."""
        return self._aside(self.p_WE - self.p_WE_desired)

    @cached_property
    def error_length(self) -> AnyArray:
        """Norm of the position error, shape (k, ...) [m]."""
        return lengths(self.error)

    @cached_property
    def velocity_error(self) -> AnyArray:
        """Velocity error; in contact, its part along the surface, shape (k, ..., m) [m/s]."""
        return self._aside(self.v_WE - self.v_WE_desired)

    @cached_property
    def target_error(self) -> AnyArray | None:
        """Largest distance of a joint from the target posture, shape (k, ...) [rad]."""
        if self.target is None:
            return None
        return abs(self.position - self.target).max(axis=-1)

    @cached_property
    def following_error(self) -> AnyArray | None:
        """Norm of the way to the newest of joint targets that come, shape (k, ...) [rad]."""
        if self.target is None or self.target.ndim != self.position.ndim:
            return None
        return lengths(self.position - self.target)

    @cached_property
    def speed(self) -> AnyArray:
        """Magnitudes of the joint velocities, shape (k, ..., n) [rad/s]."""
        return abs(self.velocity)

    @cached_property
    def joint_acceleration(self) -> AnyArray:
        """Secant of the arm's velocity over each step's tick, shape (k - 1, ..., n) [rad/s^2]."""
        return secant(self.time, self.velocity, self.tick, self.first_time)

    @cached_property
    def acceleration_magnitude(self) -> AnyArray:
        """Magnitudes of the joint accelerations, shape (k - 1, ..., n) [rad/s^2]."""
        return abs(self.joint_acceleration)

    @cached_property
    def network_acceleration(self) -> AnyArray:
        """Secant of the law's velocity over each step's tick, shape (k - 1, ..., n) [rad/s^2]."""
        if self.network_velocity is self.velocity and self.network_tick == self.tick:
            return self.joint_acceleration
        return secant(self.time, self.network_velocity, self.network_tick, self.first_time)

    @cached_property
    def jacobian_error(self) -> AnyArray | None:
        """Difference of J and J_hat, shape (k, ..., m, n); None without learning."""
        return None if self.J_hat is None else self.J - self.J_hat

    @cached_property
    def jacobian_error_size(self) -> AnyArray | None:
        """Frobenius norm of J - J_hat, shape (k, ...); None without learning."""
        return None if self.jacobian_error is None else sizes(self.jacobian_error)

    @cached_property
    def jacobian_error_along(self) -> AnyArray | None:
        """Norm of (J - J_hat) v / |v|, shape (k, ...); NaN for an arm at rest."""
        if self.jacobian_error is None:
            return None
        v = self.network_velocity
        speed = lengths(v)
        moving = speed > MOVING
        off = lengths(transform(self.jacobian_error, v))
        return np.where(moving, off / np.where(moving, speed, 1.0), np.nan)

    @property
    def begins(self) -> bool:
        """Whether these steps begin the run."""
        return self.origin is None

    @property
    def fresh(self) -> slice:
        """The steps that are not also in the part of the run before this one."""
        return slice(0 if self.begins else 1, None)

    def steps_within(self, window: tuple[float, float] | None) -> slice:
        """Return the fresh steps in the window; all fresh ones for None."""
        begin, end = self.fresh.start, self.time.size
        if window is not None:
            # Step times carry rounding errors.
            begin = max(begin, int(np.searchsorted(self.time, window[0] - 1e-9)))
            end = int(np.searchsorted(self.time, window[1] + 1e-9, side="right"))
        return slice(begin, max(begin, end))

    def _aside(self, vectors: AnyArray) -> AnyArray:
        if self.pressing is None:
            return vectors
        n = self.pressing.normal
        if n.ndim == vectors.ndim == 2:
            # Of a curved surface, a normal at each step.
            return vectors - (vectors * n).sum(axis=1)[:, np.newaxis] * n
        return vectors - along(vectors, n)

    @property
    def first_time(self) -> float:
        """Time of the run's first step [s]."""
        if self.origin is not None:
            return self.origin
        return float(self.time[0]) if self.time.size else 0.0

    seen = OldName("motion_seen_by_law")
