"""The signal of joint targets: each once, at the first sample at or after its time."""

import numpy as np

from drake_rnn.paths import JointTargets
from drake_rnn.systems import TargetSource

PERIOD = 4e-3


def test_each_target_comes_once_at_the_first_sample_after_it():
    """Of two within a sample the newer one; the times are sums of periods, as Drake has them."""
    times = np.array([0.0, 0.0101, 0.0118, 0.02, 0.0201])
    sent = np.array([[0.0], [1.0], [2.0], [np.nan], [4.0]])
    source = TargetSource(JointTargets(times, sent), PERIOD)
    context, t, seen = source.CreateDefaultContext(), 0.0, []
    for _ in range(8):
        context.SetTime(t)
        seen.append(source.get_output_port().Eval(context)[0])
        t += PERIOD
    none = np.nan
    assert np.array_equal(seen, [0.0, none, none, 2.0, none, none, 4.0, none], equal_nan=True)
