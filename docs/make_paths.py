"""Draw a path of each kind.

Writes the picture of the page of paths: ``python docs/make_paths.py docs/paths.png``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import drake_rnn
from drake_rnn import (
    Cat,
    Circle,
    Clover,
    Deltoid,
    FourRing,
    Line,
    Nephroid,
    Parallelogram,
    Part,
    Points,
    Sequence,
    Spline,
    Square,
    Svg,
    Text,
    Waypoints,
)
from drake_rnn.figures.style import DESIRED, PAGE, common_style, save

DRAWING = Path(__file__).parents[1] / "diagrams/experiments/pseudoinverse/robot.svg"
ONE = {"period": 8.0, "timing": "quintic", "laps": 1}
WAY = [[0, 0, 0], [0.2, 0.15, 0], [0.35, -0.05, 0], [0.55, 0, 0], [0.5, 0.25, 0], [0.25, 0.3, 0]]
TIMED = {"positions": WAY, "speed": 0.1}
STRAIGHT = {**TIMED, "through": "straight"}
AROUND = {"period": 4.0, "size": 0.1}

#: A path of each kind, by the name written above it.
KINDS: dict[str, drake_rnn.Path] = {
    "circle": Circle(size=0.1, **ONE),
    "nephroid": Nephroid(size=0.04, **ONE),
    "four_ring": FourRing(size=0.1, **ONE),
    "clover": Clover(size=0.1, **ONE),
    "deltoid": Deltoid(size=0.05, **ONE),
    "cat": Cat(size=0.1, **ONE),
    "square": Square(size=0.2, **ONE),
    "square: rounded": Square(size=0.2, corners="rounded", corner_radius=0.06, **ONE),
    "parallelogram": Parallelogram(sides=([0.2, 0.0], [0.1, 0.15]), **ONE),
    "points: closed": Points(points=WAY, closed=True, **ONE),
    "line": Line(by=[0.3, 0.15, 0.0], **ONE),
    "spline; points": Spline(points=WAY, **ONE),
    "text": Text(text="R2", size=0.2, speed=0.1, acceleration=0.2),
    "text: scripts": Text(text="ring", font="scripts", size=0.2, speed=0.3, acceleration=0.5),
    "svg": Svg(file=str(DRAWING), size=0.3, speed=0.4, acceleration=0.6),
    "waypoints": Waypoints(**TIMED),
    "waypoints: cubic": Waypoints(**TIMED, through="cubic"),
    "waypoints: straight": Waypoints(**STRAIGHT),
    "straight, blend_radius": Waypoints(**STRAIGHT, blend_radius=0.06),
    "sequence: circle, line": Sequence(
        parts=[
            Part(path=Circle(**AROUND), lasts=5.0),
            Part(path=Line(by=[0.2, 0.1, 0], period=2.0, timing="quintic"), bridge=1.5),
        ]
    ),
    "sequence: line, circle": Sequence(
        parts=[
            Part(path=Line(by=[0.2, 0.1, 0], period=2.0), lasts=1.5),
            Part(path=Circle(laps=1, **AROUND), bridge=1.0),
        ]
    ),
}


def draw() -> Figure:
    """Return the picture: each path with its start and its end, and a dot each 0.4 s."""
    columns = 6
    rows = -(-len(KINDS) // columns)
    with common_style():
        figure = Figure(figsize=(PAGE, 1.45 * rows), layout="constrained")
        axes = figure.subplots(rows, columns).ravel()
        for ax in axes:
            ax.axis("off")
        for ax, (name, path) in zip(axes, KINDS.items(), strict=False):
            placed = path.placed(np.zeros(3))
            end = min(placed.duration, placed.traversal)
            x, y, _ = np.array([placed.position(t)[0] for t in np.linspace(0, end, 801)]).T
            ax.plot(x, y, color=DESIRED["color"], linewidth=1.2)
            x, y, _ = np.array([placed.position(t)[0] for t in np.arange(0, end, 0.4)]).T
            ax.plot(x, y, ".", color=DESIRED["color"], markersize=3)
            ax.plot(*placed.position(0.0)[0][:2], "o", color="black", markersize=4)
            if not placed.closed:
                last = placed.position(end)[0]
                ax.plot(*last[:2], "s", color="black", markersize=5, markerfacecolor="none")
            ax.set_title(name, fontsize=6)
            ax.set_aspect("equal", adjustable="datalim")
            ax.margins(0.12)
    return figure


if __name__ == "__main__":
    with common_style():
        save(draw(), sys.argv[1])
