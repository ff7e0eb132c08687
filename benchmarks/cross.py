"""Run every law on every shipped arm at both levels and print a page with the table as Markdown.

After them comes every kind of system with every law that can have it, and on every arm.

`make cross` writes it to docs/cross.md. What was found of each cell is kept in a file, from which
the page is made, so that some rows alone can be made anew, or those that are missing::

    python benchmarks/cross.py --laws zeroing --arms panda > docs/cross.md
    python benchmarks/cross.py --laws zeroing --systems "two tools" > docs/cross.md
    python benchmarks/cross.py --missing > docs/cross.md

The exit status is 1 if the arm with full dynamics of any cell is more than 2 mm off where the ideal
one is within 1 mm.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from textwrap import wrap

from cross_cells import (
    ALL_VARIANTS,
    LEVELS,
    SYSTEM_ARM,
    SYSTEMS,
    VARIANTS,
    document,
    law_of,
    system_document,
    system_levels,
    system_variants,
)
from drake_rnn import InvalidInputError, SimulationError, make_experiment, shipped_arms, simulate
from drake_rnn.laws import LAWS
from drake_rnn.measures import violation_metric
from drake_rnn.robot.limits import LIMIT_UNITS
from markdown_table import broken_limits, head, row

# A law's own error below which its arm with full dynamics is held to the second one [m].
_GOOD, _HELD = 1e-3, 2e-3

# Excess of a limit that is no more than rounding.
_ROUNDING = 1e-9

_COMMAND = "python benchmarks/cross.py"
# What was found of each cell, beside the page.
_KEPT = Path(__file__).parents[1] / "docs/cross.json"
# Metrics that the page shows.
_SHOWN = (
    *("position_error_max_m", "end_effector_drift_max_m"),
    *("joint_drift_max_rad", "joint_error_max_rad"),
    *("force_error_rms_N", "force_error_max_N"),
    *map(violation_metric, LIMIT_UNITS),
    *dict.fromkeys(
        name for system in SYSTEMS.values() for name in (system.path, *system.measures.values())
    ),
)

#: Variant, arm and level; and the system, if it is not a path with the arm alone.
Place = tuple[str, ...]
_HEAD = """\
# Every law on every arm

<!-- Made by `make cross`. -->

`make cross` runs every law on every shipped arm, without and with dynamics;
`benchmarks/cross_cells.py` has the documents. Each arm follows a circle with a radius of 3 % of its
length, in 8 s a lap from rest to rest; errors and drift are those of the second lap. Limits are 0.5
rad/s and 1 rad/s^2 and, where a law or filter bounds higher derivatives, also 5 rad/s^3, 50 rad/s^4
and 500 rad/s^5. With dynamics the motors have their default gains, and a law sees the measured arm
or, if a filter follows the law, an ideal arm.

- *error*: largest distance from the path; for the adjustments, distance of the end effector from
  its place; for motion-force control, distance along the surface.
- *drift*: largest joint displacement over the lap; for the adjustments, the distance that is left
  to the target posture after 4 s.
- *limits*: how far the arm exceeds the limits that the law, or the filter behind the law, declares
  to keep; *kept* means to within 1e-9. A law bounds its command: an arm with mass overshoots a
  command that changes its acceleration at once, and injected noise is not part of it.
- *x real time*: simulated over wall time at both levels, beside other work; [cost](cost.md) has
  undisturbed figures.

`docs/cross.json` keeps the cells; `python benchmarks/cross.py --laws zeroing` makes some anew,
`--missing` the others.
"""
_PRESSING = """\

Motion-force control presses with 5 N, on a spring of 8 kN/m without dynamics and on a rigid plate
with friction 0.3 with them:
"""

_SYSTEMS = """\

## Every system by every law that can have it

