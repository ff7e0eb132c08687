"""Distances of an arm from itself and from obstacles: against searches, differences and Drake."""

from functools import cache
from itertools import combinations, pairwise

import numpy as np
import pytest

from drake_rnn import InvalidInputError, Shield, UnprotectedWarning, load_arm, shipped_arms
from drake_rnn.robot.clearance import Clearance
from drake_rnn.robot.clearance.arm_capsules import capsules_of, fitted_capsules, place_capsules
from drake_rnn.robot.clearance.arm_clearance import arm_clearance
from drake_rnn.robot.clearance.arm_shapes import (
    enclosing_capsule,
    parts_of,
    smallest_circle,
)
from drake_rnn.robot.clearance.capsules import (
    Solids,
    between_segments,
    to_boxes,
    to_cylinders,
    to_half_spaces,
)
from drake_rnn.robot.clearance.obstacles import make_obstacles

OBSTACLES = [
    {"kind": "ball", "center": [0.5, 0.2, 0.4], "radius": 0.08},
    {"kind": "box", "center": [0.4, -0.4, 0.3], "size": [0.2, 0.3, 0.1], "rpy": [0.1, 0.2, 0.3]},
    {"kind": "half_space", "point": [0, 0, -0.1], "normal": [0, 0, 2]},
    {"kind": "capsule", "ends": [[0.6, 0, 0.2], [0.6, 0.3, 0.9]], "radius": 0.05},
    {"kind": "cylinder", "center": [-0.3, 0.3, 0.5], "radius": 0.1, "length": 0.3},
]


def segments(seed, count):
    return np.random.default_rng(seed).normal(size=(count, 2, 3))


def searched(A, distance):
    """The least of a function of points of a segment, by a grid that becomes finer twice."""
    low, high = 0.0, 1.0
    for _ in range(4):
        s = np.linspace(low, high, 201)
        found = distance(A[0] + s[:, None] * (A[1] - A[0]))
        best = s[found.argmin()]
        width = (high - low) / 200.0
        low, high = max(0.0, best - width), min(1.0, best + width)
    return found.min()


def test_segments_are_as_far_apart_as_a_search_finds_them():
    """Also points, parallel ones, and ones on one line; the distance to a segment is convex."""
    A, B = segments(0, 300), segments(1, 300)
    A[:20, 1], B[10:30, 1] = A[:20, 0], B[10:30, 0]
    B[30:50, 1] = B[30:50, 0] + 2.0 * (A[30:50, 1] - A[30:50, 0])
    B[50:60] = A[50:60] + 3.0 * (A[50:60, 1:] - A[50:60, :1])
    near = between_segments(A, B)
    for a, b, found in zip(A, B, near.distance, strict=True):

        def away(points, b=b):
            d = b[1] - b[0]
            t = np.clip((points - b[0]) @ d / max(d @ d, 1e-300), 0.0, 1.0)
            return np.linalg.norm(points - b[0] - t[:, None] * d, axis=1)

        # A grid finds no less than there is, and nearly that.
        assert -1e-12 < searched(a, away) - found < 1e-6
    assert np.allclose(np.linalg.norm(near.p_A - near.p_B, axis=1), near.distance, atol=1e-15)


def test_segments_are_as_far_from_boxes_as_a_search_finds_them():
    A = segments(2, 300)
    A[:20, 1] = A[:20, 0]
    A[20:40, 1, 0] = A[20:40, 0, 0]
    half = np.random.default_rng(3).uniform(0.1, 0.8, (300, 3))
    near = to_boxes(A, half)
    for a, h, found in zip(A, half, near.distance, strict=True):

        def away(points, h=h):
            return np.linalg.norm(points - np.clip(points, -h, h), axis=1)

        off = searched(a, away)
        assert -1e-12 < off - found < 1e-6
    assert (near.distance == 0.0).any()


