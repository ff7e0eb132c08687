"""Compare a camera on the tool of which nothing is known with visual servoing by a known one.

::

    python benchmarks/eye_in_hand.py --seeds 100      # some minutes

The cameras, points and paths are those of ``benchmarks/cameras.py eye``, each seed with its own.
Classical image-based visual servoing (Chaumette and Hutchinson, "Visual servo control", part I,
2006) knows the arm and the depth of each point exactly, and moves the joints by the pseudoinverse
of the image Jacobian of the camera that it believes in, with the velocity of the target pixels fed
forward. Its gain is the best of a grid. It knows of no bounds: a command that is beyond that of the
velocity is scaled down as a whole.

What it believes of the camera is exact; or 10 % and 10 degrees off; or calibrated by OpenCV
(`calibrateCamera`, and `calibrateHandEye` by Park and Martin) from pictures of a chessboard, which
have the same errors of pixels. The pictures are taken from postures round the start, and the time
until the first motion is that of the motions between these, at the same bounds, and 0.5 s of rest
at each; nothing is said of the time to mount and to measure a chessboard.

It needs ``pip install "opencv-python-headless<5"``.
"""

from __future__ import annotations

import argparse
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

import cv2
import numpy as np

from cameras import ARRIVAL, NEAR_PX, Case, drawn, run, settled
from drake_rnn import Array, Experiment, Pinhole, ToolCamera
from drake_rnn.robot.rotation import rotation_by
from markdown_table import head, row

_COMMAND = "python benchmarks/eye_in_hand.py"
#: Gains that are tried [1/s].
GAINS = (1.0, 2.0, 5.0, 10.0, 20.0)
#: Errors of a camera that is believed wrongly: share of the focal length, and turn [rad].
WRONG = 0.1, np.deg2rad(10.0)
#: Rest at each posture of a calibration [s], and how far joints are from the start [rad].
REST, AROUND = 0.5, 0.35
#: Corners of the chessboard, and their distance [m].
BOARD, EDGE = (8, 6), 0.04


class Believed(NamedTuple):
    """What is believed of a camera on a tool.

    Attributes:
        focal: Focal length [px].
        center: Principal point, shape (2,) [px].
        R_EC, p_EC: Its pose in the tool's frame.
        time: Time that it took to find that out [s].
    """

    focal: Array
    center: Array
    R_EC: Array
    p_EC: Array
    time: float = 0.0


def exact(camera: Pinhole) -> Believed:
    """Return what is so."""
    return Believed(np.full(2, camera.focal_length), camera.center, camera.R_WC, camera.position)


def wrong(camera: Pinhole, rng: np.random.Generator) -> Believed:
    """Return a camera that is `WRONG`."""
    axis = rng.normal(size=3)
    turn = rotation_by(WRONG[1] * axis / np.linalg.norm(axis))
    true = exact(camera)
    return true._replace(focal=(1.0 + WRONG[0]) * true.focal, R_EC=true.R_EC @ turn)


def calibrated(experiment: Experiment, pictures: int, noise: float) -> Believed:
    """Return what OpenCV makes of pictures of a chessboard below the tool."""
    camera, arm = experiment.document.camera, experiment.arm
    assert isinstance(camera, ToolCamera)
    assert arm.home is not None
    rng, kinematics = np.random.default_rng((experiment.document.seed, 7)), arm.kinematics()
    grid = np.array([(x, y, 0.0) for y in range(BOARD[1]) for x in range(BOARD[0])]) * EDGE
    grid -= grid.mean(axis=0)
    # It lies where the camera looks to at the start.
    p_WE, R_WE = kinematics.p_WE(arm.home), kinematics.R_WE(arm.home)
    p_WC, z = p_WE + R_WE @ camera.position, (R_WE @ camera.R_WC)[:, 2]
    board = p_WC - z * p_WC[2] / z[2] + grid
    seen: list[tuple[Array, Array, Array, Array]] = []
    while len(seen) < pictures:
        q = arm.home + rng.uniform(-AROUND, AROUND, arm.n)
        p, R = kinematics.p_WE(q), kinematics.R_WE(q)
        in_tool = (board - p) @ R
        if camera.depth(in_tool).min() < 0.1:
            continue
        pixels = camera.project(in_tool)
        if camera.margin(pixels).min() > 0.0:
            seen.append((q, R, p, pixels + noise * rng.normal(size=pixels.shape)))
    views = [pixels.astype(np.float32) for *_, pixels in seen]
    boards = [grid.astype(np.float32)] * pictures
    still = cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST
    _, K, _, turns, ways = cv2.calibrateCamera(
        boards, views, camera.image_size, None, None, flags=still
    )
    R_EC, p_EC = cv2.calibrateHandEye(
        [R for _, R, *_ in seen],
        [p for _, _, p, _ in seen],
        [cv2.Rodrigues(each)[0] for each in turns],
        ways,
        method=cv2.CALIB_HAND_EYE_PARK,
    )
    postures = [arm.home, *(q for q, *_ in seen), arm.home]
    limits, time = experiment.limits, 0.0
    v, a, jerk = (limits.bounds[name] for name in ("velocity", "acceleration", "jerk"))
    for one, other in pairwise(postures):
        way = np.abs(other - one) / v + v / a + a / jerk
        time += float(way.max()) + REST
    return Believed(np.diag(K)[:2], K[:2, 2], R_EC, p_EC.ravel(), time)


class Servoing(NamedTuple):
    """What a run of visual servoing comes to: times [s], errors [px], largest share of a bound."""

    time: Array
    error: Array
    excess: float


