"""What holds by construction of an experiment's command, and what of its arm."""

from dataclasses import replace

import pytest

from drake_rnn import load_experiment
from drake_rnn.laws import Avoidance

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
