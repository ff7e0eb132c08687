"""The measures of the claims of two arms that keep apart, on what is known otherwise."""

import numpy as np
import pytest

from drake_rnn.claims.papers import mutual_collision_avoidance as measures


def test_alternating_projections_find_the_least_distance():
    """They end where no point of a convex set is nearer; of parallel segments at once."""
    assert measures.distance_apart(None, 0.0) < 1e-12
    assert measures.distance_apart(None, 0.0, degrees=0.0) < 1e-12
    # Rounding ends it early where the distance declines by less than its last digit.
    assert measures.distance_apart(None, 0.0, degrees=10.0) < 1e-6


def test_the_stop_is_no_bound():
    """Each round of segments at an angle a leaves cos(a)^2 of the way along them."""
    assert measures.distance_apart(None, 1e-5, degrees=10.0) > 1e-4


def test_a_printed_foot_is_a_projection():
    assert measures.distance_apart(None, 0.0, method="printed_foot") < 1e-12


def test_rows_of_coordinates_hinge_on_the_frame():
    assert 0.1 < measures.turned_feasibility(None) < 0.9


def test_the_printed_root_mean_square_is_that_of_the_distances():
    assert measures.rms_of_table(None, "distance") == pytest.approx(0.113, rel=0.03)
    assert measures.rms_of_table(None, "error") < 0.033


def test_a_contradiction_makes_multipliers_grow():
    """x = 1 and x <= 0 push against each other; between them x is 1/2."""
    assert measures.infeasible(None, "growth") == pytest.approx(1.0, abs=1e-3)
    assert measures.infeasible(None, "least_squares") < 1e-9


def test_the_second_arm_stands_where_printed_numbers_have_it():
    """Both elbows of Fig. 9 are 0.45 m from the shoulder: to the millimetres that are printed."""
    drawn = np.array([[0.2332, 0.02514, 0.3839], [0.2503, -0.0193, 0.4091]])
    from_shoulder = np.linalg.norm(drawn - measures._BASES[1], axis=1)
    assert from_shoulder == pytest.approx([0.45, 0.45], abs=2e-4)
    assert np.linalg.norm(measures._DRAWN[0]) == pytest.approx(0.45, abs=2e-4)


def test_jacobians_are_slopes():
    q, h = np.linspace(-1.0, 1.0, 8), 1e-6
    links = measures._links(q, measures._BASES[1])
    for point, joints in ((4, 8), (2, 4)):
        slopes = [
            (
                measures._links(q + h * e, measures._BASES[1]).points[point]
                - measures._links(q - h * e, measures._BASES[1]).points[point]
            )
            / (2.0 * h)
            for e in np.eye(8)
        ]
        J = links.J(links.points[point], joints)
        assert np.transpose(slopes) == pytest.approx(J, abs=1e-8)


@pytest.mark.long
def test_rows_keep_two_arms_apart():
    assert measures.distance(None, "none") < 0.05 < measures.distance(None, "printed")
    assert measures.distance(None, "zero") > 0.087
