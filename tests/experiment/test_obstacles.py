"""Obstacles of a document: what they do to a run, and what is refused."""

import numpy as np
import pytest
from pydrake.math import RollPitchYaw

from drake_rnn import CompiledStep, InvalidInputError, load_experiment, simulate
from drake_rnn.batch import run_many, why_not
from drake_rnn.batch.grouping import blocks
from drake_rnn.batch.run import robots_of
from drake_rnn.features.obstacles import ObstacleSource
from drake_rnn.laws.parts.safe_velocity import Avoidance
from shared_runs import shared_run

SHORT = {"accept": None, "duration": 0.2, "window": None}
BALL = {"kind": "ball", "center": [0.5, 0.3, 0.5], "radius": 0.05}
LINE = {"kind": "line", "by": [0.0, 0.2, 0.0], "period": 1.0}


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
    said = "obstacles: this law does not avoid them; distances are measured alone; with "
    assert f"{said}safety.collisions any law avoids them" in experiment.warnings
    assert "distance_min_m" in simulate(experiment).metrics


def test_an_arm_that_goes_through_an_obstacle_is_told_of():
    """The path leads 0.1 m towards the base; the ball is there."""
    p = load().desired.position(2.0)[0]
    ball = {"kind": "ball", "center": p.tolist(), "radius": 0.03}
    result = simulate(load(obstacles=[ball], duration=3, **{"law.avoidance": "none"}))
    assert result.metrics["distance_min_m"] < 0.0
    assert any(text.startswith("obstacles: the arm collides, by up to") for text in result.warnings)


def meets_what_it_expects(name, changes):
    """Return a run of a scene of which all that its document accepts holds."""
    result = shared_run(name, changes)
    for metric, accepted in result.experiment.document.accept.items():
        assert accepted.holds(result.metrics[metric]), metric
    return result


def lap(duration, begin):
    """A whole lap and what is in its way; after that a run repeats itself."""
    return {"duration": duration, "window": [begin, duration]}


#: Scenes, one lap of each, and when its arm collides if it avoids nothing [s].
SCENES = [
    ("adaptive_obstacles", lap(10.5, 2.5), 2.94),
    ("adaptive_obstacle_on_path", lap(10.0, 9.0), 5.98),
    ("adaptive_moving_obstacle", lap(10.0, 9.0), 5.14),
]
WHOLE = [
    pytest.param(name, {}, collides, marks=pytest.mark.nightly) for name, _, collides in SCENES
]


@pytest.fixture(scope="module")
def blind():
    """The run of the arm of these scenes, which knows of no obstacle."""
    short = {"duration": 6.1, "window": None, "accept": None}
    return simulate(load_experiment("adaptive_nephroid_known", short))


def collision(scene, blind):
    """Return when a run would collide in a scene, of which all but obstacles is the same [s]."""
    for key in ("arm", "path", "law", "limits", "period"):
        assert getattr(scene.document, key) == getattr(blind.experiment.document, key)
    moved = None if scene.motions is None else scene.motions.along(blind.time)
    gaps = scene.clearance.least_along(blind.series["position"], moved)
    return blind.time[np.argmax(gaps < 0.0)]


@pytest.mark.long
@pytest.mark.parametrize(("name", "changes", "collides"), [*SCENES, *WHOLE])
def test_shipped_scenes_come_to_what_they_expect_and_collide_without_avoidance(
    name, changes, collides, blind
):
    result = meets_what_it_expects(name, changes)
    # The certificate has hardly anything to hold back, but while a ball comes at the arm.
    held_back, samples = result.series["held_back"][-1, 0], result.time[-1] / 1e-3
    assert held_back < (0.05 * samples if "moving" in name else 20.0)
    assert collision(result.experiment, blind) == pytest.approx(collides, abs=0.1)


