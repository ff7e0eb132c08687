"""What an arm is to stay clear of: which pairs of its own bodies, and which obstacles.

A search over postures finds how near two bodies come within the joint limits. Their shapes are
those of the model, each mesh by its convex hull, as Drake's SceneGraph sees them, and not the
capsules. So it shows which pairs of bodies cannot touch, and may be left out in a file of capsules.
A hull holds more than its mesh: bodies that are apart here are apart; bodies that touch here may do
so only in a hollow of one of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise, product
from pathlib import Path

import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    ProximityProperties,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.tree import RevoluteJoint
from pydrake.systems.framework import Context

from ...errors import InvalidInputError, old_arguments, warn_unprotected
from ...inputs.fields import Array, checked, each, instance, vector
from ...inputs.files import cached_numbers
from ...inputs.messages import nearest, plural
from ...inputs.progress import telling
from ..arm import Arm
from ..arm_description import GRIPPER
from ..kinematics import joints_to
from ..tool import bodies_at_tip
from .arm_capsules import (
    Fit,
    capsules_key,
    capsules_of,
    capsules_text,
    fine_capsules,
    fine_of_meshes,
    fine_text,
    fits_of,
    fitted_capsules,
    place_capsules,
    rounded,
    stated_bodies,
)
from .arm_shapes import (
    HARDLY,
    ArmShapes,
    Part,
    arm_shapes,
    arm_surfaces,
    convex,
    enclosing_capsule,
    fit_name,
    parts_of,
)
from .capsules import ArmCapsules, Capsule, Solids, number_names
from .clearance import Clearance, Flags, Indices
from .obstacles import Obstacle, single_shapes

# Postures of one joint, of two (each), and of more.
_ONE, _TWO, _MORE = 361, 41, 4000
# Ways down from the best postures, and shares of a joint's range at which they begin and end.
_DESCENTS, _WIDE, _NARROW = 6, 0.05, 1e-4
# Half of the range of a joint that slides without limits [m].
_WITHOUT_LIMITS = 1.0


@dataclass(frozen=True, eq=False)
class LeastDistance:
    """The least distance of two bodies that a search has found.

    Attributes:
        bodies: Names of the two.
        joints: Names of the joints between them, which alone change their distance.
        distance: The least distance [m]; negative where they overlap, by how deep.
        posture: Where it was found, shape (n,) [rad]; joints that do not matter are at zero, or at
            the limit that is nearest to it.
        postures: Number of postures that were looked at.
    """

    bodies: tuple[str, str]
    joints: tuple[str, ...]
    distance: float
    posture: Array
    postures: int

    @property
    def touch(self) -> bool:
        """Whether the two touch."""
        return self.distance <= 0.0


def least_distance(
    arm: Arm,
    bodies: tuple[str, str],
    parts: Sequence[Part] | None = None,
    enough: float = -np.inf,
    first: Array | None = None,
    seed: int = 0,
) -> LeastDistance:
    """Return how near two bodies of an arm come within its joint limits.

    One or two joints between them are looked at on a grid, of 361 or 41 by 41 postures, more joints
    at 4000 random ones. From the six best of these a search goes down along single joints.

    Args:
        arm: The arm.
        bodies: Names of two bodies.
        parts: Shapes of the bodies in their frames, e.g. of other meshes; by default those of the
            model. A body may have several.
        enough: Distance at or below which the search ends [m]: 0 if it matters only whether they
            touch.
        first: Posture that is looked at before all others, shape (n,) [rad].
        seed: Seed of the random postures.

    Raises:
        InvalidInputError: If a body does not exist, has no shape, or no joint is between the two.
    """
    parts = parts_of(arm) if parts is None else parts
    pieces = [[p for part in parts if part.body == name for p in part.pieces] for name in bodies]
    for name, shapes in zip(bodies, pieces, strict=True):
        if not shapes:
            names = sorted({part.body for part in parts})
            raise InvalidInputError(f"bodies: {name!r} has no shape; {nearest(name, names)}")
    point = np.zeros(3)
    capsules = place_capsules(
        arm, [Capsule(body=b, ends=(point, point), radius=1.0) for b in bodies]
    )
    begin, end = _joint_range(capsules)
    if begin == end:
        raise InvalidInputError(f"bodies: no joint is between {bodies[0]!r} and {bodies[1]!r}")
    gap = _gap_of(arm, bodies, pieces)
    lower, upper = search_bounds(arm)
    rest = np.clip(0.0, lower, upper)

    def distance(free: Array) -> float:
        q = rest.copy()
        q[begin:end] = free
        return gap(*capsules.poses.at(q)[capsules.links])

    begins = _begins(lower[begin:end], upper[begin:end], seed)
    if first is not None:
        begins = np.concatenate((first[None, begin:end], begins))
    bounds = lower[begin:end], upper[begin:end]
    rest[begin:end], least, count = _search(distance, begins, bounds, enough)
    return LeastDistance(bodies, arm.joints[begin:end], least, rest, count)


def _joint_range(capsules: ArmCapsules) -> tuple[int, int]:
    """Return the first of the joints between two capsules, and the one after the last of them.

    Between those of two chains they are all joints.
    """
    links, chains = capsules.links, capsules.chains
    if (links > 0).all() and chains[0] != chains[1]:
        return 0, len(capsules.poses.slides)
    chain = int(chains.max())
    first = capsules.poses.begins[chain]
    begin, end = sorted(first if link == 0 else int(link) - chain for link in links)
    return begin, end


def search_bounds(arm: Arm) -> tuple[Array, Array]:
    """Return the position limits of an arm, of a joint that turns at most one turn, shapes (n,)."""
    half = np.array([np.pi if unit == "rad" else _WITHOUT_LIMITS for unit in arm.units])
    lower, upper = arm.limits.position_lower, arm.limits.position_upper
    turns = np.array([unit == "rad" for unit in arm.units]) & ~(upper - lower < 2.0 * np.pi)
    return (
        np.where(turns | ~np.isfinite(lower), -half, lower),
        np.where(turns | ~np.isfinite(upper), half, upper),
    )


def _search(
    distance: Callable[[Array], float], begins: Array, bounds: tuple[Array, Array], enough: float
) -> tuple[Array, float, int]:
    """Return where a function of a few joints is least, its value, and how often it was looked at.

    Args:
        distance: The function.
        begins: Postures at which it is looked at first, shape (k, joints).
        bounds: Bounds of the joints.
        enough: Value at or below which the search ends.
    """
    values = list[float]()
    for q in begins:
        values.append(distance(q))
        if values[-1] <= enough:
            return q, values[-1], len(values)
    order = np.argsort(values)
    best, least, count = begins[order[0]], values[order[0]], len(values)
    for k in order[:_DESCENTS]:
        q, value, more = _descend(distance, begins[k], values[k], bounds, enough)
        count += more
        if value < least:
            best, least = q, value
        if least <= enough:
            break
    return best, least, count


def _begins(low: Array, high: Array, seed: int) -> Array:
    """Return the postures at which a search begins, shape (k, joints)."""
    if len(low) == 1:
        return np.linspace(low, high, _ONE)
    if len(low) == 2:
        sides = [np.linspace(a, b, _TWO) for a, b in zip(low, high, strict=True)]
        return np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.random.default_rng(seed).uniform(low, high, (_MORE, len(low)))


def _descend(
    distance: Callable[[Array], float],
    q: Array,
    least: float,
    bounds: tuple[Array, Array],
    enough: float,
) -> tuple[Array, float, int]:
    """Return a posture from which no single joint leads further down, its value, and the count."""
    share, count, ranges = _WIDE, 0, bounds[1] - bounds[0]
    while share > _NARROW and least > enough:
        improves = False
        for step in (*(share * np.diag(ranges)), *(-share * np.diag(ranges))):
            trial = np.clip(q + step, *bounds)
            count += 1
            if (value := distance(trial)) < least - 1e-9:
                q, least, improves = trial, value, True
        share = share if improves else 0.5 * share
    return q, least, count


def _gap_of(
    arm: Arm, bodies: tuple[str, str], pieces: Sequence[Sequence[Array]]
) -> Callable[[Array, Array], float]:
    """Return a function that gives the distance of two bodies whose links have moved from zero."""
    plant = arm.plant()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, arm.posture(plant, np.zeros(arm.n)))
    X_WB = [plant.GetBodyByName(name).EvalPoseInWorld(context) for name in bodies]
    scene_graph = SceneGraph()
    source = scene_graph.RegisterSource("bodies")
    frame = scene_graph.RegisterFrame(source, GeometryFrame("second"))
    for side, body in enumerate(pieces):
        for k, points in enumerate(body):
            hull = convex((X_WB[side] @ points.T).T, f"{bodies[side]}_{k}")
            geometry = GeometryInstance(RigidTransform(), hull, f"{side}_{k}")
            geometry.set_proximity_properties(_touchable())
            if side:
                scene_graph.RegisterGeometry(source, frame, geometry)
            else:
                scene_graph.RegisterAnchoredGeometry(source, geometry)
    scene = scene_graph.CreateDefaultContext()
    port, output = scene_graph.get_source_pose_port(source), scene_graph.get_query_output_port()

    def gap(X_first: Array, X_second: Array) -> float:
        poses = FramePoseVector()
        poses.set_value(frame, RigidTransform(np.linalg.inv(X_first) @ X_second))
        port.FixValue(scene, poses)
        distances = output.Eval(scene).ComputeSignedDistancePairwiseClosestPoints()
        return min(float(pair.distance) for pair in distances)

    return gap


def _touchable() -> ProximityProperties:
    properties = ProximityProperties()
    AddContactMaterial(properties=properties)
    return properties


#: Bodies of an arm that are nearer than this at home count as touching by construction [m].
TOUCHING = 0.01
# Bodies whose shapes a search finds no nearer than this cannot touch [m]; it is made for so many
# joints between them, of which it sees all postures on a grid.
_APART, _FEW = 0.005, 2
# Postures of the one joint between two bodies; what changes their distance by less is none [m].
_POSTURES, _SAME = 721, 1e-6


def own_pairs(
    arm: Arm,
    capsules: ArmCapsules,
    left_out: Collection[Collection[str]],
    home: Array,
    parts: Sequence[Part],
    own_bodies: Collection[str],
) -> tuple[Indices, list[tuple[str, str]]]:
    """Return the pairs of an arm's capsules that are to stay apart, shape (s, 2).

    Bodies that a joint connects are no pairs, nor those that move together. Other bodies of which
    one joint alone moves one beside the other are a pair only if that joint brings their capsules
    to each other.

    Args:
        arm: The arm.
        capsules: Its capsules.
        left_out: Pairs of bodies, or of their `numbered` capsules, that are not looked at.
        home: A posture in which the arm does not touch itself, shape (n,) [rad].
        parts: The shapes of its bodies.
        own_bodies: Names of bodies whose capsules are stated. The capsules of others are fitted,
            and are no pairs with those that they touch at home.

    Returns:
        The pairs, and the names of those that are left out although they may touch.
    """
    out = {frozenset(pair) for pair in left_out} | _adjacent_pairs(arm, capsules)
    links, names = capsules.links, capsules.bodies
    both = list(zip(names, number_names(names), strict=True))
    pairs = [
        (a, b)
        for a, b in combinations(range(len(links)), 2)
        if links[a] != links[b] and out.isdisjoint(map(frozenset, product(both[a], both[b])))
    ]
    own = np.array(pairs, dtype=np.intp).reshape(-1, 2)
    near = Clearance(capsules, own, Solids.of([])).gaps(home) < TOUCHING
    beside = capsules.joints_between(own) == 1
    relevant = ~beside | (_approach(arm, capsules, own, beside, home) & ~near)
    is_fitted = np.array([name not in own_bodies for name in names])[own].any(axis=1)
    relevant &= ~(near & is_fitted)
    near_pairs = own[near & ~relevant]
    counts = capsules.joints_between(near_pairs).tolist()
    joints = {(names[a], names[b]): n for (a, b), n in zip(near_pairs, counts, strict=True)}
    unseen = list[tuple[str, str]]()
    with telling(f"{arm.name}: which of its bodies can touch is looked for") as tell:
        for k, (pair, count) in enumerate(joints.items()):
            tell(f"{k} of {len(joints)} pairs")
            if count > _FEW or _can_touch(arm, capsules, pair, parts, home):
                unseen.append(pair)
    return own[relevant], unseen


def touching_at_home(arm: Arm, capsules: Sequence[Capsule], home: Array) -> list[tuple[str, str]]:
    """Return the pairs of an arm's capsules, by `number_names`, that are near each other at home.

    Bodies that a joint connects are no pairs, nor those that move together or beside each other.

    Args:
        arm: The arm.
        capsules: Its capsules.
        home: A posture in which the arm does not touch itself, shape (n,) [rad].
    """
    placed = place_capsules(arm, list(capsules))
    names, adjacent = placed.bodies, _adjacent_pairs(arm, placed)
    pairs = [
        (a, b)
        for a, b in combinations(range(len(names)), 2)
        if abs(placed.links[a] - placed.links[b]) > 1
        and frozenset((names[a], names[b])) not in adjacent
    ]
    own = np.array(pairs, dtype=np.intp).reshape(-1, 2)
    near = Clearance(placed, own, Solids.of([])).gaps(home) < TOUCHING
    labels = number_names(names)
    return [(labels[a], labels[b]) for a, b in own[near]]


def fit_arm(
    arm: Arm, home: Array, most: int, made_by: str, effort: int = 1
) -> tuple[str, list[Fit]]:
    """Return the text of a file of capsules fitted to an arm's model, and how closely they fit.

    There are one capsule for each body and fine ones. Pairs that are near each other at home are
    left out. Of an arm with a gripper they are those of the gripper's bodies alone, by their names
    in its file.

    Args:
        arm: The arm.
        home: A posture in which it does not touch itself, shape (n,) [rad].
        most: Largest number of fine capsules of a body.
        made_by: The command that does this.
        effort: Number of searches for those of a body.

    Raises:
        InvalidInputError: If no body has a shape.
    """
    gripper, surfaces, name = arm.description.gripper, arm_surfaces(arm), arm.model.name
    if gripper is not None:
        name = Path(gripper.model).name
        surfaces = {body: each for body, each in surfaces.items() if body.startswith(GRIPPER)}
    if not surfaces:
        raise InvalidInputError(f"arm: no body of {name} has a shape that can be fitted")
    parts = [part for part in arm_shapes(arm).parts if part.body in surfaces]
    both = zip(fitted_capsules(parts), parts, strict=True)
    coarse = [rounded(capsule, part.points) for capsule, part in both]
    if gripper is not None:
        coarse = [replace(each, body=each.body.removeprefix(GRIPPER)) for each in coarse]
        surfaces = {body.removeprefix(GRIPPER): each for body, each in surfaces.items()}
        fine = fine_capsules(surfaces, most, effort)
        fits = fits_of(surfaces, fine)
        text = capsules_text(coarse, []) + fine_text(fine, [], fits, made_by)
        return f"# Every vertex and every face of {name} is inside.\n{text}", fits
    fine = fine_capsules(surfaces, most, effort)
    fits = fits_of(surfaces, fine)
    note = f"nearer than {1e3 * TOUCHING:.0f} mm where the arm is at home"
    left_out = [
        [(*pair, note) for pair in touching_at_home(arm, capsules, home)]
        for capsules in (coarse, fine)
    ]
    text = capsules_text(coarse, left_out[0]) + fine_text(fine, left_out[1], fits, made_by)
    return f"# Every vertex and every face of {name} is inside.\n{text}", fits


def _adjacent_pairs(arm: Arm, capsules: ArmCapsules) -> set[frozenset[str]]:
    """Return the pairs of bodies that a controlled joint connects.

    Where one of them has no capsule, all that move with it stand for it.
    """
    plant, adjacent = arm.plant(), set[frozenset[str]]()
    for moved, name in zip(capsules.poses.moved_by.tolist(), arm.joints, strict=True):
        before = 0 if moved - 1 in capsules.bases else moved - 1
        joint = plant.GetJointByName(name)
        sides = [
            {body.name()} & set(capsules.bodies)
            or {
                b
                for b, link in zip(capsules.bodies, capsules.links, strict=True)
                if link == joint_number
            }
            for body, joint_number in (
                (joint.parent_body(), before),
                (joint.child_body(), moved),
            )
        ]
        adjacent |= {frozenset((a, b)) for a in sides[0] for b in sides[1]}
    return adjacent


def _approach(arm: Arm, capsules: ArmCapsules, own: Indices, beside: Flags, home: Array) -> Flags:
    """Return of which pairs the one joint between them brings the capsules to each other."""
    approaches = np.zeros(len(own), dtype=bool)
    # The joint that moves the later one of both.
    later = capsules.links[own].max(axis=1, initial=0)
    between = later - capsules.chains[own].max(axis=1, initial=0) - 1
    lower, upper = search_bounds(arm)
    for joint in np.unique(between[beside]):
        pairs = np.nonzero(beside & (between == joint))[0]
        q = np.tile(home, (_POSTURES, 1))
        q[:, joint] = np.linspace(lower[joint], upper[joint], _POSTURES)
        gaps = Clearance(capsules, own[pairs], Solids.of([])).gaps(q)
        approaches[pairs] = (gaps.min(axis=0) < TOUCHING) & (np.ptp(gaps, axis=0) > _SAME)
    return approaches


def _can_touch(
    arm: Arm,
    capsules: ArmCapsules,
    pair: tuple[str, str],
    parts: Sequence[Part],
    home: Array,
) -> bool:
    """Return whether the shapes of two bodies can touch, as far as they are known.

    What was found is kept in the cache: a search takes a second.
    """
    if not {*pair} <= {part.body for part in parts}:
        return True
    plant, poses = arm.plant(), capsules.poses
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, arm.posture(plant, np.zeros(arm.n)))
    pieces = [[p for part in parts if part.body == name for p in part.pieces] for name in pair]
    links = [capsules.links[capsules.bodies.index(name)] for name in pair]
    X_WB = [plant.GetBodyByName(name).EvalPoseInWorld(context).GetAsMatrix34() for name in pair]
    moves = [poses.axes, poses.points, np.array(poses.slides), np.array(poses.begins)]
    shapes = (np.array([len(each)]) for each in pieces)
    bounds = search_bounds(arm)
    if poses.bases is not None:
        moves.append(poses.bases)
    given = (*moves, np.array(links), *X_WB, home, *bounds, *shapes, *pieces[0], *pieces[1])

    def search() -> Array:
        found = least_distance(arm, pair, parts, enough=_APART, first=home)
        return np.array([found.distance])

    return bool(cached_numbers(fit_name("distance", *given), search).item() <= _APART)


@old_arguments(pressed="pressed_obstacles")
@checked(
    arm=instance(Arm), obstacles=each(Obstacle), posture=vector, pressed_obstacles=each(Obstacle)
)
def arm_clearance(
    arm: Arm,
    obstacles: Sequence[Obstacle],
    posture: Array,
    pressed_obstacles: Sequence[Obstacle] = (),
) -> tuple[Clearance, tuple[str, ...]]:
    """Return what an arm is to stay clear of, and warnings, which are an `UnprotectedWarning` too.

    See `drake_rnn.robot.clearance.arm_clearance` for the pairs of its own bodies. Bodies of which
    the
    arm's file has no capsule get one that is fitted to their shapes. Where that touches another one
    in a posture where the bodies do not touch, the pair is left out; a warning names those that may
    touch.

    Args:
        arm: The arm.
        obstacles: The obstacles.
        posture: The arm's home or another posture in which it does not touch itself, shape (n,)
            [rad].
        pressed_obstacles: What its tool presses on, which only its other bodies are to stay
            clear of.

    Raises:
        InvalidInputError: If no body that the arm moves has a shape, the only mesh of a body cannot
            be read, a shape has no bounds, its file of capsules does not fit it, or an obstacle has
            the name of what is pressed on.
    """
    clearance, doubts = clearance_of(arm, obstacles, posture, pressed_obstacles)
    warn_unprotected(doubts)
    return clearance, doubts


def clearance_of(
    arm: Arm,
    obstacles: Sequence[Obstacle],
    posture: Array,
    pressed_obstacles: Sequence[Obstacle] = (),
) -> tuple[Clearance, tuple[str, ...]]:
    """Return what `arm_clearance` does, for a caller that tells the warnings itself."""
    capsules_of_arm, own, doubts = _alone(arm, posture)
    shapes = single_shapes([*obstacles, *pressed_obstacles])
    count_free = sum(len(obstacle.parts) for obstacle in obstacles)
    solids, pressed_names = Solids.of(shapes), {shape.name for shape in shapes[count_free:]}
    touching = _touching(arm, capsules_of_arm.bodies, solids, pressed_names)
    for name, count in Counter(solids.names).items():
        if count > 1:
            raise InvalidInputError(f"obstacles: {name!r} is the name of {count}; must be of one")
    return Clearance(capsules_of_arm, own, solids, touching=touching), doubts


def _alone(arm: Arm, posture: Array) -> tuple[ArmCapsules, Indices, tuple[str, ...]]:
    """Return the capsules of an arm, the pairs of them that are to stay apart, and warnings.

    An arm keeps them: a drive asks before each of its ways, and capsules take as long to fit as all
    of its commands.

    Args:
        arm: The arm.
        posture: A posture in which it does not touch itself, shape (n,) [rad].
    """
    key = (
        "clearance",
        *(np.asarray(each, float).tobytes() for each in (posture, *search_bounds(arm))),
    )
    if (result := arm.memo.get(key)) is not None:
        return result
    shapes, capsules, left_out, world_capsules = _bodies(arm)
    stated_names = stated_bodies(arm)
    # What touches a gripper at home depends on the arm, of which the gripper's file says nothing.
    has_gripper = arm.description.gripper is not None
    own_names = {n for n in stated_names if not (has_gripper and n.startswith(GRIPPER))}
    own, unseen = own_pairs(arm, world_capsules, left_out, posture, shapes.parts, own_names)
    own, disabled_pairs = _drop_disabled(arm, world_capsules, own, shapes.parts, posture)
    doubts = [
        *(f"obstacles: {doubt}" for doubt in _doubts(arm, shapes, world_capsules, stated_names)),
        *(f"obstacles: {doubt}" for doubt in _too_small(arm, shapes, capsules, stated_names)),
        *(f"obstacles: {doubt}" for doubt in _unseen(unseen)),
        *(f"obstacles: {doubt}" for doubt in disabled_pairs),
    ]
    arm.memo[key] = result = world_capsules, own, tuple(doubts)
    return result


def _bodies(
    arm: Arm,
) -> tuple[ArmShapes, list[Capsule], list[tuple[str, str]], ArmCapsules]:
    """Return what of an arm's clearance is the same in all postures; an arm keeps it as well.

    Returns:
        The shapes of its bodies, the capsules round these, the pairs of bodies that its file
        leaves out, and the capsules where all joints are at zero.
    """
    if (result := arm.memo.get("bodies")) is not None:
        return result
    with telling(f"{arm.name}: its meshes are read"):
        shapes = arm_shapes(arm)
    capsules, left_out = capsules_of(arm, shapes)
    placed = place_capsules(arm, capsules)
    _require_shapes(arm, shapes, placed)
    arm.memo["bodies"] = result = shapes, capsules, left_out, placed
    return result


def _require_shapes(arm: Arm, shapes: ArmShapes, capsules: ArmCapsules) -> None:
    """Raise an InvalidInputError if it is not known where an arm is."""
    for mesh in shapes.lost:
        if mesh.link not in capsules.bodies:
            raise InvalidInputError(
                f"obstacles: {mesh.link!r} has no shape to keep clear: its mesh {mesh.mesh} "
                f"{mesh.fault}; mend the model, or give the body a capsule in a file: "
                + capsules_key(mesh.link)
            )
    tools = {tool.name for tool in arm.tools}
    bodies_and_links = zip(capsules.bodies, capsules.links, strict=True)
    if not any(link > 0 and body not in tools for body, link in bodies_and_links):
        raise InvalidInputError(
            f"obstacles: {arm.model.name} has no geometry to keep clear of them; name a file of "
            "capsules in arm.capsules"
        )


def _doubts(
    arm: Arm, shapes: ArmShapes, capsules: ArmCapsules, own_bodies: Collection[str]
) -> list[str]:
    """Return what of an arm is not kept clear, or differently from what its model says."""
    bare = ", ".join(body for body in shapes.bare if body not in capsules.bodies)
    sentences = shapes.doubts(own_bodies)
    if bare:
        sentences.insert(
            0,
            f"nothing keeps these bodies of {arm.model.name} clear, which have no shape: {bare}; "
            "give them capsules in a file, arm.capsules",
        )
    return sentences


def _too_small(
    arm: Arm, shapes: ArmShapes, capsules: Sequence[Capsule], own_bodies: Collection[str]
) -> list[str]:
    """Return a warning about stated capsules that hold less than the model's shapes.

    None about fine ones round the meshes of a maker, beyond which the model's drawing may reach.
    """
    if fine_of_meshes(arm):
        return []
    excess = dict[str, float]()
    for part in (part for part in shapes.parts if part.body in own_bodies):
        own = [capsule.outside(part.points) for capsule in capsules if capsule.body == part.body]
        if (far := float(np.min(own, axis=0).max())) > HARDLY:
            excess[part.body] = max(far, excess.get(part.body, 0.0))
    if not excess:
        return []
    text = ", ".join(f"{body} by {1e3 * far:.0f} mm" for body, far in excess.items())
    file = Path(arm.description.capsules or "").name
    return [f"capsules of {file} hold less than the model's shapes: {text}"]


def _unseen(pairs: Sequence[tuple[str, str]]) -> list[str]:
    """Return a warning about pairs of bodies that may touch and are left out."""
    if not pairs:
        return []
    text = ", ".join(f"{a} and {b}" for a, b in pairs)
    return [
        f"{text} are not kept apart from each other, although they may touch: their capsules do "
        "where the arm is at home; give capsules that do not in a file, arm.capsules"
    ]


def _drop_disabled(
    arm: Arm, capsules: ArmCapsules, own: Indices, parts: Sequence[Part], home: Array
) -> tuple[Indices, list[str]]:
    """Return the pairs that the arm's SRDF file does not disable, and a warning about the others.

    Args:
        arm: The arm.
        capsules: Its capsules.
        own: Pairs of them that are to stay apart, shape (s, 2).
        parts: The shapes of its bodies.
        home: A posture in which the arm does not touch itself, shape (n,) [rad].
    """
    names, disabled_pairs = capsules.bodies, arm.disabled_pairs
    out = np.array([frozenset((names[a], names[b])) in disabled_pairs for a, b in own], dtype=bool)
    counts = capsules.joints_between(own[out]).tolist()
    links = {(names[a], names[b]): n for (a, b), n in zip(own[out], counts, strict=True)}
    if not links:
        return own, []
    doubtful = [
        f"{a} and {b} ({disabled_pairs[frozenset((a, b))] or 'no reason'})"
        for (a, b), count in links.items()
        if count > _FEW or _can_touch(arm, capsules, (a, b), parts, home)
    ]
    is_one = len(links) == 1
    text = (
        f"{plural(len(links), 'pair')} of bodies {'is' if is_one else 'are'} not kept apart from "
        "each other, as the SRDF file says"
    )
    if not doubtful:
        return own[~out], [f"{text}; {'it cannot' if is_one else 'none of them can'} touch"]
    return own[~out], [
        f"{text}; these may touch, or were not searched: {', '.join(doubtful)}; to keep "
        f"{'it' if is_one else 'them'} apart, take their disable_collisions out of the file"
    ]


# Steps on the way of a gripper that are looked at, and stretches of it with a capsule each.
_STEPS, _STRETCHES = 32, 4
# Angle by which a body of a gripper may turn from one to the next [rad].
_MOST_TURNED = 0.25


def clearance_between(
    arm: Arm,
    one: Clearance,
    other: Clearance,
    locks: tuple[Mapping[str, float], Mapping[str, float]],
) -> Clearance:
    """Return what an arm is to stay clear of while joints of its gripper move.

    Each capsule that they move is replaced by some that contain it all along. The joints move
    together, each by the same share of its way, whenever that is. Between two places that are
    looked at, a point goes straight if the joints only slide; else it goes no farther from the
    nearer one than half of what the joints move it by, and the capsules are larger by that. The
    arm's own pairs are those of both ends.

    Args:
        arm: The arm.
        one: What it is to stay clear of before that.
        other: What it is to stay clear of after it.
        locks: Positions of the gripper's joints then, by their names in its file [rad or m].

    Raises:
        InvalidInputError: If a body of the gripper turns by more than 8 rad.
    """
    shares = np.linspace(0.0, 1.0, _STEPS + 1)
    first, last = locks
    contexts = arm.gripper_contexts(
        {name: (1.0 - s) * first[name] + s * last[name] for name in first} for s in shares.tolist()
    )
    ends, radii, bodies = list[Array](), list[float](), list[str]()
    numbers, links = list[range](), list[int]()
    for k, body in enumerate(one.arm.bodies):
        swept = [(one.arm.ends[k], 0.0)]
        if body.startswith(GRIPPER) and arm.gripper_plant.HasBodyNamed(body):
            swept = _swept(arm, contexts, body, one.arm.ends[k])
        numbers.append(range(len(ends), len(ends) + len(swept)))
        ends += [segment for segment, _ in swept]
        radii += [one.arm.radii[k] + beyond for _, beyond in swept]
        bodies += [body] * len(swept)
        links += [one.arm.links[k]] * len(swept)
    moving = ArmCapsules(
        one.arm.poses, tuple(bodies), np.array(links), np.array(ends), np.array(radii)
    )
    both = set(map(tuple, one.own.tolist())) & set(map(tuple, other.own.tolist()))
    own = [pair for a, b in sorted(both) for pair in product(numbers[a], numbers[b])]
    touching = frozenset((n, k) for a, k in one.touching for n in numbers[a])
    pairs = np.array(own, dtype=np.intp).reshape(-1, 2)
    return Clearance(moving, pairs, one.solids, touching=touching)


def _swept(
    arm: Arm, contexts: Sequence[Context], name: str, ends: Array
) -> list[tuple[Array, float]]:
    """Return segments, and how far from one of them a segment of a gripper's body is at most [m].

    Args:
        arm: The arm.
        contexts: Those of its `gripper_plant` with the gripper in turn where it comes by.
        name: Name of the body.
        ends: Ends of the segment in the first of them, in the world with all joints of the arm at
            zero, shape (2, 3) [m].
    """
    plant, whole = arm.gripper_plant, arm.plant()
    body = plant.GetBodyByName(name)
    joints = [
        joint
        for joint in joints_to(plant, body)
        if joint.num_positions() == 1 and joint.name().startswith(GRIPPER)
    ]
    positions = np.array([[joint.GetOnePosition(c) for joint in joints] for c in contexts])
    steps = np.abs(np.diff(positions, axis=0)).max(axis=0, initial=0.0)
    if not steps.any():
        return [(ends, 0.0)]
    assert arm.description.gripper is not None
    mount, context = str(arm.description.gripper.mount), whole.CreateDefaultContext()
    whole.SetPositions(context, arm.posture(whole, np.zeros(arm.n)))
    X_WM = whole.GetFrameByName(mount).CalcPoseInWorld(context)
    M = plant.GetFrameByName(mount)
    # All in the link that carries the gripper.
    X_MB = [body.body_frame().CalcPose(c, M) for c in contexts]
    p_B = (X_MB[0].inverse() @ X_WM.inverse()) @ ends.T
    ways = np.array([(X @ p_B).T for X in X_MB])
    turns = np.array([joint.type_name() == RevoluteJoint.kTypeName for joint in joints])
    turned, slid = float(steps[turns].sum()), float(steps[~turns].sum())
    if turned > _MOST_TURNED:
        raise InvalidInputError(
            f"goal.opening: turns {name.removeprefix(GRIPPER)} by {_STEPS * turned:.3g} rad; at "
            f"one goal it may by {_STEPS * _MOST_TURNED:g} rad, as what contains all of its way is "
            "loose beyond"
        )
    beyond = 0.0
    if turned:
        origins = np.array(
            [[j.frame_on_child().CalcPose(c, M).translation() for j in joints] for c in contexts]
        )
        lever = float(np.linalg.norm(ways[:, None] - origins[:, :, None], axis=-1).max())
        # Between two places the lever is longer by what the point moves at most.
        beyond = 0.5 * (turned * lever + slid) / (1.0 - turned)
    pieces = np.linspace(0, len(ways) - 1, _STRETCHES + 1).round().astype(int).tolist()
    stretches = (enclosing_capsule(ways[a : b + 1].reshape(-1, 3)) for a, b in pairwise(pieces))
    return [((X_WM @ each.ends.T).T, each.radius + beyond) for each in stretches]


def _touching(
    arm: Arm, bodies: Sequence[str], solids: Solids, pressed_names: set[str]
) -> frozenset[tuple[int, int]]:
    """Return the pairs of a capsule of the tool and a solid that it presses on."""
    if not pressed_names:
        return frozenset()
    numbers = [k for k, name in enumerate(solids.names) if name in pressed_names]
    if len(numbers) > len(pressed_names):
        name = next(solids.names[k] for k in numbers if solids.names.count(solids.names[k]) > 1)
        raise InvalidInputError(
            f"obstacles: {name!r} is the name of what the tool presses on; give another name"
        )
    at_tip = bodies_at_tip(arm)
    return frozenset((a, k) for a, body in enumerate(bodies) if body in at_tip for k in numbers)
