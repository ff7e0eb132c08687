"""Things that an arm attaches and releases on its way: what is kept apart when."""

import sys

import numpy as np
import pytest

from drake_rnn import (
    InvalidInputError,
    make_experiment,
    run_many,
    simulate,
    write_playback,
)
from drake_rnn.features.handling import payload_obstacles

PERIOD = 0.02
DOWN = np.array([-0.9, -0.7, 1.2, -2.07, -1.57, 0.0])
RAISED = DOWN - [0.0, 0.35, 0.0, -0.35, 0.0, 0.0]
TURN = np.array([1.8, 0.0, 0.0, 0.0, 0.0, 0.0])
BOX = {"kind": "box", "center": [0, 0, 0.09], "size": [0.06, 0.06, 0.12]}
TABLES = [
    {"kind": "box", "center": [0.56, y, -0.109], "size": [0.3, 0.3, 0.1], "name": name}
    for name, y in (("table", -0.53), ("shelf", 0.53))
]
WALL = {"kind": "box", "center": [0.77, 0, 0.0], "size": [0.3, 0.02, 0.24], "name": "wall"}
DOCUMENT = {
    "arm": {"model": "ur5", "tool": None, "payload": {"name": "box", "shapes": [BOX]}},
    "law": {"kind": "joint_stream", "avoidance": {"approach": 50.0}},
    "limits": {"velocity": 1.5, "acceleration": 6.0, "jerk": 200.0},
    "obstacles": [*TABLES, WALL],
    "start": RAISED.tolist(),
    "goals": [
        {"q": DOWN.tolist(), "action": "attach", "supports": ["table"]},
        {"q": RAISED.tolist()},
        {"q": (RAISED + TURN).tolist()},
        {"q": (DOWN + TURN).tolist(), "action": "release", "supports": ["shelf"]},
        {"q": (RAISED + TURN).tolist(), "wait": 0.1},
    ],
    "period": PERIOD,
    "duration": 8.0,
}


@pytest.fixture(scope="module")
def moved():
    pytest.importorskip("ompl")
    return make_experiment(DOCUMENT)


@pytest.fixture(scope="module")
def run(moved):
    return simulate(moved)


def named(clearance):
    return {name for pair in clearance.names for name in pair}


def test_the_payload_is_one_of_the_arms_bodies_while_it_is_held_and_an_obstacle_else(moved):
    free, lifted, held, lowered, left = (each.clearance for each in moved.handling.phases)
    assert [each.event for each in moved.handling.phases] == [None, "attach", None, None, "release"]
    for clearance in (lifted, held, lowered):
        assert "box" in named(clearance)
        assert "box 1" not in named(clearance)
    for clearance in (free, left):
        assert "box" not in named(clearance)
        assert ("forearm_link", "box 1") in clearance.names
        # What closes a gripper touches it.
        assert ("wrist_3_link", "box 1") not in clearance.names
    supports = {("box", "table"): (held, lowered), ("box", "shelf"): (lifted, held)}
    for pair, where in supports.items():
        assert [pair in each.names for each in (lifted, held, lowered)] == [
            each in where for each in (lifted, held, lowered)
        ]


def test_it_lies_where_it_is_attached_and_where_it_was_released(moved):
    kinematics, handling = moved.arm.kinematics(), moved.handling
    for q, X_WH in ((DOWN, handling.before), (DOWN + TURN, handling.after)):
        assert np.abs(X_WH.translation() - kinematics.p_WE(q)).max() < 1e-12
        assert np.abs(X_WH.rotation().matrix() - kinematics.R_WE(q)).max() < 1e-12
        [box] = payload_obstacles(handling.payload, X_WH)
        assert np.abs(box.center - X_WH @ [0, 0, 0.09]).max() < 1e-12
        assert np.abs(box.R_WO - X_WH.rotation().matrix()).max() < 1e-12


def test_all_is_kept_apart_that_is_to_be_within_every_bound(moved, run):
    metrics = run.metrics
    assert metrics["distance_min_m"] >= 0.01
    assert metrics["joint_error_max_rad"] < 1e-12
    for name in ("position", "velocity", "acceleration", "held_jerk"):
        [metric] = [key for key in metrics if key.startswith(f"{name}_violation_max")]
        assert metrics[metric] <= 1e-9
    # At each step the least distance is that of the pairs which count then.
    q, time, phases = run.series["position"], run.time, moved.handling.phases
    ends = [*(each.begin for each in phases[1:]), np.inf]
    own = np.full(len(time), np.inf)
    for phase, end in zip(phases, ends, strict=True):
        inside = (time >= phase.begin - 1e-9) & (time <= end + 1e-9)
        own[inside] = np.minimum(own[inside], phase.clearance.gaps(q[inside]).min(axis=1))
    assert (run.series["distance"] <= own + 1e-12).all()
    assert (run.series["uncertified"] == 0.0).all()


