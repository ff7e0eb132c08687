"""How far the clearest posture stays clear that reaches the end of a path, of cases that are stuck.

It is sought at random, and then uphill, so that there may be a clearer one.
"""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Callable, Sequence

import numpy as np

from drake_rnn import Experiment
from drake_rnn.features.detour import detours_of
from drake_rnn.robot.postures import random_postures
from kept_cases import Found
from markdown_table import head, row

# Random postures, and how often those of two arms are paired anew; those that go uphill, for how
# many steps, the first of them [rad], and by what share one in vain makes the next one shorter.
POSTURES, PAIRED, BEST, UPHILL, STEP, SHORTER = 3000, 20, 64, 300, 0.3, 0.98
# Steps of Newton's method, at first and then.
DESCENT, AGAIN = 60, 12


def add_free_postures(parser: ArgumentParser) -> None:
    """Add the option ``--free-postures``."""
    text = "of each case that is stuck, how far the clearest posture found at its end stays clear"
    parser.add_argument("--free-postures", action="store_true", help=text)


def print_free_postures(
    seeds: Sequence[int], found: list[Found], stuck: float, load: Callable[[int], Experiment]
) -> None:
    """Print a row for each case that is stuck.

    Args:
        seeds: The cases.
        found: What was found of each.
        stuck: Error above which one is stuck [m].
        load: Returns the experiment of a case, with detours.
    """
    print()
    head("case", "off its end [mm]", "clearest posture there [mm]")
    for seed, each in zip(seeds, found, strict=True):
        if each["error"] > stuck:
            gap = clearest(load(seed))
            row(seed, f"{1e3 * each['error']:.1f}", f"{1e3 * gap:.2f}")


def clearest(experiment: Experiment, seed: int = 0) -> float:
    """Return the least distance in the clearest postures at the end of all paths [m].

    Args:
        experiment: An experiment with detours.
        seed: Seed of the search.
    """
    detours = detours_of(experiment)
    assert detours is not None
    rng, end = np.random.default_rng(seed), experiment.document.duration
    beside = np.zeros((POSTURES, len(detours.arms), 3))
    q = np.concatenate(
        [random_postures(led.arm, POSTURES, seed + k) for k, led in enumerate(detours.arms)], axis=1
    )
    q, there = detours.reached(q, end, DESCENT, beside)
    q = q[there]
    if len(detours.arms) > 1:
        pairs = [[rng.permutation(q[:, part]) for part in detours.parts] for _ in range(PAIRED)]
        q = np.concatenate([np.concatenate(pair, axis=1) for pair in pairs])
    gaps = detours.clearance.gaps(q).min(axis=1)
    best = np.argsort(-gaps, kind="stable")[:BEST]
    q, gaps, size = q[best], gaps[best], np.full(len(best), STEP)
    for _ in range(UPHILL):
        trial = q + size[:, None] * rng.normal(size=q.shape)
        trial, there = detours.reached(trial, end, AGAIN, beside[: len(q)])
        new = np.where(there, detours.clearance.gaps(trial).min(axis=1), -np.inf)
        is_up = new > gaps
        q, gaps = np.where(is_up[:, None], trial, q), np.where(is_up, new, gaps)
        size = np.where(is_up, size, np.maximum(SHORTER * size, 0.1 * STEP))
    return float(gaps.max())
