"""An arm as a product of exponentials: numbers that need no Drake, for one robot or for many.

Pose and Jacobians of an arm whose joints have moved, in arrays of NumPy or of JAX.

Inside, robots are last, see `drake_rnn.arrays.algebra.robots_last`, and a vector is a triple of
coordinates, each a number or an array with an entry for each robot. All is written in elementwise
operations: a matrix product over robots would add up in an order that depends on their number.

The coordinates of an arm at rest are mostly 0 and 1. What is exactly 0 or 1 as a number costs no
arithmetic, which leaves every sum its bits. JAX's compiler makes short loops of coordinates that
are apart, and computes what several of them need several times over, which does little harm as
long as most are 0 or 1: see `dot`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..arrays.algebra import AnyArray, functions_of, namespace, robots_first, robots_last
from ..errors import InvalidInputError
from ..inputs.fields import (
    Array,
    checked,
    instance,
    number,
    whole,
)
from ..inputs.messages import require_several, require_type
from .rotation import frame_about, product, rotation_by, times
from .task_frame import ToolFrame, Tools, pose_of

Triple = tuple[Any, Any, Any]
#: Columns.
Matrix = tuple[Triple, Triple, Triple]

ZERO: Triple = (0.0, 0.0, 0.0)
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def constant(vector: AnyArray) -> Triple:
    """Return the coordinates of a constant vector, shape (3, ...); numbers where robots agree."""
    x, y, z = (_number(coordinate) for coordinate in vector)
    return x, y, z


def _number(coordinate: AnyArray) -> Any:
    if not isinstance(coordinate, (float, np.ndarray)) or not np.size(coordinate):
        return coordinate
    first = float(np.ravel(coordinate)[0])
    return first if np.all(coordinate == first) else coordinate


def constant_matrix(array: AnyArray) -> Matrix:
    """Return the entries of a constant matrix, shape (3, 3, ...)."""
    x, y, z = (constant(column) for column in array.swapaxes(0, 1))
    return x, y, z


def times_by_entries(a: Any, b: Any) -> Any:
    """Return the product of two coordinates."""
    if isinstance(a, float):
        if a == 0.0:
            return 0.0
        if a == 1.0:
            return b
        if a == -1.0:
            return -b
    if isinstance(b, float) and b in (0.0, 1.0):
        return a if b else 0.0
    return a * b


def plus(a: Any, b: Any) -> Any:
    """Return the sum of two coordinates."""
    if isinstance(a, float) and a == 0.0:
        return b
    if isinstance(b, float) and b == 0.0:
        return a
    return a + b


def minus(a: Any, b: Any) -> Any:
    """Return the difference of two coordinates."""
    if isinstance(b, float) and b == 0.0:
        return a
    return -b if isinstance(a, float) and a == 0.0 else a - b


def add(a: Triple, b: Triple) -> Triple:
    """Return the sum of two vectors."""
    return plus(a[0], b[0]), plus(a[1], b[1]), plus(a[2], b[2])


def subtract(a: Triple, b: Triple) -> Triple:
    """Return the difference of two vectors."""
    return minus(a[0], b[0]), minus(a[1], b[1]), minus(a[2], b[2])


def scale(factor: Any, a: Triple) -> Triple:
    """Return a vector times a number."""
    return (
        times_by_entries(factor, a[0]),
        times_by_entries(factor, a[1]),
        times_by_entries(factor, a[2]),
    )


def cross(a: Triple, b: Triple) -> Triple:
    """Return the cross product of two vectors."""
    return (
        minus(times_by_entries(a[1], b[2]), times_by_entries(a[2], b[1])),
        minus(times_by_entries(a[2], b[0]), times_by_entries(a[0], b[2])),
        minus(times_by_entries(a[0], b[1]), times_by_entries(a[1], b[0])),
    )


def product_by_entries(R: Matrix, a: Triple) -> Triple:
    """Return a matrix times a vector."""
    x, y, z = R
    return add(add(scale(a[0], x), scale(a[1], y)), scale(a[2], z))


def is_full(columns: Matrix) -> bool:
    """Return whether no entry of a constant matrix is exactly 0 for all robots."""
    return not any(isinstance(c, float) and c == 0.0 for column in columns for c in column)


def dot(
    xp: Any, R: Sequence[Triple], columns: Sequence[Triple], robots: tuple[int, ...]
) -> list[Triple]:
    """Return a matrix times vectors, for JAX: its compiler computes a matrix product only once.

    In NumPy the sums of a matrix product might depend on the number of robots.
    """
    A, B = (robots_first(matrix(xp, list(zip(*m, strict=True)), robots), 2) for m in (R, columns))
    AB = A @ B
    return [(AB[..., 0, k], AB[..., 1, k], AB[..., 2, k]) for k in range(len(columns))]


def matrix(xp: Any, rows: Sequence[Sequence[Any]], robots: tuple[int, ...]) -> AnyArray:
    """Return a matrix of coordinates as an array with robots last, shape (rows, columns, ...)."""
    if xp is np:
        array = np.empty((len(rows), len(rows[0]), *robots))
        for i, row in enumerate(rows):
            for j, entry in enumerate(row):
                array[i, j] = entry
        return array
    # Rows of their own: XLA then computes only those that are used.
    return xp.stack([xp.stack([xp.broadcast_to(entry, robots) for entry in row]) for row in rows])


class Link(NamedTuple):
    """A joint and what leads to it: constants in the frame of the joint before, or in W.

    A joint's frame moves with it; its z axis is that of the joint.

    Attributes:
        offset: To the origin of the joint's frame [m].
        turn: Orientation of the joint's frame where the joint is at zero.
        slides: Whether it is prismatic.
        column: Entry of the joint positions that moves it.
    """

    offset: Triple
    turn: Matrix
    slides: bool
    column: int


class Home(NamedTuple):
    """An arm: its joints and its task frame E.

    Attributes:
        links: The joints, from the base on.
        offset: From the origin of the last joint's frame to that of E, in that frame [m].
        turn: Orientation of E in that frame.
        n: Number of joint positions.
        robots: Shape of the axes of robots.
    """

    links: Sequence[Link]
    offset: Triple
    turn: Matrix
    n: int
    robots: tuple[int, ...]


class _Chain(NamedTuple):
    """The moved axes, a point on each, the last joint's orientation, and the origin of E."""

    axes: list[Triple]
    points: list[Triple]
    R: Matrix
    end: Triple


