"""The parts of the peers' bench among obstacles that need no peer: scenes, shapes, the judge."""

from copy import copy
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

import peers_among_obstacles
from drake_rnn import InvalidInputError
from drake_rnn.robot.clearance.capsules import Solids
from drake_rnn.robot.clearance.obstacles import make_obstacles
from peer_schemes.obstacle_figures import judged, reversals, together
from peer_schemes.obstacle_scheme import ObstacleScheme, gap_difference, settings_of
from peer_schemes.obstacle_tasks import (
    BALLS,
    ITSELF,
    ObstacleTask,
    far_balls,
    into_itself,
    into_walls,
    ten_balls,
)
from peer_schemes.scheme import Motion
from peer_schemes.shapes import Shapes

H = 1e-3


@pytest.fixture(scope="module")
def walls():
    return into_walls()


@pytest.fixture(scope="module")
def balls():
    return ten_balls(0)


class Blind(ObstacleScheme):
    """Sees distances that are all a millimetre too large."""

    name, setting = "blind", "sees badly"
    chosen: ClassVar = {"gain": 1.0}
    grid: ClassVar = {"gain": (1.0, 2.0), "margin": (0.01, 0.02)}

    def pose(self, q):
        return np.zeros(3), np.eye(3)

    def velocity(self, k, q, v):
        return v

    def gaps(self, q):
        return self.task.clearance.gaps(q) + 1e-3


# Scenes.


def test_every_scene_is_clear_at_the_start_and_leads_the_tool_into_what_is_in_the_way(walls, balls):
    far, itself = far_balls(), into_itself()
    own = len(itself.clearance.own)
    for task in (walls, balls, far, itself):
        assert task.clearance.gaps(task.start).min() > 0.01
    assert far.clearance.gaps(far.start)[own:].min() > 0.3
    assert len(balls.obstacles) == len(far.obstacles) == 10
    # The tool is led 0.1 m aside and 0.2 m down, through walls that are nearer.
    way = walls.p_WE - walls.p_WE[0]
    assert way[:, 1].max() == pytest.approx(0.1, abs=1e-4)
    assert way[:, 2].min() == pytest.approx(-0.2, abs=1e-4)
    tops = [o.center[2] + 0.5 * o.size[2] for o in walls.obstacles if o.name == "table"]
    assert walls.p_WE[:, 2].min() < tops[0]
    # And into the capsules of the arm's own base.
    column = itself.clearance.arm
    base = list(column.bodies).index("panda_link1")
    apart = np.linalg.norm(itself.p_WE[:, None, :2] - column.ends[base][None, :, :2], axis=-1)
    assert apart.min() < column.radii[base]


# What other libraries see.


def test_other_libraries_are_given_the_capsules_and_pairs_that_the_judge_has(walls, balls):
    pinocchio = pytest.importorskip("pinocchio")
    for task in (walls, balls):
        shapes = Shapes(task)
        model = pinocchio.buildModelFromXML(shapes.urdf)
        kind = pinocchio.GeometryType.COLLISION
        geometry = pinocchio.buildGeomFromUrdfString(model, shapes.urdf, kind)
        for pair in shapes.pairs:
            ids = (geometry.getGeometryId(f"{name}_0") for name in pair)
            geometry.addCollisionPair(pinocchio.CollisionPair(*ids))
        data, found = model.createData(), geometry.createData()
        assert len(shapes.pairs) == task.clearance.count
        for q in np.random.default_rng(0).uniform(-1.0, 1.0, (5, 7)) + task.start:
            pinocchio.computeDistances(model, data, geometry, found, q)
            seen = np.array([result.min_distance for result in found.distanceResults])
            ours = task.clearance.gaps(q)
            apart = ours > 0.0
            assert apart.any()
            assert seen[apart] == pytest.approx(ours[apart], abs=1e-9)


