"""Recordings of joint positions as other tools write them, and what is said of the rest."""

import json
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drake_rnn import InvalidInputError, load_experiment, simulate
from drake_rnn.exports import export
from drake_rnn.paths import RecordedTargets, Svg, Waypoints

JOINTS = ["shoulder", "elbow"]
TIMES = [0.0, 0.1, 0.2]
POSITION = np.array([[0.1, -0.2], [0.2, -0.3], [0.3, -0.4]])


def targets(tmp_path, name, content, joints=JOINTS, start=None, **fields):
    file = tmp_path / name
    if content is not None:
        file.write_text(content)
    return RecordedTargets(file=str(file), **fields).of_arm(joints, start=start)


def lines(head, row, *, times=TIMES):
    rows = (row.format(t=t, a=a, b=b) for t, (a, b) in zip(times, POSITION, strict=True))
    return "\n".join([head, *rows]) + "\n"


EPOCH = [1620000000.0 + t for t in TIMES]
#: CSV as recorders write it, and what is told of it.
CSV = {
    "joints in another order": ("t,elbow,shoulder\n", "{t},{b},{a}", TIMES, ""),
    "numbered from 0": ("timestamp,j0,j1", "{t},{a},{b}", TIMES, ""),
    "degrees and milliseconds": (
        "time_ms,q1 [deg],q2 [deg]",
        None,
        TIMES,
        "",
    ),
    "a gripper and a text": (
        "timestamp,joint_1,joint_2,gripper,state",
        "{t},{a},{b},0.02,moving",
        EPOCH,
        "its times since 1970 begin at 0 here; gripper, state: ignored",
    ),
    "an index of pandas": (",time,q1,q2", "7,{t},{a},{b}", TIMES, "column 1: ignored"),
    "seconds and nanoseconds": (
        "header.stamp.sec,header.stamp.nanosec,position[0],position[1],velocity[0],velocity[1]",
        "162,{t},{a},{b},9,9",
        [0, 100000000, 200000000],
        "the joints are position[0] to position[1]; velocity[0], velocity[1]: ignored",
    ),
    "RTDE of Universal Robots": (
        "timestamp target_q_0 target_q_1 target_qd_0 target_qd_1 actual_q_0 actual_q_1 "
        "actual_TCP_pose_0 actual_TCP_pose_1",
        "{t} {a} {b} 9 9 8 8 7 7",
        TIMES,
        "the joints are target_q_0 to target_q_1; target_qd_0, target_qd_1, actual_q_0, "
        "actual_q_1, actual_TCP_pose_0, actual_TCP_pose_1: ignored",
    ),
    "PlotJuggler": (
        "__time,/joint_states/elbow/position,/joint_states/shoulder/position,"
        "/joint_states/elbow/velocity",
        "{t},{b},{a},9",
        EPOCH,
        "its times since 1970 begin at 0 here; the joints are /joint_states/shoulder/position to "
        "/joint_states/elbow/position; /joint_states/elbow/velocity: ignored",
    ),
    "rostopic echo -p": (
        "%time,field.header.seq,field.name0,field.name1,field.position0,field.position1,"
        "field.effort0,field.effort1",
        "{t},4,elbow,shoulder,{b},{a},0,0",
        [1620000000000000000, 1620000000100000000, 1620000000200000000],
        "its times since 1970 begin at 0 here; the joints are field.position.shoulder to "
        "field.position.elbow; field.header.seq, field.name0, field.name1, field.effort0, "
        "field.effort1: ignored",
    ),
    "an index of dates": (
        ",q1,q2",
        "{t},{a},{b}",
        [f"2026-01-02 03:04:05.{k}00000" for k in (0, 1, 2)],
        "its times since 1970 begin at 0 here",
    ),
    "dates": (
        "time;q1;q2",
        "{t};{a};{b}",
        [f"2026-01-02T03:04:05.{k}00Z" for k in (0, 1, 2)],
        "its times since 1970 begin at 0 here",
    ),
}


@pytest.mark.parametrize(("head", "row", "times", "told"), CSV.values(), ids=CSV)
def test_the_headers_of_other_recorders_are_read(tmp_path, head, row, times, told):
    content = lines(head, row or "", times=times)
    if row is None:
        degrees = np.degrees(POSITION).tolist()
        rows = [f"{1000 * t},{a!r},{b!r}" for t, (a, b) in zip(TIMES, degrees, strict=True)]
        content = "\n".join([head, *rows])
    found = targets(tmp_path, "r.csv", content)
    if "position[0]" in head:
        found = found.__class__(found.time - 162.0, found.position, found.notes)
    np.testing.assert_allclose(found.time, TIMES, atol=1e-6)
    np.testing.assert_allclose(found.position, POSITION, atol=1e-15)
    assert list(found.notes) == ([f"targets: r.csv: {told}"] if told else [])