def test_segments_are_as_far_from_cylinders_as_a_search_finds_them():
    """Also points, segments along the axis, beside it and across, and on the axis."""
    A, rng = segments(6, 300), np.random.default_rng(7)
    A[:20, 1] = A[:20, 0]
    axes = rng.normal(size=(300, 3))
    axes[:80] = [0.0, 0.0, 1.0]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    A[20:40, 1, :2], A[40:60, 1, 2], A[60:80, :, :2] = A[20:40, 0, :2], A[40:60, 0, 2], 0.0
    half, radii = rng.uniform(0.1, 0.8, (2, 300))
    near = to_cylinders(A, axes, half, radii)
    for a, axis, h, r, found in zip(A, axes, half, radii, near.distance, strict=True):

        def away(points, axis=axis, h=h, r=r):
            z = points @ axis
            rho = np.linalg.norm(points - np.outer(z, axis), axis=1)
            return np.hypot(np.maximum(np.abs(z) - h, 0.0), np.maximum(rho - r, 0.0))

        assert -1e-12 < searched(a, away) - found < 1e-6
    # The points of the cylinders are in them, so that no distance is too small either.
    heights = (near.p_B * axes).sum(axis=1)
    assert (np.abs(heights) <= half + 1e-12).all()
    assert (np.linalg.norm(near.p_B - heights[:, None] * axes, axis=1) <= radii + 1e-12).all()
    assert np.allclose(np.linalg.norm(near.p_A - near.p_B, axis=1), near.distance, atol=1e-15)
    assert 10 < (near.distance == 0.0).sum() < 200


def test_half_spaces_count_what_is_within_as_negative():
    A = np.array([[[0, 0, 1.0], [0, 0, -0.2]]])
    near = to_half_spaces(A, np.array([[0, 0, 1.0]]), np.array([0.1]))
    assert near.distance[0] == pytest.approx(-0.3)
    assert near.p_B[0].tolist() == pytest.approx([0, 0, 0.1])


def test_a_capsule_holds_all_points_and_is_hardly_larger_than_one_that_does():
    """Points on a known capsule; its volume is at most 5 % larger, in any direction."""
    rng = np.random.default_rng(4)
    for _ in range(3):
        d, u = (
            x / np.linalg.norm(x, axis=-1, keepdims=True)
            for x in (rng.normal(size=3), rng.normal(size=(400, 3)))
        )
        points = rng.uniform(0.0, 0.3, (400, 1)) * d + 0.05 * u
        found = enclosing_capsule(points)
        along = found.ends[1] - found.ends[0]
        t = np.clip((points - found.ends[0]) @ along / (along @ along), 0.0, 1.0)
        away = np.linalg.norm(points - found.ends[0] - t[:, None] * along, axis=1)
        assert away.max() <= found.radius + 1e-12
        assert found.volume < 1.05 * np.pi * 0.05**2 * (0.3 + 4.0 / 3.0 * 0.05)


def test_the_smallest_circle_is_held_by_two_or_three_points():
    rng = np.random.default_rng(5)
    for count in (1, 2, 3, 50):
        points = rng.normal(size=(count, 2))
        centre, radius = smallest_circle(points)
        away = np.linalg.norm(points - centre, axis=1)
        assert away.max() <= radius + 1e-12
        if count > 1:
            on = points[away > radius - 1e-9]
            # No move of the centre brings all of those nearer: it is in their hull.
            turns = np.sort(np.arctan2(*(on - centre).T[::-1]))
            assert np.diff(turns, append=turns[0] + 2.0 * np.pi).max() < np.pi + 1e-6


loaded = cache(load_arm)


@pytest.fixture(params=shipped_arms())
def arm(request):
    return loaded(request.param)


def clearance_of(arm, given=OBSTACLES):
    found, doubts = arm_clearance(arm, make_obstacles(given), arm.home)
    assert doubts == ()
    return found


@pytest.mark.long
def test_capsules_hold_every_vertex_of_what_a_model_shows(arm):
    """Those that are fitted; those of a file hold the maker's meshes, or what the model shows."""
    parts = parts_of(arm)
    fitted = fitted_capsules(parts)
    assert len(fitted) == len(parts)
    for part, capsule in zip(parts, fitted, strict=True):
        assert part.exact or capsule.holds(part.points), part.body


