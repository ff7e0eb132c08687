"""Tables for the terminal.

- Tables of commands: shown on a terminal, and written to the files that are asked for.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ..errors import InvalidInputError
from ..experiment import COUNTED_LIMITS
from ..inputs.messages import nearest
from ..jobs.requests import Row
from ..jobs.summary import Group, Spread, Statistic, format_values
from ..measures import METRICS, format_number, place_metrics, superscript
from ..robot.clearance.arm_capsules import Fit
from ..robot.limits import DERIVATIVE_UNITS, JointLimits
from ..robot.load_arm import ArmReport
from ..runs.folder import require_output
from ..runs.limit_use import uses
from ..runs.result import (
    Result,
    Verdict,
    bound_text,
    hyphened,
    name_with_ending,
    value_and_unit,
)
from ..tables import (
    BROKEN,
    BROKEN_MEANS,
    SPREAD,
    Cell,
    Column,
    Heading,
    Sheet,
    metric_heading,
    require_format,
    write_sheet,
)
from .console import WIDE, SafeConsole, out, print_whole


def require_tables(files: Sequence[Path] | None) -> None:
    """Raise an InvalidInputError unless all files of ``--table`` can be of a known format."""
    for file in files or []:
        require_format(file, "--table")
        require_output(file, "--table")


def write_tables(sheet: Sheet, files: Sequence[Path] | None) -> None:
    """Write a table to the files of ``--table``, and name them.

    Raises:
        InvalidInputError: If one cannot be written.
    """
    for file in files or []:
        write_sheet(sheet, file)
        out.print(escape(f"table    {file}"), soft_wrap=True)


def chosen_metrics(args: str | None) -> list[str]:
    """Return the metrics of ``--metrics``; none if it is not given.

    Raises:
        InvalidInputError: If one of them is unknown or given twice.
    """
    if args is None:
        return []
    names = split_words(args)
    for name in names:
        if name not in METRICS.names:
            raise InvalidInputError(f"--metrics: no {name!r}; {nearest(name, list(METRICS.names))}")
        if names.count(name) > 1:
            raise InvalidInputError(f"--metrics: {name} is given twice")
    return names


def split_words(text: str) -> list[str]:
    """Return the words between commas."""
    return [word.strip() for word in text.split(",")]


def terminal_table(sheet: Sheet) -> Table:
    """Return a table for the terminal: names, and units and bounds beside the numbers."""
    sheet = sheet.for_terminal()
    table = Table(
        box=SIMPLE_HEAD, title=escape(sheet.title) or None, caption=escape(sheet.note) or None
    )
    for column in sheet.columns:
        side: Literal["left", "right"] = "right" if column.right else "left"
        table.add_column(escape(str(column.heading)), overflow="fold", justify=side)
    for row in sheet.rows:
        table.add_row(*map(shown_cell, row))
    return table


#: Least share of a table that is left when every column is as wide as its longest word.
_SPARE = 0.25


def fitted(sheet: Sheet) -> Table:
    """Return a table of sentences for the terminal, whose words are not broken.

    Where that leaves no room, each row is a record: the name of a column, and its entry beside.
    """
    table = terminal_table(sheet)
    if not out.is_terminal:
        return table
    room = out.width - 3 * len(table.columns) - 1
    texts = [
        [str(column.heading), *(str(row[k]) for row in sheet.rows)]
        for k, column in enumerate(sheet.columns)
    ]
    least = [max(len(word) for text in each for word in text.split()) for each in texts]
    more = [max(len(line) for text in each for line in text.split("\n")) for each in texts]
    more = [most - few for most, few in zip(more, least, strict=True)]
    spare = room - sum(least)
    if spare < min(_SPARE * room, sum(more)):
        return _records(sheet, table)
    for column, few, wish in zip(table.columns, least, more, strict=True):
        column.width = few + min(wish, spare * wish // max(1, sum(more)))
    return table


def _records(sheet: Sheet, table: Table) -> Table:
    """Return a table of two columns, names and entries, with the title and note of another."""
    records = Table(box=None, show_header=False, padding=(0, 2, 0, 0), title=table.title)
    records.caption = table.caption
    records.add_column(no_wrap=True)
    records.add_column(overflow="fold")
    for row in sheet.for_terminal().rows:
        for column, entry in zip(sheet.columns, row, strict=True):
            records.add_row(escape(str(column.heading)), shown_cell(entry))
        records.add_row("", "")
    return records


def shown_cell(entry: Heading | Cell | str) -> str:
    """Return an entry as rich markup: what is outside its bound in red, with a mark."""
    if not isinstance(entry, Cell):
        return escape(str(entry))
    mark = f" {BROKEN}" if entry.is_broken else ""
    text = escape(f"{entry}{mark} ({entry.bound})" if entry.bound else f"{entry}{mark}")
    return text if entry.kept else f"[red]{text}[/]"


def print_sheet(sheet: Sheet, keys: int = 1) -> None:
    """Print a table; on a terminal, columns that do not fit beside follow in tables of their own.

    Args:
        sheet: The table.
        keys: Number of its first columns that are in each of the tables.
    """
    wide = SafeConsole(width=WIDE, highlight=False, emoji=False, quiet=out.quiet)
    for table in sheet_tables(sheet, keys, out.width if out.is_terminal else None):
        if out.is_terminal:
            wide.print(table)
        else:
            print_whole(table)
    if sheet.is_broken:
        out.print(f"{BROKEN} {BROKEN_MEANS}")


#: Widths of columns of numbers, where their headers break, and of a sweep's values [characters].
_HEADER, _VALUE = 13, 40


def arm_joints_sheet(report: ArmReport) -> Sheet:
    """Return a table of an arm's joints: limits, weight and home posture."""
    arm, limits = report.arm, report.arm.limits
    limit_names = [name for name in DERIVATIVE_UNITS if limits.bounds[name] is not None]
    column_names = list(dict.fromkeys(("velocity", "acceleration", *limit_names)))
    names = (
        "position [rad]",
        *(f"{name} [{superscript(DERIVATIVE_UNITS[name])}]" for name in column_names),
        *("effort [N m]", "weight [N m]", "share", "home [rad]"),
    )
    columns = (Column(Heading(name), right=True) for name in names)
    sheet = Sheet((Column(Heading("joint")), *columns), title=arm.name)
    for k, joint in enumerate(arm.joints):
        lower, upper = limits.position_lower[k], limits.position_upper[k]
        row = (
            joint if arm.units[k] == "rad" else f"{joint} (in m, N)",
            f"{_bound(lower, 'none')} .. {_bound(upper, 'none')}",
            *(_bound_of(limits, name, k) for name in column_names),
            _bound(arm.effort[k]),
            f"{round(report.weight_torque[k], 6):.3g}",
            f"{report.weight_share[k]:.0%}" if np.isfinite(arm.effort[k]) else "-",
            format_number(report.home[k]),
        )
        sheet.rows.append(row)
    return sheet