def test_degrees_columns_times_and_a_beginning_are_said_by_keys(tmp_path):
    rows = "".join(f"{a},{b}\n" for a, b in np.degrees(POSITION).tolist())
    found = targets(tmp_path, "r.csv", "a,b\n" + rows, columns=["b", "a"], period=0.1,
                    angles="degrees", begin=0.1)  # fmt: skip
    np.testing.assert_allclose(found.time, [0.0, 0.1], atol=1e-12)
    np.testing.assert_allclose(found.position, POSITION[1:, ::-1], atol=1e-15)


@pytest.mark.parametrize(
    ("content", "fields", "said"),
    [
        ("t,left1,left2,right1,right2\n0,1,2,3,4\n", {}, "columns: must be given, as the joints"),
        ("t,q1,q2,q3\n0,1,2,3\n", {"columns": ["q1"]}, "columns: must be 2, one per joint; there"),
        ("t,q1,q2,q3\n0,1,2,3\n", {"columns": ["q1", "z"]}, "columns: no column 'z'; there are"),
        ("t,q1,x\n0,1,2\n", {"columns": "q"}, "columns: q: has 1 column, and the arm 2 joints"),
        ("t,q1,q2\n0,1,2\n", {"begin": 5.0}, "begin: no row comes at 5 s or later"),
        ("t,q1,q2\n0,1,on\n", {}, "row 2, column 3: 'on' is not a finite number, nor nan"),
    ],
)
def test_what_is_not_clear_is_refused_with_the_key(tmp_path, content, fields, said):
    with pytest.raises(InvalidInputError) as caught:
        targets(tmp_path, "r.csv", content, **fields)
    assert said in str(caught.value)


NAMES = ["base", "shoulder", "elbow", "wrist"]


def as_csv(names, rows):
    lines = [",".join(map(str, (t, *row))) for t, row in zip(TIMES, rows.tolist(), strict=True)]
    return "r.csv", "\n".join(["t," + ",".join(names), *lines])


def as_states(names, rows):
    """Messages of which each has its own order of joints."""
    records = []
    for k, (t, row) in enumerate(zip(TIMES, rows.tolist(), strict=True)):
        order = np.roll(np.arange(len(names)), k)
        state = {"name": [names[i] for i in order], "position": [row[i] for i in order]}
        records.append({"header": {"stamp": t}, **state})
    return "r.json", json.dumps(records)


def as_trajectory(names, rows):
    points = [
        {"positions": row, "time_from_start": t + 1.0}
        for t, row in zip(TIMES, rows.tolist(), strict=True)
    ]
    return "r.yaml", json.dumps({"joint_names": list(names), "points": points})


@settings(max_examples=10)
@given(order=st.permutations(range(4)), seed=st.integers(0, 99))
@pytest.mark.parametrize("written", [as_csv, as_states, as_trajectory])
def test_joints_with_names_may_have_any_order(tmp_path_factory, written, order, seed):
    """Targets have the same bits."""
    rows, place = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, 4)), tmp_path_factory
    found = [
        targets(
            place.mktemp("r"), *written([NAMES[k] for k in each], rows[:, each]), NAMES, np.zeros(4)
        )
        for each in (range(4), order)
    ]
    np.testing.assert_array_equal(found[1].time, found[0].time)
    np.testing.assert_array_equal(found[1].position, found[0].position)


def test_numbers_of_which_some_are_joints_are_not_taken_for_others(tmp_path):
    """joint2 is the first joint of the arm, and the second column."""
    rows = lines("t,joint1,joint2,joint3", "{t},{a},{b},0")
    with pytest.raises(InvalidInputError, match=r"joint1 \.\.\. have names of some .* of joint4"):
        targets(tmp_path, "r.csv", rows, ["joint2", "joint3", "joint4"])


TRAJECTORY = """
header: {stamp: {secs: 0, nsecs: 0}}
joint_names: [gripper, elbow, shoulder]
points:
- positions: [0.0, -0.2, 0.1]
  velocities: [0.0, 0.0, 0.0]
  time_from_start: {secs: 1, nsecs: 0}
- {positions: [1e-05, -0.4, 0.3], velocities: [0, 0, 0], time_from_start: {sec: 2, nanosec: 500000000}}
---
"""  # noqa: E501


