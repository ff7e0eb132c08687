"""A shield, which may run in a process of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ..drive.own_process import Send, check_process
from ..inputs.fields import Array, with_own_errors
from ..robot.arm import Arm
from ..robot.clearance.capsules import Displacements
from ..robot.limits import JointLimits
from .process_reading import CommandsOfProcess, StreamOfProcess, settings_of
from .serving import ServedShield
from .shield import ShieldSettings, ShieldStatus


@with_own_errors
class Shield(CommandsOfProcess, StreamOfProcess):
    """Follows joint positions, velocities, poses or twists with certified commands.

    Targets come when they come, by `follow_positions` and its like; `command` is called every
    period. A new chunk replaces what is left of the last one, whatever kind that was. Joint
    positions and poses are held at the end of a chunk.

    With ``process`` the shield runs in a process of its own, which makes all calls of `command`,
    one each period, on the clock of `time.monotonic`. What is followed is handed to it at once;
    `latest` and the properties tell what is commanded now. `close`, or the end of a ``with`` block,
    has the arm come to rest and ends the process. It does so as well when this process ends,
    however that happens.

    Args:
        arm: The arm.
        period: Time between two calls of `command` [s].
        settings: How it follows its source.
        start: Posture that the robot rests in, shape (n,) [rad]; by default the arm's home. It may
            be up to 0.2 rad outside the position limits: the arm is then brought back first.
        limits: Limits of the joints; by default the arm's. Give those of acceleration and jerk
            where the arm has none.
        obstacles: Obstacles as in a document, each a mapping with ``kind`` and what belongs to it;
            with ``name`` and ``speed`` one that may move, see `StreamShield.command`.
        collisions: Whether the arm is kept clear of itself and of ``obstacles``.
        on_blocked: Called with the status, see `StreamShield`; with ``process`` it is called there,
            once the command was sent, and must be known by name in a module.
        process: Whether the shield runs in a process of its own: False, True, or a function that
            this process calls with each `GuardCommand` at once, so as to send it to the robot. The
            function must be known by name in a module, so that it can be sent there.

    Raises:
        InvalidInputError: If an argument is not as described, or the start is not free.
        RobotError: If the process does not come up.
    """

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
        process: bool | Send = False,
    ) -> None:
        send, settings = check_process(process), settings_of(settings, period, process)
        world: dict[str, Any] = {"limits": limits, "obstacles": obstacles, "collisions": collisions}
        world["on_blocked"] = on_blocked
        super().__init__(arm, period, settings, start=start, **world)
        if process:
            world |= {"settings": settings, "steps": self._steps}
            self._start(ServedShield, world, send)

    def command(self, t: float | None = None, p_WO: Displacements | None = None) -> Array:
        """See `StreamShield.command`; for a shield that is called by this process."""
        self._require_own_calls("command")
        return self._command(t, p_WO)

    def resume(
        self, q: Array, v: Array | None = None, a: Array | None = None, t: float | None = None
    ) -> None:
        """See `StreamShield.resume`; for a shield that is called by this process."""
        self._require_own_calls("resume")
        super().resume(q, v, a, t)
