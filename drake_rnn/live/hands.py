"""What hands move in an experiment: the target, obstacles, and the desired force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..environments import Plate
from ..experiment import Experiment
from ..inputs.fields import Array
from ..paths import PlacedPath, Rest
from ..systems import Contact, ObstacleMotions
from .controls import Handle
from .handled_force import HandledForce, LaterForce
from .handled_path import HandledPath, Later

#: Names of the handles of the target and, before its number, of an obstacle.
TARGET, OBSTACLE = "target", "obstacle "

# Bounds of the target's displacement by hand [m/s, m/s^2], and of an obstacle's acceleration.
_FASTEST, _MOST, _OF_OBSTACLE = 0.25, 1.0, 2.0
# Share of the speed that is counted on at which an obstacle is led.
_SHARE = 0.9
# The ball in which things may be dragged reaches this much beyond the path, seen from the base [m].
_BEYOND = 0.6
# How near to a plate's edge the target may come [m].
_EDGE = 0.01


class Hands:
    """What is led by hand through an experiment, written up to a time that grows.

    Args:
        experiment: The experiment, or a variant of it.
    """

    def __init__(self, experiment: Experiment) -> None:
        self.target = HandledPath(experiment.desired, _FASTEST, _MOST)
        self._follows = experiment.law.follows_position
        self._contact = experiment.contact
        self._p_WS = np.zeros(3)
        self.force: HandledForce | None = None
        if experiment.contact is not None:
            self._p_WS = experiment.contact.place(experiment.arm, experiment.start)
            self.force = HandledForce(experiment.contact.force)
        self.obstacles = _handled_obstacles(experiment)
        self._errors = None if experiment.motions is None else experiment.motions.errors
        self._places = _places_of_obstacles(experiment)
        points = experiment.desired.sample(100)
        farthest = float(np.linalg.norm(points, axis=1).max())
        self._reach = farthest + _BEYOND

    @property
    def handles(self) -> dict[str, Handle]:
        """What a page may drag, by name."""
        middle = (0.0, 0.0, 0.0)
        found = {}
        if self._follows:
            found[TARGET] = Handle("target", middle, self._reach, "/desired/point")
        for number, (name, _) in self._places.items():
            place = f"/obstacles/{number}"
            found[f"{OBSTACLE}{number}"] = Handle(name, middle, self._reach, place)
        return found

    def drag(self, name: str, point: Array) -> None:
        """Lead what a handle belongs to towards a point, shape (3,) [m]."""
        if name == TARGET:
            self.target.hold(self._on_surface(point))
            return
        _, (path, begin) = self._places[int(name.removeprefix(OBSTACLE))]
        self.obstacles[path].hold(point - begin)

    def go_on(self, until: float) -> None:
        """Write how everything goes on up to a time [s]."""
        for each in (self.target, *self.obstacles.values(), self.force):
            if each is not None:
                each.go_on(until)

    def forget(self, before: float) -> None:
        """Forget what was before a time [s]."""
        for each in (self.target, *self.obstacles.values(), self.force):
            if each is not None:
                each.forget(before)

    def led(self, experiment: Experiment, begin: float) -> Experiment:
        """Return an experiment that is led by hand, whose time 0 is a time of the session [s]."""
        contact = experiment.contact
        if contact is not None and self.force is not None:
            force = LaterForce(self.force, begin)
            contact = PlacedContact(contact.surface, force, contact.sensor, self._p_WS)
        motions = self.motions(experiment.motions, begin)
        desired = Later(self.target, begin)
        return replace(experiment, desired=desired, contact=contact, motions=motions)

    def motions(self, own: ObstacleMotions | None, begin: float) -> ObstacleMotions | None:
        """Return how obstacles move, whose time 0 is a time of the session [s]."""
        if own is None:
            return None
        led: list[PlacedPath | None] = [
            Later(self.obstacles[k], begin) if k in self.obstacles else None
            for k in range(len(own.paths))
        ]
        return PlacedMotions(tuple(led), own.errors)

    def p_WO(self, number: int, t: float) -> Array:
        """Return how far an obstacle has gone by a time [s], by its number in the document."""
        _, (path, _) = self._places[number]
        return self.obstacles[path].position(t)[0]

    @property
    def moved_obstacles(self) -> list[int]:
        """Numbers in the document of the obstacles that may move."""
        return list(self._places)

    def _on_surface(self, point: Array) -> Array:
        """Return the point of the path's plane, along the surface, nearest to a point."""
        if self._contact is None:
            return point
        surface = self._contact.surface
        n, on = surface.normal_W, self.target.own.position(0.0)[0]
        point = point - n.dot(point - on) * n
        if not isinstance(surface, Plate):
            return point
        X_WP = surface.pose(self._p_WS)
        R, half = X_WP.rotation().matrix(), surface.size / 2.0 - _EDGE
        p_P = R.T @ (point - X_WP.translation())
        p_P[:2] = np.clip(p_P[:2], -half, half)
        return np.asarray(R @ p_P + X_WP.translation())