def test_a_trajectory_is_filled_in_from_the_start_on_with_joints_by_name(tmp_path):
    start = np.array([0.5, 0.5])
    found = targets(tmp_path, "t.yaml", TRAJECTORY, start=start)
    assert found.notes == ("targets: t.yaml: gripper: ignored",)
    assert np.diff(found.time).max() <= 0.01 + 1e-12
    # A cubic from rest to rest, half way at half the time.
    for t, q in ((0.0, start), (0.5, [0.3, 0.15]), (1.0, [0.1, -0.2]), (1.75, [0.2, -0.3])):
        assert found.position[found.newest(np.array(t))] == pytest.approx(q, abs=1e-9)
    assert (found.time[-1], *found.position[-1]) == pytest.approx((2.5, 0.3, -0.4))
    rate = np.diff(found.position, axis=0) / np.diff(found.time)[:, None]
    assert np.abs(rate[[0, -1]]).max() < 0.025


def test_a_trajectory_without_rates_is_a_line_and_with_accelerations_a_quintic(tmp_path):
    point = (
        "{{joint_names: [shoulder, elbow], points: [{{positions: [0, 0]{0}, time_from_start: 0}}, "
    )
    point += "{{positions: [1, 1]{0}, time_from_start: 1.0}}]}}"
    rest = ", velocities: [0, 0]"
    for more, quarter in (
        ("", 0.25),
        (rest + rest.replace("velocities", "accelerations"), 0.103516),
    ):
        nested = '{"trajectory": ' + point.format(more) + "}"
        found = targets(tmp_path, "t.yaml", nested)
        assert found.position[found.newest(np.array(0.25)), 0] == pytest.approx(quarter, abs=1e-6)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("a: 1", "has no message with joint positions"),
        ("{joint_names: [a], points: []}", "points: must be a list of mappings"),
        (
            "{joint_names: [shoulder, elbow], points: [{positions: [1]}]}",
            "point 1: must have 2 positions, one per joint",
        ),
        (
            "{joint_names: [hip, knee], points: [{positions: [1, 2]}]}",
            "must name the 2 joints, shoulder, elbow; it may be hip, knee",
        ),
        (
            "{joint_names: [sholder, elbow], points: [{positions: [1, 2]}]}",
            "has no joint shoulder; nearest: sholder",
        ),
        (
            "{joint_names: [elbow, elbow], points: [{positions: [1, 2]}]}",
            "joint_names: elbow is given twice",
        ),
        ("name: [elbow, elbow]\nposition: [1, 2]", "name: elbow is given twice"),
        (
            "{joint_names: [shoulder, elbow], points: [{positions: [1, x]}]}",
            "point 1: positions of elbow: must be a finite decimal number, not 'x'",
        ),
        (
            "{joint_names: [shoulder, elbow], points: [{positions: [1, 2]}, {positions: [.nan, 2], "
            "time_from_start: 1}]}",
            "point 2: positions of shoulder: must be a finite number, not nan",
        ),
        ("name: [a, b]\nposition: [1, .nan]", "position of b: must be a finite number, not nan"),
        (
            "{joint_names: [shoulder, elbow], points: [{positions: [1, 2], velocities: [1]}]}",
            "point 1: must have 2 velocities, one per joint",
        ),
        (
            "{joint_names: [shoulder, elbow], points: [{positions: [1, 2], effort: [1]}]}",
            "point 1: must have 2 effort, one per joint",
        ),
        (
            "{joint_names: [shoulder, elbow], points: [{positions: [1, 2]}, {positions: [1, 3]}]}",
            "points: have no times; give targets.period, the time between two",
        ),
        (
            "{joint_names: [shoulder, elbow], points: [{positions: [1, 2], time_from_start: 1}, "
            "{positions: [1, 3], time_from_start: 0.5}]}",
            "point 2: its time must be after that before it, not 0.5 s",
        ),
        (
            "{joint_names: [shoulder], points: [{positions: [1], time_from_start: -1}]}",
            "point 1: its time must be 0 or later, not -1 s",
        ),
        ("name: [a]\nposition: [1, 2]", "a message has 1 name and 2 positions"),
    ],
)
def test_what_is_no_trajectory_is_refused(tmp_path, content, said):
    with pytest.raises(InvalidInputError) as caught:
        targets(tmp_path, "t.yaml", content)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("first", "second", "told"),
    [
        ("effort: [1, 2]", "effort: [1, 2]", "effort"),
        ("velocities: [0, 0]", "velocities: []", "velocities"),
        ("accelerations: [0, 0]", "accelerations: [0, 0]", "accelerations"),
        ("velocities: []", "effort: []", None),
    ],
)
def test_what_points_have_in_vain_is_told(tmp_path, first, second, told):
    found = targets(
        tmp_path,
        "t.yaml",
        f"{{joint_names: [shoulder, elbow], points: [{{positions: [0, 0], {first}, "
        f"time_from_start: 0}}, {{positions: [1, 1], {second}, time_from_start: 1}}]}}",
    )
    assert found.notes == (
        () if told is None else (f"targets: t.yaml: {told} of its points: ignored",)
    )


