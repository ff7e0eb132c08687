"""What holds by construction of an experiment's command, and what of its arm."""

import json
from dataclasses import replace

import pytest

from drake_rnn import load_experiment, simulate
from drake_rnn.experiment import COUNTED_LIMITS, expected_bounds
from drake_rnn.laws import Avoidance
from drake_rnn.laws.guarantee import Promise, promise_lines
from drake_rnn.runs.limit_use import conclusion_of

ALL = ("position", "velocity", "acceleration", "jerk")
FIRST = ALL[:3]
LOCK = {"joint": "panda_joint2", "time": 0.5}
CHAIN = {"accept": None, "duration": 60.0, "filter": {"kind": "moving_average"}}
UP_TO_CRACKLE = ("velocity", "acceleration", "jerk", "snap", "crackle")


def guarantees(name, **changes):
    changes = {key.replace("__", "."): value for key, value in changes.items()}
    return load_experiment(name, changes).guarantees


@pytest.mark.parametrize(
    ("name", "changes", "command", "arm"),
    [
        # An ideal arm keeps what its command keeps, and a law that declares nothing keeps nothing.
        ("adaptive_jerk", {}, ALL, ALL),
        ("slc_nephroid_known", {}, FIRST, FIRST),
        ("pinv_circle", {}, (), ()),
        ("adaptive_fr3", {}, (*ALL, "envelope"), (*ALL, "envelope")),
        # Motors follow with errors, and what is added to the command is not the law's.
        ("adaptive_jerk", {"level": "dynamic"}, ALL, ()),
        ("slc_nephroid", {}, FIRST, ()),
        ("slc_nephroid", {"dither__model": "virtual"}, FIRST, FIRST),
        ("adaptive_jerk", {"disturbance": {"kind": "constant", "size": 1e-3}}, ALL, ()),
        # A wrong position brings a joint over its limit; a velocity is bounded all the same.
        ("adaptive_jerk", {"sensing": {"position_noise": 1e-4}}, ALL, ALL[1:]),
        ("adaptive_fr3", {"sensing": {"position_noise": 1e-4}}, (*ALL, "envelope"), ALL[1:]),
        # A mean of positions is within their range, and its derivatives within the filter's bounds.
        ("chain_circle", CHAIN, (), UP_TO_CRACKLE),
        (
            "chain_circle",
            {**CHAIN, "law": {"kind": "recursive", "gains": [100.0]}},
            ("position", "velocity"),
            ("position", *UP_TO_CRACKLE),
        ),
        # A brake within its bounds keeps them; from one sample to the next it keeps the velocity.
        ("adaptive_jerk", {"faults": [LOCK]}, ALL, ALL),
        ("adaptive_jerk", {"faults": [{**LOCK, "stop": "at_once"}]}, ALL, ("position", "velocity")),
        # Safety keeps all limits of any sampled law, but no higher ones than it knows.
        ("slc_nephroid_known", {"safety": {}, "limits__jerk": 500.0}, ALL, ALL),
    ],
)
def test_limits_hold_of_the_command_and_as_far_as_the_arm_follows_it_of_the_arm(
    name, changes, command, arm
):
    found = guarantees(name, **changes)
    assert set(found.command.limits) == set(command)
    assert set(found.arm.limits) == set(arm)
    assert set(found.command_only) == set(command) - set(arm)


def test_a_distance_holds_of_an_ideal_arm_and_with_motors_or_sensors_of_its_command():
    """The floor of the avoidance; without obstacles there is none."""
    floor = Avoidance().floor
    ideal = guarantees("adaptive_obstacles")
    assert ideal.command.distance == ideal.arm.distance == floor
    for change in ({"level": "dynamic"}, {"sensing": {"position_noise": 1e-5}}):
        real = guarantees("adaptive_obstacles", **change)
        assert (real.command.distance, real.arm.distance) == (floor, None)
    assert guarantees("adaptive_jerk").command.distance is None


def test_of_law_and_safety_the_larger_distance_holds():
    wide = {"collisions": True, "avoidance": {"floor": 0.008}}
    assert guarantees("adaptive_obstacles", safety=wide).command.distance == 0.008


def test_torques_that_alone_act_are_kept_and_those_of_motors_are_not():
    """A quarter of what the joints may; a law of velocities keeps none."""
    found, effort = guarantees("dual_criteria_torque"), load_experiment("dual_criteria_torque").arm
    assert found.arm.torque == found.command.torque == tuple(0.25 * effort.effort)
    # Whatever the law sees of its joints, what it commands is clipped.
    noisy = guarantees("dual_criteria_torque", sensing={"position_noise": 1e-5})
    assert noisy.arm.torque == found.arm.torque
    for level in ("kinematic", "dynamic"):
        assert guarantees("adaptive_jerk", level=level).command.torque is None


def test_an_arm_with_less_torque_than_its_law_was_told_keeps_none():
    """A fifth less of one joint; unless the law uses no more than that of what it was told."""
    made = load_experiment("computed_torque")
    told = made.arm.effort * [1.0, 1.0, 1.25, 1.0, 1.0, 1.0, 1.0]
    found = replace(made, law=replace(made.law, torque_limits=told)).guarantees
    assert (found.command.torque, found.arm.torque) == (tuple(told), None)
    less = replace(made.law, torque_limits=told, torque_share=0.8)
    assert replace(made, law=less).guarantees.arm.torque == tuple(0.8 * told)
    no_limits = replace(made.law, torque_limits=None)
    assert replace(made, law=no_limits).guarantees.command.torque is None


