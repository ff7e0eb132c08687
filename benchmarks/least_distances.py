"""Which bodies of an arm can touch within its joint limits, by the convex hulls of their shapes.

::

    python benchmarks/least_distances.py panda
    python benchmarks/least_distances.py my.urdf --frame tool0 --bodies link_4 link_6

It prints the least distance that a search finds for each pair of bodies that no joint connects, or
for one pair, and the posture. One or two joints between them are looked at on a grid, more at
random postures, and a search goes down from the best of these. A hull holds more than its mesh.
"""

from __future__ import annotations

import argparse
from itertools import combinations

from drake_rnn import InvalidInputError, load_arm
from drake_rnn.robot.clearance.arm_clearance import least_distance
from drake_rnn.robot.clearance.arm_shapes import arm_shapes
from drake_rnn.robot.kinematics import holders
from markdown_table import head, row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("arm", help="a shipped arm, or a model file")
    parser.add_argument("--frame", help="frame of a model file's end effector")
    parser.add_argument("--bodies", nargs=2, help="two bodies; by default all pairs")
    options = parser.parse_args()
    changes = {} if options.frame is None else {"frame": options.frame}
    arm = load_arm(options.arm, **changes)
    parts = arm_shapes(arm).parts
    joints = holders(arm.plant()).values()
    joined = {frozenset((j.parent_body().name(), j.child_body().name())) for j in joints}
    names = list(dict.fromkeys(part.body for part in parts))
    pairs = [pair for pair in combinations(names, 2) if frozenset(pair) not in joined]
    head("bodies", "joints between", "least distance [mm]", "posture")
    for pair in [tuple(options.bodies)] if options.bodies else pairs:
        try:
            found = least_distance(arm, pair, parts)
        except InvalidInputError:
            if options.bodies:
                raise
            continue  # nothing moves one beside the other
        posture = ", ".join(f"{q:.3f}" for q in found.posture)
        count, distance = str(len(found.joints)), f"{1e3 * found.distance:.1f}"
        row(f"{pair[0]}, {pair[1]}", count, distance, posture)


if __name__ == "__main__":
    main()
