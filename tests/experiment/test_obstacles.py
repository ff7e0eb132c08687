"""Obstacles of a document: what they do to a run, and what is refused."""

import numpy as np
import pytest
from pydrake.math import RollPitchYaw

from drake_rnn import InvalidInputError, load_experiment, simulate
from drake_rnn.batch import why_not
from drake_rnn.laws.parts.held_clear import Avoidance
from shared_runs import shared_run

SHORT = {"accept": None, "duration": 0.2, "window": None}
BALL = {"kind": "ball", "center": [0.5, 0.3, 0.5], "radius": 0.05}


def load(name="adaptive_nephroid_known", **changes):
    return load_experiment(name, {**SHORT, **changes})


def test_without_obstacles_distances_are_not_looked_at():
    experiment = load()
    assert (experiment.clearance, experiment.obstacles) == (None, ())
    result = simulate(experiment)
    assert "distance_min_m" not in result.metrics
    assert "distance" not in result.series


def test_with_a_list_that_is_empty_the_arm_keeps_clear_of_itself():
    experiment = load(obstacles=[])
    assert experiment.clearance is not None
    assert experiment.law.keeps_distance == Avoidance().floor
    result = simulate(experiment)
    assert result.metrics["distance_min_m"] == pytest.approx(result.series["distance"].min())


def test_a_law_that_avoids_nothing_is_measured_and_warned_of():
    experiment = load("slc_nephroid_known", obstacles=[BALL])
    assert experiment.law.keeps_distance is None
    assert "obstacles: this law does not avoid them; distances are measured alone" in (
        experiment.warnings
    )
    assert "distance_min_m" in simulate(experiment).metrics


def test_an_arm_that_goes_through_an_obstacle_is_told_of():
    """The path leads 0.1 m towards the base; the ball is there."""
    p = load().desired.position(2.0)[0]
    ball = {"kind": "ball", "center": p.tolist(), "radius": 0.03}
    result = simulate(load(obstacles=[ball], duration=3, **{"law.avoidance": "none"}))
    assert result.metrics["distance_min_m"] < 0.0
    assert any(text.startswith("obstacles: the arm collides, by up to") for text in result.warnings)


@pytest.mark.long
@pytest.mark.parametrize("name", ["adaptive_obstacles", "adaptive_obstacle_on_path"])
def test_shipped_scenes_come_to_what_they_expect_and_collide_without_avoidance(name):
    result = shared_run(name)
    for metric, accepted in result.experiment.document.accept.items():
        assert accepted.holds(result.metrics[metric]), metric
    # The certificate had hardly anything to hold back.
    assert result.series["held_back"][-1, 0] < 20.0
    blind = simulate(load_experiment(name, {"law.avoidance": "none", "accept": None}))
    assert blind.metrics["distance_min_m"] < 0.0


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"obstacles": [{"kind": "sphere", "radius": 1}]}, r"obstacles\[0\].kind: 'sphere'"),
        ({"obstacles": ["ball"]}, r"obstacles\[0\]: must be a kind with its fields, not 'ball'"),
        ({"obstacles": [{**BALL, "radius": -0.1}]}, r"obstacles\[0\].radius: must be"),
        ({"obstacles": [{**BALL, "radius": float("nan")}]}, r"obstacles\[0\].radius: must be"),
        ({"obstacles": [{**BALL, "center": [0, 0]}]}, r"obstacles\[0\].center: must have 3"),
        ({"obstacles": [{**BALL, "center": [0, 0, 1e4]}]}, r"center: must be within 100 m"),
        ({"obstacles": [{**BALL, "speed": 1}]}, r"obstacles\[0\].speed: no such key"),
        ({"obstacles": [BALL] * 300}, r"obstacles: may be up to 200, not 300"),
        ({"obstacles": [{**BALL, "name": "a"}] * 2}, r"obstacles\[1\].name: 'a' is given twice"),
        (
            {"obstacles": [{"kind": "box", "center": [1, 1, 1], "size": [1, 0, 1]}]},
            r"obstacles\[0\].size: must be three edges above 0",
        ),
        (
            {"obstacles": [{"kind": "half_space", "point": [0, 0, 0], "normal": [0, 0, 0]}]},
            r"obstacles\[0\].normal: must not be zero",
        ),
        (
            {"obstacles": [{**BALL, "center": [0.3, 0.0, 0.6]}]},
            r"law.clearance: at the start .* and ball 1 are -?\S+ m apart",
        ),
        ({"obstacles": [], "limits.jerk": 20.0}, r"limits.jerk: must be left out with obstacles"),
        (
            {
                "obstacles": [],
                "filter": {"kind": "moving_average", "above": "acceleration"},
                "law.kappa": 10.0,
            },
            "filter: must be left out with obstacles",
        ),
        (
            {"obstacles": [], "law.clearance": 1},
            "law.clearance: follows from arm and obstacles; leave it out",
        ),
        (
            {"obstacles": [], "law.avoidance": {"floor": 0.02}},
            "distance: must be greater than floor, 0.02 m, not 0.01",
        ),
    ],
)
def test_what_cannot_be_avoided_is_refused_before_a_run(changes, said):
    with pytest.raises(InvalidInputError, match=said):
        load(**changes)


def test_a_batch_says_that_it_does_not_look_at_distances():
    assert why_not(load(obstacles=[])) == (
        "obstacles: a batch does not look at distances; simulate does"
    )


def test_boxes_turn_as_drake_turns_them():
    box = {"kind": "box", "center": [1, 1, 1], "size": [0.1] * 3, "rpy": [0.3, -0.4, 1.2]}
    (found,) = load(obstacles=[box]).obstacles
    expected = RollPitchYaw([0.3, -0.4, 1.2]).ToRotationMatrix().matrix()
    assert np.allclose(found.R_WO, expected, atol=1e-15)
