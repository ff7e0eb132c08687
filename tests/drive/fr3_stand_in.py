"""An FR3 that follows its commands exactly and judges them, for a pacer's process; no NumPy.

Its address says what goes wrong, e.g. ``lose=500:7``: from its 500th cycle on it takes no command
for 7 of them, and goes on with its last acceleration, as in a cycle that is not answered;
``nan=500``, ``joints=500`` or ``clock=500``: in its 500th cycle it tells what is no state.
"""

from math import nan, pi
from time import monotonic, sleep

from drake_rnn.drive.pacer import State

H = 1e-3
START = [0.0, -pi / 4, 0.0, -0.75 * pi, 0.0, pi / 2, pi / 4]
UPPER = [2.7501, 1.7918, 2.9065, -0.1458, 2.8101, 4.5205, 3.0196]
LOWER = [-2.7501, -1.7918, -2.9065, -3.0481, -2.8101, 0.54092, -3.0196]
FASTEST = [2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26]
ACCELERATION, JERK = 10.0, 5000.0
#: Cycles in a row after which the robot gives up.
PATIENCE = 20

#: What is no state.
WRONG = {
    "nan": lambda state: state._replace(q=[nan] * 7),
    "joints": lambda state: state._replace(q=state.q[:6]),
    "clock": lambda state: state._replace(time=state.time + 500.0),
}


class RefusedError(Exception):
    """What the robot refuses."""


class StandIn:
    def __init__(self, address):
        name, _, numbers = address.partition("=")
        self.lost, self.kind = range(0), name
        self.wrong = int(numbers) if name in WRONG else -1
        if name == "lose":
            at, count = map(int, numbers.split(":"))
            self.lost = range(at, at + count)
        self.q, self.v, self.a = list(START), [0.0] * 7, [0.0] * 7
        self.cycle, self.moved, self.due = 0, 0, monotonic()
        self.answered = True

    def look(self):
        self.cycle += 1
        self.due = max(self.due + H, monotonic() - 20 * H)
        sleep(max(self.due - monotonic(), 0.0))
        return State(self.cycle * H, self.q, self.v, self.q, 1.0)

    def begin(self):
        self.moved, self.answered = 0, True

    def read(self):
        if not self.answered:
            self._go_on()
        self.moved += 1
        self.answered, lost = False, 0
        while self.moved in self.lost:
            lost += 1
            self.moved += 1
            self.cycle += 1
            if lost == PATIENCE:
                raise RefusedError("communication_constraints_violation")
            self._go_on()
        state = self.look()
        return WRONG[self.kind](state) if self.moved == self.wrong else state

    def _go_on(self):
        """Hold the acceleration for a cycle."""
        self._move([v + H * a for v, a in zip(self.v, self.a, strict=True)])

    def answer(self, position, is_last):
        v = [(new - old) / H for new, old in zip(position, self.q, strict=True)]
        for i in range(7):
            a = (v[i] - self.v[i]) / H
            jerk = (a - self.a[i]) / H
            if abs(v[i]) > FASTEST[i] or abs(a) > ACCELERATION or abs(jerk) > JERK:
                raise RefusedError(f"joint {i + 1}: {v[i]} rad/s, {a} rad/s^2, {jerk} rad/s^3")
            if not LOWER[i] <= position[i] <= UPPER[i]:
                raise RefusedError(f"joint {i + 1}: {position[i]} rad")
        if is_last and any(v):
            raise RefusedError("it moves at the end")
        self._move(v)
        self.q, self.answered = list(position), True

    def _move(self, v):
        self.a = [(new - old) / H for new, old in zip(v, self.v, strict=True)]
        self.v = v
        self.q = [q + H * speed for q, speed in zip(self.q, v, strict=True)]