def _bound_of(limits: JointLimits, name: str, joint: int) -> str:
    """Return the bound of a derivative of a joint; those of both directions if they differ."""
    if (bound := limits.bounds[name]) is None:
        return "unknown"
    if not limits.has_sides(name):
        return _bound(bound[joint])
    down, up = (side[joint] for side in limits.sides(name))
    return f"{_bound(-down, 'none')} .. {_bound(up, 'none')}"


def _bound(value: float, without: str = "unknown") -> str:
    return format_number(value) if np.isfinite(value) else without


def fits_table(fits: Sequence[Fit]) -> Table:
    """Return a table of how closely capsules contain the bodies of an arm."""
    table = Table(box=SIMPLE_HEAD)
    for name in ("body", "radii \\[mm]", "volume over the hull's", "farthest face outside \\[mm]"):
        table.add_column(name, justify="left" if name == "body" else "right")
    for fit in fits:
        radii = ", ".join(f"{1e3 * radius:.1f}" for radius in fit.radii)
        excess = f"{fit.volume / fit.hull:.2f}"
        table.add_row(escape(fit.body), radii, excess, f"{1e3 * fit.outside:.3f}")
    return table


def arm_table(report: ArmReport) -> Table:
    """Return a table of an arm's other figures, with lines to paste into an experiment."""
    arm, tool = report.arm, report.arm.tool
    home = ", ".join(f"{angle:.6g}" for angle in report.home)
    tool_text = "none" if arm.tip is None else f"in the model, at {arm.tip}"
    if tool is not None:
        tool_text = (
            f"{tool.mass:g} kg on {tool.mount}, ball of {tool.ball * 1e3:g} mm at {tool.tip}"
        )
    verdict = "yes" if report.carries_itself else "[red]no[/]"
    if not np.isfinite(arm.effort).all():
        verdict += ", as far as efforts are known"
    rows = {
        "model": escape(str(arm.model)),
        "limits": escape(str(arm.description.limits or "those of the model")),
        "task frame E": escape(arm.frame),
        "tool": escape(tool_text),
        "home, proposed" if report.home_is_proposed else "home": f"home: \\[{home}]",
        **({"named postures": escape(", ".join(sorted(arm.postures)))} if arm.postures else {}),
        "E at home [m]": ", ".join(format_number(round(value, 6)) for value in report.p_WE_home),
        "distance of E from the base [m]": f"{report.reach[0]:.3g} to {report.reach[1]:.3g}",
        "eigenvalues of M [kg m²]": f"{report.inertia[0]:.3g} to {report.inertia[1]:.3g}",
        "mass [kg]": format_number(report.mass),
        "carries itself and its tool": verdict,
    }
    table = Table(
        box=None,
        show_header=False,
        caption=f"distances, M and weight over {report.postures} random postures",
    )
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in rows.items():
        table.add_row(escape(name), value)
    return table


