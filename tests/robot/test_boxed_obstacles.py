"""Point clouds, height maps and meshes: all of them is in their boxes, and little else."""

import numpy as np
import pytest
import trimesh

from drake_rnn import InvalidInputError, arm_clearance, load_arm, make_experiment, make_obstacles
from drake_rnn.robot.clearance.model_obstacle import all_obstacles

RADIUS, ROOM = 0.01, np.array([0.4, -0.5, -0.3])


def written(folder, name, values):
    np.savetxt(folder / name, values, delimiter=",")
    return str(folder / name)


def boxes_of(kind, file, **fields):
    return make_obstacles([{"kind": kind, "file": file, "name": "it", **fields}])


def depth(boxes, points):
    """How deep points are in the box in which they are deepest; negative outside of all, (k,)."""
    inside = [
        (0.5 * box.size - np.abs((points - box.center) @ box.R_WO)).min(axis=1) for box in boxes
    ]
    return np.max(inside, axis=0)


def volume(boxes):
    return sum(float(box.size.prod()) for box in boxes)


def corner_of_a_room():
    """Points of two walls and a floor, 2 cm apart."""
    a, b = np.meshgrid(np.arange(0.0, 1.0, 0.02), np.arange(0.0, 1.0, 0.02))
    flat = np.stack((a.ravel(), b.ravel(), np.zeros(a.size)), axis=1)
    return np.concatenate((flat, flat[:, [2, 0, 1]], flat[:, [0, 2, 1]]))


def test_the_ball_round_each_point_is_in_a_box_and_a_room_stays_free(tmp_path):
    points = corner_of_a_room()
    file = written(tmp_path, "room.csv", points)
    boxes = boxes_of("point_cloud", file, radius=RADIUS, boxes=6)
    assert len(boxes) == 6
    assert depth(boxes, points).min() >= RADIUS
    # Two walls and a floor are 2 cm thick; where they meet a box is thicker.
    assert volume(boxes) < 1.2 * 3 * 0.02
    assert depth(boxes, np.array([[0.5, 0.5, 0.5], [0.08, 0.08, 0.08]])).max() < -0.009
    one = boxes_of("point_cloud", file, radius=RADIUS, boxes=1)
    assert volume(one) > 0.9


def test_more_boxes_take_less_space_and_contain_all_the_same(tmp_path):
    rng = np.random.default_rng(0)
    way = rng.normal(size=(5000, 3))
    points = 0.3 * way / np.linalg.norm(way, axis=1, keepdims=True) + [0.5, 0.0, 0.3]
    file = written(tmp_path, "ball.csv", points)
    volumes = []
    for count in (1, 8, 64, 200):
        boxes = boxes_of("point_cloud", file, radius=RADIUS, boxes=count, rpy=[0.1, 0.2, 0.3])
        assert len(boxes) <= count
        R = boxes[0].R_WO
        assert depth(boxes, points @ R.T).min() >= RADIUS
        volumes.append(volume(boxes))
    assert volumes == sorted(volumes, reverse=True)
    assert volumes[-1] < 0.35 * volumes[0]


def test_the_space_below_a_table_that_is_a_single_mesh_is_free(tmp_path):
    top = trimesh.creation.box((1.0, 0.6, 0.04))
    top.apply_translation([0.0, 0.0, 0.7])
    legs = []
    for x in (-0.45, 0.45):
        for y in (-0.25, 0.25):
            leg = trimesh.creation.box((0.05, 0.05, 0.68))
            leg.apply_translation([x, y, 0.34])
            legs.append(leg)
    place = np.array([0.8, 0.0, -0.4])
    table = trimesh.util.concatenate([top, *legs])
    for name in ("table.obj", "table.stl"):
        table.export(tmp_path / name)
        boxes = boxes_of("mesh", str(tmp_path / name), boxes=9, translation=place)
        samples, _ = trimesh.sample.sample_surface(table, 20_000, seed=0)
        # Files have seven digits.
        assert depth(boxes, samples + place).min() >= -1e-7
        assert volume(boxes) < 1.05 * (1.0 * 0.6 * 0.04 + 4 * 0.05**2 * 0.68)
        assert depth(boxes, np.array([[0.8, 0.0, -0.1]]))[0] < -0.1


def test_the_ground_between_its_heights_is_below_the_boxes(tmp_path):
    x, y = np.meshgrid(np.arange(30) * 0.05, np.arange(20) * 0.05)
    heights = 0.1 * np.sin(3.0 * x) * np.cos(2.0 * y) + 0.2 * (x > 0.8)
    file = written(tmp_path, "ground.csv", heights)
    boxes = boxes_of("height_map", file, spacing=0.05, boxes=60)
    rng = np.random.default_rng(0)
    at = rng.uniform(0.0, [28.999, 18.999], (5000, 2))
    i, j = at.astype(int).T
    u, v = (at - np.floor(at)).T
    ground = (1 - u) * (1 - v) * heights[j, i] + u * (1 - v) * heights[j, i + 1]
    ground += (1 - u) * v * heights[j + 1, i] + u * v * heights[j + 1, i + 1]
    points = np.column_stack((0.05 * at, ground))
    assert depth(boxes, points).min() >= -1e-9
    deep = np.column_stack((0.05 * at, np.full(5000, heights.min() - 0.099)))
    assert depth(boxes, deep).min() >= 0.0
    # What is 12 cm above the ground is mostly free.
    assert (depth(boxes, points + np.array([0.0, 0.0, 0.12])) < 0.0).mean() > 0.9


