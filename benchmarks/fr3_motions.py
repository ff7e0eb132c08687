"""Motions that a Franka FR3 is asked for at its full limits, and the commands of laws for them.

Targets jump by up to 0.5 m, follow a nephroid passed in 1 to 2 s, or jump to where the tool is in
postures close to position limits. Motions begin at the home posture, in a random one, close to
position limits, or in one that is nearly singular.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache

import numpy as np

from drake_rnn import Adaptive, Arm, Array, JointLimits
from drake_rnn.arrays.algebra import (
    robots_first,
    robots_last,
)
from drake_rnn.laws import SampledReading
from drake_rnn.laws.call_checks import without_checks
from drake_rnn.laws.checks import stack
from drake_rnn.robot.load_arm import screws_of
from drake_rnn.robot.screws import Screws
from peer_schemes.tasks import Braking, Task

PERIOD, STEPS = 1e-3, 2000
#: How the path is joined [m/s^2, m/s].
BRAKING, FASTEST = 2.0, 1.0
#: Random starts are this far within where joints may rest, and those close to limits at most [rad].
INSIDE = 0.02
#: Share of the joints that are close to a limit where some are.
CLOSE = 0.5
#: Random postures of which the one nearest to singular is taken.
DRAWN = 200


class Errand(Task):
    """A motion that is asked for: a start, and where the end effector should be at each sample.

    Args:
        arm: The arm.
        limits: Limits that the law is given.
        seed: Decides on the motion: the start, by its remainder of four, and the kind of targets.
        known: Whether J is known.
    """

    def __init__(self, arm: Arm, limits: JointLimits, seed: int, *, known: bool = True) -> None:
        rng = np.random.default_rng(seed)
        self.name, self.oriented, self.known, self.seed = f"errand {seed}", False, known, seed
        self.arm, self.limits, self.period, self.steps = arm, limits, PERIOD, STEPS
        starts = (lambda _arm, _rng: arm.home, _anywhere, _close_to_limits, _nearly_singular)
        self.start = starts[seed % 4](arm, rng)
        at_start = _screws(arm).at(self.start)
        self.R_WE = np.broadcast_to(at_start.R_WE, (STEPS + 2, 3, 3))
        kind = seed // 4 % 3
        if kind == 2:
            self.p_WE = _to_limits(arm, rng)
        else:
            self.p_WE = at_start.p_WE + (_jumps, _nephroid)[kind](rng)


@cache
def _screws(arm: Arm) -> Screws:
    return screws_of(arm)


def _anywhere(arm: Arm, rng: np.random.Generator, count: tuple[int, ...] = ()) -> Array:
    """Return random postures, shape (*count, n) [rad]."""
    lower, upper = arm.limits.resting
    return rng.uniform(lower + INSIDE, upper - INSIDE, (*count, arm.n))


def _close_to_limits(arm: Arm, rng: np.random.Generator) -> Array:
    """Return a random posture with some joints close to where they may just rest [rad]."""
    lower, upper = arm.limits.resting
    q, room = _anywhere(arm, rng), rng.uniform(0.0, INSIDE, arm.n)
    at_limit = np.where(rng.random(arm.n) < 0.5, lower + room, upper - room)
    return np.where(rng.random(arm.n) < CLOSE, at_limit, q)


def _nearly_singular(arm: Arm, rng: np.random.Generator) -> Array:
    """Return the posture that is nearest to singular of some random ones [rad]."""
    postures = _anywhere(arm, rng, (DRAWN,))
    least = np.linalg.svd(np.asarray(_screws(arm).at(postures).J), compute_uv=False)[:, -1]
    nearest: Array = postures[np.argmin(least)]
    return nearest


def _each_second(targets: Array) -> Array:
    """Return targets that are held for a second each, shape (STEPS + 2, 3) [m]."""
    return np.repeat(targets, 1000, axis=0)[np.minimum(np.arange(STEPS + 2), STEPS - 1)]


def _jumps(rng: np.random.Generator) -> Array:
    """Return ways that jump by up to 0.5 m each second, shape (STEPS + 2, 3) [m]."""
    ways = rng.normal(size=(-(-STEPS // 1000), 3))
    ways *= rng.uniform(0.1, 0.5, (len(ways), 1)) / np.linalg.norm(ways, axis=1, keepdims=True)
    return _each_second(ways)


def _to_limits(arm: Arm, rng: np.random.Generator) -> Array:
    """Return positions of the tool in postures close to limits, shape (STEPS + 2, 3) [m]."""
    postures = np.array([_close_to_limits(arm, rng) for _ in range(-(-STEPS // 1000))])
    return _each_second(np.asarray(_screws(arm).at(postures).p_WE))


def _nephroid(rng: np.random.Generator) -> Array:
    """Return a nephroid in a random plane, passed in 1 to 2 s, shape (STEPS + 2, 3) [m]."""
    plane, _ = np.linalg.qr(rng.normal(size=(3, 2)))
    size, lap = rng.uniform(0.02, 0.08), rng.uniform(1.0, 2.0)
    phase = 2.0 * np.pi * PERIOD * np.arange(STEPS + 2) / lap
    curve = np.stack(
        (3.0 * np.cos(phase) - np.cos(3.0 * phase), 3.0 * np.sin(phase) - np.sin(3.0 * phase)), -1
    )
    return size * (curve - curve[0]) @ plane.T


#: Velocities of errands, held sample by sample, shape (errands, STEPS, 7) [rad/s].
Commands = Callable[[Sequence[Errand]], Array]


def adaptive(errands: Sequence[Errand]) -> Array:
    """Return the commands of the adaptive law, of all errands side by side."""
    readings = [_reading(errand) for errand in errands]
    x = np.stack([_first(*each) for each in zip(readings, errands, strict=True)])
    q = np.stack([errand.start for errand in errands])
    p = np.stack([errand.p_WE for errand in errands], axis=1)
    commands = _followed(errands[0], stack(readings), _beside(q), _beside(x), p)
    return np.ascontiguousarray(commands.swapaxes(0, 1))


def _beside(array: Array) -> Array:
    """Return an array with robots side by side in memory."""
    return robots_first(robots_last(array, 1), 1)


def adaptive_alone(errand: Errand) -> Array:
    """Return the commands of the adaptive law for one errand, shape (STEPS, 7) [rad/s]."""
    reading = _reading(errand)
    return _followed(errand, reading, errand.start, _first(reading, errand), errand.p_WE)


def _reading(errand: Errand) -> SampledReading:
    law = Adaptive(
        limits=errand.limits,
        home=errand.start,
        jacobian="known" if errand.known else "learned",
        braking=BRAKING,
        feedback_limit=FASTEST,
    )
    return law.sampled(PERIOD)


def _seen(errand: Errand, q: Array) -> dict[str, Array]:
    """Return what a law sees of arms, by name."""
    moved = _screws(errand.arm).at(q)
    u = {"position": q, "p_WE": moved.p_WE}
    return {**u, "J": moved.J} if errand.known else u


def _first(reading: SampledReading, errand: Errand) -> Array:
    desired = {"p_WE_desired": errand.p_WE[0], "p_preview": errand.p_WE[1]}
    u = {**_seen(errand, errand.start), **desired}
    return reading.initial_state(np.random.default_rng(errand.seed), u)


def _followed(errand: Errand, reading: SampledReading, q: Array, x: Array, p_WE: Array) -> Array:
    """Return commands that arms follow exactly, shape (STEPS, ..., n) [rad/s].

    Args:
        errand: One of those that arms have.
        reading: The law of all arms.
        q: Postures at the start, shape (..., n) [rad].
        x: Their states, shape (..., state.size).
        p_WE: Desired positions, shape (STEPS + 2, ..., 3) [m].
    """
    step, commands = without_checks(reading.step), np.empty((STEPS, *q.shape))
    with np.errstate(all="ignore"):
        for k in range(STEPS):
            u = _seen(errand, q) | {"p_WE_desired": p_WE[k], "p_preview": p_WE[k + 1]}
            x = step(k * PERIOD, x, u, PERIOD)
            commands[k] = reading.commanded_velocity((k + 1) * PERIOD, x)
            q = q + PERIOD * commands[k]
    return commands


def mink(errands: Sequence[Errand]) -> Array:
    """Return the commands of mink, within limits of position and velocity."""
    return np.array([list(_of_mink(errand, lambda v: v)) for errand in errands])


def ruckig(errands: Sequence[Errand]) -> Array:
    """Return those of Ruckig behind mink, within limits of acceleration and jerk besides."""
    return np.array([_through_ruckig(errand) for errand in errands])


def _through_ruckig(errand: Errand) -> Array:
    from ruckig import ControlInterface, InputParameter, OutputParameter, Ruckig, Synchronization

    n = errand.arm.n
    generator, given, made = Ruckig(n, PERIOD), InputParameter(n), OutputParameter(n)
    given.control_interface = ControlInterface.Velocity
    given.synchronization = Synchronization.No
    given.max_acceleration = errand.limits.require("acceleration", "Ruckig").tolist()
    given.max_jerk = errand.limits.require("jerk", "Ruckig").tolist()
    given.current_position = given.current_velocity = given.current_acceleration = [0.0] * n

    def shaped(v: Array) -> Array:
        given.target_velocity, given.target_acceleration = v.tolist(), [0.0] * n
        generator.update(given, made)
        made.pass_to_input(given)
        return np.array(made.new_velocity)

    return np.array(list(_of_mink(errand, shaped)))


def _of_mink(errand: Errand, shaped: Callable[[Array], Array]) -> Iterator[Array]:
    """Yield what is made of mink's velocities, sample by sample."""
    from peer_schemes.mink_scheme import Mink
    from peer_schemes.scheme import NoSolutionError

    class Brisk(Mink):
        braking = Braking(BRAKING, FASTEST, gain=100.0)

    scheme, q, v = Brisk(errand), errand.start.copy(), np.zeros(errand.arm.n)
    for k in range(STEPS):
        try:
            wanted = scheme.velocity(k, q, v)
        except NoSolutionError:
            wanted = np.zeros(errand.arm.n)
        v = shaped(wanted)
        yield v
        q = q + PERIOD * v
