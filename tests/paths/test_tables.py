"""CSV files of points, times and orientations."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, Points, Spline, Waypoints
from drake_rnn.paths import RecordedTargets
from row_helpers import each

ROWS = np.array([[0, 0, 0, 0], [1, 0.1, 0, 0], [2, 0.1, 0.1, 0], [3.5, 0, 0.1, 0.1]])


def written(tmp_path, text):
    file = tmp_path / "table.csv"
    file.write_text(text)
    return str(file)


def lines(header, rows):
    return header + "\n" + "\n".join(",".join(map(repr, map(float, row))) for row in rows) + "\n"


@pytest.mark.parametrize("header", ["t,x,y,z", "time, x, y, z", "Time,X,Y,Z"])
def test_columns_have_names(tmp_path, header):
    path = Waypoints(file=written(tmp_path, lines(header, ROWS)))
    same = Waypoints(positions=ROWS[:, 1:], times=ROWS[:, 0])
    for t in np.linspace(0, 4, 17):
        np.testing.assert_array_equal(path.evaluate(t), same.evaluate(t))


def test_columns_may_be_in_any_order(tmp_path):
    path = Waypoints(file=written(tmp_path, lines("z,t,y,x", ROWS[:, [3, 0, 2, 1]])))
    same = Waypoints(positions=ROWS[:, 1:], times=ROWS[:, 0])
    np.testing.assert_array_equal(path.evaluate(1.3), same.evaluate(1.3))


@pytest.mark.parametrize(
    ("names", "key"), [("qw,qx,qy,qz", "quaternions"), ("roll,pitch,yaw", "rpy")]
)
def test_a_file_may_hold_orientations(tmp_path, names, key):
    turns = np.array([[0, 0, 0], [0.1, 0, 0.2], [0, 0.3, 0], [0, 0, 0.4]])
    if key == "quaternions":
        turns = np.column_stack([np.sqrt(1 - (turns**2).sum(axis=1)), turns])
    path = Waypoints(file=written(tmp_path, lines(f"t,x,y,z,{names}", np.hstack([ROWS, turns]))))
    same = Waypoints(positions=ROWS[:, 1:], times=ROWS[:, 0], **{key: turns})
    assert path.turns
    for value, other in zip(path.evaluate_rotation(1.3), same.evaluate_rotation(1.3), strict=True):
        np.testing.assert_array_equal(value, other)


def test_points_and_splines_take_a_header_too(tmp_path):
    file = written(tmp_path, lines("x,y,z", ROWS[:, 1:]))
    plain = Spline(points=ROWS[:, 1:], period=2.0)
    for path in (Spline(file=file, period=2.0), Points(file=file, period=2.0)):
        np.testing.assert_array_equal(path.evaluate(0.7), plain.evaluate(0.7))
    closed = Points(file=file, period=2.0, closed=True)
    assert np.linalg.norm(closed.evaluate(2.0 - 1e-9)[0]) < 1e-8


def test_a_file_without_times_takes_them_from_the_document(tmp_path):
    file = written(tmp_path, lines("x,y,z", ROWS[:, 1:]))
    assert Waypoints(file=file, speed=0.1).duration > 2.0
    assert Waypoints(file=file, times=ROWS[:, 0]).duration == 3.5
    with pytest.raises(InvalidInputError, match="give one of times, period and speed"):
        Waypoints(file=file)


@each(
    ("text", "message"),
    [
        ("x,y\n0,0\n1,1\n", "row 1: has no column z"),
        ("t,x,y\n0,0,0\n", "row 1: has no column z"),
        ("x,y,z,qw,qx\n0,0,0,1,0\n", "row 1: has no column qy, qz"),
        ("x,y,z,x\n0,0,0,0\n", "row 1: column x is given twice"),
        ("t,x,y,z,time\n0,0,0,0,0\n", "row 1: column t is given twice"),
        ("x,y,f\n0,0,0\n", "row 1: has no column z; no column may be called 'f'"),
        ("x,y,3\n0,0,0\n1,1,1\n", "row 1, column 1: 'x' is not a finite number"),
        ("x,y,z,qw,qx,qy,qz,roll,pitch,yaw\n", "both quaternions and roll, pitch, yaw"),
        ("t,x,y,z\n0,0,0,0\n1,1,1\n", "row 3: must be 4 numbers, t, x, y and z"),
        ("t,x,y,z\n0,0,0,0\n1,1,1,nan\n", "row 3, column 4: 'nan' is not a finite number"),
        ("t,x,y,z\n0,0,0,0\n1,1,1,x\n", "row 3, column 4: 'x' is not a finite number"),
        ("t,x,y,z\n0,0,0,0\n\n0,1,1,1\n", "row 4: repeats the time 0"),
        ("t,x,y,z\n1,0,0,0\n0,1,1,1\n", "row 3: times must increase; 0 comes after 1"),
        ("t,x,y,z\n0,0,0,0\n", "needs at least 2 waypoints, not 1"),
        ("t,x,y,z\n", "needs at least 2 waypoints, not 0"),
        (
            "t,x,y,z,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n1,1,1,1,1,1,0,0\n",
            "row 3: a quaternion must have the length 1, not 1.414",
        ),
        ("0,0\n1,1\n", "row 1: must be 3 numbers, x, y and z"),
        ("", "is empty"),
    ],
)
def test_a_bad_table_is_refused_with_the_row(tmp_path, text, message):
    file = written(tmp_path, text)
    times = {} if text.startswith("t") else {"speed": 1.0}
    with pytest.raises(InvalidInputError, match=message) as caught:
        Waypoints(file=file, **times)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"period": 3.0}, "period: the file .*table.csv has a column t; leave one out"),
        ({"times": [0, 1, 2, 3]}, "times: the file .*table.csv has a column t; leave one out"),
        ({"rpy": np.zeros((4, 3))}, "rpy: the file .*table.csv has a column qw; leave one out"),
    ],
)
def test_what_the_file_gives_must_not_be_given_again(tmp_path, fields, message):
    rows = np.hstack([ROWS, np.tile([1.0, 0, 0, 0], (4, 1))])
    file = written(tmp_path, lines("t,x,y,z,qw,qx,qy,qz", rows))
    with pytest.raises(InvalidInputError, match=message):
        Waypoints(file=file, **fields)


@pytest.mark.parametrize("names", ["t,x,y,z", "x,y,z,qw,qx,qy,qz"])
def test_a_spline_ignores_no_column(tmp_path, names):
    width = names.count(",") + 1
    rows = np.hstack([ROWS[:, 1:], np.tile([1.0, 0, 0, 0], (4, 1))])[:, :width]
    file = written(tmp_path, lines(names, ROWS if width == 4 else rows))
    with pytest.raises(InvalidInputError, match=r"column (t|qw): is not used here.*waypoints"):
        Spline(file=file, period=2.0)


@pytest.mark.parametrize("kind", [Waypoints, Points, Spline])
@pytest.mark.parametrize("ending", ["yaml", "json", "mcap", "parquet"])
def test_recorded_joint_positions_are_referred_to_targets(tmp_path, kind, ending):
    file = tmp_path / f"t.{ending}"
    file.write_text("header: {stamp: {sec: 0}}\njoint_names: [a]\npoints: []\n")
    with pytest.raises(InvalidInputError) as caught:
        kind(file=str(file), period=1.0)
    assert str(caught.value).endswith(
        f"file {file}: must be a file of comma-separated values; recorded joint positions, such as "
        "a JointTrajectory, are given in targets"
    )


@pytest.mark.parametrize(
    ("header", "scales"),
    [
        ("time_ms,x_mm,y_mm,z_mm", (1e3, 1e3, 1e3, 1e3)),
        ("t_s,x_m,y_cm,z_um", (1.0, 1.0, 1e2, 1e6)),
        ("t [ms],x [mm],p_WE_y_mm,position.z_m", (1e3, 1e3, 1e3, 1.0)),
        ("elapsed_us,pos_x_mm,pos_y_mm,pos_z_mm", (1e6, 1e3, 1e3, 1e3)),
    ],
)
def test_units_may_end_the_names(tmp_path, header, scales):
    """1e-12: scaling there and back."""
    path = Waypoints(file=written(tmp_path, lines(header, ROWS * scales)))
    same = Waypoints(positions=ROWS[:, 1:], times=ROWS[:, 0])
    for t in np.linspace(0, 4, 17):
        np.testing.assert_allclose(path.evaluate(t), same.evaluate(t), atol=1e-12)
    assert path.notes == ()


def test_angles_at_the_end_of_whose_names_a_unit_stands_are_in_it(tmp_path):
    table = np.column_stack([ROWS, [[0, 0, 0], [0, 0, 9], [0, 5, 9], [0, 0, 0]]])
    file = written(tmp_path, lines("t,x,y,z,roll_deg,pitch_deg,yaw_deg", table))
    same = Waypoints(positions=ROWS[:, 1:], times=ROWS[:, 0], rpy=np.radians(table[:, 4:]))
    placed, other = (p.placed(np.zeros(3), np.eye(3)) for p in (Waypoints(file=file), same))
    np.testing.assert_allclose(placed.orientation(1.2)[0], other.orientation(1.2)[0], atol=1e-14)


@each("name", ["t", "time", "date", "timestamp", "datetime"])
@each("end", ["", "Z", "+01:00"])
def test_times_may_be_dates(tmp_path, name, end):
    """1e-6 s: seconds since 1970 as a double."""
    rows = "".join(
        f"2026-11-26T08:00:0{t}.000{end},{x},{y},{z}\n" for t, x, y, z in ROWS[:3].tolist()
    )
    path = Waypoints(file=written(tmp_path, f"{name},x,y,z\n" + rows.replace(".0.000", ".000")))
    same = Waypoints(positions=ROWS[:3, 1:], times=ROWS[:3, 0])
    for t in np.linspace(0, 3, 13):
        np.testing.assert_allclose(path.evaluate(t), same.evaluate(t), atol=1e-6)
    assert path.notes == ("table.csv: its times since 1970 begin at 0 here",)


def test_a_date_beside_a_time_is_ignored(tmp_path):
    rows = "".join(f"2026-11-26,{t},{x},{y},{z}\n" for t, x, y, z in ROWS.tolist())
    path = Waypoints(file=written(tmp_path, "date,t,x,y,z\n" + rows))
    assert path.notes == ("table.csv: date: ignored",)
    assert path.duration == ROWS[-1, 0]


STAMPS = {
    "rostopic echo -p": (
        "%time,field.header.seq,field.header.stamp,field.header.frame_id",
        "1600000000{0:03d}000000,7,1600000000{0:03d}000000,base",
        "field.header.seq, field.header.stamp, field.header.frame_id: ignored",
    ),
    "a stamp in two parts": (
        "header.stamp.sec,header.stamp.nanosec,header.frame_id",
        "16,{0:03d}000000,base",
        "header.frame_id: ignored",
    ),
    "a stamp since 1970 in two parts": (
        "header.stamp.secs,header.stamp.nsecs",
        "1600000000,{0:03d}000000",
        "",
    ),
    "a number of the row": ("index,timestamp [ns]", "1,{0}000000", "index: ignored"),
}


@pytest.mark.parametrize(("head", "stamp", "told"), STAMPS.values(), ids=STAMPS)
def test_stamps_of_poses_are_read_alike_as_waypoints_and_as_targets(tmp_path, head, stamp, told):
    """1e-6 s: seconds since 1970 as a double."""
    pose = [f"pose.position.{axis}" for axis in "xyz"]
    pose += [f"pose.orientation.{axis}" for axis in "xyzw"]
    begin = "field." if "field" in head else ""
    rows = [f"{stamp.format(100 * k)},{0.01 * k},0,0,0,0,0,1" for k in range(3)]
    text = "\n".join([",".join([head, *(begin + name for name in pose)]), *rows])
    file = written(tmp_path, text + "\n")
    path, shift = Waypoints(file=file), 16.0 * stamp.startswith("16,")
    assert path.duration - shift == pytest.approx(0.2, abs=1e-6)
    assert path.turns
    assert all(told in note for note in path.notes)
    calls, _ = RecordedTargets(file=file).calls(["a", "b"], ["rad", "rad"], np.zeros(2))
    np.testing.assert_allclose([c.time - shift for c in calls], [0.0, 0.1, 0.2], atol=1e-6)
    assert {call.kind for call in calls} == {"poses"}
    np.testing.assert_array_equal(calls[2].values, [[0.02, 0, 0, 1, 0, 0, 0]])


def test_each_angle_is_in_its_own_unit(tmp_path):
    table = np.column_stack([ROWS, [[0, 0, 0], [90, 0.5, 9], [0, 0.1, 9], [0, 0, 0]]])
    file = written(tmp_path, lines("t,x,y,z,roll [deg],pitch [rad],yaw", table))
    rpy = np.column_stack([np.radians(table[:, 4]), table[:, 5], np.radians(table[:, 6])])
    same = Waypoints(positions=ROWS[:, 1:], times=ROWS[:, 0], rpy=rpy)
    found = Waypoints(file=file, angles="degrees")
    placed, other = (p.placed(np.zeros(3), np.eye(3)) for p in (found, same))
    np.testing.assert_allclose(placed.orientation(1.2)[0], other.orientation(1.2)[0], atol=1e-14)