def test_an_arm_is_as_far_from_the_boxes_as_from_any_ball_or_nearer(tmp_path):
    arm, points = load_arm("ur5", tool=None), corner_of_a_room()[::97] + ROOM
    file = written(tmp_path, "room.csv", points)
    boxes = boxes_of("point_cloud", file, radius=RADIUS, boxes=24)
    balls = [{"kind": "ball", "center": p.tolist(), "radius": RADIUS} for p in points]
    q = arm.home + np.random.default_rng(0).uniform(-0.5, 0.5, (20, 6))
    near, exact = (
        (clearance := arm_clearance(arm, obstacles, arm.home)[0])
        .gaps(q)[:, len(clearance.own) :]
        .min(axis=1)
        for obstacles in (boxes, make_obstacles(balls))
    )
    assert (near <= exact + 1e-9).all()
    assert np.median(exact - near) < 0.05


def test_a_document_names_its_file_and_is_told_what_became_of_it(tmp_path):
    file = written(tmp_path, "room.csv", corner_of_a_room() + ROOM)
    section = [{"kind": "point_cloud", "file": file, "radius": RADIUS, "boxes": 6, "name": "room"}]
    obstacles, notes = all_obstacles(section)
    assert [each.name for each in obstacles] == [f"room/{k}" for k in range(1, 7)]
    litres = 1e3 * volume(obstacles)
    assert notes == [f"obstacles[0]: room.csv: in 6 boxes of {litres:.3g} l together"]
    made = make_experiment(
        {
            "arm": "panda",
            "path": {"kind": "circle", "size": 0.03, "period": 2.0},
            "law": {"kind": "adaptive"},
            "limits": {"acceleration": 2.0},
            "obstacles": section,
            "period": 1e-3,
            "duration": 0.1,
        }
    )
    assert made.guarantees.command.distance == 0.005
    assert any("room.csv: in 6 boxes" in text for text in made.warnings)


@pytest.mark.parametrize(
    "text", ["0.1,0.2,0.3\n", "z [mm],x_cm,y\n300,10,0.2\n", "# Y X Z\n0.2 0.1 0.3\n"]
)
def test_columns_of_points_have_names_and_units(tmp_path, text):
    (tmp_path / "p.csv").write_text(text)
    (box,) = boxes_of("point_cloud", str(tmp_path / "p.csv"), radius=RADIUS)
    np.testing.assert_allclose(box.center, [0.1, 0.2, 0.3], atol=1e-12)


@pytest.mark.parametrize(
    ("fields", "text", "message"),
    [
        ({"radius": RADIUS}, "0,0\n1,1\n", "it.csv: row 1: must have 3 numbers, not 2"),
        ({"radius": RADIUS}, "0,0,nan\n", "must be a finite decimal number, not 'nan'"),
        ({"radius": RADIUS}, "x,y,z\n", "it.csv: has no numbers"),
        (
            {"radius": RADIUS},
            "x,y [deg],z\n0,0,0\n",
            "column y .deg.: 'deg' is no unit of a length",
        ),
        (
            {"radius": RADIUS},
            "x,y,intensity\n0,0,9\n",
            "must have the columns x, y, z, not x, y, i",
        ),
        ({"radius": RADIUS}, "x,y,z,r\n0,0,0,9\n", "must have the columns x, y, z, not x, y, z, r"),
        ({"radius": RADIUS}, "800,0,300\n", "must be within 100 m; are these millimetres?"),
        ({}, "0,0,0\n", "radius: must be given"),
        ({"radius": 0.0}, "0,0,0\n", "radius"),
        ({"radius": RADIUS, "boxes": 0}, "0,0,0\n", "boxes"),
        ({"radius": RADIUS, "boxes": 201}, "0,0,0\n", "boxes"),
        ({"kind": "height_map", "spacing": 0.1}, "0,0,0\n", "two rows and two columns"),
        ({"kind": "mesh"}, "0,0,0\n", "it.csv: "),
    ],
)
def test_what_cannot_be_read_is_refused(fields, text, message, tmp_path):
    (tmp_path / "it.csv").write_text(text)
    section = {"kind": "point_cloud", "file": str(tmp_path / "it.csv"), **fields}
    with pytest.raises(InvalidInputError, match=message):
        make_obstacles([section])


def test_a_file_that_is_not_there_is_named(tmp_path):
    for kind, fields in (("point_cloud", {"radius": RADIUS}), ("mesh", {})):
        with pytest.raises(InvalidInputError, match=r"none\.csv: .*[nN]o such file"):
            boxes_of(kind, str(tmp_path / "none.csv"), **fields)
