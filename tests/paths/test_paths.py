import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drake_rnn.errors import InvalidInputError
from drake_rnn.inputs.fields import Array
from drake_rnn.paths import PATHS, Path, Planar, Points
from drake_rnn.paths.pieces import join, quintics
from row_helpers import each

PERIOD = 4.0
TIMINGS = ["uniform", "sin2", "quintic", "cycloid", "ramps"]
SMOOTH_AT_REST = ["quintic", "cycloid", "ramps"]

TURNS = np.linspace(0, 2 * np.pi, 16, endpoint=False)
LOOP = np.column_stack([0.1 * np.cos(TURNS), 0.1 * np.sin(TURNS), 0.02 * np.sin(2 * TURNS)])

FIELDS = {
    "circle": {"kind": "circle", "size": 0.1},
    "nephroid": {"kind": "nephroid", "size": 0.04},
    "four_ring": {"kind": "four_ring", "size": 0.04},
    "clover": {"kind": "clover", "size": 0.05},
    "clover_centre": {"kind": "clover", "size": 0.05, "begin": "centre"},
    "deltoid": {"kind": "deltoid", "size": 0.02},
    "cat": {"kind": "cat", "size": 0.05},
    "square": {"kind": "square", "size": 0.2},
    "square_rounded": {
        "kind": "square",
        "size": 0.2,
        "corners": "rounded",
        "corner_radius": 0.03,
    },
    "parallelogram": {"kind": "parallelogram", "sides": [[-0.2, 0.0], [-0.08, 0.15]]},
    "points": {"kind": "points", "points": LOOP, "closed": True},
}
STARTS_AT_A_CUSP = ["nephroid", "deltoid"]
PLANAR = [name for name in FIELDS if name != "points"]


def make(name: str, **more: object) -> Path:
    fields = {"period": PERIOD, **FIELDS[name], **more}
    return PATHS[str(fields["kind"])](**fields)


def positions(path: Path, times: Array) -> Array:
    return np.array([path.evaluate(t)[0] for t in times])


def times_between_knots(path: Path, until: float, margin: float) -> Array:
    """Several times in each smooth stretch, irregular ones."""
    knots = np.unique([*path.knots(until), until])
    shares = np.array([0.0, 0.137, 0.381, 0.493, 0.618, 0.873, 1.0])
    return np.concatenate(
        [a + margin + (b - a - 2 * margin) * shares for a, b in pairwise(knots) if b - a > 0.01]
    )


@each("timing", TIMINGS)
@each("name", FIELDS)
def test_velocity_and_acceleration_are_the_derivatives(name: str, timing: str) -> None:
    path = make(name, timing=timing)
    h = 1e-5 * PERIOD
    times = times_between_knots(path, 2 * PERIOD, margin=2 * h)
    _, v, a = (np.array(x) for x in zip(*map(path.evaluate, times), strict=True))
    before, after = ([path.evaluate(t + d) for t in times] for d in (-h, h))
    for order, exact in ((0, v), (1, a)):
        secant = [(y[order] - x[order]) / (2 * h) for x, y in zip(before, after, strict=True)]
        np.testing.assert_allclose(exact, secant, rtol=0, atol=1e-6 * (1e-3 + abs(exact).max()))


@each("timing", TIMINGS)
@each("name", FIELDS)
def test_starts_at_zero_displacement_and_closes_after_each_lap(name: str, timing: str) -> None:
    path = make(name, timing=timing)
    assert not path.evaluate(0.0)[0].any()
    assert abs(path.evaluate(PERIOD * (1 - 1e-12))[0]).max() < 1e-11
    assert abs(path.evaluate(PERIOD)[0]).max() < 1e-15
    for now, later in zip(path.evaluate(0.3), path.evaluate(0.3 + 5 * PERIOD), strict=True):
        np.testing.assert_allclose(now, later, atol=1e-12)


@each("name", FIELDS)
def test_motion_between_knots_is_continuous(name: str) -> None:
    """A step in velocity or acceleration is a knot; uniform timing shows the curve's own."""
    path = make(name)
    knots = path.knots(PERIOD)
    times = np.linspace(0.0, PERIOD, 4001)[1:-1]
    times = times[abs(times[:, None] - knots).min(axis=1) > 2e-3]
    _, v, a = (np.array(x) for x in zip(*map(path.evaluate, times), strict=True))
    near = np.diff(times) < 1.5e-3
    for values in (v, a):
        step = np.linalg.norm(np.diff(values, axis=0), axis=1)[near]
        assert step.max() < 0.05 * np.linalg.norm(values, axis=1).max() + 1e-12


