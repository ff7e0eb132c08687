"""A safety shield between a source of targets and an arm.

A policy, a hand-held controller or a planner sends targets 5 to 50 times a second, singly or in
chunks, late, with gaps and jumps. The arm wants a command every millisecond, within its limits of
position, velocity, acceleration and jerk, and clear of itself and of obstacles. A `Shield` follows
the targets and gives the commands.

It pursues the way through the chunks (`drake_rnn.shield.chunks`), as `drake_rnn.shield.pursuit`
says. What is safe of that velocity is chosen by a `Guard`, whose certificate holds between samples
too. Poses and twists of the tool become joint velocities by the adaptive law, with the arm's
Jacobian, and are held to the same certificate.

Where the arm cannot keep up, it yields in one of two ways. It leaves the way where that brings it
nearer to its target, joint by joint; or, ``on_path``, the way itself goes on more slowly, the more
so the farther the arm is behind, so that it leaves the way little. In both cases `Shield.status`
says how far it is behind, off the way, and what limits it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from math import isfinite
from time import perf_counter
from typing import Annotated, Any, NamedTuple
from warnings import warn

import numpy as np
from pydantic import Field, StrictBool, StrictInt

from ..compiled.builds import Steps
from ..drive.call_times import CallTimes
from ..errors import InvalidInputError, warn_unprotected
from ..inputs.fields import (
    Array,
    NonNegative,
    Wait,
    checked,
    each,
    flag,
    instance,
    optional,
    validated,
    vector,
    with_own_errors,
)
from ..inputs.keys import Meaning
from ..inputs.messages import is_number, replace_unchecked, require_type, short
from ..laws import JointStream
from ..laws.guard import LastStep, Late, StreamGuard, check_period
from ..robot.arm import Arm
from ..robot.clearance import Clearance
from ..robot.clearance.arm_clearance import clearance_of
from ..robot.clearance.capsules import Displacements
from ..robot.clearance.obstacles import make_obstacles
from ..robot.limits import OUTSIDE, JointLimits, degree_hint, require_resting
from ..robot.rotation import rotation_error
from ..systems import start_posture
from .blockage import Blockage, Look
from .chunks import (
    NAMES,
    WIDTHS,
    Chunk,
    ChunkPath,
    Counts,
    SourceClock,
    Switch,
    Timing,
    WayBehind,
    read_chunk,
)
from .chunks import Kind as Kind
from .guarded_commands import GuardedCommands
from .pose_filter import PoseFilter, Tracking, unit_poses
from .progress import JointProgress
from .pursuit import Pursuit, WayPursuit
from .report import (
    Sample,
    ShieldRecord,
    interventions_of,
    joint_step,
    pose_of,
    record_of,
)
from .tool_tracking import AT, OFF, PATIENCE, TURNED, ToolTracking, angle_between

# Least lookahead [s]; how much of a/J it is if the jerk is bounded.
_LEAST_LOOKAHEAD, _LAGS = 0.05, 2.0
# A joint that is this far behind lets the way go on more slowly [rad], and one that far halts it.
_BEHIND, _HALT = 0.02, 0.1
# An arm whose joints stay this near to a posture does not get on [rad]; one that is behind by more
# than that wants to [rad].
_STANDS, _WANTS = 0.03, 0.02
# A tool has arrived that is turned off its pose by less than the first of these, joints that are
# nearer to their positions than the second [rad], if they are slower than the third [rad/s].
_AT_TURN, _AT_JOINTS, _SETTLED = 5e-3, 2e-3, 1e-3
# Poses that begin farther from the tool than this are refused [m].
_JUMP = 0.5
# Changes of the way that are remembered of a record of the last commands.
_WAYS = 64
# A quaternion this far from length 1 is told.
_UNIT = 1e-3
# A tool does not turn or move faster [rad/s, m/s]; a turn a second is never taken for degrees.
_SPIN, _SPEED, _TURN_RATE = 50.0, 10.0, 6.3
# What numbers are clipped to before they are squared.
_HUGE = 1e100
# Positions nearer to the origin than this may be meant from the tool [m].
_STEPS = 0.1
# Poses that begin farther from the tool's orientation than this, and with w last nearer [rad].
_TURN, _NEAR = 1.0, 0.3
# Calls of a source and of `command` are no farther apart than this [s].
_PAUSE = 60.0


class ShieldStatus(NamedTuple):
    """Where an arm is against what its source wants, and why it is not there.

    Attributes:
        behind: Largest difference of a joint from where the source wants it now [rad]; of poses and
            twists from where their joint velocities lead.
        off_path: How far the joints are off the way that was wanted lately, as the largest
            difference of a joint from the nearest point of it [rad].
        delay: By how much later than wanted the arm is at that point [s].
        limited_by: What keeps it from the velocity that is wanted: ``NAME velocity``,
            ``acceleration``, ``jerk`` or ``position`` of a joint, ``ONE and OTHER`` for two bodies
            of which one is in the way of the other, or ``reach`` where no motion of the joints
            brings the tool nearer to its pose or along its twist; ``change of limits`` while the
            arm stops for one; empty for nothing.
        blocked_for: Time for which it has not got on although it is behind, or although its source
            asks for a velocity or a twist [s].
        silent_for: Time since the last target that is followed [s]; infinite before one.
        arrived: Number of the last chunk at whose last target the arm has come to rest, as
            `StreamShield.follow` has returned it; 0 before one.
        limits_pending: Whether limits that were changed wait until they accept the motion of the
            arm, which stops meanwhile.
        tracking: What `ShieldSettings.poses` says: ``tracked``, ``lost``, or why the newest pose
            was dropped, by the names in `Counts`; empty without it, and before poses.
    """

    behind: float
    off_path: float
    delay: float
    limited_by: tuple[str, ...]
    blocked_for: float
    silent_for: float
    arrived: int = 0
    limits_pending: bool = False
    tracking: str = ""


@validated
class ShieldSettings:
    """How a shield follows its source."""

    lookahead: Annotated[
        Wait | None,
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
    overlap: Annotated[Wait, Meaning("Length of a blend.", unit="s")] = 0.1
    timeout: Annotated[
        Wait,
        Meaning(
            "Time after the last velocity or twist after which the joints come to rest.",
            unit="s",
        ),
    ] = 0.2
    stale: Annotated[
        Wait,
        Meaning(
            "Time since its last target after which a chunk that comes is not followed.",
            unit="s",
        ),
    ] = 1.0
    on_path: Annotated[
        StrictBool,
        Meaning("Whether the way goes on more slowly where the arm is behind."),
    ] = False
    poses: Annotated[
        PoseFilter | None,
        Meaning(
            "Which poses are followed that something measures; by default all, and those are "
            "refused that can hardly be meant."
        ),
    ] = None
    blocked_after: Annotated[
        Wait,
        Meaning(
            "Time for which the arm does not get on after which `on_blocked` is called.", unit="s"
        ),
    ] = 0.3
    tolerance: Annotated[
        NonNegative | None,
        Meaning(
            "Time by which a command may come late while the arm keeps its velocity, at most a "
            "period; by default half of it, and all of it in a process of its own.",
            unit="s",
        ),
    ] = None
    late: Annotated[
        Late | None,
        Meaning(
            "What the robot does that gets no command in time: hold the last one, or stop as was "
            "certified with it; by default stop where others read the commands of a process.",
        ),
    ] = None
    compiled: Annotated[
        StrictBool | None,
        Meaning(
            "Whether the steps of its laws are compiled: by default to C, as soon as that is built "
            "beside it; true waits for the compiler, false has NumPy make them."
        ),
    ] = None
    record: Annotated[
        StrictBool | Annotated[StrictInt, Field(gt=0)],
        Meaning("Whether commands are recorded: all of them, or the last so many."),
    ] = False


def _arm(key: str, arm: object) -> None:
    """Raise an InvalidInputError unless this is an arm."""
    if isinstance(arm, str):
        raise InvalidInputError(f"{key}: must be an Arm, such as load_arm({arm!r}), not its name")
    require_type(key, arm, Arm)


def check_function(key: str, function: object) -> None:
    """Raise an InvalidInputError unless this is a function, or None."""
    if function is not None and not callable(function):
        raise InvalidInputError(
            f"{key}: must be a function that takes a ShieldStatus, not {short(function)}"
        )


@with_own_errors
class StreamShield(GuardedCommands):
    """Follows joint positions, velocities, poses or twists with certified commands.

    `drake_rnn.Shield` is one that may run in a process of its own. See there.

    Args:
        arm: The arm.
        period: Time between two calls of `command` [s].
        settings: How it follows its source.
        start: Posture that the robot rests in, shape (n,) [rad]; by default the arm's home. It may
            be up to 0.2 rad outside the position limits: the arm is then brought back first.
        limits: Limits of the joints; by default the arm's. Give those of acceleration and jerk
            where the arm has none.
        obstacles: Obstacles as in a document, each a mapping with ``kind`` and what belongs to it;
            with ``name`` and ``speed`` one that may move, see `command`.
        collisions: Whether the arm is kept clear of itself and of ``obstacles``.
        on_blocked: Called by `command` with the status, once the arm has not got on for the time
            ``settings.blocked_after``, once for each such time. Commands wait for it, so it must
            return at once; what it raises becomes a warning.
        steps: How the steps of its laws are made; by default as the settings say.

    Attributes:
        p_WO: How far obstacles that may move have gone, as given last, shape (m, 3) [m]; its rows
            are those of `moving_obstacles`.

    Raises:
        InvalidInputError: If an argument is not as described, or the start is not free.
    """

    @checked(
        arm=_arm,
        period=check_period,
        settings=instance(ShieldSettings, None),
        start=optional(vector),
        limits=instance(JointLimits, None),
        obstacles=each(dict),
        collisions=flag,
        on_blocked=check_function,
    )
    def __init__(  # noqa: PLR0913  entry point: one argument per part of what it is told
        self,
        arm: Arm,
        period: float,
        settings: ShieldSettings | None = None,
        *,
        start: Array | None = None,
        limits: JointLimits | None = None,
        obstacles: Sequence[Any] = (),
        collisions: bool = True,
        on_blocked: Callable[[ShieldStatus], object] | None = None,
        steps: Steps | None = None,
    ) -> None:
        self.settings = settings = ShieldSettings() if settings is None else settings
        home = start_posture(arm, start, OUTSIDE)
        self.arm, self.period = arm, period
        limits = arm.limits if limits is None else limits
        if limits.size != arm.n:
            raise InvalidInputError(
                f"limits: are of {limits.size} joints, but {arm.name} has {arm.n}"
            )
        self.lookahead = lookahead_of(settings.lookahead, limits, period)
        self.clearance: Clearance | None = None
        self.warnings: tuple[str, ...] = ()
        self.obstacles = list(obstacles)
        solids = make_obstacles(self.obstacles)
        if collisions or solids:
            self.clearance, self.warnings = clearance_of(arm, solids, home)
        self.warnings += doubts_of(limits, arm)
        warn_unprotected(self.warnings)
        law = law_of(arm, limits, home, self.lookahead, self.clearance)
        self._steps = made_by = Steps(settings.compiled) if steps is None else steps
        self._times = CallTimes("shield", period, lambda: made_by.text)
        how: dict[str, Any] = {"late": settings.late or "hold", "bind": self._steps.bind}
        self._guard = StreamGuard(law, period, tolerance=settings.tolerance, **how)
        self._on_blocked = on_blocked
        self._begin()

    def _begin(self) -> None:
        """Follow what is sent from now on, as of an arm at rest, by the guard and with the arm."""
        arm, settings = self.arm, self.settings
        # The largest speeds that limits have allowed so far.
        self._fastest = self.limits.sides("velocity").largest
        self._way, self._clock = self._no_way(), SourceClock()
        # Whether calls of `command` tell the time, None before the first; and those that follow.
        self._is_timed: bool | None = None
        self._gave_time = False
        self._kind: Kind = "positions"
        self._kinematics = arm.kinematics()
        # Time now, and that of the last target that is followed.
        self._t, self._last = 0.0, -np.inf
        self.p_WO = np.full((self._guard.moving, 3), np.nan)
        self._past = WayBehind(arm.n)
        self._stands_at, self._error = self._guard.position, 0.0
        self._blockage = Blockage(settings.blocked_after, self._on_blocked)
        # What velocities or twists ask for now, of the joints or of the tool; empty for nothing.
        self._asked = np.zeros(0)
        # Numbers of the chunk that is followed, and of the one that the arm has arrived at.
        self._followed = self._arrived = 0
        # Time of commands since this was noted.
        self._unnoted = 0.0
        self._wanted = np.zeros(arm.n)
        # Positions of the poses that came last.
        self._poses = np.zeros((0, 3))
        self._tracking: Tracking | None = None
        if settings.poses is not None:
            kept = None if settings.record is True else max(int(settings.record), 1)
            self._tracking = Tracking(settings.poses, self._way.counts, kept)
        self._remember(settings.record)
        if self._steps.are_compiled:
            # Now, and not at the first pose: a compiler takes seconds.
            _ = self._pursuit, self._tool

    def _remember(self, kept: bool | int) -> None:
        """Record all commands, the last so many, or none."""
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
        sent: object = None,
    ) -> int:
        """Follow targets of a kind, and return the number of their chunk; 0 if it is not followed.

        `ShieldStatus.arrived` tells when the arm has come to rest at its last target.

        Args:
            kind: What they are; the methods below have it in their names.
            targets: One target, or a chunk of them, one a row. Rows with NaN are left out.
            rate: Targets a second; needed for a chunk, if ``times`` are not given.
            start: Time of the first [s]; by default now.
            t: Time now, on the clock of `command` [s]; by default that of its last call.
            times: Times of all targets, shape (k,) [s], in place of ``rate`` and ``start``.
            sent: What the source's clock shows now [s], if that is another than the one of
                `command`; ``start`` and ``times`` are then on the source's, and ``start`` is by
                default ``sent``.

        Raises:
            InvalidInputError: If they cannot be meant as they stand; the message names the likely
                mistake.
        """
        return self._accept(kind, *self._read(kind, targets, (t, rate, start, times, sent)))

    def _read(
        self, kind: Kind, targets: object, when: tuple[float | None, object, object, object, object]
    ) -> tuple[Chunk, float]:
        """Return a chunk, checked, and the time now [s].

        Args:
            kind: See `follow`.
            targets: See `follow`.
            when: ``t``, ``rate``, ``start``, ``times`` and ``sent`` of `follow`.
        """
        width, (t, *rest) = self._width(kind), when
        timing = Timing(self._now(t), *rest)
        chunk = read_chunk(NAMES[kind], targets, width, timing, self._clock)
        self._check_targets(kind, chunk.values)
        return chunk, timing.now

    def follow_positions(
        self,
        q: object,
        rate: object = None,
        start: object = None,
        t: float | None = None,
        **more: object,
    ) -> int:
        """Follow joint positions, shape (n,) or (k, n) [rad]; see `follow`."""
        return self.follow("positions", q, rate, start, t, **more)

    def follow_velocities(
        self,
        v: object,
        rate: object = None,
        start: object = None,
        t: float | None = None,
        **more: object,
    ) -> int:
        """Follow joint velocities, shape (n,) or (k, n) [rad/s]; see `follow`."""
        return self.follow("velocities", v, rate, start, t, **more)

    def follow_twists(
        self,
        V_WE: object,
        rate: object = None,
        start: object = None,
        t: float | None = None,
        **more: object,
    ) -> int:
        """Follow twists of the tool in W, shape (6,) or (k, 6); see `follow`.

        The first three numbers are the angular velocity [rad/s], the others the velocity of E's
        origin [m/s].
        """
        return self.follow("twists", V_WE, rate, start, t, **more)

    def follow_poses(
        self,
        X_WE: object,
        rate: object = None,
        start: object = None,
        t: float | None = None,
        **more: object,
    ) -> int:
        """Follow poses of the tool in W, shape (7,) or (k, 7); see `follow`.

        The first three numbers are the position of E's origin [m], the others a quaternion of
        length 1, w first.
        """
        return self.follow("poses", X_WE, rate, start, t, **more)

    def rest(self) -> None:
        """Have the arm come to rest within its bounds, from the next command until a target."""
        self._way = self._no_way(self._way.counts)
        self._past.clear()
        self._guard.rest()

    # What the arm's loop calls.

    def command(self, t: float | None = None, p_WO: Displacements | None = None) -> Array:
        """Return the positions to command for the next period, shape (n,) [rad].

        Args:
            t: Time of this call [s]; must be given in all calls or in none.
            p_WO: How far obstacles that may move have gone from where they are stated: a row [m]
                for each of `moving_obstacles`, or rows by name, ``{"cup": p}``; see
                `StreamGuard.command`.

        Raises:
            InvalidInputError: See `drake_rnn.Guard.command`.
        """
        return self._command(t, p_WO)

    def _command(self, t: float | None, p_WO: Displacements | None) -> Array:
        """Return what `command` does, of which all is in the quickest way."""
        begin = perf_counter()
        if not self._is_timed or type(t) is not float or not isfinite(t):
            self._check_time(t)
        now = self._t + self.period if t is None else t
        target = self._target(now, self._guard.position)
        q = self._guard.command(target, p_WO, t)
        self._commanded(now, q, p_WO)
        self._note_call(begin, t)
        return q

    def _note_call(self, begin: float, t: float | None) -> None:
        """Note how long a call took that began at a time [s], and was told another one."""
        self._times.note(begin, t)

    def _commanded(self, now: float, q: Array, p_WO: Displacements | None) -> None:
        """Note a command, shape (n,) [rad], of a time [s], with places of obstacles."""
        self._t = now
        if p_WO is not None:
            self.p_WO = self._whole.p_WO
        self._note(now)
        if self._samples is not None:
            wanted = self._wanted_position(now, q), self._wanted.copy()
            step = self.last_step
            self._samples.append(Sample(now, *wanted, self.position, *self._lag(), step))

    def resume(
        self, q: Array, v: Array | None = None, a: Array | None = None, t: float | None = None
    ) -> None:
        """Go on from where the arm was brought without the shield, such as after a stop or by hand.

        What was followed is forgotten: the arm rests, as soon as its bounds allow, until a target
        comes. See `drake_rnn.Guard.resume`; no stop of a motion of others was certified, which
        `uncertified` counts. From rest that cannot happen.

        Args:
            q: Positions now, shape (n,) [rad]; at most 0.2 rad outside the limits.
            v: Velocities that have led there, shape (n,) [rad/s]; by default at rest.
            a: Accelerations that have led to these, shape (n,) [rad/s^2]; by default none.
            t: Time now [s], as for `command`.

        Raises:
            InvalidInputError: If an argument is not as described; the shield is then as before.
        """
        if t is not None:
            self._now(t)
        self._guard.resume(*checked_motion(self._guard.next_limits, q, v, a), t)
        self._resumed(t)

    def change_limits(self, limits: JointLimits) -> None:
        """Keep other limits from now on, or as soon as they accept the motion of the arm.

        Wider limits are in force from the next command on. Where a motion has no stop within
        narrower ones, the arm goes on along the stop that was certified within the old ones until
        it has, and then goes on to its targets; `status` tells in ``limits_pending``. `limits` are
        those in force, which no command is beyond.

        Args:
            limits: The limits.

        Raises:
            InvalidInputError: If they are of another number of joints, or the arm would come to
                rest outside of the new position limits; the shield is then as before.
        """
        guard, steps = self._guard, self._steps.anew()
        require_limits_of(self.arm, limits, guard.law.home)
        lookahead = lookahead_of(self.settings.lookahead, limits, self.period)
        guard.change_law(law_within(guard.law, limits, lookahead), steps.bind)
        self._lead_within(limits, lookahead, steps)

    def _lead_within(self, limits: JointLimits, lookahead: float, steps: Steps) -> None:
        """Want what other limits allow; the guard keeps those that are in force."""
        self.lookahead, self._steps = lookahead, steps
        self._fastest = np.maximum(self._fastest, limits.sides("velocity").largest)
        for name in ("_pursuit", "_tool", "_joint_progress"):
            vars(self).pop(name, None)
        if steps.are_compiled:
            _ = self._pursuit, self._tool

    def _resumed(self, t: float | None) -> None:
        """Forget what was followed, as the arm goes on from elsewhere, at a time [s]."""
        self.rest()
        if self._tracking is not None:
            self._tracking.clear()
        if "_tool" in vars(self):
            self._tool.clear()
        self._stands_at = self._guard.position
        if t is not None:
            self._t, self._is_timed = float(t), True

    @property
    def streams(self) -> tuple[StreamShield, ...]:
        """What each of its arms follows, which is this."""
        return (self,)

    @property
    def time(self) -> float:
        """Time of the last command [s]."""
        return self._t

    @property
    def leading(self) -> Array | None:
        """Positions that the arm was led to by the last command, shape (n,) [rad]; None so far."""
        target = self._guard.last_step.u["target"]
        return target if np.isfinite(target).all() else None

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
        times = self._blockage.time, silent
        is_pending = self._whole.limits_pending
        return ShieldStatus(
            *(self._behind(), off_path, delay, at_work, *times, self._arrived, is_pending),
            tracking="" if self._tracking is None else self._tracking.state,
        )

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
        record = record_of(
            list(self._samples), self.period, self.arm.joints, self.clearance, tuple(self._ways)
        )
        dropped = () if self._tracking is None else tuple(self._tracking.dropped)
        return replace(record, dropped=dropped)

    @property
    def last_step(self) -> LastStep:
        """The last step, of which `LastStep.causes` says what kept it from what was wanted."""
        # A law of the tool chooses its velocities within the limits.
        is_chosen = self._kind in ("poses", "twists")
        return self._guard.last_step._replace(chosen=is_chosen)

    @property
    def last_record(self) -> ShieldRecord:
        """The last command as a record of its own, with what is left of the way from it on."""
        q, t = self.position, self._t
        wanted = self._wanted_position(t, q), self._wanted.copy()
        sample = Sample(t, *wanted, q, *self._lag(), self.last_step)
        ways = ((t, self._kind, self._way.ahead(t)),) if self._is_led else ()
        return record_of([sample], self.period, self.arm.joints, self.clearance, ways)

    # How it is done.

    def _no_way(self, counts: Counts | None = None) -> ChunkPath:
        settings = self.settings
        counts = Counts() if counts is None else counts
        return ChunkPath(settings.switch, settings.overlap, settings.stale, counts)

    def _width(self, kind: object) -> int:
        """Return how many numbers a target of a kind has."""
        if kind not in NAMES:
            raise InvalidInputError(f"kind: may be {', '.join(NAMES)}, not {short(kind)}")
        width = WIDTHS[kind]
        return self.arm.n if width is None else width

    def _now(self, t: float | None) -> float:
        """Return the time now of a call of a source [s], checked."""
        if t is None:
            return self._t
        if not is_number(t):
            raise InvalidInputError(f"t: must be a time [s], not {short(t)}")
        if self._is_timed is False:
            raise InvalidInputError(
                "t: must be left out where command is called without it: both are on one clock"
            )
        if self._is_timed and abs(t - self._t) > _PAUSE:
            raise InvalidInputError(
                f"t: {t:.9g} s is {abs(t - self._t):.3g} s from the last call of command, at "
                f"{self._t:.9g} s; must be in seconds, on the clock of command. A source with a "
                "clock of its own gives sent, what that shows"
            )
        self._gave_time = True
        return float(t)

    def _check_time(self, t: float | None) -> None:
        """Raise an InvalidInputError if a call of `command` has another clock than the source."""
        if t is not None and not is_number(t):
            raise InvalidInputError(f"t: must be a finite time [s], not {short(t)}")
        if t is None:
            if self._gave_time and self._is_timed is None:
                raise InvalidInputError(
                    "t: must be given to command as it is to what is followed: both are on one "
                    "clock"
                )
            self._is_timed = self._is_timed or False
        elif not self._is_timed:
            if self._is_timed is None and not self._gave_time:
                # What came before the first call was wanted from then on.
                self._way.put_off(t - self._t)
                self._last += t - self._t
            self._is_timed = True

    def _check_targets(self, kind: Kind, values: Array) -> None:
        """Raise an InvalidInputError if targets, shape (k, width), can hardly be meant."""
        rows = values[np.isfinite(values).all(axis=1)]
        if not len(rows):
            return
        largest = np.abs(rows).max(axis=0)
        if kind == "positions":
            self._check_positions(rows)
        elif kind == "velocities" and (largest > 10.0 * self._fastest).any():
            raise InvalidInputError(
                f"v: {largest.max():.6g} rad/s is more than ten times a limit of the velocity; "
                "must be in rad/s, not degrees a second"
            )
        elif kind == "twists":
            # No posture turns the tool faster than all joints together.
            spin = min(max(float(self._fastest.sum()), _TURN_RATE), _SPIN)
            if largest[:3].max() > spin or largest[3:].max() > _SPEED:
                raise InvalidInputError(
                    f"V_WE: {largest[:3].max():.3g} rad/s and {largest[3:].max():.3g} m/s are "
                    f"beyond {spin:.3g} and {_SPEED:g}, which no motion of the joints reaches; "
                    "must be an angular velocity [rad/s], not in degrees, and then a velocity "
                    "[m/s], not in millimetres"
                )
        elif kind == "poses" and self.settings.poses is None:
            self._check_poses(rows)

    def _check_positions(self, rows: Array) -> None:
        worst = float(np.abs(rows).max())
        hint = degree_hint([worst], "rad")
        beyond = np.where(self._guard.law.turning, 0.0, self.limits.violation(rows))
        if (
            not hint
            and (beyond > np.pi).any()
            and not self.limits.violation(np.deg2rad(rows)).any()
        ):
            k = np.unravel_index(int(beyond.argmax()), beyond.shape)
            worst, hint = float(rows[k]), "; angles are in radians, and these look like degrees"
        if hint:
            raise InvalidInputError(f"q: {worst:.6g} rad is no position of a joint{hint}")

    def _check_poses(self, rows: Array) -> None:
        # Of garbage too, whose squares are no numbers.
        rows = rows.clip(-_HUGE, _HUGE)
        lengths = np.linalg.norm(rows[:, 3:], axis=1)
        if (np.abs(lengths - 1.0) > _UNIT).any():
            worst = float(lengths[np.abs(lengths - 1.0).argmax()])
            comes_first = np.abs(np.linalg.norm(rows[:, :4], axis=1) - 1.0) < _UNIT
            hint = "; it comes first, and must come after the position" if comes_first.all() else ""
            raise InvalidInputError(
                f"X_WE: has a quaternion of length {worst:.6g}; must be of length 1, w first{hint}"
            )
        q = self.position
        p_WE, R_WE = self._kinematics.p_WE(q), self._kinematics.R_WE(q)
        # An arm that lags behind poses may be far from the next ones.
        known = np.vstack((p_WE, self._poses))
        away = float(np.linalg.norm(rows[0, :3] - known, axis=1).min())
        if away > _JUMP:
            in_mm = float(np.linalg.norm(1e-3 * rows[0, :3] - p_WE)) < _JUMP < np.abs(rows[0]).max()
            hint = "; they look like millimetres" if in_mm and away > 10.0 else ""
            if np.linalg.norm(rows[0, :3]) < _STEPS:
                hint = ". It looks like a step from the tool, and must be where that leads"
            raise InvalidInputError(
                f"X_WE: begins {away:.3g} m from the tool, more than {_JUMP:g} m; positions are in "
                f"metres, in W, the frame of the arm's base{hint}"
            )
        turn, turn_w_last = (
            angle_between(R_WE, pose_of(np.concatenate((rows[0, :3], wxyz)))[0])
            for wxyz in (rows[0, 3:], np.roll(rows[0, 3:], 1))
        )
        if turn > _TURN and turn_w_last < _NEAR:
            raise InvalidInputError(
                f"X_WE: begins {turn:.3g} rad from the tool's orientation; the quaternion looks as "
                "if w came last, and must have it first"
            )

    def _accept(self, kind: Kind, chunk: Chunk, now: float) -> int:
        """Take checked targets, and return their number; 0 if they are not followed."""
        if self._tracking is not None and kind == "poses":
            return self._accept_measured(self._tracking, chunk, now)
        if self._tracking is not None:
            self._tracking.clear()
        if kind == "positions":
            chunk = self._unwound(chunk)
        if kind == "poses":
            self._poses, chunk = chunk.values[:, :3], self._near(chunk)
        return self._take(kind, chunk, now)

    def _accept_measured(self, tracking: Tracking, chunk: Chunk, now: float) -> int:
        """Take what is believed of poses that something measures; see `_accept`."""
        if tracking.is_lost(now):
            self.rest()
        refusal, rows = "", unit_poses(chunk.values)
        if not tracking.has_begun and len(rows):
            try:
                self._check_poses(rows)
            except InvalidInputError as error:
                refusal = str(error).removeprefix("X_WE: ")
        chunk = tracking.believed(chunk, now, self._kinematics.p_WE(self.position), refusal)
        if not len(chunk.times):
            self.counts.chunks += 1
            tracking.take(None, now)
            return 0
        poses, chunk = chunk.values[:, :3], self._near(chunk)
        if number := self._take("poses", chunk, now):
            self._poses = poses
            tracking.take(chunk, now)
        return number

    def _take(self, kind: Kind, chunk: Chunk, now: float) -> int:
        """Follow a chunk, whose kind may be another than that of the last one."""
        if kind != self._kind:
            self._way = self._no_way(self._way.counts)
            self._past.clear()
            vars(self).pop("_joint_progress", None)
        self._kind = kind
        if not self._way.put(chunk, now):
            return 0
        self._last, self._followed = now, self.counts.chunks
        if self._samples is not None:
            self._ways.append((now, kind, self._way.ahead(now)))
        return self._followed

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
        """Return the joint positions that lead the arm, shape (n,) [rad]; None before a target.

        The next call may overwrite them.
        """
        if self._tracking is not None and self._kind == "poses" and self._tracking.is_lost(now):
            self.rest()
        way, kind = self._way, self._kind
        if way.path is None:
            self._wanted = np.zeros(q.size)
            return None
        rate = 1.0
        if self.settings.on_path and kind in ("positions", "poses"):
            rate = self._slow_down(now, q)
        if kind == "positions":
            pursuit = self._pursuit
            pursuit.step(way, now, q, rate)
            self._wanted = pursuit.wanted
            return pursuit.target
        self._wanted = self._wanted_velocity(now, q, rate)
        return q + self.lookahead * self._wanted

    def _wanted_velocity(self, now: float, q: Array, rate: float) -> Array:
        """Return the joint velocities that velocities, poses or twists ask for, (n,) [rad/s].

        Poses go on along their way at a rate of 0 to 1.
        """
        self._asked = np.zeros(0)
        if self._kind != "poses":
            if now > self._way.end + self.settings.timeout:
                return np.zeros(q.size)
            self._asked = self._way.mean(now, now + self.period)
            if self._kind == "velocities":
                return self._joint_progress.shares(self._asked, self.velocity) * self._asked
            return self._tool.follow_twist(now, self._guard, self._asked)
        here, ahead = (self._pose_at(t) for t in (now, now + rate * self.period))
        return self._tool.follow_pose(now, self._guard, here, ahead)

    @cached_property
    def _pursuit(self) -> WayPursuit:
        limits = self._guard.next_limits
        has_none = limits.acceleration is None
        most = np.full(self.arm.n, np.inf) if has_none else limits.sides("acceleration").least
        return WayPursuit(Pursuit(self.lookahead, self.period, most), self._steps.bind)

    @cached_property
    def _joint_progress(self) -> JointProgress:
        return JointProgress(self._guard.next_limits, self.period, PATIENCE["velocities"])

    @cached_property
    def _tool(self) -> ToolTracking:
        limits = self._guard.next_limits
        return ToolTracking(self.arm, limits, self._guard.law.home, self.period, self._steps)

    def _slow_down(self, now: float, q: Array) -> float:
        """Have the way go on later where the arm is behind, and not at all if it is far behind.

        Returns:
            The rate at which it goes on, 0 to 1.
        """
        behind = float(np.abs(self._wanted_position(now, q) - q).max())
        rate = min(max((_HALT - behind) / (_HALT - _BEHIND), 0.0), 1.0)
        self._way.put_off((1.0 - rate) * self.period)
        return rate

    def _note(self, now: float) -> None:
        """Note what `status` tells of."""
        if now - self._past.newest >= WayBehind.step:
            target = self._way.at(now) if self._kind == "positions" else None
            if target is not None:
                self._past.add(now, target)
        # What takes time is worked out every few commands.
        self._unnoted += self.period
        if self._unnoted < WayBehind.step:
            return
        q = self.position
        self._error = self._behind()
        passed, self._unnoted = self._unnoted, 0.0
        if self._is_settled(now, q):
            self._arrived = self._followed
        blocked = self._blocked_for(q, self._blockage.time + passed)
        self._blockage.note(blocked, self._look, lambda: self.status)

    def _look(self) -> Look:
        """Return what is looked at to find what is in the way."""
        wanted = self._wanted
        if self._kind in ("poses", "twists"):
            wanted = self._tool.whole_velocity
        elif self._asked.size:
            wanted = self._asked
        return Look(self.last_step, wanted)

    def _blocked_for(self, q: Array, longer: float) -> float:
        """Return for how long the arm has not got on [s], which is `longer` if it still does not.

        The tool is blocked if it makes no progress, joints if those do not that velocities are
        asked of, other arms if they stand.
        """
        if self._kind in ("poses", "twists"):
            is_there = self._kind == "poses" and self._is_at_pose(q)
            return 0.0 if is_there or not self._is_led else self._tool.blocked
        if self._kind == "velocities":
            return self._joint_progress.blocked if self._asked.size else 0.0
        if self._error < _WANTS or np.abs(q - self._stands_at).max() > _STANDS:
            self._stands_at = q
            return 0.0
        return longer

    def _is_at_pose(self, q: Array) -> bool:
        """Return whether the tool is near the pose that is wanted now."""
        if not self._is_led:
            return True
        turn, way = self._off_pose(q)
        return way < OFF and turn < TURNED and self._error < _WANTS

    def _off_pose(self, q: Array) -> tuple[float, float]:
        """Return how far the tool is off the pose that is wanted now [rad, m]."""
        R_WE, p_WE = self._pose_at(self._t)
        kinematics = self._kinematics
        away = float(np.linalg.norm(p_WE - kinematics.p_WE(q)))
        return angle_between(kinematics.R_WE(q), R_WE), away

    def _is_settled(self, now: float, q: Array) -> bool:
        """Return whether the arm has come to rest at the last target of what it follows."""
        if not self._is_led or self._arrived == self._followed:
            return False
        holds = self._kind in ("positions", "poses")
        if now < self._way.end + (0.0 if holds else self.settings.timeout):
            return False
        if np.abs(self.velocity).max() > _SETTLED:
            return False
        if self._kind == "positions":
            return self._error < _AT_JOINTS
        if self._kind == "poses":
            turn, way = self._off_pose(q)
            return way < AT and turn < _AT_TURN
        return True

    def _behind(self) -> float:
        """Return the largest difference of a joint from where it is wanted now [rad]."""
        if self._way.end == -np.inf:
            return 0.0
        q = self.position
        return float(np.abs(self._wanted_position(self._t, q) - q).max())

    def _lag(self) -> tuple[float, float]:
        """Return how far the joints are off the way of late [rad], and how much later [s]."""
        return self._past.nearest(self.position, self._t)

    def _wanted_position(self, t: float, q: Array) -> Array:
        """Return where joints are wanted, shape (n,) [rad]; see `ShieldRecord.wanted`.

        Args:
            t: Time [s].
            q: Where they are, shape (n,) [rad].
        """
        target = self._way.at(t)
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
    def _is_led(self) -> bool:
        """Whether there is a way to follow."""
        return self._way.end > -np.inf

    def _limits_at_work(self) -> tuple[str, ...]:
        """Return what keeps the arm from the velocity that is wanted; see `ShieldStatus`."""
        if not self._is_led:
            return ()
        if self._whole.limits_pending:
            return ("change of limits",)
        names = () if self.clearance is None else self.clearance.names
        causes = self.last_step.causes
        if not causes.pairs.size:
            # A tool that makes no progress wants less and less, so that nothing is in its way.
            causes = causes._replace(pairs=np.array(self._pairs_of_blockage(), dtype=np.intp))
        at_work = tuple(map(str, interventions_of(causes, self.arm.joints, names)))
        return at_work if at_work else self._reach_limits()

    def _pairs_of_blockage(self) -> tuple[int, ...]:
        """Return the numbers of the pairs in the way of an arm that does not get on."""
        return self._blockage.pairs

    def _reach_limits(self) -> tuple[str, ...]:
        """Return which joints at their ends keep the tool from what is wanted of it, or `reach`."""
        if self._kind not in ("poses", "twists"):
            return ()
        ends = self._tool.out_of_reach
        if ends:
            return tuple(f"{self.arm.joints[k]} position" for k in ends)
        return ("reach",) if ends is not None or self._blockage.time else ()


def lookahead_of(lookahead: float | None, limits: JointLimits, period: float) -> float:
    """Return the lookahead, by default what the jerk needs [s].

    With less than that, the arm would swing about its way.

    Args:
        lookahead: What is given [s]; None for nothing.
        limits: Limits of the joints.
        period: Time between two commands [s].
    """
    least = max(_LEAST_LOOKAHEAD, 2.0 * period)
    if limits.jerk is not None and limits.acceleration is not None:
        most = limits.sides("acceleration").largest
        least = max(least, _LAGS * float((most / limits.jerk).max()))
    if lookahead is not None and lookahead < least:
        text = f"lookahead: {lookahead:g} s is short; the arm may swing below {least:.3g} s"
        warn(text, stacklevel=3)
    return least if lookahead is None else lookahead


def checked_motion(
    limits: JointLimits, q: object, v: object, a: object
) -> tuple[Array, Array, Array]:
    """Return a motion from which joints go on: positions, velocities and accelerations.

    Args:
        limits: Limits of the joints.
        q: Positions, shape (n,) [rad].
        v: Velocities, shape (n,) [rad/s]; None for rest.
        a: Accelerations, shape (n,) [rad/s^2]; None for none.

    Raises:
        InvalidInputError: If one is no vector of that shape, or too far outside the limits.
    """
    still = np.zeros(limits.size)
    motion = {"q": q, "v": still if v is None else v, "a": still if a is None else a}
    for name, value in motion.items():
        vector(name, value)
    posture, *rates = (np.asarray(value, dtype=float) for value in motion.values())
    beyond = limits.violation(posture).max() if posture.size == limits.size else 0.0
    if beyond > OUTSIDE:
        raise InvalidInputError(
            f"q: is {beyond:.3g} rad outside the position limits; may be {OUTSIDE:g} at most"
        )
    return posture, rates[0], rates[1]


def law_of(
    arm: Arm, limits: JointLimits, home: Array, lookahead: float, clearance: Clearance | None
) -> JointStream:
    """Return the law that commands an arm.

    Args:
        arm: The arm.
        limits: Limits of its joints.
        home: Posture at the start, shape (n,) [rad].
        lookahead: How far ahead on its way it is led [s].
        clearance: What it is to stay clear of; None for nothing.
    """
    return JointStream(
        limits=limits,
        home=home,
        interval=lookahead,
        pursues=True,
        timeout=2.0 * lookahead,
        clearance=clearance,
        endless=[bool(turns) for turns in arm.endless],
    )


def doubts_of(limits: JointLimits, arm: Arm) -> tuple[str, ...]:
    """Return what limits of an arm lack; nothing where they have accelerations."""
    if limits.acceleration is not None:
        return ()
    return (
        f"limits: no acceleration is known of {arm.name}, so commanded velocities jump; give "
        "limits=arm.limits.replace(acceleration=..., jerk=...)",
    )


def require_limits_of(arm: Arm, limits: object, home: Array) -> None:
    """Raise an InvalidInputError unless these are limits of an arm, within which home is a rest."""
    require_type("limits", limits, JointLimits)
    assert isinstance(limits, JointLimits)
    if limits.size != arm.n:
        raise InvalidInputError(f"limits: are of {limits.size} joints, but {arm.name} has {arm.n}")
    require_resting(limits, home, "limits", arm.joints, arm.units)


def law_within(law: JointStream, limits: JointLimits, lookahead: float) -> JointStream:
    """Return a law with other limits and lookahead [s], see `law_of`."""
    times = {"interval": lookahead, "timeout": 2.0 * lookahead}
    changed: JointStream = replace_unchecked(law, limits=limits, **times)
    return changed
