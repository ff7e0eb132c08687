"""`drake-rnn shield`: what a recorded stream asks for, and what a guard makes of it."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from cli_helpers import call, sentence

from browsing import ask, open_page
from drake_rnn import InvalidInputError, JointLimits, Result, load_arm
from drake_rnn.cli.shielding import _source, _stream
from drake_rnn.diagrams import EXPERIMENTS
from drake_rnn.live.play import LiveScene
from drake_rnn.live.session import Session
from drake_rnn.models import MODELS
from drake_rnn.paths.joint_targets import RecordedTargets
from drake_rnn.paths.recordings import TARGET_KINDS
from drake_rnn.shield.report import look_ahead, report_stream
from drake_rnn.shield.report import rows_of as report_rows

OPERATOR = EXPERIMENTS / "joint_stream" / "operator.csv"
BALL = "obstacles=[{kind: ball, center: [0.307, -0.24, 0.59], radius: 0.04, name: on the way}]"
LIMITS = "limits={velocity: 0.8, acceleration: 3.0, jerk: 60.0}"


@pytest.mark.long
def test_it_says_what_would_have_stopped_the_robot_and_commands_none_of_it(tmp_path):
    options = ("--set", LIMITS, "--set", BALL, "--set", "duration=5", "--period", "8e-3")
    pictures = ("--no-figures", "--no-playback")
    result = call("shield", OPERATOR, "--out", tmp_path, *options, *pictures)
    assert result.exit_code == 0, result.stderr
    assert "velocity, acceleration, jerk, contact would have stopped the robot" in result.stdout
    report = json.loads((tmp_path / "operator" / "stream.json").read_text())
    assert [use["is_broken"] for use in report["source"]] == [False, True, True, True]
    assert not any(use["is_broken"] for use in report["command"])
    assert report["source_nearest"]["distance"] < 0.0
    assert "on the way" in report["source_nearest"]["pair"]
    assert report["command_nearest"]["distance"] >= 0.005
    assert report["invalid"] > 0
    assert "promise   " in result.stdout
    assert {"jerk", "distance"} <= {each["name"] for each in report["promises"] if each["met"]}
    assert "limits    panda_joint" in result.stdout
    by = report["shield"]["by"]
    assert any("on the way" in name for name in by)
    assert max(by.values()) <= report["shield"]["intervened"] <= report["shield"]["duration"]
    first = {use["name"]: use["first"] for use in report["source"]}
    assert first["position"] is None
    assert 0.0 < first["velocity"] < 5.0
    assert 0.0 < first["acceleration"] < 5.0
    series = Result.load(tmp_path / "operator").series
    away = np.abs(series["position_wanted"] - series["position"]).max(axis=1)
    assert away.max() == pytest.approx(report["shield"]["largest_deviation"], rel=0.02)
    assert set(np.unique(series["limit_at_work"])) <= set(range(-4, 5))


PANDA = load_arm("panda")
NAMES, HOME = list(PANDA.joints), PANDA.home


def rows_of(head, rows):
    """Text of a CSV file."""
    return "\n".join([",".join(head), *(",".join(f"{x!r}" for x in row) for row in rows)]) + "\n"


def chunk_rows(count=4, size=8):
    """Rows of chunks: each comes 0.05 s after its first target, and lasts 0.2 s beyond the next."""
    turn = np.eye(7)[0]
    for k in range(count):
        for m in range(size):
            t = 0.2 * k + 0.05 * m
            yield [t, k, 0.2 * k + 0.05, *map(float, HOME + 0.4 * np.sin(t) * turn)]


CHUNKED = ["t", "chunk", "issued", *NAMES]


def test_chunks_are_followed_as_a_shield_follows_them(tmp_path):
    """What the shield commands is what the run of its targets commands."""
    file = tmp_path / "policy.csv"
    file.write_text(rows_of(CHUNKED, chunk_rows()))
    options = ("--set", LIMITS, "--set", "shield.switch=now", "--period", "5e-3")
    result = call("shield", file, "--out", tmp_path, *options, "--no-figures", "--no-playback")
    assert result.exit_code == 0, result.stderr
    assert "32 in 4 chunks" in result.stdout
    report = json.loads((tmp_path / "policy" / "stream.json").read_text())
    assert (report["chunks"], report["kind"]) == (4, "positions")
    run = Result.load(tmp_path / "policy")
    assert not any(use["is_broken"] for use in report["command"])
    away = np.abs(run.series["position_wanted"] - run.series["position"]).max()
    # A command is reached a period later, at up to 0.8 rad/s.
    assert away == pytest.approx(report["shield"]["largest_deviation"], abs=0.8 * 5e-3)
    assert away < 0.06
    assert run.series["position"][-1, 0] - HOME[0] == pytest.approx(0.4 * np.sin(0.95), abs=1e-3)


@pytest.mark.long
def test_the_playback_shows_what_the_source_wants_and_what_holds_the_arm_back(tmp_path, browser):
    """Each frame has the ghost where it is wanted; at 0.1 s the jerk or the acceleration holds."""
    file = tmp_path / "policy.csv"
    file.write_text(rows_of(CHUNKED, chunk_rows()))
    result = call(
        "shield", file, "--out", tmp_path, "--set", LIMITS, "--period", "5e-3", "--no-figures"
    )
    assert result.exit_code == 0, result.stderr
    open_page(browser, tmp_path / "policy" / "playback.html")
    assert "wanted by the source" in ask(browser, "document.getElementById('legend').textContent")

    def seen(t):
        ask(browser, f"playback.seek({t})")
        return ask(browser, "document.getElementById('held').textContent")

    text = seen(0.15)
    assert text.startswith("held back: ")
    assert "of joint 1" in text
    assert seen(1.9) == ""


def stream_of(file, **options):
    """The arguments of the command for a file."""
    changes = [f"{LIMITS}", *options.pop("changes", ())]
    return SimpleNamespace(
        file=file, arm="panda", frame=None, period=5e-3, changes=changes, **options
    )


@pytest.mark.long
def test_the_live_page_shows_the_ghost_and_what_is_ahead(tmp_path):
    """A ball stands where joint 1 is led to; the arm that runs is held back as the record says."""
    turned = HOME + 0.38 * np.eye(7)[0]
    center = np.round(PANDA.kinematics().p_WE(turned), 4).tolist()
    ball = f"obstacles=[{{kind: ball, center: {center}, radius: 0.03, name: lamp}}]"
    file = tmp_path / "policy.csv"
    file.write_text(rows_of(CHUNKED, chunk_rows()))
    with _stream(_source(stream_of(file, changes=[ball]))) as stream:
        experiment, record = stream.experiment, stream.record
        arm = PANDA.kinematics(), experiment.limits
        ahead = look_ahead(record, 0.3, arm, experiment.clearance)
        assert "in lamp" in ahead.first
        assert ahead.broken.any()
        assert not ahead.broken[0]
        np.testing.assert_allclose(ahead.p_WE[0], arm[0].p_WE(record.wanted_at(0.3)), atol=5e-3)
        session = Session(experiment, obstacle_speed=0.0)
        scene = LiveScene(session.experiment, "localhost", lambda: record)
        for _ in range(35):
            session.advance()
            scene.show(session, [0.0, session.time, 1.0, 0.0])
        q, k = session.position(), round(session.time / 5e-3)
        np.testing.assert_allclose(q, record.command[k - 1], atol=1e-9)
        np.testing.assert_array_equal(session.last_step.causes.limits, record.limits[k - 1])
        away = arm[0].p_WE(q) - arm[0].p_WE(record.wanted_at(session.time))
        assert scene.numbers(session)["position_error"] == pytest.approx(np.linalg.norm(away))


def calls_in(tmp_path, name, text, **options):
    """What a file says that a source gave a Panda."""
    file = tmp_path / name
    file.write_text(text if isinstance(text, str) else json.dumps(text))
    recorded = RecordedTargets(file=str(file), **options)
    return recorded.calls(PANDA.joints, PANDA.units, HOME)[0]


POSE = [0.3, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0]


def test_velocities_poses_twists_and_chunks_are_told_by_their_columns(tmp_path):
    rows = [[0.1 * k, *map(float, 0.1 * np.arange(7))] for k in range(3)]
    for head in (["t", *(f"{n}_velocity" for n in NAMES)], ["t", *(f"v{k}" for k in range(1, 8))]):
        calls = calls_in(tmp_path, "v.csv", rows_of(head, rows))
        assert [call.kind for call in calls] == 3 * ["velocities"]
        np.testing.assert_allclose(calls[1].values, [rows[1][1:]])
    degrees = calls_in(
        tmp_path, "v.csv", rows_of(["t", *(f"dq{k} [deg/s]" for k in range(7))], rows)
    )
    np.testing.assert_allclose(degrees[0].values, np.deg2rad([rows[0][1:]]))
    tool = ["t", "x [mm]", "y [mm]", "z [mm]", "qw", "qx", "qy", "qz"]
    (pose,) = calls_in(tmp_path, "p.csv", rows_of(tool, [[0.5, 300.0, 0.0, 500.0, 1, 0, 0, 0]]))
    assert (pose.time, pose.kind) == (0.5, "poses")
    np.testing.assert_allclose(pose.values, [POSE])
    (twist,) = calls_in(tmp_path, "w.csv", "t,wx,wy,wz,vx,vy,vz\n0,0,0,1,0.1,0,0\n")
    assert twist.kind == "twists"
    np.testing.assert_allclose(twist.values, [[0, 0, 1, 0.1, 0, 0]])
    chunks = calls_in(tmp_path, "c.csv", rows_of(CHUNKED, chunk_rows()))
    assert [len(call.times) for call in chunks] == 4 * [8]
    np.testing.assert_allclose([call.time for call in chunks], [0.05, 0.25, 0.45, 0.65])
    since_1970 = [[1.7e9 + row[0], row[1], 1.7e9 + row[2], *row[3:]] for row in chunk_rows()]
    later = calls_in(tmp_path, "e.csv", rows_of(CHUNKED, since_1970))
    np.testing.assert_allclose([call.time for call in later], [0.05, 0.25, 0.45, 0.65], atol=1e-6)
    record = {"t": 1.0, "rate": 20, "start": 0.9, "poses": [POSE, [None, *POSE[1:]]]}
    (call,) = calls_in(tmp_path, "p.json", [record])
    np.testing.assert_allclose(call.times, [0.9, 0.95])
    np.testing.assert_array_equal(np.isnan(call.values[:, 0]), [False, True])


def written_actions(folder, actions, names, nested=True, **info):
    """A LeRobot data set, with chunks of actions or one action a row."""
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    (folder / "meta").mkdir(exist_ok=True)
    stated = {"features": {"action": {"names": names}}, **info}
    (folder / "meta" / "info.json").write_text(json.dumps(stated))
    file = folder / "episode_000000.parquet"
    table = {"timestamp": [0.0, 0.1, 0.2], "action": actions, "episode_index": [0, 0, 0]}
    table["observation.state"] = [[0.2] * 7] * 3  # what is measured of the joints
    parquet.write_table(arrow.table(table), file)

    def read(**options):
        recorded = RecordedTargets(file=str(file), **options)
        return recorded.calls(PANDA.joints, PANDA.units, HOME)

    return read


CHUNKS = [np.tile(HOME + 0.01 * k, (16, 1)).tolist() for k in range(3)]


def test_chunks_of_actions_of_lerobot_are_read(tmp_path):
    calls, notes = written_actions(tmp_path, CHUNKS, None, fps=50)()
    assert [call.values.shape for call in calls] == 3 * [(16, 7)]
    np.testing.assert_allclose(calls[1].times, 0.1 + 0.02 * np.arange(16))
    assert "at 50 Hz" in notes[0]
    # Names decide which joint an entry is of, and what is of none is left out.
    others = [[[0.04, *row[::-1]] for row in chunk] for chunk in CHUNKS]
    names = ["gripper.pos", *(f"{name}.pos" for name in NAMES[::-1])]
    calls, _ = written_actions(tmp_path, others, {"motors": names}, fps=50)()
    np.testing.assert_allclose([call.values for call in calls], CHUNKS)


@pytest.mark.parametrize(
    "fps", [0, -30, "fast", "50", None, float("nan"), float("inf"), [30], True]
)
def test_a_rate_of_chunks_that_is_none_is_refused(tmp_path, fps):
    said = (
        "fps must be a number of frames a second, above 0, not" if fps is not None else "state fps"
    )
    with pytest.raises(InvalidInputError, match=said):
        written_actions(tmp_path, CHUNKS, None, fps=fps)()


def test_a_rate_that_is_none_is_refused_where_rows_have_times(tmp_path):
    rows = [HOME.tolist()] * 3
    with pytest.raises(InvalidInputError, match=r"meta/info.json: fps must be .* not 0"):
        written_actions(tmp_path, rows, None, fps=0)()
    assert len(written_actions(tmp_path, rows, None)()[0]) == 3


TOOL = ["delta_x", "delta_y", "delta_z", "delta_roll", "delta_pitch", "delta_yaw", "gripper"]


@pytest.mark.parametrize("names", [TOOL, ["x", "y", "z", "roll", "pitch", "yaw", "gripper"]])
@pytest.mark.parametrize("nested", [True, False])
@pytest.mark.parametrize("columns", [None, "action"])
def test_a_motion_of_the_tool_is_no_stream_of_joints(tmp_path, names, nested, columns):
    actions = CHUNKS if nested else [HOME.tolist()] * 3
    with pytest.raises(
        InvalidInputError, match="are by their names a pose or a motion of the"
    ) as e:
        written_actions(tmp_path, actions, names, fps=30)(columns=columns)
    assert names[0] in str(e.value)


def test_actions_that_are_whole_poses_are_followed_as_poses(tmp_path):
    """With a gripper, whose entry is left out; the real part is wherever it is named."""
    x, y, z, *wxyz = POSE
    actions = [[x, y, z, *wxyz[1:], wxyz[0], 0.04]] * 3
    names = ["x", "y", "z", "qx", "qy", "qz", "qw", "gripper"]
    calls, notes = written_actions(tmp_path, actions, names, fps=30)()
    assert [call.kind for call in calls] == ["poses"] * 3
    np.testing.assert_allclose(calls[2].values, [POSE])
    assert "action.gripper" in notes[0]
    chunks = [[row] * 4 for row in actions]
    calls, _ = written_actions(tmp_path, chunks, names, fps=30)()
    assert [(call.kind, call.values.shape) for call in calls] == [("poses", (4, 7))] * 3
    np.testing.assert_allclose(calls[0].values, [POSE] * 4)


def written_mcap(file, kind, contents):
    """A file of messages in JSON, one each 0.2 s of 2021."""
    writing = pytest.importorskip("mcap.writer")
    with file.open("wb") as stream:
        writer = writing.Writer(stream)
        writer.start()
        schema = writer.register_schema(kind, "jsonschema", b"{}")
        channel = writer.register_channel("/policy", "json", schema)
        for k, content in enumerate(contents):
            when = 1_620_000_000_000_000_000 + k * 200_000_000
            writer.add_message(channel, when, json.dumps(content).encode(), when)
        writer.finish()
    return RecordedTargets(file=str(file)).calls(PANDA.joints, PANDA.units, HOME)


def test_chunks_in_an_mcap_file_are_records_or_trajectories(tmp_path):
    """Of trajectories, joints have names, and points times after the stamp."""
    rows = [(HOME + 0.1 * k).tolist() for k in range(3)]
    record = {"start": 1.62e9 + 0.25, "rate": 20, "positions": [*rows, 7 * [None]]}
    calls, notes = written_mcap(tmp_path / "r.mcap", "drake_rnn/Chunk", [record])
    told = "the topic is /policy", "its times since 1970 begin at 0 here"
    assert notes == tuple(f"targets: r.mcap: {each}" for each in told)
    np.testing.assert_allclose(calls[0].times, 0.25 + 0.05 * np.arange(4), atol=1e-6)
    np.testing.assert_allclose(calls[0].values[:3], rows)
    poses, _ = written_mcap(tmp_path / "p.mcap", "drake_rnn/Chunk", [{"poses": POSE}] * 2)
    assert [(call.kind, round(call.time, 6)) for call in poses] == [("poses", 0.0), ("poses", 0.2)]
    stamp = {"stamp": {"sec": 1_620_000_000, "nanosec": 100_000_000}}
    points = [
        {"positions": row[::-1], "time_from_start": {"sec": 0, "nanosec": 50_000_000 * k}}
        for k, row in enumerate(rows)
    ]
    message = {"header": stamp, "joint_names": NAMES[::-1], "points": points}
    calls, _ = written_mcap(
        tmp_path / "t.mcap", "trajectory_msgs/msg/JointTrajectory", [message, message]
    )
    assert [round(each.time, 6) for each in calls] == [0.0, 0.2]
    for each in calls:
        np.testing.assert_allclose(each.times, 0.1 + 0.05 * np.arange(3), atol=1e-6)
        np.testing.assert_allclose(each.values, rows)


def test_chunks_that_come_too_late_are_told(tmp_path):
    """Two of four are 3 s old: the arm stays where the second one leads it."""
    rows = [[t, k, sent + 3.0 * (k > 1), *q] for t, k, sent, *q in chunk_rows()]
    file = tmp_path / "late.csv"
    file.write_text(rows_of(CHUNKED, rows))
    options = ("--set", LIMITS, "--set", "shield.switch=now", "--period", "5e-3")
    result = call("shield", file, "--out", tmp_path, *options, "--no-figures", "--no-playback")
    assert result.exit_code == 0, result.stderr
    assert "dropped   2 of 4 messages came more than 1 s after the last target" in result.stdout
    report = json.loads((tmp_path / "late" / "stream.json").read_text())
    assert (report["counts"]["chunks"], report["counts"]["expired"]) == (4, 2)
    last = max(t for t, k, *_ in chunk_rows() if k == 1)
    joint = Result.load(tmp_path / "late").series["position"][-1, 0] - HOME[0]
    assert joint == pytest.approx(0.4 * np.sin(last), abs=1e-3)


def with_entry(place, value):
    rows = list(chunk_rows())
    rows[11][place] = value
    return rows_of(CHUNKED, rows)


def of_unit(name):
    """A row of columns of all joints."""
    return rows_of(["t", *map(name.format, NAMES)], [[0] * 8])


def of_tool(kind, column):
    """A row of targets of the tool, of which a column is called differently, or there again."""
    names = list(TARGET_KINDS[kind])
    bare = column.split()[0]
    names = [column if name == bare else name for name in names]
    names += [] if column in names else [column]
    return rows_of(["t", *names], [[0.0] * (len(names) + 1)])


SIX = {"t": 0.0, "positions": [0.0] * 6}
BAD_FILES = [
    ("c.csv", with_entry(0, 0.2), "row 13: t must be greater than 0.3, that of the row before"),
    ("c.csv", with_entry(1, float("nan")), "target 12: its chunk is no number"),
    ("c.csv", with_entry(2, 0.0), "issued must not decrease, from 0.25 to 0 s"),
    ("c.csv", "t,chunk,q1,q2\n0,0,0,0\n", "must have the columns t, q1, q2, q3, q4, q5, q6, q7"),
    ("c.csv", rows_of(CHUNKED, chunk_rows()) + "1,2,3\n", "must have 10 entries, one per column"),
    ("p.csv", "t,x,y,z,qw,qx,qy\n0,0,0,0,1,0,0\n", "must have the columns qz too: poses are x, y"),
    ("p.csv", "t,x,y\n0,0,0\n", "must have the columns t, q1"),
    ("u.csv", of_unit("{} [rev/s]"), "column panda_joint1 [rev/s]: 'rev/s' is no unit of an angle"),
    ("u.csv", of_unit("{} [A]"), "column panda_joint1 [A]: 'A' is no unit of an angle; it may be"),
    ("u.csv", of_unit("{} [mm]"), "column panda_joint1 [mm]: 'mm' is no unit of an angle"),
    (
        "u.csv",
        of_unit("{}_velocity [rad]"),
        "'rad' is no unit of an angular velocity; it may be ra",
    ),
    ("u.csv", of_unit("{}_velocity [V]"), "'V' is no unit of an angular velocity"),
    ("u.csv", of_unit("{}_velocity [rad/s^2]"), "'rad/s^2' is no unit of an angular velocity"),
    ("u.csv", of_tool("poses", "x [deg]"), "column x [deg]: 'deg' is no unit of a length"),
    ("u.csv", of_tool("poses", "x [m/s]"), "column x [m/s]: 'm/s' is no unit of a length"),
    ("u.csv", of_tool("poses", "qw [rad]"), "column qw [rad]: 'rad' is no unit of a number"),
    ("u.csv", of_tool("twists", "wx [rad]"), "'rad' is no unit of an angular velocity"),
    ("u.csv", of_tool("twists", "vx [deg/s]"), "'deg/s' is no unit of a velocity; it may be m/s"),
    ("u.csv", of_unit("{}").replace("t,", "t [mm],"), "column t [mm]: 'mm' is no unit of a time"),
    ("u.csv", of_unit("{}").replace("t,", "t,issued [m],").replace("0,", "0,0,", 1), "of a time"),
    ("u.csv", of_unit("{}").replace("t,", "t,chunk [s],").replace("0,", "0,0,", 1), "of a number"),
    ("p.csv", of_tool("poses", "tx"), "has several columns of poses, ['x', 'tx', "),
    ("c.json", [SIX], "the positions at 0 s have 6 numbers each; must be 7"),
    ("c.json", [{"positions": [0.0] * 7}], "chunk 1: t: must be given"),
    ("c.json", [{"t": 0, "poses": [POSE, POSE[:6]]}], "row 2 has 6 numbers, and the first 7"),
    ("c.json", [{"t": 0, "poses": [POSE, POSE]}], "rate: must be given for 2 targets, or times"),
    ("c.json", [SIX | {"joints": NAMES[:6]}], "has no joint panda_joint7; nearest: panda_joint6"),
    ("c.json", [{"t": 0, "poses": POSE, "joints": NAMES}], "must be the names of the poses of joi"),
    ("c.json", [{"t": 0, "poses": [POSE], "hz": 3}], "no key hz; it may have t, start, rate"),
    ("c.json", [{"t": 0, "poses": POSE, "twists": POSE}], "has both poses and twists"),
    ("c.json", [{"t": 1, "poses": POSE}, {"t": 0, "poses": POSE}], "t must not decrease, from 1"),
    ("c.json", [{"t": 0, "poses": POSE}, {"t": 1, "positions": [0] * 7}], "must be of one kind"),
    ("c.json", [{"t": 0, "rate": 0.02, "poses": [POSE, POSE]}], "0.02, nor a time between two"),
    ("c.json", [{"t": 1.7e12, "poses": POSE}], "t must be in seconds, not 1.7e+12, which looks"),
    ("c.json", [{"t": 0, "positions": "home"}], "positions: must be a list of numbers"),
    ("c.json", [{"t": 0, "start": "soon", "poses": POSE}], "chunk 1: start: must be a finite"),
    ("c.json", [{"t": 0, "times": [0, 0], "poses": [POSE, POSE]}], "must be 2 times that increase"),
]


@pytest.mark.parametrize(("name", "text", "told"), BAD_FILES, ids=[each[2] for each in BAD_FILES])
def test_a_bad_file_is_refused_with_the_cause(name, text, told, tmp_path):
    with pytest.raises((InvalidInputError, ValueError)) as error:
        calls_in(tmp_path, name, text)
    assert told in str(error.value)


DEGREES = {"t": 0.0, "positions": np.rad2deg(HOME).tolist()}
MEANT_OTHERWISE = [
    (
        "c.json",
        [DEGREES],
        "c.json: at 0 s: q: 135 rad is no position of a joint; angles are in",
    ),
    (
        "c.json",
        [{"t": 0.0, "start": 1700.0, "rate": 20, "positions": [HOME.tolist()]}],
        "at 0 s: start: 1700 s is 1.7e+03 s from the time now, 0 s; must be on the same clock",
    ),
    (
        "c.json",
        [{"t": 0.0, "poses": [2.0, *POSE[1:]]}],
        "m from the tool, more than 0.5 m; positions are in metres",
    ),
    (
        "c.json",
        [
            {"t": 0.0, "rate": 20, "positions": [HOME.tolist()] * 2},
            {"t": 1e4, "positions": [0.0] * 6},
        ],
        "the positions at 10000 s have 6 numbers each; must be 7",
    ),
    (
        "c.json",
        [{"t": t, "rate": 20, "positions": [HOME.tolist()] * 300} for t in range(0, 600, 15)],
        "s are 120190 commands, more than 100000; give a longer --period, or targets.begin",
    ),
    (
        "q.csv",
        rows_of(["t", *NAMES], [[20.0 * k, *HOME.tolist()] for k in range(4)]),
        "its targets are 20 s apart, by the median; name the column of times t_ms if they are",
    ),
    (
        "late.csv",
        rows_of(CHUNKED, [[t, k, t_issued + 3.0, *q] for t, k, t_issued, *q in chunk_rows()]),
        "none can be followed: 4 of 4 messages came more than 1 s after the last target in it",
    ),
    (
        "nan.csv",
        rows_of(["t", *NAMES], [[0.1 * k, *[float("nan")] * 7] for k in range(4)]),
        "none can be followed: 4 of 4 messages had no row of numbers",
    ),
]


@pytest.mark.parametrize(
    ("name", "text", "told"), MEANT_OTHERWISE, ids=[each[2][:30] for each in MEANT_OTHERWISE]
)
def test_what_is_hardly_meant_is_refused_with_the_likely_mistake(name, text, told, tmp_path):
    file = tmp_path / name
    file.write_text(text if isinstance(text, str) else json.dumps(text))
    options = ("--set", LIMITS, "--period", "5e-3", "--set", "shield.switch=now")
    answer = call("shield", file, "--out", tmp_path, *options, "--no-figures", "--no-playback")
    assert told in sentence(answer)


def test_chunks_are_refused_where_single_targets_are_run(tmp_path):
    file = tmp_path / "policy.csv"
    file.write_text(rows_of(CHUNKED, chunk_rows()))
    with pytest.raises(InvalidInputError, match="has chunks of targets, which drake-rnn shield"):
        RecordedTargets(file=str(file)).of_arm(NAMES)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["/nowhere.csv"], "FILE: no file '/nowhere.csv'"),
        ([OPERATOR, "--arm", "pandora"], "arm: no arm 'pandora'"),
        ([OPERATOR, "--arm", "ur5"], "targets: file "),
        ([OPERATOR, "--set", "limits.jerk=-1"], "limits.jerk: "),
    ],
)
def test_what_it_cannot_read_is_refused(arguments, text, tmp_path):
    assert sentence(call("shield", *arguments, "--out", tmp_path)).startswith(text)


def test_a_stream_is_judged_as_it_would_be_commanded():
    """A joint that jumps by 0.1 rad in 0.1 s needs 1 rad/s, and 10 rad/s^2 to begin with it."""
    limits = JointLimits(
        position_lower=[-1.0], position_upper=[1.0], velocity=[0.5], acceleration=[20.0]
    )
    t = 0.1 * np.arange(4)
    q = np.array([[0.0], [0.0], [0.1], [0.1]])
    rest = (np.array([0.0, 0.3]), np.zeros((2, 1)))
    report = report_stream((t, q), rest, np.zeros(1), limits)
    uses = {use.name: use for use in report.source}
    assert uses["velocity"].largest == pytest.approx(2.0)
    assert uses["velocity"].at == pytest.approx(0.15)
    assert uses["acceleration"].largest == pytest.approx(0.5)
    assert report.would_trip == ("velocity",)
    assert report.rate == pytest.approx(10.0)
    assert report.stopped == pytest.approx(0.3)


def test_an_arm_that_starts_outside_and_is_brought_back_breaks_no_limit():
    """One that goes farther outside first, or leaves again, does."""
    limits = JointLimits(position_lower=[-1.0], position_upper=[1.0], velocity=[0.5])
    t, target = 0.1 * np.arange(5), (np.zeros(1), np.zeros((1, 1)))
    for way, is_broken, largest in (
        ([1.1, 1.08, 1.05, 1.0, 0.97], False, 0.0),
        ([1.1, 1.12, 1.08, 1.04, 1.0], True, 0.02),
        ([1.1, 1.05, 0.99, 1.03, 1.0], True, 0.03),
    ):
        q = np.array(way)[:, None]
        report = report_stream(target, (t, q), q[0], limits)
        position = report.command[0]
        assert (position.name, position.is_broken) == ("position", is_broken)
        assert position.largest == pytest.approx(largest, abs=1e-9)
        assert report.outside == pytest.approx(0.1)
        (cell,) = (row[2] for row in report_rows(report, ("a",)) if row[0] == "position")
        assert cell.startswith("kept") is not is_broken
    # A source that asks for what is outside is told so.
    outside = (np.zeros(1), np.full((1, 1), 1.1))
    report = report_stream(outside, (t, np.full((5, 1), 1.1)), np.full(1, 1.1), limits)
    assert "position" in report.would_trip


def test_ones_own_model_needs_its_frame_alone_and_begins_at_the_first_row(tmp_path):
    """The headline is what the stream would have done, not that the run came to its end."""
    model, start = MODELS / "panda" / "panda.urdf", HOME + 0.1
    rows = [[0.05 * k, *map(float, start + 0.02 * k)] for k in range(10)]
    file = tmp_path / "stream.csv"
    file.write_text(rows_of(["t", *(f"q{k}" for k in range(1, 8))], rows))
    plain = ("--out", tmp_path, "--no-figures", "--no-playback", "--period", "5e-3")
    lone = tmp_path / "mine.urdf"
    lone.write_text(model.read_text())
    told = sentence(call("shield", file, "--arm", lone, *plain))
    assert "arm.frame: must be given" in told
    assert "--frame" in told
    assert "start" in told
    result = call("shield", file, "--arm", lone, "--frame", "panda_link8", "--set", LIMITS, *plain)
    assert result.exit_code == 0, result.stderr
    run = Result.load(tmp_path / "stream")
    np.testing.assert_allclose(run.series["position"][0], start, atol=1e-12)
    assert "the stream would not have tripped the robot" in result.stdout
    # Degrees are told before a posture to start at is asked for.
    turns = [[t, *map(float, np.rad2deg(q))] for t, *q in rows]
    file.write_text(rows_of(["t", *(f"q{k}" for k in range(1, 8))], turns))
    told = sentence(call("shield", file, "--arm", lone, "--frame", "panda_link8", *plain))
    assert told.startswith("targets: begin with panda_joint")
    assert "for degrees give targets.angles" in told
    jump = [[0.0, *map(float, start)], [0.05, *map(float, start + 0.5)]]
    file.write_text(rows_of(["t", *(f"q{k}" for k in range(1, 8))], jump))
    # The frame by its key of the document.
    by_key = ("--set", "arm.frame=panda_link8", "--set", LIMITS)
    result = call("shield", file, "--arm", lone, *by_key, *plain)
    assert "the stream would have tripped the robot by velocity" in result.stdout
    # A file in another folder names a shield that a target is dragged for.
    told = call("shield", "--live", "--arm", lone, "--frame", "panda_link8", "--set", "start=[0]")
    assert sentence(told).startswith("start: ")


def test_records_of_single_positions_are_followed_in_the_order_of_their_names(tmp_path):
    """They were called chunks, by the very command that follows these."""
    file, plain = tmp_path / "calls.json", ("--no-figures", "--no-playback", "--period", "1e-2")
    target = HOME + 0.02 * np.arange(7)
    call_of = {"t": 0.0, "positions": target[::-1].tolist(), "joints": NAMES[::-1]}
    file.write_text(json.dumps(call_of))
    result = call("shield", file, "--out", tmp_path, "--set", LIMITS, *plain)
    assert result.exit_code == 0, result.stderr
    run = Result.load(tmp_path / "calls")
    np.testing.assert_allclose(run.series["position"][-1], target, atol=1e-3)
