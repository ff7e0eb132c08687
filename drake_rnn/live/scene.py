"""The scene of a running experiment, and what moves in it, sent over Meshcat's own websocket."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.math import RigidTransform, RotationMatrix

from ..errors import InvalidInputError
from ..experiment import Experiment
from ..inputs.fields import Array
from ..playback.force_arrow import arrow_of
from ..playback.obstacles import pose_of
from ..playback.page import make_scene
from ..playback.recorded import Recorded, recorded
from ..playback.replay import replayed_contact, replayed_motion
from ..robot.drake_log import quiet_drake
from ..runs.result import Result
from ..signals import DESIRED_POSITION
from .session import Session

# Number of points of the path that are drawn.
_POINTS = 400
# How far above a surface what is on it is drawn [m].
_ABOVE = 8e-4
#: Where numbers come in the scene, and the property that holds them.
SAMPLE = ("/live", "sample")


class LiveScene:
    """The scene of a session.

    The page has the scene as it is at the start; a Meshcat of its own, which takes nothing from
    anybody, tells it what moves.

    Args:
        experiment: The experiment.
        host: Address to listen at.

    Raises:
        InvalidInputError: If it cannot listen there.
    """

    def __init__(self, experiment: Experiment, host: str) -> None:
        motion = replayed_motion(_at_start(experiment))
        self._scene = make_scene(replace(motion, ends=not experiment.desired.closed))
        self._contact = replayed_contact(motion)
        drawn = self._scene.drawn
        drawn.draw(experiment.start, 0.0)
        self._bodies = [b for b in drawn.bodies if not drawn.plant.IsAnchored(b)]
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
    def start(self) -> Recorded:
        """The scene as it is at the start."""
        return recorded(self._scene.meshcat.StaticHtml())

    def as_data(self) -> dict[str, Any]:
        """Return what the page's picture is drawn with."""
        return self._scene.as_data()

    def show(self, session: Session, sample: Sequence[float]) -> None:
        """Show where everything is.

        Args:
            session: The session.
            sample: Numbers that the page shows besides.
        """
        drawn, live, q = self._scene.drawn, self._live, session.position()
        experiment, t = session.experiment, session.local_time
        drawn.set_posture(q)
        for body in self._bodies:
            live.SetTransform(drawn.place(body), drawn.X_WB(body))
        p_WE, R_WE = session.kinematics.p_WE(q), session.kinematics.R_WE(q)
        desired = experiment.desired.position(t)[0]
        seen, tool = (self._below(p) for p in (desired, p_WE))
        live.SetTransform("/desired/point", RigidTransform(seen))
        if self._contact is None:
            live.SetTransform("/traced/point", RigidTransform(p_WE))
        else:
            R, scale, pressed = arrow_of(self._contact, session.contact_force())
            live.SetTransform("/force", RigidTransform(R, tool))
            live.SetProperty("/force", "scale", scale)
            live.SetProperty("/force", "visible", pressed)
        if experiment.desired.turns:
            R = RotationMatrix.ProjectToRotationMatrix(R_WE)
            live.SetTransform("/traced/axes", RigidTransform(R, p_WE))
        for number in session.hands.moved_obstacles:
            X = pose_of(experiment.obstacles[number])
            at = X.translation() + session.hands.p_WO(number, session.time)
            live.SetTransform(f"/obstacles/{number}", RigidTransform(X.rotation(), at))
        live.SetProperty(*SAMPLE, [*sample, *tool, *desired])

    def _below(self, p_WE: Array) -> Array:
        """Return where a point is drawn, shape (3,) [m]: on the surface, if there is one."""
        contact = self._contact
        if contact is None:
            return p_WE
        n = contact.normal
        return np.asarray(p_WE - (n.dot(p_WE - contact.p_WS) - _ABOVE) * n)


def _at_start(experiment: Experiment) -> Result:
    """Return a result in which the arm rests where it starts, and the path is passed once."""
    until = experiment.desired.traversal
    time = np.linspace(0.0, until if np.isfinite(until) and until > 0.0 else 1.0, _POINTS)
    axes = list(experiment.task.axes)
    desired = np.array([experiment.desired.position(t)[0][axes] for t in time.tolist()])
    series = {
        "position": np.tile(experiment.start, (_POINTS, 1)),
        "p_WE": np.tile(experiment.p_WE_start[axes], (_POINTS, 1)),
        DESIRED_POSITION: desired,
    }
    if experiment.contact is not None:
        series["contact_force"] = np.zeros((_POINTS, 3))
    return Result(experiment, time, series, {})