def test_without_its_geometry_it_collides_with_the_wall(moved):
    bare = make_experiment(
        {
            **DOCUMENT,
            "arm": {"model": "ur5", "tool": None},
            "goals": [{"q": goal["q"]} for goal in DOCUMENT["goals"]],
        }
    )
    held = moved.handling.phases[2].clearance
    assert held.gaps(bare.targets.position).min() < -0.01
    assert bare.handling is None
    assert len(bare.document.goals[2].via) == 1


def test_a_result_is_repeated_bit_for_bit_without_a_search(moved, run, monkeypatch):
    monkeypatch.setitem(sys.modules, "ompl.base", None)
    again = simulate(make_experiment(moved.document.contents()))
    assert again.series["position"].tobytes() == run.series["position"].tobytes()
    assert again.series["distance"].tobytes() == run.series["distance"].tobytes()


def test_an_arm_that_is_not_at_rest_at_its_goal_attaches_nothing(moved):
    """Without targets the arm waits where it started."""
    reading = moved.handling.around(moved.law.sampled(PERIOD))
    u = {"position": RAISED, "target": np.full(6, np.nan)}
    x = reading.initial_state(np.random.default_rng(0), u)
    begin = moved.handling.phases[1].begin
    x = reading.step(begin - PERIOD, x, u, PERIOD)
    with pytest.raises(InvalidInputError, match=r"goals.0: the arm is not at rest there at 1.08 s"):
        reading.step(begin, x, u, PERIOD)


def test_what_is_handed_over_is_gone(moved):
    goals = [{**goal} for goal in run_goals(moved)]
    goals[3]["action"] = "hand_over"
    handling = make_experiment({**DOCUMENT, "goals": goals}).handling
    assert handling.after is None
    assert "box 1" not in named(handling.phases[-1].clearance)
    # What is held from the start is released without being attached.
    del goals[0]["action"], goals[0]["supports"]
    supports = [*TABLES, WALL][1:]
    held = make_experiment({**DOCUMENT, "obstacles": supports, "goals": goals}).handling
    assert held.before is None
    assert "box" in named(held.phases[0].clearance)


def run_goals(moved):
    """Return the goals with the plans that were found."""
    return moved.document.contents()["goals"]


def changed(number, **keys):
    goals = [{**goal} for goal in DOCUMENT["goals"]]
    goals[number] |= keys
    return {"goals": [{k: v for k, v in goal.items() if v is not None} for goal in goals]}


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"goals": []}, "goals: must have one goal or more"),
        (
            {"goal": {"q": DOWN.tolist()}},
            "goal: cannot be combined with goals; give one of them",
        ),
        (
            {"goals": None, "goal": {"q": DOWN.tolist(), "action": "attach"}},
            "goal.action: is for several goals",
        ),
        (
            {"arm": {"model": "ur5", "tool": None}},
            "goals.0.action: attach needs arm.payload, what the arm holds",
        ),
        (
            changed(1, action="attach"),
            "goals.3.action: a payload is attached once, and then released or handed over once",
        ),
        (
            changed(0, action="release"),
            "goals.3.action: a payload is attached once",
        ),
        (changed(1, supports=["table"]), "goals.1.supports: only with an action"),
        (changed(3, supports=["shlf"]), "goals.3.supports: no obstacle 'shlf'; nearest: shelf"),
        (
            changed(0, supports=None),
            r"goals.0: box and table (overlap by|are) .* there, where 0.005 m are kept",
        ),
        (
            changed(0, q=None, p_WE=[0.56, -0.53, 0.09]),
            "goals.0.rpy: must be given where it attaches",
        ),
        (changed(2, q=[9.0, 0, 0, 0, 0, 0]), "goals.2.q: shoulder_pan_joint is at 9 rad"),
        ({"level": "dynamic"}, "goals: must attach and release nothing at level: dynamic"),
        ({"safety": {}}, "safety: must be left out where goals attach or release"),
        ({"obstacles": None}, "obstacles: must be given where goals attach or release"),
        (
            {"obstacles": [*TABLES, {**WALL, "name": "box 1"}]},
            "obstacles: 'box 1' is the name of a part of the payload",
        ),
    ],
)
def test_what_cannot_be_is_refused_before_a_run(changes, text):
    document = {k: v for k, v in {**DOCUMENT, **changes}.items() if v is not None}
    with pytest.raises(InvalidInputError, match=text):
        make_experiment(document)


def test_hosts_that_keep_the_same_pairs_apart_refuse_it(moved):
    with pytest.raises(InvalidInputError, match="goals: must attach and release nothing here"):
        run_many([moved])
    with pytest.raises(InvalidInputError, match="goals: must attach and release nothing here"):
        simulate(moved, compiled=True)


def test_its_playback_shows_the_payload_where_it_lies_and_when(run, tmp_path):
    page = write_playback(run, tmp_path / "playback.html").read_text()
    assert "attaches box" in page
    assert "releases box" in page
