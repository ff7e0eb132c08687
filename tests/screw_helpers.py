"""Arms and what Drake says of them, for the tests of kinematics for many robots."""

import numpy as np

from drake_rnn import load_arm

BODY = (
    '<inertial><mass value="2"/>'
    '<inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>'
)
#: Slides and turns in turn, about axes that lie askew, from origins that are turned as well.
KINDS = ("prismatic", "revolute", "continuous", "prismatic", "revolute")
AXES = ((0.6, 0, 0.8), (0, 1, 0), (1, 2, -2), (0, -1, 0), (0.1, 0.2, -1))
#: From each joint to the next, the last to E: position [m], roll, pitch and yaw [rad].
ORIGINS = (
    (0.1, -0.2, 0.4, 0.3, -0.5, 1.2),
    (0.0, 0.1, 0.3, 0.0, 1.1, 0.0),
    (0.2, 0.0, 0.1, -0.7, 0.2, 0.4),
    (0.0, 0.3, 0.0, 0.0, 0.0, 2.0),
    (-0.1, 0.1, 0.2, 1.5, -0.3, 0.1),
    (0.05, 0.0, 0.15, 0.2, 0.9, -0.6),
)


def askew(file, frames=None):
    """An arm of five joints that slide and turn, its base placed askew.

    Args:
        file: File to write its URDF to.
        frames: Position and orientation of each joint's frame and of E in the link before, of
            shapes (6, 3); by default those of ORIGINS.
    """
    frames = [(origin[:3], origin[3:]) for origin in ORIGINS] if frames is None else frames
    text = f'<link name="link0">{BODY}</link>'
    for i, (kind, axis, (xyz, rpy)) in enumerate(zip(KINDS, AXES, frames, strict=False)):
        text += (
            f'<link name="link{i + 1}">{BODY}</link><joint name="joint{i + 1}" type="{kind}">'
            f'<parent link="link{i}"/><child link="link{i + 1}"/>{_origin(xyz, rpy)}'
            f'<axis xyz="{_text(axis)}"/><limit lower="-3" upper="3" velocity="2" effort="1"/>'
            "</joint>"
        )
    text += (
        '<link name="tip"/><joint name="end" type="fixed"><parent link="link5"/>'
        f'<child link="tip"/>{_origin(*frames[-1])}</joint>'
    )
    file.write_text(f'<robot name="askew">{text}</robot>')
    return load_arm(file, frame="tip")


def _origin(xyz, rpy):
    return f'<origin xyz="{_text(xyz)}" rpy="{_text(rpy)}"/>'


def _text(numbers):
    return " ".join(repr(float(number)) for number in numbers)


def motions(n, robots=(40,), seed=0):
    """Random joint positions and velocities, shapes (*robots, n)."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-3, 3, (*robots, n)), rng.uniform(-2, 2, (*robots, n))


def all_of(screws, q, v):
    """What screws say of motions, by name."""
    moved = screws.at(q)
    return {
        "p_WE": moved.p_WE,
        "R_WE": moved.R_WE,
        "J": moved.J,
        "J_omega": moved.J_omega,
        "Jdot_v": moved.Jdot_v(v),
    }


def all_of_drake(arm, q, v):
    """What Drake says of motions of shape (robots, n), by name."""
    kinematics = arm.kinematics()
    at_q = {name: getattr(kinematics, name) for name in ("p_WE", "R_WE", "J", "J_omega")}
    found = {name: np.array([function(row) for row in q]) for name, function in at_q.items()}
    bias = [kinematics.Jdot_v(*row) for row in zip(q, v, strict=True)]
    return found | {"Jdot_v": np.array(bias)}


def assert_close(found, wanted, atol):
    for name, value in wanted.items():
        np.testing.assert_allclose(found[name], value, rtol=0, atol=atol, err_msg=name)


def assert_same(found, wanted):
    for name, value in wanted.items():
        np.testing.assert_array_equal(found[name], value, err_msg=name)
