"""Versions of what the numbers of a run may depend on."""

from __future__ import annotations

from importlib.metadata import version

__version__ = version("drake-rnn")


def versions() -> dict[str, str]:
    """Return the versions of the packages that the numbers of a run may depend on."""
    return {"drake-rnn": __version__} | {each: version(each) for each in ("drake", "numpy")}
