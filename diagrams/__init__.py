"""Diagram builders, and the experiments that come with this package."""

from pathlib import Path

EXPERIMENTS = Path(__file__).parent / "experiments"
