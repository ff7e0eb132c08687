"""What an FR3 makes of lost cycles, by the manual and by franka-sim, in a time of its own.

A pacer and a law move a robot at full acceleration. Once in each motion the pacer's process stands
still for some cycles: while it waits for a state, while it answers one, or when it has looked at
the time already and is about to send. A robot drops a command that comes
late, and goes on with its acceleration where none came ("keep acceleration constant and integrate",
libfranka's page on system requirements). Such a robot, made from that sentence, judges what is
commanded then, and so does franka-sim's `MotionLimitChecker`, told every packet when it came::

    python benchmarks/fr3_lost_cycles.py --judge /path/to/venv/bin/python

franka-sim applies what comes late, in place of the motion since. So what it judges are the motions
of a robot that does the same. The first rows are of a pacer that sends what is late, and takes it
for taken.
"""

from __future__ import annotations

import argparse
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Literal
from unittest.mock import patch

import numpy as np

from drake_rnn import FR3, Motion, driven_experiment
from drake_rnn.drive import pacer
from drake_rnn.drive.approach import DrivenLaw
from drake_rnn.drive.pacer import Pacing, State
from drake_rnn.drive.shared_cycles import END, MOVE, REST, LawCommand, SharedCycles, anonymous_file
from fr3_conformance import ACCELERATION, JERK
from fr3_judge_packets import Packet, judged_by
from markdown_table import head, row
from shared_options import add_judge

_COMMAND = "python benchmarks/fr3_lost_cycles.py"
H = FR3.period
#: Time from a state to when it is read, and from there to the answer [s].
TRAVEL = 5e-5
#: Cycles of a motion, and those in which the pacer stands still, one in each motion.
CYCLES, MOMENTS = 320, (60, 90, 130, 180, 260)
#: Jump of the robot's clock at which the law has it brought to rest [s].
JUMP = 0.1
#: Cycles for which it stands still.
LOST = (1.0, 1.9, 3.0, 4.9, 10.0, 14.9, 17.9)
#: Shares by which rounding may exceed a bound.
ROUNDING = 1e-6
DOCUMENT = {
    "arm": "fr3",
    "path": {"kind": "rest", "offset": [0.2, 0.3, -0.2]},
    "law": {"kind": "adaptive", "braking": 2.0, "feedback_limit": 1.0},
    "period": H,
    "duration": 1.0,
}
#: Where the pacer stands still.
Place = Literal["waiting", "answering", "sending"]


@dataclass
class Robot:
    """A robot that follows exactly and takes what comes in time, in a time of its own.

    Attributes:
        q, v, a: What it holds, 7 each [rad, rad/s, rad/s^2].
        at: Cycle in which the pacer stands still.
        length: For how long [s].
        place: Where.
        pace: Time that a cycle of its takes by the clock of the pacer's machine [s].
        applies_late: Whether it applies what comes late, in place of the motion since, as
            franka-sim does.
        time: Clock of the pacer's machine [s].
        packets: What it has sent and what has come, in order.
        worst: Largest acceleration and jerk that it was commanded.
        lost: Number of cycles that it has lost.
    """

    q: list[float]
    at: int
    length: float
    place: Place
    pace: float = H
    applies_late: bool = False
    time: float = 0.0
    v: list[float] = field(default_factory=lambda: [0.0] * 7)
    a: list[float] = field(default_factory=lambda: [0.0] * 7)
    packets: list[Packet] = field(default_factory=list)
    worst: tuple[float, float] = (0.0, 0.0)
    lost: int = 0
    _cycle: int = 0
    _seen: int = 0
    _asked: int = 0
    _states: deque[State] = field(default_factory=deque)
    _taken: list[float] | None = None
    _begun: bool = False
    # What it held before the cycles that it has lost in a row, by their numbers.
    _before: dict[int, tuple[list[float], ...]] = field(default_factory=dict)

    def look(self) -> State:
        """See `PacedRobot.look`."""
        return self.read()

    def begin(self) -> None:
        """See `PacedRobot.begin`; it counts from the first command on."""

    def read(self) -> State:
        """Return the newest state, or else wait for the next, as libfranka does."""
        if self._states:
            state = self._states[-1]
        else:
            self._pass((self._cycle + 1) * self.pace + TRAVEL - self.time)
            state = self._states[0]
            self._stand_still("waiting", state)
        while self._states and self._states[0].time <= state.time:
            self._states.popleft()
        self._seen, self._asked = round(state.time / H), 0
        return state

    def now(self) -> float:
        """Return the clock of the pacer's machine [s]."""
        self._asked += 1
        if self._asked == 2:
            self._pass(TRAVEL)
            self._stand_still("answering")
        return self.time

    def answer(self, position: Sequence[float], is_last: bool) -> None:
        """See `PacedRobot.answer`."""
        self._stand_still("sending")
        self.packets.append(Packet(self._seen, list(position)))
        if self._seen == self._cycle:
            self._taken, self._begun = list(position), True
        elif self.applies_late and self._seen in self._before:
            self.q, self.v, self.a = self._before.pop(self._seen)
            self._move(list(position))

    def _stand_still(self, place: Place, state: State | None = None) -> None:
        cycle = self._seen if state is None else round(state.time / H)
        if cycle >= self.at and self.length and place == self.place:
            length, self.length = self.length, 0.0
            self._pass(length)

    def _pass(self, length: float) -> None:
        """Let time pass, and send the states that are due."""
        self.time += length
        while (self._cycle + 1) * self.pace <= self.time:
            self._close()
            self._cycle += 1
            self.packets.append(Packet(self._cycle, None))
            self._states.append(State(self._cycle * H, self.q, self.v, self.q, 1.0))

    def _close(self) -> None:
        """Move through a cycle: to what was commanded, or on with the acceleration."""
        if not self._begun:
            return
        if self._taken is None:
            self.lost += 1
            self._before[self._cycle] = self.q, self.v, self.a
            self.v = [v + H * a for v, a in zip(self.v, self.a, strict=True)]
            self.q = [q + H * v for q, v in zip(self.q, self.v, strict=True)]
            return
        self._before.clear()
        self._move(self._taken)
        self._taken = None

    def _move(self, position: list[float]) -> None:
        """Move to a position within a cycle."""
        v = [(new - q) / H for new, q in zip(position, self.q, strict=True)]
        a = [(new - old) / H for new, old in zip(v, self.v, strict=True)]
        jerks = (abs(new - old) / H for new, old in zip(a, self.a, strict=True))
        most, fastest = self.worst
        self.worst = max(most, *map(abs, a)), max(fastest, *jerks)
        self.q, self.v, self.a = position, v, a