def test_joint_states_of_rostopic_are_rows(tmp_path):
    one = "header: {{stamp: {{secs: 1620000000, nsecs: {0}}}}}\nname: [elbow, shoulder]\n"
    one += "position: [{2}, {1}]\n---\n"
    parts = (one.format(int(1e9 * t), *q) for t, q in zip(TIMES, POSITION.tolist(), strict=True))
    other = "name: [finger]\nposition: [0.01]\nheader: {stamp: {secs: 1620000000, nsecs: 3}}\n"
    found = targets(tmp_path, "s.yaml", "".join(parts) + other)
    np.testing.assert_allclose(found.time, TIMES, atol=1e-6)
    np.testing.assert_array_equal(found.position, POSITION)
    assert "1 message without all joints: ignored" in found.notes[0]


def written_mcap(file, encoding):
    """Joint states of 2021 with a finger, those of a gripper, and pictures."""
    writing = pytest.importorskip("mcap.writer")
    with file.open("wb") as stream:
        writer = writing.Writer(stream)
        writer.start()
        channels = {}
        for topic, kind in (("/joint_states", "sensor_msgs/msg/JointState"), ("/image", "I")):
            schema = writer.register_schema(kind, "jsonschema", b"{}")
            channels[topic] = writer.register_channel(topic, encoding, schema)
        for t, (a, b) in zip(EPOCH, POSITION.tolist(), strict=True):
            for names, position in ((["elbow", "shoulder"], [b, a]), (["finger"], [0.0])):
                data = json.dumps({"name": names, "position": position}).encode()
                when = round(1e9 * t)
                writer.add_message(channels["/joint_states"], when, data, when)
            writer.add_message(channels["/image"], when, b"?", when)
        writer.finish()


def test_joint_states_in_an_mcap_file_of_json(tmp_path):
    written_mcap(tmp_path / "r.mcap", "json")
    found = targets(tmp_path, "r.mcap", None)
    np.testing.assert_allclose(found.time, TIMES, atol=1e-6)
    np.testing.assert_array_equal(found.position, POSITION)
    told = "the topic is /joint_states; its times since 1970 begin at 0 here; "
    assert found.notes == (f"targets: r.mcap: {told}3 messages without all joints: ignored",)


@pytest.mark.parametrize(
    ("fields", "encoding", "said"),
    [
        ({"topic": "/image"}, "json", "topic: /image has messages I; sensor_msgs/JointState"),
        ({"topic": "/other"}, "json", "topic: no /other; there are ['/image', '/joint_states']"),
        ({}, "protobuf", "topic: /joint_states is encoded as protobuf; cdr of ROS 2 and json are"),
    ],
)
def test_a_topic_that_is_not_read_is_refused(tmp_path, fields, encoding, said):
    written_mcap(tmp_path / "r.mcap", encoding)
    with pytest.raises(InvalidInputError) as caught:
        targets(tmp_path, "r.mcap", None, **fields)
    assert said in str(caught.value)


def test_files_that_are_damaged_or_of_another_kind_are_refused(tmp_path):
    for name, said in (
        ("r.mcap", "cannot be read as MCAP: "),
        ("r.parquet", "cannot be read as Parquet: "),
        ("r.db3", "is a bag of ROS; convert it to MCAP"),
        ("r.json", "is no JSON: "),
        ("r.yaml", "is no YAML: line 1, column"),
    ):
        with pytest.raises(InvalidInputError, match=said):
            targets(tmp_path, name, "@ no {such file" * 9)


@pytest.mark.parametrize(
    ("name", "module"), [("r.mcap", "mcap.reader"), ("r.parquet", "pyarrow.parquet")]
)
def test_without_its_package_a_file_says_what_to_install(tmp_path, monkeypatch, name, module):
    (tmp_path / name).touch()
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InvalidInputError, match=r"targets.file: needs .* pip install '"):
        RecordedTargets(file=str(tmp_path / name))


def written_lerobot(folder, names=None):
    """Two episodes of a LeRobot data set, in degrees, with a gripper."""
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    rows = [[*q, 50.0] for q in np.degrees(POSITION).tolist()]
    table = {
        "action": rows + rows[::-1],
        "observation.state": [[9.0, 9.0, 9.0]] * 6,
        "timestamp": arrow.array(TIMES * 2, arrow.float32()),
        "episode_index": [3] * 3 + [4] * 3,
        "task": ["pick"] * 6,
    }
    file = folder / "data" / "chunk-000" / "file-000.parquet"
    file.parent.mkdir(parents=True)
    parquet.write_table(arrow.table(table), file)
    if names:
        (folder / "meta").mkdir()
        features = {"action": {"dtype": "float32", "shape": [3], "names": names}}
        (folder / "meta" / "info.json").write_text(json.dumps({"features": features}))
    return "data/chunk-000/file-000.parquet"