@pytest.mark.long
def test_an_obstacle_that_runs_into_an_arm_at_rest_is_told_of_as_that():
    """A ball comes at the tool at 0.3 m/s: the arm stops before it touches, and is then hit."""
    p = load().p_WE_start
    by = {"kind": "line", "by": [0.0, -0.6, 0.0], "period": 2.0}
    ball = {"kind": "ball", "center": np.add(p, [0.0, 0.45, 0.0]).tolist(), "radius": 0.08}
    result = simulate(load(obstacles=[{**ball, "speed": 0.3, "moves": by}], duration=1.8))
    metrics = result.metrics
    assert metrics["distance_min_m"] < 0.0
    assert metrics["distance_moving_min_m"] >= Avoidance().floor
    assert any("to the arm while that stands still" in text for text in result.warnings)


def test_the_law_is_told_where_an_obstacle_is_with_its_error():
    ball = {**BALL, "speed": 0.3, "moves": LINE, "error": 0.01}
    experiment = load(obstacles=[BALL, ball])
    assert experiment.law.inputs.parts["p_WO"][1] == (1, 3)
    source = ObstacleSource(experiment.motions, 1e-3)
    context = source.CreateDefaultContext()
    for t in (0.0, 0.25, 1.5):
        context.SetTime(t)
        told = source.get_output_port().Eval(context)
        true = [0.0, 0.2 * min(t, 1.0), 0.0]
        assert np.linalg.norm(told - true) == pytest.approx(0.01, abs=1e-12)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"obstacles": [{"kind": "sphere", "radius": 1}]}, r"obstacles\[0\].kind: 'sphere'"),
        ({"obstacles": ["ball"]}, r"obstacles\[0\]: must be a kind with its fields, not 'ball'"),
        ({"obstacles": [{**BALL, "radius": -0.1}]}, r"obstacles\[0\].radius: must be"),
        ({"obstacles": [{**BALL, "radius": float("nan")}]}, r"obstacles\[0\].radius: must be"),
        ({"obstacles": [{**BALL, "center": [0, 0]}]}, r"obstacles\[0\].center: must have 3"),
        ({"obstacles": [{**BALL, "center": [0, 0, 1e4]}]}, r"center: must be within 100 m"),
        ({"obstacles": [{**BALL, "center": [600, 0, 50]}]}, r"600 m away; .* millimetres\?"),
        ({"obstacles": [{**BALL, "fast": 1}]}, r"obstacles\[0\].fast: no such key"),
        ({"obstacles": [{**BALL, "moves": LINE}]}, r"speed: must be given with"),
        ({"obstacles": [{**BALL, "error": 0.01}]}, r"speed: must be given with"),
        ({"obstacles": [{**BALL, "speed": -0.1}]}, r"obstacles\[0\].speed: must be"),
        ({"obstacles": [{**BALL, "speed": 0.1, "error": float("nan")}]}, r"obstacles\[0\].error: "),
        (
            {"obstacles": [{**BALL, "speed": 0.1, "moves": LINE}]},
            r"obstacles\[0\].moves: reaches 0.2 m/s, where speed counts on at most 0.1 m/s",
        ),
        (
            {"obstacles": [{**BALL, "speed": 0.1, "moves": {"kind": "lime"}}]},
            r"obstacles\[0\].moves.kind: no path 'lime'",
        ),
        (
            {"obstacles": [{**BALL, "speed": 1, "moves": {**LINE, "frame": "tool"}}]},
            r"obstacles\[0\].moves: must be a path along the axes of the base",
        ),
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
            r"start: .* and ball 1 are -?\S+ m apart there",
        ),
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