class MovedScrews:
    """Pose and Jacobians of an arm's task frame E at joint positions, computed when asked for.

    W is the world frame. Made by `drake_rnn.robot.screws.Screws.at`, which says how arrays lie.

    Args:
        home: The arm.
        q: Joint positions, shape (..., n) [rad, or m of a joint that slides].

    Raises:
        InvalidInputError: If ``q`` is no array of float64 of that shape.
    """

    #: It has one tool.
    tools: None = None

    def __init__(self, home: Home, q: AnyArray) -> None:
        self._home = home
        self._xp = namespace("position", q)
        self._q = self._of_joints("position", q)
        self._robots: tuple[int, ...] = self._q.shape[1:]

    @cached_property
    def p_WE(self) -> AnyArray:
        """Position of E's origin, shape (..., 3) [m]."""
        return self._array((self._chain.end,))[..., 0]

    @cached_property
    def R_WE(self) -> AnyArray:
        """Orientation of E, shape (..., 3, 3)."""
        R = self._chain.R
        return self._array([product_by_entries(R, column) for column in self._home.turn])

    @cached_property
    def J(self) -> AnyArray:
        """Jacobian of E's origin, shape (..., 3, n) [m, or 1 of a joint that slides]."""
        return self._array(self._of_every_joint(self._J_columns))

    @cached_property
    def J_omega(self) -> AnyArray:
        """Jacobian of E's angular velocity, shape (..., 3, n)."""
        return self._array(self._of_every_joint(self._J_omega_columns))

    def Jdot_v(self, v: AnyArray) -> AnyArray:
        """Return the part of E's acceleration not due to joint accelerations, (..., 3) [m/s^2].

        Args:
            v: Joint velocities, shape (..., n) [rad/s, or m/s], for each of the robots.

        Raises:
            InvalidInputError: If ``v`` is no array of float64 of that shape.
        """
        namespace("velocity", v)
        rates = self._of_joints("velocity", v)
        if rates.shape[1:] != self._robots:
            raise InvalidInputError(
                f"velocity: must be given for each posture, {(*self._robots, self._home.n)}, not "
                f"{tuple(v.shape)}"
            )
        # Column i of J changes with joint k by the cross product of column k of J_omega with it,
        # for k up to i, and as much as column k with joint i.
        bias, twice_before = ZERO, ZERO
        for link, turning, column in zip(
            self._home.links, self._J_omega_columns, self._J_columns, strict=True
        ):
            rate = rates[link.column]
            spin = scale(rate, turning)
            bias = add(bias, cross(add(twice_before, spin), scale(rate, column)))
            twice_before = add(twice_before, scale(2.0, spin))
        return self._array((bias,))[..., 0]

    @cached_property
    def _chain(self) -> _Chain:
        sines, cosines = self._xp.sin(self._q), self._xp.cos(self._q)
        R, end = IDENTITY, ZERO
        axes, points = [], []
        for link in self._home.links:
            step, R = self._next(R, link, sines[link.column], cosines[link.column])
            end = add(end, step)
            points.append(end)
            axes.append(R[2])
            if link.slides:
                end = add(end, scale(self._q[link.column], R[2]))
        return _Chain(axes, points, R, add(end, product_by_entries(R, self._home.offset)))

    def _next(
        self, R: Matrix, link: Link, sine: AnyArray, cosine: AnyArray
    ) -> tuple[Triple, Matrix]:
        """Return the way from a joint to the next one, and that one's frame, as seen from W."""
        if self._xp is not np and R is not IDENTITY and is_full(link.turn):
            # As one product of matrices, so that it is computed once.
            turn = link.turn if link.slides else _spun(link.turn, sine, cosine)
            step, x, y, z = dot(self._xp, R, (link.offset, *turn), self._robots)
            return step, (x, y, z)
        x, y, z = link.turn
        frame = product_by_entries(R, x), product_by_entries(R, y), product_by_entries(R, z)
        return product_by_entries(R, link.offset), frame if link.slides else _spun(
            frame, sine, cosine
        )

    @cached_property
    def _J_columns(self) -> list[Triple]:
        """Columns of J for the joints between base and E."""
        chain = self._chain
        return [
            axis if link.slides else cross(axis, subtract(chain.end, point))
            for link, axis, point in zip(self._home.links, chain.axes, chain.points, strict=True)
        ]

    @property
    def _J_omega_columns(self) -> list[Triple]:
        """Columns of J_omega for the joints between base and E."""
        links, axes = self._home.links, self._chain.axes
        return [ZERO if link.slides else axis for link, axis in zip(links, axes, strict=True)]

    def _of_every_joint(self, columns: Sequence[Triple]) -> Sequence[Triple]:
        """Return columns for all joint positions from those of the joints between base and E."""
        every = [ZERO] * self._home.n
        for link, column in zip(self._home.links, columns, strict=True):
            every[link.column] = column
        return every

    def _of_joints(self, name: str, values: AnyArray) -> AnyArray:
        """Return values of all joints with robots last, shape (n, ...)."""
        n, robots = self._home.n, self._home.robots
        if values.ndim == 0 or values.shape[-1] != n:
            raise InvalidInputError(
                f"{name}: must have shape (..., {n}), not {tuple(values.shape)}"
            )
        if robots:
            values = self._xp.broadcast_to(values, (*self._all_robots(name, values), n))
        return robots_last(values, 1)

    def _all_robots(self, name: str, values: AnyArray) -> tuple[int, ...]:
        lead, robots = values.shape[:-1], self._home.robots
        try:
            return np.broadcast_shapes(lead, robots)
        except ValueError:
            raise InvalidInputError(
                f"{name}: is for robots of shape {tuple(lead)}, but the arms are of {robots}"
            ) from None

    def _array(self, columns: Sequence[Triple]) -> AnyArray:
        """Return a matrix of these columns, shape (..., 3, k)."""
        rows = list(zip(*columns, strict=True))
        return robots_first(matrix(self._xp, rows, self._robots), 2)


