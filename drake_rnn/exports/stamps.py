"""Times as ROS 2 has them: whole seconds, and nanoseconds."""

from __future__ import annotations


def nanoseconds(time: float) -> int:
    """Return a time [s] in nanoseconds, rounded."""
    return round(time * 1e9)


def stamp(time: float, fraction: str) -> dict[str, int]:
    """Return a time [s] as a message, whose fraction has that name."""
    seconds, rest = divmod(nanoseconds(time), 1_000_000_000)
    return {"sec": seconds, fraction: rest}