@pytest.mark.parametrize(
    ("name", "changes", "off"),
    [
        # Near its start this law is sensitive to rounding: other starts by 1e-15 differ as much.
        ("adaptive_nephroid_known", {}, 1e-5),
        ("slc_nephroid_known", {"safety": {"collisions": True}}, 1e-12),
        pytest.param(
            *("pinv_circle", {"safety": {"collisions": True}, "limits.jerk": 50.0}, 1e-9),
            marks=pytest.mark.long,
        ),
    ],
)
def test_a_batch_runs_among_obstacles_that_rest_and_finds_the_same_distances(name, changes, off):
    given = [
        load(name, obstacles=[BALL], **changes, **{"limits.acceleration": most})
        for most in (1.0, 0.8)
    ]
    # They run side by side.
    assert len(blocks(robots_of(given))) == 1
    many = run_many(given)
    assert not np.array_equal(*many.position)
    for number, experiment in enumerate(given):
        result = simulate(experiment)
        assert many.position[number] == pytest.approx(result.series["position"][-1], abs=off)
        found = many.row(number)["distance_min_m"]
        assert found == pytest.approx(result.metrics["distance_min_m"], abs=off)


@pytest.mark.long
def test_a_batch_measures_obstacles_that_move_as_a_run_does():
    """Each robot has its own, with errors of its own; a robot that is compiled alone has none."""
    motion = {"kind": "line", "by": [0.0, -0.02, 0.0], "period": 0.2}
    balls = [{**BALL, "speed": 0.4, "error": error, "moves": motion} for error in (0.001, 0.002)]
    short = {"duration": 0.05, "window": None, "accept": None}
    given = [
        load_experiment("adaptive_obstacles", {**short, "obstacles": [ball], "seed": seed})
        for seed, ball in enumerate(balls)
    ]
    assert len(blocks(robots_of(given))) == 1
    many = run_many(given)
    for number, experiment in enumerate(given):
        result = simulate(experiment)
        assert many.position[number] == pytest.approx(result.series["position"][-1], abs=1e-7)
        for name in ("distance_min_m", "distance_moving_min_m"):
            assert many.row(number)[name] == pytest.approx(result.metrics[name], abs=1e-7)
        # What is measured is remembered in the law's state.
        places = result.series["obstacle_p"][-1].ravel()
        assert many.state[number]["obstacle_p"].ravel() == pytest.approx(places, abs=1e-12)
    pytest.importorskip("jax")
    with pytest.raises(InvalidInputError, match="none may move; a compiled step is not told"):
        CompiledStep(given[0])


def test_boxes_turn_as_drake_turns_them():
    box = {"kind": "box", "center": [1, 1, 1], "size": [0.1] * 3, "rpy": [0.3, -0.4, 1.2]}
    (found,) = load(obstacles=[box]).obstacles
    expected = RollPitchYaw([0.3, -0.4, 1.2]).ToRotationMatrix().matrix()
    assert np.allclose(found.R_WO, expected, atol=1e-15)


SAFE = {"collisions": True}


def test_safety_changes_no_bit_of_a_run_that_is_safe():
    own, safe = (
        simulate(load("slc_nephroid_known", **changes))
        for changes in ({}, {"safety": {"bounds": True}})
    )
    assert all(np.array_equal(own.series[name], safe.series[name]) for name in own.series)
    wanted = safe.series["safe_wanted"]
    assert np.array_equal(wanted, safe.series["network_velocity"])


def test_safety_keeps_what_a_law_does_not():
    """Without an acceleration of its own the pseudoinverse starts with a jump."""
    limits = {"velocity": 0.5, "acceleration": 2.0, "jerk": 100.0}
    law = {"kind": "pseudoinverse"}
    given = {"arm": "panda", "path": load().document.path, "law": law, "limits": limits}
    jumps, safe = (
        load_experiment({**given, "period": 1e-3, "duration": 0.2, **changes})
        for changes in ({}, {"safety": {}})
    )
    assert safe.guarantees.arm.limits == ("position", "velocity", "acceleration", "jerk")
    assert simulate(jumps).metrics["acceleration_violation_max_rad_s2"] > 1.0
    metrics = simulate(safe).metrics
    for name in ("acceleration_violation_max_rad_s2", "held_jerk_violation_max_rad_s3"):
        # 1e-9 of the jerk's bound: rounding of velocities, divided by the period twice.
        assert metrics[name] < 1e-7


