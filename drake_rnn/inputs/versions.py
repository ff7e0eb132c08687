"""Versions of what the numbers of a run may depend on."""

from __future__ import annotations

from importlib.metadata import version

__version__ = version("drake-rnn")


def versions() -> dict[str, str]:
    """Return the versions of the packages that the numbers of a run may depend on."""
    return {"drake-rnn": __version__} | {each: version(each) for each in ("drake", "numpy")}


def versions_text() -> str:
    """Return these versions as the command line prints them, a line each."""
    return "".join(f"{name} {number}\n" for name, number in versions().items())
