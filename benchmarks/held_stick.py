"""A stick that is held: whether an arm behind the shield rests, tells why, and leaves again.

An operator holds a stick for some seconds, as a twist of the tool, as velocities of the joints, or
as a pose: into the arm's own body, into a table or a wall, into another arm, or past the end of its
reach. Then it is moved back the way that it came::

    python benchmarks/held_stick.py --cases 10000 --kept FILE --jobs 2
    python benchmarks/held_stick.py --cases 200 --meshes franka_description=FOLDER --meshes ...

Arm, period (1, 5, 10 ms), bounds of acceleration and jerk (50, 500, 5000 rad/s^3), the kind of
target, what it is held into, speed and start are drawn from the seed of each episode. Steps are in
C: each arm has three builds, of which each has a period and bounds of its own, so that the arms
together have all pairs of these. ``--numpy`` builds none. The SO-101 is that of example-robot-data;
where that is not installed, its episodes are those of a UR5. Two Pandas stand face to face; the
stick is that of the left one, the right one rests, or is led to it for some seconds.

An episode has these judgements:

- *limits*: velocities, their differences and second differences beyond a bound by more than 1e-9 of
  it, or positions beyond theirs;
- *collided*: the least distance of the motion, by the law's capsules between samples and, with
  ``--meshes``, by the makers' meshes as in `chunks.py`, whose packages are installed or in these
  folders (that of the Panda and the UR5 is example-robot-data; an arm of which some are nowhere is
  told in the table);
- *rests*: progress has ended when the tool goes no further than a millimetre along what is asked
  for until the stick is let go of, or no joint further than a milliradian in the direction of the
  velocity that is asked of it; 2 s later, and once no other arm is led towards it, no joint may be
  faster than 0.01 rad/s;
- *tells*: within 0.3 s of that, ``limited_by`` names what is in the way, a pair that from the end
  of progress until the arm is to rest comes nearer than 3 mm beyond the distance at which arms
  rest, or a limit, and ``blocked_for`` counts;
- *leaves*: 0.5 s after the stick is moved back, a joint has moved by a milliradian, and a second
  later the tool has gone a millimetre of the way that it came, nearer to its start for a pose, or a
  joint a milliradian.

A stick is held for 9 s, or, in three of four episodes, until progress has ended 2.5 s ago and the
arm rests. Episodes in which progress does not end are counted apart: an arm that slides along a
wall.
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from drake_rnn import (
    Arm,
    Array,
    DualArmShield,
    InvalidInputError,
    JointLimits,
    Shield,
    ShieldSettings,
    arm_clearance,
    load_arm,
    make_obstacles,
)
from kept_cases import Found, cases
from markdown_table import head, row
from shared_options import add_case_options

PAIR = "two pandas"
ARMS = ("panda", "fr3", "iiwa14", "ur5", "so101", PAIR)
KINDS = ("twist", "velocity", "pose")
INTO = ("own body", "table", "wall", "end of reach", "another arm")
PERIODS = (1e-3, 5e-3, 1e-2)
# Bounds of acceleration and jerk, of each of which a step is built [rad/s^2, rad/s^3].
BOUNDS = ((2.0, 50.0), (5.0, 500.0), (10.0, 5000.0))
# Times of holding, in which an arm leaves, and in which it goes back besides [s], and how long
# after progress has ended it is at rest [s].
HELD, LEFT, BACK, SETTLED = 9.0, 0.5, 1.0, 2.0
# For how long it is held on once progress has ended [s]; the share of episodes held to the end.
ON, TO_THE_END = 2.5, 0.25
# Progress that does not count [m or rad], speed at rest [rad/s], motion that counts as leaving.
PROGRESS, REST, LEAVES = 1e-3, 0.01, 1e-3
# Within which time the alarm is to tell [s], how often it is looked at [s], and how near a pair is
# that is in the way [m].
ALARM, LOOKS, NEAR = 0.3, 0.05, 0.013
# After which time without progress shields call back that they are blocked [s].
AT_ONCE = 1e-4
# What is beyond a limit, as a share of it.
EXACT = 1e-9
# Where the second Panda stands [m], for how long it is led on at most, and from when on it is at
# rest, so that it pushes the first one no more [s].
BESIDE, LED, PUSHED = 1.1, 4.0, 5.0
# Largest velocity of a joint by the speed of the tool [rad/m], and the share of it below which a
# joint is left alone.
FAST, MATTERS = 3.0, 0.4
# A box that is nowhere near: one build serves episodes with a box and without.
AWAY = {"kind": "box", "center": [30.0, 0.0, 0.0], "size": [0.1, 0.1, 0.1]}


@cache
def arm_of(name: str) -> Arm:
    """Return an arm without a tool."""
    if name == "so101":
        from chunks import arm_of as user_arm

        return user_arm(name)
    if name != PAIR:
        return load_arm(name, tool=None)
    base = {"translation": [BESIDE, 0.0, 0.0], "rpy": [0.0, 0.0, np.pi]}
    return load_arm(
        "panda", tool=None, pair={"arm": {"model": "panda", "tool": None}, "base": base}
    )


class Side(NamedTuple):
    """The arm whose stick is held, alone or one of two.

    Attributes:
        shield: What commands it.
        source: What its targets are given to.
        arm: The arm.
        block: Its joints among those that are commanded.
        other: What targets of the other arm are given to; None if there is none or it rests.
        alarm: What comes to have something in it when an arm does not get on any more.
    """

    shield: Any
    source: Any
    arm: Arm
    block: slice
    other: Any
    alarm: list[Any]

    @classmethod
    def of(cls, shield: Shield | DualArmShield, moves: bool, alarm: list[Any]) -> Side:
        """Return it."""
        if isinstance(shield, DualArmShield):
            source, arm = shield["left"], shield.arm.parts[0]
            other = shield["right"] if moves else None
            return cls(shield, source, arm, source.block, other, alarm)
        return cls(shield, shield, shield.arm, slice(None), None, alarm)


def scene(
    rng: np.random.Generator, into: str, arm: Arm, q: Array
) -> tuple[list[dict[str, Any]], Array]:
    """Return obstacles, and the point that the stick is held towards, shape (3,) [m]."""
    one = arm.parts[0] if arm.description.pair else arm
    p_WE = one.kinematics().p_WE(q[: one.n])
    # The SO-101 is half as large as the others.
    scale = min(1.0, float(np.linalg.norm(p_WE)) / 0.6)
    out = p_WE[:2] / max(float(np.linalg.norm(p_WE[:2])), 1e-9)
    if into == "own body":
        return [AWAY], scale * np.array([0.0, 0.0, rng.uniform(0.1, 0.5)])
    if into == "another arm":
        return [AWAY], np.array([BESIDE, 0.0, 0.5]) + rng.uniform(-0.3, 0.3, 3)
    if into == "end of reach":
        way = np.append(out, rng.uniform(-0.5, 0.8))
        return [AWAY], p_WE + 3.0 * way
    if into == "table":
        height = p_WE[2] - scale * rng.uniform(0.1, 0.3)
        size, center = [0.5, 0.5, 0.1], [*(p_WE[:2] + 0.1 * out), height - 0.05]
        target = np.array([*p_WE[:2], height - 1.0]) + np.append(rng.uniform(-0.4, 0.4, 2), 0.0)
        return [{"kind": "box", "center": center, "size": size}], target
    away = p_WE[:2] + scale * rng.uniform(0.1, 0.25) * out
    angle = float(np.arctan2(out[1], out[0]))
    size, center = [0.06, 0.8, 0.8], [*away, float(p_WE[2])]
    box = {"kind": "box", "center": center, "size": size, "rpy": [0.0, 0.0, angle]}
    return [box], np.append(p_WE[:2] + out, p_WE[2]) + rng.uniform(-0.4, 0.4, 3)


class Draw(NamedTuple):
    """What an episode is of.

    Attributes:
        rng: What its start and its scene are drawn from.
        name: Name of the arm, of `ARMS`.
        kind: Of what its targets are.
        into: What the stick is held into.
        period: Time between two commands [s].
        limits: Limits of the joints.
        speed: How fast the tool is to go [m/s].
        moves: Whether a second arm is led.
        held: How long the stick is held [s]; None for until the arm rests.
    """

    rng: np.random.Generator
    name: str
    kind: str
    into: str
    period: float
    limits: JointLimits
    speed: float
    moves: bool
    held: float | None


def draw_of(seed: int) -> Draw:
    """Return what an episode is of."""
    rng = np.random.default_rng(seed)
    number = int(rng.integers(len(ARMS)))
    name, kind, into = ARMS[number], str(rng.choice(KINDS)), str(rng.choice(INTO[:-1]))
    if name == PAIR and rng.random() < 0.6:
        into = "another arm"
    try:
        arm = arm_of(name)
    except StopIteration:
        name, arm = "ur5", arm_of("ur5")
    # Each arm has each period with bounds of its own.
    build = int(rng.integers(len(PERIODS)))
    period, (most, jerk) = PERIODS[build], BOUNDS[(build + number) % len(BOUNDS)]
    limits = arm.limits.replace(
        velocity=np.minimum(arm.limits.velocity, 1.0), acceleration=most, jerk=jerk
    )
    speed, moves = float(rng.uniform(0.05, 0.3)), bool(rng.random() < 0.5)
    held = HELD if rng.random() < TO_THE_END else None
    return Draw(rng, name, kind, into, period, limits, speed, moves, held)


def about(draw: Draw) -> Found:
    """Return what is kept of what an episode is of."""
    assert draw.limits.jerk is not None
    jerk = float(np.max(draw.limits.jerk))
    of = {"arm": draw.name, "kind": draw.kind, "into": draw.into, "period": draw.period}
    return of | {"jerk": jerk}


def placed(
    draw: Draw, settings: ShieldSettings, on_blocked: Any = None
) -> tuple[Shield | DualArmShield, Array] | None:
    """Return a shield at a start that is free, and where its stick leads; None if there is none."""
    arm = arm_of(draw.name)
    maker: Any = DualArmShield if draw.name == PAIR else Shield
    how: Found = {"limits": draw.limits, "on_blocked": on_blocked}
    for _ in range(50):
        q = arm.home + draw.rng.uniform(-0.3, 0.3, arm.n)
        obstacles, target = scene(draw.rng, draw.into, arm, q)
        try:
            shield = maker(arm, draw.period, settings, start=q, obstacles=obstacles, **how)
        except InvalidInputError:
            continue
        return shield, target
    return None


def episode(seed: int, *, meshes: tuple[str, ...] = (), compiled: bool = True) -> Found:
    """Return what an episode comes to."""
    draw = draw_of(seed)
    found = about(draw)
    alarm: list[Any] = []
    settings = ShieldSettings(compiled=compiled, blocked_after=AT_ONCE)
    made = placed(draw, settings, lambda *status: alarm.append(status))
    if made is None:
        return found | {"refused": True}
    shield, target = made
    side = Side.of(shield, draw.moves, alarm)
    found |= judged(side, draw, target)
    motion = found.pop("motion")
    if meshes:
        try:
            found["meshes"] = _recount(draw.name, meshes, shield.obstacles).least(motion)[0]
        except SystemExit as error:
            found["no meshes"] = str(error)
    return found


def judged(side: Side, draw: Draw, target: Array, least: Any = None) -> Found:
    """Return how a shield does in an episode.

    Args:
        side: The arm.
        draw: What the episode is of.
        target: The point that the stick is held towards, shape (3,) [m].
        least: Returns the least distance of a motion [m], by default between samples as well.
    """
    kind, speed, held = draw.kind, draw.speed, draw.held
    shield, limits = side.shield, side.shield.limits
    clearance, _ = arm_clearance(shield.arm, make_obstacles(shield.obstacles), shield.position)
    stick = Stick(side, kind, target, speed)
    q, v = [shield.position], [np.zeros(shield.arm.n)] * 3
    along = [stick.along(q[0][side.block])]
    told = []
    period, k = shield.period, 0
    looks, last = max(round(LOOKS / period), 1), round(ALARM / period) + 3
    pushed = PUSHED if side.other is not None else 0.0
    while not _is_over(along, v, period, HELD if k * period < pushed + ON - SETTLED else held):
        t = k * period
        stick.hold(t, 1.0)
        if side.other is not None:
            _lead_other(side.other, stick, t)
        q.append(shield.command(t))
        v.append(shield.velocity)
        along.append(np.maximum(along[-1], stick.along(q[-1][side.block])))
        # What is told while it gets on, or long after that, does not count.
        if k % looks == 0 and side.alarm and (along[-1] > along[max(k - last, 0)]).any():
            status = side.source.status
            told.append((t, status.blocked_for, status.limited_by))
            if not status.blocked_for:
                side.alarm.clear()
        k += 1
    end = k
    while k < end + round((LEFT + BACK) / period):
        stick.hold(k * period, -1.0)
        q.append(shield.command(k * period))
        v.append(shield.velocity)
        k += 1
    motion = np.array(q)
    ended = _ended(np.array(along), period)
    found: Found = {
        "beyond": _beyond(np.array(v), limits, period),
        "outside": float(limits.violation(motion).max()),
        "uncertified": shield.uncertified,
        "distance": (least or _least)(clearance, motion),
        "ended": ended,
        "held": end * period,
        "moved": float(np.abs(motion[end + round(LEFT / period)] - motion[end]).max()),
        "left": stick.way_back(motion[end][side.block], motion[-1][side.block]),
        "motion": motion,
    }
    later = np.array(v[3:])[round(max(ended + SETTLED, pushed) / period) : end, side.block]
    if len(later) * period < ON - SETTLED - 0.05:
        later = np.array(v[3:])[end - round((ON - SETTLED) / period) : end, side.block]
        return found | {"slides": True, "speed": float(np.abs(later).max())}
    found["speed"] = float(np.abs(later).max())
    found["told"] = _tells(told, ended, clearance, motion, period)
    return found


class Stick:
    """A stick that an operator holds, and moves back.

    Args:
        side: The arm.
        kind: Of what its targets are.
        target: The point that it is held towards, shape (3,) [m].
        speed: How fast the tool is to go [m/s].
    """

    def __init__(self, side: Side, kind: str, target: Array, speed: float) -> None:
        self._side, self._kind, self._speed = side, kind, speed
        self._kinematics = kinematics = side.arm.kinematics()
        q = side.shield.position[side.block]
        p, R = kinematics.p_WE(q), RotationMatrix(kinematics.R_WE(q)).ToQuaternion().wxyz()
        far = float(np.linalg.norm(target - p))
        self._way = (target - p) / far
        self._start = np.concatenate((p, R))
        self._end = np.concatenate((p + min(1.0, far) * self._way, R))
        J = kinematics.J(q)
        v = J.T @ np.linalg.solve(J @ J.T + 1e-3 * np.eye(3), self._way)
        # A stick for joints moves those that matter; they come to an end before it is let go of.
        v[np.abs(v) < MATTERS * np.abs(v).max()] = 0.0
        self._v = speed * FAST / float(np.abs(v).max()) * v
        self._V = np.append(np.zeros(3), speed * self._way)
        self._sign = 0.0

    def along(self, q: Array) -> Array:
        """Return how far the tool, or each joint, is along what is asked for, shape (k,).

        Args:
            q: Positions of the arm, shape (n,) [rad].
        """
        if self._kind == "velocity":
            return np.sign(self._v) * q
        return np.array([self._way @ self._kinematics.p_WE(q)])

    def way_back(self, q: Array, q_later: Array) -> float:
        """Return how far the tool, or a joint, has gone back, shape (n,) each [rad].

        A pose leads it back to its start, which may be on either side of where it was held up.
        """
        if self._kind != "pose":
            return float((self.along(q) - self.along(q_later)).max())
        left, left_later = (
            float(np.linalg.norm(self._kinematics.p_WE(each) - self._start[:3]))
            for each in (q, q_later)
        )
        return left - left_later

    def hold(self, t: float, sign: float) -> None:
        """Give its targets to the shield.

        Args:
            t: Time [s].
            sign: 1 to hold it, -1 to move it back.
        """
        source = self._side.source
        if self._kind == "twist":
            source.follow_twists(sign * self._V, t=t)
        elif self._kind == "velocity":
            source.follow_velocities(sign * self._v, t=t)
        elif sign != self._sign:
            self._follow_pose(self._end if sign > 0.0 else self._start, t)
        self._sign = sign

    def _follow_pose(self, pose: Array, t: float) -> None:
        """Lead the tool straight to a pose, from where it is."""
        p_WE = self._kinematics.p_WE(self._side.source.position)
        far = float(np.linalg.norm(pose[:3] - p_WE))
        count = max(int(np.ceil(far / (0.05 * self._speed))), 1) + 1
        rows = np.tile(pose, (count, 1))
        rows[:, :3] = np.linspace(p_WE, pose[:3], count)
        self._side.source.follow_poses(rows, rate=20.0, start=t, t=t)


def _lead_other(other: Any, stick: Stick, t: float) -> None:
    """Lead the second arm towards the first one, for some seconds."""
    if t < LED:
        other.follow_twists([0.0, 0.0, 0.0, -0.05, 0.02, 0.0], t=t)


def _ended(along: Array, period: float) -> float:
    """Return when progress has ended [s].

    Args:
        along: How far the tool, or each joint, has come at most, shape (k, m) [m or rad].
        period: Time between two of these [s].
    """
    goes_on = (along < along[-1] - PROGRESS).any(axis=1)
    return period * float(np.flatnonzero(goes_on)[-1] + 1) if goes_on.any() else 0.0


def _is_over(along: list[Array], v: list[Array], period: float, held: float | None) -> bool:
    """Return whether the stick has been held for long enough."""
    t = (len(along) - 1) * period
    if t >= HELD - 0.5 * period:
        return True
    samples = round(ON / period)
    if held is not None or len(along) <= samples or (len(along) % round(0.1 / period)):
        return False
    if (along[-1] > along[-1 - samples] + PROGRESS).any():
        return False
    return float(np.abs(v[-round((ON - SETTLED) / period) :]).max()) < REST


def _least(clearance: Any, motion: Array) -> float:
    """Return the least distance of a motion, of which an arm rests in much [m]."""
    if not clearance.count:
        return 1.0
    moves = (motion[1:] != motion[:-1]).any(axis=1)
    return float(clearance.least_along(motion[np.append(True, moves)]).min())


def _tells(told: list[Any], ended: float, clearance: Any, motion: Array, period: float) -> bool:
    """Return whether the alarm tells the true reason in time.

    Where a pair is named, it must be one that comes near until the arm is at rest: one that still
    moves is kept farther off. A limit may be named where none is, or besides.
    """
    for t, blocked_for, causes in told:
        if ended <= t <= ended + ALARM + period and blocked_for > 0.0 and causes:
            until = round((ended + SETTLED) / period)
            gaps = clearance.gaps(motion[round(ended / period) : until + 1]).min(axis=0)
            near = {frozenset(clearance.names[k]) for k in np.flatnonzero(gaps < NEAR)}
            pairs = {frozenset(each.split(" and ")) for each in causes if " and " in each}
            if pairs & near or not pairs:
                return True
    return False


def _beyond(v: Array, limits: JointLimits, period: float) -> float:
    """Return by which share velocities, or their differences, are beyond a limit at most."""
    orders = (limits.velocity, limits.acceleration, limits.jerk)
    return max(
        float((np.abs(np.diff(v, n=k, axis=0)) / period**k / bound).max() - 1.0)
        for k, bound in enumerate(orders)
        if bound is not None
    )


@cache
def _meshes_of(name: str, folders: tuple[str, ...]) -> Any:
    """Return the makers' meshes of an arm, or of two."""
    from chunks import meshes_of
    from two_arm_streams import PairMeshes

    if name != PAIR:
        return meshes_of(name, folders)
    X_AB = RigidTransform(RollPitchYaw(0.0, 0.0, np.pi), [BESIDE, 0.0, 0.0])
    return PairMeshes(meshes_of("panda", folders), X_AB)


