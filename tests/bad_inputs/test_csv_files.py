"""Files of points that are none: refused with file, row and column."""

import os

import numpy as np
import pytest
from refusing import at_once, refusal

from drake_rnn import Points, Spline, Waypoints
from drake_rnn.paths.points import read_table
from row_helpers import each

GOOD = "t,x,y,z\n0,0,0,0\n1,0.1,0,0\n2,0.1,0.1,0\n"
HEADER = "t,x,y,z\n"
TURNED = "t,x,y,z,qw,qx,qy,qz\n0,0,0,0,{}\n1,0.1,0,0,1,0,0,0\n"

#: What the file holds, and what is said of it.
FILES = {
    "nothing": ("", "is empty"),
    "blank lines": ("  \n \n", "is empty"),
    "a header alone": (HEADER, "needs at least 2 waypoints, not 0"),
    "a single point": (HEADER + "0,0,0,0\n", "needs at least 2 waypoints, not 1"),
    "bytes of a program": (bytes(range(256)), "is not a text file"),
    "zero bytes": (HEADER.encode() + b"0,0,0,0\n\x00\x00\n", "row 3: must be 4 numbers"),
    "UTF-16": (GOOD.encode("utf-16"), "is not a text file"),
    "Latin-1": ("t,x,y,z\n0,0,0,ä\n".encode("latin-1"), "is not a text file"),
    "gzip": (b"\x1f\x8b\x08\x00abc", "is not a text file"),
    "NumPy's format": (b"\x93NUMPY\x01\x00v\x00", "is not a text file"),
    "JSON": ('{"x": [1, 2]}', "no column may be called '{\"x\": [1'"),
    "a comment alone": ("# my points\n", "is empty"),
    "NaN": (GOOD + "3,nan,0,0\n", "row 5, column 2: 'nan' is not a finite number"),
    "infinity": (GOOD + "3,0,inf,0\n", "row 5, column 3: 'inf' is not a finite number"),
    "too large a number": (GOOD + "3,0,0,1e400\n", "row 5, column 4: '1e400' is not a finite"),
    "a word": (GOOD + "3,far,0,0\n", "row 5, column 2: 'far' is not a finite number"),
    "a unit": (GOOD + "3,0.1m,0,0\n", "row 5, column 2: '0.1m' is not a finite number"),
    "a percentage": (GOOD + "3,10%,0,0\n", "row 5, column 2: '10%' is not a finite number"),
    "hexadecimal": (GOOD + "3,0x10,0,0\n", "row 5, column 2: '0x10' is not a finite number"),
    "underscores": (GOOD + "3,0_1,0,0\n", "row 5, column 2: '0_1' is not a finite number"),
    "digits of another script": (GOOD + "3,٠.٢,0,0\n", "row 5, column 2: '٠.٢' is not a finite"),
    "too many rows": (
        HEADER + "1,0,0,0\n" * 250_000,
        "has 250000 rows, and may have 100000; keep one of 3 of them",
    ),
    "thousands": (GOOD + '3,"1,000",0,0\n', "row 5, column 2: '1,000' is not a finite number"),
    "a time of day": (HEADER + "00:00,0,0,0\n", "row 2, column 1: '00:00' is not a finite number"),
    "an empty cell": (GOOD + "3,,0,0\n", "row 5, column 2: '' is not a finite number"),
    "a row that is short": (GOOD + "3,0,0\n", "row 5: must be 4 numbers, t, x, y and z"),
    "a row that is long": (GOOD + "3,0,0,0,0\n", "row 5: must be 4 numbers, t, x, y and z"),
    "an open quote": (HEADER + '0,"0,0,0\n1,1,1,1\n', "row 3: must be 4 numbers"),
    "an endless cell": (HEADER + "0," + "9" * 200_000 + ",0,0\n", "field larger than field limit"),
    "no z": ("t,x,y\n0,0,0\n1,1,1\n", "row 1: has no column z"),
    "no x": ("t,y,z\n0,0,0\n1,1,1\n", "row 1: has no column x"),
    "another column": (
        "t,x,y,Z axis\n0,0,0,0\n",
        "row 1: has no column z; no column may be called 'Z axis'; they may be x, y, z; t or time",
    ),
    "a column twice": ("t,x,y,x\n0,0,0,0\n", "row 1: column x is given twice"),
    "time twice": ("t,time,x,y,z\n0,0,0,0,0\n", "row 1: column t is given twice"),
    "a unit that is none": (
        "t,x [ft],y,z\n",
        "row 1: column x [ft]: 'ft' is no unit of a length; it may be m, cm, mm or um",
    ),
    "a length in degrees": ("t,x,y [deg],z\n", "column y [deg]: 'deg' is no unit of a length"),
    "a length in seconds": ("t,x,y,z_ms\n", "column z_ms: 'ms' is no unit of a length"),
    "a speed as a length": ("t,x [m/s],y,z\n", "column x [m/s]: 'm/s' is no unit of a length"),
    "a time in degrees": ("t [deg],x,y,z\n0,0,0,0\n", "column t [deg]: 'deg' is no unit of a time"),
    "a time in mm": ("time_mm,x,y,z\n0,0,0,0\n", "'mm' is no unit of a time; it may be s, ms, us"),
    "an angle in m": ("t,x,y,z,roll [m],pitch,yaw\n", "'m' is no unit of an angle; it may be rad"),
    "a quaternion in degrees": ("t,x,y,z,qw,qx [deg],qy,qz\n", "'deg' is no unit of a number; it"),
    "KUKA's angles": (
        "x [mm],y [mm],z [mm],A,B,C\n0,0,0,0,0,0\n",
        "row 1: a, b, c look like the angles A, B and C of KUKA; give orientations as columns yaw "
        "[deg], pitch [deg], roll [deg]",
    ),
    "Fanuc's angles": ("x,y,z,w,p,r\n", "row 1: w, p, r look like the angles W, P and R of Fanuc"),
    "a rotation vector": ("x,y,z,rx,ry,rz\n", "rx, ry, rz look like a rotation vector; give"),
    "two columns": ("0,0\n1,1\n", "row 1: must be 3 numbers, x, y and z"),
    "four columns without names": ("0,0,0,0\n1,1,1,1\n", "row 1: must be 3 numbers, x, y and z"),
    "a time before the start": (
        HEADER + "-1,0,0,0\n1,1,1,1\n",
        "the time must be 0 or more, not -1",
    ),
    "a time that goes back": (GOOD + "1,0,0,0\n", "row 5: times must increase; 1 comes after 2"),
    "a time twice": (GOOD + "2,0,0,0\n", "row 5: repeats the time 2 of the row before it"),
    "a leap": (
        GOOD + "2.000001,0,0,0\n",
        "row 5: must be at least 0.001 s after the row before it",
    ),
    "half a quaternion": ("t,x,y,z,qw,qx\n", "row 1: has no column qy, qz"),
    "half of the angles": ("t,x,y,z,roll,yaw\n", "row 1: has no column pitch"),
    "two orientations": ("t,x,y,z,qw,qx,qy,qz,roll,pitch,yaw\n", "both quaternions and roll"),
    "a long quaternion": (TURNED.format("2,0,0,0"), "a quaternion must have the length 1, not 2"),
    "no quaternion": (TURNED.format("0,0,0,0"), "a quaternion must have the length 1, not 0"),
    "degrees": (
        "t,x,y,z,roll,pitch,yaw\n0,0,0,0,0,0,0\n1,0.1,0,0,0,90,0\n",
        "row 3: roll, pitch and yaw are at most one turn, 2 pi, in radians, not [0.0, 90.0, 0.0]; "
        "for degrees give angles: degrees",
    ),
}