def _spun(turn: Matrix, sine: AnyArray, cosine: AnyArray) -> Matrix:
    """Return an orientation after a turn about its own z axis."""
    x, y, z = turn
    return (
        add(scale(cosine, x), scale(sine, y)),
        subtract(scale(cosine, y), scale(sine, x)),
        z,
    )


# How many axes of an array are the arm's; those before them are robots.
_ARRAYS = {"axes": 2, "offsets": 2, "R_WE": 2, "R_WF": 3}


@dataclass(frozen=True, eq=False)
class Screws:
    """An arm's joints and its task frame E where all joints are at zero, in the world frame W.

    The pose of E is a product of exponentials (R. W. Brockett, "Robotic manipulators and the
    product of exponentials formula", 1984): each joint turns or slides all that comes after it.
    `drake_rnn.robot.load_arm.screws_of` makes it from an arm.

    Leading axes are robots. Fields without them are of one arm that all robots share, fields with
    them give each robot its own: `side_by_side`, `LinkErrors`. They are broadcast
    against those of the joint positions. Only the order of the joints and whether they turn or
    slide are the same for all. ::

        screws = screws_of(load_arm("panda"))
        moved = screws.at(q)             # q of shape (..., n), of NumPy or of JAX
        moved.p_WE, moved.J              # shapes (..., 3) and (..., 3, n)
        moved.Jdot_v(v)                  # shape (..., 3)

    Results are computed when they are requested, and the pass through the joints is made once for
    each `at`: p_WE takes that pass, R_WE, J and J_omega add little, Jdot_v adds half of it again.
    In NumPy a robot's numbers have the same bits alone as among any others, also beside robots with
    arms of their own. JAX's compiler chooses its own order of summation.

    In memory, robots lie side by side in results, which are views: elementwise operations on them
    are fastest and keep that order, and positions that lie so are not copied. A matrix product of
    NumPy may add up such views otherwise than those of one robot; sums of products, one term after
    the other, do not. About a thousand robots at a time fit the cache of a processor.

    In JAX, close over the screws. For derivatives with respect to their fields make them inside of
    the function, by `dataclasses.replace`. Masses play no part.

    Attributes:
        axes: Unit axes of the k joints between base and E, from the base on, shape (..., k, 3).
        offsets: From W's origin to a point of the first axis, from there to one of the next, and so
            on; the last one leads to E. Shape (..., k + 1, 3) [m].
        R_WE: Orientation of E, shape (..., 3, 3).
        R_WF: Orientations of the joints' own frames, in which errors of the links are given, shape
            (..., k, 3, 3).
        slides: For each of the k joints, whether it is prismatic.
        columns: For each of them, which entry of the joint positions moves it.
        n: Number of joint positions; those that move none of the k joints do not move E.

    Raises:
        InvalidInputError: If shapes do not fit together.
    """

    axes: AnyArray
    offsets: AnyArray
    R_WE: AnyArray
    R_WF: AnyArray
    slides: tuple[bool, ...]
    columns: tuple[int, ...]
    n: int

    def __post_init__(self) -> None:
        k = len(self.slides)
        for name, array, shape in (
            ("axes", self.axes, (k, 3)),
            ("offsets", self.offsets, (k + 1, 3)),
            ("R_WE", self.R_WE, (3, 3)),
            ("R_WF", self.R_WF, (k, 3, 3)),
        ):
            if array.shape[-len(shape) :] != shape:
                shape_text = ", ".join(map(str, shape))
                raise InvalidInputError(
                    f"screws.{name}: must have shape (..., {shape_text}), not {array.shape}"
                )

    def at(self, q: AnyArray) -> MovedScrews:
        """Return pose and Jacobians of E at joint positions, computed when asked for.

        Args:
            q: Joint positions, shape (..., n) [rad, or m of a joint that slides].

        Raises:
            InvalidInputError: If ``q`` is no array of float64 of that shape.
        """
        return MovedScrews(self._home, q)

    @property
    def robots(self) -> tuple[int, ...]:
        """Shape of the leading axes; () if all robots share one arm."""
        fields = (self.axes.shape[:-2], self.offsets.shape[:-2], self.R_WE.shape[:-2])
        return np.broadcast_shapes(*fields)

    def of(self, robot: int) -> Screws:
        """Return the arm of one of the robots along the only leading axis, or the shared arm.

        Raises:
            InvalidInputError: If there is no such robot.
        """
        if self.robots and not 0 <= robot < self.robots[0]:
            raise InvalidInputError(f"robot: may be 0 to {self.robots[0] - 1}, not {robot}")
        own: dict[str, Any] = {
            name: array[robot]
            for name, axes in _ARRAYS.items()
            if (array := self.__dict__[name]).ndim > axes
        }
        return replace(self, **own)

    @cached_property
    def _home(self) -> Home:
        """The same in frames whose z axes are those of the joints: to turn about z costs least."""
        links = []
        # The frame of the joint before, seen from W, where all joints are at zero.
        Q = np.eye(3)
        for i, (slides, column) in enumerate(zip(self.slides, self.columns, strict=True)):
            offset, frame = self.offsets[..., i, :], frame_about(self.axes[..., i, :])
            links.append(Link(_view(Q, offset), _turn(Q, frame), slides, column))
            Q = frame
        offset = _view(Q, self.offsets[..., -1, :])
        return Home(links, offset, _turn(Q, self.R_WE), self.n, self.robots)


