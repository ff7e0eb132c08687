"""Numbers as they are read."""

from __future__ import annotations

import math
from itertools import product

import pytest

from drake_rnn.measures import format_quantity, prefix_unit, superscript


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (2.7126e-4, "m", "0.2713 mm"),
        (2.7126e-5, "m", "27.13 µm"),
        (-5e-3, "N", "-5 mN"),
        (3e-12, "m", "0.003 nm"),
        (12.5, "m", "12.5 m"),
        (0.0, "rad", "0 rad"),
        (-0.0, "m", "0 m"),
        (21.84, "1", "21.84"),
        (0.001, "1", "0.001"),
        (1.5, "rad/s^2", "1.5 rad/s²"),
        (1e-9, "rad/s^2", "1 nrad/s²"),
        (math.inf, "m", "inf m"),
        (math.nan, "N", "nan N"),
    ],
)
def test_numbers_are_told_with_four_digits(value, unit, text):
    assert format_quantity(value, unit) == text


def test_no_number_has_an_exponent():
    """Up to 100 nothing has; what rounding makes 100 of is 0.1 of the next unit."""
    leads, exponents = (1.0, 9.94, 9.96, 9.994, 9.996), range(-9, 3)
    for lead, exponent, digits in product(leads, exponents, (2, 3, 4)):
        value = lead * 10.0**exponent
        number, unit = format_quantity(value, "m", digits).split()
        assert "e" not in number
        factor = {"m": 1.0, "mm": 1e-3, "µm": 1e-6, "nm": 1e-9}[unit]
        assert float(number) * factor == pytest.approx(value, rel=10.0 ** (1 - digits))


@pytest.mark.parametrize(
    ("size", "expected"),
    [
        (0.1, ("m", 1.0)),
        (1e-4, ("mm", 1e3)),
        (1e-7, ("µm", 1e6)),
        (0.9e-7, ("nm", 1e9)),
        (-0.02, ("mm", 1e3)),
        (0.0, ("m", 1.0)),
    ],
)
def test_the_coarsest_prefix_that_leaves_a_tenth(size, expected):
    assert prefix_unit(size, "m") == expected


def test_powers_are_raised():
    assert superscript("rad/s^2") == "rad/s²"
    assert superscript("N m") == "N m"
