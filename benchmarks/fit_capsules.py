"""Fit capsules to the links of an arm, and write them to a file.

::

    python benchmarks/fit_capsules.py panda drake_rnn/models/panda/capsules.yaml

It prints how much larger each is than the hull of what it holds. Pairs of bodies whose capsules
touch where the arm is at home, and of which no joint connects the two, are left out.
"""

from __future__ import annotations

import argparse
from itertools import combinations
from pathlib import Path

import numpy as np
from pydrake.geometry import CalcVolume, Convex

from drake_rnn import load_arm
from drake_rnn.inputs.documents import to_yaml
from drake_rnn.robot.clearance import Clearance
from drake_rnn.robot.clearance.arm_capsules import fitted_capsules, place_capsules
from drake_rnn.robot.clearance.arm_clearance import TOUCHING
from drake_rnn.robot.clearance.arm_shapes import parts_of
from drake_rnn.robot.clearance.enclosing_capsule import Enclosing
from drake_rnn.robot.clearance.solids import Solids
from markdown_table import head, row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("arm", help="a shipped arm, or a model file")
    parser.add_argument("file", type=Path)
    parser.add_argument("--frame", help="frame of a model file's end effector")
    options = parser.parse_args()
    changes = {} if options.frame is None else {"frame": options.frame}
    arm = load_arm(options.arm, capsules=None, **changes)
    tool = None if arm.tool is None else "tool"
    parts = [part for part in parts_of(arm) if part.body != tool]
    capsules = fitted_capsules(parts)
    head("body", "radius [m]", "length [m]", "volume over that of the hull")
    for part, capsule in zip(parts, capsules, strict=True):
        ends = np.array(capsule.ends)
        volume = Enclosing(ends, capsule.radius).volume / CalcVolume(
            Convex(part.points.T, part.body)
        )
        length = float(np.linalg.norm(ends[1] - ends[0]))
        row(part.body, f"{capsule.radius:.4f}", f"{length:.4f}", f"{volume:.2f}")
    placed = place_capsules(arm, capsules)
    own = np.array(
        [
            (a, b)
            for a, b in combinations(range(len(capsules)), 2)
            if abs(placed.links[a] - placed.links[b]) > 1
        ]
    )
    home = np.zeros(arm.n) if arm.home is None else arm.home
    touching = own[Clearance(placed, own, Solids.of([])).gaps(home) < TOUCHING]
    contents = {
        "capsules": [
            {
                "body": capsule.body,
                "ends": [[round(float(x), 6) for x in end] for end in capsule.ends],
                # Rounded up, so that it holds what it held.
                "radius": float(np.ceil(capsule.radius * 1e6 + 2.0) / 1e6),
            }
            for capsule in capsules
        ],
        "left_out": [[capsules[a].body, capsules[b].body] for a, b in touching],
    }
    options.file.write_text(to_yaml(contents))


if __name__ == "__main__":
    main()
