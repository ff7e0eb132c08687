"""The adaptive law that presses, against hydroelastic contact: whole runs of the diagram.

The one beside the wall is made once, with the command at each sample, until it has been back on its
circle for a second. Others are shorter.
"""

import numpy as np
import pytest

from shared_runs import shared_run

# The command at each sample.
EACH = {"log_period": 1e-3}
# For comparisons; contact_circle is made for other tests too.
SIX_SECONDS = {"duration": 6, "window": [2, 6]}
WALL = {**EACH, "duration": 11, "window": [2, 11]}
BLIND = {"duration": 8, "window": [2, 8], "accept": None, "law.avoidance": "none"}
JERK = {"limits.jerk": 20.0}


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("adaptive_contact_circle", None),
        ("adaptive_contact_wall", WALL),
        pytest.param("adaptive_contact_wall", None, marks=pytest.mark.nightly),
    ],
)
def test_it_comes_to_what_its_document_expects(name, changes):
    result = shared_run(name, changes)
    for metric, accepted in result.experiment.document.accept.items():
        assert accepted.holds(result.metrics[metric]), metric


@pytest.mark.long
def test_it_presses_as_well_as_motion_force_control_does():
    """Within 1.5 times its figures: measured are 0.3 of its force errors, 0.8 aside, 0.1 turned."""
    ours = shared_run("adaptive_contact_circle", SIX_SECONDS).metrics
    theirs = shared_run("contact_circle", SIX_SECONDS).metrics
    for name in (
        *("force_error_rms_N", "force_error_max_N"),
        *("lateral_error_max_m", "orientation_error_max_rad"),
    ):
        assert ours[name] <= 1.5 * theirs[name], name


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "changes", "most_off"),
    [
        ("adaptive_contact_circle", {**SIX_SECONDS, **EACH, **JERK, "accept": None}, 0.005),
        ("adaptive_contact_wall", WALL, 0.03),
        # Beside a wall it swings within a bound of the jerk.
        pytest.param(
            *(
                "adaptive_contact_wall",
                {**EACH, **JERK, "duration": 9, "window": [2, 9], "accept": None},
                1.0,
            ),
            marks=pytest.mark.nightly,
        ),
    ],
)
def test_what_it_commands_keeps_every_bound_and_the_distance(name, changes, most_off):
    result, jerk = shared_run(name, changes), "limits.jerk" in changes
    v, limits = result.series["network_velocity"], result.experiment.limits
    assert limits.violation(result.series["commanded"]).max() <= 0.0
    for order, bound in enumerate(("velocity", "acceleration", "jerk")):
        if (most := limits.bounds[bound]) is not None and (bound != "jerk" or jerk):
            size = np.abs(np.diff(v, n=order, axis=0)) / 1e-3**order
            assert (size <= most * (1.0 + 1e-9)).all(), bound
    assert result.metrics["contact_lost_fraction"] == 0.0
    assert result.metrics["force_error_max_N"] < most_off
    assert result.metrics.get("distance_min_m", 1.0) >= 0.005


@pytest.mark.long
def test_a_wall_beside_the_path_is_kept_clear_while_it_presses_and_hit_without():
    """1 cm is asked for and 5 mm certified; the arm follows its command within 0.1 mm."""
    pressing, blind = (shared_run("adaptive_contact_wall", c) for c in (WALL, BLIND))
    assert pressing.metrics["distance_min_m"] > 9.9e-3
    assert blind.metrics["distance_min_m"] == pytest.approx(-7e-3, abs=1e-4)
    # The force is kept all the while, the path is left by 17 mm, and joined again.
    assert pressing.metrics["force_error_max_N"] < 0.03
    assert pressing.metrics["lateral_error_max_m"] == pytest.approx(17.2e-3, abs=3e-4)
    aside = (pressing.series["p_WE"] - pressing.series["p_WE_desired"])[:, :2]
    assert np.linalg.norm(aside[pressing.time > 10.0], axis=1).max() < 3e-5
