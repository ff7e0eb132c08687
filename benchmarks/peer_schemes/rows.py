"""Rows of the tables: what was measured of each scheme, in words."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, nan

from peer_schemes.figures import Figures

#: Up to this excess, relative to a bound, it counts as kept: solvers stop at a tolerance.
ROUNDING = 2e-6
#: What the name of a law of ours ends in where it is compiled to C.
IN_C = ", in C"


@dataclass(frozen=True)
class Row:
    """What was measured of a scheme on a task; a scheme that did not run says why.

    Attributes:
        name: Name of the scheme.
        setting: What is set, or why it did not run.
        figures: What was measured of its motion.
        cost: Cost of a step, in units of pydrake's p_WE and J.
        diagram: Cost of a sample of our whole diagram, likewise.
        failures: Number of samples without a solution.
    """

    name: str
    setting: str
    figures: Figures | None = None
    cost: float = nan
    diagram: float = nan
    failures: int = 0

    @property
    def keeps_bounds(self) -> bool:
        """Whether the motion kept the bounds of position, velocity and acceleration."""
        found = self.figures
        most = 1.0 + ROUNDING
        return (
            found is not None
            and max(found.velocity, found.acceleration) <= most
            and found.beyond <= ROUNDING
        )

    def cells(self, oriented: bool) -> list[str]:
        """Return the cells of the row in a table.

        Args:
            oriented: Whether the orientation is a part of the task.
        """
        found = self.figures
        if found is None:
            return [self.name, self.setting, *[""] * (len(columns(oriented)) - 2)]
        cost = "" if not isfinite(self.cost) else f"{self.cost:.{1 if self.cost >= 2.0 else 2}f}"
        if isfinite(self.diagram):
            cost = f"{cost} ({self.diagram:.1f})"
        turned = [digits(1e6 * found.turned_max)] if oriented else []
        return [
            self.name,
            self.setting,
            cost,
            f"{digits(1e6 * found.error_max)} / {digits(1e6 * found.error_rms)}",
            *turned,
            f"{found.settling:.2f}" if isfinite(found.settling) else "never",
            ratio(found.velocity),
            ratio(found.acceleration),
            digits(found.jerk),
            digits(1e3 * found.drift),
            str(self.failures),
        ]


def columns(oriented: bool) -> list[str]:
    """Return the head of a table."""
    turned = ["orientation max [urad]"] if oriented else []
    return [
        "scheme",
        "setting",
        "u a step (diagram)",
        "error max / rms [um]",
        *turned,
        "settles [s]",
        "v / bound",
        "a / bound",
        "jerk [rad/s^3]",
        "drift [mrad]",
        "failures",
    ]


def ratio(value: float) -> str:
    """Return a ratio to a bound; what is next to 1 as its difference from 1."""
    excess = value - 1.0
    if abs(excess) < 1e-9:
        return "1"
    if abs(excess) < 1e-3:
        return f"1 {'+' if excess > 0 else '-'} {abs(excess):.0e}"
    return f"{value:.3g}" if value < 1e3 else f"{value:.0f}"


def digits(value: float) -> str:
    """Return a number rounded to two digits, without an exponent where it is not tiny."""
    rounded = float(f"{value:.2g}")
    return f"{rounded:.0f}" if rounded >= 100.0 else f"{rounded:g}"