def moved(
    at: int,
    lost: float,
    place: Place,
    pace: float = H,
    *,
    applies_late: bool = False,
    cycles: int = CYCLES,
) -> Robot:
    """Return a robot after a motion of so many cycles, for some of which its pacer stood still."""
    law = DrivenLaw(driven_experiment(DOCUMENT, FR3))
    robot = Robot(law.start.tolist(), at, lost * H, place, pace, applies_late)
    shared = SharedCycles(anonymous_file())
    shared.request = MOVE
    limits, rest = law.limits, np.zeros(7)
    most, jerk = (tuple(x.tolist()) for x in (limits.acceleration, limits.jerk))

    def law_answers() -> None:
        base = shared.count - 1
        cycle = shared.cycle(base)
        if base > cycles or abs(cycle.time - law.time) > JUMP:
            shared.request = REST
            if not any(cycle.part(4)) and not any(cycle.part(5)):
                shared.request = END
            return
        law.resume(cycle.time, Motion(*(np.array(cycle.part(k)) for k in (3, 4, 5))))
        law.advance(cycle.time + H, law.start, rest)
        q, v, a = (tuple(part.tolist()) for part in law.motion())
        shared.tell(LawCommand(base, q, v, a, most, jerk))

    Pacing(robot, shared, law_answers, lambda: False, robot.now).run()
    return robot


def told(name: str, place: Place, python: str | None) -> None:
    """Print the row of a place."""
    robots = [moved(at, lost, place) for lost in LOST for at in MOMENTS]
    bounds = np.array([ACCELERATION, JERK]) * (1.0 + ROUNDING)
    refused = sum(bool((np.array(robot.worst) > bounds).any()) for robot in robots)
    lost = ", ".join(str(k) for k in sorted({robot.lost for robot in robots}))
    cells = [refused]
    if python is not None:
        theirs = [moved(at, lost, place, applies_late=True) for lost in LOST for at in MOMENTS]
        cells.append(sum(map(bool, judged_by(python, [robot.packets for robot in theirs]))))
    row(name, place, lost, len(robots), *cells)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add_judge(parser)
    asked = parser.parse_args()
    theirs = [] if asked.judge is None else ["by franka-sim"]
    head(
        *("the pacer", "stands still while", "cycles lost in a row", "motions"),
        *("objected to by the manual", *theirs),
        made_by=f"{_COMMAND} --judge PYTHON",
    )
    places: tuple[Place, ...] = ("waiting", "answering", "sending")
    for place in places[:2]:
        with patch.multiple(pacer, LATE=inf, DROPPED=inf):
            told("sends what is late, and takes it for taken", place, asked.judge)
    for place in places:
        told("as it is", place, asked.judge)


if __name__ == "__main__":
    main()