@each("name", FIELDS)
def test_before_the_start_it_rests_at_the_start(name: str) -> None:
    assert not np.any(make(name).evaluate(-0.5))


@each("timing", TIMINGS)
@each("name", FIELDS)
def test_after_the_last_lap_it_rests_at_the_start(name: str, timing: str) -> None:
    path = make(name, timing=timing, laps=2)
    assert path.duration == 2 * PERIOD
    assert np.any(path.evaluate(1.5 * PERIOD)[0])
    for t in (2 * PERIOD, 2 * PERIOD + 0.3, 1e6):
        assert not np.any(path.evaluate(t))


@each("timing", TIMINGS[1:])
@each("name", FIELDS)
def test_rest_to_rest_timings_rest_at_every_segment_end(name: str, timing: str) -> None:
    path = make(name, timing=timing)
    ends = np.arange(2 * path.segments + 1) * PERIOD / path.segments
    assert set(ends) <= set(path.knots(2 * PERIOD))
    top = max(abs(path.evaluate(t)[2]).max() for t in np.linspace(0, PERIOD, 50))
    for end in ends:
        for t in (end, max(0.0, end - 1e-9)):
            _, v, a = path.evaluate(t)
            assert abs(v).max() < 1e-7
            if timing in SMOOTH_AT_REST:
                assert abs(a).max() < 1e-6 * top
            elif name not in STARTS_AT_A_CUSP:
                assert abs(a).max() > 1e-3


@each("name", FIELDS)
def test_ramps_hold_a_constant_rate_between_them(name: str) -> None:
    """Between its ramps the point runs as uniformly timed, 1 / (1 - ramp) times as fast."""
    path, uniform = make(name, timing="ramps", ramp=0.1), make(name)
    duration = PERIOD / path.segments
    for share in (0.1, 0.3, 0.5, 0.8999):
        same = duration * (share - 0.05) / 0.9
        for order, value in enumerate(path.evaluate(share * duration)):
            expected = uniform.evaluate(same)[order] / 0.9**order
            np.testing.assert_allclose(value, expected, atol=1e-9)


def test_ramps_have_a_continuous_fourth_derivative() -> None:
    """S7 has three zero derivatives at its ends: no jump in the acceleration's second one."""
    path = make("square", timing="ramps", ramp=0.4)
    h = 1e-4
    a = np.array([path.evaluate(t)[2][0] for t in np.arange(1, 15000) * h])
    second = np.diff(a, 2) / h**2
    assert abs(np.diff(second)).max() < 2e-2 * abs(second).max()


@each("timing", TIMINGS)
@each("plane", ["xy", "xz", "yz"])
def test_stays_in_its_plane(plane: str, timing: str) -> None:
    normal = "xyz".index((set("xyz") - set(plane)).pop())
    for name in PLANAR:
        path = make(name, plane=plane, timing=timing, angle=0.7)
        for t in np.linspace(0, PERIOD, 23):
            assert not any(value[normal] for value in path.evaluate(t))


@pytest.mark.parametrize("plane", ["xy", "xz", "yz"])
def test_the_curves_axes_are_the_planes_in_order(plane: str) -> None:
    first, second = ("xyz".index(axis) for axis in plane)
    p, v, _ = make("circle", plane=plane).evaluate(PERIOD / 4)
    assert p[first] == pytest.approx(-0.1)
    assert p[second] == pytest.approx(0.1)
    assert v[first] == pytest.approx(-0.1 * 2 * np.pi / PERIOD)


angles = st.floats(-6, 6)


@settings(max_examples=40)
@given(
    st.sampled_from(PLANAR),
    st.sampled_from(TIMINGS),
    angles,
    st.tuples(angles, angles, angles),
    st.tuples(st.floats(0, 9), st.floats(0, 9)),
)
def test_angle_and_rotation_turn_the_curve_rigidly(
    name: str,
    timing: str,
    angle: float,
    rotation: tuple[float, float, float],
    times: tuple[float, float],
) -> None:
    path, turned = (
        make(name, timing=timing),
        make(name, timing=timing, angle=angle, rotation=rotation),
    )
    for plain, other in zip(
        zip(*map(path.evaluate, times), strict=True),
        zip(*map(turned.evaluate, times), strict=True),
        strict=True,
    ):
        gram = np.array(plain) @ np.array(plain).T
        np.testing.assert_allclose(np.array(other) @ np.array(other).T, gram, atol=1e-12)


