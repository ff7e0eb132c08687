"""How a shield of two arms fares whose chunks lead both through the same place.

Two Pandas stand beside or in front of each other, in one of six ways, every third time with three
balls between them. Each gets a stream of chunks as in `chunks.py`, of joint positions or of poses,
along a smooth motion that leads its tool to where the other arm's tool is led as well. In a third
of the streams neither arm yields, in a third the left one does, in a third the right one::

    python benchmarks/two_arm_streams.py --streams 2000 --kept FILE
    python benchmarks/two_arm_streams.py --streams 2000 --kept FILE --table

Limits are those of the commanded velocities and of the positions that they lead to. Motions are
judged between samples too, by the makers' meshes, as in `chunks.py`: each arm by itself, with the
other arm, and with the balls. What the chunks ask for is judged so as well.
"""

from __future__ import annotations

import argparse
import json
import traceback
from functools import cache
from itertools import pairwise
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from chunks import DURATION, ENDS, EXACT, FREE, ArmMeshes, Message, Recount, messages, motion
from drake_rnn import (
    Arm,
    Array,
    DualArmShield,
    InvalidInputError,
    ShieldSettings,
    arm_clearance,
    load_arm,
    make_obstacles,
)
from makers_meshes import add_folders
from markdown_table import head, row
from motion_bench_maker import Solid
from shared_options import add_kept
from streams import ACCELERATION, JERK, PERIOD, VELOCITY

NAMES = ("left", "right")
YIELDS = (None, "left", "right")
# Where the right arm's base is in that of the left one: x, y, z [m] and yaw [rad].
PLACES = (
    (1.0, 0.0, 0.0, np.pi),
    (0.8, 0.2, 0.0, np.pi),
    (0.9, -0.1, 0.1, 2.6),
    (0.0, 0.7, 0.0, 0.0),
    (0.0, 0.55, 0.0, -0.4),
    (0.6, 0.6, 0.0, -1.6),
)
BALLS, AWAY = 3, 30.0
# Postures of each arm of which the one that comes nearest to the common place is taken, and how far
# from home they are [rad].
POSTURES, FAR = 300, 1.0


class Scene(NamedTuple):
    """Where two arms stand.

    Attributes:
        arm: Both.
        X_AB: Base of the right one in that of the left one.
        balls: What is between them.
    """

    arm: Arm
    X_AB: RigidTransform
    balls: tuple[Solid, ...]

    @property
    def obstacles(self) -> list[dict[str, Any]]:
        """The balls as obstacles, and some far away: one build in C serves all scenes."""
        far = [
            {"kind": "ball", "center": [AWAY + k, 0.0, 0.0], "radius": 0.1}
            for k in range(BALLS - len(self.balls))
        ]
        return [ball.settings() for ball in self.balls] + far


@cache
def arms_at(place: int) -> tuple[Arm, RigidTransform]:
    """Return two arms at one of the places, and where the second one stands."""
    *p_AB, yaw = PLACES[place]
    base = {"translation": list(p_AB), "rpy": [0.0, 0.0, yaw]}
    pair = {"arm": {"model": "panda", "tool": None}, "base": base}
    arm = load_arm("panda", tool=None, pair=pair)
    return arm, RigidTransform(RollPitchYaw(0.0, 0.0, yaw), p_AB)


def scene_of(number: int) -> Scene:
    """Return the scene of a stream; every third one has balls that are clear of both arms."""
    (arm, X_AB), rng = arms_at(number % len(PLACES)), np.random.default_rng((number, 1))
    balls: list[Solid] = []
    middle = np.mean([part.kinematics().p_WE(part.home) for part in arm.parts], axis=0)
    while number % 3 == 0 and len(balls) < BALLS:
        center = middle + rng.uniform(-0.4, 0.4, 3)
        ball = Solid("sphere", (rng.uniform(0.03, 0.08),), RigidTransform(center))
        clearance, _ = arm_clearance(arm, make_obstacles([ball.settings()]), arm.home)
        if clearance.gaps(arm.home).min() > FREE:
            balls.append(ball)
    return Scene(arm, X_AB, tuple(balls))