def test_actions_of_an_episode_of_lerobot(tmp_path):
    names = {"motors": ["shoulder.pos", "elbow.pos", "gripper.pos"]}
    name = written_lerobot(tmp_path, names)
    found = targets(tmp_path, name, None, angles="degrees")
    np.testing.assert_allclose(found.time, TIMES, atol=1e-6)
    np.testing.assert_allclose(found.position, POSITION, atol=1e-15)
    assert "file-000.parquet: of 2 episodes, 3 is read; the joints are action.sh" in found.notes[0]
    assert "action.gripper.pos, " in found.notes[0]
    other = targets(tmp_path, name, None, angles="degrees", episode=4)
    np.testing.assert_allclose(other.position, POSITION[::-1], atol=1e-15)
    with pytest.raises(InvalidInputError, match="episode: no 7; there are 3 to 4"):
        targets(tmp_path, name, None, episode=7)


def test_actions_without_names_are_the_first_entries_if_a_key_says_so(tmp_path):
    name = written_lerobot(tmp_path)
    with pytest.raises(InvalidInputError, match="must have the columns t"):
        targets(tmp_path, name, None)
    found = targets(tmp_path, name, None, columns="action", angles="degrees")
    np.testing.assert_allclose(found.position, POSITION, atol=1e-15)


UNITS = ["rad", "m"]


def of_kinds(tmp_path, head, row, **fields):
    """Targets of a joint that turns and one that slides."""
    file = tmp_path / "k.csv"
    file.write_text(f"{head}\n{row}\n")
    return RecordedTargets(file=str(file), **fields).of_arm(JOINTS, UNITS)


@pytest.mark.parametrize(
    ("head", "row", "columns"),
    [
        ("t,shoulder [deg],elbow [mm]", "0,90,250", None),
        ("t_ms,shoulder_rev,elbow_cm", "0,0.25,25", None),
        ("t,q1 [mrad],q2 [m]", f"0,{500 * np.pi},0.25", None),
        ("t [s],q1 [turns],q2_m", "0,0.25,0.25", None),
        ("t,q1 [A],q2 [A],q1 [deg],q2 [mm]", "0,3,3,90,250", None),
        ("t,a [deg],b [mm]", "0,90,250", ["a [deg]", "b [mm]"]),
        ("t,q1,q2", f"0,{np.pi / 2},0.25", None),
    ],
)
def test_units_are_those_of_what_a_joint_does(tmp_path, head, row, columns):
    found = of_kinds(tmp_path, head, row, columns=columns)
    np.testing.assert_allclose(found.position, [[np.pi / 2, 0.25]], atol=1e-12)


@pytest.mark.parametrize(
    ("head", "said"),
    [
        (f"t,shoulder [{unit}],elbow", f"column shoulder [{unit}]: '{unit}' is no unit of an angle")
        for unit in ("rad/s", "A", "N m", "counts", "mm", "s", "deg/s", "V", "%", "raw")
    ]
    + [
        (f"t,q1,q2 [{unit}]", f"column q2 [{unit}]: '{unit}' is no unit of a length; it may be m,")
        for unit in ("deg", "rad", "rev", "m/s", "N", "inch")
    ]
    + [
        ("t,q1_A,q2_A", "column q1_A: 'A' is no unit of an angle; it may be rad, mrad, deg or rev"),
        ("t,q1_Nm,q2_N", "column q1_Nm: 'Nm' is no unit of an angle"),
        ("t,q1_rpm,q2_m", "column q1_rpm: 'rpm' is no unit of an angle"),
        ("t,shoulder_ms,elbow", "column shoulder_ms: 'ms' is no unit of an angle"),
        ("t,q1_deg,q2_deg", "column q2_deg: 'deg' is no unit of a length"),
        ("t [deg],q1,q2", "column t [deg]: 'deg' is no unit of a time; it may be s, ms, us or ns"),
        ("time_mm,q1,q2", "column time_mm: 'mm' is no unit of a time"),
        ("timestamp [h],q1,q2", "column timestamp [h]: 'h' is no unit of a time"),
        ("t,q1 [rad],q2,q1 [deg]", "columns: must be given, as q1 may be q1 [rad] or q1 [deg]"),
    ],
)
def test_a_unit_of_something_else_is_refused_with_its_column(tmp_path, head, said):
    with pytest.raises(InvalidInputError) as caught:
        of_kinds(tmp_path, head, ",".join(["0.1"] * len(head.split(","))))
    assert said in str(caught.value)


