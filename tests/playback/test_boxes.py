"""What boxes hide from a camera, where it is known without calculation."""

import numpy as np
import pytest
from pydrake.math import RotationMatrix

from drake_rnn.playback.viewpoint import Boxes

UP = np.array([0.0, 0.0, 1.0])


def boxes(*centres, R=None, half=(0.1, 0.2, 0.3), postures=1):
    axes = np.eye(3) if R is None else R
    count = len(centres)
    return Boxes(
        np.array(centres, float), np.tile(axes, (count, 1, 1)), np.tile(half, (count, 1)), postures
    )


@pytest.mark.parametrize(
    ("point", "hidden"),
    [
        ((0.0, 0.0, -1.0), 1.0),  # below the box, seen from above
        ((0.0, 0.0, 1.0), 0.0),  # above it: the box is behind the point
        ((0.0, 0.0, 0.0), 1.0),  # inside
        ((0.09, 0.19, -1.0), 1.0),  # just within its outline
        ((0.11, 0.0, -1.0), 0.0),  # just beyond it
        ((0.0, 0.21, -1.0), 0.0),
    ],
)
def test_a_box_hides_what_is_behind_it(point, hidden):
    assert boxes((0, 0, 0)).hidden_share(np.array([point]), UP) == hidden


def test_a_turned_box_hides_what_the_turned_camera_does_not_see():
    R = RotationMatrix.MakeXRotation(0.7).matrix() @ RotationMatrix.MakeZRotation(-1.9).matrix()
    points = np.array([(0.09, 0.19, -1.0), (0.11, 0.0, -1.0), (0.0, 0.0, 1.0), (0.0, 0.0, -2.0)])
    centre = np.array([3.0, -2.0, 1.0])
    assert boxes(centre, R=R).hidden_share(points @ R.T + centre, R @ UP) == 0.5


def test_shares_are_averaged_over_the_postures():
    """In one of two postures a box hides the point."""
    assert boxes((0, 0, 0), (5, 0, 0), postures=2).hidden_share(np.array([(0, 0, -1.0)]), UP) == 0.5


def test_several_boxes_of_a_posture_hide_a_point_once():
    assert boxes((0, 0, 0), (0, 0, 1)).hidden_share(np.array([(0, 0, -1.0)]), UP) == 1.0
