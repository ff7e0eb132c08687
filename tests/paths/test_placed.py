"""Paths in the world frame: where the arm starts, in the frame of the tool, in any frame."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from drake_rnn import (
    Circle,
    Curve,
    InvalidInputError,
    Line,
    PathSource,
    Points,
    RelativePath,
    Sequence,
    Waypoints,
    load_arm,
    validated,
)
from row_helpers import each

P_WE = np.array([0.3, 0.1, 0.6])
R_WE = RotationMatrix(RollPitchYaw(0.3, -0.2, 2.0)).matrix()
X_WC = RigidTransform(RollPitchYaw(1.0, 0.2, -0.4), [0.1, -0.3, 0.8])
PANDA = load_arm("panda")


def test_in_the_base_it_is_the_path_from_where_the_arm_starts():
    path = Circle(size=0.1, period=4.0, plane="yz", offset=[0.02, 0, 0])
    placed = path.placed(P_WE, R_WE)
    for t in (0.0, 1.3, 7.1):
        p, v, a = path.evaluate(t)
        np.testing.assert_array_equal(placed.position(t)[0], P_WE - [0.02, 0, 0] + p)
        np.testing.assert_array_equal(placed.position(t)[1:], (v, a))
        R, w, alpha = placed.orientation(t)
        np.testing.assert_array_equal(R, R_WE)
        assert not w.any()
        assert not alpha.any()
    assert (placed.duration, placed.traversal) == (math.inf, 4.0)
    assert placed.closed
    assert not placed.turns
    np.testing.assert_array_equal(placed.sample(9), P_WE - [0.02, 0, 0] + path.sample(9))


@pytest.mark.parametrize(
    ("frame", "X_WF"),
    [("tool", RigidTransform(RotationMatrix(R_WE), P_WE)), ("camera", X_WC)],
)
def test_in_another_frame_every_vector_is_along_its_axes(frame, X_WF):
    fields = {"by": [0.1, -0.2, 0.05], "turn": [0.3, 0.4, 1.0], "period": 2.0, "timing": "quintic"}
    plain, placed = Line(**fields), Line(frame=frame, **fields).placed(P_WE, R_WE, {"camera": X_WC})
    R_WF = X_WF.rotation().matrix()
    for t in (0.0, 0.7, 1.6, 3.0):
        p, v, a = (R_WF @ x for x in plain.evaluate(t))
        np.testing.assert_allclose(placed.position(t), (P_WE + p, v, a), atol=1e-12)
        R, w, alpha = plain.evaluate_rotation(t)
        got = placed.orientation(t)
        np.testing.assert_allclose(got[0], R_WF @ R @ R_WF.T @ R_WE, atol=1e-12)
        np.testing.assert_allclose(got[1:], (R_WF @ w, R_WF @ alpha), atol=1e-12)
    np.testing.assert_allclose(placed.sample(5)[-1], placed.position(2.0)[0], atol=1e-12)


@pytest.mark.parametrize(
    "path",
    [
        lambda **more: Circle(size=0.1, period=4.0, centre=[0.1, 0.2, 0.3], **more),
        lambda **more: Points(
            points=[[0, 0, 0], [1, 0, 0], [1, 1, 1]], period=4.0, absolute=True, **more
        ),
        lambda **more: Waypoints(
            positions=[[0, 0, 0.1], [1, 0, 0]],
            times=[0, 1],
            rpy=[[0.1, 0, 0], [0, 1, 0]],
            absolute=True,
            **more,
        ),
        lambda **more: Line(to=[0.1, 0.2, 0.3], period=1.0, **more),
    ],
    ids=["centre", "points", "waypoints", "to"],
)
def test_a_place_of_its_own_is_one_in_its_frame(path):
    """As seen by a camera: the same as for an arm that starts where this one is seen by it."""
    C = X_WC.inverse() @ RigidTransform(RotationMatrix(R_WE), P_WE)
    seen = path().placed(C.translation(), C.rotation().matrix())
    placed = path(frame="camera").placed(P_WE, R_WE, {"camera": X_WC})
    for t in (0.0, 0.4, 0.9, 2.0):
        place = X_WC @ seen.position(t)[0]
        np.testing.assert_allclose(placed.position(t)[0], place, atol=1e-12)
        R = X_WC.rotation().matrix() @ seen.orientation(t)[0]
        np.testing.assert_allclose(placed.orientation(t)[0], R, atol=1e-12)


def test_a_frame_of_the_model_is_where_it_is_at_the_start():
    line = Line(by=[0, 0, 0.1], period=1.0, frame="panda_link4")
    placed = line.placed_on(PANDA, PANDA.home)
    kinematics = PANDA.kinematics()
    axis = kinematics.X_WF(PANDA.home, "panda_link4").rotation().matrix()[:, 2]
    way = placed.position(1.0)[0] - kinematics.p_WE(PANDA.home)
    np.testing.assert_allclose(way, 0.1 * axis, atol=1e-15)
    assert line.frames == {"panda_link4"}
    with pytest.raises(InvalidInputError, match=r"^path\.frame: no frame 'panda_link44' in the"):
        Line(by=[0, 0, 0.1], period=1.0, frame="panda_link44").placed_on(PANDA, PANDA.home)


@pytest.mark.parametrize(
    ("path", "arguments", "message"),
    [
        (Circle(size=0.1, period=1.0), (), "p_WE: must be given, for a path that begins where"),
        (Circle(size=0.1, period=1.0, frame="tool"), (P_WE,), "R_WE: must be given, for a path in"),
        (Circle(size=0.1, period=1.0, frame="eye"), (P_WE, R_WE), "frames: must hold .* 'eye'"),
        (
            Circle(size=0.1, period=1.0),
            (P_WE[:2],),
            r"p_WE: must be finite .* shape \(3,\), not of",
        ),
        (
            Circle(size=0.1, period=1.0),
            (P_WE, P_WE),
            r"R_WE: must be finite .* shape \(3, 3\), not",
        ),
        (Circle(size=0.1, period=1.0), (P_WE * np.nan,), "p_WE: must be finite numbers"),
        (Circle(size=0.1, period=1.0), ("here",), "p_WE: must be finite numbers"),
    ],
)
def test_what_a_place_lacks_is_named(path, arguments, message):
    with pytest.raises(InvalidInputError, match=message):
        path.placed(*arguments)


def test_an_orientation_that_is_not_known_is_not_made_up():
    placed = Circle(size=0.1, period=1.0).placed(P_WE)
    assert not placed.oriented
    with pytest.raises(InvalidInputError, match="R_WE: must be given"):
        placed.orientation(0.0)
    assert Circle(size=0.1, period=1.0, centre=[0, 0, 0]).placed().position(0.0)[0][0] == 0.1


def test_a_source_offers_a_turning_orientation_with_its_rates_and_previews():
    path = Line(by=[0.1, 0, 0], turn=[0, 0, 1.0], period=2.0, timing="quintic")
    source = PathSource(path, P_WE, "pose", R_WE, preview=0.25)
    placed, context = path.placed(P_WE, R_WE), source.CreateDefaultContext()
    for t in (0.4, 1.9, 0.4):
        context.SetTime(t)
        for names, at in (
            (("R_WE_desired", "w_WE_desired", "alpha_WE_desired"), t),
            (("R_preview", "w_preview", "alpha_preview"), t + 0.25),
        ):
            for name, value in zip(names, placed.orientation(at), strict=True):
                got = source.GetOutputPort(name).Eval(context)
                np.testing.assert_array_equal(got, np.ravel(value))


def test_a_source_takes_a_placed_path_or_none_of_another_kind():
    placed = Circle(size=0.1, period=1.0).placed(P_WE, R_WE)
    source = PathSource(placed)
    got = source.GetOutputPort("p_WE_desired").Eval(source.CreateDefaultContext())
    np.testing.assert_array_equal(got, P_WE)
    with pytest.raises(InvalidInputError, match="p_WE: must be left out"):
        PathSource(placed, P_WE)
    for wrong in (3.0, None, "circle", Circle):
        with pytest.raises(InvalidInputError, match=r"^path: must be of class Path or PlacedPath"):
            PathSource(wrong, P_WE)


# Paths of a user's own that are wrong.


def own(**members):
    """Return a curve of a user's own with these members."""
    right = {
        "trace": lambda self, f: ((0.0, math.sin(f), 0.0), (0.0, math.cos(f), 0.0), (0.0,) * 3)
    }
    return validated(type("Mine", (Curve,), {**right, **members}))(period=2.0)


