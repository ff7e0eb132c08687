"""A session at the rate of real time, and the page that plays with it.

- The rate at which slices of simulated time follow each other: that of real time, or less.
- The live page: that of the playback, with controls in place of what has come out.
- The scene of a running experiment, and what moves in it, sent over Meshcat's own websocket.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.math import RigidTransform, RotationMatrix

from .. import colours
from ..errors import InvalidInputError
from ..experiment import Experiment
from ..features.obstacles import pose_of
from ..inputs.fields import Array
from ..inputs.files import page_templates
from ..inputs.messages import require_type
from ..laws.guarantee import promise_lines
from ..playback.arm_drawing import WantedArm, restraint_text
from ..playback.page import SCRIPTS, WEB, RecordedScene, make_scene, parse_static_html
from ..playback.path_drawings import arrow_of
from ..playback.replay import replayed_contact, replayed_motion, round_points
from ..playback.viewpoint import box_round, outermost
from ..robot.model.model import quiet_drake
from ..runs.result import Result
from ..shield.arms import DualArmShield
from ..shield.process import Shield
from ..shield.report import AHEAD, WANTED, ShieldRecord, look_ahead, points_ahead, series_of
from ..signals import DESIRED_POSITION
from .controls import Button, Control
from .hands import OBSTACLE, TARGET
from .segment import Readout
from .serving import Content, Lease, Server
from .session import LONGEST, SLICE, Recording, Reply, Session
from .shielded import ShieldSession, experiment_of

#: How far the simulation may be behind before the rest is given up [s].
_BEHIND = 0.1
# Time over which the rate is measured [s].
_WINDOW = 2.0


class Pace:
    """When the next slice is due, and how fast they have followed each other.

    A simulation that is behind by more than a tenth of a second, after a stall or because it is too
    slow, does not catch up: it goes on at the rate of real time from where it is.

    Args:
        slice_time: Simulated time of a slice [s].
        clock: Returns the time [s].
    """

    def __init__(self, slice_time: float, clock: Callable[[], float]) -> None:
        self._slice, self._clock = slice_time, clock
        self.begin()

    def begin(self) -> None:
        """Begin anew, as after a pause; nothing is behind."""
        self._due = self._clock()
        self._ends: deque[float] = deque([self._due])

    def wait(self) -> float:
        """Return the time until the next slice is due [s]; 0 if it is."""
        return max(0.0, self._due - self._clock())

    def note_slice(self) -> None:
        """Note that a slice has been simulated."""
        now = self._clock()
        self._due = max(self._due + self._slice, now - _BEHIND)
        self._ends.append(now)
        while now - self._ends[0] > _WINDOW and len(self._ends) > 2:
            self._ends.popleft()

    @property
    def rate(self) -> float:
        """Simulated time over real time, of the last two seconds."""
        since = self._clock() - self._ends[0]
        return (len(self._ends) - 1) * self._slice / since if since > 0.0 else 1.0


#: Time that the chart shows [s].
WINDOW = 20.0
# Scripts behind those of any page.
_OWN = ("wire.js", "panel.js", "drag.js", "live.js")


def live_page(
    title: str,
    state: Mapping[str, Any],
    scene: RecordedScene,
    view: Mapping[str, Any],
    numbers: Sequence[Readout],
    port: int,
    *,
    offers: Sequence[str],
    streams: bool,
) -> str:
    """Return the page.

    Args:
        title: Its title.
        state: What the document says of itself, ``expect`` and ``paper``, and ``promises``.
        scene: The scene at the start.
        view: What its picture is drawn with.
        numbers: Numbers that come with each sample, in their order.
        port: Port of Meshcat's websocket.
        offers: Names of the controls at the start.
        streams: Whether a source gives targets, and no law has gains.
    """
    curves = [
        {**each.as_data(), "time": "", "values": "", "accepted": []}
        for each in numbers
        if each.key != "force_desired"
    ]
    data = {
        **view,
        "name": title,
        "beside": [],
        "duration": WINDOW,
        "rate": 30,
        "window": None,
        "curves": curves,
        # The arm fills the picture; a path that is dragged has no place to be enlarged at.
        "inset": False,
        "image": None,
        "numbers": [each.key for each in numbers],
        "offers": list(offers),
        "obstacles": any(name.startswith(OBSTACLE) for name in offers),
        "streams": streams,
        "port": port,
    }
    page = page_templates(Path(__file__).parent / "web", WEB).get_template("live.html.jinja")
    return page.render(
        title=title,
        scene=scene,
        outcome=state,
        data=data,
        scripts=SCRIPTS + _OWN,
        colours=colours,
    )


# Number of points of the path that are drawn.
_POINTS = 400
# How far from the path a hand is expected to lead the target [m], and damping of postures along it.
_REACHED, _DAMPING = 0.1, 1e-4
# How far above a surface what is on it is drawn [m].
_ABOVE = 8e-4
# What takes a while to find is shown with each so many samples; what lasts, after so many times.
_SELDOM, _LASTS = 3, 3
#: Where numbers come in the scene, and the property that holds them.
SAMPLE = ("/live", "sample")


#: Returns what a shield makes of a source.
Source = Callable[[], ShieldRecord]


class LiveScene:
    """The scene of a session.

    The page has the scene as it is at the start; a Meshcat of its own, which takes nothing from
    anybody, tells it what moves.

    Args:
        experiment: The experiment.
        host: Address to listen at.
        source: Returns what a shield makes of a source, to be shown; None without one.

    Raises:
        InvalidInputError: If it cannot listen there.
    """

    def __init__(self, experiment: Experiment, host: str, source: Source | None = None) -> None:
        run = _ideal_run(experiment)
        self._source, self._shown = source, 0
        # What a source's way leads into, and for how many looks there was something to remark.
        self._ahead, self._remarked = "", 0
        self._record = record = None if source is None else source()
        motion = replayed_motion(run if record is None else _with_source(run, record))
        self._scene = make_scene(replace(motion, ends=not experiment.desired.closed))
        self._room = _room_of_hands(experiment, motion.course)
        self._contact = replayed_contact(motion)
        arm = self._scene.drawn
        arm.draw(experiment.start, 0.0)
        drawn = [item for item in self._scene.items if isinstance(item, WantedArm)]
        self._wanted = drawn[0] if drawn else None
        self._bodies = [b for b in arm.bodies if not arm.plant.IsAnchored(b)]
        try:
            with quiet_drake(logging.WARNING):
                self._live = Meshcat(MeshcatParams(host=host, port=0, show_stats_plot=False))
        except RuntimeError:
            raise InvalidInputError(
                f"--host {host}: must be an address of this machine, and its port free"
            ) from None

    @property
    def port(self) -> int:
        """Port of the websocket."""
        port: int = self._live.port()
        return port

    @property
    def start(self) -> RecordedScene:
        """The scene as it is at the start."""
        return parse_static_html(self._scene.meshcat.StaticHtml())

    def as_data(self) -> dict[str, Any]:
        """Return what the page's picture is drawn with."""
        data = self._scene.as_data()
        view = data["views"]["arm"]
        view["points"] = round_points(outermost(np.concatenate((view["points"], self._room))))
        return data

    def refresh(self) -> None:
        """Ask what a source wants now."""
        if self._source is not None:
            self._record = self._source()

    def show(self, session: Session | ShieldSession, sample: Sequence[float]) -> None:
        """Show where everything is.

        Args:
            session: The session.
            sample: Numbers that the page shows besides.
        """
        arm, live, q = self._scene.drawn, self._live, session.position()
        experiment, t = session.experiment, session.local_time
        arm.set_posture(q)
        for body in self._bodies:
            live.SetTransform(arm.place(body), arm.X_WB(body))
        p_WE, R_WE = session.kinematics.p_WE(q), session.kinematics.R_WE(q)
        path = self.desired(experiment, t)
        shadow, tool = (self._below(p) for p in (path, p_WE))
        live.SetTransform("/desired/point", RigidTransform(shadow))
        if self._contact is None:
            live.SetTransform("/traced/point", RigidTransform(p_WE))
        else:
            R, scale, presses = arrow_of(self._contact, session.contact_force())
            live.SetTransform("/force", RigidTransform(R, tool))
            live.SetProperty("/force", "scale", scale)
            live.SetProperty("/force", "visible", presses)
        if experiment.desired.turns:
            R = RotationMatrix.ProjectToRotationMatrix(R_WE)
            live.SetTransform("/traced/axes", RigidTransform(R, p_WE))
        for number, p_WO in session.moved_obstacles.items():
            X = pose_of(experiment.obstacles[number])
            at = X.translation() + p_WO
            live.SetTransform(f"/obstacles/{number}", RigidTransform(X.rotation(), at))
        self._shown += 1
        self._show_wanted(session)
        if self._shown % _SELDOM == 1:
            self._show_said(session)
        live.SetProperty(*SAMPLE, [*sample, *tool, *path])

    def desired(self, experiment: Experiment, t: float) -> Array:
        """Return where the tool is wanted at a time of the experiment [s], shape (3,) [m]."""
        if self._record is None:
            return experiment.desired.position(t)[0]
        return self._scene.drawn.arm.kinematics().p_WE(self._record.wanted_at(t))

    def numbers(self, session: Session | ShieldSession) -> dict[str, float]:
        """Return numbers that are of what a source wants, in place of the session's."""
        if self._record is None:
            return {}
        desired = self.desired(session.experiment, session.local_time)
        away = session.kinematics.p_WE(session.position()) - desired
        return {"position_error": float(np.linalg.norm(away))}

    def _show_wanted(self, session: Session | ShieldSession) -> None:
        """Show what a source wants now and next, and what keeps the arm from it."""
        record, wanted, live = self._record, self._wanted, self._live
        if record is None or wanted is None:
            return
        arm, t = self._scene.drawn, session.local_time
        for place, X_WB in arm.target_poses(record.wanted_at(t)).items():
            live.SetTransform(place, X_WB)
        if self._shown % _SELDOM != 1:
            return
        experiment = session.experiment
        around = (session.kinematics, experiment.limits), experiment.clearance, session.p_WO
        ahead = look_ahead(record, t, *around)
        for place, point, broken in zip(wanted.points, ahead.p_WE, ahead.broken, strict=False):
            is_there = bool(np.isfinite(point).all())
            live.SetProperty(place, "visible", is_there)
            if is_there:
                live.SetTransform(place, RigidTransform(point))
                colour = colours.BROKEN if broken else colours.TARGET
                live.SetProperty(place, "color", [*colours.components(colour), 1.0])
        self._ahead = f"the source: {ahead.first}" if ahead.first else ""

    def _show_said(self, session: Session | ShieldSession) -> None:
        """Mark what holds the arm back, and say it, what is ahead, and what lasts."""
        wanted, step, said = self._wanted, session.last_step, list[str]()
        if wanted is not None and self._record is not None and step is not None:
            clearance, causes = session.experiment.clearance, step.causes
            names = () if clearance is None else clearance.names
            near = [names[k] for k in causes.pairs.tolist()]
            pairs = np.array([name in near for name in wanted.pair_names], dtype=bool)
            for place, is_marked in wanted.marks(causes.limits, pairs).items():
                self._live.SetProperty(place, "visible", is_marked)
            said.append(restraint_text(causes.limits, pairs, wanted.pair_names))
        remark = session.remark()
        self._remarked = self._remarked + 1 if remark else 0
        said.append(remark if self._remarked > _LASTS else "")
        text = ". ".join(each for each in (*said, self._ahead) if each)
        # Meshcat's properties are numbers.
        self._live.SetProperty(SAMPLE[0], "said", [float(ord(letter)) for letter in text] or [32.0])

    def _below(self, p_WE: Array) -> Array:
        """Return where a point is drawn, shape (3,) [m]: on the surface, if there is one."""
        contact = self._contact
        if contact is None:
            return p_WE
        n = contact.normal
        return np.asarray(p_WE - (n.dot(p_WE - contact.p_WS) - _ABOVE) * n)


