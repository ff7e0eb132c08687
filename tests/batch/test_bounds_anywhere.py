"""A part of the campaign that is meant to break the bounds of the adaptive law."""

import pytest

from drake_rnn import read_campaign, run_campaign
from drake_rnn.inputs.messages import fields_of

#: Largest violation: rounding of differences over a period, of a velocity over 1 ms twice.
ROUNDING = 1e-9
VIOLATIONS = (
    "position_violation_max_rad",
    "velocity_violation_max_rad_s",
    "acceleration_violation_max_rad_s2",
    "held_jerk_violation_max_rad_s3",
)


@pytest.mark.parametrize(
    "samples",
    [pytest.param(1, marks=pytest.mark.long), pytest.param(12, marks=pytest.mark.nightly)],
)
def test_no_bound_is_broken_anywhere(samples, tmp_path):
    """Whatever path, target, posture and Jacobian are; also by those that lose their path."""
    shipped = fields_of(read_campaign("bounds_anywhere"))
    changes = {**shipped["changes"], "duration": 3, "window": [2.5, 3]}
    campaign = {**shipped, "changes": changes, "samples": samples}
    if samples == 1:
        # All of them have the same period, here the longest; many samples have others, too.
        period = {**shipped["vary"]["period"], "values": [4e-3] * 3}
        campaign["vary"] = {**shipped["vary"], "period": period}
    result = run_campaign(campaign, tmp_path, jobs=0)
    assert result.ending == "complete"
    assert result.summary.statuses == {"complete": 80 * samples}
    found = {metric.name: metric for metric in result.summary.metrics}
    for name in VIOLATIONS:
        assert found[name].worst[0].value <= ROUNDING, found[name].worst[0].command
    # Most cannot arrive in so short a time; that some do shows that the runs are none of nothing.
    assert found["position_error_max_m"].quantiles[0.05][0] < 1e-6
