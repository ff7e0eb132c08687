r"""A safety shield between a source of targets and an arm.

A policy, a hand-held controller or a planner sends targets 5 to 50 times a second, singly or in
chunks, late, with gaps and jumps. The arm wants a command every millisecond, within its limits of
position, velocity, acceleration and jerk, and clear of itself and of obstacles. A `Shield` follows
the targets and gives the commands.

It pursues the way through the chunks (`drake_rnn.shield.chunks`): at each sample it wants the
velocity that leads to where the way will be a ``lookahead`` later. That takes away the lag of a
controller that waits for each target. What is safe of that velocity is chosen by a `Guard`, whose
certificate holds between samples too. Poses and twists of the tool become joint velocities by the
adaptive law, with the arm's Jacobian, and are held to the same certificate.

Where the arm cannot keep up, it yields in one of two ways. It leaves the way where that brings it
nearer to its target, joint by joint; or, ``on_path``, the way itself goes on more slowly, the more
so the farther the arm is behind, so that it leaves the way little. In both cases `Shield.status`
says how far it is behind, off the way, and what limits it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import cached_property
from typing import Annotated, Any, NamedTuple
from warnings import warn

import numpy as np
from pydantic import Field, StrictBool, StrictInt

from ..compiled.library import built_step
from ..drive.guard import Guard, bind_step
from ..errors import InvalidInputError
from ..inputs.fields import (
    Array,
    Positive,
    checked,
    each,
    flag,
    instance,
    number,
    optional,
    validated,
    vector,
)
from ..inputs.keys import Meaning
from ..laws import Adaptive, JointStream
from ..laws.call_checks import without_checks
from ..laws.guard import LastStep, StepInPlace
from ..robot.arm import Arm
from ..robot.clearance import Clearance
from ..robot.clearance.arm_clearance import arm_clearance
from ..robot.clearance.obstacles import make_obstacles
from ..robot.limits import OUTSIDE, JointLimits, degree_hint
from ..robot.rotation import rotation_by, rotation_error
from ..systems import start_posture
from .chunks import Chunk, ChunkPath, Counts, Switch, read_chunk
from .chunks import Kind as Kind
from .report import (
    Sample,
    ShieldRecord,
    interventions_of,
    joint_step,
    lag,
    pose_of,
    record_of,
)

# Least lookahead [s]; how much of a/J it is if the jerk is bounded.
_LEAST_LOOKAHEAD, _LAGS = 0.05, 2.0
# A joint that is this far behind lets the way go on more slowly [rad], and one that far halts it.
_BEHIND, _HALT = 0.02, 0.1
# An arm whose joints stay this near to a posture does not get on [rad]; one that is behind by more
# than that wants to [rad].
_STANDS, _WANTS = 0.03, 0.02
# Poses that begin farther from the tool than this are refused [m].
_JUMP = 0.5
# How long the way behind is remembered, and how finely [s].
_PAST, _STEP = 2.0, 0.01
# Changes of the way that are remembered of a record of the last commands.
_WAYS = 64
# Deceleration and largest speed with which a tool joins poses [m/s^2, m/s].
_BRAKING, _JOINING = 1.0, 0.5
# A quaternion this far from length 1 is told.
_UNIT = 1e-3


class ShieldStatus(NamedTuple):
    """Where an arm is against what its source wants, and why it is not there.

    Attributes:
        behind: Largest difference of a joint from where the source wants it now [rad]; of poses and
            twists from where their joint velocities lead.
        off_path: How far the joints are off the way that was wanted lately, as the largest
            difference of a joint from the nearest point of it [rad].
        delay: By how much later than wanted the arm is at that point [s].
        limited_by: What keeps it from the velocity that is wanted: ``NAME velocity``,
            ``acceleration``, ``jerk`` or ``position`` of a joint, or ``ONE and OTHER`` for two
            bodies of which one is in the way of the other; empty for nothing.
        blocked_for: Time for which it has not got on although it is behind [s].
        silent_for: Time since the last target that is followed [s]; infinite before one.
    """

    behind: float
    off_path: float
    delay: float
    limited_by: tuple[str, ...]
    blocked_for: float
    silent_for: float


@validated
class ShieldSettings:
    """How a shield follows its source."""

    lookahead: Annotated[
        Positive | None,
        Meaning(
            "How far ahead on its way the arm is led; by default twice the time in which the jerk "
            "takes the acceleration to its limit, at least 0.05 s.",
            unit="s",
        ),
    ] = None
    switch: Annotated[
        Switch,
        Meaning("Rule for the overlap of two chunks."),
    ] = "blend"
    overlap: Annotated[Positive, Meaning("Length of a blend.", unit="s")] = 0.1
    timeout: Annotated[
        Positive,
        Meaning(
            "Time after the last velocity or twist after which the joints come to rest.",
            unit="s",
        ),
    ] = 0.2
    stale: Annotated[
        Positive,
        Meaning(
            "Time since its last target after which a chunk that comes is not followed.",
            unit="s",
        ),
    ] = 1.0
    on_path: Annotated[
        StrictBool,
        Meaning("Whether the way goes on more slowly where the arm is behind."),
    ] = False
    compiled: Annotated[
        StrictBool,
        Meaning(
            "Whether the steps of its laws are compiled: to C where a C compiler is found, else by "
            "JAX."
        ),
    ] = False
    record: Annotated[
        StrictBool | Annotated[StrictInt, Field(gt=0)],
        Meaning("Whether commands are recorded: all of them, or the last so many."),
    ] = False


class Shield:
    """Follows joint positions, velocities, poses or twists with certified commands.

    Targets come when they come, by `follow_positions` and its like; `command` is called every
    period. A new chunk replaces what is left of the last one, whatever kind that was. Joint
    positions and poses are held at the end of a chunk.

    Args:
        arm: The arm.
        period: Time between two calls of `command` [s].
        settings: How it follows its source.
        start: Posture that the robot rests in, shape (n,) [rad]; by default the arm's home. It may
            be up to 0.2 rad outside the position limits: the arm is then brought back first.
        limits: Limits of the joints; by default the arm's. Give those of acceleration and jerk
            where the arm has none.
        obstacles: Obstacles as in a document, each a mapping with ``kind`` and what belongs to it.
        collisions: Whether the arm is kept clear of itself and of ``obstacles``.

    Raises:
        InvalidInputError: If an argument is not as described, or the start is not free.
    """

    @checked(
        arm=instance(Arm),
        period=number(above=0.0),
        settings=instance(ShieldSettings, None),
        start=optional(vector),
        limits=instance(JointLimits, None),
        obstacles=each(dict),
        collisions=flag,
    )
    def __init__(
        self,
        arm: Arm,
        period: float,
        settings: ShieldSettings | None = None,
        *,
        start: Array | None = None,
        limits: JointLimits | None = None,
        obstacles: Sequence[Any] = (),
        collisions: bool = True,
    ) -> None:
        self.settings = settings = ShieldSettings() if settings is None else settings
        home = start_posture(arm, start, OUTSIDE)
        self.arm, self.period = arm, period
        self.limits = arm.limits if limits is None else limits
        self.lookahead = self._lookahead(settings.lookahead)
        self.clearance: Clearance | None = None
        self.warnings: tuple[str, ...] = ()
        solids = make_obstacles(list(obstacles))
        if collisions or solids:
            self.clearance, self.warnings = arm_clearance(arm, solids, home)
        law = JointStream(
            limits=self.limits,
            home=home,
            interval=self.lookahead,
            pursues=True,
            timeout=2.0 * self.lookahead,
            clearance=self.clearance,
            endless=[bool(turns) for turns in arm.endless],
        )
        self._guard = Guard(law, period, compiled=settings.compiled)
        self._way = self._no_way()
        self._kind: Kind = "positions"
        self._kinematics = arm.kinematics()
        # Time now, and that of the last target that is followed.
        self._t, self._last = 0.0, -np.inf
        self._past: deque[tuple[float, Array]] = deque(maxlen=round(_PAST / _STEP))
        self._stands_at, self._blocked = self._guard.position, 0.0
        self._wanted = np.zeros(arm.n)
        kept = settings.record
        self._samples: deque[Sample] | None = None
        if kept:
            self._samples = deque(maxlen=None if kept is True else kept)
        self._ways: deque[tuple[float, Kind, Chunk]] = deque(maxlen=None if kept is True else _WAYS)

    # What a source calls.

    def follow(
        self,
        kind: Kind,
        targets: object,
        rate: object = None,
        start: object = None,
        t: float | None = None,
        *,
        times: object = None,
    ) -> bool:
        """Follow targets of a kind, by the one of the methods below that is named after it.

        ``times`` are those of all targets, shape (k,) [s], in place of ``rate`` and ``start``.
        """
        followers = {
            "positions": self.follow_positions,
            "velocities": self.follow_velocities,
            "poses": self.follow_poses,
            "twists": self.follow_twists,
        }
        return followers[kind](targets, rate, start if times is None else times, t)

    def follow_positions(
        self, q: object, rate: object = None, start: object = None, t: float | None = None
    ) -> bool:
        """Follow joint positions, and return whether they are followed.

        Args:
            q: One target, shape (n,), or a chunk of them, shape (k, n) [rad]. Rows with NaN are
                left out.
            rate: Targets a second; needed for a chunk.
            start: Time of the first [s]; by default now. Without a rate, times of all, shape (k,).
            t: Time now, on the clock of `command` [s]; by default that of its last call.

        Raises:
            InvalidInputError: If they cannot be meant as they stand; the message names the likely
                mistake.
        """
        chunk, now = self._chunk("q", q, self.arm.n, rate, start, t)
        hint = degree_hint(chunk.values.ravel().tolist(), "rad")
        if hint:
            worst = float(np.nanmax(np.abs(chunk.values)))
            raise InvalidInputError(f"q: {worst:.6g} rad is no position of a joint{hint}")
        return self._take("positions", self._unwound(chunk), now)

    def follow_velocities(
        self, v: object, rate: object = None, start: object = None, t: float | None = None
    ) -> bool:
        """Follow joint velocities, shape (n,) or (k, n) [rad/s]; see `follow_positions`."""
        chunk, now = self._chunk("v", v, self.arm.n, rate, start, t)
        most = 10.0 * self.limits.velocity
        if (np.abs(chunk.values) > most).any():
            worst = float(np.nanmax(np.abs(chunk.values)))
            raise InvalidInputError(
                f"v: {worst:.6g} rad/s is more than ten times a limit of the velocity; must be in "
                "rad/s, not degrees a second"
            )
        return self._take("velocities", chunk, now)

    def follow_twists(
        self, V_WE: object, rate: object = None, start: object = None, t: float | None = None
    ) -> bool:
        """Follow twists of the tool in W, shape (6,) or (k, 6); see `follow_positions`.

        The first three numbers are the angular velocity [rad/s], the others the velocity of E's
        origin [m/s].
        """
        return self._take("twists", *self._chunk("V_WE", V_WE, 6, rate, start, t))

    def follow_poses(
        self, X_WE: object, rate: object = None, start: object = None, t: float | None = None
    ) -> bool:
        """Follow poses of the tool in W, shape (7,) or (k, 7); see `follow_positions`.

        The first three numbers are the position of E's origin [m], the others a quaternion of
        length 1, w first.
        """
        chunk, now = self._chunk("X_WE", X_WE, 7, rate, start, t)
        lengths = np.linalg.norm(chunk.values[:, 3:], axis=1)
        if (np.abs(lengths - 1.0) > _UNIT).any():
            worst = float(lengths[np.nanargmax(np.abs(lengths - 1.0))])
            raise InvalidInputError(
                f"X_WE: has a quaternion of length {worst:.6g}; must be of length 1, w first"
            )
        away = float(np.linalg.norm(chunk.values[0, :3] - self._kinematics.p_WE(self.position)))
        if away > _JUMP:
            raise InvalidInputError(
                f"X_WE: begins {away:.3g} m from the tool, more than {_JUMP:g} m; positions are in "
                "metres, in W, the frame of the arm's base"
            )
        return self._take("poses", self._near(chunk), now)

    # What the arm's loop calls.

    def command(self, t: float | None = None, p_WO: Array | None = None) -> Array:
        """Return the positions to command for the next period, shape (n,) [rad].

        Args:
            t: Time of this call [s]; must be given in all calls or in none.
            p_WO: How far obstacles that may move have gone, see `drake_rnn.Guard.command`.

        Raises:
            InvalidInputError: See `drake_rnn.Guard.command`.
        """
        before = self._guard.position
        now = self._t + self.period if t is None else t
        target = self._target(now, before)
        q = self._guard.command(target, p_WO, t)
        self._t = now
        self._note(now)
        if self._samples is not None:
            wanted = self._wanted_position(), self._wanted.copy()
            step = self._last_step
            self._samples.append(Sample(now, *wanted, self.position, *self._lag(), step))
        return q

    @property
    def position(self) -> Array:
        """Positions commanded last, shape (n,) [rad]."""
        return self._guard.position

    @property
    def velocity(self) -> Array:
        """Velocities commanded last, shape (n,) [rad/s]."""
        return self._guard.velocity

    @property
    def leading(self) -> Array | None:
        """Positions that the arm was led to by the last command, shape (n,) [rad]; None so far."""
        target = self._guard.last_step.u["target"]
        return target if np.isfinite(target).all() else None

    @property
    def uncertified(self) -> int:
        """In how many samples the arm moved and no stop was certified; see `drake_rnn.Guard`."""
        return 0 if self.clearance is None else int(self._guard.part("uncertified").item())

    @property
    def counts(self) -> Counts:
        """What of the chunks was not followed, and why."""
        return self._way.counts

    @property
    def status(self) -> ShieldStatus:
        """Where the arm is against what its source wants, and why it is not there."""
        off_path, delay = self._lag()
        silent = self._t - self._last
        at_work = self._limits_at_work()
        return ShieldStatus(self._behind(), off_path, delay, at_work, self._blocked, silent)

    @property
    def record(self) -> ShieldRecord:
        """What was wanted and commanded, and what intervened; see `ShieldSettings.record`.

        Raises:
            InvalidInputError: If nothing is recorded.
        """
        if self._samples is None:
            raise InvalidInputError(
                "record: there is none of this shield; make it with ShieldSettings(record=True)"
            )
        return record_of(
            list(self._samples), self.period, self.arm.joints, self.clearance, tuple(self._ways)
        )

    # How it is done.

    def _lookahead(self, lookahead: float | None) -> float:
        """Return the lookahead, by default what the jerk needs [s].

        With less than that, the arm would swing about its way.
        """
        limits, least = self.limits, max(_LEAST_LOOKAHEAD, 2.0 * self.period)
        if limits.jerk is not None and limits.acceleration is not None:
            least = max(least, _LAGS * float((limits.acceleration / limits.jerk).max()))
        if lookahead is not None and lookahead < least:
            text = f"lookahead: {lookahead:g} s is short; the arm may swing below {least:.3g} s"
            warn(text, stacklevel=3)
        return least if lookahead is None else lookahead

    def _no_way(self, counts: Counts | None = None) -> ChunkPath:
        settings = self.settings
        counts = Counts() if counts is None else counts
        return ChunkPath(settings.switch, settings.overlap, settings.stale, counts)

    def _chunk(
        self, name: str, values: object, width: int, rate: object, start: object, t: float | None
    ) -> tuple[Chunk, float]:
        now = self._t if t is None else t
        return read_chunk(name, values, width, now, rate, start), now

    def _take(self, kind: Kind, chunk: Chunk, now: float) -> bool:
        """Follow a chunk, whose kind may be another than that of the last one."""
        if kind != self._kind:
            self._way = self._no_way(self._way.counts)
            self._past.clear()
        self._kind = kind
        if not self._way.put(chunk, now):
            return False
        self._last = now
        if self._samples is not None:
            self._ways.append((now, kind, self._way.ahead(now)))
        return True

    def _unwound(self, chunk: Chunk) -> Chunk:
        """Return joint positions of which those that turn without end go the shorter way."""
        law, values = self._guard.law, chunk.values.copy()
        if not law.turning.any():
            return chunk
        near = self._way.at(self._t) if self._kind == "positions" else None
        near = self.position if near is None else near
        for row in values:
            if np.isfinite(row).all():
                row[:] = near = self.limits.nearest_turn(row, near, law.turning)
        return chunk._replace(values=values)

    def _near(self, chunk: Chunk) -> Chunk:
        """Return poses of which quaternions next to each other have the same sign."""
        values = chunk.values.copy()
        values[:, 3:] /= np.linalg.norm(values[:, 3:], axis=1)[:, None]
        near = self._way.at(self._t) if self._kind == "poses" else None
        last = values[0, 3:] if near is None else near[3:]
        for row in values:
            if row[3:] @ last < 0.0:
                row[3:] = -row[3:]
            last = row[3:] if np.isfinite(row).all() else last
        return chunk._replace(values=values)

    def _target(self, now: float, q: Array) -> Array | None:
        """Return the joint positions that lead the arm, shape (n,) [rad]; None before a target."""
        if self._way.end == -np.inf:
            self._wanted = np.zeros(q.size)
            return None
        if self._kind == "positions":
            if self.settings.on_path:
                self._slow_down(now, q)
            target = self._way.at(now + self.lookahead)
            assert target is not None
            self._wanted = (target - q) / self.lookahead
            return target
        self._wanted = self._wanted_velocity(now, q)
        return q + self.lookahead * self._wanted

    def _wanted_velocity(self, now: float, q: Array) -> Array:
        """Return the joint velocities that velocities, poses or twists ask for, (n,) [rad/s]."""
        if self._kind != "poses" and now > self._way.end + self.settings.timeout:
            return np.zeros(q.size)
        if self._kind == "velocities":
            return self._way.mean(now, now + self.period)
        if self._kind == "twists":
            V_WE = self._way.mean(now, now + self.period)
            p_WE, R_WE = self._kinematics.p_WE(q), self._kinematics.R_WE(q)
            ahead = rotation_by(self.period * V_WE[:3]) @ R_WE, p_WE + self.period * V_WE[3:]
            return self._tool.velocity(now, self._guard, (R_WE, p_WE), ahead)
        here, ahead = (self._pose_at(t) for t in (now, now + self.period))
        return self._tool.velocity(now, self._guard, here, ahead)

    @cached_property
    def _tool(self) -> ToolTracking:
        return ToolTracking(
            self.arm, self.limits, self._guard.law.home, self.period, self.settings.compiled
        )

    def _slow_down(self, now: float, q: Array) -> None:
        """Have the way go on later where the arm is behind, and not at all if it is far behind."""
        target = self._way.at(now)
        assert target is not None
        behind = float(np.abs(target - q).max())
        rate = min(max((_HALT - behind) / (_HALT - _BEHIND), 0.0), 1.0)
        self._way.put_off((1.0 - rate) * self.period)

    def _note(self, now: float) -> None:
        """Note what `status` tells of."""
        q = self.position
        if not self._past or now - self._past[-1][0] >= _STEP:
            target = self._way.at(now) if self._kind == "positions" else None
            if target is not None:
                self._past.append((now, target))
        if self._behind() < _WANTS or np.abs(q - self._stands_at).max() > _STANDS:
            self._stands_at, self._blocked = q, 0.0
        else:
            self._blocked += self.period

    def _behind(self) -> float:
        """Return the largest difference of a joint from where it is wanted now [rad]."""
        if self._kind == "positions":
            target = self._way.at(self._t)
            return 0.0 if target is None else float(np.abs(target - self.position).max())
        return float(np.abs(self._wanted - self.velocity).max()) * self.lookahead

    def _lag(self) -> tuple[float, float]:
        """Return how far the joints are off the way of late [rad], and how much later [s]."""
        return lag(self._past, self._t, self.position)

    def _wanted_position(self) -> Array:
        """Return where joints are wanted now, shape (n,) [rad]; see `ShieldRecord.wanted`."""
        target, q = self._way.at(self._t), self.position
        if target is not None and self._kind == "positions":
            return target
        if target is None or self._kind != "poses":
            return q + self.lookahead * (self._wanted - self.velocity)
        kinematics, (R_WE, p_WE) = self._kinematics, pose_of(target)
        turn = rotation_error(kinematics.R_WE(q), R_WE)
        way = np.concatenate((turn, p_WE - kinematics.p_WE(q)))
        return q + joint_step(kinematics, q, way)

    def _pose_at(self, t: float) -> tuple[Array, Array]:
        """Return orientation and position of the tool that are wanted at a time; poses are."""
        X_WE = self._way.at(t)
        assert X_WE is not None
        return pose_of(X_WE)

    @property
    def _last_step(self) -> LastStep:
        # A law of the tool chooses its velocities within the limits.
        is_chosen = self._kind in ("poses", "twists")
        return self._guard.last_step._replace(chosen=is_chosen)

    def _limits_at_work(self) -> tuple[str, ...]:
        """Return what keeps the arm from the velocity that is wanted; see `ShieldStatus`."""
        if self._way.end == -np.inf:
            return ()
        names = () if self.clearance is None else self.clearance.names
        causes = self._last_step.causes
        return tuple(map(str, interventions_of(causes, self.arm.joints, names)))


class ToolTracking:
    """Joint velocities that move the tool from where it is to a pose, by the adaptive law.

    Args:
        arm: The arm.
        limits: Limits of the joints.
        home: Posture that joints which the task leaves free are pulled to, shape (n,) [rad].
        period: Time for which a velocity is held [s].
        compiled: Whether the steps of the law are compiled.
    """

    def __init__(
        self, arm: Arm, limits: JointLimits, home: Array, period: float, compiled: bool
    ) -> None:
        self._kinematics, self._period = arm.kinematics(), period
        law = Adaptive(
            limits=limits,
            home=home,
            jacobian="known",
            task_size=6,
            braking=_BRAKING,
            feedback_limit=_JOINING,
            turn_braking=4.0 * _BRAKING,
            turn_limit=4.0 * _JOINING,
        )
        self._reading = reading = law.sampled(period)
        if compiled:
            self._step = bind_step(built_step(reading, period), reading, period)
        else:
            self._step = StepInPlace.by(without_checks(reading.step), reading, period)
        self._has_begun = False

    def velocity(
        self, t: float, guard: Guard, here: tuple[Array, Array], ahead: tuple[Array, Array]
    ) -> Array:
        """Return the velocities of the next period, shape (n,) [rad/s].

        Args:
            t: Time now [s].
            guard: What commands the arm.
            here: Orientation and position of E that are wanted now, in W.
            ahead: The same a period later.
        """
        q, kinematics = guard.position, self._kinematics
        step, reading, u = self._step, self._reading, self._step.u
        u["position"][:], u["p_WE"][:] = q, kinematics.p_WE(q)
        u["R_WE"][:], u["J"][:3], u["J"][3:] = (
            kinematics.R_WE(q),
            kinematics.J_omega(q),
            kinematics.J(q),
        )
        u["R_WE_desired"][:], u["p_WE_desired"][:] = here
        u["R_preview"][:], u["p_preview"][:] = ahead
        if not self._has_begun:
            step.x[:] = reading.initial_state(np.random.default_rng(0), u)
            self._has_begun = True
        step.x[:] = reading.resumed(step.x, q, guard.velocity, guard.acceleration)
        step.make()
        return np.array(reading.commanded_velocity(t, step.x))