def test_angle_turns_from_x_to_y_and_rotation_about_the_fixed_axes() -> None:
    p = make("square").evaluate(PERIOD / 4)[0]
    np.testing.assert_allclose(p, [-0.2, 0, 0], atol=1e-15)
    p = make("square", angle=np.pi / 2).evaluate(PERIOD / 4)[0]
    np.testing.assert_allclose(p, [0, -0.2, 0], atol=1e-15)
    tilted = make("square", rotation=[np.pi / 2, 0, 0])
    np.testing.assert_allclose(tilted.evaluate(PERIOD / 2)[0], [-0.2, 0, 0.2], atol=1e-15)
    rolled_then_yawed = make("square", rotation=[np.pi / 2, 0, np.pi / 2])
    np.testing.assert_allclose(
        rolled_then_yawed.evaluate(PERIOD / 2)[0], [0, -0.2, 0.2], atol=1e-15
    )


@settings(max_examples=40)
@given(st.floats(0.01, 1.0), st.floats(0.5, 50.0))
def test_nephroid_peak_speed_and_acceleration(size: float, period: float) -> None:
    """|v| = 6 a w |sin f|, |a| <= 12 a w^2: the speed peaks half-way between the cusps."""
    path = make("nephroid", size=size, period=period)
    w = 2 * np.pi / period
    values = [path.evaluate(t) for t in np.linspace(0, period, 101)]
    assert max(np.linalg.norm(v) for _, v, _ in values) == pytest.approx(6 * size * w)
    assert max(np.linalg.norm(a) for _, _, a in values) == pytest.approx(12 * size * w**2)
    assert np.linalg.norm(path.evaluate(period / 2)[1]) < 1e-12 * size * w * 100


@settings(max_examples=60)
@given(st.floats(0, 1), st.floats(0.01, 1), st.floats(-2, 2))
def test_curves_against_their_formulas(share: float, a: float, b: float) -> None:
    f = 2 * np.pi * share
    formulas = {
        "circle": (a * np.cos(f), a * np.sin(f)),
        "nephroid": (
            a * (3 * np.cos(f) - np.cos(3 * f)),
            a * (3 * np.sin(f) - np.sin(3 * f)),
        ),
        "four_ring": (
            a * (np.cos(f) + b * np.cos(3 * f)),
            a * (np.sin(f) - b * np.sin(3 * f)),
        ),
        "clover": (a * np.cos(2 * f) * np.cos(f), a * np.cos(2 * f) * np.sin(f)),
        "clover_centre": (a * np.sin(2 * f) * np.cos(f), a * np.sin(2 * f) * np.sin(f)),
        "deltoid": (
            a * (2 * np.cos(f) + np.cos(2 * f)),
            a * (2 * np.sin(f) - np.sin(2 * f)),
        ),
    }
    for name, (x, y) in formulas.items():
        path = make(name, size=a, **({"ring": b} if name == "four_ring" else {}))
        assert isinstance(path, Planar)
        z = path.curve(f)[0]
        assert abs(z - complex(x, y)) < 1e-14


def test_cat_starts_at_the_chin_and_has_two_equal_ears() -> None:
    path = make("cat", size=1.0)
    outline = path.sample(2001)
    np.testing.assert_allclose(outline[:, 0], -outline[::-1, 0], atol=1e-12)
    np.testing.assert_allclose(outline[:, 1], outline[::-1, 1], atol=1e-12)
    height = outline[:, 1]
    peaks = np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] > height[2:])) + 1
    assert len(peaks) == 2
    assert height[peaks].min() > height[1000] + 0.3
    p, v, _ = path.evaluate(0.0)
    assert not p.any()
    assert v[0] > 0
    assert abs(v[1]) < 1e-12


def test_sharp_square_rests_at_its_four_corners() -> None:
    path = make("square", timing="quintic", plane="yz")
    corners = [[0, 0, 0], [0, -0.2, 0], [0, -0.2, 0.2], [0, 0, 0.2], [0, 0, 0]]
    for k, corner in enumerate(corners):
        p, v, a = path.evaluate(k * PERIOD / 4)
        np.testing.assert_allclose(p, corner, atol=1e-15)
        assert abs(v).max() < 1e-15
        assert abs(a).max() < 1e-12
    np.testing.assert_allclose(path.knots(PERIOD), np.arange(5) * PERIOD / 4)


