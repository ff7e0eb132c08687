"""Experiments as documents: what is read, what is refused, what is written."""

from math import inf

import numpy as np
import pytest

from drake_rnn import (
    Adaptive,
    InvalidInputError,
    check_reach,
    load_experiment,
    make_experiment,
    simulate,
)
from drake_rnn.experiment import parse_change, read_document
from drake_rnn.inputs.documents import parse_yaml, to_yaml
from drake_rnn.runs import simulation as diagram

KNOWN, LEARNED = "slc_nephroid_known", "slc_nephroid"
HOME = load_experiment(KNOWN).start


def refusal(experiment=KNOWN, changes=None):
    """What the refusal says: always one line, in the words of the document."""
    with pytest.raises(InvalidInputError) as caught:
        load_experiment(experiment, changes)
    message = str(caught.value)
    assert "\n" not in message
    assert "http" not in message
    assert "pydantic" not in message
    return message


@pytest.fixture
def file(tmp_path):
    def write(text):
        (tmp_path / "mine.yaml").write_text(text)
        return tmp_path / "mine.yaml"

    return write


# Reading.


@pytest.mark.parametrize(
    "changes",
    [
        {"start": [0.1, -0.7853981633974483, 0.0, -2.3, 0.0, 1.57, 1 / 3]},
        {"limits": "none", "law.acceleration_bound": "none"},
        {"limits": {"position_lower": [-inf] * 7, "velocity": inf}},
        {"limits": {"acceleration": [1, 2, 3, 4, 5, 6, 7]}},
        {"integrator": {"scheme": "radau3", "accuracy": 1e-6}},
        {"arm": {"model": "panda", "frame": "tip", "joints": ["panda_joint2", "panda_joint4"]}},
        {"paper": ": as 'printed' #1", "seed": 2**40, "window": None, "accept": None},
    ],
)
def test_a_changed_experiment_written_and_read_is_the_same(changes):
    experiment = load_experiment(KNOWN, changes)
    again = make_experiment(parse_yaml(experiment.document.to_yaml(), "here"))
    assert again.document.contents() == experiment.document.contents()
    np.testing.assert_array_equal(again.start, experiment.start)
    for bound in ("position_lower", "velocity", "acceleration"):
        np.testing.assert_array_equal(
            getattr(again.limits, bound), getattr(experiment.limits, bound)
        )


def test_what_arm_and_task_know_is_filled_into_the_law():
    law = load_experiment(KNOWN).law
    np.testing.assert_array_equal(law.limits.velocity, [0.5] * 7)
    np.testing.assert_array_equal(law.limits.acceleration, [1.0] * 7)
    np.testing.assert_array_equal(law.home, HOME)
    assert law.task_size == 3


def test_limits_of_the_experiment_stand_above_those_of_the_arm():
    limits = load_experiment(KNOWN, {"limits": {"velocity": 0.25}}).limits
    arm = load_experiment(KNOWN).arm.limits
    np.testing.assert_array_equal(limits.velocity, [0.25] * 7)
    np.testing.assert_array_equal(limits.position_lower, arm.position_lower)


def test_limits_none_leaves_no_limit():
    experiment = load_experiment(KNOWN, {"limits": "none", "law.acceleration_bound": "none"})
    assert np.isinf(experiment.limits.velocity).all()
    assert experiment.limits.acceleration is None


def test_a_start_outside_of_the_arms_limits_may_lie_inside_the_experiments():
    start = [*HOME[:3], 0.2, *HOME[4:]]
    assert "panda_joint4" in refusal(changes={"start": start})
    load_experiment(KNOWN, {"start": start, "limits.position_upper": [3] * 7})


def test_a_start_a_little_outside_is_for_laws_that_bring_the_arm_back():
    start = {"start": [*HOME[:6], 3.0], "on_unreachable": "follow"}
    (warning,) = (
        text for text in load_experiment(KNOWN, start).warnings if text.startswith("start:")
    )
    assert "0.103 rad outside its limits; it is brought back" in warning
    text = "panda_joint7 is at 3 rad; it may be -2.8973 to 2.8973"
    assert text in refusal("lvi_learned", start)
    # The same law with its limits kept by what stands behind it.
    load_experiment("lvi_learned", start | {"safety": {"bounds": True}})
    # Under an envelope of its velocity no joint can rest outside.
    assert "fr3_joint7 is at 3.1 rad" in refusal("adaptive_fr3", {"start": [*HOME[:6], 3.1]})


@pytest.mark.long
def test_an_arm_that_starts_outside_is_inside_when_it_tracks():
    """0.103 rad at a fifth of 0.5 rad/s, after 0.1 s to that speed: 1.1 s; no bound is broken."""
    changes = {"start": [*HOME[:6], 3.0], "on_unreachable": "follow", "duration": 1.2}
    experiment = load_experiment("adaptive_jerk", changes)
    result = simulate(experiment)
    outside = experiment.limits.violation(result.series["position"])
    assert outside[0].max() > 0.1
    assert (np.diff(outside, axis=0) <= 1e-12).all()
    assert not outside[-1].any()
    for name in ("velocity", "acceleration", "held_jerk"):
        (excess,) = (x for k, x in result.metrics.items() if k.startswith(f"{name}_violation_max"))
        assert excess <= 1e-8