class Source(NamedTuple):
    """What one arm is sent.

    Attributes:
        by_poses: Whether its chunks are of poses.
        smooth: The motion that they follow.
        sent: The chunks.
    """

    by_poses: bool
    smooth: Any
    sent: list[Message]


def sources_of(number: int, scene: Scene) -> dict[str, Source]:
    """Return what both arms are sent: each is led to one place, which is between them."""
    rng = np.random.default_rng((number, 2))
    tools = [part.kinematics().p_WE(part.home) for part in scene.arm.parts]
    place = np.mean(tools, axis=0) + rng.uniform(-0.15, 0.15, 3)
    found = {}
    for name, part in zip(NAMES, scene.arm.parts, strict=True):
        kinematics = part.kinematics()

        def pose_of(q: Array, kinematics: Any = kinematics) -> Array:
            R = RotationMatrix(kinematics.R_WE(q))
            return np.concatenate((kinematics.p_WE(q), R.ToQuaternion().wxyz()))

        q = part.home + rng.uniform(-FAR, FAR, (POSTURES, part.n))
        q = q.clip(part.limits.position_lower + 0.05, part.limits.position_upper - 0.05)
        off = [np.linalg.norm(kinematics.p_WE(each) - place) for each in q]
        by_poses = bool(rng.random() < 0.5)
        smooth = motion(rng, part.home, q[int(np.argmin(off))])
        found[name] = Source(by_poses, smooth, messages(rng, smooth, pose_of if by_poses else None))
    return found


class PairMeshes:
    """The makers' meshes of two Pandas, with the members of `chunks.ArmMeshes`.

    Args:
        one: Those of one.
        X_AB: Where the second one stands.
    """

    def __init__(self, one: ArmMeshes, X_AB: RigidTransform) -> None:
        self._one, self._R, self._p = one, X_AB.rotation().matrix(), X_AB.translation()
        self.points, self.links = one.points * 2, one.links * 2
        self.reach = np.concatenate((one.reach, one.reach))
        count = len(one.points)
        self.joined = [*pairwise(range(count)), *pairwise(range(count, 2 * count))]
        self.joined += [(0, count)]
        self.bases = [0, count]

    def poses(self, q: Array) -> tuple[Array, Array]:
        """Return how links of both are moved, as `ArmMeshes.poses` does."""
        n = q.shape[-1] // 2
        (R_1, p_1), (R_2, p_2) = self._one.poses(q[..., :n]), self._one.poses(q[..., n:])
        p_2 = p_2 @ self._R.T + self._p
        return np.concatenate((R_1, self._R @ R_2), axis=-3), np.concatenate((p_1, p_2), axis=-2)


def shielded(scene: Scene, sources: dict[str, Source], yields: str | None) -> dict[str, Any]:
    """Return what a shield commands, and what it says of it."""
    limits = scene.arm.limits
    limits = limits.replace(
        velocity=np.minimum(limits.velocity, VELOCITY), acceleration=ACCELERATION, jerk=JERK
    )
    shield = DualArmShield(
        scene.arm,
        PERIOD,
        ShieldSettings(compiled=True),
        yields=yields,
        limits=limits,
        obstacles=scene.obstacles,
    )
    coming = sorted(
        ((message, name) for name in NAMES for message in sources[name].sent),
        key=lambda each: each[0].arrives,
    )
    q, v, refused, took = [shield.position], [np.zeros(scene.arm.n)] * 3, list[str](), 0.0
    for t in PERIOD * np.arange(round(DURATION / PERIOD)):
        began = process_time()
        while coming and coming[0][0].arrives <= t:
            message, name = coming.pop(0)
            kind = "poses" if sources[name].by_poses else "positions"
            try:
                shield[name].follow(kind, message.values, message.rate, message.start, t)
            except InvalidInputError as error:
                refused.append(f"{name}: {error}")
        q.append(shield.command(t))
        took += process_time() - began
        v.append(shield.velocity)
    velocities, positions = np.array(v), np.array(q)
    orders = (limits.velocity, limits.acceleration, limits.jerk)
    return {
        "q": positions,
        "us": 1e6 * took / len(q),
        "refused": refused,
        "uncertified": shield.uncertified,
        "limits": [
            float(limits.violation(positions).max()),
            *(
                float((np.abs(np.diff(velocities, n=k, axis=0)) / PERIOD**k / bound).max() - 1.0)
                for k, bound in enumerate(orders)
            ),
        ],
        "summed": float(np.abs(q[0] + PERIOD * np.cumsum(velocities[3:], 0) - q[1:]).max()),
    }