def test_uniform_sharp_square_keeps_its_speed_and_jumps_at_corners() -> None:
    path = make("square", period=0.7)
    for k, corner in enumerate(path.knots(70.0)):
        way = np.array([[-1, 0, 0], [0, 1, 0], [1, 0, 0], [0, -1, 0]])[k % 4]
        for t in (corner, corner + 0.1):
            np.testing.assert_allclose(path.evaluate(t)[1], 0.8 / 0.7 * way, atol=1e-14)


def test_parallelogram_runs_along_its_sides_and_back() -> None:
    path = make("parallelogram")
    corners = positions(path, np.arange(5) * PERIOD / 4)
    np.testing.assert_allclose(
        corners[:, :2], [[0, 0], [-0.2, 0], [-0.28, 0.15], [-0.08, 0.15], [0, 0]], atol=1e-15
    )
    speeds = [np.linalg.norm(path.evaluate(t)[1]) for t in (0.5, 1.5, 2.5, 3.5)]
    np.testing.assert_allclose(speeds, [0.2, 0.17, 0.2, 0.17])


@settings(max_examples=40)
@given(st.floats(0.001, 0.1), st.floats(0, 2 * PERIOD, exclude_max=True))
def test_rounded_square_has_constant_speed_and_bounded_curvature(radius: float, t: float) -> None:
    path = make("square_rounded", corner_radius=radius, centre=[0, 0, 0])
    speed = (4 * (0.2 - 2 * radius) + 2 * np.pi * radius) / PERIOD
    p, v, a = path.evaluate(t)
    assert np.linalg.norm(v) == pytest.approx(speed)
    assert np.linalg.norm(a) <= speed**2 / radius * (1 + 1e-9)
    assert abs(v @ a) < 1e-12 * (1 + np.linalg.norm(a))
    x, y, _ = abs(path.start_point(np.zeros(3)) + p)
    assert max(x, y) <= 0.1 + 1e-12
    if min(x, y) < 0.1 - radius:
        assert max(x, y) == pytest.approx(0.1)
    else:
        assert math.hypot(x - 0.1 + radius, y - 0.1 + radius) == pytest.approx(radius)


def test_rounded_square_with_the_largest_radius_is_a_circle() -> None:
    path = make("square_rounded", corner_radius=0.1, centre=[0, 0, 0])
    start = path.start_point(np.ones(3))
    np.testing.assert_allclose(start, [0, -0.1, 0], atol=1e-15)
    places = start + positions(path, np.linspace(0, PERIOD, 50))
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), 0.1)


def test_rounded_square_starts_at_the_end_of_a_corner() -> None:
    path = make("square_rounded", centre=[0.5, 0.1, 0.3])
    np.testing.assert_allclose(path.start_point(np.zeros(3)), [0.5 + 0.07, 0.1 - 0.1, 0.3])
    assert path.evaluate(0.0)[1][0] < 0


@pytest.mark.parametrize("timing", TIMINGS)
def test_knots_of_a_rounded_square_are_where_the_acceleration_jumps(timing: str) -> None:
    path = make("square_rounded", timing=timing)
    knots = path.knots(PERIOD)
    assert len(knots) == 9
    way = [path.evaluate(t)[0] for t in knots]
    straight = [np.linalg.norm(b - a) for a, b in zip(way[:-1:2], way[1::2], strict=True)]
    np.testing.assert_allclose(straight, 0.2 - 2 * 0.03)


def test_knots_of_smooth_curves() -> None:
    np.testing.assert_array_equal(make("circle").knots(50.0), [0.0])
    np.testing.assert_array_equal(make("circle", laps=2).knots(50.0), [0.0, 8.0])
    np.testing.assert_array_equal(make("circle", laps=2).knots(math.inf), [0.0, 8.0])
    np.testing.assert_array_equal(make("circle", timing="sin2").knots(9.0), [0.0, 4.0, 8.0])
    assert make("square").knots(-1.0).size == 0
    with pytest.raises(InvalidInputError, match=r"^until: must be finite, not inf"):
        make("circle").knots(math.inf)


@pytest.mark.parametrize("t", [math.nan, math.inf, -math.inf])
def test_a_time_that_is_not_finite_is_refused(t: float) -> None:
    with pytest.raises(InvalidInputError, match=r"^t: must be finite, not"):
        make("circle").evaluate(t)


@pytest.mark.parametrize("name", FIELDS)
def test_starts_at_the_arm_but_for_the_offset(name: str) -> None:
    p_WE = np.array([0.3, 0.1, 0.6])
    np.testing.assert_array_equal(make(name).start_point(p_WE), p_WE)
    start = make(name, offset=[0.1, 0, -0.02]).start_point(p_WE)
    np.testing.assert_allclose(p_WE - start, [0.1, 0, -0.02])