def _recount(name: str, folders: tuple[str, ...], obstacles: list[dict[str, Any]]) -> Any:
    """Return distances by the makers' meshes among boxes."""
    from chunks import Recount
    from motion_bench_maker import Solid

    solids = [
        Solid(
            "box",
            tuple(each["size"]),
            RigidTransform(RollPitchYaw(each.get("rpy", [0.0, 0.0, 0.0])), each["center"]),
        )
        for each in obstacles
    ]
    return Recount(_meshes_of(name, folders), tuple(solids))


def is_left(found: Found) -> bool:
    """Return whether an arm leaves as its stick is moved back."""
    return bool(min(found["moved"], found["left"]) >= LEAVES)


def print_table(rows: list[Found]) -> None:
    """Print how all episodes ended, by what the stick was held into."""
    titles = ("held into", "episodes", "limits broken", "least distance [mm]", "collided")
    titles += ("slide on", "at rest", "told in time", "left")
    head(*titles)
    rows = [each for each in rows if "refused" not in each]
    groups = {into: [r for r in rows if r["into"] == into] for into in INTO} | {"all": rows}
    for into, group in groups.items():
        if not group:
            continue
        rest = [r for r in group if "slides" not in r]
        least = min(min(r["distance"], r.get("meshes", 1.0)) for r in group)
        cells = (
            len(group),
            sum(r["beyond"] > EXACT or r["outside"] > EXACT for r in group),
            f"{1e3 * least:.2f}",
            sum(min(r["distance"], r.get("meshes", 1.0)) <= 0.0 for r in group),
            len(group) - len(rest),
            f"{sum(r['speed'] < REST for r in rest)} of {len(rest)}",
            f"{sum(r['told'] for r in rest)} of {len(rest)}",
            f"{sum(is_left(r) for r in group)} of {len(group)}",
        )
        row(into, *cells)
    print_distances(rows)
    fails = Counter(
        (r["arm"], r["kind"], r["into"], r["period"])
        for r in rows
        if not is_left(r) or ("slides" not in r and not (r["told"] and r["speed"] < REST))
    )
    for key, count in fails.most_common(20):
        print(*key, count)


