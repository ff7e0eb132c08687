"""Units of the keys of documents, as they are told where fields are explained."""

import pytest

from drake_rnn.experiment import read_document, unit_of_key


@pytest.mark.parametrize(
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