def test_capsules_move_as_the_bodies_do(arm):
    capsules, _ = capsules_of(arm)
    placed, plant = place_capsules(arm, capsules), arm.plant()
    context, rng = plant.CreateDefaultContext(), np.random.default_rng(6)
    for q in rng.uniform(-1.5, 1.5, (5, arm.n)):
        plant.SetPositions(context, arm.posture(plant, q))
        ends = placed.segments_in_world(placed.poses.at(q))
        for capsule, found in zip(capsules, ends, strict=True):
            X_WB = plant.GetBodyByName(capsule.body).EvalPoseInWorld(context)
            for stated, end in zip(capsule.ends, found, strict=True):
                assert X_WB @ stated == pytest.approx(end, abs=1e-14)


def test_slopes_are_those_of_differences(arm):
    clearance = clearance_of(arm)
    q = np.random.default_rng(7).uniform(-1.5, 1.5, (20, arm.n))
    near = clearance.near(q)
    step = 1e-6 * np.eye(arm.n)
    differences = np.stack(
        [(clearance.gaps(q + e) - clearance.gaps(q - e)) / 2e-6 for e in step], axis=-1
    )
    # Where segments cross, or one is in a box, there is no slope.
    apart = near.gaps > -0.02
    assert apart.sum() > 100
    assert np.abs(near.slopes - differences)[apart].max() < 1e-6


def test_pairs_that_are_looked_at_alone_are_as_far_apart_as_among_all(arm):
    """Also none of one shape, and none at all; two in turn, as those asked for last are kept."""
    clearance, rng = clearance_of(arm), np.random.default_rng(10)
    q = rng.uniform(-1.5, 1.5, (4, arm.n))
    every = clearance.near(q)
    np.testing.assert_array_equal(every.gaps, clearance.gaps(q))
    count, own = clearance.count, len(clearance.own)
    some = [np.sort(rng.choice(count, rng.integers(count), replace=False)) for _ in range(10)]
    for pairs in (*some, some[0], np.arange(own), np.arange(own, count), np.arange(0)):
        near = clearance.near(q, pairs=pairs, sloped=np.array([0, 2]))
        np.testing.assert_allclose(near.gaps, every.gaps[:, pairs], rtol=0.0, atol=1e-15)
        np.testing.assert_allclose(near.slopes, every.slopes[::2, pairs], rtol=0.0, atol=1e-14)
        np.testing.assert_array_equal(clearance.gaps(q, pairs=pairs), near.gaps)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.9])