A law that keeps its limits leaves a path that asks for more; what first learns is late.
"""


@dataclass(frozen=True)
class Cell:
    """A cell of the table: a run, or the reason why there is none.

    Attributes:
        variant, arm, level: Its place in the table.
        keeps: Limits that the law, or a filter behind it, says it keeps.
        metrics: Metrics of the run.
        warnings: Warnings of the run.
        reason: Why it did not run; empty if it did.
        pace: Simulated time over wall time.
        system: Kind of system; empty for a path with the arm alone.
    """

    variant: str
    arm: str
    level: str
    keeps: tuple[str, ...] = ()
    metrics: dict[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    reason: str = ""
    pace: float = 0.0
    system: str = ""

    @property
    def place(self) -> Place:
        """Where it is kept."""
        return (self.variant, self.arm, self.level, *([self.system] if self.system else []))

    @property
    def error(self) -> float:
        """Largest error of the end effector [m]."""
        seeks = "joint_error_max_rad" in self.metrics
        return self.metrics["end_effector_drift_max_m" if seeks else "position_error_max_m"]

    @property
    def drift(self) -> float:
        """Joint displacement over the lap, or what is left to the target posture [rad]."""
        return self.metrics.get("joint_error_max_rad", self.metrics.get("joint_drift_max_rad", 0.0))

    @property
    def limits(self) -> str:
        """What is exceeded of the limits that the law says it keeps."""
        if not self.keeps:
            return "none"
        excess = {name: self.metrics.get(violation_metric(name), 0.0) for name in self.keeps}
        broken = [
            f"{name} by {by:.2g} {LIMIT_UNITS[name]}"
            for name, by in excess.items()
            if by > _ROUNDING
        ]
        return ", ".join(broken) or "kept"


def run(place: Place) -> Cell:
    """Run the cell at a place."""
    (variant, arm, level), system = place[:3], "".join(place[3:])
    try:
        asked = system_document(system, *place[:3]) if system else document(variant, arm, level)
        experiment = make_experiment(asked)
        result = simulate(experiment)
    except (InvalidInputError, SimulationError) as error:
        return Cell(variant, arm, level, reason=str(error), system=system)
    return Cell(
        *(variant, arm, level),
        (*experiment.guarantees.arm.limits, *experiment.guarantees.command_only),
        {name: result.metrics[name] for name in _SHOWN if name in result.metrics},
        tuple(result.warnings),
        pace=result.timings["real_time_factor"],
        system=system,
    )


def run_all(places: list[Place], jobs: int, known: dict[Place, Cell], kept: Path) -> None:
    """Run the cells at places in several processes; each is known, and kept, once it has ended."""
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for ended in as_completed([pool.submit(run, place) for place in places]):
            cell = ended.result()
            known[cell.place] = cell
            keep(known, kept)
            print(", ".join(cell.place), cell.reason, file=sys.stderr, flush=True)


def keep(cells: Mapping[Place, Cell], kept: Path) -> None:
    """Write cells to a file, one a line, in order of the page."""
    rows = [asdict(cells[place]) for place in all_places() if place in cells]
    lines = ",\n".join(
        json.dumps({k: v for k, v in row.items() if v or k != "system"}) for row in rows
    )
    kept.write_text(f"[\n{lines}\n]\n")


def kept_cells(kept: Path) -> dict[Place, Cell]:
    """Return the cells of a file, by place; none if there is no such file."""
    if not kept.exists():
        return {}
    rows = json.loads(kept.read_text())
    lists = ("keeps", "warnings")
    cells = [Cell(**{**row, **{name: tuple(row[name]) for name in lists}}) for row in rows]
    return {cell.place: cell for cell in cells}


def all_places() -> list[Place]:
    """Return the places of all cells, in order of the page."""
    systems = (
        (variant, arm, level, system)
        for system, arm in product(SYSTEMS, shipped_arms())
        for variant in system_variants(system, arm)
        for level in system_levels(system, variant, arm)
    )
    return [*product(VARIANTS, shipped_arms(), LEVELS), *systems]


def misses(cells: Iterable[Cell]) -> list[str]:
    """Return the places where dynamics make a good law bad."""
    ran = {(cell.variant, cell.arm, cell.level): cell for cell in cells if not cell.reason}
    return [
        f"{variant} on {arm}: {ran[variant, arm, 'dynamic'].error:.2g} m"
        for variant, arm, level in ran
        if level == "kinematic"
        and ran[variant, arm, level].error < _GOOD
        and (variant, arm, "dynamic") in ran
        and ran[variant, arm, "dynamic"].error > _HELD
    ]


def arm_table(arm: str, pairs: dict[str, list[Cell]]) -> None:
    """Print the table of one arm."""
    print(f"\n## {arm}")
    both = [f"{what}, {level}" for what in ("error [m]", "drift [rad]") for level in LEVELS]
    limits = (f"limits, {level}" for level in LEVELS)
    head("law", *both, "keeps", *limits, "x real time", made_by=_COMMAND)
    for variant, cells in pairs.items():
        if reason := next((cell.reason for cell in cells if cell.reason), ""):
            row(variant, f"does not run: {reason}", *["-"] * 7)
            continue
        row(
            variant,
            *(f"{cell.error:.2g}" for cell in cells),
            *(f"{cell.drift:.2g}" for cell in cells),
            ", ".join(cells[0].keeps) or "none",
            *(cell.limits for cell in cells),
            ", ".join(f"{cell.pace:.2g}" for cell in cells),
        )


def force_table(cells: Iterable[Cell]) -> None:
    """Print the force errors of the cells that press."""
    pressing = [cell for cell in cells if "force_error_rms_N" in cell.metrics]
    if not pressing:
        return
    print(_PRESSING)
    columns = ("force, rms error [N]", "force, largest error [N]")
    head("law", "arm", "level", *columns, made_by=_COMMAND)
    for cell in pressing:
        errors = (cell.metrics[f"force_error_{name}_N"] for name in ("rms", "max"))
        row(cell.variant, cell.arm, cell.level, *(f"{error:.2g}" for error in errors))


def system_table(system: str, cells: list[Cell]) -> None:
    """Print what each law does with a system, on one arm, and why others do not."""
    kind = SYSTEMS[system]
    print(f"\n### {system[0].upper()}{system[1:]}")
    columns = ("path [m]", *kind.measures)
    head("law", "level", *columns, "keeps", "exceeds", made_by=_COMMAND)
    for cell in cells:
        if not cell.reason:
            row(cell.variant, cell.level, *_system_row(cell))
    for reason, refused in refusals(cells).items():
        row("; ".join(refused), "-", f"does not run: {reason}", *["-"] * (len(columns) + 1))


def refusals(cells: Iterable[Cell]) -> dict[str, list[str]]:
    """Return the laws that do not run, with their levels if they run at others, by the reason."""
    cells = list(cells)
    ran = {cell.variant for cell in cells if not cell.reason}
    found: dict[str, dict[str, None]] = {}
    for cell in cells:
        if cell.reason:
            name = LAWS[law_of(cell.variant)["kind"]].__name__
            said = f"{cell.variant}, {cell.level}" if cell.variant in ran else cell.variant
            found.setdefault(cell.reason.replace(name, "this law"), {})[said] = None
    return {reason: list(names) for reason, names in found.items()}


def arms_table(cells: Iterable[Cell]) -> None:
    """Print each system on each arm, by one law."""
    head("system", "arm", "law", "level", "path [m]", "other error", "exceeds", made_by=_COMMAND)
    for cell in cells:
        place = (cell.system, cell.arm, cell.variant, cell.level)
        if cell.reason:
            row(*place, f"does not run: {cell.reason}", "-", "-")
            continue
        errors = _system_row(cell)[:-2]
        others = zip(SYSTEMS[cell.system].measures, errors[1:], strict=True)
        row(*place, errors[0], ", ".join(map(": ".join, others)) or "-", _system_row(cell)[-1])


def _system_row(cell: Cell) -> list[str]:
    kind = SYSTEMS[cell.system]
    path = "end_effector_drift_max_m" if "joint_error_max_rad" in cell.metrics else kind.path
    errors = (cell.metrics.get(name) for name in (path, *kind.measures.values()))
    values = ["-" if error is None else f"{error:.2g}" for error in errors]
    exceeded = {name: value for name, value in cell.metrics.items() if value > _ROUNDING}
    return [*values, ", ".join(cell.keeps) or "none", broken_limits(exceeded)]


def print_systems(found: Mapping[Place, Cell]) -> None:
    """Print the tables of systems, of those that were run."""
    cells = [found[place] for place in all_places() if len(place) > 3 and place in found]
    if not cells:
        return
    print(_SYSTEMS)
    head("what", "meaning")
    row(
        "every system",
        "given to every law with a Panda, and to one law with every arm; a lap of 4 s, or 8 s with "
        "a base, whose circle is five times as large; errors are the largest of the second half",
    )
    row("exceeds", "largest excess of each limit, whether or not the law keeps it")
    for system, kind in SYSTEMS.items():
        row(system, kind.says)
    print()
    if left := sum(len(place) > 3 and place not in found for place in all_places()):
        print(f"{left} of {left + len(cells)} of these cells are not run yet.")
    arms_table(cell for cell in cells if cell.variant == SYSTEMS[cell.system].law)
    for system in SYSTEMS:
        system_table(
            system, [cell for cell in cells if (cell.system, cell.arm) == (system, SYSTEM_ARM)]
        )


def summary(cells: list[Cell]) -> str:
    """Return how much the dynamics add to the errors."""
    ran = {(cell.variant, cell.arm, cell.level): cell.error for cell in cells if not cell.reason}
    added = {
        (variant, arm): ran[variant, arm, "dynamic"] - error
        for (variant, arm, level), error in ran.items()
        if level == "kinematic" and (variant, arm, "dynamic") in ran
    }
    if not added:
        return ""
    worst = max(added, key=lambda place: added[place])
    warned = [cell for cell in cells if any(said.startswith("plant: ") for said in cell.warnings)]
    return (
        f"Dynamics add at most {added[worst]:.2g} m to the error ({worst[0]} on {worst[1]}); "
        f"{len(misses(cells))} of {len(added)} pairs are more than {_HELD * 1e3:g} mm off with "
        f"dynamics and less than {_GOOD * 1e3:g} mm without; "
        f"in {len(warned)} runs an arm is far from the command to its motors."
    )


def not_run(found: Mapping[Place, Cell]) -> str:
    """Return what to say of pairs of law and arm that were not run; empty if there are none."""
    pairs = list(product(VARIANTS, shipped_arms()))
    left = [pair for pair in pairs if any((*pair, level) not in found for level in LEVELS)]
    if not left:
        return ""
    arms = ", ".join(dict.fromkeys(arm for _, arm in left))
    return (
        f" {len(left)} of {len(pairs)} pairs of law and arm have not been run, which are the rows "
        f"that tables lack ({arms})."
    )


def main() -> int:
    """Print the page; return 1 if a cell misses."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--laws", nargs="*", default=ALL_VARIANTS, choices=ALL_VARIANTS)
    parser.add_argument("--arms", nargs="*", default=shipped_arms(), choices=shipped_arms())
    parser.add_argument(
        "--systems",
        nargs="*",
        default=["", *SYSTEMS],
        choices=["", *SYSTEMS],
        help="kinds of systems; an empty one is the first table of the page",
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--missing", action="store_true", help="leave out cells that are kept")
    parser.add_argument("--kept", type=Path, default=_KEPT, help="file of cells that were run")
    given = parser.parse_args()
    known = kept_cells(given.kept)
    places = [
        place
        for place in all_places()
        if place[0] in given.laws and place[1] in given.arms and "".join(place[3:]) in given.systems
    ]
    run_all(
        [place for place in places if not (given.missing and place in known)],
        given.jobs,
        known,
        given.kept,
    )
    found = {place: known[place] for place in all_places() if place in known}
    cells = [cell for cell in found.values() if not cell.system]
    print(_HEAD)
    print("\n".join(wrap(f"{summary(cells)}{not_run(found)}", 100)))
    for arm in shipped_arms():
        ran = [law for law in VARIANTS if all((law, arm, level) in found for level in LEVELS)]
        if ran:
            arm_table(arm, {law: [found[law, arm, level] for level in LEVELS] for law in ran})
    force_table(cells)
    print_systems(found)
    for missed in misses(cells):
        print(missed, file=sys.stderr)
    return int(bool(misses(cells)))


if __name__ == "__main__":
    sys.exit(main())
