"""Detours: an arm that is stuck on its path goes round, within every bound; what is told if not."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from drake_rnn import (
    AddLoop,
    DetourSource,
    IdealArm,
    InvalidInputError,
    JointStream,
    PathSource,
    SampledController,
    load_arm,
    load_experiment,
    run_many,
    simulate,
    write_playback,
)
from drake_rnn.errors import InterruptedRunError
from drake_rnn.features.detour import LED, STOPS, Meetings, detours_of
from drake_rnn.figures.style import mark_times
from drake_rnn.runs import resume

pytest.importorskip("ompl")

PERIOD = 0.01
BOX = {
    "kind": "box",
    "center": [0.45, 0.24, 0.6],
    "size": [0.3, 0.04, 0.24],
    "name": "board",
}
WALL = {"kind": "half_space", "point": [0.0, 0.25, 0.0], "normal": [0.0, -1.0, 0.0]}
# The path leads through the board, or behind the wall, and rests at its end from 3 s on.
DOCUMENT = {
    "arm": "panda",
    "path": {"kind": "line", "by": [0.0, 0.45, 0.0], "period": 3.0, "timing": "quintic"},
    "law": {"kind": "adaptive"},
    "limits": {"velocity": 1.0, "acceleration": 4.0},
    "obstacles": [BOX],
    "period": PERIOD,
    "duration": 7.0,
    "on_unreachable": "follow",
}


def scene(**changes):
    return load_experiment({**DOCUMENT, "detour": {}, **changes})


@pytest.fixture(scope="module")
def round_the_board():
    return simulate(scene(log_period=PERIOD))


@pytest.mark.long
def test_a_law_without_detours_is_stuck_before_a_board():
    result = simulate(scene(detour=None, log_period=PERIOD))
    assert result.position_error[-1] > 0.2
    # It comes no nearer in the last second.
    assert (result.position_error[-100:] > result.position_error[-1] - 1e-3).all()


def test_on_a_detour_it_reaches_the_end_of_its_path(round_the_board):
    metrics = round_the_board.metrics
    assert round_the_board.position_error[-1] < 1e-6
    assert metrics["detours"] == 1.0
    assert metrics["detours_in_vain"] == metrics["stuck_in_the_end_s"] == 0.0
    # Certified between samples too, and within every bound of every joint.
    assert metrics["distance_min_m"] >= 0.005
    excess = [metrics[f"{name}_violation_max_{unit}"] for name, unit in
              (("position", "rad"), ("velocity", "rad_s"), ("acceleration", "rad_s2"))]  # fmt: skip
    assert max(excess) < 1e-9
    assert not [text for text in round_the_board.warnings if text.startswith("detour")]


def test_the_record_says_when_for_how_long_and_how_far(round_the_board):
    mode, detours, _, _, led, stuck, length = round_the_board.series["detours"].T
    time = round_the_board.time
    way = np.abs(np.diff(round_the_board.series["position"][mode == LED], axis=0)).sum()
    # Waypoints are the corners of what is followed, which a curve cuts.
    assert 0.7 * length[-1] < way < length[-1] + 1e-9
    assert led[-1] == pytest.approx(time[mode > 0.0][-1] - time[mode > 0.0][0] + PERIOD)
    assert stuck[mode == LED].max() > led[-1]
    assert detours[time < 1.0].max() == 0.0


def test_its_figures_shade_the_time_of_the_detour(round_the_board):
    mode, time = round_the_board.series["detours"][:, 0], round_the_board.time
    fig, ax = plt.subplots()
    mark_times(ax, round_the_board)
    plt.close(fig)
    [patch] = [each for each in ax.patches if each.get_label() == "on a detour"]
    away = time[mode > 0.0]
    # A rectangle, or before Matplotlib 3.9 a polygon.
    left, right = ax.transData.inverted().transform(patch.get_window_extent())[:, 0]
    assert left == pytest.approx(away[0], abs=1e-9)
    assert right == pytest.approx(away[-1] + PERIOD, abs=1e-9)


def test_its_playback_shows_where_it_was_stuck(round_the_board, tmp_path):
    page = write_playback(round_the_board, tmp_path / "playback.html").read_text()
    assert "stuck, on a detour" in page


@pytest.mark.long
def test_side_by_side_it_makes_the_same_detours(round_the_board):
    many = run_many([scene(), scene(obstacles=[])])
    assert many.row(0)["detours"] == 1.0
    assert many.row(1)["detours"] == 0.0
    end = round_the_board.series["position"][-1]
    np.testing.assert_allclose(many.position[0], end, atol=1e-6)


@pytest.mark.long
def test_in_a_diagram_of_ones_own(round_the_board):
    experiment, builder = scene(), DiagramBuilder()
    path = builder.AddSystem(PathSource(experiment.desired, preview=PERIOD))
    law = experiment.law
    source = builder.AddSystem(DetourSource(experiment.arm, law, path, PERIOD))
    (ways,) = source.ways
    body = IdealArm(experiment.arm, experiment.start)
    loop = AddLoop(builder, body, SampledController(law, PERIOD), path, signals=ways)
    source.watch(builder, [loop.joint_command.get_output_port()])
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(7.0)
    q = loop.arm.GetOutputPort("position").Eval(
        loop.arm.GetMyContextFromRoot(simulator.get_context())
    )
    np.testing.assert_allclose(q, round_the_board.series["position"][-1], atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"detours": False}, "law: Adaptive makes no detours; give Adaptive with detours=True"),
        ({"clearance": None}, "law: has nothing to go round"),
        ({"avoidance": "none"}, "law: has nothing to go round"),
    ],
)
def test_in_a_diagram_of_ones_own_a_law_that_cannot_go_round_is_refused(changes, message):
    experiment = scene()
    path = PathSource(experiment.desired, preview=PERIOD)
    with pytest.raises(InvalidInputError, match=message):
        DetourSource(experiment.arm, replace(experiment.law, **changes), path, PERIOD)
    stream = JointStream(limits=experiment.limits, home=experiment.start)
    with pytest.raises(InvalidInputError, match="law: JointStream makes no detours"):
        DetourSource(experiment.arm, stream, path, PERIOD)
    with pytest.raises(InvalidInputError, match="law: its clearance is of another arm than iiwa14"):
        DetourSource(load_arm("iiwa14"), experiment.law, path, PERIOD)
    with pytest.raises(InvalidInputError, match="law: is of 7 joints; ur5 has 6"):
        DetourSource(load_arm("ur5"), experiment.law, path, PERIOD)


def test_in_a_diagram_of_ones_own_another_period_than_the_controllers_is_refused():
    """What brings an arm to rest within its bounds in steps of 2 ms breaks them in steps of 10."""
    experiment, builder = scene(), DiagramBuilder()
    path = builder.AddSystem(PathSource(experiment.desired, preview=PERIOD))
    source = builder.AddSystem(DetourSource(experiment.arm, experiment.law, path, PERIOD / 5))
    body = IdealArm(experiment.arm, experiment.start)
    controller = SampledController(experiment.law, PERIOD)
    with pytest.raises(InvalidInputError, match=r"signals\.detour: is for a period of"):
        AddLoop(builder, body, controller, path, signals=source.ways[0])


def test_what_no_way_leads_round_is_told():
    result = simulate(scene(obstacles=[WALL], duration=4.0))
    metrics = result.metrics
    assert metrics["distance_min_m"] >= 0.005
    assert metrics["detours"] == 0.0
    assert metrics["detours_in_vain"] == metrics["detours_blocked"] >= 1.0
    assert metrics["stuck_in_the_end_s"] > 1.0
    text = " ".join(result.warnings)
    assert "no point of the path was free within 6 s, detour.horizon" in text
    assert "no way to one" not in text  # none was sought
    assert "detour: in the end the arm is not back on its path" in text


def test_a_plan_is_timed_by_the_acceleration():
    with pytest.raises(InvalidInputError, match="a detour begins and ends at rest"):
        scene(limits="none")


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"obstacles": None}, "detour: needs obstacles that the law avoids"),
        ({"law": {"kind": "pseudoinverse"}}, "detour: this law cannot be led round"),
        ({"obstacles": [{**BOX, "speed": 0.1}]}, "detour: is planned among obstacles that stand"),
        ({"safety": {"collisions": True}}, "safety: must be left out with a detour"),
        ({"law": {"kind": "adaptive", "detours": True}}, "law.detours: follows from detour"),
    ],
)
def test_what_it_does_not_go_with(changes, match):
    with pytest.raises(InvalidInputError, match=match):
        scene(**changes)


# Two arms that face each other, whose paths cross: each waits for the other one.
PAIR = {
    **DOCUMENT,
    "path": {"kind": "line", "by": [0.17, 0.256, 0.06], "period": 3.85, "timing": "quintic",
             "offset": [0.0, 0.128, 0.0]},
    "limits": {"velocity": 0.5, "acceleration": 1.0},
    "obstacles": [],
    "second": {
        "base": {"translation": [0.99, 0.0, 0.0], "rpy": [0.0, 0.0, 3.43]},
        "path": {"kind": "line", "by": [0.224, -0.282, 0.08], "period": 4.45, "timing": "quintic",
                 "offset": [0.0, -0.141, 0.0]},
    },
    "duration": 12.0,
}  # fmt: skip


@pytest.mark.long
def test_two_arms_that_wait_for_each_other_are_led_past_each_other():
    alone = simulate(load_experiment(PAIR))
    assert max(alone.position_error[-1], alone.second.position_error[-1]) > 0.02
    result = simulate(load_experiment({**PAIR, "detour": {}}))
    assert result.metrics["detours"] >= 1.0
    assert result.metrics["stuck_in_the_end_s"] == 0.0
    for arm in (result, result.second):
        assert arm.position_error[-1] < 1e-6
        assert arm.metrics["distance_min_m"] >= 0.005
        assert arm.metrics["acceleration_violation_max_rad_s2"] < 1e-9


@pytest.mark.long
def test_it_goes_on_after_a_stop_with_the_same_bits(round_the_board, tmp_path, monkeypatch):
    """All of a detour is in numbers of the state, the plan as its waypoints.

    And a run is repeated bit for bit, in two parts.
    """
    # A checkpoint at each second of the run, however quick that is.
    monkeypatch.setattr("drake_rnn.runs.checkpoint._PAUSE", 0.0)

    def stop(time):
        if time > 2.5:
            raise KeyboardInterrupt

    with pytest.raises(InterruptedRunError):
        simulate(scene(log_period=PERIOD), stop, keep=tmp_path / "run")
    result = resume(tmp_path / "run")
    assert result.series["detours"].tobytes() == round_the_board.series["detours"].tobytes()
    assert result.series["position"].tobytes() == round_the_board.series["position"].tobytes()


@pytest.mark.long
def test_the_jerk_is_bounded_on_a_detour_as_well():
    result = simulate(scene(limits={"velocity": 1.0, "acceleration": 4.0, "jerk": 40.0}))
    assert result.metrics["detours"] == 1.0
    assert result.position_error[-1] < 1e-6
    assert result.metrics["limit_ratio_3_max"] < 1.0 + 1e-9
    assert result.metrics["distance_min_m"] >= 0.005


# Five balls round a slow nephroid that rests from 10 s on; where the arm is stuck on it.
def among_balls(balls):
    obstacles = [{"kind": "ball", "center": [*ball[:3]], "radius": ball[3]} for ball in balls]
    nephroid = {
        "kind": "nephroid",
        "plane": "yz",
        "size": 0.04,
        "period": 8.0,
        "offset": [0.1, 0, 0],
    }
    parts = [
        {"path": nephroid, "lasts": 10.0},
        {"path": {"kind": "rest"}, "bridge": 0.02},
    ]
    return detours_of(
        scene(
            path={"kind": "sequence", "parts": parts},
            limits={"velocity": 0.5, "acceleration": 1.0},
            obstacles=obstacles,
            duration=15.0,
        )
    )


def test_it_meets_its_path_where_it_can_stay_on_it_to_the_end():
    """An earlier meeting is followed by another detour."""
    balls = [
        [0.4248, 0.2521, 0.8961, 0.0331],
        [0.1338, 0.2667, 0.4498, 0.0522],
        [0.0745, -0.1548, 0.6154, 0.0708],
        [0.1571, -0.1556, 0.8412, 0.0571],
        [0.2624, 0.2664, 0.7843, 0.0406],
    ]
    detours, t = among_balls(balls), 6.92
    q = np.array([0.1058, -1.06857, -0.01928, -2.70236, -0.01762, 1.35577, 0.78426])
    waypoints, until = detours._plan(t, q, 1)
    posture = waypoints[-1:]
    for time in np.arange(until, 12.0, 0.1):
        posture, there = detours.reached(posture, time, 20, np.zeros((1, 1, 3)))
        assert there.all()
        assert detours.clearance.gaps(posture).min() >= detours.avoidance.distance


@pytest.mark.long
def test_where_the_path_rests_the_quickest_of_several_ways_is_taken():
    balls = [
        [0.2518, 0.0488, 0.8522, 0.0343],
        [0.3766, 0.2243, 0.7388, 0.0505],
        [0.517, -0.3283, 0.8023, 0.0601],
        [-0.1052, 0.151, 0.7534, 0.0341],
        [0.1827, -0.0314, 0.8807, 0.0599],
    ]
    detours, t = among_balls(balls), 9.66
    q = np.array([0.07327, -1.12368, 0.07817, -2.40762, -0.07442, 1.50219, 0.7854])
    meetings = Meetings.of(detours, t, q, 1000)
    free = meetings.postures[-1][meetings.lasts[-1] > 0]
    (_, until), first = detours._plan(t, q, 1), detours._way(q, free, 1000)
    # The nearest posture would take that long if nothing were in the way.
    assert until - t < 1.6 * detours.least_time(q, free).min()
    assert until - t < 0.75 * detours.takes(first)


def test_an_end_that_no_free_posture_reaches_is_gone_to_as_near_as_can_be():
    balls = [
        [0.17, -0.2075, 0.5486, 0.0558],
        [0.2482, -0.2474, 0.8137, 0.0436],
        [0.1451, -0.1353, 0.8228, 0.0687],
        [0.4415, 0.3371, 0.6355, 0.049],
        [-0.0727, -0.303, 0.7743, 0.0728],
    ]
    detours, t = among_balls(balls), 10.23
    q = np.array([-1.15907, -1.34167, 0.39224, -2.3985, 0.0554, 2.04781, -0.75969])
    assert not Meetings.of(detours, t, q, 2000).lasts.any()
    assert detours.errors(t, q)[0] > 0.037
    waypoints, until = detours._plan(t, q, 2)
    # It is near enough not to count as stuck, free, and there within the horizon.
    assert detours.errors(until, waypoints[-1])[0] < detours.settings.off
    assert detours.clearance.gaps(waypoints).min() >= detours.avoidance.distance
    assert until - t <= detours.settings.horizon


@pytest.mark.long
def test_an_arm_that_is_still_led_in_the_end_does_not_oscillate():
    """Its path ends in a box; it is told that it is not back, and not to lower a gain."""
    box = {**BOX, "center": [0.45, 0.3, 0.6], "size": [0.3, 0.2, 0.24]}
    path = {**DOCUMENT["path"], "by": [0.0, 0.3, 0.0]}
    result = simulate(scene(path=path, obstacles=[box]))
    assert result.series["detours"][-1, 0] == LED
    assert result.metrics["rest_swing_max_rad_s"] > 0.1
    assert any("in the end the arm is not back" in each for each in result.warnings)
    assert not any("to and fro" in each for each in result.warnings)


def test_pauses_between_searches_in_vain_begin_anew_behind_a_detour():
    detours = detours_of(scene(obstacles=[WALL]))
    t, q, layout = 1.0, detours.arms[0].home, detours.layout
    parts = dict(layout.by_name(detours.start(q)))
    # The whole path is behind the wall, long after five searches in vain and a detour.
    parts |= {"mode": np.full(1, STOPS), "in_vain": np.full(1, 5.0), "detours": np.ones(1)}
    pauses = []
    for _ in range(2):
        x = detours.step(layout.from_parts(parts), t, q)
        pauses.append(float(layout.part(x, "since")[0]) + detours.settings.after - t)
        parts = dict(layout.by_name(x)) | {"mode": np.full(1, STOPS)}
    assert pauses == pytest.approx([1.0, 2.0])