TOOL = ["x", "y", "z", "roll", "pitch", "yaw", "gripper"]
#: Names of actions that move a tool, as data sets have them.
MOTIONS = {
    "a pose": TOOL,
    "a motion": [f"delta_{name}" for name in TOOL],
    "small letters": ["dx", "dy", "dz", "droll", "dpitch", "dyaw", "grip"],
    "LeRobot's kinematics": [*(f"ee.{n}" for n in ("x", "y", "z", "wx", "wy", "wz")), "ee.gripper"],
    "a rotation vector": ["eef_pos_x", "eef_pos_y", "eef_pos_z", "rx", "ry", "rz", "gripper"],
    "camel case": ["PosX", "PosY", "PosZ", "RotX", "RotY", "RotZ", "Gripper"],
    "by place": {name: k for k, name in enumerate(TOOL)},
    "by part": {"arm": TOOL[:6], "gripper": ["gripper"]},
    "differences of joints": [f"delta_joint_{k}" for k in range(7)],
}


def written_actions(folder, names, rows=None, width=7, **info):
    """A LeRobot data set whose actions have names."""
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    rows = [[0.1] * width] * 3 if rows is None else rows
    (folder / "meta").mkdir()
    features = {"action": {"dtype": "float32", "shape": [width], "names": names}}
    (folder / "meta" / "info.json").write_text(json.dumps({"features": features, **info}))
    # What is measured of the joints is beside it, as in all of LeRobot's data sets.
    measured = {f"observation.{name}": [[0.2] * 7] * 3 for name in ("state", "effort")}
    table = {"action": rows, **measured, "timestamp": TIMES, "frame_index": [0, 1, 2]}
    parquet.write_table(arrow.table(table), folder / "e.parquet")
    return "e.parquet"


SEVEN = [f"joint{k}" for k in range(1, 8)]


@pytest.mark.parametrize("names", MOTIONS.values(), ids=MOTIONS)
@pytest.mark.parametrize("columns", [None, "action"])
def test_a_motion_of_the_tool_is_never_taken_for_joints(tmp_path, names, columns):
    """Though there are as many entries as joints, and their list is asked for by its name."""
    name = written_actions(tmp_path, names)
    with pytest.raises(InvalidInputError) as caught:
        targets(tmp_path, name, None, joints=SEVEN, columns=columns)
    inner = list(names) if not (isinstance(names, dict) and "arm" in names) else TOOL
    assert f"action.{inner[0]}, action.{inner[1]}" in str(caught.value)
    assert "drake-rnn shield follows poses, by x, y, z, qw, qx, qy, qz" in str(caught.value)


def test_names_of_joints_stay_joints_and_those_of_another_arm_are_told(tmp_path):
    lerobot = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]
    name = written_actions(tmp_path, [f"{each}.pos" for each in (*lerobot, "gripper")], width=6)
    found = targets(tmp_path, name, None, joints=lerobot)
    assert found.position.shape == (3, 5)
    assert targets(tmp_path, name, None, joints=SEVEN[:6]).position.shape == (3, 6)
    (tmp_path / "other").mkdir()
    name = written_actions(tmp_path / "other", ["waist", "arm", "fore", "wrist", "a", "b", "hand"])
    said = "columns: must be given, as the entries of action, waist, arm, .* in this order"
    with pytest.raises(InvalidInputError, match=said):
        targets(tmp_path / "other", name, None, joints=SEVEN)
    found = targets(tmp_path / "other", name, None, joints=SEVEN, columns="action")
    assert found.position.shape == (3, 7)
    turns = ["base_yaw", "arm_pitch", "hand_pitch", "hand_roll"]
    found = targets(
        tmp_path, "w.csv", f"t,{','.join(turns)}\n0,1,2,3,4\n", SEVEN[:4], columns=turns
    )
    assert found.position.tolist() == [[1.0, 2.0, 3.0, 4.0]]
    # An axis may be the name of a joint.
    gantry = targets(tmp_path, "g.csv", "t,x.pos,y.pos,z.pos\n0,1,2,3\n", joints=["x", "y", "z"])
    assert gantry.position.tolist() == [[1.0, 2.0, 3.0]]


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (SEVEN[:5], "column action: has 7 entries, and meta/info.json names 5"),
        (7, None),
        (["actions"], None),
    ],
)
def test_names_that_are_not_those_of_all_entries_are_refused(tmp_path, names, said):
    name = written_actions(tmp_path, names)
    if said is None:
        assert targets(tmp_path, name, None, joints=SEVEN).position.shape == (3, 7)
        return
    with pytest.raises(InvalidInputError, match=said):
        targets(tmp_path, name, None, joints=SEVEN)


