"""Lists of obstacles of all shapes round an arm, in random order, and how far a point is from each.

The distances are worked out here from the documents' numbers, name by name.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from drake_rnn import JointStream, arm_clearance, load_arm, make_obstacles

PANDA = load_arm("panda")
HOME = np.asarray(PANDA.home)
PERIOD, SPEED, ERROR = 0.01, 0.4, 0.002
#: Points of a capsule's axis at which distances are looked at.
SHARES = np.linspace(0.0, 1.0, 101)[:, None]


def shape(kind, center, rng):
    """The fields of an obstacle of a kind at a place, of random size and orientation."""
    rpy, size = rng.uniform(-3.0, 3.0, 3).tolist(), rng.uniform(0.03, 0.12, 3)
    if kind == "ball":
        return {"center": center.tolist(), "radius": float(size[0])}
    if kind == "capsule":
        way = rng.uniform(-0.15, 0.15, 3)
        ends = [(center - way).tolist(), (center + way).tolist()]
        return {"ends": ends, "radius": float(size[0])}
    if kind == "box":
        return {"center": center.tolist(), "size": (2.0 * size).tolist(), "rpy": rpy}
    if kind == "cylinder":
        length = float(3.0 * size[1])
        return {"center": center.tolist(), "radius": float(size[0]), "length": length, "rpy": rpy}
    middle = np.array([0.0, 0.0, 0.4])
    return {"point": center.tolist(), "normal": (middle - center).tolist()}


def distance(fields, points):
    """How far points, shape (k, 3), are from an obstacle, by its fields [m]; 0 within a solid."""
    kind = fields["kind"]
    if kind == "half_space":
        normal = np.array(fields["normal"]) / np.linalg.norm(fields["normal"])
        return (points - fields["point"]) @ normal
    if kind == "capsule":
        a, b = np.array(fields["ends"])
        share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        axis = a + share[:, None] * (b - a)
        return np.linalg.norm(points - axis, axis=1) - fields["radius"]
    local = points - fields["center"]
    if kind == "ball":
        return np.linalg.norm(local, axis=1) - fields["radius"]
    # Extrinsic rotations about x, y, z are what roll, pitch and yaw are.
    local = Rotation.from_euler("xyz", fields["rpy"]).inv().apply(local)
    if kind == "box":
        return np.linalg.norm(np.maximum(np.abs(local) - 0.5 * np.array(fields["size"]), 0), axis=1)
    across = np.linalg.norm(local[:, :2], axis=1) - fields["radius"]
    along = np.abs(local[:, 2]) - 0.5 * fields["length"]
    return np.linalg.norm(np.maximum([across, along], 0.0), axis=0)


def arm_distance(arm, q, fields, p_WO):
    """How far capsules of an arm are from an obstacle that has moved by p_WO, in a posture [m]."""
    segments = arm.segments_in_world(arm.poses.at(q))[arm.carried_by_joint.any(axis=1)]
    radii = arm.radii[arm.carried_by_joint.any(axis=1)]
    points = segments[:, None, 0] + SHARES * (segments[:, 1] - segments[:, 0])[:, None]
    gaps = distance(fields, points.reshape(-1, 3) - p_WO).reshape(len(radii), -1)
    return (gaps.min(axis=1) - radii).min()


def random_list(rng, count=7, limits=None):
    """A list of obstacles by name, of all shapes, about half of which may move, and its law.

    They stand round the arm, clear of it at home.
    """
    kinds = ["ball", "capsule", "box", "cylinder", "half_space"]
    kinds = [*rng.permutation(kinds), *rng.choice(kinds[:4], max(count - 5, 0))][:count]
    alone = arm_clearance(PANDA, [], HOME)[0].arm
    obstacles = []
    for number, kind in enumerate(kinds):
        while True:
            way = rng.normal(size=3) * [1.0, 1.0, 0.6]
            reach = 0.9 if kind == "half_space" else rng.uniform(0.3, 0.8)
            center = np.array([0.0, 0.0, 0.45]) + reach * way / np.linalg.norm(way)
            fields = {"kind": str(kind), "name": f"thing {number}", **shape(kind, center, rng)}
            if arm_distance(alone, HOME, fields, np.zeros(3)) > 0.05:
                break
        if rng.random() < 0.6 or number < 2:
            fields |= {"speed": float(rng.uniform(0.1, SPEED)), "error": ERROR}
        obstacles.append(fields)
    return [obstacles[k] for k in rng.permutation(count)]


def law_among(obstacles, jerk=None):
    """A law that follows joint targets among obstacles of a document."""
    clearance, _ = arm_clearance(PANDA, make_obstacles(obstacles), HOME)
    limits = PANDA.limits.replace(velocity=1.0, acceleration=4.0, jerk=jerk)
    return JointStream(limits=limits, home=HOME, clearance=clearance, timeout=5.0)