def test_setting_period_removes_the_integrator_and_the_reverse():
    continuous = load_experiment(KNOWN, {"integrator": {"scheme": "runge_kutta3", "step": 1e-3}})
    assert continuous.document.period is None
    assert load_experiment(KNOWN, {"integrator.accuracy": 1e-4}).document.period is None
    sampled = load_experiment("slc_nephroid_known_continuous", {"period": 1e-3})
    assert sampled.document.integrator is None


def test_a_shorter_run_has_no_window_and_expects_nothing():
    shortened = load_experiment(KNOWN, {"duration": 1})
    assert shortened.document.window is None
    assert shortened.document.accept == {}


def test_changes_are_read_as_yaml():
    assert parse_change("law.kappa=1e1") == ("law.kappa", 10.0)
    assert parse_change(" a.b = [1, 2]") == ("a.b", [1, 2])
    assert parse_change("a=b=c") == ("a", "b=c")
    assert parse_change("window=null") == ("window", None)
    for text in ("law.kappa", "=3", " = 3", "window=", "window= "):
        with pytest.raises(InvalidInputError, match="--set: must be KEY=VALUE"):
            parse_change(text)


def test_models_and_points_are_found_beside_the_document(tmp_path, monkeypatch, file):
    """And still are when what was written is read in another place."""
    (tmp_path / "loop.csv").write_text("0,0,0\n.01,0,0\n.01,.01,0\n0,.01,0\n")
    source = load_experiment(KNOWN)
    (tmp_path / "arm.urdf").write_bytes(source.arm.model.read_bytes())
    written = file(
        "arm: {model: arm.urdf, frame: panda_link8}\n"
        "path: {kind: points, file: loop.csv, period: 2}\n"
        "law: {kind: simultaneous_learning}\n"
        f"start: {HOME.tolist()}\n"
        "period: 1e-3\n"
        "duration: 1\n"
    )
    monkeypatch.chdir(tmp_path)
    experiment = load_experiment(written.name)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "again.yaml").write_text(experiment.document.to_yaml())
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert load_experiment("again.yaml").arm.joints == source.arm.joints


# Refusals.


def test_what_is_wrong_with_an_object_as_a_whole_is_said_without_its_fields():
    message = refusal(changes={"integrator": {"scheme": "radau3"}})
    assert message == "integrator: give either accuracy or step"


def test_an_unknown_experiment_is_refused_with_those_of_like_name():
    assert refusal("slc_nefroid").startswith("experiment: no experiment 'slc_nefroid'; nearest: ")
    assert "No such file" in refusal("nowhere.yaml")


def test_period_and_integrator_in_one_document_are_refused():
    document = {**load_experiment(KNOWN).document.contents(), "integrator": {"step": 1e-3}}
    with pytest.raises(InvalidInputError, match="period: cannot be combined with integrator"):
        make_experiment(document)


@pytest.mark.parametrize("text", ["- arm\n- law\n", "", "arm\n", "3\n"])
def test_a_document_that_is_no_mapping_is_refused(file, text):
    assert refusal(file(text)).endswith("must be a mapping of keys to values")


@pytest.mark.parametrize("document", [None, 3, ["arm"], "slc_nephroid"])
def test_what_is_no_document_is_refused(document):
    with pytest.raises(InvalidInputError, match=r"^document: must be a mapping of keys to values"):
        make_experiment(document)


def test_a_key_that_stands_twice_is_refused(file):
    assert refusal(file("seed: 1\nseed: 2\n")).endswith("the key 'seed' is given twice")


def test_numbers_without_a_point_are_numbers(file):
    """1e-6 is a string in YAML 1.1."""
    text = load_experiment(LEARNED).document.to_yaml().replace("rho: 0.000001", "rho: 1e-6")
    assert load_experiment(file(text)).law.rho == 1e-6


def test_a_path_out_of_reach_is_refused_before_anything_is_simulated(monkeypatch):
    def simulator(diagram):
        raise AssertionError("simulated")

    monkeypatch.setattr(diagram, "Simulator", simulator)
    with pytest.raises(InvalidInputError, match=r"^path: out of reach: panda misses the point \("):
        simulate(load_experiment(KNOWN, {"path.size": 2}))


@pytest.mark.parametrize("key", ["home", "limits", "task_size"])
def test_what_arm_and_task_determine_cannot_be_given_to_the_law(key):
    with pytest.raises(InvalidInputError, match=rf"law\.{key}: follows from .*; leave it out"):
        load_experiment(KNOWN, {f"law.{key}": 2})