def print_distances(rows: list[Found]) -> None:
    """Print by how much arms stay clear, by their capsules and by their makers' meshes."""
    if not any("meshes" in r or "no meshes" in r for r in rows):
        return
    head("arm", "episodes", "by capsules [mm]", "by its maker's meshes [mm]", "collided")
    for name in ARMS:
        group = [r for r in rows if r["arm"] == name]
        judged = [r["meshes"] for r in group if "meshes" in r]
        missing = {r["no meshes"] for r in group if "no meshes" in r}
        if not group:
            continue
        by_meshes = f"{1e3 * min(judged):.2f}" if judged else f"- ({', '.join(missing)})"
        by_capsules = f"{1e3 * min(r['distance'] for r in group):.2f}"
        row(name, len(group), by_capsules, by_meshes, sum(d <= 0.0 for d in judged))


def main() -> None:
    """Run the episodes, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--cases", type=int, default=100, help="number of episodes")
    parser.add_argument("--first", type=int, default=0, help="seed of the first one")
    parser.add_argument("--numpy", action="store_true", help="make steps by NumPy")
    parser.add_argument("--meshes", action="append", default=[], help="folder of makers' meshes")
    add_case_options(parser)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    seeds = range(options.first, options.first + options.cases)
    task = partial(episode, meshes=tuple(options.meshes), compiled=not options.numpy)
    print_table(cases(task, seeds, options.jobs, options.kept, "held stick"))


if __name__ == "__main__":
    main()
