"""Drawings of SVG files: shapes and transforms, size, and files that are refused."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from path_helpers import assert_derivatives

from drake_rnn import InvalidInputError, Svg, load_experiment, simulate
from row_helpers import each

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


@pytest.mark.parametrize("radii", ["1e-3 1e-3", "1e-200 1e-200", "1e-320 1e-320"])
def test_an_arc_whose_radii_are_too_small_is_a_half_circle_on_its_chord(drawing, radii):
    inside = f'<path d="M 10 10 A {radii} 0 0 1 10 50 L 10 90"/>'
    path = Svg(file=drawing(inside), size=0.8, speed=0.1)
    assert path.length == pytest.approx(0.2 * np.pi + 0.4, rel=1e-6)


@pytest.mark.parametrize(
    "inside",
    [
        '<path d="M 10 10 A 1e-320 5 0 0 1 10 50 L 10 90"/>',
        '<path d="M 10 10 A 5 1e-200 0 0 1 10 50 L 10 90"/>',
        '<path d="M 10 10 L 10 90"/><ellipse cx="10" cy="10" rx="1e-200" ry="5"/>',
    ],
)
def test_arcs_and_ellipses_with_one_radius_of_nothing_are_lines_or_not_drawn(drawing, inside):
    assert Svg(file=drawing(inside), size=0.8, speed=0.1).length == pytest.approx(0.8)


def test_a_rectangle_with_a_corner_radius_of_nothing_has_corners(drawing):
    inside = '<rect width="40" height="20" rx="1e-200" ry="3"/>'
    assert Svg(file=drawing(inside), size=0.4, speed=0.1).length == pytest.approx(1.2)


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
        ('<path d="M 0 0 L 5 5 6"/>', {}, "a path: L takes 2 numbers at a time, and has 1 in"),
        ('<path d="M 0 0 L"/>', {}, "a path: L takes 2 numbers at a time, and has 0 in"),
        ('<path d="M 0 0 L 1e400 3"/>', {}, "a path: has the number '1e400'; it may be up to 1"),
        (SHAPES, {"element": "bnet"}, "has no element 'bnet'; nearest: bent"),
        ("<g", {}, "is no SVG: "),
        (
            '<path d="M 0 0' + " L 1 1 L 2 0" * 1001 + '"/>',
            {},
            "a path: has more than 2000 lines and curves, which it may have",
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


#: Contents that are drawn as a line of 10 by 10 on the page, or twice that.
LINE = '<path d="M 0 0 L 10 10"/>'
BIG = '<path id="big" d="M 0 0 L 90 0"/>'
DISPLAYED = {
    "a mask": f'<mask id="k">{BIG}</mask>{LINE}',
    "a symbol that nothing uses": f'<symbol id="s">{BIG}</symbol>{LINE}',
    "a marker": f'<marker id="m">{BIG}</marker>{LINE}',
    "a pattern": f'<pattern id="p">{BIG}</pattern>{LINE}',
    "a clip": f'<clipPath id="c">{BIG}</clipPath>{LINE}',
    "definitions": f"<defs>{BIG}</defs>{LINE}",
    "elements of no SVG": f'<title>{BIG}</title><x:g xmlns:x="other">{BIG}</x:g>{LINE}',
    "no display": f'<g display="none">{BIG}</g>{LINE}',
    "no display by style": f'<g style="fill:red; display : none">{BIG}</g>{LINE}',
    "no display by sheet": f"<style>/* {{ */ .h, #o {{display: none}}</style>"
    f'<g class="a h">{BIG}</g>{LINE}',
    "the style that wins": "<style>#l {display: inline} path.x {display: none} path {display: no}"
    '</style><path class="x" d="M 0 0 L 90 0"/><path id="l" class="x" d="M 0 0 L 10 10"/>',
    "no visibility": f'<g visibility="hidden">{BIG}<g style="visibility:visible">{LINE}</g></g>',
    "a switch": f'<switch><g requiredExtensions="x">{BIG}</g>{LINE}{BIG}</switch>',
    "no extent": f'<circle r="0"/><rect width="0" height="90"/><g transform="scale(0 1)">{BIG}</g>'
    + LINE,
    "a use": f'<defs><g id="d" transform="scale(2)">{LINE}</g></defs>'
    '<use href="#d" transform="scale(.5)"/>',
    "a symbol that is used": f'<symbol id="s" viewBox="0 0 90 90">{LINE}</symbol>'
    '<use href="#s" width="90" height="90"/>',
    "an origin": '<path d="M 0 0 L 5 5"/>'
    '<path transform="rotate(180)" transform-origin="5px 5" d="M 5 5 L 0 0"/>',
    "an svg in it": '<svg width="20" height="10" viewBox="0 0 5 5"><path d="M 0 0 L 5 5"/></svg>',
}


@each("inside", DISPLAYED.values(), ids=DISPLAYED)
def test_what_svg_does_not_display_is_not_drawn(drawing, inside):
    path = Svg(file=drawing(inside), size=0.1, period=4.0)
    assert path.length == pytest.approx(0.1 * np.sqrt(2.0), rel=1e-12)


@pytest.mark.parametrize("outer", ["defs", "symbol", "g display='none'", "g visibility='hidden'"])
def test_a_hidden_element_is_drawn_by_its_name(drawing, outer):
    file = drawing(f"<{outer}>{BIG}</{outer.split()[0]}>{LINE}")
    assert Svg(file=file, element="big", size=0.1, period=4.0).length == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("inside", "length"),
    [
        ('<path d="M1.77,1.77 a 0 0 0 1 0 100 100Z"/>', 0.2 * np.sqrt(2.0)),
        ('<path d="M 0 0 A 5 0 0 0 1 10 0"/>', 0.1),
        # Radii that are too small to reach grow.
        ('<path d="M 0 0 A 1 1 0 0 1 10 0"/>', 0.05 * np.pi),
        ('<path d="M0 0a5 5 0 015 5 5 5 0 01-5 5"/>', 0.1 * np.pi / 2),
        # Of a circle that is far larger than the page, this is its chord.
        ('<path d="M 0 0 A 1e6 1e6 0 0 1 10 0"/>', 0.1),
        ('<path d="M 0 0 A 1e9 1e9 0 0 1 10 0"/>', 0.1),
        ('<path d="M 0 0 A 9e11 9e11 0 0 1 10 0"/>', 0.1),
        ('<path d="M 0 0 A 1e11 1 0 0 1 10 0"/>', 0.1),
        ('<ellipse rx="5"/>', 0.1 * np.pi),
        ('<circle r="50%" cx="50%" cy="1in"/>', 0.1 * np.pi),
        ('<rect width="50%" height="10" rx="5"/>', 2 * 0.1 * 0.8 + np.pi * 0.02),
        ('<polygon points="0,0 10,0 10,10"/>', 0.2 + 0.1 * np.sqrt(2.0)),
        ('<path d="M 5 5 m 1 1 2 0 0 2 z l 2 0"/>', 0.1 * (3 + np.sqrt(2.0))),
        ('<g transform="rotate(0.25turn) translate(3px,4px)"><path d="M 0 0 H 9"/></g>', 0.1),
    ],
)
def test_a_shape_is_as_long_as_it_is_drawn(drawing, inside, length):
    path = Svg(file=drawing(inside), size=0.1, period=4.0, blend_radius=None)
    assert path.length == pytest.approx(length, rel=1e-5)


@pytest.mark.parametrize("width", [0.01, 0.1, 1.0, 10.0, 100.0])
def test_a_hairpin_is_drawn_to_its_tip(drawing, width):
    """It was cut short by 1 mm of 100 mm."""
    path = Svg(file=drawing(f'<path d="M 0 0 Q 200 {width} 0 {2 * width}"/>'), size=0.1, period=4.0)
    s = np.linspace(0.0, 1.0, 100001)
    curve = np.column_stack((400 * s * (1 - s), -2 * width * s))
    curve *= 0.1 / np.ptp(curve, axis=0).max()
    shown = path.sample(2001)[:, :2]
    tip = np.argmax(curve[:, 0])
    assert np.linalg.norm(shown - curve[tip], axis=1).min() < 1e-6 + path.length / 4000
    assert shown[:, 0].max() == pytest.approx(0.1, abs=1e-6) or width > 50.0
    nearest = np.array([np.linalg.norm(curve - p, axis=1).min() for p in shown[::20]])
    assert nearest.max() < 2e-6


def test_a_curve_that_goes_back_on_itself_turns_at_its_end(drawing):
    path = Svg(file=drawing('<path d="M 0 0 Q 200 0 0 0"/>'), size=0.1, period=4.0)
    assert path.length == pytest.approx(0.2, rel=1e-9)
    cusp = Svg(file=drawing('<path d="M 0 0 C 100 100 0 100 100 0"/>'), size=0.1, period=4.0)
    assert len(cusp.knots(9.0)) == 3


def test_a_hidden_shape_is_drawn_by_its_own_name(drawing):
    file = drawing(f'{LINE}<path id="l" visibility="hidden" display="none" d="M 0 0 V 9"/>')
    assert Svg(file=file, element="l", size=0.1, period=4.0).length == pytest.approx(0.1)


def test_what_svgelements_raises_is_told_in_one_sentence(drawing, monkeypatch):
    """Whatever it does not expect, such as an arc of zero radius before it was a line."""
    import svgelements

    def fails(*_: object) -> None:
        raise IndexError("list index\nout of range")

    file = drawing(LINE)
    monkeypatch.setattr(svgelements.Path, "reify", fails)
    said = "a path: cannot be read as SVG: IndexError list index out of range"
    with pytest.raises(InvalidInputError, match=f"file {file}: {said}"):
        Svg(file=file, size=0.1, period=4.0)


def uses(levels: int, each: int, leaf: str) -> str:
    """Groups of which each uses the one before it several times."""
    groups = [f'<g id="u0">{leaf}</g>']
    for k in range(levels):
        used = f'<use href="#u{k}"/>' * each
        groups.append(f'<g id="u{k + 1}">{used}</g>')
    return f'<defs>{"".join(groups)}</defs><use href="#u{levels}"/>'


#: Contents that nobody draws, and what is said of them.
HOSTILE = {
    "uses without end": (uses(6, 10, LINE), "more than 2000 lines and curves, which it may have"),
    "uses of nothing": (
        uses(6, 10, ""),
        "a use: with it more than 20000 elements and transforms are displayed",
    ),
    "uses of uses": (uses(100, 1, LINE), "a use: is used by 30 uses, each by the next"),
    "a use of itself": ('<use id="a" href="#a"/>', "use a: uses itself, or an element in which"),
    "a use of its group": (f'<g id="a">{LINE}<use href="#a"/></g>', "a use: uses itself, or an"),
    "uses of each other": (
        '<g id="a"><use href="#b"/></g><g id="b"><use href="#a"/></g>',
        "a use: uses itself, or an element in which it is",
    ),
    "a use of another file": ('<use href="o.svg#a"/>', "a use: may use an element of its own file"),
    "a use of nothing": (f'<use href="#lin"/><g id="line">{LINE}</g>', "'lin'; nearest: line"),
    "a path of 200000 lines": (
        f'<path id="p" d="M 0 0{" L 1 1 L 2 0" * 100_000}"/>',
        "path p: has more than 2000 lines and curves, which it may have",
    ),
    "moves alone": (f'<path d="{"M 0 0" * 100_000}"/>', "a path: has more than 2000 lines"),
    "a polygon of many points": (f'<polygon points="{"1 1 " * 10**5}"/>', "more than 4002 numbers"),
    "groups in groups": ("<g>" * 9999 + "</g>" * 9999, "'g': elements may be nested 100 deep"),
    "elements without number": (
        "<g/>" * 101_000,
        "has more than 100000 elements and attributes together",
    ),
    "a length in em": (
        '<rect width="3em" height="1"/>',
        "width: must be a length in px, pt, pc, mm, cm, in or %, not '3em'",
    ),
    "NaN": (
        '<circle r="nan"/>',
        "a circle: r: must be a length in px, pt, pc, mm, cm, in or %, not 'nan'",
    ),
    "a negative radius": ('<circle r="-3"/>', "a circle: r: must not be negative, not '-3'"),
    "an infinite number": ('<circle r="1e999"/>', "r: has the number '1e999'; it may be up to 1e"),
    "a small drawing far away": ('<path d="M 1e12 0 l 1 1"/>', "is 1 large on its page, too small"),
    "transforms that grow": (
        f'<g transform="{"scale(1e12)" * 40}">{LINE}</g>',
        "a g: transform: must not enlarge beyond 1e+15",
    ),
    "no transform": (f'<g transform="turn(3)">{LINE}</g>', "a g: transform: no turn of 1 number"),
    "an unfinished transform": (f'<g transform="scale(3">{LINE}</g>', "a g: transform: must be up"),
    "nothing but zeros": (f'<g transform="scale(0)">{LINE}</g>', "has no line that is drawn"),
    "a sheet for a printer": (
        "<style>@media print{g{display:none}}</style>",
        "rules in '@media print' are not read",
    ),
    "a long sheet": (f"<style>{'}' * 1_000_001}</style>", "style: may have 1000000 characters"),
    "many transforms": (
        f'<g id="g"><g transform="{"skewX(1)" * 90}"/></g>' * 250,
        "with it more than 20000 elements and transforms are displayed",
    ),
    "a long transform": (f'<g transform="{"skewX(1)" * 101}"/>', "transform: must be up to 100 of"),
    "a viewBox without area": ('<svg viewBox="0 0 0 1"/>', "a svg: viewBox: must be x, y, width"),
    "half a point": ('<polyline points="1 1 2"/>', "a polyline: points: must be pairs of numbers"),
    "an origin in words": (
        '<g transform="scale(2)" transform-origin="center"/>',
        "a g: no number at 'center'",
    ),
    "no aspect": (
        '<svg viewBox="0 0 1 1" preserveAspectRatio="mid"/>',
        "a svg: preserveAspectRatio: must be as xMidYMid meet, not 'mid'",
    ),
    "a path without a move": ('<path d="L 1 1"/>', "a path: must begin with M, not L"),
    "a flag of 2": ('<path d="M0 0A1 1 0 2 0 3 3"/>', "a path: no flag, 0 or 1, at '2 0 3 3'"),
}


@each(("inside", "said"), HOSTILE.values(), ids=HOSTILE)
def test_what_nobody_draws_is_refused_before_it_is_read(drawing, inside, said):
    with pytest.raises(InvalidInputError, match="Svg: file") as caught:
        Svg(file=drawing(inside), size=0.1, period=4.0)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


#: Document types of files, and what is said of them.
ENTITIES = {
    "laughs": (
        '<!ENTITY a "ha"><!ENTITY b "&a;&a;">',
        "has the entity 'b', which is made of others",
    ),
    "a long one": (
        f'<!ENTITY a "{"x" * 2_000_000}">',
        "entities that stand for more than 1000000 characters",
    ),
    "another file": ('<!ENTITY a SYSTEM "file:///etc/hostname">', "'a', which is in another file"),
    "a parameter": ('<!ENTITY % b "x"> %b;', "has the entity 'b', which is in another file"),
    "very many": ("".join(f'<!ENTITY a{k} "x">' for k in range(101)), "more than 100 entities"),
    "a default": (f'<!ATTLIST path x CDATA "{"x" * 101}">', "has a default of 'x' of 101"),
    "a short one": ('<!ENTITY a "M 0 0 L 10 10">', None),
}


@pytest.mark.parametrize(("entities", "said"), ENTITIES.values(), ids=ENTITIES)
def test_entities_are_those_that_drawing_programs_write(tmp_path, entities, said):
    file = tmp_path / "e.svg"
    file.write_text(f'<!DOCTYPE svg [{entities}]><svg><path d="&a;"/></svg>')
    if said is None:
        assert Svg(file=str(file), size=0.1, period=4.0).length > 0.1
    else:
        with pytest.raises(InvalidInputError, match=said):
            Svg(file=str(file), size=0.1, period=4.0)


def test_without_its_package_the_path_says_what_to_install(drawing, monkeypatch):
    file = drawing(SHAPES)
    monkeypatch.setitem(sys.modules, "svgelements", None)
    with pytest.raises(InvalidInputError, match=r"needs svgelements.*pip install 'svgelements"):
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