class MovedPair:
    """Pose and Jacobians of the frame E of two tools at joint positions, as of `MovedScrews`.

    Args:
        pair: The tools.
        q: Joint positions, shape (..., n) [rad, or m of a joint that slides].
    """

    def __init__(self, pair: PairScrews, q: AnyArray) -> None:
        first, second = (AtPosture(screws.at(q)) for screws in (pair.first, pair.second))
        self.tools = Tools(first, second, pair.task_frame, pair.R_21)
        self._pose = pose_of(self, q)

    @cached_property
    def p_WE(self) -> AnyArray:
        """Position of E, shape (..., 3) [m]."""
        return _stacked(self._pose.p, -1)

    @cached_property
    def R_WE(self) -> AnyArray:
        """Orientation of E, shape (..., 3, 3)."""
        return self._pose.R

    @cached_property
    def J(self) -> AnyArray:
        """Jacobian of E's origin, shape (..., 3, n) [m]."""
        return _stacked(self._pose.J, -2)

    @cached_property
    def J_omega(self) -> AnyArray:
        """Jacobian of E's angular velocity, shape (..., 3, n)."""
        return _stacked(self._pose.J_omega, -2)

    def Jdot_v(self, v: AnyArray) -> AnyArray:
        """Return the part of E's acceleration not due to joint accelerations, (..., 3) [m/s^2]."""
        return _stacked(self._pose.rates(v).a, -1)


