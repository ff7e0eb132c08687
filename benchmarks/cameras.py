"""Print how often a Panda finds its path in the image of a camera that nothing is known of.

::

    python benchmarks/cameras.py                       # all tables, 100 seeds: some two minutes
    python benchmarks/cameras.py still --seeds 20      # one of them, fewer seeds

Each seed is an experiment of its own: a camera round the arm, points on the tool, a direction in
which its path lies, and a first J_hat. They run side by side, in NumPy; a test compares one with
`drake_rnn.simulate`. Tables are Markdown.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from drake_rnn import Experiment, InvalidInputError, ToolCamera, load_experiment, screws_of
from drake_rnn.experiment.components import Arms
from drake_rnn.features.sensing import WhiteNoise
from drake_rnn.inputs.fields import Array
from drake_rnn.laws import adaptive
from drake_rnn.laws.checks import stack
from drake_rnn.laws.parts import jacobian as learned_jacobian
from drake_rnn.measures import NEAR_PX
from markdown_table import head, row

_COMMAND = "python benchmarks/cameras.py"
#: Time in which a run is to arrive, and of the swap of a camera [s].
ARRIVAL, SWAP = 3.0, 3.0
#: Bounds of the joints, by that of the jerk.
LIMITS = {
    "200": {"velocity": 1.0, "acceleration": 5.0, "jerk": 200.0},
    "40": {"velocity": 0.5, "acceleration": 2.0, "jerk": 40.0},
}
#: What all runs have in common.
DOCUMENT: dict[str, Any] = {
    "arm": "panda",
    "law": {"kind": "adaptive", "jacobian": "learned"},
    "on_unreachable": "follow",
}
#: Rules of the law for pixels, each with its number and with what leaves the rule out.
RULES: dict[str, tuple[ModuleType, str, float]] = {
    "a leap is not learned from": (learned_jacobian, "_LEAP", np.inf),
    "the edge near singular postures is lower": (adaptive, "OF_PIXELS", 1.0),
    "the task is firmer against errors": (adaptive, "FIRMER", 1.0),
}
#: Way from the start to the path, and edge of the cube that points are drawn from [m].
WAY, SPREAD = 0.1, 0.2
_ARMS = Arms()


@dataclass(frozen=True)
class Case:
    """What the runs of a row have in common.

    Attributes:
        points: Number of points.
        noise: Standard deviation of the errors of pixels [px].
        swaps: Whether another random camera comes in place of the first one.
        pixel_size: What a pixel is taken to be at the tool [m].
        period: Time between pictures [s].
        limits: Bounds of the joints.
        duration: Duration of the runs [s].
        without: Rule of the law for pixels that is left out, of `RULES`; empty for none.
        mount: What the camera is fixed to; on the tool it sees points that stand.
    """

    points: int = 1
    noise: float = 0.0
    swaps: bool = False
    pixel_size: float = 1e-3
    period: float = 0.01
    limits: str = "200"
    duration: float = 4.5
    without: str = ""
    mount: str = "world"


class Found(NamedTuple):
    """What runs come to.

    Attributes:
        time: Time of each step, shape (k,) [s].
        error: Largest distance of a point from where it is to be seen, shape (k, runs) [px].
        excess: Largest excess of a joint over a bound, as a share of it, of a position in rad,
            shape (runs,).
        position: Joint positions, shape (k, runs, n) [rad].
    """

    time: Array
    error: Array
    excess: Array
    position: Array


def drawn(case: Case, seed: int) -> Experiment:
    """Return an experiment with a random camera that sees start and path.

    Args:
        case: What is not drawn.
        seed: Seed of all that is random.
    """
    rng, arm = np.random.default_rng(seed), _ARMS.of("panda")
    assert arm.home is not None
    around = arm.kinematics().p_WE(arm.home)
    way = rng.standard_normal(3)
    path = {"kind": "circle", "plane": "yz", "size": 0.04, "period": 8.0}
    path["offset"] = (WAY / np.linalg.norm(way) * way).tolist()
    while True:
        camera = drawn_view(rng, case, around)
        camera |= {"noise": case.noise, "pixel_size": case.pixel_size}
        document = {**DOCUMENT, "path": path, "camera": camera, "seed": seed}
        document |= {"limits": LIMITS[case.limits], "period": case.period}
        try:
            return load_experiment({**document, "duration": case.duration}, arms=_ARMS)
        except InvalidInputError:
            # Out of the image, or behind the camera.
            continue


def drawn_view(rng: np.random.Generator, case: Case, around: Array) -> dict[str, Any]:
    """Return a camera of a case, its points, and the camera that comes in its place."""
    if case.mount == "world":
        camera = drawn_camera(rng, around) | {"points": drawn_points(rng, case.points).tolist()}
        if case.swaps:
            camera["swaps"] = [{"time": SWAP, **drawn_camera(rng, around)}]
        return camera
    camera = drawn_eye(rng) | {"mount": "tool"}
    # On the ground below the tool, which points down at home, and up to 0.1 m above it.
    below = np.array([around[0], around[1], 0.5 * SPREAD])
    camera["points"] = (below + 1.5 * drawn_points(rng, case.points)).tolist()
    if case.swaps:
        camera["swaps"] = [{"time": SWAP, **drawn_eye(rng)}]
    return camera


def drawn_eye(rng: np.random.Generator) -> dict[str, Any]:
    """Return a camera up to 0.1 m beside a tool, which looks ahead to 0.1 m of its axis."""
    return {
        "position": rng.uniform([-0.1, -0.1, -0.1], [0.1, 0.1, 0.0]).tolist(),
        "look_at": rng.uniform([-0.1, -0.1, 0.4], [0.1, 0.1, 0.6]).tolist(),
        "roll": rng.uniform(-np.pi, np.pi),
        "focal_length": rng.uniform(500.0, 900.0),
    }


def drawn_camera(rng: np.random.Generator, around: Array) -> dict[str, Any]:
    """Return a camera 0.9 to 1.6 m away from a point, which looks to 0.1 m of it."""
    azimuth, roll = rng.uniform(-np.pi, np.pi, 2).tolist()
    elevation, distance = rng.uniform(0.1, 1.2), rng.uniform(0.9, 1.6)
    across, up = np.cos(elevation), np.sin(elevation)
    towards = np.array([across * np.cos(azimuth), across * np.sin(azimuth), up])
    look_at = around + rng.uniform(-0.1, 0.1, 3)
    return {
        "position": (look_at + distance * towards).tolist(),
        "look_at": look_at.tolist(),
        "roll": roll,
        "focal_length": rng.uniform(500.0, 900.0),
    }


def drawn_points(rng: np.random.Generator, count: int) -> Array:
    """Return points of a cube round the tool frame, apart from one another and from a line."""
    while True:
        points = rng.uniform(-0.5 * SPREAD, 0.5 * SPREAD, (count, 3))
        sides = [points[k] - points[j] for k in range(count) for j in range(k)]
        near = any(np.linalg.norm(side) < 0.25 * SPREAD for side in sides)
        in_line = count == 3 and np.linalg.norm(np.cross(*sides[:2])) < 0.075 * SPREAD**2
        if not near and not in_line:
            return points


def run(case: Case, seeds: range) -> Found:
    """Return what runs of a case come to, one for each seed."""
    if not case.without:
        return _run(case, seeds)
    module, name, number = RULES[case.without]
    with patch.object(module, name, number):
        return _run(case, seeds)


def _run(case: Case, seeds: range) -> Found:
    experiments = [drawn(case, seed) for seed in seeds]
    first, period = experiments[0], case.period
    limits, screws = first.limits, screws_of(first.arm)
    reading = stack([each.law.sampled(period) for each in experiments])
    noises = [WhiteNoise(6, each.document.seed, stream=6) for each in experiments]
    q, x = np.array([each.start for each in experiments]), None
    steps = round(case.duration / period)
    time = period * np.arange(steps + 1)
    position, velocity, errors = [q], [0.0 * q], []
    for k, t in enumerate(time.tolist()):
        pixels, wanted, ahead = _seen(experiments, screws.at(q), t, period)
        errors.append(np.linalg.norm((pixels - wanted).reshape(len(q), -1, 2), axis=-1).max(axis=1))
        if case.noise:
            pixels += case.noise * np.array([n.sample(k)[: pixels.shape[1]] for n in noises])
        u = {"position": q, "pixels": pixels, "pixels_desired": wanted, "pixels_preview": ahead}
        if x is None:
            x = np.array([_started(one, k, u) for k, one in enumerate(experiments)])
        x = np.asarray(reading.step(t, x, u, period))
        velocity.append(np.asarray(reading.commanded_velocity(t, x)))
        q = q + period * velocity[-1]
        position.append(q)
    excess = [np.maximum(limits.position_lower - position, position - limits.position_upper)]
    for order, name in enumerate(("velocity", "acceleration", "jerk")):
        values = abs(np.diff(np.array(velocity), n=order, axis=0)) / period**order
        excess.append(values / limits.bounds[name] - 1.0)
    most = np.max([each.max(axis=(0, 2)) for each in excess], axis=0)
    return Found(time, np.array(errors), np.maximum(most, 0.0), np.array(position[:-1]))


def _started(experiment: Experiment, number: int, u: dict[str, Array]) -> Array:
    """Return the initial state of one of the laws, as its controller has it."""
    rng = np.random.default_rng([experiment.document.seed, 0])
    reading = experiment.law.sampled(experiment.document.period or 0.0)
    return reading.initial_state(rng, {name: values[number] for name, values in u.items()})


def _seen(
    experiments: list[Experiment], moved: Any, t: float, period: float
) -> tuple[Array, Array, Array]:
    """Return the pixels of arms, where they are to be, and a sample ahead, shape (runs, m)."""
    p_WE, R_WE = np.array(moved.p_WE), np.array(moved.R_WE)
    rows = []
    for each, p, R in zip(experiments, p_WE, R_WE, strict=True):
        camera, path = each.document.camera, each.desired
        assert isinstance(camera, ToolCamera)
        R_desired = path.orientation(t)[0]
        to, ahead = (camera.pixels(t, path.position(s)[0], R_desired) for s in (t, t + period))
        rows.append((camera.pixels(t, p, R), to, ahead))
    pixels, wanted, ahead = (np.array(each) for each in zip(*rows, strict=True))
    return pixels, wanted, ahead


def settled(time: Array, error: Array) -> Array:
    """Return the time from which on each run stays near, shape (runs,) [s]; infinite for never."""
    far = error >= NEAR_PX
    last = len(time) - np.argmax(far[::-1], axis=0)
    last = np.where(far.any(axis=0), last, 0)
    return np.where(last < len(time), time[np.minimum(last, len(time) - 1)], np.inf)


def print_still(seeds: range) -> None:
    """Print a row for each number of points, rate of pictures and set of bounds, without noise."""
    head(
        *("points", "pictures a second", "bounds", "within .5 px from 3 s on"),
        *("arrives, median / last [s]", "largest excess over a bound"),
        made_by=f"{_COMMAND} still",
    )
    for case in (
        Case(points=1),
        Case(points=2),
        Case(points=3),
        Case(period=0.04),
        Case(limits="40"),
        Case(points=2, limits="40"),
        Case(points=3, limits="40"),
    ):
        found = run(case, seeds)
        bounds = ", ".join(f"{bound:g}" for bound in LIMITS[case.limits].values())
        row(case.points, f"{1 / case.period:g}", bounds, *_arrivals(found), _most(found))


def print_guess(seeds: range) -> None:
    """Print a row for each guess of what a pixel is at the tool."""
    head(
        *("`pixel_size` [mm]", "within .5 px from 3 s on", "arrives, median / last [s]"),
        "largest excess over a bound",
        made_by=f"{_COMMAND} guess",
    )
    for size in (0.25e-3, 0.5e-3, 1e-3, 2e-3, 4e-3):
        found = run(Case(pixel_size=size), seeds)
        row(f"{1e3 * size:g}", *_arrivals(found), _most(found))


def print_noise(seeds: range) -> None:
    """Print a row for each number of points and size of the errors of pixels."""
    head(
        *("points", "errors of pixels [px]", "within .5 px at 3 s", "rms from 3 s on below .5 px"),
        *("pictures within .5 px", "median rms [px]", "largest excess over a bound"),
        made_by=f"{_COMMAND} noise",
    )
    for points, noise in ((1, 0.1), (1, 0.2), (1, 0.5), (2, 0.2), (3, 0.2)):
        found = run(Case(points=points, noise=noise), seeds)
        late = found.error[found.time >= ARRIVAL - 1e-9]
        rms = np.sqrt(np.mean(late**2, axis=0))
        row(
            *(points, noise, _of(late[0] < NEAR_PX), _of(rms < NEAR_PX)),
            *(f"{100 * (late < NEAR_PX).mean():.1f} %", f"{np.median(rms):.2f}", _most(found)),
        )


def print_swap(seeds: range) -> None:
    """Print a row for each number of points, with a camera that is swapped for another one.

    With errors of pixels a run is near whose rms over half a second is.
    """
    head(
        *("points", "errors of pixels [px]", "within .5 px before", "within .5 px again in 3 s"),
        *("takes, median / last [s]", "error meanwhile, median / largest [px]"),
        "largest excess over a bound",
        made_by=f"{_COMMAND} swap",
    )
    for points, noise in ((1, 0.0), (2, 0.0), (3, 0.0), (1, 0.2)):
        case = Case(points=points, noise=noise, swaps=True, duration=6.0)
        found = run(case, seeds)
        after = found.time >= SWAP - 1e-9
        errors = found.error[~after], found.error[after]
        if noise:
            half = round(0.5 / case.period)
            near = [np.sqrt(np.mean(e[-half:] ** 2, axis=0)) < NEAR_PX for e in errors]
            takes = ""
        else:
            again = settled(found.time[after] - SWAP, errors[1])
            near = [np.isfinite(settled(found.time[~after], errors[0])), np.isfinite(again)]
            takes = _told(again)
        largest = errors[1].max(axis=0)
        row(
            *(points, noise, *map(_of, near), takes),
            *(f"{np.median(largest):.1f} / {largest.max():.1f}", _most(found)),
        )


def print_rules(seeds: range) -> None:
    """Print a row for each rule of the law for pixels: how many runs are near with and without."""
    head("rule", "runs", "with it", "without it", made_by=f"{_COMMAND} rules")
    swap = Case(swaps=True, duration=6.0)
    for rule, said, case in zip(
        RULES,
        ("1 point, swapped", "3 points", "2 points, .2 px"),
        (swap, Case(points=3), Case(points=2, noise=0.2)),
        strict=True,
    ):
        near = []
        for each in (case, replace(case, without=rule)):
            found = run(each, seeds)
            late = found.error[found.time >= case.duration - 0.5]
            near.append(_of(np.sqrt(np.mean(late**2, axis=0)) < NEAR_PX))
        row(rule, said, *near)


def _arrivals(found: Found) -> tuple[str, str]:
    """Return how many runs stay near from `ARRIVAL` on, and when they arrive."""
    late = found.error[found.time >= ARRIVAL - 1e-9]
    return _of((late < NEAR_PX).all(axis=0)), _told(settled(found.time, found.error))


def _told(times: Array) -> str:
    """Return the median and the largest of times that may be infinite."""
    last = times.max()
    return f"{np.median(times):.2f} / " + (f"{last:.2f}" if np.isfinite(last) else "never")


def _most(found: Found) -> str:
    """Return the largest excess over a bound, as a share of it."""
    return f"{found.excess.max():.0e}"


def _of(which: Any) -> str:
    return f"{np.count_nonzero(which)} of {len(which)}"


def print_eye(seeds: range) -> None:
    """Print a row for each number of points that a camera on the tool sees."""
    head(
        *("points", "errors of pixels [px]", "swapped", "rms from 3 s on below .5 px"),
        *("median rms [px]", "arrives, median / last [s]", "largest excess over a bound"),
        made_by=f"{_COMMAND} eye",
    )
    still = [Case(points=k, mount="tool") for k in (1, 2, 3)]
    noisy = [replace(case, noise=0.2) for case in still]
    for case in (*still, *noisy, replace(still[2], swaps=True, duration=6.0)):
        found = run(case, seeds)
        begin = ARRIVAL + (SWAP if case.swaps else 0.0)
        late = found.error[found.time >= min(begin, case.duration - 0.5) - 1e-9]
        rms = np.sqrt(np.mean(late**2, axis=0))
        after = found.time >= (SWAP if case.swaps else 0.0) - 1e-9
        began = found.time[after]
        takes = "" if case.noise else _told(settled(began - began[0], found.error[after]))
        row(
            *(case.points, case.noise, "yes" if case.swaps else "no", _of(rms < NEAR_PX)),
            *(f"{np.median(rms):.2g}", takes, _most(found)),
        )


TABLES = {
    "eye": print_eye,
    "still": print_still,
    "guess": print_guess,
    "noise": print_noise,
    "swap": print_swap,
    "rules": print_rules,
}


def main() -> None:
    """Print the tables that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tables", nargs="*", default=[*TABLES])
    parser.add_argument("--seeds", type=int, default=100, help="number of seeds")
    asked = parser.parse_args()
    for name in asked.tables:
        TABLES[name](range(asked.seeds))


if __name__ == "__main__":
    main()
