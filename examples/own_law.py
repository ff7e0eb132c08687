"""Run a law of your own: one class, and one entry in `LAWS` with its name for experiments.

The diagram connects the law's ``inputs`` by name. Filters, `fastest` and full dynamics work with it
as with any other law.
"""

from functools import cached_property
from typing import Annotated

import numpy as np

from drake_rnn import (
    LAWS,
    JointLimits,
    Layout,
    Meaning,
    NonNegative,
    Positive,
    SampledLaw,
    fastest,
    make_experiment,
    simulate,
    validated,
)


@validated
class DampedLeastSquares(SampledLaw):
    """Joint velocities J^T (J J^T + damping^2 I)^-1 (v_d + gain (p_d - p))."""

    limits: Annotated[JointLimits, Meaning("Limits of the joints; only their number is used.")]
    gain: Annotated[Positive, Meaning("Gain of the position error.", unit="1/s")] = 4.0
    damping: Annotated[NonNegative, Meaning("Damping of the pseudoinverse.", unit="m")] = 1e-3

    # Its joint velocities scale with the speed of the path: `fastest` may stretch it.
    stays_on_path = True

    @property
    def loop_gains(self):
        """Gain that a filter's delay limits."""
        return {"gain": self.gain}

    @cached_property
    def state(self):
        return Layout(v=(self.limits.size,))

    @cached_property
    def inputs(self):
        n = self.limits.size
        return Layout(p_WE=(3,), J=(3, n), p_WE_desired=(3,), v_WE_desired=(3,))

    def step(self, t, x, u, period):
        J = u["J"]
        v_WE = u["v_WE_desired"] + self.gain * (u["p_WE_desired"] - u["p_WE"])
        return J.T @ np.linalg.solve(J @ J.T + self.damping**2 * np.eye(3), v_WE)


LAWS["damped_least_squares"] = DampedLeastSquares

DOCUMENT = {
    "name": "own_law",
    "arm": "panda",
    "path": {"kind": "circle", "plane": "yz", "size": 0.05, "period": 4, "timing": "sin2"},
    "law": {"kind": "damped_least_squares", "gain": 10},
    "limits": {"velocity": 1.0, "acceleration": 4.0, "jerk": 80.0},
    "period": 1e-3,
    "duration": 4,
}


def main() -> None:
    """Run the law as it is, with a filter, with full dynamics, and as fast as possible."""
    variants = {
        "ideal arm": {},
        "every bound held by a filter": {
            "filter": {"kind": "moving_average", "precompensate": True},
            "feedback": "unfiltered",
        },
        "full dynamics": {"level": "dynamic"},
    }
    for name, changes in variants.items():
        metrics = simulate(make_experiment(DOCUMENT | changes)).metrics
        error, jerk = metrics["position_error_max_m"], metrics["limit_ratio_3_max"]
        print(f"{name}: at most {error:.1e} m off its path, jerk {jerk:.2f} of its bound")
    found = fastest(make_experiment(DOCUMENT))
    print(f"fastest lap: {found.experiment.document.duration:.3g} s, bound by the {found.binding}")


if __name__ == "__main__":
    main()