def test_pairs_that_a_compiled_step_leaves_out_change_nothing(share):
    """Of all with a flag, distances, slopes and planes are the same; too many are told."""
    clearance, rng = clearance_of(loaded("panda"), 2 * OBSTACLES), np.random.default_rng(11)
    q, flags = rng.uniform(-1.5, 1.5, (4, 7)), rng.uniform(size=clearance.count) < share
    pairs, counts, places, are_all = clearance.few(flags)
    sizes = zip(clearance.begins, (*clearance.begins[1:], clearance.count), strict=True)
    fit = all(
        flags[begin:end].sum() <= size
        for (begin, end), size in zip(sizes, clearance.lanes, strict=True)
    )
    assert (bool(are_all), share < 0.9) == (fit, fit)
    if not fit:
        return
    assert sorted(pairs[counts]) == np.flatnonzero(flags).tolist()
    few, X, at, every = (
        clearance.among_few(pairs),
        clearance.arm.poses.at(q),
        places[flags],
        slice(4),
    )
    gaps, slopes = few.distances_and_slopes(X, None, every)
    near = clearance.near(q)
    np.testing.assert_allclose(gaps[:, at], near.gaps[:, flags], rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(slopes[:, at], near.slopes[:, flags], rtol=0.0, atol=1e-13)
    planes = few.gaps_between(X, few.nearest(X, None), None, 0.0, 0.0)
    wanted = clearance.view(q)[1](0.0, 0.0)
    np.testing.assert_allclose(planes[:, at], wanted[:, flags], rtol=0.0, atol=1e-13)


def test_no_pair_comes_nearer_than_the_joints_way_allows(arm):
    """The certificate rests on it; over 2000 ways, up to 95 % and more of it is used."""
    clearance, rng = clearance_of(arm), np.random.default_rng(8)
    q = rng.uniform(-2.0, 2.0, (2000, arm.n))
    way = rng.normal(size=q.shape) * rng.choice([1e-3, 0.1, 1.0], (2000, 1))
    # Of one joint alone as well.
    way[::2] *= np.eye(arm.n)[rng.integers(arm.n, size=1000)]
    nearer = np.abs(clearance.gaps(q + way) - clearance.gaps(q))
    allowed = np.abs(way) @ clearance.reaches.T
    assert (nearer <= allowed + 1e-12).all()
    assert (nearer / np.maximum(allowed, 1e-12)).max() > 0.9


def test_the_least_distance_between_postures_is_found_on_the_way():
    """Beside one that is looked at at 2000 places."""
    clearance = clearance_of(load_arm("panda"))
    q = np.random.default_rng(9).uniform(-1.0, 1.0, (6, 7))
    least = clearance.least_along(q)
    s = np.linspace(0.0, 1.0, 2001)[:, None]
    looked = [clearance.gaps(a + s * (b - a)).min() for a, b in pairwise(q)]
    assert least.min() == pytest.approx(min(looked), abs=2e-6)
    assert clearance.gaps(q).min() > least.min() + 1e-3


def test_only_bodies_that_may_collide_are_pairs(arm):
    clearance = clearance_of(arm, [])
    links = clearance.arm.links
    # A ball that is welded to the last link comes to the last but one if the arm folds.
    steps = [abs(links[a] - links[b]) for a, b in clearance.own]
    beside = [pair for pair, step in zip(clearance.names, steps, strict=True) if step < 2]
    assert beside == ([("link5", "tip")] if arm.name == "planar6" else [])
    assert clearance.gaps(arm.home).min() > 0.009
    every = [(a, b) for a, b in combinations(range(len(links)), 2) if abs(links[a] - links[b]) > 1]
    out = len(every) + len(beside) - len(clearance.own)
    left_out = {"panda": 1, "fr3": 1, "iiwa14": 1, "ur5": 4, "gen3": 1, "puma560": 7, "planar6": 0}
    assert out == left_out[arm.name]
    assert isinstance(clearance, Clearance)


def test_capsules_of_an_arm_without_a_file_are_fitted_and_doubts_told(tmp_path):
    arm = load_arm("panda").replace(capsules=None)
    limits = arm.limits.replace(acceleration=5.0, jerk=100.0)
    # Once for each, where it was made.
    with pytest.warns(UnprotectedWarning) as told:
        _, (doubt,) = arm_clearance(arm, [], arm.home)
    assert [(str(each.message), each.filename) for each in told] == [(doubt, __file__)]
    with pytest.warns(UnprotectedWarning) as told:
        shield = Shield(arm, 0.01, limits=limits)
    assert shield.warnings == (doubt,)
    assert [(str(each.message), each.filename) for each in told] == [(doubt, __file__)]
    assert doubt.startswith(
        "obstacles: panda_link5 and panda_link7 are not kept apart from each oth"
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("capsules: [{body: elbow, ends: [[0,0,0],[0,0,1]], radius: 0.1}]", "no body 'elbow'"),
        ("capsules: [{body: panda_link3, ends: [[0,0,0]], radius: 0.1}]", "ends"),
        (
            "capsules: []\nleft_out: [[panda_link3, panda_lnk6]]",
            "left_out: no body 'panda_lnk6' in",
        ),
        ("capsules: []\nleft_out: [[panda_link3, pen]]", "left_out: no body 'pen' in panda.urdf; "),
        ("capsules: [{body: panda_link3, ends: [[0,0,0],[0,0,1]], radius: -1}]", "radius"),
    ],
)
def test_a_file_of_capsules_that_does_not_fit_is_refused(tmp_path, text, said):
    (tmp_path / "c.yaml").write_text(text)
    arm = load_arm("panda").replace(capsules=str(tmp_path / "c.yaml"))
    with pytest.raises(InvalidInputError, match=said):
        arm_clearance(arm, [], arm.home)


def test_obstacles_as_arrays_keep_their_order():
    solids = Solids.of(make_obstacles(OBSTACLES))
    assert solids.names == ("ball 1", "capsule 4", "box 2", "half_space 3", "cylinder 5")
    assert solids.levels.tolist() == [-0.1]