def _stacked(three: Sequence[AnyArray], axis: int) -> AnyArray:
    return functions_of(*three).stack(three, axis=axis)


class AtPosture:
    """Kinematics of robots side by side at one posture, as functions of it.

    Args:
        moved: The kinematics.
    """

    def __init__(self, moved: MovedScrews | MovedPair) -> None:
        self._moved, self.tools = moved, moved.tools

    def p_WE(self, q: AnyArray) -> AnyArray:
        """Return the positions, see `MovedScrews.p_WE`."""
        return self._moved.p_WE

    def R_WE(self, q: AnyArray) -> AnyArray:
        """Return the orientations."""
        return self._moved.R_WE

    def J(self, q: AnyArray) -> AnyArray:
        """Return the Jacobians."""
        return self._moved.J

    def J_omega(self, q: AnyArray) -> AnyArray:
        """Return the Jacobians of the angular velocity."""
        return self._moved.J_omega

    def Jdot_v(self, q: AnyArray, v: AnyArray) -> AnyArray:
        """Return the accelerations at constant joint velocities."""
        return self._moved.Jdot_v(v)


@dataclass(frozen=True, eq=False)
class PairScrews:
    """An arm's joints and its two tools, of whose frames one is E; used as `Screws` are.

    Attributes:
        first, second: The joints that lead to each tool.
        task_frame: Which frame is E.
        R_21: See `drake_rnn.robot.task_frame.Tools`, shape (..., 3, 3).
    """

    first: Screws
    second: Screws
    task_frame: ToolFrame
    R_21: Array

    @property
    def slides(self) -> tuple[bool, ...]:
        """For each joint that leads to the first tool, then to the second, whether it slides."""
        return (*self.first.slides, *self.second.slides)

    @property
    def columns(self) -> tuple[int, ...]:
        """For each of them, which entry of the joint positions moves it."""
        return (*self.first.columns, *self.second.columns)

    @property
    def n(self) -> int:
        """Number of joint positions."""
        return self.first.n

    def at(self, q: AnyArray) -> MovedPair:
        """Return pose and Jacobians of E at joint positions, shape (..., n)."""
        return MovedPair(self, q)

    @property
    def robots(self) -> tuple[int, ...]:
        """Shape of the leading axes; () if all robots share one arm."""
        return np.broadcast_shapes(self.first.robots, self.second.robots, self.R_21.shape[:-2])

    def of(self, robot: int) -> PairScrews:
        """Return the arm of one of the robots along the only leading axis, or the shared arm."""
        R_21 = self.R_21 if self.R_21.ndim == 2 else self.R_21[robot]
        first, second = (
            each.of(robot) if each.robots else each for each in (self.first, self.second)
        )
        return PairScrews(first, second, self.task_frame, R_21)