def test_a_centre_is_where_the_curves_own_origin_lies() -> None:
    centre = np.array([0.5, 0.2, 0.4])
    anywhere = np.array([9.0, 9.0, 9.0])
    path = make("circle", plane="yz", centre=centre, angle=0.3, rotation=[0.1, 0.2, 0.3])
    places = path.start_point(anywhere) + positions(path, np.linspace(0, PERIOD, 20))
    np.testing.assert_allclose(np.linalg.norm(places - centre, axis=1), 0.1)
    for name in ("square", "parallelogram"):
        path = make(name, centre=centre)
        opposite = path.start_point(anywhere) + path.evaluate(PERIOD / 2)[0]
        np.testing.assert_allclose((path.start_point(anywhere) + opposite) / 2, centre)


def test_sample_draws_one_closed_lap() -> None:
    for name in FIELDS:
        drawn = make(name, laps=1).sample(41)
        assert drawn.shape == (41, 3)
        np.testing.assert_allclose(drawn[0], drawn[-1], atol=1e-15)
        np.testing.assert_allclose(
            drawn[:-1], positions(make(name), np.arange(40) / 10), atol=1e-12
        )


def test_points_are_passed_in_order_with_continuous_acceleration() -> None:
    path = make("points")
    way = np.cumsum([0, *np.linalg.norm(np.diff([*LOOP, LOOP[0]], axis=0), axis=1)])
    times = PERIOD * way / way[-1]
    np.testing.assert_allclose(positions(path, times[:-1]), LOOP - LOOP[0], atol=1e-12)
    for t in times[1:]:
        for before, after in zip(path.evaluate(t - 1e-9), path.evaluate(t + 1e-9), strict=True):
            np.testing.assert_allclose(before, after, atol=1e-7)


def test_points_on_a_circle_give_nearly_its_motion() -> None:
    turns = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    ring = np.column_stack([0.1 * np.cos(turns), 0.1 * np.sin(turns), 0 * turns])
    spline, circle = make("points", points=ring), make("circle")
    for t in np.linspace(0, PERIOD, 37):
        for near, exact in zip(spline.evaluate(t), circle.evaluate(t), strict=True):
            np.testing.assert_allclose(near, exact, atol=1e-3 * 0.25)


def test_points_may_stay_where_they_are_or_be_moved_to_the_arm() -> None:
    p_WE = np.array([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(make("points").start_point(p_WE), p_WE)
    np.testing.assert_array_equal(make("points", absolute=True).start_point(p_WE), LOOP[0])


def test_a_repeated_first_point_only_closes_the_curve(tmp_path) -> None:
    times = np.linspace(0, PERIOD, 30)
    file = tmp_path / "loop.csv"
    np.savetxt(file, [*LOOP, LOOP[0] + 1e-15], delimiter=",", fmt="%.18g")
    closed, read = (
        make("points", points=[*LOOP, LOOP[0]]),
        Points(file=str(file), period=PERIOD, closed=True),
    )
    np.testing.assert_array_equal(positions(closed, times), positions(make("points"), times))
    np.testing.assert_array_equal(positions(read, times), positions(make("points"), times))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0,0,0\n1,0,0\n1,1,0\n", "needs at least 4 distinct points, not 3"),
        ("0,0,0\n1,0,0\n1,1,0\n0,0,0\n", "needs at least 4 distinct points, not 3"),
        ("", "is empty"),
        ("0,0,0\n1,0,0\n\n1,0,0\n1,1,0\n0,1,0\n", "row 4: repeats the point before it"),
        ("0,0,0\n1,oops,0\n1,1,0\n0,1,0\n", "row 2, column 2: 'oops' is not a finite number"),
        ("0,0,0\n1,0,0\n1,1,nan\n0,1,0\n", "row 3, column 3: 'nan' is not a finite number"),
        ("0,0\n1,0\n1,1\n0,1\n", "row 1: must be 3 numbers, x, y and z"),
        ("0;0\n1;0\n1;1\n0;1\n", "row 1: must be 3 numbers, x, y and z"),
    ],
)
def test_a_bad_file_is_refused_by_name_and_row(tmp_path, text: str, message: str) -> None:
    file = tmp_path / "bad.csv"
    file.write_text(text)
    with pytest.raises(InvalidInputError, match=f"bad.csv: .*{message}"):
        Points(file=str(file), period=1.0, closed=True)


