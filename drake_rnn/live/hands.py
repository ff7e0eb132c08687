"""What hands move in an experiment: the target, obstacles, and the desired force.

- A desired force that is set while it is pressed with.
- The path of a point that a hand leads away from the path that it follows by itself.
- A motion that is written piece by piece while it is followed.
- Points that go where they are wished to be, at a bounded speed and a bounded acceleration.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import replace
from math import sqrt

import numpy as np

from ..environments import Plate
from ..experiment import Experiment
from ..features.contact import Contact, ForceProfile
from ..features.obstacles import ObstacleMotions
from ..inputs.fields import Array
from ..paths import PlacedPath, Rest
from ..paths.path import Motion, PathOfAnother
from .controls import Handle

# Pieces that are forgotten together.
_MANY = 256


class Course:
    """A motion in pieces of constant acceleration, written up to a time that only grows.

    What has been written never changes, so values at times before `until` are those of a function
    of time. Beyond, the last piece goes on, which matters for rounding errors of a time alone.

    Args:
        value: Value at time 0, shape (k,).
        rate: Its rate from then on, shape (k,) [1/s]; zero if None.
    """

    def __init__(self, value: Array, rate: Array | None = None) -> None:
        self.until = 0.0
        p = np.array(value, dtype=float)
        v = np.zeros_like(p) if rate is None else np.array(rate, dtype=float)
        self._begins, self._pieces = [0.0], [(p, v, np.zeros_like(p))]

    def at(self, t: float) -> tuple[Array, Array, Array]:
        """Return value, rate and acceleration at a time [s]; at rest before the first piece."""
        k = bisect_right(self._begins, t) - 1
        p, v, a = self._pieces[max(k, 0)]
        if k < 0:
            return p, np.zeros_like(p), np.zeros_like(p)
        since = t - self._begins[k]
        return p + since * v + 0.5 * since**2 * a, v + since * a, a

    def go_on(self, until: float, acceleration: Array) -> None:
        """Write the next piece, up to a later time [s].

        Args:
            until: Time at which it ends [s].
            acceleration: Its acceleration, shape (k,) [1/s^2].
        """
        p, v, a = self.at(self.until)
        # A motion that goes on as it was is one piece, exact however long it takes.
        if np.any(acceleration != 0.0) or np.any(a != 0.0):
            self._begins.append(self.until)
            self._pieces.append((p, v, np.array(acceleration, dtype=float)))
        self.until = until

    def forget(self, before: float) -> None:
        """Forget the pieces that end before a time [s], which is not asked for again."""
        k = bisect_right(self._begins, before) - 1
        if k >= _MANY:
            del self._begins[:k], self._pieces[:k]


def shaped_acceleration(away: Array, v: Array, bounds: tuple[float, float], step: float) -> Array:
    """Return the acceleration with which a point is led towards a place for one step.

    It is led straight there at the largest speed from which it can still stop in time; of the
    change of the velocity no more is made than the bound of the acceleration allows. As a ball is
    convex, a velocity within the bound stays within it.

    Args:
        away: The way to the place, shape (k,) [m].
        v: Velocity until now, shape (k,) [m/s].
        bounds: Bounds of speed and acceleration [m/s, m/s^2].
        step: Time for which the acceleration is held [s].
    """
    fastest, most = bounds
    distance = float(np.linalg.norm(away))
    # The speed from which steps of deceleration lead to rest within the distance, and not beyond.
    loss = most * step
    speed = loss * (sqrt(0.25 + 2.0 * distance / (loss * step)) - 0.5) if distance else 0.0
    speed = min(fastest, speed, distance / step)
    change = (speed / distance * away if distance else np.zeros_like(away)) - v
    size = float(np.linalg.norm(change))
    return np.asarray(change * (min(1.0, loss / size) if size else 0.0) / step)


class ShapedPoint:
    """A point that goes towards a place that may jump.

    Args:
        place: Where it is at time 0, shape (k,) [m].
        fastest: Bound of its speed [m/s].
        most: Bound of its acceleration [m/s^2].
    """

    def __init__(self, place: Array, fastest: float, most: float) -> None:
        self.course = Course(place)
        self.wish = np.array(place, dtype=float)
        self._bounds = (fastest, most)

    def go_on(self, until: float) -> None:
        """Write how it goes on up to a time [s]."""
        step = until - self.course.until
        p, v, _ = self.course.at(self.course.until)
        # Where it will be half a step later decides: the velocity changes during the step.
        a = shaped_acceleration(self.wish - p - 0.5 * step * v, v, self._bounds, step)
        self.course.go_on(until, a)

    def stay(self) -> None:
        """Wish to be where it can stop soonest."""
        p, v, _ = self.course.at(self.course.until)
        self.wish = p + 0.5 * v * float(np.linalg.norm(v)) / self._bounds[1]


# Bounds of the rate of the force and of its change, as shares of the force at the start a second.
_RATE, _CHANGE = 2.0, 20.0


class HandledForce(ForceProfile):
    """A pressing force that follows a document's profile, and then what it is set to.

    Args:
        own: The document's profile.
    """

    def __init__(self, own: ForceProfile) -> None:
        # Where there is a time in which it rises, blocks read it at every time.
        super().__init__(value=own.value, rise_time=own.rise_time or 1.0, initial=own.initial)
        scale = max(own.value, own.initial)
        more = ShapedPoint(np.zeros(1), _RATE * scale, _CHANGE * scale)
        object.__setattr__(self, "_own", own)
        object.__setattr__(self, "_more", more)

    def at(self, t: float) -> float:
        """Return the desired force [N] at time ``t`` [s]."""
        return self._profile.at(t) + float(self._point.course.at(t)[0][0])

    def set(self, value: float) -> None:
        """Lead the force to a value [N], at a bounded rate."""
        self._point.wish = np.array([value - self._profile.value])

    def go_on(self, until: float) -> None:
        """Write how it goes on up to a time [s]."""
        self._point.go_on(until)

    def forget(self, before: float) -> None:
        """Forget what was before a time [s]."""
        self._point.course.forget(before)

    @property
    def _profile(self) -> ForceProfile:
        profile: ForceProfile = vars(self)["_own"]
        return profile

    @property
    def _point(self) -> ShapedPoint:
        point: ShapedPoint = vars(self)["_more"]
        return point


class LaterForce(ForceProfile):
    """A force, of which time 0 is a later time of another one.

    Args:
        whole: The other force.
        begin: That time [s].
    """

    def __init__(self, whole: HandledForce, begin: float) -> None:
        super().__init__(value=whole.value, rise_time=whole.rise_time, initial=whole.initial)
        object.__setattr__(self, "_at", lambda t: whole.at(begin + t))

    def at(self, t: float) -> float:
        """Return the desired force [N] at time ``t`` [s]."""
        return float(vars(self)["_at"](t))


# How fast the point's own path is left and joined: of the rate at which time passes on it [1/s].
_LETTING_GO = 2.0


class HandledPath(PathOfAnother):
    r"""A path as it is followed by itself, and displaced by hand.

    The desired point is p(s(t)) + d(t) with the path p, its clock s, and a displacement d of
    bounded speed and acceleration. While it is held s comes to rest, and d leads to the hand; once
    it follows its path again, d returns to zero. It is written up to a time, see `Course`; as long
    as nobody touches it, s = t and d = 0, to the last bit.

    Args:
        own: The path.
        fastest: Bound of the speed of d [m/s].
        most: Bound of its acceleration [m/s^2].
        by_turns: Whether d changes only while s rests, so that the point is never faster than the
            path and the hand are each by themselves.
    """

    def __init__(
        self, own: PlacedPath, fastest: float, most: float, *, by_turns: bool = False
    ) -> None:
        self.own = own
        self._clock = Course(np.zeros(1), np.ones(1))
        self._away = ShapedPoint(np.zeros(3), fastest, most)
        self._by_turns = by_turns
        self.held: Array | None = None
        self.moves = True

    @property
    def until(self) -> float:
        """Time up to which it is written [s]."""
        return self._clock.until

    def hold(self, point: Array) -> None:
        """Lead the point to a place, shape (3,) [m], and keep it there."""
        self.held, self.moves = np.array(point, dtype=float), False

    def stay(self) -> None:
        """Bring the point to rest where it is."""
        self._away.stay()
        p, _, _ = self.own.position(self._s(self.until))
        self.hold(p + self._away.wish)

    def follow(self) -> None:
        """Lead the point back to its path, and along it."""
        self.held, self.moves = None, True

    def go_on(self, until: float) -> None:
        """Write how it goes on up to a later time [s]."""
        step = until - self.until
        rate = float(self._clock.at(self.until)[1][0])
        waits = self._by_turns and not self._is_back
        aim = 1.0 if self.moves and not waits else 0.0
        change = float(np.clip(aim - rate, -_LETTING_GO * step, _LETTING_GO * step))
        self._clock.go_on(until, np.array([change / step]))
        if self._by_turns and rate > 0.0:
            self._away.wish = np.array(self._away.course.at(self.until)[0])
        elif self.held is None:
            self._away.wish = np.zeros(3)
        else:
            self._away.wish = self.held - self.own.position(self._s(until))[0]
        self._away.go_on(until)

    def forget(self, before: float) -> None:
        """Forget what was before a time [s]."""
        self._clock.forget(before)
        self._away.course.forget(before)

    @property
    def _is_back(self) -> bool:
        d, v, _ = self._away.course.at(self.until)
        return self.held is None and not d.any() and not v.any()

    def _s(self, t: float) -> float:
        return float(self._clock.at(t)[0][0])

    @property
    def duration(self) -> float:
        """Infinite; see `Passage.duration`."""
        return np.inf

    def position(self, t: float) -> Motion:
        """See `PlacedPath.position`."""
        s, rate, change = (float(value[0]) for value in self._clock.at(t))
        p, v, a = self.own.position(s)
        d, d_v, d_a = self._away.course.at(t)
        return p + d, rate * v + d_v, rate**2 * a + change * v + d_a

    def orientation(self, t: float) -> Motion:
        """See `PlacedPath.orientation`."""
        s, rate, change = (float(value[0]) for value in self._clock.at(t))
        R, w, alpha = self.own.orientation(s)
        return R, rate * w, rate**2 * alpha + change * w


class Later(PathOfAnother):
    """A path, of which time 0 is a later time of another one.

    Args:
        own: The other path.
        begin: That time [s].
    """

    def __init__(self, own: PlacedPath, begin: float) -> None:
        self.own, self.begin = own, begin

    @property
    def duration(self) -> float:
        """See `Passage.duration`."""
        return self.own.duration - self.begin

    def position(self, t: float) -> Motion:
        """See `PlacedPath.position`."""
        return self.own.position(self.begin + t)

    def orientation(self, t: float) -> Motion:
        """See `PlacedPath.orientation`."""
        return self.own.orientation(self.begin + t)


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
        sources = {}
        if self._follows:
            sources[TARGET] = Handle("target", middle, self._reach, "/desired/point")
        for number, (name, _) in self._places.items():
            place = f"/obstacles/{number}"
            sources[f"{OBSTACLE}{number}"] = Handle(name, middle, self._reach, place)
        return sources

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

    def lead(self, experiment: Experiment, begin: float) -> Experiment:
        """Return an experiment that is led by hand, whose time 0 is a time of the session [s]."""
        contact = experiment.contact
        if contact is not None and self.force is not None:
            force = LaterForce(self.force, begin)
            contact = PlacedContact(contact.surface, force, contact.sensor, self._p_WS)
        motions = self.motions(experiment.motions, begin)
        target_path = Later(self.target, begin)
        return replace(experiment, desired=target_path, contact=contact, motions=motions)

    def motions(self, own: ObstacleMotions | None, begin: float) -> ObstacleMotions | None:
        """Return how obstacles move, whose time 0 is a time of the session [s]."""
        if own is None:
            return None
        paths: list[PlacedPath | None] = [
            Later(self.obstacles[k], begin) if k in self.obstacles else None
            for k in range(len(own.paths))
        ]
        return PlacedMotions(tuple(paths), own.errors)

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
    obstacles = {}
    speeds = _speeds(experiment)
    for k, path in enumerate(experiment.motions.paths):
        own: PlacedPath = Rest().placed(np.zeros(3)) if path is None else PathFromStart(path)
        bound = _SHARE * speeds[k]
        obstacles[k] = HandledPath(own, bound, _OF_OBSTACLE, by_turns=path is not None)
    return obstacles


class PathFromStart(Later):
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
    obstacles = {}
    # Of what a model's file holds, a hand moves nothing.
    for number, value in enumerate(experiment.document.obstacles or []):
        name = value.get("name", f"{value['kind']} {number + 1}")
        if name in moving and len(corners[name]):
            obstacles[number] = (name, (moving[name], corners[name].mean(axis=0)))
    return obstacles
