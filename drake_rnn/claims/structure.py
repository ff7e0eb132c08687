"""What a law is told of the arm's structure, rather than measures."""

from __future__ import annotations

from collections.abc import Collection

from ..experiment import load_experiment

#: Signals that only a model of the arm can give.
STRUCTURE = frozenset({"J", "J_omega", "Jdot_v", "M", "bias", "gravity"})


def signals_of_structure(name: str, among: Collection[str] = STRUCTURE) -> float:
    """Return the number of signals of an arm's structure that a law sees [1].

    Args:
        name: Name of the shipped experiment with the law.
        among: Signals that count.
    """
    return float(len(set(among) & set(load_experiment(name).law.inputs.parts)))