def run(number: int, meshes: ArmMeshes) -> dict[str, Any]:
    """Return what a stream comes to."""
    yields, scene = YIELDS[(number // len(PLACES)) % len(YIELDS)], scene_of(number)
    found: dict[str, Any] = {"seed": [number], "yields": yields}
    try:
        sources = sources_of(number, scene)
        made = shielded(scene, sources, yields)
        q = made.pop("q")
        recount = Recount(PairMeshes(meshes, scene.X_AB), scene.balls)
        t = PERIOD * np.arange(len(q))
        wanted = np.concatenate([sources[name].smooth(t) for name in NAMES], axis=1)
        least, collided = recount.least(q)
        errors = ((q - wanted)[round(1.0 / PERIOD) : round(ENDS / PERIOD)] ** 2).mean(axis=0)
        by_arm = np.sqrt(errors.reshape(2, -1).sum(axis=1))
        found |= made | {
            "distance": least,
            "collided": collided,
            "asks for a collision": recount.least(wanted)[1],
            "error": dict(zip(NAMES, by_arm.tolist(), strict=True)),
        }
    except Exception:
        found["exception"] = traceback.format_exc()
    return found


def print_table(streams: list[dict[str, Any]]) -> None:
    """Print a row for each way to yield."""
    errors = [f"rms error, {name} [mrad]" for name in NAMES]
    beyond = ("streams beyond q", "v", "a", "jerk")
    asks = ("ask for a collision", "collided", "uncertified", "exceptions")
    head("yields", "streams", *beyond, *asks, "least distance [mm]", *errors, "µs")
    for yields in YIELDS:
        some = [each for each in streams if each["yields"] == yields]
        went = [each for each in some if "exception" not in each]
        if not went:
            continue
        kept = [[excess > EXACT for excess in each["limits"]] for each in went]
        counts = [
            sum(bool(each[key]) for each in went)
            for key in ("asks for a collision", "collided", "uncertified")
        ]
        row(
            yields or "neither",
            len(some),
            *np.sum(kept, axis=0),
            *counts,
            len(some) - len(went),
            f"{1e3 * min(each['distance'] for each in went):.2f}",
            *(f"{1e3 * np.median([each['error'][name] for each in went]):.1f}" for name in NAMES),
            f"{np.median([each['us'] for each in went]):.0f}",
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--streams", type=int, default=20, help="number of the last stream")
    parser.add_argument("--first", type=int, default=1, help="number of the first")
    parser.add_argument("--table", action="store_true", help="print what is kept, and run nothing")
    add_folders(parser)
    add_kept(parser)
    options = parser.parse_args()
    if options.kept is None:
        parser.error("--kept is needed")
    known = _kept(options.kept)
    numbers = range(options.first, options.streams + 1)
    meshes = None
    for number in numbers if not options.table else ():
        if number not in known:
            meshes = meshes or ArmMeshes("panda", tuple(options.folder))
            known[number] = run(number, meshes)
            with options.kept.open("a") as lines:
                lines.write(json.dumps(known[number]) + "\n")
    print_table([known[number] for number in numbers if number in known])


def _kept(file: Path) -> dict[int, dict[str, Any]]:
    """Return what is kept of streams, by their numbers."""
    lines = map(json.loads, file.read_text().splitlines()) if file.exists() else ()
    return {line["seed"][0]: line for line in lines}


if __name__ == "__main__":
    main()
