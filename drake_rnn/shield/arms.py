"""Two arms behind one shield: each follows a source of its own, and none comes near the other.

One law moves the joints of both, so that their distance is certified as that of an arm from itself.
What each of them follows, and what is told of it, is as of a shield of one arm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from ..compiled.builds import Steps
from ..drive.call_times import CallTimes
from ..drive.own_process import Send, check_process
from ..errors import InvalidInputError, warn_unprotected
from ..inputs.fields import (
    Array,
    checked,
    each,
    instance,
    is_name,
    is_vector,
    optional,
    vector,
    with_own_errors,
)
from ..inputs.messages import nearest, require_type, short
from ..laws.guard import LastStep, StreamGuard, check_period
from ..laws.guard_command import GuardCommand
from ..robot.arm import Arm
from ..robot.clearance import Clearance
from ..robot.clearance.arm_clearance import clearance_of
from ..robot.clearance.capsules import Displacements
from ..robot.clearance.obstacles import make_obstacles
from ..robot.limits import OUTSIDE, JointLimits
from ..systems import start_posture
from .chunks import WIDTHS, Kind
from .memory import ShieldMemory
from .process_reading import CommandsOfProcess, StreamOfProcess, settings_of
from .report import ShieldRecord
from .serving import ServedStream
from .shield import (
    ShieldSettings,
    ShieldStatus,
    check_function,
    checked_motion,
    doubts_of,
    law_of,
    law_within,
    lookahead_of,
    require_limits_of,
)

# How readily an arm leaves what it wants where bodies come near each other, if another one gives
# way first; its square is the price of what that one does against that of the same by this one.
_LEADS = 0.03
# An arm whose joints are no faster than this rests [rad/s].
_AT_REST = 1e-9


@with_own_errors
class DualArmShield(CommandsOfProcess):
    """Follows a source for each of two arms with certified commands, clear of each other.

    The arms are a pair: an `Arm` with ``pair``, of two models or of a bimanual one. Each of them is
    a shield of its own to its source, ``shield["left"]``, with the methods of `drake_rnn.Shield`:
    `follow_positions` and its like, `rest`, `position`, `velocity`, `counts`, `status`, `record`.
    Poses and twists are those of its tool, in the world frame, that of the first arm's base.
    An arm without targets rests, and the other one goes on.

    Where they come near each other, both give way alike. With ``yields`` one of them gives way
    first, also from where it holds or rests; the other one does only where that is not enough. An
    arm that rests without targets is else not moved.

    Args:
        arm: Both arms; each joint must move one of its two tools.
        period: Time between two calls of `command` [s].
        settings: How each follows its source.
        names: Names of the first arm and of the second one.
        yields: Name of the arm that gives way to the other; None for neither.
        start: Posture that the robot rests in, shape (n,) [rad], the first arm's joints before
            those of the second one; by default home. See `drake_rnn.Shield`.
        limits: Limits of the joints of both; by default the arm's.
        obstacles: Obstacles as in a document, each a mapping with ``kind`` and what belongs to it.
            Each arm is kept clear of them, of itself and of the other one.
        on_blocked: Called with the name of an arm that does not get on, and its status; see
            `drake_rnn.Shield`.
        process: Whether a process of its own commands both arms, see `drake_rnn.Shield`.

    Attributes:
        arms: Each arm by its name.

    Raises:
        InvalidInputError: If an argument is not as described, or the start is not free.
    """

    @checked(
        period=check_period,
        settings=instance(ShieldSettings, None),
        start=optional(vector),
        limits=instance(JointLimits, None),
        obstacles=each(dict),
        on_blocked=check_function,
    )
    def __init__(  # noqa: PLR0913  entry point: one argument per part of what it is told
        self,
        arm: Arm,
        period: float,
        settings: ShieldSettings | None = None,
        *,
        names: tuple[str, str] = ("left", "right"),
        yields: str | None = None,
        start: Array | None = None,
        limits: JointLimits | None = None,
        obstacles: Sequence[Any] = (),
        on_blocked: Callable[[str, ShieldStatus], object] | None = None,
        process: bool | Send = False,
    ) -> None:
        self._require_pair(arm)
        self.names, self.yields = checked_names(names), yields
        send, settings = check_process(process), settings_of(settings, period, process)
        home = start_posture(arm, start, OUTSIDE)
        self.arm, self.period, self.settings = arm, period, settings
        limits = arm.limits if limits is None else limits
        if limits.size != arm.n:
            raise InvalidInputError(
                f"limits: are of {limits.size} joints, but both arms have {arm.n}"
            )
        parts = arm.parts
        self.obstacles = list(obstacles)
        solids = make_obstacles(self.obstacles)
        self.clearance: Clearance
        self.clearance, self.warnings = clearance_of(arm, solids, home)
        self.warnings += doubts_of(limits, arm)
        warn_unprotected(self.warnings)
        blocks = slice(0, arm.begins[1]), slice(arm.begins[1], arm.n)
        self.lookahead = max(
            lookahead_of(settings.lookahead, limits.select(range(arm.n)[block]), period)
            for block in blocks
        )
        law = law_of(arm, limits, home, self.lookahead, self.clearance)
        self._steps = steps = Steps(settings.compiled)
        self._times = CallTimes("shield", period, lambda: steps.text)
        self._guard = StreamGuard(
            law,
            period,
            tolerance=settings.tolerance,
            late=settings.late or "hold",
            bind=steps.bind,
            has_compliance=True,
        )
        arms = zip(self.names, parts, blocks, strict=True)
        self.arms = {name: self._stream(self, name, *each, on_blocked) for name, *each in arms}
        if process:
            options: dict[str, Any] = {"settings": settings, "names": names, "yields": yields}
            options |= {"limits": limits, "obstacles": self.obstacles, "on_blocked": on_blocked}
            self._start(_ServedArms, options, send, tuple(part.n for part in parts))
            for side in self.arms.values():
                side._process = self._process

    def _stream(self, *arguments: Any) -> ArmStream:
        """Return one of the arms, of the arguments of an `ArmStream`."""
        return ArmStream(*arguments)

    @staticmethod
    def _require_pair(arm: object) -> None:
        """Raise an InvalidInputError unless this is an arm with two tools."""
        if isinstance(arm, (list, tuple, dict)):
            raise InvalidInputError(
                "arm: must be one Arm with pair, such as load_arm('panda', pair={'arm': 'panda', "
                "'base': {'translation': [1, 0, 0]}}), not several arms"
            )
        require_type("arm", arm, Arm)
        assert isinstance(arm, Arm)
        if arm.description.pair is None:
            raise InvalidInputError(
                f"arm: {arm.name} has one tool; give pair, the second arm or the frame of the "
                "second tool, or take a Shield"
            )

    @property
    def yields(self) -> str | None:
        """Name of the arm that gives way to the other; None for neither. It may be set."""
        return self._yields

    @yields.setter
    def yields(self, name: str | None) -> None:
        if name is not None and not (isinstance(name, str) and name in self.names):
            first, second = self.names
            raise InvalidInputError(
                f"yields: must be {first!r}, {second!r} or None, not {short(name)}"
            )
        self._yields = name
        if self._process is not None:
            self._process.memory.yields.write((None, *self.names).index(name))

    def __getitem__(self, name: str) -> ArmStream:
        if name not in self.names:
            raise InvalidInputError(
                f"arm: no arm {short(name)}; {nearest(str(name), [*self.names])}"
            )
        return self.arms[name]

    # What sources call.

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
    ) -> dict[str, int]:
        """Follow targets of one or both arms; see `drake_rnn.Shield.follow`.

        If those of one arm are refused, none are followed.

        Args:
            kind: What they are.
            targets: By the names of the arms; or of both side by side in each row, the first arm's
                before the second one's.
            rate: Targets a second; as the following, see `drake_rnn.Shield.follow`.
            start: Time of the first [s].
            t: Time now [s].
            times: Times of all targets, shape (k,) [s].
            sent: What the source's clock shows now [s].

        Returns:
            Numbers of the chunks, 0 of one that is not followed, by the names of the arms.

        Raises:
            InvalidInputError: If they cannot be meant as they stand, or there is no such arm.
        """
        if not isinstance(targets, Mapping):
            targets = self._split(kind, targets)
        elif not targets:
            raise InvalidInputError(f"targets: must be of {' or '.join(self.names)}, or of both")
        chunks = {}
        for name, values in targets.items():
            side = self[name]
            try:
                chunks[name] = side._read(kind, values, (t, rate, start, times, sent))
            except InvalidInputError as error:
                raise InvalidInputError(f"{name}: {error}") from None
        return {name: self.arms[name]._accept(kind, *chunk) for name, chunk in chunks.items()}

    def follow_positions(self, q: object, *when: Any, **more: Any) -> dict[str, int]:
        """Follow joint positions of one or both arms [rad]; see `follow`."""
        return self.follow("positions", q, *when, **more)

    def follow_velocities(self, v: object, *when: Any, **more: Any) -> dict[str, int]:
        """Follow joint velocities of one or both arms [rad/s]; see `follow`."""
        return self.follow("velocities", v, *when, **more)

    def follow_poses(self, X_WE: object, *when: Any, **more: Any) -> dict[str, int]:
        """Follow poses of one or both tools, see `follow` and `drake_rnn.Shield.follow_poses`."""
        return self.follow("poses", X_WE, *when, **more)

    def follow_twists(self, V_WE: object, *when: Any, **more: Any) -> dict[str, int]:
        """Follow twists of one or both tools, see `follow` and `drake_rnn.Shield.follow_twists`."""
        return self.follow("twists", V_WE, *when, **more)

    def rest(self) -> None:
        """Have both arms come to rest within their bounds, until a target comes."""
        for side in self.arms.values():
            side.rest()

    # What the loop of both arms calls.

    def command(self, t: float | None = None, p_WO: Displacements | None = None) -> Array:
        """Return the positions of both arms for the next period, shape (n,) [rad].

        The first arm's joints come before those of the second one.

        Args:
            t: Time of this call [s]; must be given in all calls or in none.
            p_WO: How far obstacles that may move have gone, see `drake_rnn.Guard.command`.

        Raises:
            InvalidInputError: See `drake_rnn.Guard.command`.
        """
        self._require_own_calls("command")
        begin = perf_counter()
        sides, guard = self.arms.values(), self._guard
        for side in sides:
            side._check_time(t)
        now = self.time + self.period if t is None else t
        targets = [side._target(now, side.position) for side in sides]
        for side, target in zip(sides, targets, strict=True):
            guard.compliance[side.block] = self._compliance(side, now, target is None)
        if all(target is None for target in targets):
            guard.rest()
            q = guard.command(None, p_WO, t)
        else:
            # An arm without a target wants to be where it is.
            q = guard.command(
                np.concatenate(
                    [
                        side.position if target is None else target
                        for side, target in zip(sides, targets, strict=True)
                    ]
                ),
                p_WO,
                t,
            )
        for side in sides:
            side._commanded(now, q[side.block], p_WO)
        self._note_call(begin, t)
        return q

    def _note_call(self, begin: float, t: float | None) -> None:
        """See `StreamShield._note_call`."""
        self._times.note(begin, t)

    def _compliance(self, side: ArmStream, now: float, has_none: bool) -> float:
        """Return how readily an arm gives way, see `JointStreamReading`."""
        if self.yields == side.name:
            return 1.0
        if (has_none or side.is_over(now)) and np.abs(side.velocity).max() <= _AT_REST:
            return 0.0
        return 1.0 if self.yields is None else _LEADS

    def resume(
        self, q: Array, v: Array | None = None, a: Array | None = None, t: float | None = None
    ) -> None:
        """Go on from where both arms were brought otherwise; see `drake_rnn.Shield.resume`.

        Args:
            q: Positions of both arms now, shape (n,) [rad].
            v: Velocities that have led there, shape (n,) [rad/s]; by default at rest.
            a: Accelerations that have led to these, shape (n,) [rad/s^2]; by default none.
            t: Time now [s], as for `command`.

        Raises:
            InvalidInputError: If an argument is not as described; the shield is then as before.
        """
        self._require_own_calls("resume")
        sides = self.arms.values()
        for side in sides:
            if t is not None:
                side._now(t)
        self._guard.resume(*checked_motion(self._guard.next_limits, q, v, a), t)
        for side in sides:
            side._resumed(t)

    def change_limits(self, limits: JointLimits) -> None:
        """Keep other limits of both arms; see `drake_rnn.Shield.change_limits`.

        Args:
            limits: Limits of the joints of both.

        Raises:
            InvalidInputError: See there; the shield is then as before.
        """
        guard, given = self._guard, self.settings.lookahead
        require_limits_of(self.arm, limits, guard.law.home)
        parts = [(s, limits.select(range(self.arm.n)[s.block])) for s in self.arms.values()]
        lookahead = max(lookahead_of(given, own, self.period) for _, own in parts)
        steps = self._steps.anew()
        guard.change_law(law_within(guard.law, limits, lookahead), steps.bind)
        self.lookahead, self._steps = lookahead, steps
        for side, own in parts:
            side._lead_within(own, lookahead, side._steps.anew())

    @property
    def streams(self) -> tuple[ArmStream, ...]:
        """What each arm follows, the first one's first."""
        return tuple(self.arms.values())

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints of both arms, in the order of `command`."""
        return self.arm.joints

    @property
    def time(self) -> float:
        """Time of the last command [s]."""
        return self.arms[self.names[0]].time

    @property
    def p_WO(self) -> Array:
        """How far obstacles that may move have gone, as given last, shape (m, 3) [m]."""
        return self.arms[self.names[0]].p_WO

    @property
    def record(self) -> ShieldRecord:
        """What both arms were to do and did; see `StreamShield.record`.

        Of the way of both only `ways` of each arm's own record tells.
        """
        return _join([side.record for side in self.arms.values()])

    @property
    def last_record(self) -> ShieldRecord:
        """See `StreamShield.last_record`."""
        return _join([side.last_record for side in self.arms.values()])

    @property
    def last_step(self) -> LastStep:
        """The last step of the law of both arms."""
        return self._guard.last_step

    @property
    def status(self) -> dict[str, ShieldStatus]:
        """Where each arm is against what its source wants, by its name."""
        return {name: side.status for name, side in self.arms.items()}

    def _split(self, kind: Kind, targets: object) -> dict[str, object]:
        """Return targets of both arms side by side as those of each, by name."""
        if kind not in WIDTHS:
            # It is refused where the targets are read.
            return dict.fromkeys(self.names, targets)
        widths = [WIDTHS[kind] or side.arm.n for side in self.arms.values()]
        try:
            values = np.asarray(targets, dtype=float)
        except (TypeError, ValueError):
            values = np.zeros(0)
        if values.ndim not in (1, 2) or values.shape[-1] != sum(widths):
            first, second = self.names
            raise InvalidInputError(
                f"targets: must be of shape ({sum(widths)},) or (k, {sum(widths)}), {widths[0]} "
                f"of {first} and then {widths[1]} of {second}, or a mapping of the names of arms "
                f"to their {kind}, not {_shape_of(targets, values)}"
            )
        parts = np.split(values, [widths[0]], axis=-1)
        return dict(zip(self.names, parts, strict=True))


def _join(records: Sequence[ShieldRecord]) -> ShieldRecord:
    """Return records of two arms at the same times as one, whose joints follow one another."""
    one, other = records

    def both(first: Array, second: Array) -> Array:
        return np.concatenate((first, second), axis=1)

    return replace(
        one,
        wanted=both(one.wanted, other.wanted),
        wanted_velocity=both(one.wanted_velocity, other.wanted_velocity),
        command=both(one.command, other.command),
        off_path=np.maximum(one.off_path, other.off_path),
        delay=np.maximum(one.delay, other.delay),
        limits=np.concatenate((one.limits, other.limits), axis=1),
        pairs=one.pairs | other.pairs,
        joints=(*one.joints, *other.joints),
        ways=(),
    )


def _shape_of(targets: object, values: Array) -> str:
    """Return what targets are in place of an array of the right shape."""
    return f"of shape {values.shape}" if values.size or is_vector(targets) else short(targets)


def checked_names(names: object) -> tuple[str, str]:
    """Return the names of two arms, checked."""
    every = list(names) if isinstance(names, (list, tuple)) else []
    if len(every) != 2 or not all(isinstance(name, str) and is_name(name) for name in every):
        raise InvalidInputError(
            f"names: must be two names, of the first arm and of the second, not {short(names)}"
        )
    first, second = every
    if first == second:
        raise InvalidInputError(f"names: must be two different names, not {first!r} twice")
    return first, second


class ArmStream(StreamOfProcess):
    """One of two arms behind a shield, as its source sees it; see `DualArmShield`.

    Args:
        shield: The shield.
        name: What it is called.
        arm: The arm.
        block: Its joints among those of both.
        on_blocked: Called with its name and its status, see `StreamShield`.
    """

    def __init__(
        self,
        shield: DualArmShield,
        name: str,
        arm: Arm,
        block: slice,
        on_blocked: Callable[[str, ShieldStatus], object] | None,
    ) -> None:
        self.settings, self.arm, self.period = shield.settings, arm, shield.period
        self.name, self.block, self._shield = name, block, shield
        self._which = shield.names.index(name)
        self.lookahead = shield.lookahead
        self.clearance, self.warnings = shield.clearance, shield.warnings
        self.obstacles = shield.obstacles
        self._steps, self._times = Steps(self.settings.compiled), shield._times
        self._on_blocked = None if on_blocked is None else partial(on_blocked, name)
        # It has of a guard what a stream reads of it.
        self._guard = cast("StreamGuard", _GuardOfArm(shield, block))
        self._begin()

    @property
    def _whole(self) -> StreamGuard:
        return self._shield._guard

    @property
    def overruns(self) -> int:
        """See `DualArmShield.overruns`."""
        return self._shield.overruns

    def command(self, t: float | None = None, p_WO: Displacements | None = None) -> Array:
        """Raise an InvalidInputError: both arms are commanded together."""
        raise InvalidInputError(
            f"command: is that of both arms, shield.command(...), not of {self.name!r} alone"
        )

    def resume(
        self, q: Array, v: Array | None = None, a: Array | None = None, t: float | None = None
    ) -> None:
        """Raise an InvalidInputError: both arms go on together."""
        raise InvalidInputError(
            f"resume: is that of both arms, shield.resume(...), not of {self.name!r} alone"
        )

    def change_limits(self, limits: JointLimits) -> None:
        """Raise an InvalidInputError: both arms have one guard."""
        raise InvalidInputError(
            f"change_limits: is that of both arms, shield.change_limits(...), not of {self.name!r} "
            "alone"
        )

    @property
    def leading(self) -> Array | None:
        """See `StreamShield.leading`."""
        whole = self._guard.last_step.u["target"][self.block]
        return whole if np.isfinite(whole).all() else None

    def is_over(self, now: float) -> bool:
        """Return whether the time after its last velocity or twist is over."""
        is_held = self._kind in ("positions", "poses")
        return not is_held and now > self._way.end + self.settings.timeout


class _ServedArm(ServedStream, ArmStream):
    """One of two arms, in the process of their shield."""


class _ServedArms(DualArmShield):
    """A shield of two arms in its process."""

    _memory: ShieldMemory

    def _stream(self, *arguments: Any) -> ArmStream:
        return _ServedArm(*arguments)

    def serve(self, memory: ShieldMemory) -> None:
        """See `Served`."""
        self._memory = memory
        for which, side in enumerate(self.arms.values()):
            assert isinstance(side, _ServedArm)
            side.serve(memory, which)

    def command(self, t: float | None = None, p_WO: Displacements | None = None) -> Array:
        if (record := self._memory.yields.read()) is not None:
            self.yields = (None, *self.names)[record[0]]
        return super().command(t, p_WO)

    def _note_call(self, begin: float, t: float | None) -> None:
        # Whoever calls notes it, with what is done besides.
        pass


class _LawOfArm(NamedTuple):
    """What is known of the joints of an arm by the law of both.

    Attributes:
        home: Posture at the start, shape (n,) [rad].
        turning: Which joints turn without end, shape (n,).
    """

    home: Array
    turning: NDArray[np.bool_]


class _GuardOfArm:
    """What a stream reads of the guard of two arms: the joints of one.

    Args:
        shield: The shield of both.
        block: The joints.
    """

    def __init__(self, shield: DualArmShield, block: slice) -> None:
        self._shield, self._block, guard = shield, block, shield._guard
        self.law = _LawOfArm(guard.law.home[block], guard.law.turning[block])
        self.period, self.tolerance, self.moving = guard.period, guard.tolerance, guard.moving
        # Limits of both, and of these joints.
        self._limits = guard.limits, self._of_joints(guard.limits)

    @property
    def _guard(self) -> StreamGuard:
        return self._shield._guard

    def _of_joints(self, limits: JointLimits) -> JointLimits:
        return limits.select(range(limits.size)[self._block])

    @property
    def limits(self) -> JointLimits:
        of_both = self._guard.limits
        if of_both is not self._limits[0]:
            self._limits = of_both, self._of_joints(of_both)
        return self._limits[1]

    @property
    def next_limits(self) -> JointLimits:
        return self._of_joints(self._guard.next_limits)

    @property
    def position(self) -> Array:
        return self._guard.position[self._block]

    @property
    def velocity(self) -> Array:
        return self._guard.velocity[self._block]

    @property
    def acceleration(self) -> Array:
        return self._guard.acceleration[self._block]

    @property
    def accelerations(self) -> tuple[Array, Array]:
        before, after = self._guard.accelerations
        return before[self._block], after[self._block]

    @property
    def last_step(self) -> LastStep:
        return self._guard.last_step._replace(block=self._block)

    @property
    def newest(self) -> GuardCommand:
        newest, block = self._guard.newest, self._block
        return newest._replace(
            position=newest.position[block],
            velocity=newest.velocity[block],
            acceleration=newest.acceleration[block],
            most=newest.most[block],
            jerk=None if newest.jerk is None else newest.jerk[block],
        )

    def part(self, name: str) -> Array:
        """Return a part of the law's state, as `StreamGuard.part` does."""
        part = self._guard.part(name)
        return part[self._block] if part.shape == self._guard.law.home.shape else part

    def rest(self) -> None:
        """Do nothing: an arm without a way rests."""
