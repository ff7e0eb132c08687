"""A recording of what was played, and the result that it is saved as."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from pydrake.math import RotationMatrix

from ..errors import InvalidInputError
from ..experiment import Experiment, make_experiment
from ..experiment.law import ORIGINS
from ..inputs.dataclass_fields import fields_of
from ..inputs.fields import Array
from ..laws import Law
from ..measures import Steps
from ..paths import Waypoints
from ..runs.evaluation import Evaluation
from ..runs.result import Result
from .hands import Hands
from .segment import Segment

#: Longest recording [s]: a minute takes some 50 MB and a few seconds to evaluate.
LONGEST = 120.0
# Time between two waypoints of the path that the document of a recording names [s].
_SPACING = 0.02
# Room above the largest speed that was looked for.
_ROOM = 1.02


@dataclass(eq=False)
class Recording:
    """Steps that are recorded while one variant runs.

    Attributes:
        segment: The simulation.
        law: Law at the beginning.
        begin: Time of the session at which it begins [s].
        gains: What was changed, as sentences.
        ended: Whether no more steps come.
    """

    segment: Segment
    law: Law
    begin: float
    gains: list[str] = field(default_factory=list)
    ended: bool = False
    _parts: list[Steps] = field(default_factory=list)
    _until: float = 0.0

    def add(self, steps: Steps) -> None:
        """Add steps, which begin with the last one added before."""
        at = slice(1 if self._parts else 0, None)
        self._parts.append(replace(steps, time=steps.time[at], rows=steps.rows[at].copy()))
        self._until = float(steps.time[-1])
        self.ended = self.ended or self.duration >= LONGEST

    def note(self, what: str) -> None:
        """Note that something was set, at the time reached."""
        self.gains.append(f"{what} from t = {self.duration:.3f} s")

    @property
    def duration(self) -> float:
        """What has been recorded [s]."""
        return max(0.0, self._until - (self.begin - self.segment.begin))

    def result(self, hands: Hands) -> Result:
        """Return what was recorded as the result of a run.

        Its document names the path that was dragged as waypoints, and so begins where the arm was,
        but at rest; series and metrics are of what was played.

        Args:
            hands: What led the experiment.

        Raises:
            InvalidInputError: If nothing was recorded, or it cannot be described by a document.
        """
        if self.duration <= 0.0:
            raise InvalidInputError("recording: is empty; play, and record again")
        steps = self._steps()
        experiment = self._experiment(steps, hands)
        loop = self.segment.loop
        evaluation = Evaluation(experiment, loop, experiment.document.log_period)
        result, fault = evaluation.finish(steps, (), self.segment.simulator.get_system())
        if fault is not None:
            raise fault
        if not self.gains:
            return result
        # What a law says of itself follows from its gains, and those have changed.
        said = {*loop.controller.reading.observables.parts}
        series = {name: each for name, each in result.series.items() if name not in said}
        return replace(result, series=series, warnings=[*result.warnings, *self.gains])

    def _steps(self) -> Steps:
        begin = self.begin - self.segment.begin
        time = np.concatenate([part.time for part in self._parts])
        rows = np.concatenate([part.rows for part in self._parts])
        return Steps(np.maximum(time - begin, 0.0), rows, self._parts[0].layout)

    def _experiment(self, steps: Steps, hands: Hands) -> Experiment:
        """Return the experiment of the result: what its document says, as it was played."""
        played, start = self.segment.experiment, steps.series("position")[0]
        document = played.document.contents()
        for key in ("window", "accept", "over", "paper"):
            document.pop(key, None)
        document |= {
            "expect": "played live",
            "start": np.clip(start, played.limits.position_lower, played.limits.position_upper),
            "duration": float(steps.time[-1]),
            "law": _described(document["law"], self.law),
        }
        if played.law.follows_position:
            document["path"] = _waypoints(played, hands, self.begin, float(steps.time[-1]))
        if played.document.obstacles is not None:
            document["obstacles"] = self._obstacles(hands, float(steps.time[-1]))
        made = make_experiment(document)
        led = hands.led(replace(played, document=made.document), self.begin)
        return replace(led, law=self.law, start=made.start, warnings=made.warnings)

    def _obstacles(self, hands: Hands, duration: float) -> list[Any]:
        """Return the obstacles of the document, those that moved with the way that they went."""
        given = list(self.segment.experiment.document.obstacles or [])
        times = _times(duration)
        for k in hands.moved_obstacles:
            way = np.array([hands.p_WO(k, self.begin + t) for t in times])
            found = dict(given[k])
            found.pop("moves", None)
            found |= _displaced(found, way[0])
            if np.ptp(way, axis=0).max() > 0.0:
                points = {"positions": (way - way[0]).tolist(), "times": times.tolist()}
                moves = Waypoints(**points, through="cubic").placed(np.zeros(3))
                found["moves"] = {"kind": "waypoints", "through": "cubic", **points}
                # As waypoints it begins and ends at rest, and is faster there for a moment.
                fastest = max(float(np.linalg.norm(moves.position(t)[1])) for t in _dense(times))
                found["speed"] = max(found["speed"], _ROOM * fastest)
            given[k] = found
        return given


def _dense(times: Array) -> list[float]:
    found: list[float] = np.linspace(0.0, times[-1], 8 * times.size).tolist()
    return found


def _times(duration: float) -> Array:
    return np.linspace(0.0, duration, max(2, round(duration / _SPACING) + 1))


def _waypoints(played: Experiment, hands: Hands, begin: float, duration: float) -> dict[str, Any]:
    """Return the path that was followed, as waypoints of a document."""
    times = _times(duration)
    target = hands.target
    points = [target.position(begin + t)[0].tolist() for t in times]
    path: dict[str, Any] = {"kind": "waypoints", "through": "cubic", "absolute": True}
    path |= {"positions": points, "times": times.tolist()}
    if played.holds_orientation and target.oriented:
        turned = [RotationMatrix(target.orientation(begin + t)[0]) for t in times]
        path["quaternions"] = [R.ToQuaternion().wxyz().tolist() for R in turned]
    return path


def _displaced(obstacle: dict[str, Any], by: Array) -> dict[str, Any]:
    """Return the keys that say where an obstacle is, after it has been moved."""
    places = [key for key in ("center", "ends") if key in obstacle]
    return {key: (np.array(obstacle[key]) + by).tolist() for key in places}


def _described(section: dict[str, Any], law: Law) -> dict[str, Any]:
    """Return the section of a law with the gains that it had."""
    known = fields_of(law)
    numbers = [k for k, value in known.items() if type(value) is float and k not in ORIGINS]
    return section | {name: known[name] for name in numbers}
