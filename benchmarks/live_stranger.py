"""A stranger at the controls, and what the command did meanwhile."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from drake_rnn.live.controls import Control
from drake_rnn.live.segment import Segment
from drake_rnn.live.session import SLICE, Session
from drake_rnn.measures import Steps

BUTTONS = {"reset", "record"}
SWITCHES = ("law", "level", "learned", "noise", "reset J")


class Watched:
    """The largest excess over each bound, and the largest jump where one law takes over."""

    def __init__(self, session: Session) -> None:
        self.limits = session.experiment.limits
        self.excess = dict.fromkeys(("position", "velocity", "acceleration", "jerk"), -np.inf)
        self.jump, self.distance = 0.0, np.inf
        self._last: Any = None
        session.watch = self

    def __call__(self, segment: Segment, steps: Steps) -> None:
        v = segment.controller.reading.state.part(steps.series("state"), "v")
        motors = "position_commanded" in steps.layout
        q = steps.series("position_commanded" if motors else "position")
        held, limits = np.diff(steps.time)[:, None], self.limits
        a = np.diff(v, axis=0) / held
        before = a[:1]
        if segment.begin + steps.time[0] == 0.0:
            # A reset is no motion.
            self._last = None
        if self._last is not None:
            q_end, v_end, before = self._last
            self.jump = max(self.jump, np.abs(q[0] - q_end).max(), np.abs(v[0] - v_end).max())
        self._last = q[-1].copy(), v[-1].copy(), a[-1:]
        jerk = np.diff(np.concatenate((before, a)), axis=0) / held
        self._exceed("position", np.maximum(limits.position_lower - q, q - limits.position_upper))
        for name, values in (("velocity", v), ("acceleration", a), ("jerk", jerk)):
            if (bound := limits.bounds[name]) is not None:
                self._exceed(name, np.abs(values) / bound - 1.0)
        if (clearance := segment.experiment.clearance) is not None:
            motions = segment.experiment.motions
            least = clearance.least_along(q, motions and motions.along(steps.time))
            moved = np.abs(np.diff(q, axis=0)).max(axis=1) > 1e-12
            self.distance = min(self.distance, least[1:][moved].min(initial=np.inf))

    def _exceed(self, name: str, values: Any) -> None:
        self.excess[name] = max(self.excess[name], float(values.max()))


def random_setting(rng: np.random.Generator, controls: Mapping[str, Control]) -> tuple[str, Any]:
    """Return a name and a value that a page could send, often beyond what may be set."""
    name = str(rng.choice([each for each in controls if each not in BUTTONS]))
    told = controls[name].as_data()
    ends = np.log([told.get("low", 1.0) / 10.0, told.get("high", 1.0) * 10.0])
    values = {
        "handle": lambda: rng.uniform(-1.5, 1.5, 3).tolist(),
        "slider": lambda: float(np.exp(rng.uniform(*ends))),
        "switch": lambda: bool(rng.random() < 0.5),
        "choice": lambda: str(rng.choice(told["options"])),
        "button": lambda: None,
    }
    return name, values[told["kind"]]()


def play(session: Session, seconds: float, seed: int, switches: float = 0.4) -> int:
    """Set controls at random while some seconds are simulated; return how many were set."""
    rng, count, slices = np.random.default_rng(seed), 0, 0
    while slices < seconds / SLICE:
        for _ in range(rng.integers(0, 3)):
            name, value = random_setting(rng, session.controls())
            if name in SWITCHES and rng.random() > switches:
                continue
            session.set(name, value)
            count += 1
        for _ in range(rng.integers(1, 25)):
            session.advance()
            slices += not session.is_paused
        assert session.failure == ""
        session.set("pause", False)
    return count
