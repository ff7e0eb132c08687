"""Recordings of joint positions as other tools write them, and what is said of the rest."""

import json
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drake_rnn import InvalidInputError, load_experiment, simulate
from drake_rnn.exports import export
from drake_rnn.paths import RecordedTargets

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