def _with_source(run: Result, record: ShieldRecord) -> Result:
    """Return a result that shows what a source wants as the path."""
    kinematics, axes = run.experiment.arm.kinematics(), list(run.experiment.task.axes)
    series = series_of(record, run.time, kinematics)
    series[AHEAD] = points_ahead(record, run.time, kinematics)
    path = np.array([kinematics.p_WE(q)[axes] for q in series[WANTED]])
    return replace(run, series={**run.series, **series, DESIRED_POSITION: path})


def _room_of_hands(experiment: Experiment, course: Array) -> Array:
    """Return points that a hand may lead the target and obstacles to, shape (k, 3) [m].

    These are a box round the path, and the boxes round obstacles where they begin and end.
    """
    boxes = [box_round(course, _REACHED)]
    motions, clearance = experiment.motions, experiment.clearance
    if motions is not None and clearance is not None:
        corners = {each.name: each.corners for each in experiment.obstacles}
        solids = clearance.solids
        names = [solids.names[k] for k in solids.moving]
        for name, path in zip(names, motions.paths, strict=True):
            begin = np.zeros(3) if path is None else path.position(0.0)[0]
            end = begin if path is None else path.position(path.duration)[0]
            boxes += [corners[name], corners[name] + end - begin] if np.isfinite(end).all() else []
    return np.concatenate(boxes)


