"""Meanings and units of the keys of documents, which are metadata of the fields."""

import os
import subprocess
import sys
from typing import Annotated

import pytest

from drake_rnn import LAWS, PATHS, Meaning, Only
from drake_rnn.experiment import read_document, unit_of_key
from drake_rnn.inputs.keys import keys_of, meanings_of
from row_helpers import each


@each(
    ("experiment", "key", "unit"),
    [
        ("slc_nephroid_known", "law.kappa", "1/s"),
        ("slc_nephroid_known", "law.rho", "rad^2/s"),
        ("slc_nephroid_known", "period", "s"),
        ("slc_nephroid_known", "path.size", "m"),
        ("slc_nephroid_known", "limits.jerk", "rad/s^3"),
        ("slc_nephroid_known", "limits.position_lower[2]", "rad"),
        ("pinv_line", "start[0]", "rad"),
        ("pinv_line", "path.by[1]", "m"),
        ("contact_cat", "force.value", "N"),
        ("adaptive_measured", "sensing.delay", "s"),
        ("slc_nephroid_warm_up", "arm.tool.mass", "kg"),
        ("slc_nephroid", "dither.hold", "s"),
        # Without a unit, or not known.
        ("slc_nephroid_known", "law.jacobian", ""),
        ("slc_nephroid_known", "law.J_hat_initial", ""),
        ("slc_nephroid_known", "law.no_such", ""),
        ("slc_nephroid_known", "no_such", ""),
        ("slc_nephroid_known", "no.such.key", ""),
    ],
)
def test_units_are_found_for_keys_of_any_section(experiment, key, unit):
    assert unit_of_key(read_document(experiment), key) == unit


def test_a_kind_that_there_is_not_has_no_units():
    assert unit_of_key({"law": {"kind": "none_such"}}, "law.kappa") == ""


def test_a_field_that_is_declared_anew_keeps_its_meaning_unless_another_is_given():
    class Base:
        gain: Annotated[float, Meaning("A gain.", unit="1/s")]
        zone: Annotated[float, Meaning("A zone.", unit="rad")]

    class Derived(Base):
        gain: int
        zone: Annotated[float, Meaning("A wider zone.", unit="m")]

    found = meanings_of(Derived)
    assert (found["gain"].unit, str(found["zone"])) == ("1/s", "A wider zone [m].")


@pytest.mark.parametrize(
    ("meaning", "text"),
    [
        (Meaning("A gain."), "A gain."),
        (Meaning("A gain.", unit="1/s"), "A gain [1/s]."),
        (Meaning("A gain; 0 for none. More.", unit="1/s"), "A gain [1/s]; 0 for none. More."),
        (Meaning("Joints [rad], named q1.", unit="rad"), "Joints [rad], named q1."),
        (
            Meaning("A.", only=(Only("task", "xy", "pose"),)),
            "A. Acts only with ``task: xy or pose``.",
        ),
        (Meaning("A.", only=(Only("a", "b"), Only("c"))), "A. Acts only with ``a: b`` and ``c``."),
    ],
)
def test_a_meaning_in_words_has_the_unit_where_its_first_clause_ends(meaning, text):
    assert str(meaning) == text


@pytest.mark.parametrize("kinds", [LAWS, PATHS], ids=["laws", "paths"])
def test_all_that_is_shipped_says_what_it_is_and_what_each_key_means(kinds):
    for kind, cls in kinds.items():
        assert vars(cls)["summary"].endswith("."), kind
        assert all(key.meaning for key in keys_of(cls)), kind


_SHOWN = """
import sys
from drake_rnn import load_experiment
from drake_rnn.cli import starting
print(*load_experiment("slc_nephroid_known", {"law.rho": 1e-5}).warnings, sep="\\n")
print(*load_experiment("zeroing_clover", {"law.blend": 0.2}).warnings, sep="\\n")
for arguments in (["laws"], ["laws", "adaptive"], ["paths", "sequence"]):
    sys.argv = ["drake-rnn", *arguments]
    try:
        starting.main()
    except SystemExit as ended:
        print(ended.code)
"""


@pytest.mark.long
def test_python_without_docstrings_tells_the_same():
    """Of -OO, which drops docstrings and assertions: warnings, laws, keys and units."""
    shown = [
        subprocess.run(
            [sys.executable, *options, "-c", _SHOWN],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "COLUMNS": "120"},
        ).stdout
        for options in ([], ["-OO"])
    ]
    assert shown[0] == shown[1]
    assert "law.rho: does nothing here; it acts only with law.jacobian: learned" in shown[0]
    assert "law.blend: does nothing here" in shown[0]
    assert "Every bound to the jerk, by construction" in shown[0]
    assert "[rad/s²]" in shown[0]