def test_with_safety_any_law_avoids_and_the_arm_itself_if_nothing_else():
    experiment = load("slc_nephroid_known", obstacles=[BALL], safety=SAFE)
    assert experiment.guarantees.command.distance == Avoidance().floor
    assert not any("does not avoid" in text for text in experiment.warnings)
    alone = load("slc_nephroid_known", safety=SAFE)
    assert alone.clearance is not None
    assert alone.obstacles == ()
    assert why_not(alone) is None


@pytest.mark.long
@pytest.mark.parametrize("changes", [lap(10.6, 2.6), pytest.param({}, marks=pytest.mark.nightly)])
def test_the_guarded_run_comes_to_what_it_expects_and_collides_without(changes):
    result = meets_what_it_expects("slc_nephroid_guarded", changes)
    # The same run without a safety is 10 mm in the ball, with the capsules of the robot.
    blind = shared_run("slc_nephroid_known")
    assert 0.0 < collision(result.experiment, blind) < 4.3
    assert result.experiment.clearance.least_along(blind.series["position"]).min() < -0.01


@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        ("slc_nephroid_known", {"safety": {"bounds": False}}, "safety.bounds: must be true"),
        ("slc_nephroid_known", {"safety": {"floor": 1}}, "safety.floor: no such key"),
        ("slc_nephroid_known_continuous", {"safety": {}}, "safety: needs a sampled law"),
        ("naljdf_nephroid", {"safety": {}}, "safety: TwoStep varies its command between samples"),
        ("adaptive_smooth", {"safety": SAFE}, "filter: must be left out with obstacles"),
        (
            "slc_nephroid_known",
            {"safety": {**SAFE, "avoidance": {"floor": 0.5, "distance": 0.6}}},
            r"start: .* apart there, where 0.5 m are kept",
        ),
    ],
)
def test_what_safety_cannot_keep_is_refused(name, changes, said):
    with pytest.raises(InvalidInputError, match=said):
        load(name, **changes)


def pressing(**changes):
    given = {"obstacles": [], **SHORT, **changes}
    return load_experiment("adaptive_contact_circle", given)


def test_what_is_pressed_on_is_in_the_way_of_all_bodies_but_the_tool():
    """The flange's last body ends 0.1 m above the ball's centre, which is 12 mm above the plate."""
    clearance = pressing().clearance
    bodies = [one for one, other in clearance.names if other == "environment"]
    assert bodies == [f"iiwa_link_{k}" for k in range(1, 8)]
    gaps = dict(zip(clearance.names, clearance.gaps(pressing().start), strict=True))
    # The capsule of link 7 reaches farther than its body does, by 17 mm.
    assert gaps["iiwa_link_7", "environment"] == pytest.approx(0.112 - 0.017, abs=1e-3)
    assert ("tool", "wall") in pressing(obstacles=[{**BALL, "name": "wall"}]).clearance.names


def test_an_arm_that_starts_with_another_body_at_what_it_presses_on_is_refused():
    """A plate as thick as the arm is high has its first bodies inside, were it wide enough."""
    plate = {"kind": "plate", "size": 2.0}
    with pytest.raises(InvalidInputError, match="start: iiwa_link_1 and environment are -"):
        pressing(environment=plate)


def test_a_spring_has_no_extent_and_is_not_looked_at():
    changes = {"level": "kinematic", "environment": {"kind": "elastic_surface", "stiffness": 8e3}}
    experiment = pressing(**changes, feedback=None)
    assert all(other != "environment" for _, other in experiment.clearance.names)
    assert any("a spring without extent" in text for text in experiment.warnings)


def test_the_name_of_what_is_pressed_on_is_no_obstacles():
    with pytest.raises(InvalidInputError, match="'environment' is the name of what the tool"):
        pressing(obstacles=[{**BALL, "name": "environment"}])


def test_of_two_arms_none_presses():
    with pytest.raises(InvalidInputError, match="environment: must be left out with second"):
        pressing(second={"base": {"translation": [1.5, 0, 0]}})