def _ideal_run(experiment: Experiment) -> Result:
    """Return a result in which the path is passed once, as an arm without bounds would."""
    until = experiment.desired.traversal
    time = np.linspace(0.0, until if np.isfinite(until) and until > 0.0 else 1.0, _POINTS)
    axes = list(experiment.task.axes)
    path = np.array([experiment.desired.position(t)[0][axes] for t in time.tolist()])
    series = {
        "position": _postures_along(experiment, time),
        "p_WE": np.tile(experiment.p_WE_start[axes], (_POINTS, 1)),
        DESIRED_POSITION: path,
    }
    if experiment.contact is not None:
        series["contact_force"] = np.zeros((_POINTS, 3))
    return Result(experiment, time, series, {})


def _postures_along(experiment: Experiment, time: Array) -> Array:
    """Return postures in which the tool is on the path, shape (k, n), by damped least squares."""
    q, kinematics = experiment.start.copy(), experiment.arm.kinematics()
    postures = [q]
    for t in time[1:].tolist():
        if not experiment.law.follows_position:
            postures.append(q)
            continue
        error = experiment.desired.position(t)[0] - kinematics.p_WE(q)
        J = kinematics.J(q)
        if experiment.holds_orientation:
            R = experiment.desired.orientation(t)[0] @ kinematics.R_WE(q).T
            rotation_error = 0.5 * np.array(
                [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]
            )
            error, J = np.append(error, rotation_error), np.vstack((J, kinematics.J_omega(q)))
        step = J.T @ np.linalg.solve(J @ J.T + _DAMPING * np.eye(error.size), error)
        limits = experiment.limits
        q = np.clip(q + step, limits.position_lower, limits.position_upper)
        postures.append(q)
    return np.array(postures)