def test_what_a_data_set_says_beside_its_data_must_be_read(tmp_path):
    name = written_actions(tmp_path, SEVEN)
    (tmp_path / "meta" / "info.json").write_text("{fps: ")
    with pytest.raises(InvalidInputError, match=r"meta/info.json: Expecting property name"):
        targets(tmp_path, name, None, joints=SEVEN)


POINTS = """joint_names: [elbow, shoulder], points: [{positions: [-0.2, 0.1], time_from_start:
 {sec: 0}}, {positions: [-0.4, 0.3], time_from_start: {sec: 1, nanosec: 0}}]"""
EMPTY = "{header: {stamp: {sec: 0}}, joint_names: [], points: []}"
STATE = "{joint_state: {name: [shoulder, elbow], position: [9, 9]}, is_diff: false}"
TOLERANCES = "[{name: shoulder, position: 0.1, velocity: 0, acceleration: 0}]"
#: Messages of MoveIt and of ros2_control round one trajectory, and what is told.
ROUND_ONE = {
    "RobotTrajectory": (
        f"joint_trajectory: {{{POINTS}}}\nmulti_dof_joint_trajectory: {EMPTY}",
        "",
    ),
    "DisplayTrajectory": (
        f"model_id: arm\ntrajectory: [{{joint_trajectory: {{{POINTS}}}, "
        f"multi_dof_joint_trajectory: {EMPTY}}}]\ntrajectory_start: {STATE}",
        "trajectory_start",
    ),
    "MotionPlanResponse": (
        f"trajectory_start: {STATE}\ntrajectory: {{joint_trajectory: {{{POINTS}}}}}",
        "trajectory_start",
    ),
    "FollowJointTrajectory": (
        f"goal: {{trajectory: {{{POINTS}}}, path_tolerance: {TOLERANCES}, goal_tolerance: []}}",
        "path_tolerance",
    ),
}


@pytest.mark.parametrize(("content", "told"), ROUND_ONE.values(), ids=ROUND_ONE)
def test_the_trajectory_in_a_message_is_followed(tmp_path, content, told):
    found = targets(tmp_path, "m.yaml", content)
    np.testing.assert_allclose(found.position[[0, -1]], [[0.1, -0.2], [0.3, -0.4]])
    assert found.notes == ((f"targets: m.yaml: {told}: ignored",) if told else ())


def test_a_trajectory_of_frames_is_refused(tmp_path):
    frames = "multi_dof_joint_trajectory: {joint_names: [base], points: [{transforms: []}]}"
    with pytest.raises(InvalidInputError, match="multi_dof_joint_trajectory: poses of frames are"):
        targets(tmp_path, "m.yaml", f"joint_trajectory: {{{POINTS}}}\n{frames}")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("t.yaml", "{joint_names: [shoulder], points: [{positions: [1]}]}"),
        ("s.yaml", "name: [shoulder, finger]\nposition: [1, 2]"),
        ("c.csv", "t,shoulder,finger\n0,1,2\n"),
    ],
)
def test_targets_of_some_joints_say_that_all_are_needed(tmp_path, name, content):
    said = "elbow; it may be|elbow; nearest"
    with pytest.raises(InvalidInputError, match=said) as caught:
        targets(tmp_path, name, content)
    assert "; all 2 joints are needed; one that is to stand still is given its place" in str(
        caught.value
    )


