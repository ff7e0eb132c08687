"""What a page may send, and what comes of anything else."""

import json
import math
import random

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_experiment
from drake_rnn.live.controls import Button, Choice, Handle, Slider, Switch, read_message
from drake_rnn.live.session import Session
from live_stranger import Watched, random_setting

CONTROLS = {
    "gain": Slider("gain", 0.1, 10.0, 1.0),
    "on": Switch("on", False),
    "law": Choice("law", ("one", "two"), "one"),
    "press": Button("press"),
    "point": Handle("point", (0.0, 0.0, 0.0), 1.0, "/place"),
}


@pytest.mark.parametrize(
    ("name", "value", "read"),
    [
        ("gain", 2, 2.0),
        ("gain", -1e300, 0.1),
        ("gain", 1e300, 10.0),
        ("on", True, True),
        ("law", "two", "two"),
        ("press", None, None),
        ("point", [0.1, 0.2, 0.3], [0.1, 0.2, 0.3]),
        ("point", [0.0, 3.0, 4.0], [0.0, 0.6, 0.8]),
        ("point", [1e308, 0.0, 0.0], [1.0, 0.0, 0.0]),
    ],
)
def test_what_is_sent_is_brought_within_its_ends(name, value, read):
    found = read_message(CONTROLS, name, value)
    assert found == pytest.approx(read) if isinstance(read, (float, list)) else found is read


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("gain", math.nan),
        ("gain", math.inf),
        ("gain", True),
        ("gain", "2"),
        ("gain", 10**400),
        ("on", 1),
        ("law", "three"),
        ("law", ["one"]),
        ("press", 0),
        ("point", [0.0, 1.0]),
        ("point", [0.0, 1.0, math.nan]),
        ("point", {"x": 1}),
        ("other", 1.0),
        ("__class__", 1.0),
        (None, None),
        (["gain"], 1.0),
    ],
)
def test_anything_else_is_refused(name, value):
    with pytest.raises(InvalidInputError):
        read_message(CONTROLS, name, value)


_GAINS = {
    "adaptive_jerk": {"kappa", "braking", "feedback_limit"},
    "adaptive_pose": {
        *("kappa", "braking", "feedback_limit"),
        *("turn_braking", "turn_limit", "lever"),
    },
    "slc_nephroid_known": {
        *("kappa", "rate", "return_gain", "limit_stiffness", "multiplier_limit"),
    },
}


@pytest.mark.parametrize("name", [*_GAINS])
def test_a_slider_is_offered_for_each_gain_that_does_something(name):
    experiment = load_experiment(name)
    session = Session(experiment)
    sliders = {k: each for k, each in session.controls().items() if k.startswith("law.")}
    assert {name.removeprefix("law.") for name in sliders} == _GAINS[name]
    # A document that gives what a slider sets is neither warned of it nor refused.
    gains = {name: each.value for name, each in sliders.items()}
    given = load_experiment({**experiment.document.contents()}, gains)
    assert not [each for each in given.warnings if "does nothing here" in each]
    for each in sliders.values():
        assert each.meaning
        assert each.unit or "[" not in each.meaning


def junk(rng):
    return rng.choice(
        [
            math.nan,
            math.inf,
            -(10**400),
            1e308,
            -0.0,
            True,
            None,
            "law",
            "\x00" * 50,
            [],
            [math.nan] * 3,
            [1e308] * 3,
            ["a"] * 3,
            {"a": [1]},
            [[[[[]]]]],
        ]
    )


def test_hundreds_of_messages_of_junk_break_nothing():
    session = Session(load_experiment("slc_nephroid_known"))
    watched = Watched(session)
    rng, known = random.Random(0), np.random.default_rng(0)
    refused, takeovers = 0, 0
    for k in range(400):
        names = [*session.controls(), "save", "exec", "", "law.", "law.limits", "law.home"]
        name, value = rng.choice(names), junk(rng)
        refused += session.set(name, value).refused
        if k % 25 == 0:
            # What is meant as well, so that the arm moves, and laws take over.
            session.set(*random_setting(known, session.controls()))
            session.set("pause", False)
            session.advance()
            takeovers = max(takeovers, session.takeovers)
            assert session.failure == ""
    assert refused > 240
    assert takeovers > 0
    assert max(watched.excess.values()) <= 1e-9
    assert watched.jump == 0.0
    assert np.isfinite(session.position()).all()
    json.dumps({name: each.as_data() for name, each in session.controls().items()}, allow_nan=False)
