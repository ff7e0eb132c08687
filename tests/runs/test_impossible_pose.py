"""A pose that an arm of four joints cannot have: it rests where the weighted error is least."""

import numpy as np
import pytest
from scipy.optimize import minimize

from drake_rnn import make_experiment, simulate
from drake_rnn.robot.rotation import rotation_error

LINK = (
    '<link name="l{0}"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" '
    'ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j{0}" type="revolute"><parent '
    'link="l{1}"/><child link="l{0}"/><origin xyz="0 0 {2}"/><axis xyz="{3}"/><limit lower="-2.5" '
    'upper="2.5" velocity="2" effort="50"/></joint>'
)
END = '<link name="tcp"/><joint name="end" type="fixed"><parent link="l4"/><child link="tcp"/>'


def rests(folder, lever):
    """Where the arm rests, and the errors of position [m] and orientation [rad] as a function."""
    joints = ((1, 0, 0, "0 0 1"), (2, 1, 0.2, "0 1 0"), (3, 2, 0.3, "0 1 0"), (4, 3, 0.25, "0 1 0"))
    chain = "".join(LINK.format(*joint) for joint in joints)
    text = (
        f'<robot name="four"><link name="l0"/>{chain}{END}<origin xyz="0 0 0.1"/></joint></robot>'
    )
    (folder / "four.urdf").write_text(text)
    experiment = make_experiment(
        {
            "arm": {"model": str(folder / "four.urdf"), "frame": "tcp"},
            "start": [0.3, 0.6, 1.0, 0.6],
            "task": "pose",
            # It has no joint that turns its hand about the way ahead.
            "path": {
                "kind": "waypoints",
                "positions": [[0, 0, 0], [0, 0, 0.01]],
                "rpy": [[0, 0, 0], [0.15, 0, 0.1]],
                "times": [0, 1],
            },
            "law": {"kind": "adaptive", "lever": lever},
            "limits": {"velocity": 1.0, "acceleration": 5.0},
            "period": 0.01,
            "duration": 8,
            "on_unreachable": "follow",
        }
    )
    q = simulate(experiment).series["position"][-1]
    kinematics = experiment.arm.kinematics()
    p_WE = experiment.desired.position(8.0)[0]
    R_WE = experiment.desired.orientation(8.0)[0]

    def errors(q):
        away = np.linalg.norm(kinematics.p_WE(q) - p_WE)
        return away, np.linalg.norm(rotation_error(kinematics.R_WE(q), R_WE))

    return q, errors


@pytest.mark.long
def test_a_pose_that_is_impossible_is_missed_by_the_least_weighted_error(tmp_path):
    """|e_p|^2 + lever^2 |e_R|^2 is least; a longer lever turns the hand nearer."""
    turned = []
    for lever in (0.1, 0.5):
        q, errors = rests(tmp_path, lever)

        def cost(q, errors=errors, lever=lever):
            away, angle = errors(q)
            return away**2 + lever**2 * angle**2

        best = minimize(cost, q + 0.05, method="BFGS", options={"gtol": 1e-10})
        assert cost(q) == pytest.approx(best.fun, rel=1e-6)
        turned.append(errors(q)[1])
    assert turned[1] < turned[0]