def test_arrays_of_numpy_are_times_and_rows(tmp_path):
    file = tmp_path / "r.npz"
    np.savez(file, timestamp=np.array(EPOCH), q=POSITION, velocity=9.0 * POSITION)
    found = targets(tmp_path, "r.npz", None)
    np.testing.assert_allclose(found.time, TIMES, atol=1e-6)
    np.testing.assert_array_equal(found.position, POSITION)
    np.savez(file, **{"t": np.array(TIMES), "q [deg]": np.degrees(POSITION)})
    np.testing.assert_allclose(targets(tmp_path, "r.npz", None).position, POSITION, atol=1e-15)
    for arrays, said in (
        ({"t": np.array(TIMES), "q": POSITION[:2]}, "must hold times and rows of positions"),
        ({"t": np.array(TIMES), "q": np.zeros((3, 2, 2))}, r"not t \(3,\), q \(3, 2, 2\)"),
        ({"q": POSITION}, "has no column of times"),
        ({"t": np.array([0.0, np.nan, 1.0]), "q": POSITION}, "row 2: t is no finite number"),
        ({"t": np.array(TIMES), "q [A]": POSITION}, "'A' is no unit of an angle"),
        ({"t": np.array(TIMES), "q": np.array(["a"] * 3)}, "q must hold numbers"),
        ({}, "not nothing"),
    ):
        np.savez(file, **arrays)
        with pytest.raises(InvalidInputError, match=said):
            targets(tmp_path, "r.npz", None)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("a.script", "is a program of Universal Robots; record the joints that it moves, by RTDE"),
        (
            "a.hdf5",
            r"is HDF5, as ALOHA and robomimic write it; save times and positions by numpy\.",
        ),
        ("a.h5", "is HDF5"),
        ("a.pkl", "is not read; save times and positions by"),
        ("a.src", r"is a program of KUKA; give its points as CSV, with columns x \[mm\]"),
        ("a.dxf", r"is a drawing of a CAD program; save it as SVG, .* path: \{kind: svg\}"),
    ],
)
def test_a_file_of_another_format_says_what_to_do(tmp_path, name, said):
    (tmp_path / name).write_bytes(b"\x89HDF\r\n")
    for make in (
        lambda file: RecordedTargets(file=file),
        lambda file: Waypoints(file=file),
        lambda file: Svg(file=file, size=0.1, period=1.0),
    ):
        with pytest.raises(InvalidInputError, match=said):
            make(str(tmp_path / name)).placed(np.zeros(3), np.eye(3))


LEROBOT = "t,shoulder.pos,elbow.pos,gripper.pos\n"


@pytest.mark.parametrize(
    ("content", "fields", "is_doubted"),
    [
        (LEROBOT + "0,-60.5,58,12\n", {}, True),
        (LEROBOT + "0,-60.5,58,12\n", {"angles": "degrees"}, True),
        (LEROBOT + "0,-100,100,0\n", {"angles": "degrees"}, True),
        ("t,q1,q2\n0,-100,99.9\n", {"angles": "degrees"}, True),
        (LEROBOT + "0,-60.5,100.5,12\n", {"angles": "degrees"}, False),
        (LEROBOT + "0,1.5,-3,12\n", {}, False),
        ("t,shoulder.pos [deg],elbow.pos [deg]\n0,-60.5,58\n", {}, False),
        ("t,q1,q2\n0,-90,45\n", {"angles": "degrees"}, False),
    ],
)
def test_numbers_that_may_be_ends_of_a_range_are_doubted(tmp_path, content, fields, is_doubted):
    notes = " ".join(targets(tmp_path, "n.csv", content, **fields).notes)
    assert (
        "within -100 to 100, which may be the ends of each joint's range" in notes
    ) == is_doubted


@pytest.fixture(scope="module")
def run():
    changes = {"duration": 0.3, "window": None, "accept": None}
    return simulate(load_experiment("stream_guarded", changes))


@pytest.mark.parametrize("form", ["csv", "parquet", "mcap", "trajectory"])
def test_what_a_run_exports_is_followed_in_another_run(run, tmp_path, form):
    file = export(run, tmp_path, form)
    changes = {"targets": {"file": str(file)}, "duration": 0.1, "window": None, "accept": None}
    experiment = load_experiment("stream_guarded", changes)
    for t, q in zip(run.time, run.series["position"], strict=True):
        sent = experiment.targets.position[experiment.targets.newest(np.array(t))]
        np.testing.assert_allclose(sent, q, atol=1e-9)
    assert simulate(experiment).metrics["target_error_max_rad"] < 0.1


def test_times_that_are_not_in_the_run_and_degrees_are_told(tmp_path):
    document = {"duration": 1.0, "window": None, "accept": None}
    columns = ",".join(f"q{k}" for k in range(1, 8))
    rows = "\n".join(f"{t},0,-45,0,-135,0,90,{45 + t % 1}" for t in (5000.25, 5000.5))
    (tmp_path / "r.csv").write_text(f"t,{columns}\n{rows}\n")
    given = {**document, "targets": {"file": str(tmp_path / "r.csv")}}
    with pytest.raises(InvalidInputError) as caught:
        load_experiment("stream_guarded", given)
    assert str(caught.value) == (
        "targets: none that is followed comes within the duration, 1 s; their times are 5000.25 "
        "to 5000.5 s; targets.begin: 5000.25 begins there"
    )
    given["targets"]["begin"] = 5000.25
    told = load_experiment("stream_guarded", given).warnings
    assert any(
        each.endswith("; for degrees give targets.angles: degrees, or [deg] in columns' names")
        for each in told
    )
    given["targets"]["angles"] = "degrees"
    assert not load_experiment("stream_guarded", given).warnings
