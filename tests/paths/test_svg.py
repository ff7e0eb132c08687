"""Drawings of SVG files: shapes and transforms, size, and files that are refused."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from path_helpers import assert_derivatives

from drake_rnn import InvalidInputError, Svg, load_experiment, simulate

SHAPES = """
<g id="both" transform="translate(10 10) rotate(30) scale(2)">
  <circle id="round" cx="20" cy="20" r="10"/>
  <path id="bent" d="M10 10 C 20 20, 40 20, 50 10 A 5 8 30 0 1 70 20 Q 80 30 60 40 z m 5 5 l 10 0"/>
</g>
<rect id="box" x="1" y="1" width="40" height="20" rx="5"/>
<text>not drawn</text>
"""


@pytest.fixture
def drawing(tmp_path):
    """A function that writes a drawing and returns its file."""

    def written(inside: str) -> str:
        file = tmp_path / "drawing.svg"
        page = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">{inside}</svg>'
        file.write_text(page)
        return str(file)

    return written


def test_a_circle_is_round_through_all_its_transforms(drawing):
    path = Svg(file=drawing(SHAPES), element="round", size=0.2, period=4.0, centre=np.zeros(3))
    points = path.placed().sample(2001)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 0.1, atol=2e-7)
    assert path.length == pytest.approx(0.2 * np.pi, rel=1e-6)
    # Four arcs that meet smoothly are one run.
    assert len(path.knots(9.0)) == 2


def test_up_on_the_page_is_up_in_the_plane_and_the_size_is_the_larger_side(drawing):
    path = Svg(file=drawing('<path d="M 0 0 L 0 -10 L 40 -10"/>'), size=0.2, period=4.0)
    corner, end = (path.evaluate(t)[0] for t in path.knots(9.0)[1:])
    np.testing.assert_allclose(corner, [0.0, 0.05, 0.0], atol=1e-15)
    np.testing.assert_allclose(end, [0.2, 0.05, 0.0], atol=1e-15)


def test_a_group_is_drawn_by_its_id_and_a_file_as_a_whole(drawing):
    file = drawing(SHAPES)
    counts = {
        element: len(Svg(file=file, element=element, size=0.1, period=4.0)._strokes)
        for element in ("round", "bent", "both", "box", None)
    }
    assert counts == {"round": 1, "bent": 2, "both": 3, "box": 1, None: 4}


def test_a_cubic_passes_its_own_points(drawing):
    control = np.array([[0, 0], [10, 30], [30, -30], [40, 0]], dtype=float)
    path = Svg(file=drawing('<path d="M 0 0 C 10 30 30 -30 40 0"/>'), size=0.4, period=4.0)
    shown = path.sample(4001)
    s = np.linspace(0, 1, 23)[:, None]
    basis = np.hstack([(1 - s) ** 3, 3 * s * (1 - s) ** 2, 3 * s**2 * (1 - s), s**3])
    for x, y in basis @ control * [0.01, -0.01]:
        away = np.linalg.norm(shown - [x, y, 0.0], axis=1).min()
        assert away < 0.6 * path.length / 4000


@pytest.mark.parametrize("radius", [None, 0.004])
def test_velocity_and_acceleration_are_the_derivatives(drawing, radius):
    file = drawing(SHAPES)
    given = {"size": 0.1, "period": 10.0, "blend_radius": radius, "lift": 0.02}
    assert_derivatives(Svg(file=file, element="box", **given))


def test_a_slight_corner_is_no_stop(drawing):
    """Where drawing programs round numbers, smooth curves turn by a fraction of a degree."""
    path = Svg(file=drawing('<path d="M 0 0 L 50 0 L 100 1"/>'), size=0.1, period=4.0)
    assert len(path.knots(9.0)) == 2
    sharp = Svg(file=drawing('<path d="M 0 0 L 50 0 L 100 20"/>'), size=0.1, period=4.0)
    assert len(sharp.knots(9.0)) == 3


def test_a_line_that_goes_back_is_stopped_at_even_where_corners_are_rounded(drawing):
    file = drawing('<path d="M 0 0 L 50 0 L 0 0.5"/>')
    assert len(Svg(file=file, size=0.1, period=4.0, blend_radius=0.01).knots(9.0)) == 3


@pytest.mark.parametrize(
    ("inside", "more", "said"),
    [
        ("", {}, "has no path, and no other shape, to be drawn"),
        ("<text>hi</text>", {}, "has no path, and no other shape, to be drawn"),
        ('<path d=""/>', {}, "has no line that is drawn"),
        ('<path d="M 5 5"/>', {}, "has no line that is drawn"),
        ('<path id="p" d="M 0 0 L 5 x"/>', {}, "path p: no number at 'x'"),
        ('<path d="0 0 L 5 5"/>', {}, "a path: no command at '0 0 L 5 5'"),
        ('<path d="M 0 0 L 5 5 6"/>', {}, "a path: L takes 2 numbers, and has 3"),
        ('<path d="M 0 0 L"/>', {}, "a path: L takes 2 numbers, and has 0"),
        ('<path d="M 0 0 L 1e400 3"/>', {}, "has a point that is not finite"),
        (SHAPES, {"element": "bnet"}, "has no element 'bnet'; nearest: bent"),
        ("<g", {}, "is no SVG: "),
        (
            '<path d="M 0 0' + " L 1 1 L 2 0" * 1001 + '"/>',
            {},
            "has 2002 lines and curves, and may",
        ),
    ],
)
def test_what_cannot_be_drawn_is_refused_with_the_name_of_the_file(drawing, inside, more, said):
    file = drawing(inside)
    with pytest.raises(InvalidInputError) as caught:
        Svg(file=file, size=0.1, period=4.0, **more)
    assert f"file {file}: {said}" in str(caught.value)


def test_files_that_are_no_drawings_are_refused(tmp_path):
    other = tmp_path / "a.svg"
    for content, said in (("<html/>", "is no SVG: its outermost"), ("", "is no SVG: no element")):
        other.write_text(content)
        with pytest.raises(InvalidInputError, match=said):
            Svg(file=str(other), size=0.1, period=4.0)
    with pytest.raises(InvalidInputError, match="cannot be read: No such file"):
        Svg(file=str(tmp_path / "missing.svg"), size=0.1, period=4.0)


def test_without_its_package_the_path_says_what_to_install(drawing, monkeypatch):
    file = drawing(SHAPES)
    monkeypatch.setitem(sys.modules, "svgelements", None)
    with pytest.raises(InvalidInputError, match=r"needs svgelements.*pip install drake-rnn\[svg\]"):
        Svg(file=file, size=0.1, period=4.0)


def test_a_drawing_of_200_lines_and_curves_is_one_path(drawing):
    """A spiral of 100 lines, and 100 curves back along a wave."""
    turns = np.linspace(0.5, 12.0, 101)
    spiral = " L ".join(f"{50 + 4 * k * np.cos(k)} {50 + 4 * k * np.sin(k)}" for k in turns)
    wave = " ".join(f"q 0.5 {(-1) ** k} 1 0" for k in range(100))
    path = Svg(
        file=drawing(f'<path d="M {spiral} {wave}"/>'),
        size=0.2, speed=0.2, acceleration=2.0, blend_radius=0.002,
    )  # fmt: skip
    assert sum(len(stroke) for stroke in path._strokes) == 200
    times = np.linspace(0.0, path.duration, 4001)
    p, v, a = (np.array(each) for each in zip(*map(path.evaluate, times.tolist()), strict=True))
    assert np.linalg.norm(v, axis=1).max() <= 0.2 * (1 + 1e-9)
    assert np.linalg.norm(a, axis=1).max() <= 2.0 * (1 + 1e-9)
    # No jump: each step is at most what the largest speed allows.
    assert np.linalg.norm(np.diff(p, axis=0), axis=1).max() < 0.2 * times[1] * (1 + 1e-6)


@pytest.mark.long
def test_a_run_follows_such_a_drawing(drawing):
    """The pseudoinverse feeds the desired velocity forward; what is left is of the sampling."""
    steps = " ".join(f"l {2 + k % 3} {(-1) ** k * (1 + k % 5)}" for k in range(200))
    path = {"kind": "svg", "file": drawing(f'<path d="M 0 0 {steps}"/>'), "size": 0.2}
    path |= {"plane": "yz", "blend_radius": 0.0005, "speed": 0.1, "acceleration": 2.0}
    result = simulate(load_experiment("pinv_drawing", {"path": path, "duration": 16}))
    assert sum(map(len, Svg(**{k: v for k, v in path.items() if k != "kind"})._strokes)) == 200
    assert result.metrics["position_error_max_m"] < 1e-4