@pytest.mark.parametrize("scene", ["walls", "balls"])
@pytest.mark.long
def test_distances_in_jax_are_those_of_the_judge(scene, request):
    pytest.importorskip("jax")
    from peer_schemes.jax_distances import Things, gaps_of

    task = request.getfixturevalue(scene)
    gaps, things = gaps_of(task.clearance), Things.of(task.clearance.solids)
    for q in np.random.default_rng(0).uniform(-0.5, 0.5, (2, 7)) + task.start:
        ours = task.clearance.gaps(q)
        # JAX has single precision unless told otherwise.
        assert np.asarray(gaps(q, things)) == pytest.approx(ours, abs=1e-5)


def test_obstacles_that_other_libraries_are_not_given_are_refused(balls):
    post = {"kind": "capsule", "ends": [[1.0, 0.0, 0.0], [1.0, 0.0, 1.0]], "radius": 0.05}
    changes = {"accept": None, "obstacles": [{**post, "name": "post"}]}
    with pytest.raises(InvalidInputError, match="post: must be a ball or a box"):
        _ = Shapes(ObstacleTask("post", changes, lap=8.0)).obstacles


def test_distances_that_a_library_sees_otherwise_are_found(balls):
    assert gap_difference(Blind(balls), Shapes(balls)) == pytest.approx(1e-3)


def test_a_grid_is_tried_in_every_combination_and_settings_are_told():
    tried = [scheme.chosen for scheme in settings_of(Blind)]
    assert len(tried) == 4
    assert {"gain": 2.0, "margin": 0.01} in tried
    assert Blind.told() == "sees badly, gain 1"


# The judge.


def test_a_collision_between_two_samples_counts(walls):
    """One step of the first joint, with a ball half way; both of its ends are clear of it."""
    swing = np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    q = np.stack((walls.start - swing, walls.start + swing))
    center = walls.arm.kinematics().p_WE(walls.start).tolist()
    ball = make_obstacles([{"kind": "ball", "center": center, "radius": 0.02}])
    task = copy(walls)
    task.clearance, task.window = replace(walls.clearance, solids=Solids.of(ball)), slice(0, 2)
    assert task.clearance.gaps(q).min() > 0.0
    found = judged(Motion(q, np.zeros((1, 7))), task)
    assert (found.collided, found.scenes) == (1, 1)
    assert found.least < -0.01


def test_reversals_of_an_acceleration_are_counted_beyond_what_is_hardly_one():
    swinging = np.array([1.0, -1.0, 1.0, -1.0, 0.005, -0.005, 1.0])
    still = np.array([0.5, 0.5, 0.002, -0.002, 0.5, 0.0, 0.5])
    assert reversals(np.stack((swinging, still), axis=1)) == pytest.approx(0.5 * 4)


def test_scenes_together_have_their_sums_and_their_worst(balls):
    task, q = copy(balls), np.tile(balls.start, (3, 1))
    task.window = slice(0, 3)
    still = judged(Motion(q, np.zeros((2, 7)), failures=1), task)
    moved = judged(Motion(q, np.full((2, 7), 2.0 * H), failures=1), task)
    assert still.acceleration == 0.0
    assert moved.acceleration == pytest.approx(2.0)
    both = together([still, moved])
    assert (both.scenes, both.failures, both.collided, both.back) == (2, 2, 0, 0)
    assert both.acceleration == moved.acceleration
    assert both.least == still.least


# Who is compared.


def test_a_library_that_is_not_installed_is_named_and_left_out(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(peers_among_obstacles, "PEERS", {"nobody": "no_such_package.scheme"})
    monkeypatch.setattr(peers_among_obstacles, "our_entries", lambda tasks: [])
    found = list(peers_among_obstacles.entries(ITSELF, 1, [], None, tmp_path))
    peers_among_obstacles.print_table(BALLS, found)
    assert "| nobody | not installed: no_such_package |" in capsys.readouterr().out
    # Rows that are kept are not measured again; what was not installed is not kept.
    assert [file.name for file in tmp_path.iterdir()] == ["itself-1-ours.pickle"]