class PlacedContact(Contact):
    """A contact with a surface that stays where it was placed, wherever an arm begins.

    Args:
        surface, force, sensor: See `Contact`.
        p_WS: Point of the surface below the tool, shape (3,) [m].
    """

    def __init__(self, surface: object, force: object, sensor: object, p_WS: Array) -> None:
        super().__init__(surface, force, sensor)  # type: ignore[arg-type]
        object.__setattr__(self, "_p_WS", p_WS)

    def place(self, arm: object, start: Array) -> Array:
        """See `Contact.place`."""
        p_WS: Array = vars(self)["_p_WS"]
        return p_WS


class PlacedMotions(ObstacleMotions):
    """Motions that are displacements themselves, from where obstacles are stated to be."""

    def at(self, t: float) -> Array:
        """See `ObstacleMotions.at`."""
        rest = np.zeros(3)
        return np.array([rest if path is None else path.position(t)[0] for path in self.paths])


def _handled_obstacles(experiment: Experiment) -> dict[int, HandledPath]:
    """Return what leads each obstacle that may move, by its number among these."""
    if experiment.motions is None or experiment.clearance is None:
        return {}
    found = {}
    speeds = _speeds(experiment)
    for k, path in enumerate(experiment.motions.paths):
        own: PlacedPath = Rest().placed(np.zeros(3)) if path is None else Begun(path)
        bound = _SHARE * speeds[k]
        found[k] = HandledPath(own, bound, _OF_OBSTACLE, by_turns=path is not None)
    return found


class Begun(Later):
    """A path as a displacement from where it begins."""

    def __init__(self, own: PlacedPath) -> None:
        super().__init__(own, 0.0)
        self._from = own.position(0.0)[0]

    def position(self, t: float) -> tuple[Array, Array, Array]:
        """See `PlacedPath.position`."""
        p, v, a = self.own.position(t)
        return p - self._from, v, a


def _speeds(experiment: Experiment) -> list[float]:
    """Return the speeds that are counted on, in the order of the obstacles' signal [m/s]."""
    assert experiment.clearance is not None
    solids = experiment.clearance.solids
    speed = {each.name: each.speed or 0.0 for each in experiment.obstacles}
    return [speed[solids.names[k]] for k in solids.moving]


def _places_of_obstacles(experiment: Experiment) -> dict[int, tuple[str, tuple[int, Array]]]:
    """Return name, number of the motion, and middle [m], by number of those that may move."""
    if experiment.clearance is None or experiment.motions is None:
        return {}
    solids = experiment.clearance.solids
    corners = {obstacle.name: obstacle.corners for obstacle in experiment.obstacles}
    moving = {solids.names[k]: m for m, k in enumerate(solids.moving)}
    found = {}
    # Of what a model's file holds, a hand moves nothing.
    for number, given in enumerate(experiment.document.obstacles or []):
        name = given.get("name", f"{given['kind']} {number + 1}")
        if name in moving and len(corners[name]):
            found[number] = (name, (moving[name], corners[name].mean(axis=0)))
    return found
