"""Units in the names of columns: each is read where it is of the column's kind, and only there."""

import numpy as np
import pytest

from drake_rnn.inputs.units import UNITS, is_time, scale_of, split_unit, time_columns

TURN = 2.0 * np.pi
#: Names, the kind of their numbers, and the unit in s, rad, m, rad/s, m/s or 1.
READ = [
    ("t_ms", "time", 1e-3),
    ("time [us]", "time", 1e-6),
    ("header.stamp.nanosec", "time", 1e-9),
    ("q1 [deg]", "angle", TURN / 360.0),
    ("q1_DEG", "angle", TURN / 360.0),
    ("q1 (°)", "angle", TURN / 360.0),
    ("q1 [mrad]", "angle", 1e-3),
    ("q1 [rev]", "angle", TURN),
    ("q1_turns", "angle", TURN),
    ("position[0] [rad]", "angle", 1.0),
    ("slide [mm]", "length", 1e-3),
    ("x_cm", "length", 1e-2),
    ("dq1 [deg/s]", "angular velocity", TURN / 360.0),
    ("dq1_rad_s", "angular velocity", 1.0),
    ("dq1_rad_per_s", "angular velocity", 1.0),
    ("w [rpm]", "angular velocity", TURN / 60.0),
    ("w [rad s^-1]", "angular velocity", 1.0),
    ("vx [mm/s]", "velocity", 1e-3),
    ("v_RS_R_x [m s^-1]", "velocity", 1.0),
    ("qw [1]", "number", 1.0),
    ("qw []", "number", 1.0),
]
#: Units that are read nowhere.
FOREIGN = [
    "A",
    "mA",
    "N m",
    "Nm",
    "V",
    "N",
    "counts",
    "%",
    "°C",
    "rad/s^2",
    "inch",
    "ft",
    "Hz",
    "x",
]


@pytest.mark.parametrize(("name", "kind", "scale"), READ)
def test_a_unit_is_read_by_its_own_kind_alone(name, kind, scale):
    assert scale_of(name, kind) == pytest.approx(scale, rel=1e-12)
    for other in UNITS:
        if other != kind and split_unit(name)[1]:
            with pytest.raises(ValueError, match="is no unit of an? " + other) as caught:
                scale_of(name, other)
            assert str(caught.value).startswith(f"column {name}: ")


@pytest.mark.parametrize("unit", FOREIGN)
@pytest.mark.parametrize("kind", UNITS)
def test_a_unit_that_is_not_known_is_refused(kind, unit):
    with pytest.raises(
        ValueError, match=r"column q1 \[.*\]: '.*' is no unit of an? .*; it may be "
    ):
        scale_of(f"q1 [{unit}]", kind)


@pytest.mark.parametrize("ending", ["A", "Nm", "counts", "rad_s2", "rpm", "percent"])
def test_a_unit_of_something_else_ends_a_name_too(ending):
    assert split_unit(f"q1_{ending}") == ("q1", ending)
    with pytest.raises(ValueError, match=f"column q1_{ending}: '{ending}' is no unit of an angle"):
        scale_of(f"q1_{ending}", "angle")


def test_digits_in_brackets_count_and_names_of_joints_stay_whole():
    assert split_unit("position[3]") == ("position[3]", "")
    assert split_unit("arm/lift_mm", ["lift_mm"]) == ("arm/lift_mm", "")
    assert split_unit("position[elbow]", ["elbow"]) == ("position[elbow]", "")
    assert split_unit("elbow [deg]", ["elbow"]) == ("elbow", "deg")


def test_one_column_or_a_stamp_in_two_parts_is_of_times():
    assert time_columns(["%time", "field.header.stamp", "x"]) == ("%time",)
    assert time_columns(["x", "header.stamp.sec", "header.stamp.nanosec"]) == (
        "header.stamp.sec",
        "header.stamp.nanosec",
    )
    assert time_columns(["date", "t_ms", "x"]) == ("t_ms",)
    assert time_columns(["date", "x"]) == ("date",)
    assert time_columns(["timeout", "x"]) == ()
    assert is_time("t [deg]")
    with pytest.raises(ValueError, match="column t is given twice, as t and as time_ms; leave one"):
        time_columns(["t", "time_ms"])
