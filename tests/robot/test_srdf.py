"""Named postures and disabled pairs of SRDF files, and keyframes of MJCF."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_arm, load_experiment, make_experiment, simulate
from drake_rnn.models import MODELS

NAMES = load_arm("panda").joints
READY = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]


def state(name, group, positions):
    joints = "".join(f'<joint name="{j}" value="{q}"/>' for j, q in positions.items())
    return f'<group_state name="{name}" group="{group}">{joints}</group_state>'


def srdf(*states, more=""):
    return (
        '<robot name="panda"><virtual_joint name="v" type="fixed" parent_frame="w" child_link="'
        'panda_link0"/><group name="arm"><chain base_link="panda_link0" tip_link="panda_link8"/>'
        f"</group>{''.join(states)}{more}</robot>"
    )


def disabled(first, second, reason="Never"):
    return f'<disable_collisions link1="{first}" link2="{second}" reason="{reason}"/>'


READY_STATE = state("ready", "arm", dict(zip(NAMES, READY, strict=True)))
OPEN = state("open", "hand", {"panda_finger_joint1": 0.035})


def panda(folder, text, **changes):
    file = folder / "panda.srdf"
    file.write_text(text)
    return load_arm("panda", srdf=str(file), **changes)


def test_named_postures_are_starts_homes_and_targets(tmp_path):
    """A document that runs: from the named posture to another named one, E in place."""
    arm = panda(tmp_path, srdf(READY_STATE, OPEN), home="ready")
    np.testing.assert_array_equal(arm.home, READY)
    assert sorted(arm.postures) == ["arm/ready", "ready"]
    assert arm.warnings == (
        "arm.srdf: panda.srdf: not used: virtual_joint; joints that the model has not: "
        "panda_finger_joint1",
    )
    turned = arm.kinematics()
    (tmp_path / "self_motion.yaml").write_text(
        "arm: {model: panda, srdf: panda.srdf}\nlaw: {kind: state_adjustment, target: ready}\n"
        "start: arm/ready\nperiod: 1e-3\nduration: 0.02\n"
    )
    experiment = load_experiment(tmp_path / "self_motion.yaml")
    np.testing.assert_array_equal(experiment.start, READY)
    np.testing.assert_array_equal(experiment.law.target, READY)
    p_WE = simulate(experiment).series["p_WE"]
    np.testing.assert_allclose(p_WE[-1], turned.p_WE(np.array(READY)), atol=1e-9)


def test_a_name_of_two_groups_needs_its_group(tmp_path):
    other = state("ready", "arm_and_hand", dict(zip(NAMES, [0.1, *READY[1:]], strict=True)))
    arm = panda(tmp_path, srdf(READY_STATE, other))
    assert sorted(arm.postures) == ["arm/ready", "arm_and_hand/ready"]
    with pytest.raises(InvalidInputError, match=r"^start: no posture 'ready'; nearest: arm/ready"):
        arm.named_posture("start", "ready")


def test_disabled_pairs_are_left_out_and_told(tmp_path):
    """Links 1 and 3 cannot touch; link 2 can touch link 7, which nothing keeps apart any more."""
    (tmp_path / "panda.srdf").write_text(
        srdf(
            more=disabled("panda_link1", "panda_link2", "Adjacent")
            + disabled("panda_link2", "panda_link7", "User")
        )
    )
    (tmp_path / "near.yaml").write_text(
        "arm: {model: panda, srdf: panda.srdf}\nlaw: {kind: adaptive}\nobstacles: []\n"
        "path: {kind: circle, size: 0.01, period: 2, laps: 1}\nperiod: 1e-3\nduration: 0.01\n"
        "limits: {velocity: 0.5, acceleration: 3}\n"
    )
    experiment = load_experiment(tmp_path / "near.yaml")
    (told,) = [w for w in experiment.warnings if "SRDF" in w]
    assert told == (
        "obstacles: 1 pair of bodies is not kept apart from each other, as the SRDF file says; "
        "these may touch, or were not searched: panda_link2 and panda_link7 (User); to keep it "
        "apart, take their disable_collisions out of the file"
    )


def test_what_is_no_srdf_file_is_refused(tmp_path):
    def refusal(text):
        with pytest.raises(InvalidInputError) as caught:
            panda(tmp_path, text)
        return str(caught.value).replace(f"{tmp_path}/", "")

    model = (MODELS / "panda" / "panda.urdf").read_text()
    assert refusal(model) == (
        "arm.srdf: panda.srdf is a model, which is given in arm.model; an SRDF file has no links"
    )
    assert refusal("<sdf/>") == (
        "arm.srdf: panda.srdf is no SRDF file: it begins with <sdf>, not <robot>"
    )
    assert refusal(" \n") == "arm.srdf: panda.srdf is no SRDF file: it is empty"
    assert refusal('<robot name="panda">\n<group name=') == (
        "arm.srdf: panda.srdf is no SRDF file: unclosed token: line 2, column 0"
    )
    assert refusal(srdf(more='<disable_collisions link1="panda_link1"/>')) == (
        "arm.srdf: panda.srdf disable_collisions of panda_link1: has no link2"
    )
    assert refusal(srdf(more='<disable_collisions link2="panda_link1"/>')) == (
        "arm.srdf: panda.srdf disable_collisions of panda_link1: has no link1"
    )
    assert refusal(srdf(state("r", "arm", {"panda_joint1": "a"}))).startswith(
        "arm.srdf: panda.srdf r: panda_joint1: must be a finite decimal number, not 'a'"
    )
    assert refusal(srdf(more=disabled("a", "b"))).startswith(
        "arm.srdf: panda.srdf is that of another robot"
    )
    with pytest.raises(InvalidInputError, match=r"^arm\.srdf: no file 'nowhere'$"):
        load_arm("panda", srdf="nowhere")
    with pytest.raises(InvalidInputError, match=r"^start: no posture 'x'; panda\.urdf names none"):
        load_arm("panda").named_posture("start", "x")


def test_a_posture_that_leaves_out_joints_says_which(tmp_path):
    """One joint is misspelt; of another posture two joints are there."""
    names = ["panda_joint1", *NAMES[1:-1], "panda_jiont7"]
    misspelt = state("ready", "arm", dict(zip(names, READY, strict=True)))
    part = state("up", "arm", dict(zip(NAMES[:2], READY, strict=False)))
    arm = panda(tmp_path, srdf(misspelt, part))
    (warning,) = arm.warnings
    assert warning.endswith("; joints that the model has not: panda_jiont7 (nearest: panda_joint7)")
    for name, missing in (
        ("ready", "panda_joint7"),
        ("arm/up", "panda_joint3, panda_joint4, panda_joint5, panda_joint6 and 1 more"),
    ):
        with pytest.raises(InvalidInputError) as caught:
            arm.named_posture("start", name)
        assert str(caught.value) == (
            f"start: the posture '{name}' of panda.srdf leaves out {missing}"
        )
    with pytest.raises(InvalidInputError) as caught:
        arm.named_posture("start", "x")
    assert str(caught.value) == (
        "start: no posture 'x'; panda.srdf of arm.srdf names none of all 7 joints"
    )


def test_the_name_of_another_robot_is_told(tmp_path):
    arm = panda(tmp_path, srdf(READY_STATE).replace('name="panda"', 'name="ur5"'))
    assert arm.warnings == (
        "arm.srdf: panda.srdf: not used: virtual_joint; it is that of ur5, by its name, and the "
        "model that of panda",
    )


def test_a_target_posture_is_a_whole_turn_nearer_for_a_continuous_joint():
    """The first joint of a Gen3 turns without end."""
    gen3 = load_arm("gen3")
    assert gen3.endless[0]
    document = {
        "arm": "gen3",
        "law": {"kind": "state_adjustment", "target": [gen3.home[0] + 2 * np.pi, *gen3.home[1:]]},
        "period": 1e-3,
        "duration": 0.01,
    }
    experiment = make_experiment(document)
    np.testing.assert_allclose(experiment.law.target, gen3.home, atol=1e-12)
    (told,) = [w for w in experiment.warnings if w.startswith("law.target")]
    assert "turns without end and takes the shorter way, to" in told