def pairs_side_by_side(arms: Sequence[PairScrews]) -> PairScrews:
    """Return what `side_by_side` does, of arms with two tools.

    Raises:
        InvalidInputError: If the arms differ in number, kind or order of joints.
    """
    first = side_by_side([arm.first for arm in arms])
    second = side_by_side([arm.second for arm in arms])
    return PairScrews(first, second, arms[0].task_frame, np.stack([arm.R_21 for arm in arms]))


def _view(Q: AnyArray, offset: AnyArray) -> Triple:
    return constant(robots_last(times(Q.swapaxes(-1, -2), offset), 1))


def _turn(Q: AnyArray, frame: AnyArray) -> Matrix:
    return constant_matrix(robots_last(product(Q.swapaxes(-1, -2), frame), 2))


def side_by_side(arms: Sequence[Screws]) -> Screws:
    """Return the screws of robots of which each has its own arm, in this order.

    Arms may differ in whatever leaves the order of their joints: tools, frames, joints that are
    held elsewhere, dimensions.

    Args:
        arms: For each robot, the screws of its arm, without leading axes.

    Raises:
        InvalidInputError: If there are none, or they differ in number, kind or order of joints.
    """
    require_several("arms", arms)
    for place, arm in enumerate(arms):
        require_type(f"arms[{place}]", arm, Screws)
        if arm.robots:
            raise InvalidInputError(f"arms[{place}]: must be of one robot, not of {arm.robots}")
        if (arm.slides, arm.columns, arm.n) != (arms[0].slides, arms[0].columns, arms[0].n):
            raise InvalidInputError(
                f"arms[{place}]: must have the joints of arms[0], {_joints(arms[0])}, not "
                f"{_joints(arm)}"
            )
    if not len(arms):
        raise InvalidInputError("arms: must be given")
    together: dict[str, Any] = {
        name: np.stack([arm.__dict__[name] for arm in arms]) for name in _ARRAYS
    }
    return replace(arms[0], **together)


def _joints(arm: Screws) -> str:
    kinds = ("slides" if slides else "turns" for slides in arm.slides)
    columns = zip(arm.columns, kinds, strict=True)
    return f"{arm.n} ({', '.join(f'{column} {kind}' for column, kind in columns)})"