def test_each_of_two_arms_has_guarantees_of_its_own():
    first = load_experiment("adaptive_two_arms")
    assert first.guarantees.arm.distance == first.second.guarantees.arm.distance > 0.0
    assert first.second.guarantees.command.limits == first.second.law.keeps


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("keeps", lambda found: found.command.limits),
        ("keeps_distance", lambda found: found.command.distance),
        ("kept_limits", lambda found: found.arm.limits),
        ("commanded_limits", lambda found: found.command_only),
    ],
)
def test_the_old_names_say_the_same_and_where_to_read_it(old, new):
    experiment = load_experiment("adaptive_jerk", {"level": "dynamic"})
    with pytest.warns(DeprecationWarning, match=rf"Experiment\.{old} is deprecated; read"):
        assert getattr(experiment, old) == new(experiment.guarantees)


def test_each_promise_says_what_it_rests_on_and_whether_that_holds():
    """An ideal arm in a simulation does all that is assumed; of motors nothing is promised."""
    found = {each.name: each for each in guarantees("adaptive_obstacles").promises}
    assert set(found) == {*ALL, "distance"}
    for name, each in found.items():
        assert each.of == "arm"
        assert {"lateness of a sample", "velocity at the start"} <= {
            one.what for one in each.assumptions
        }, name
        assert all(one.holds in (True, None) for one in each.assumptions)
    (known,) = (e for e in found["distance"].assumptions if e.what.startswith("error of the kin"))
    assert (known.most, known.unit, known.holds) == (0.0, "m", True)
    assert found["distance"].bound == Avoidance().floor
    (line, other) = promise_lines(found.values())
    assert line.startswith("position, velocity, acceleration, jerk: promised of the arm; rests")
    assert other.startswith("distance ≥ 0.005 m: promised of the arm; rests on no error of the kin")
    for each in guarantees("adaptive_obstacles", level="dynamic").promises:
        assert each.of == "command"
        assert "deviation of the arm from its command" not in {one.what for one in each.assumptions}


def test_obstacles_that_move_are_assumed_to_be_as_fast_and_as_well_measured_as_is_stated():
    (found,) = (e for e in guarantees("adaptive_moving_obstacle").promises if e.name == "distance")
    most = {each.what: (each.most, each.unit, each.holds) for each in found.assumptions}
    (solid,) = load_experiment("adaptive_moving_obstacle").obstacles
    assert most["speed of an obstacle"] == (solid.speed, "m/s", True)
    assert most["error of an obstacle's place"] == (solid.error, "m", True)


@pytest.mark.parametrize(
    "changes",
    [
        {"law.jacobian": "learned"},
        {"arm": {"model": "panda", "link_errors": {}}},
    ],
)
def test_distances_that_are_kept_with_other_kinematics_than_the_law_s_are_told(changes):
    """Of learned ones and of links that differ from the model's."""
    experiment = load_experiment("adaptive_obstacles", changes)
    assert experiment.guarantees.arm.distance == Avoidance().floor
    (told,) = (text for text in experiment.warnings if text.startswith("obstacles: "))
    assert told.endswith("of a robot this is promised only if they are known")


def test_a_document_cannot_ask_for_less_than_is_promised():
    wanted = {"limit_ratio_1_max": {"at_least": 0.1, "at_most": 2.0}}
    wanted |= {"distance_min_m": {"at_least": 0.0}, "position_error_max_m": {"at_most": 1.0}}
    bounds = expected_bounds(load_experiment("adaptive_obstacles", {"accept": wanted}))
    assert bounds["limit_ratio_1_max"].at_least == 0.1
    assert bounds["limit_ratio_1_max"].at_most == pytest.approx(1.0, abs=1e-8)
    assert bounds["distance_min_m"].at_least == pytest.approx(Avoidance().floor, abs=1e-8)
    assert bounds["position_error_max_m"].at_most == 1.0


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("adaptive_obstacles", {"duration": 0.3}),
        ("adaptive_jerk", {"duration": 0.3}),
        ("adaptive_impedance", {"duration": 2.0}),
        ("dual_criteria_torque", {"duration": 0.2}),
    ],
)
def test_what_is_kept_is_within_its_bound_and_what_is_beyond_is_not_called_kept(name, changes):
    """Of any promise, with what a run measured, and with each metric just beyond its bound."""
    experiment = load_experiment(name, {**changes, "window": None, "accept": None})
    result = simulate(experiment)
    assert result.promises
    for each in result.promises:
        assert each.met is True, each
        assert each.excess == 0.0
        limit = COUNTED_LIMITS[each.name]
        metric, bound = limit.metric_of(experiment), limit.bound_of(experiment)
        assert bound.holds(result.metrics[metric])
        beyond = 1.01 * bound.at_most if bound.at_least is None else bound.at_least - 1e-4
        bad = replace(result, metrics={**result.metrics, metric: beyond})
        assert each.name in conclusion_of(bad).broken
        assert not bad.keeps_bounds
        (after,) = (one for one in bad.promises if one.name == each.name)
        assert after.met is False
        written = json.loads(json.dumps(after.contents))
        assert promise_lines([Promise.from_contents(written)]) == promise_lines([after])


def test_a_jerk_that_only_held_velocities_show_is_no_limit_that_is_kept():
    """Differences over 10 ms miss an acceleration that begins within a sample."""
    path = {"kind": "circle", "size": 0.05, "period": 4, "timing": "sin2"}
    changes = {"path": path, "limits": {"velocity": 1.0, "jerk": 20.0}, "duration": 0.2}
    experiment = load_experiment("pinv_circle", {**changes, "accept": None, "window": None})
    result = simulate(experiment)
    assert result.metrics["limit_ratio_3_max"] < 1.0
    assert result.metrics["held_jerk_violation_max_rad_s3"] > 1.0
    assert conclusion_of(result).limits == "limits broken: held jerk"
