"""Writes a stream of joint targets as a policy or an operator might send them, to a CSV file.

The file that is shipped with the experiment `stream_guarded` was made by

    python benchmarks/record_targets.py diagrams/experiments/joint_stream/operator.csv

A Panda's tool goes round a circle; 20 postures a second are sent, with noise. Some are late, some
are no numbers, one is far off, and the last one comes while the arm moves.
"""

import sys

import numpy as np

from drake_rnn import Circle, load_arm
from drake_rnn.systems import followed_path

INTERVAL, ENDS = 0.05, 8.0

arm = load_arm("panda")
home = np.asarray(arm.home)
rng = np.random.default_rng(0)
times = INTERVAL * np.arange(round(ENDS / INTERVAL))
targets = followed_path(Circle(size=0.12, period=6.0, plane="yz"), arm, home, ENDS)(times)
targets += 1e-3 * rng.normal(size=targets.shape)
# Each comes up to 10 ms late, and none does for half a second.
came = times + rng.uniform(0.0, 0.01, times.size)
kept = (came < 1.5) | (came > 2.0)
# A reading that fails, and one that is wrong.
targets[70:74] = np.nan
targets[90] += rng.uniform(-0.5, 0.5, home.size)

joints = ",".join(f"q{number}" for number in range(1, home.size + 1))
rows = np.column_stack((came, targets))[kept]
np.savetxt(
    sys.argv[1] if len(sys.argv) > 1 else "targets.csv",
    rows,
    fmt="%.5f",
    delimiter=",",
    header=f"t,{joints}",
    comments="",
)
