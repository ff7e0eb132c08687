"""Options that several benchmarks have."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path


def add_case_options(parser: ArgumentParser, jobs: int = 2) -> None:
    """Add the options of benchmarks that run `kept_cases.cases`: ``--jobs`` and ``--kept``.

    Args:
        parser: The parser.
        jobs: Number of processes without the option.
    """
    parser.add_argument("--jobs", type=int, default=jobs, help="number of processes")
    add_kept(parser)


def add_kept(parser: ArgumentParser) -> None:
    """Add the option ``--kept``."""
    parser.add_argument("--kept", type=Path, help="file of what was found, which is not made again")


def add_judge(parser: ArgumentParser, *, required: bool = False) -> None:
    """Add the option ``--judge`` of benchmarks of an FR3."""
    parser.add_argument(
        "--judge", metavar="PYTHON", required=required, help="a Python that has franka-sim"
    )