def own_relative(**members):
    still = np.zeros(3)
    right = {"duration": 2.0, "evaluate": lambda self, t: (still, still, still)}
    return validated(type("Mine", (RelativePath,), {**right, **members}))()


def fails(self, value):
    raise ZeroDivisionError("division by zero")


NOTHING = np.zeros(3)


@each(
    ("path", "message"),
    [
        (own(trace=lambda self, f: None), r"Mine\.trace\(phase = 0\): must return .*not None"),
        (own(trace=lambda self, f: (0.0, 1.0, 2.0)), r"Mine\.trace.*not one of shape \(\)"),
        (own(trace=lambda self, f: ((0, 0),) * 3), r"Mine\.trace.*not one of shape \(2,\)"),
        (own(trace=lambda self, f: ((0, 0, 0),) * 2), r"Mine\.trace.*three arrays"),
        (own(trace=lambda self, f: ((0, 0, math.nan),) * 3), r"Mine\.trace.*finite.*nan"),
        (own(trace=lambda self, f: (("a", 0, 0),) * 3), r"Mine\.trace.*not \['a', 0, 0\]"),
        (own(trace=fails), r"Mine\.trace\(phase = 0\): fails with ZeroDivisionError: division by"),
        (
            own(trace=lambda self, f: ((1.0, 0, 0), (0, 0, 0), (0, 0, 0))),
            "Mine must start at its first point, with a displacement of zero, not 1 m away",
        ),
        (
            own(trace=lambda self, f: ((f, 0, 0), (1, 0, 0), (0, 0, 0))),
            "Mine says that it is closed, and a lap ends 6.28 m from where it began",
        ),
        (own_relative(duration=-1.0), r"Mine\.duration: must be a time above 0 \[s\], not -1"),
        (own_relative(duration=math.nan), r"Mine\.duration: must be a time above 0 \[s\], not nan"),
        (own_relative(duration="2"), r"Mine\.duration: must be a time above 0"),
        (own_relative(duration=math.inf), r"Mine\.traversal: must be a finite time above 0"),
        (own_relative(evaluate=lambda self, t: None), r"Mine\.evaluate\(t = -1\): .*not None"),
        (
            own_relative(evaluate=lambda self, t: (np.full(3, t), NOTHING)),
            r"Mine\.evaluate.*three arrays",
        ),
        (
            own_relative(evaluate=lambda self, t: (np.full(3, np.inf), NOTHING, NOTHING)),
            r"Mine\.evaluate.*finite",
        ),
        (
            own_relative(turns=True, evaluate_rotation=lambda self, t: (NOTHING, NOTHING, NOTHING)),
            r"Mine\.evaluate_rotation.*\(3, 3\), \(3,\), \(3,\), not one of shape \(3,\)",
        ),
    ],
)
def test_a_wrong_path_is_refused_by_name(path, message):
    for use in (lambda: path.placed(P_WE, R_WE), lambda: PathSource(path, P_WE)):
        with pytest.raises(InvalidInputError, match=f"^path: {message}") as caught:
            use()
        assert "\n" not in str(caught.value)