def test_a_planar_task_takes_no_path_that_leaves_its_plane():
    document = {"arm": "planar6", "task": "xy", "path.offset": [0, 0, 0], "duration": 1}
    with pytest.raises(InvalidInputError, match=r"path: leaves the plane of task xy by 0\.3"):
        check_reach(load_experiment(KNOWN, document))


def test_changes_stay_the_callers_own():
    law = {"kind": "simultaneous_learning", "jacobian": "known"}
    changes = {"law": law, "law.kappa": 8.0}
    assert load_experiment("slc_nephroid_known", changes).law.kappa == 8.0
    assert law == {"kind": "simultaneous_learning", "jacobian": "known"}


def test_period_and_integrator_cannot_both_be_changed():
    with pytest.raises(InvalidInputError, match="period: cannot be combined with integrator"):
        load_experiment(KNOWN, {"period": 1e-3, "integrator": {"step": 1e-3}})


def test_what_is_expected_survives_a_short_run_only_if_it_is_asked_for():
    """The window ends after the run, and what was expected in it with it."""
    accept = {"accept.joint_velocity_max_rad_s": {"at_most": 1}}
    assert load_experiment(KNOWN, {"duration": 1}).document.accept == {}
    kept = load_experiment(KNOWN, {"duration": 1, **accept}).document.accept
    assert "joint_velocity_max_rad_s" in kept


@pytest.mark.parametrize("name", [None, ""])
def test_without_a_name_a_run_has_that_of_its_file(name, tmp_path):
    """An empty one would have the run written beside the folders of others."""
    assert load_experiment("pinv_circle", {"name": name}).name == "pinv_circle"
    file = tmp_path / "mine.yaml"
    file.write_text(to_yaml({**read_document("pinv_circle"), "name": name or ""}))
    assert load_experiment(file).name == "mine"


def test_a_law_is_told_the_jacobian_of_its_whole_task_anywhere(monkeypatch):
    """For its doubts; the rotation first, of what the arm has at a posture of its own choice."""
    seen = []

    def doubts(self, circumstances):
        seen.append(circumstances.task_J)
        return []

    monkeypatch.setattr(Adaptive, "doubts", doubts)
    found = load_experiment("adaptive_pose")
    kinematics, q = found.arm.kinematics(), found.start + 0.3
    J = np.vstack((kinematics.J_omega(q), kinematics.J(q)))
    np.testing.assert_allclose(seen[0](q), J, rtol=0, atol=1e-15)
    load_experiment("adaptive_nephroid")
    np.testing.assert_allclose(seen[1](q), J[3:], rtol=0, atol=1e-15)


def test_a_singular_start_is_doubted_where_the_law_pulls_to_it():
    changes = {"arm": "iiwa14", "start": [0.0] * 7, "path": {"kind": "circle", "size": 0.01}}
    changes["path"] |= {"period": 8, "offset": [0.0, 0.0, -0.05]}
    warnings = load_experiment("adaptive_pose", changes).warnings
    assert any("start: the arm is pulled towards a posture that is singular" in w for w in warnings)


DEGREES = "; angles are in radians, and these look like degrees"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"start": [0, -45, 0, -135, 0, 90, 45]},
            "start: panda_joint4 is at -135 rad; it may be -3.0718 to -0.0698" + DEGREES,
        ),
        (
            {"obstacles": [], "second": {"base": {"translation": [0, 1, 0]}, "follows": True}}
            | {"task": "pose", "law": {"kind": "adaptive"}},
            "second.follows: needs task: xyz or xy",
        ),
    ],
)
def test_what_is_refused_says_what_it_may_be(changes, said):
    with pytest.raises(InvalidInputError) as caught:
        load_experiment("adaptive_nephroid_known", changes)
    assert str(caught.value) == said


def test_velocities_in_degrees_and_paths_that_begin_far_away_are_told():
    path = {"kind": "waypoints", "positions": [[0.4, 0.2, 0.3], [0.4, 0.3, 0.3]]}
    changes = {"limits.velocity": 150.0, "path": {**path, "absolute": True, "period": 2.0}}
    fast, far = load_experiment("adaptive_nephroid_known", changes).warnings
    assert fast == (
        "limits: panda_joint1 may be 69 times as fast as panda says, 2.175 rad/s" + DEGREES
    )
    assert far == (
        "path: begins 0.365 m from where the tool is at the start; the arm goes there first, at "
        "once and along no path"
    )
    line = {"kind": "line", "by": [0.0, 0.1, 0.0], "turn": [0.0, 0.0, 90.0], "period": 2.0}
    given = {"path": line, "task": "pose", "law": {"kind": "adaptive"}}
    assert load_experiment("adaptive_nephroid_known", given).warnings == (
        "path: turn: 90 rad are 14.3 rounds" + DEGREES,
    )
    assert load_experiment("adaptive_nephroid_known").warnings == ()