@dataclass(frozen=True, eq=False)
class LinkErrors:
    """Displacements of an arm's joints and of its task frame E, each seen from the link before.

    Row i displaces the i-th joint between base and E, and all that comes after it, and is given in
    the axes of that joint's own frame, as the model states it: in URDF, that of its ``origin``.
    The last row displaces E, in its own axes: the error of a tool. Leading axes are robots.

    Attributes:
        translation: Displacement of the frame's origin, shape (..., k + 1, 3) [m].
        rotation: Rotation about that origin, as a rotation vector, shape (..., k + 1, 3) [rad].

    Raises:
        InvalidInputError: If an array has another shape, or is not finite, or they differ in shape.
    """

    translation: Array
    rotation: Array

    def __post_init__(self) -> None:
        for name in ("translation", "rotation"):
            value = self.__dict__[name]
            require_type(name, value, np.ndarray)
            if value.ndim < 2 or value.shape[-1] != 3 or not np.isfinite(value).all():
                raise InvalidInputError(
                    f"{name}: must be finite, of shape (..., joints + 1, 3), not {value.shape}"
                )
        if self.rotation.shape != self.translation.shape:
            raise InvalidInputError(
                f"rotation: must have the shape of translation, {self.translation.shape}, not "
                f"{self.rotation.shape}"
            )


@checked(
    screws=instance(Screws),
    rng=instance(np.random.Generator),
    robots=whole(0, 10**7),
    translation=number(0.0),
    rotation=number(0.0),
)
def random_link_errors(
    screws: Screws,
    rng: np.random.Generator,
    robots: int,
    translation: float = 0.02,
    rotation: float = float(np.deg2rad(2.0)),
) -> LinkErrors:
    """Return errors for each of a number of robots, uniform and independent in each coordinate.

    A robot's errors do not depend on how many come after it.

    Args:
        screws: The arm without errors.
        rng: Generator of the errors.
        robots: Number of robots.
        translation: Largest error of each coordinate [m].
        rotation: Largest error about each axis [rad].

    Raises:
        InvalidInputError: If a number is negative, or an argument of another class.
    """
    draws = rng.uniform(-1.0, 1.0, (robots, len(screws.slides) + 1, 2, 3))
    return LinkErrors(translation * draws[:, :, 0], rotation * draws[:, :, 1])


def with_link_errors(screws: Screws, errors: LinkErrors) -> Screws:
    """Return an arm whose links have errors, or several of them.

    Args:
        screws: The arm without them; its leading axes and those of the errors are broadcast.
        errors: The errors.

    Raises:
        InvalidInputError: If the errors are for another number of joints, or of robots.
    """
    require_type("screws", screws, Screws)
    require_type("errors", errors, LinkErrors)
    k, translation, turn = len(screws.slides), errors.translation, errors.rotation
    if translation.shape[-2] != k + 1:
        raise InvalidInputError(
            f"errors: must have {k + 1} rows, one for each joint that moves E and one for E, not "
            f"{translation.shape[-2]}"
        )
    try:
        np.broadcast_shapes(screws.robots, translation.shape[:-2])
    except ValueError:
        raise InvalidInputError(
            f"errors: are for robots of shape {translation.shape[:-2]}, but the arms are of "
            f"{screws.robots}"
        ) from None
    # Rotation of the next links relative to the arm without errors.
    R: Array = np.eye(3)
    axes, offsets, frames = [], [], []
    for i in range(k + 1):
        last = i == k
        frame = screws.R_WE if last else screws.R_WF[..., i, :, :]
        shift = screws.offsets[..., i, :] + times(frame, translation[..., i, :])
        offsets.append(times(R, shift))
        R = product(R, rotation_by(times(frame, turn[..., i, :])))
        frames.append(product(R, frame))
        if not last:
            axes.append(times(R, screws.axes[..., i, :]))
    *R_WF, R_WE = np.broadcast_arrays(*frames)
    return replace(
        screws,
        axes=np.stack(np.broadcast_arrays(*axes), axis=-2),
        offsets=np.stack(np.broadcast_arrays(*offsets), axis=-2),
        R_WE=R_WE,
        R_WF=np.stack(R_WF, axis=-3),
    )