def test_a_right_path_of_ones_own_is_not():
    placed = own().placed(P_WE)
    assert placed.closed
    np.testing.assert_allclose(placed.position(0.5)[0], P_WE + np.array([0, 1, 0]))
    assert own_relative().placed(P_WE).traversal == 2.0


@pytest.mark.parametrize("R_WE", [np.ones((3, 3)), -np.eye(3), 1.001 * np.eye(3)])
def test_an_orientation_is_a_rotation(R_WE):
    with pytest.raises(InvalidInputError, match=r"^R_WE: must be a rotation matrix, not "):
        Circle(size=0.1, period=1.0).placed(np.zeros(3), R_WE)


@pytest.mark.parametrize(
    ("fields", "until", "began"),
    [
        ({}, 3.9, None),
        ({}, 4.0, 0.0),
        # Without an end, a lap ends at any time.
        ({}, 9.5, 5.5),
        ({"laps": 1}, 3.9, None),
        ({"laps": 1}, 9.5, 0.0),
        ({"laps": 3}, 20.0, 8.0),
        ({"laps": 2, "pause": 0.5, "timing": "quintic"}, 20.0, 4.5),
    ],
)
def test_the_last_lap_began_where_the_point_is_again(fields, until, began):
    placed = Circle(size=0.1, period=4.0, **fields).placed(P_WE, R_WE)
    assert placed.last_lap(until) == (None if began is None else pytest.approx(began, abs=1e-12))


def test_a_sequence_closes_as_a_whole_and_an_open_path_never():
    fields = {"period": 2.0, "timing": "quintic"}
    way, back = (Line(by=[by, 0.0, 0.0], **fields) for by in (0.1, -0.1))
    there = Sequence(parts=[{"path": way}, {"path": back}]).placed(P_WE, R_WE)
    assert [there.last_lap(t) for t in (2.0, 3.9, 4.0, 7.0)] == [None, None, 0.0, 0.0]
    assert way.placed(P_WE, R_WE).last_lap(5.0) is None