def test_pairs_that_may_touch_are_left_out_and_all_others_stay_as_they_are():
    """Of a ball, a box and a wall; the tool, of three capsules, may touch the box."""
    arm = load_arm("iiwa14", frame="tip")
    given = [
        {"kind": "half_space", "point": [0.0, 0.0, -0.4], "normal": [0.0, 0.0, 1.0]},
        {"kind": "ball", "center": [0.6, 0.5, 0.4], "radius": 0.1},
        {"kind": "box", "center": [0.5, 0.0, -0.2], "size": [0.4, 0.4, 0.1], "name": "table"},
    ]
    every, _ = arm_clearance(arm, make_obstacles(given), arm.home)
    some, _ = arm_clearance(arm, make_obstacles(given[:2]), arm.home, make_obstacles(given[2:]))
    left_out = [k for k, names in enumerate(every.names) if names == ("tool", "table")]
    assert len(left_out) == 3
    kept = np.delete(np.arange(every.count), left_out)
    assert some.names == tuple(every.names[k] for k in kept)
    q = arm.home + 0.1
    np.testing.assert_array_equal(some.gaps(q), every.gaps(q)[kept])
    near, all_near = some.near(q[None]), every.near(q[None])
    np.testing.assert_array_equal(near.slopes, all_near.slopes[:, kept])
    np.testing.assert_array_equal(some.reaches, every.reaches[kept])


def test_every_arm_is_kept_clear_without_its_tool_and_with_another(arm):
    """The PUMA's file leaves out a pair with its tool, of which no other arm had a body."""
    bare = arm.replace(tool=None) if arm.tool else arm
    clearance, doubts = arm_clearance(bare, [], arm.home)
    assert doubts == ()
    assert not {"tool", "pen"} & set(clearance.arm.bodies)
    assert clearance.gaps(arm.home).min() > 0.01
    mount = arm.tool.mount if arm.tool else arm.frame
    other = bare.replace(tool={"name": "pen", "tip": "point", "mount": mount, "length": 0.15})
    with_other, doubts = arm_clearance(other, [], arm.home)
    assert doubts == ()
    assert "pen" in with_other.arm.bodies
    assert set(clearance.names) <= set(with_other.names)
    assert with_other.gaps(arm.home).min() > 0.01


def test_a_file_whose_capsules_hold_less_than_the_model_is_told_by_how_much(tmp_path):
    """A ball of 0.05 m at the origin of link 7, of which the drawn flange goes on to 0.107 m."""
    (tmp_path / "c.yaml").write_text(
        "capsules: [{body: panda_link7, ends: [[0,0,0],[0,0,0]], radius: 0.05}]\n"
        "left_out: [[panda_link5, panda_link7]]\n"
    )
    arm = load_arm("panda", capsules=str(tmp_path / "c.yaml"))
    (part,) = (part for part in parts_of(arm) if part.body == "panda_link7")
    by = 1e3 * (np.linalg.norm(part.points, axis=1).max() - 0.05)
    _, doubts = arm_clearance(arm, [], arm.home)
    told = "obstacles: capsules of c.yaml hold less than the model's shapes: panda_link7 by "
    assert doubts == (f"{told}{by:.0f} mm",)


def test_what_a_file_states_of_a_tool_counts_only_with_the_tool(tmp_path):
    """Bodies that are neither of the arm nor of a tool are refused, with the nearest name."""
    text = (
        "capsules: [{body: pen, ends: [[0,0,0],[0,0,0.1]], radius: 0.02}]\n"
        "left_out: [[panda_link3, panda_link7], [panda_link5, pen]]\n"
    )
    (tmp_path / "c.yaml").write_text(text + "tools: [pen]")
    arm = load_arm("panda", tool=None, capsules=str(tmp_path / "c.yaml"))
    capsules, left_out = capsules_of(arm)
    assert "pen" not in [capsule.body for capsule in capsules]
    assert left_out == [("panda_link3", "panda_link7")]
    pen = {"name": "pen", "mount": "panda_link8"}
    capsules, left_out = capsules_of(load_arm("panda", tool=pen, capsules=str(tmp_path / "c.yaml")))
    assert [capsule.radius for capsule in capsules if capsule.body == "pen"] == [0.02]
    assert ("panda_link5", "pen") in left_out
    (tmp_path / "c.yaml").write_text(text)
    with pytest.raises(InvalidInputError, match="left_out: no body 'pen' in panda"):
        capsules_of(load_arm("panda", tool=None, capsules=str(tmp_path / "c.yaml")))