def servo(experiment: Experiment, believed: Believed, gain: float, noise: float) -> Servoing:
    """Follow the path in the image, by a camera as it is believed to be."""
    camera, path, limits = experiment.document.camera, experiment.desired, experiment.limits
    assert isinstance(camera, ToolCamera)
    assert experiment.document.period is not None
    rng, h = np.random.default_rng((experiment.document.seed, 8)), experiment.document.period
    kinematics, q = experiment.arm.kinematics(), experiment.start
    points, R_CE = np.array(camera.points), believed.R_EC.T
    time = h * np.arange(round(experiment.document.duration / h) + 1)
    errors, velocities = [], [np.zeros(q.size)] * 3
    R_desired = path.orientation(0.0)[0]
    for t in time.tolist():
        p_WE, R_WE = kinematics.p_WE(q), kinematics.R_WE(q)
        pixels = camera.pixels(t, p_WE, R_WE).reshape(-1, 2)
        now, ahead = (camera.pixels(t, path.position(s)[0], R_desired) for s in (t, t + h))
        errors.append(np.linalg.norm(pixels - now.reshape(-1, 2), axis=1).max())
        pixels = pixels + noise * rng.normal(size=pixels.shape)
        # Depths are those of the true points in the believed camera.
        depth = ((points - p_WE) @ R_WE - believed.p_EC) @ believed.R_EC[:, 2]
        x, y = ((pixels - believed.center) / believed.focal).T
        rows = np.zeros((len(points), 2, 6))
        for k, (u, v, z) in enumerate(zip(x, y, depth, strict=True)):
            rows[k, 0] = [u * v, -(1.0 + u * u), v, -1.0 / z, 0.0, u / z]
            rows[k, 1] = [1.0 + v * v, -u * v, -u, 0.0, -1.0 / z, v / z]
        L = (believed.focal[:, None] * rows).reshape(-1, 6)
        # Of the camera's frame, from the tool's Jacobians.
        J_omega, J = kinematics.J_omega(q), kinematics.J(q)
        arms = (R_WE @ believed.p_EC)[:, None]
        J_camera = J + np.cross(J_omega, arms, axis=0)
        J_C = np.vstack((R_CE @ R_WE.T @ J_omega, R_CE @ R_WE.T @ J_camera))
        rate = (ahead - now) / h + gain * (now - pixels.ravel())
        v = np.linalg.pinv(L @ J_C, rcond=1e-3) @ rate
        v = v / max(1.0, float((np.abs(v) / limits.velocity).max()))
        velocities.append(v)
        q = np.clip(q + h * v, limits.position_lower, limits.position_upper)
    excess = 0.0
    for order, name in ((1, "acceleration"), (2, "jerk")):
        values = np.abs(np.diff(np.array(velocities[3 - order :]), n=order, axis=0)) / h**order
        excess = max(excess, float((values / limits.bounds[name]).max()))
    return Servoing(time, np.array(errors), excess)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100, help="number of seeds")
    seeds = range(parser.parse_args().seeds)
    head(
        *("points, errors [px]", "by", "rms from 3 s on below .5 px", "median rms [px]"),
        *("arrives, median [s]", "largest share of a bound", "before the first motion [s]"),
        made_by=_COMMAND,
    )
    for points, noise in ((1, 0.0), (3, 0.0), (3, 0.2)):
        case = Case(points=points, noise=noise, mount="tool")
        found = run(case, seeds)
        ours = [Servoing(found.time, error, 1.0 + found.excess.max()) for error in found.error.T]
        _print(case, "ours, nothing known", ours, [0.0] * len(seeds))
        experiments = [drawn(case, seed) for seed in seeds]
        for name, believe in _believed(noise).items():
            cameras = [believe(each) for each in experiments]
            pairs = list(zip(experiments, cameras, strict=True))
            ways = {g: [servo(*pair, g, noise) for pair in pairs] for g in GAINS}
            best = min(ways, key=lambda gain: float(np.median([_rms(w) for w in ways[gain]])))
            _print(case, f"{name}, gain {best:g}", ways[best], [each.time for each in cameras])


def _believed(noise: float) -> dict[str, Any]:
    def camera(experiment: Experiment) -> ToolCamera:
        assert experiment.document.camera is not None
        return experiment.document.camera

    def off(experiment: Experiment) -> Believed:
        return wrong(camera(experiment), np.random.default_rng(experiment.document.seed))

    ways: dict[str, Any] = {"IBVS, camera known": lambda each: exact(camera(each))}
    ways["IBVS, 10 % and 10 degrees off"] = off
    for pictures in (5, 15) if noise else ():
        ways[f"IBVS, calibrated by {pictures} pictures"] = cache(
            lambda each, pictures=pictures: calibrated(each, pictures, noise)
        )
    return ways


def _rms(way: Servoing) -> float:
    late = way.error[way.time >= ARRIVAL - 1e-9]
    return float(np.sqrt(np.mean(late**2)))


def _print(case: Case, name: str, ways: list[Servoing], waits: list[float]) -> None:
    rms = np.array([_rms(way) for way in ways])
    arrives = [settled(way.time, way.error[:, None])[0] for way in ways]
    arrival = np.median(arrives)
    row(
        *(f"{case.points}, {case.noise:g}", name, f"{(rms < NEAR_PX).sum()} of {len(rms)}"),
        f"{np.median(rms):.2g}",
        "" if case.noise else (f"{arrival:.2f}" if np.isfinite(arrival) else "never"),
        f"{max(way.excess for way in ways):.3g}",
        f"{np.median(waits):.0f}" if max(waits) else "0",
    )


if __name__ == "__main__":
    main()