def metrics_table(result: Result) -> Table:
    """Return a table of a run's metrics, first those with bounds that they are expected to keep."""
    verdicts = {verdict.metric: verdict for verdict in result.verdicts}
    table = Table(box=SIMPLE_HEAD, title=escape(name_with_ending(result.experiment.name, result)))
    table.add_column("metric", no_wrap=True)
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    table.add_column("bound")
    table.add_column("")
    bounds = {name: _bound_and_verdict(verdict) for name, verdict in verdicts.items()}
    bounds |= dict(_commanded_bounds(result))
    # What the document asks for stands before what holds by construction.
    asked = result.experiment.document.accept
    for name in sorted(bounds, key=lambda name: name not in asked):
        bound = verdicts[name].bound if name in verdicts else None
        table.add_row(name, *value_and_unit(name, result.metrics.get(name), bound), *bounds[name])
    table.add_section()
    for name, value in result.metrics.items():
        if name not in bounds:
            table.add_row(name, *value_and_unit(name, value), "", "")
    return table


def _commanded_bounds(result: Result) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield ratios to limits that the law keeps of its command alone, with what the arm did."""
    metrics = {verdict.metric for verdict in result.verdicts}
    names = result.experiment.guarantees.command_only
    for use in uses(result):
        if use.name in names and use.name in DERIVATIVE_UNITS:
            metric = COUNTED_LIMITS[use.name].share
            if metric not in metrics:
                passed = "[yellow]the arm passed it[/]" if use.broken else ""
                yield metric, ("≤ 1 (command)", passed)


def _bound_and_verdict(verdict: Verdict) -> tuple[str, str]:
    bound = hyphened(bound_text(verdict.metric, verdict.bound))
    return bound, "ok" if verdict.met else f"[red]{verdict.word}[/]"


def joints_sheet(result: Result) -> Sheet | None:
    """Return a table of the final joint errors to the target posture; None without a target."""
    experiment = result.experiment
    if experiment.target is None or result.time.size == 0:
        return None
    names = ("start [rad]", "target [rad]", "end [rad]")
    columns = (Column(Heading(name), right=True) for name in names)
    apart = Column(Heading("|error|", unit="rad"), right=True)
    sheet = Sheet((Column(Heading("joint")), *columns, apart))
    end, error = result.series["position"][-1], result.series["joint_error"][-1]
    for name, *values, off in zip(
        experiment.arm.joints, experiment.start, experiment.target, end, error, strict=True
    ):
        sheet.rows.append((name, *(f"{value:.6g}" for value in values), Cell((abs(off),))))
    return sheet


def sweep_sheet(
    keys: Sequence[str],
    rows: Sequence[Row],
    metrics: Sequence[str],
    units: Mapping[str, str] = MappingProxyType({}),
) -> Sheet:
    """Return a table with one row per run of a sweep.

    Args:
        keys: Swept keys.
        rows: The runs.
        metrics: Names of the metrics of its columns.
        units: Units of the swept keys, as far as they are known.
    """
    key_columns = (Column(Heading(key, unit=units.get(key, ""))) for key in keys)
    metric_columns = (Column(metric_heading(name), right=True) for name in metrics)
    sheet = Sheet((*key_columns, *metric_columns))
    for row in rows:
        cells = (_sweep_cell(row, name) for name in metrics)
        sheet.rows.append((*map(str, row.values), *cells))
    return sheet


def unfinished_cell(status: str = "failed") -> Cell:
    """Return what tables have in place of a number of a run that did not come to its end.

    It would be that of a part of the run, beside those of whole ones.
    """
    return Cell((), status, kept=False)


def _sweep_cell(row: Row, metric: str) -> Cell | str:
    if row.failure is not None:
        # The reason was printed when the run failed, and is in the CSV file.
        return unfinished_cell()
    if metric not in row.metrics:
        return "-"
    return Cell((row.metrics[metric],), kept=metric not in row.not_met)


def sheet_tables(sheet: Sheet, keys: int, width: int | None = None) -> list[Table]:
    """Return a table for the terminal, or several of some of its columns each.

    Columns beyond ``width`` characters continue in another table; numbers are never broken, and
    names only after an underscore. Print them on a `WIDE` console, because a single column may
    be wider than ``width``.

    Args:
        sheet: The table.
        keys: Number of its first columns that are in each of the tables, as swept values.
        width: Room for a table [characters].
    """
    sheet = sheet.for_terminal()
    tables: list[Table] = []
    begin, wide_console = keys, SafeConsole(width=WIDE)
    while True:
        end, table = len(sheet.columns), _part_of(sheet, keys, slice(begin, None))
        while width is not None and end > begin + 1 and wide_console.measure(table).maximum > width:
            end -= 1
            table = _part_of(sheet, keys, slice(begin, end))
        if not tables:
            table.title = escape(sheet.title) or None
        tables.append(table)
        begin = end
        if begin >= len(sheet.columns):
            return tables


def _part_of(sheet: Sheet, keys: int, others: slice) -> Table:
    """Return a table of the first columns and some of the others."""
    table = Table(box=SIMPLE_HEAD)
    for k, column in enumerate(sheet.columns[:keys]):
        # A value may be a list of any length; a name is not broken.
        has_headings = any(isinstance(row[k], Heading) for row in sheet.rows)
        most = None if has_headings else _VALUE
        table.add_column(escape(str(column.heading)), overflow="fold", max_width=most)
    for column in sheet.columns[others]:
        name = escape(_break_name(str(column.heading)))
        table.add_column(name, justify="right" if column.right else "left", no_wrap=True)
    for row in sheet.rows:
        table.add_row(*map(shown_cell, (*row[:keys], *row[others])))
    return table


def _break_name(name: str) -> str:
    """Return a name broken after underscores and blanks, into lines of ``_HEADER`` characters."""
    lines = [""]
    for part in re.findall("[^_ ]*[_ ]|[^_ ]+", name):
        if lines[-1] and len(lines[-1] + part) > _HEADER:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)


def groups_sheet(
    by: Sequence[str], groups: Sequence[Group], metrics: Sequence[str], statistic: Statistic
) -> Sheet:
    """Return a table with a row for each group of a campaign's rows.

    Args:
        by: Keys that they are grouped by.
        groups: The groups.
        metrics: Names of the metrics of its columns.
        statistic: What is told of each.
    """
    columns = [*(Column(Heading(key)) for key in by), Column(Heading("runs"), right=True)]
    columns += [Column(metric_heading(name), right=True) for name in metrics]
    sheet = Sheet(tuple(columns), note=spread_note(groups, metrics, statistic))
    for group, values in zip(groups, format_values(groups), strict=True):
        runs = str(group.complete)
        if group.complete < group.rows:
            runs += f" of {group.rows}"
        cells = (spread_cell(group.metrics.get(name), statistic) for name in metrics)
        sheet.rows.append((*values, runs, *cells))
    return sheet


def spread_note(groups: Sequence[Group], metrics: Sequence[str], statistic: Statistic) -> str:
    """Return what the numbers of groups are, as a line below their table."""
    if statistic == "mean":
        return "mean ± standard deviation over the runs that completed"
    summaries = [
        group.metrics[name] for group in groups for name in metrics if name in group.metrics
    ]
    outer = sorted(summaries[0].quantiles) if summaries else [0.0]
    middle = outer[len(outer) // 2]
    return f"{middle:g} quantile [{outer[0]:g}, {outer[-1]:g}] over the runs that completed"


def spread_cell(spread: Spread | None, statistic: Statistic) -> Cell | str:
    """Return a metric of a group as a text: its middle, and how far it spreads."""
    if spread is None or not spread.count:
        return "-"
    middle, down, up = spread.interval(statistic)
    if statistic == "quantiles":
        return Cell((middle, middle - down, middle + up), "{} [{}, {}]")
    return Cell((middle,)) if math.isnan(down) else Cell((middle, down), SPREAD)


_ARRIVAL = "joint_error_max_rad"


def varying_metrics(rows: Sequence[Row]) -> list[str]:
    """Return the names of the main metrics that differ between the runs."""
    selection = []
    for name in place_metrics("sweep"):
        ran = [row for row in rows if row.failure is None]
        # Only a run to a target posture has a drift: on a path the end effector leaves its start.
        if name == "end_effector_drift_max_m" and not any(_ARRIVAL in r.metrics for r in ran):
            continue
        values = [row.metrics[name] for row in ran if name in row.metrics]
        # Differences due to rounding do not count.
        differ = values and max(values) - min(values) > 1e-9 * max(map(abs, values))
        if values and (differ or len(ran) == 1):
            selection.append(name)
    return selection