@each(("content", "said"), FILES.values(), ids=FILES)
def test_a_file_that_holds_no_motion_is_refused(tmp_path, content, said):
    file = tmp_path / "points.csv"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert said in refusal(lambda: Waypoints(file=str(file)))


@pytest.mark.parametrize("kind", [Waypoints, Spline, Points])
@pytest.mark.parametrize(
    ("name", "said"),
    [("folder.csv", "Is a directory"), ("none.csv", "No such file"), ("a\0b.csv", "null")],
)
def test_what_is_no_file_is_refused(tmp_path, kind, name, said):
    (tmp_path / "folder.csv").mkdir()
    assert said in refusal(lambda: kind(file=str(tmp_path / name), period=2.0))


@pytest.mark.parametrize("kind", [Waypoints, Spline, Points])
def test_what_has_no_end_is_refused_at_once(tmp_path, kind):
    """A pipe would be waited for, and a device would fill the memory."""
    os.mkfifo(tmp_path / "pipe.csv")
    with (tmp_path / "large.csv").open("wb") as large:
        large.truncate(10**12)
    for file in (tmp_path / "pipe.csv", "/dev/zero"):
        said = "must be a regular file, not a pipe or a device"
        assert said in refusal(lambda file=file: kind(file=str(file), period=2.0))
    said = "has 1e+06 MB, and may have 25 MB"
    assert said in refusal(lambda: kind(file=str(tmp_path / "large.csv"), period=2.0))


