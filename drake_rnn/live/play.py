"""A session at the rate of real time, and the page that plays with it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from ..errors import InvalidInputError
from ..runs.result import Result
from .controls import Button, Control
from .gauge import shown_numbers
from .lease import Lease
from .pace import Pace
from .page import live_page
from .recording import Recording
from .scene import LiveScene
from .serving import Served, Server
from .session import SLICE, Reply, Session

# Time between two samples that the page is sent [s], and the longest wait for anything [s].
_BETWEEN, _SHORT = 1.0 / 30.0, 0.01
_SAVE = "save"

#: Saves a result, and returns where.
Saving = Callable[[Result], str]


@dataclass
class _Told:
    """What the page asks for from time to time.

    Attributes:
        version: Number of the last change.
        reply: What the last control has led to.
    """

    version: int = 0
    reply: Reply = field(default_factory=Reply)
    data: dict[str, Any] = field(default_factory=dict)


class Play:
    """A session that is played with on a page, by the thread that has made this object.

    Args:
        session: The session.
        host: Address to listen at.
        port: Port of the page; 0 for any that is free.
        save: Saves what was recorded.
        clock: Returns the time [s].

    Raises:
        InvalidInputError: If it cannot listen there.
    """

    def __init__(
        self,
        session: Session,
        host: str,
        port: int,
        save: Saving,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._session, self._save, self._clock = session, save, clock
        self._pace = Pace(SLICE, clock)
        self._lease = Lease(clock)
        self._told, self._recorded = _Told(), False
        self._saved_last: Recording | None = None
        self._numbers = shown_numbers(session.experiment)
        self._scene = LiveScene(session.variants.experiment(session.variants.base), host)
        document = session.variants.document
        page = live_page(
            session.experiment.name or session.experiment.arm.name,
            {"expect": document.expect, "paper": document.paper},
            self._scene.start,
            self._scene.as_data(),
            self._numbers,
            self._scene.port,
            obstacles=bool(session.hands.moved_obstacles),
        )
        self._tell(Reply())
        served = Served(page, lambda: self._told.data, self._lease)
        self._server = Server(host, port, served)
        self.url = self._server.url

    @property
    def unsaved(self) -> float:
        """What was recorded last and has not been saved [s]."""
        recording = self._session.recording
        saved = recording is None or recording is self._saved_last
        return 0.0 if recording is None or saved else recording.duration

    @property
    def rate(self) -> float:
        """Simulated time over real time, of the last two seconds."""
        return self._pace.rate

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Play until a condition holds, or KeyboardInterrupt."""
        shown = -1.0
        while not until():
            self._listen()
            if self._session.is_paused:
                time.sleep(_SHORT)
                self._pace.begin()
            elif (wait := self._pace.wait()) > 0.0:
                time.sleep(min(wait, _SHORT))
            else:
                self._session.advance()
                self._pace.passed()
                self._tell_of_ends()
            if (now := self._clock()) - shown >= _BETWEEN:
                shown = now
                self._show()

    def close(self) -> None:
        """Stop listening."""
        self._server.close()

    def _tell_of_ends(self) -> None:
        """Tell of what ends by itself: a simulation that fails, and a recording that is full."""
        recorded = self._is_recording
        if self._session.failure:
            self._tell(Reply(f"stopped: {self._session.failure}", refused=True))
        elif self._recorded and not recorded:
            self._tell(Reply("the recording has ended"))
        self._recorded = recorded

    @property
    def _is_recording(self) -> bool:
        recording = self._session.recording
        return recording is not None and not recording.ended

    def _listen(self) -> None:
        for name, value in self._lease.taken().items():
            reply = self._saved() if name == _SAVE else self._session.set(name, value)
            if reply.text or not name.startswith(("target", "obstacle")):
                self._tell(reply)
        self._recorded = self._is_recording

    def _saved(self) -> Reply:
        try:
            began = self._clock()
            result = self._session.recorded()
            timings = {"wall_time_s": self._clock() - began}
            place = self._save(replace(result, timings=timings))
        except (InvalidInputError, RuntimeError, OSError) as error:
            return Reply(str(error), refused=True)
        finally:
            # What took time to evaluate is not made up for.
            self._pace.begin()
        self._saved_last = self._session.recording
        return Reply(f"saved: {place}")

    def _show(self) -> None:
        try:
            self._send()
        except (InvalidInputError, RuntimeError):
            # Of a simulation that has failed there may be nothing to show.
            if not self._session.failure:
                raise

    def _send(self) -> None:
        session = self._session
        known = session.numbers()
        recording = session.recording
        head = [
            float(self._told.version),
            session.time,
            self._pace.rate if not session.is_paused else 0.0,
            0.0 if recording is None else recording.duration,
        ]
        nothing = float("nan")
        numbers = [known.get(each.key, nothing) for each in self._numbers]
        self._scene.show(session, [*head, *numbers])

    def _tell(self, reply: Reply) -> None:
        """Change what the page asks for."""
        told, session = self._told, self._session
        told.version += 1
        controls: dict[str, Control] = dict(session.controls())
        if session.recording is not None:
            controls[_SAVE] = Button("save")
        told.data = {
            "version": told.version,
            "reply": {"text": reply.text, "refused": reply.refused},
            "controls": {name: control.as_data() for name, control in controls.items()},
        }