# Time between two samples that the page is sent [s], and the longest wait for anything [s].
_BETWEEN, _SHORT = 1.0 / 30.0, 0.01
_SAVE = "save"
_FULL = f"the recording has ended, after {LONGEST:g} s; it can be saved"

#: Saves a result, and returns where.
Saving = Callable[[Result], str]


@dataclass
class _PageState:
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
        save: Saves what was recorded; None where nothing is.
        clock: Returns the time [s].
        waits: Whether time starts when a page is first open.
        source: Returns what a shield makes of a source, to be shown; None without one.

    Raises:
        InvalidInputError: If it cannot listen there.
    """

    def __init__(
        self,
        session: Session | ShieldSession,
        host: str,
        port: int,
        save: Saving | None = None,
        clock: Callable[[], float] = time.monotonic,
        *,
        waits: bool = False,
        source: Source | None = None,
    ) -> None:
        self._session, self._save, self._clock = session, save, clock
        self._waits = waits
        self._pace = Pace(SLICE, clock)
        self._lease = Lease(clock)
        told, self._recorded = _PageState(), False
        self._told = told
        self._saved_last: Recording | None = None
        self._numbers, base = session.readouts, session.base
        self._scene = LiveScene(base, host, source)
        document = session.document
        page = live_page(
            session.experiment.name or session.experiment.arm.name,
            {
                "expect": document.expect,
                "paper": document.paper,
                "promises": promise_lines(session.experiment.guarantees.promises),
            },
            self._scene.start,
            self._scene.as_data(),
            self._numbers,
            self._scene.port,
            offers=list(session.controls()),
            streams=source is not None or base.targets is not None,
        )
        self._tell(Reply())
        content = Content(page, lambda: told.data, self._lease)
        self._server = Server(host, port, content)
        self.url = self._server.url

    @property
    def unsaved_time(self) -> float:
        """What was recorded last and has not been saved [s]."""
        recording = self._session.recording
        is_saved = recording is None or recording is self._saved_last
        return 0.0 if recording is None or is_saved else recording.duration

    @property
    def rate(self) -> float:
        """Simulated time over real time, of the last two seconds."""
        return self._pace.rate

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Play until a condition holds, or KeyboardInterrupt."""
        last_shown = -1.0
        while not until():
            self._listen()
            if self._session.is_paused or (self._waits and not self._lease.was_asked):
                time.sleep(_SHORT)
                self._pace.begin()
            elif (wait := self._pace.wait()) > 0.0:
                time.sleep(min(wait, _SHORT))
            else:
                self._session.advance()
                self._pace.note_slice()
                self._tell_of_ends()
            if (now := self._clock()) - last_shown >= _BETWEEN:
                last_shown = now
                self._show()

    def show(self) -> None:
        """Listen, and show what is now, of what goes on by itself."""
        self._listen()
        self._show()

    def close(self) -> None:
        """Stop listening, and end the scene; by the thread that has made this."""
        self._server.close()
        # Its Meshcat ends the process if another thread deletes it, as the garbage collector may.
        vars(self).pop("_scene", None)

    def _tell_of_ends(self) -> None:
        """Tell of what ends by itself: a simulation that fails, and a recording that is full."""
        is_recording = self._is_recording
        if self._session.failure:
            self._tell(Reply(f"stopped: {self._session.failure}", refused=True))
        elif self._recorded and not is_recording:
            self._tell(Reply("the recording has ended", notice=_FULL))
        self._recorded = is_recording

    @property
    def _is_recording(self) -> bool:
        recording = self._session.recording
        return recording is not None and not recording.ended

    def _listen(self) -> None:
        for name, value in self._lease.take_all().items():
            reply = self._save_recording() if name == _SAVE else self._session.set(name, value)
            is_dragged = name.startswith(("target", "obstacle"))
            # What the target did before it was dragged is no longer so.
            is_over = name == TARGET and self._told.data["reply"]["text"].startswith("the target")
            if reply.text or is_over or not is_dragged:
                self._tell(reply)
        self._recorded = self._is_recording

    def _save_recording(self) -> Reply:
        try:
            began = self._clock()
            result = self._session.end_recording()
            timings = {"wall_time_s": self._clock() - began}
            assert self._save is not None
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
        self._scene.refresh()
        session_numbers = {**session.numbers(), **self._scene.numbers(session)}
        recording = session.recording
        head = [
            float(self._told.version),
            session.time,
            self._pace.rate if not session.is_paused else 0.0,
            0.0 if recording is None else recording.duration,
        ]
        nothing = float("nan")
        numbers = [session_numbers.get(each.key, nothing) for each in self._numbers]
        self._scene.show(session, [*head, *numbers])

    def _tell(self, reply: Reply) -> None:
        """Change what the page asks for."""
        state, session = self._told, self._session
        state.version += 1
        controls: dict[str, Control] = dict(session.controls())
        if session.recording is not None:
            controls[_SAVE] = Button("save")
        state.data = {
            "version": state.version,
            "reply": vars(reply),
            "controls": {name: control.as_data() for name, control in controls.items()},
        }


class ShieldView:
    """A page that shows a shield of a loop of one's own while that runs.

    It has the arm as it is commanded, what the source wants as a ghost, the way ahead, what holds
    the arm back, and curves. All is done by the thread of the loop, within `show`. Of a shield with
    a process of its own, `show` is called by whoever wants to look, at any pace.

    Args:
        shield: The shield, of one arm or of two.
        host: Address to listen at.
        port: Port of the page; 0 for any that is free.

    Attributes:
        url: Address of the page.

    Raises:
        InvalidInputError: If it cannot listen there.
    """

    def __init__(
        self, shield: Shield | DualArmShield, host: str = "localhost", port: int = 0
    ) -> None:
        require_type("shield", shield, Shield, DualArmShield)
        _ = shield.last_record
        self._session = session = ShieldSession(shield, experiment_of(shield))
        self._play = Play(session, host, port, source=lambda: session.record)
        self.url, self._due = self._play.url, 0.0

    def show(self) -> None:
        """Show the last command; more than 30 times a second nothing is sent."""
        self._session.note()
        if (now := time.monotonic()) >= self._due:
            self._due = now + _BETWEEN
            self._play.show()

    def close(self) -> None:
        """Stop listening."""
        self._play.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()
