"""The receding-horizon law as whole runs: six bounds, and a path that starts at speed."""

import numpy as np
import pytest

from drake_rnn import load_experiment, simulate


@pytest.mark.long
@pytest.mark.parametrize(
    ("shape", "at_start"),
    [("circle", 3.83e-2), pytest.param("square", 1.61e-2, marks=pytest.mark.nightly)],
)
def test_it_joins_a_path_at_speed_with_every_bound_held(shape, at_start):
    """At the start it is as far off as any law must be: within a tenth of the optimum."""
    result = simulate(load_experiment(f"horizon_{shape}"))
    for metric, accepted in result.experiment.document.accept.items():
        assert accepted.holds(result.metrics[metric]), (metric, result.metrics[metric])
    for order in range(1, 6):
        assert result.metrics[f"limit_ratio_{order}_max"] <= 1.0
    assert result.metrics["joint_limit_margin_min_rad"] > 0.0
    assert result.position_error.max() == pytest.approx(at_start, rel=0.02)
    # The arm is where the law's own chain has it.
    assert np.abs(result.series["slip"]).max() < 1e-9
    assert result.series["fallbacks"].max() == 0
