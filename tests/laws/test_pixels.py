"""The adaptive law with pixels of points on its tool in place of positions."""

import numpy as np
import pytest

from drake_rnn import Adaptive, InvalidInputError, ToolCamera, load_arm

ARM = load_arm("panda")
KINEMATICS = ARM.kinematics()
LIMITS = ARM.limits.replace(velocity=1.0, acceleration=5.0, jerk=200.0, snap=None, crackle=None)
PERIOD = 0.01
GOAL = ARM.home + np.array([0.1, -0.1, 0.15, 0.1, 0.0, 0.1, 0.0])
CAMERA = ToolCamera(position=[1.6, 0.5, 0.9], look_at=[0.55, 0, 0.6], points=[[0.02, 0.01, 0.05]])
OTHER = ToolCamera(position=[-0.4, -0.9, 1.1], look_at=[0.5, 0.1, 0.6], points=CAMERA.points)


def adaptive(**changes):
    given = {"limits": LIMITS, "home": ARM.home, "jacobian": "learned"}
    return Adaptive(**{**given, "points": 1, "task_size": 2, **changes})


def pixels(camera, q):
    return camera.pixels(0.0, KINEMATICS.p_WE(q), KINEMATICS.R_WE(q))


def run(law, cameras, until, swap=np.inf, goal=None):
    """Return states, joint velocities, and errors [px] on the way to what a camera saw."""
    reading = law.sampled(PERIOD)
    goal = GOAL if goal is None else goal
    q, x, rows = ARM.home.copy(), None, []
    for k in range(round(until / PERIOD)):
        t = k * PERIOD
        camera = cameras[t >= swap - 1e-9]
        to = pixels(camera, goal)
        u = {"position": q, "pixels": pixels(camera, q)}
        u |= {"pixels_desired": to, "pixels_preview": to}
        x = reading.initial_state(np.random.default_rng(0), u) if x is None else x
        error = float(np.linalg.norm(u["pixels"] - to))
        x = reading.step(t, x, u, PERIOD)
        v = reading.commanded_velocity(t, x)
        q = q + PERIOD * v
        rows.append((x, v, error))
    states, velocities, errors = zip(*rows, strict=True)
    return reading, np.array(states), np.array(velocities), np.array(errors)


def test_a_pixel_is_a_length():
    """The law of a plane, told lengths, commands the same until rounding tells them apart."""
    size = 2e-3
    seen, plane = adaptive(pixel_size=size), adaptive(points=None)
    assert set(plane.inputs.parts) == {"position", "p_WE", "p_WE_desired", "p_preview"}
    one, two = seen.sampled(PERIOD), plane.sampled(PERIOD)
    u = {"position": ARM.home, "pixels": np.array([300.0, 200.0])}
    u |= {"pixels_desired": np.array([310.0, 230.0]), "pixels_preview": np.array([311.0, 231.0])}
    lengths = {"position": u["position"]}
    for name, pixels_of in (("p_WE", "pixels"), ("p_WE_desired", "pixels_desired")):
        lengths[name] = size * u[pixels_of]
    lengths["p_preview"] = size * u["pixels_preview"]
    x, y = (
        reading.initial_state(np.random.default_rng(0), signals)
        for reading, signals in ((one, u), (two, lengths))
    )
    for _ in range(3):
        x, y = one.step(0.0, x, u, PERIOD), two.step(0.0, y, lengths, PERIOD)
        np.testing.assert_array_equal(
            one.commanded_velocity(0.0, x), two.commanded_velocity(0.0, y)
        )


def test_without_a_leap_nothing_begins_anew():
    """The error falls below .5 px, and C grows by no more than it wanders."""
    reading, states, _, errors = run(adaptive(), [CAMERA], 3.0)
    assert errors[0] > 20.0
    assert errors[-1] < 1e-3
    C = states[:, reading.state.parts["covariance"][0]].reshape(-1, 7, 7)
    grown = np.trace(C[1:], axis1=1, axis2=2) - np.trace(C[:-1], axis1=1, axis2=2)
    assert grown.max() <= 7 * PERIOD + 1e-12


def test_after_a_leap_it_learns_anew_from_where_it_was():
    """Of the sample of the leap nothing is learned, and all that is known is in doubt."""
    goal = ARM.home + np.array([0.0, -0.3, 0.0, 0.2, 0.0, 0.0, 0.0])
    reading, states, _, errors = run(adaptive(), [CAMERA, OTHER], 3.0, swap=0.5, goal=goal)
    part = reading.state.part
    before, at = states[49], states[50]
    np.testing.assert_array_equal(part(at, "J_hat"), part(before, "J_hat"))
    np.testing.assert_array_equal(part(at, "covariance"), np.eye(7))
    assert np.abs(part(states[60], "J_hat") - part(at, "J_hat")).max() > 1e-2
    assert errors[50] > 5.0
    assert errors[-1] < 1e-3


@pytest.mark.parametrize("points", [1, 2, 3])
def test_bounds_are_kept_whatever_is_seen_and_broken_without(points):
    """Pixels at random, drawn anew now and then, so that each draw is a leap."""
    rng = np.random.default_rng(points)
    for jerk, kept in ((200.0, True), (None, False)):
        limits = LIMITS.replace(jerk=jerk)
        reading = adaptive(limits=limits, points=points, task_size=2 * points).sampled(PERIOD)
        q, x, velocities = ARM.home.copy(), None, [np.zeros(7)]
        for k in range(300):
            if k % 20 == 0:
                seen, to = rng.uniform(0.0, 600.0, (2, 2 * points))
            u = {"position": q, "pixels": seen, "pixels_desired": to, "pixels_preview": to}
            x = reading.initial_state(rng, u) if x is None else x
            x = reading.step(k * PERIOD, x, u, PERIOD)
            velocities.append(reading.commanded_velocity(0.0, x))
            q = q + PERIOD * velocities[-1]
            assert LIMITS.violation(q).max() <= 1e-9
        v, a, j = (np.diff(np.array(velocities), n=n, axis=0) / PERIOD**n for n in range(3))
        assert abs(v).max() <= 1.0 + 1e-9
        assert abs(a).max() <= 5.0 * (1.0 + 1e-9)
        assert (abs(j).max() <= 200.0 * (1.0 + 1e-9)) == kept


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"task_size": 4}, "task_size: must be 2, two for each point, not 4"),
        ({"points": None, "task_size": 4}, "task_size: 4 is that of two points; give points"),
        ({"jacobian": "known"}, "jacobian: must be learned with pixels"),
        ({"J_hat_initial": "exact"}, "law.J_hat_initial: may be uniform or zero with pixels"),
        ({"pixel_size": 0.0}, "pixel_size: must be greater than or equal to 0.000001"),
    ],
)
def test_what_suits_no_pixels_is_refused(changes, said):
    with pytest.raises(InvalidInputError, match=said):
        adaptive(**changes)