def test_a_hundred_thousand_rows_are_read(tmp_path):
    file = tmp_path / "points.csv"
    file.write_text("x,y,z\n" + "".join(f"{k},0,0\n" for k in range(100_000)))
    with at_once():
        assert len(read_table(str(file)).points) == 100_000


#: The same motion as editors and recorders write it.
SAME = {
    "Windows": GOOD.replace("\n", "\r\n"),
    "byte order mark": "\ufeff" + GOOD,
    "old Macintosh": GOOD.replace("\n", "\r"),
    "blanks around": GOOD.replace(",", " , "),
    "semicolons": GOOD.replace(",", ";"),
    "decimal commas": GOOD.replace(",", ";").replace(".", ","),
    "tabs": GOOD.replace(",", "\t"),
    "blanks": GOOD.replace(",", "  "),
    "a spreadsheet's hint": "sep=;\n" + GOOD.replace(",", ";"),
    "comments": "# my points, by hand\n" + GOOD.replace("\n1", "\n  # later\n1"),
    "NumPy's header": "# t x y z\n" + GOOD.partition("\n")[2].replace(",", " "),
    "units in the header": "t [ms],x [mm],y [mm],z [mm]\n0,0,0,0\n1000,100,0,0\n2000,100,100,0\n",
    "columns that are ignored": "frame,timestamp,x,y,z,speed\na,0,0,0,0,\n"
    "b,1,0.1,0,0,fast\nc,2,0.1,0.1,0,1\n",
    "nanoseconds since 1970": "stamp,x,y,z\n1620000000000000000,0,0,0\n"
    "1620000001000000000,0.1,0,0\n1620000002000000000,0.1,0.1,0\n",
    "a stamped pose": "time,pose.position.x,pose.position.y,pose.position.z\n"
    + GOOD.partition("\n")[2],
    "a TUM trajectory": "# timestamp tx ty tz qx qy qz qw\n1620000000.5 0 0 0 0 0 0 1\n"
    "1620000001.5 0.1 0 0 0 0 0 1\n1620000002.5 0.1 0.1 0 0 0 0 1\n",
    "EuRoC": "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],"
    "q_RS_z [],v_RS_R_x [m s^-1]\n1620000000000000000,0,0,0,1,0,0,0,9\n"
    "1620000001000000000,0.1,0,0,1,0,0,0,9\n1620000002000000000,0.1,0.1,0,1,0,0,0,9\n",
    "a TUM trajectory without a head": "1620000000.5 0 0 0 0 0 0 1\n"
    "1620000001.5 0.1 0 0 0 0 0 1\n1620000002.5 0.1 0.1 0 0 0 0 1\n",
}


@each("content", SAME.values(), ids=SAME)
def test_what_editors_and_recorders_write_is_read(tmp_path, content):
    file = tmp_path / "points.csv"
    file.write_bytes(content.encode())
    table, path = read_table(str(file)), Waypoints(file=str(file))
    assert table.columns["t"] == pytest.approx([0.0, 1.0, 2.0], abs=1e-9)
    assert table.points.ravel() == pytest.approx([0, 0, 0, 0.1, 0, 0, 0.1, 0.1, 0], abs=1e-15)
    assert path.duration == pytest.approx(2.0)


def test_what_is_ignored_and_moved_is_told_in_one_line(tmp_path):
    file = tmp_path / "points.csv"
    file.write_text("t,x,y,z,note\n1620000000,0,0,0,a\n1620000001,0.1,0,0,b\n")
    told = "points.csv: its times since 1970 begin at 0 here; note: ignored"
    assert list(Waypoints(file=str(file)).notes) == [told]


def test_degrees_are_said_by_a_key_or_by_the_header(tmp_path):
    file, rows = tmp_path / "points.csv", "0,0,0,0,0,0,0\n1,0.1,0,0,0,0,90\n"
    found = []
    for head in ("roll,pitch,yaw", "roll [deg],pitch [deg],yaw [deg]"):
        file.write_text(f"t,x,y,z,{head}\n{rows}")
        for angles in ("degrees",) if "[" not in head else ("degrees", "radians"):
            placed = Waypoints(file=str(file), angles=angles).placed(np.zeros(3), np.eye(3))
            found.append(placed.orientation(1.0)[0])
    for R in found:
        np.testing.assert_allclose(R, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
