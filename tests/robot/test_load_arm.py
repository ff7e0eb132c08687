"""Limits that come with the package, by name."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, JointLimits, load_arm, make_experiment
from drake_rnn.robot.load_arm import named_limits, shipped_limits

PATH = {"kind": "circle", "plane": "yz", "size": 0.05, "period": 2}
DOCUMENT = {
    "arm": "panda",
    "path": PATH,
    "law": {"kind": "adaptive"},
    "period": 1e-3,
    "duration": 1.0,
}


def test_every_shipped_file_of_limits_has_a_name():
    assert set(shipped_limits()) == {
        *("panda", "fer", "fr3", "iiwa14", "ur5", "gen3", "puma560", "planar6")
    }


@pytest.mark.parametrize("name", shipped_limits())
def test_limits_by_name_are_those_of_the_file(name):
    arm = load_arm({"fer": "panda"}.get(name, name))
    limits = named_limits(name, arm)
    assert isinstance(limits, JointLimits)
    if name != "fer":
        for key, bound in limits.bounds.items():
            np.testing.assert_array_equal(bound, arm.limits.bounds[key], err_msg=key)


def test_a_trace_is_left_to_what_the_panda_s_controller_checks():
    arm = load_arm("panda")
    fer = named_limits("fer", arm)
    np.testing.assert_array_equal(fer.position_upper, arm.limits.position_upper)
    lost = arm.limits.velocity - 0.001 - 0.003 * fer.acceleration
    np.testing.assert_allclose(fer.velocity, lost, rtol=0, atol=1e-12)
    np.testing.assert_allclose(fer.acceleration, arm.limits.acceleration - 0.001, atol=1e-12)
    np.testing.assert_allclose(fer.jerk, arm.limits.jerk - 0.1, atol=1e-9)


def test_a_document_may_name_limits_of_another_arm():
    experiment = make_experiment({**DOCUMENT, "limits": "fr3"})
    np.testing.assert_array_equal(experiment.limits.jerk, [4999.9] * 7)
    assert experiment.limits.envelope is not None
    assert "envelope" in experiment.guarantees.arm.limits


@pytest.mark.parametrize(
    ("arm", "name", "message"),
    [
        ("panda", "fr4", r"^limits: no limits 'fr4'; nearest: fr3"),
        ("panda", "ur5", r"^limits: ur5 are those of 6 joints; panda has 7"),
    ],
)
def test_limits_that_do_not_fit_are_refused(arm, name, message):
    with pytest.raises(InvalidInputError, match=message):
        make_experiment({**DOCUMENT, "arm": arm, "limits": name})
