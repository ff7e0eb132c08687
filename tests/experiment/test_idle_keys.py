"""Keys that do nothing beside the others are told before a run, and change no bit of it."""

from dataclasses import is_dataclass
from typing import get_args

import numpy as np
import pytest

from drake_rnn import LAWS, load_experiment, simulate
from drake_rnn.experiment import ExperimentDocument
from drake_rnn.features.obstacles import SafetySettings
from drake_rnn.inputs.keys import meanings_of
from drake_rnn.robot.arm_description import ArmDescription

SHORT = {"duration": 0.02, "window": None, "accept": None}


def sections(cls):
    """Yield a class that a document describes and those of its fields, with what is around each."""
    waiting = [(cls, ())]
    while waiting:
        found, around = waiting.pop()
        yield found, around
        for field in found.__pydantic_fields__.values():
            for part in (field.annotation, *get_args(field.annotation)):
                if is_dataclass(part) and hasattr(part, "__pydantic_fields__"):
                    waiting.append((part, (found, *around)))


DESCRIBED = [*(LAWS[kind] for kind in LAWS), ArmDescription, SafetySettings]


@pytest.mark.parametrize("cls", DESCRIBED, ids=lambda cls: cls.__name__)
def test_what_a_key_acts_with_is_a_key_of_its_section_or_one_around_it(cls):
    for section, around in sections(cls):
        told = [(name, each) for name, said in meanings_of(section).items() for each in said.only]
        for name, condition in told:
            places = [
                place
                for place in (section, *around, ExperimentDocument)
                if condition.key in place.__pydantic_fields__
                and not (place is section and condition.key == name)
            ]
            assert places, f"{section.__name__}.{name}: there is no key {condition.key}"
            known = get_args(places[0].__pydantic_fields__[condition.key].annotation)
            if condition.key != "task":
                assert {*condition.values} <= {*known}


#: What is told of a document with these changes.
TOLD = {
    "law.rho": (
        "slc_nephroid_known",
        {"law.rho": 1e-5},
        "law.jacobian: learned, which is known",
    ),
    "law.warm_up.rho": (
        "slc_nephroid_known",
        {"law.warm_up": {"rho": 1e-5}},
        "law.jacobian: learned, which is known",
    ),
    "law.turn_limit": (
        "adaptive_nephroid_known",
        {"law.turn_limit": 0.4},
        "task: pose or a list of objectives, which is xyz",
    ),
    "law.avoidance": (
        "adaptive_nephroid_known",
        {"law.avoidance": {"floor": 0.002}},
        "obstacles, which is not given",
    ),
    "law.secondary.obstacles_zone": (
        "adaptive_nephroid_known",
        {"obstacles": [], "law.secondary": {"obstacles": 0, "obstacles_zone": 0.2}},
        "law.secondary.obstacles, which is 0",
    ),
    "law.blend": (
        "zeroing_clover",
        {"law.blend": 0.2},
        "law.cost: largest_velocity, which is velocity",
    ),
    "law.growth_rate": (
        "zeroing_clover",
        {"law.growth_rate": 2},
        "law.growth: exponential, power or power_of_gain, which is none",
    ),
    "law.return_beta": (
        "galjdf_clover",
        {"law.scheme": "man", "law.return_beta": 2},
        "law.scheme: galjdf, naljdf, moaljdf or moaljdf_printed, which is man",
    ),
    "safety.avoidance": (
        "slc_nephroid_known",
        {"safety": {"avoidance": {"distance": 0.03}}},
        "safety.collisions, which is false",
    ),
    "arm.triangles": (
        "adaptive_nephroid_known",
        {"arm": {"model": "panda", "triangles": 500}},
        "arm.looks, which is not given",
    ),
}


@pytest.mark.parametrize("key", TOLD)
def test_they_are_told_before_a_run(key):
    name, changes, lacks = TOLD[key]
    told = [text for text in load_experiment(name, changes).warnings if text.startswith(key)]
    assert told == [f"{key}: does nothing here; it acts only with {lacks}"]


def test_keys_that_act_are_not():
    experiment = load_experiment("adaptive_pose", {"law.lever": 0.2, "law.turn_limit": 0.4})
    assert not any("does nothing" in text for text in experiment.warnings)


#: Keys with another value, where they do nothing, and where they act.
IDLE = {
    "law.lever": ("adaptive_nephroid_known", {"law.lever": 0.5}, "adaptive_pose", {}),
    "law.wander": ("adaptive_nephroid_known", {"law.wander": 5.0}, "adaptive_nephroid", {}),
    "law.blend": ("zeroing_clover", {"law.blend": 0.5}, "zeroing_largest", {}),
    "law.growth_rate": ("zeroing_clover", {"law.growth_rate": 9}, "zeroing_growing", {}),
    "law.return_weight": ("man_clover", {"law.return_weight": 50}, "galjdf_clover", {}),
    "law.rho": ("slc_nephroid_known", {"law.rho": 1e-2}, "slc_nephroid", {}),
    "law.position_bound": (
        "slc_nephroid_known",
        {"law.position_bound": "printed", "law.acceleration_bound": "none"},
        None,
        {},
    ),
    "law.orientation_gain": (
        "motion_force_cat",
        {"law.orientation_gain": 40.0, "law.orientation": "printed"},
        "motion_force_cat",
        {"law.orientation": "rotation"},
    ),
}


def moved(name, changes):
    return simulate(load_experiment(name, {**SHORT, **changes})).series["position"]


@pytest.mark.long
@pytest.mark.parametrize("key", IDLE)
def test_they_change_no_bit_of_a_run(key):
    name, changes, acts, more = IDLE[key]
    others = {name: value for name, value in changes.items() if name != key}
    np.testing.assert_array_equal(moved(name, changes), moved(name, others))
    if acts is not None:
        given = {key: changes[key]}
        assert not np.array_equal(moved(acts, {**more, **given}), moved(acts, more))
