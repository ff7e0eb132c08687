"""The table of pairs: every pair of features runs, or is refused with a sentence of the table."""

import itertools
import string
from dataclasses import replace
from typing import get_args

import pytest

from drake_rnn import Adaptive, InvalidInputError, SensingSettings, load_arm, load_experiment
from drake_rnn.experiment import ExperimentDocument
from drake_rnn.experiment.components import Arms
from drake_rnn.features import FEATURES as FEATURES_OF_ALL
from drake_rnn.features.pairs import ANY, PAIRS, TRAITS, Combination, Host, Pair, refusal
from drake_rnn.inputs.keys import LISTED
from drake_rnn.inputs.messages import field_names
from drake_rnn.laws import Law
from drake_rnn.runs.simulation import build_diagram
from drake_rnn.systems import BODIES
from row_helpers import each

ARMS = Arms()
CAMERA = load_experiment("adaptive_camera").document.contents()["camera"]
FEATURES = {
    "camera": {"camera": CAMERA},
    "faults": {"faults": [{"joint": 2, "time": 0.5}]},
    "dither": {"dither": {"sigma": 1e-3, "hold": 2e-3}},
    "disturbance": {"disturbance": {"kind": "constant", "size": 1e-3}},
    "filter": {"filter": {"kind": "moving_average"}, "feedback": "unfiltered"},
    "sensing": {"sensing": {"position_noise": 1e-5}},
    "environment": {
        "environment": {"kind": "elastic_surface", "stiffness": 1000.0},
        "force": {"value": 5.0},
    },
    "moves": {
        "environment": {
            "kind": "elastic_surface",
            "stiffness": 1000.0,
            "moves": {"kind": "line", "by": [0.0, 0.0, 0.01], "period": 2.0},
        },
        "force": {"value": 5.0},
    },
    "admittance": {
        "environment": {"kind": "elastic_surface", "stiffness": 1000.0},
        "force": {"kind": "admittance", "value": 5.0},
    },
    "obstacles": {"obstacles": []},
    "safety": {"safety": {"collisions": True}},
    "second": {"obstacles": [], "second": {"base": {"translation": [0.0, 1.5, 0.0]}}},
    "sensor": {
        "environment": {"kind": "elastic_surface", "stiffness": 1000.0},
        "force": {"value": 5.0},
        "sensor": {"noise": 0.1},
    },
    "integrator": {"integrator": {"step": 2e-3}, "period": None},
    "task": {"task": [{"kind": "position"}, {"kind": "axis"}]},
}
#: Pairs that are refused, and the key that the refusal begins with; all others run.
REFUSED = {
    ("camera", "filter"): "filter",
    ("camera", "environment"): "environment",
    ("camera", "second"): "second",
    ("faults", "filter"): "feedback",
    ("faults", "obstacles"): "obstacles",
    ("faults", "safety"): "obstacles",
    ("faults", "second"): "second",
    ("faults", "integrator"): "faults",
    ("dither", "disturbance"): "disturbance",
    ("dither", "safety"): "dither.model",
    ("disturbance", "obstacles"): "disturbance",
    ("disturbance", "safety"): "disturbance",
    ("disturbance", "second"): "disturbance",
    ("filter", "sensing"): "sensing",
    ("filter", "obstacles"): "filter",
    ("filter", "safety"): "filter",
    ("filter", "second"): "filter",
    ("filter", "integrator"): "filter",
    ("sensing", "integrator"): "sensing",
    ("environment", "second"): "environment",
    ("camera", "dither"): "dither",
    ("camera", "sensor"): "environment",
    ("camera", "integrator"): "camera",
    ("dither", "second"): "second",
    ("second", "sensor"): "environment",
    ("sensor", "integrator"): "sensor",
    ("safety", "second"): "safety",
    ("safety", "integrator"): "safety",
    ("second", "integrator"): "second",
    ("camera", "task"): "task",
    ("environment", "task"): "environment",
    ("sensor", "task"): "environment",
    ("camera", "moves"): "environment",
    ("camera", "admittance"): "environment",
    ("filter", "admittance"): "filter",
    ("moves", "obstacles"): "environment.moves",
    ("moves", "safety"): "environment.moves",
    ("moves", "second"): "environment",
    ("moves", "task"): "environment",
    ("admittance", "second"): "environment",
    ("admittance", "integrator"): "force.kind",
    ("admittance", "task"): "environment",
}


ADAPTIVE = {"kind": "adaptive", "jacobian": "learned"}
WORDS = {**ANY, "feedback": "unfiltered"}


def law_for(names):
    """A law that can do what some features need, if there is one."""
    if "sensor" in names and "camera" not in names:
        if {"dither", "integrator"} & names:
            learned = {"jacobian": "learned"} if "dither" in names else {}
            return {"kind": "motion_force", "stiffness": 1000.0, **learned}
        return {**ADAPTIVE, "force_control": {"stiffness": 1000.0}}
    if {"dither", "integrator"} & names and "camera" not in names:
        return {"kind": "simultaneous_learning"}
    return ADAPTIVE


def document(*names):
    contents = {"arm": "panda", "law": law_for({*names}), "period": 2e-3, "duration": 1.0}
    contents["path"] = {"kind": "circle", "plane": "xy", "size": 0.02, "period": 4.0}
    for name in names:
        contents |= FEATURES[name]
    return {key: value for key, value in contents.items() if value is not None}