def test_a_file_that_cannot_be_read_is_refused(tmp_path) -> None:
    with pytest.raises(InvalidInputError, match=r"missing\.csv: cannot be read: No such file"):
        Points(file=str(tmp_path / "missing.csv"), period=1.0)
    binary = tmp_path / "binary.csv"
    binary.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InvalidInputError, match=r"binary\.csv: is not a text file"):
        Points(file=str(binary), period=1.0)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"points": None}, "give either a file or points"),
        ({"file": "loop.csv"}, "give either a file or points"),
        ({"points": 3}, "must be a list of points"),
        ({"points": [[0, 0, 0], [1, 0]]}, "row 2: must be 3 numbers"),
        ({"points": [[0, 0, 0], [1, 0, "a"]]}, "row 2, column 3: 'a' is not a finite number"),
        ({"points": [[0, 0, 0], [0, 0, 0]]}, "row 2: repeats the point before it"),
        ({"absolute": True, "offset": [0.1, 0, 0]}, "offset: cannot be combined with absolute"),
        ({"plane": "yz"}, "plane"),
        ({"size": 0.1}, "size"),
    ],
)
def test_bad_points_are_refused(fields: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        make("points", **fields)


@each(
    ("name", "fields", "message"),
    [
        ("circle", {"size": -0.1}, "size: .*greater than or equal to"),
        ("circle", {"size": math.inf}, "size: .*finite"),
        ("circle", {"period": math.nan}, "period: .*"),
        ("circle", {"period": 0}, "period: .*greater than or equal to 0.001"),
        ("circle", {"radius": 0.1}, "radius: no such key"),
        ("circle", {"plane": "zx"}, "plane: .*'xy', 'xz' or 'yz'"),
        ("circle", {"timing": "linear"}, "timing: .*'uniform', 'sin2'"),
        ("circle", {"ramp": 0.6}, "ramp: .*less than or equal to 0.5"),
        ("circle", {"laps": 0}, "laps: .*greater than or equal to 1"),
        ("circle", {"offset": [0.1, 0]}, "offset: .*must have 3 entries, not 2"),
        ("circle", {"angle": math.nan}, "angle: .*finite"),
        (
            "circle",
            {"centre": [0, 0, 0], "offset": [0.1, 0, 0]},
            "offset: cannot be combined with centre",
        ),
        ("clover", {"begin": "middle"}, "begin: .*'tip' or 'centre'"),
        ("square", {"corner_radius": 0.01}, "corner_radius: only with corners: rounded"),
        ("square", {"corners": "rounded"}, "corner_radius: must be given with corners: rounded"),
        (
            "square_rounded",
            {"corner_radius": 0.11},
            "corner_radius: .*at most half the side, 0.1, not 0.11",
        ),
        ("parallelogram", {"size": 0.1}, "size"),
        ("parallelogram", {"sides": [[0, 0], [1, 0]]}, "sides.0: .*must not be zero"),
        ("parallelogram", {"sides": [[1, 0], [1, 0, 0]]}, "sides.1: .*must have 2 entries, not 3"),
    ],
)
def test_bad_fields_are_refused(name: str, fields: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        make(name, **fields)


def test_paths_are_registered_by_kind_and_do_not_change() -> None:
    for kind, cls in PATHS.items():
        assert cls.kind == kind
    path = make("circle")
    with pytest.raises(AttributeError):
        path.period = 2.0
    with pytest.raises(ValueError, match="read-only"):
        path.offset[0] = 1.0


def test_pieces_have_the_values_of_their_trajectory() -> None:
    """To the last bit, also of its derivatives, and where they meet."""
    rng = np.random.default_rng(0)
    times = np.cumsum(rng.uniform(0.001, 1.0, 30))
    curve = quintics(times, *rng.normal(size=(3, 30, 3)))
    at = np.sort(np.concatenate((times, rng.uniform(times[0], times[-1], 3000))))
    for order, found in enumerate(curve.values(at, range(4))):
        drake = curve.trajectory.MakeDerivative(order) if order else curve.trajectory
        np.testing.assert_array_equal(found, drake.vector_values(at).T, strict=True)
    both = join([curve, quintics(times[-1] + np.arange(2.0), *rng.normal(size=(3, 2, 3)))])
    assert both.trajectory.end_time() == times[-1] + 1.0
    np.testing.assert_array_equal(both.values(at[:-1], [1]), curve.values(at[:-1], [1]))