@each(("one", "other"), [*itertools.combinations(FEATURES, 2)])
def test_every_pair_of_features_is_built_or_refused_by_the_table(one, other):
    try:
        build_diagram(load_experiment(document(one, other), arms=ARMS))
    except InvalidInputError as error:
        refused = str(error)
    else:
        refused = ""
    assert refused.split(":")[0] == REFUSED.get((one, other), ""), refused
    of_a_list = {**WORDS, "task": LISTED}
    sentences = {pair.sentence(words) for pair in PAIRS for words in (WORDS, of_a_list)}
    assert not refused or refused in sentences


def test_the_table_names_traits_and_keys_that_exist_and_none_that_nothing_uses():
    named = {name for pair in PAIRS for name in (pair.one, pair.other)}
    assert named - {each.key for each in FEATURES_OF_ALL if each.section is not None} == {*TRAITS}
    for pair in PAIRS:
        assert pair.key.split(".")[0] in field_names(ExperimentDocument)
        assert {name for _, name, *_ in string.Formatter().parse(pair.text)} - {None} <= {*ANY}
    assert len({pair.sentence() + pair.one + pair.other for pair in PAIRS}) == len(PAIRS)


def test_a_level_is_one_alone_and_the_table_says_what_it_needs():
    """Loops with and without a period, sensors and settings of motors, at each level."""

    def said(level, **given):
        return refusal(Combination(**{"level": BODIES[level], "period": 1e-3, **given})) or ""

    levels = [name for name in TRAITS if name.startswith("level: ")]
    for name, body in BODIES.items():
        found = [each for each in levels if TRAITS[each].has(Combination(level=body))]
        assert {f"level: {each}" for each in BODIES} & {*found} <= {f"level: {name}"}
        sampled = said(name, period=None)
        assert sampled == (
            ""
            if name == "kinematic"
            else f"period: must be given at level: {name}, instead of an integrator"
        )
        assert said(name, plant=True).startswith("plant: only at level: dynamic or torque") is (
            name not in ("dynamic", "torque")
        )
        measured = said(name, feedback="measured")
        assert measured.startswith("feedback: measured needs level: dynamic") is (
            name == "kinematic"
        )
    assert not said("kinematic", feedback="measured", sensing=SensingSettings(encoder_bits=20))


def test_an_example_of_a_row_lacks_what_the_row_needs():
    """So that the page does not say: only at level: torque, not torque."""
    row = Pair("dither", "level: torque", "dither", "only at level: torque, not {level}", True)
    assert row.sentence() == "dither: only at level: torque, not kinematic"
    assert not row.applies(Combination(dither=object(), level=BODIES["torque"]))
    for level in ("kinematic", "robot"):
        assert row.applies(Combination(dither=object(), level=BODIES[level]))


def test_a_feature_goes_to_every_host_that_no_row_keeps_it_from():
    able = Combination(period=1e-3, dither=None)
    for host in get_args(Host):
        assert refusal(replace(able, host=host, robot="fr3")) is None
    locked = replace(able, faults=[1])
    assert {host for host in get_args(Host) if refusal(replace(locked, host=host))} == {
        *("compiled law", "law in C", "batch", "live", "switch", "drive", "paced drive")
    }
    two = replace(able, second=True, obstacles=True)
    assert refusal(replace(two, host="compiled law")) is None
    assert refusal(replace(two, host="law in C")) == (
        "second: must be left out; a law in C moves one arm"
    )


@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        # The cause is said first, and not the gain that the filter's delay would allow.
        ("adaptive_camera", {"filter": {}, "limits.jerk": 500}, "filter: must be left out with a"),
        ("adaptive_camera", {"filter": {}, "duration": 0.2}, "filter: must be left out with a"),
        (
            "adaptive_nephroid",
            {"dither": {"sigma": 1e-3, "hold": 1e-3}},
            "dither: must be left out; this law learns from positions, and does not use the "
            "velocity that dither excites",
        ),
        (
            "adaptive_jerk",
            {"dither": {"sigma": 1e-3, "hold": 1e-3}},
            "dither: must be left out; this law does not learn, so there is nothing to excite",
        ),
        (
            "adaptive_two_arms",
            {"safety": {"collisions": True}},
            "safety: must be left out with second; the laws of two arms keep bounds and",
        ),
    ],
)
def test_the_first_refusal_names_the_cause(name, changes, said):
    with pytest.raises(InvalidInputError) as caught:
        load_experiment(name, changes)
    assert str(caught.value).startswith(said)


@pytest.mark.parametrize(
    "name",
    [
        *("adaptive_camera", "adaptive_nephroid", "adaptive_jerk", "contact_cat_learned"),
        *("pinv_line", "slc_nephroid", "naljdf_clover", "contact_inclined"),
        "null_space_adjustment",
    ],
)
def test_what_a_law_says_that_it_can_do_is_what_it_is_given(name):
    law = load_experiment(name, arms=ARMS).law
    capabilities = [each for each, kind in vars(Law).items() if isinstance(kind, property)]
    said = [each for each in capabilities if each.startswith(("sees_", "learns_", "follows_"))]
    for trait in (*said, "presses", "measures_force"):
        assert vars(Law)[trait].fget(law) is getattr(law, trait), trait


def test_an_adaptive_law_without_a_camera_sees_no_pixels():
    arm = load_arm("panda")
    assert Adaptive.can_see_pixels()
    assert not Adaptive(limits=arm.limits, home=arm.home).sees_pixels
