"""What a law's observables are computed from, after its steps: signals that belong together."""

from functools import cached_property

import numpy as np
import pytest
from test_turning_paths import Nodding, document

from drake_rnn import LAWS, PATHS, Layout, Pseudoinverse, make_experiment, simulate, validated

STEP = 1e-3
SEEN = {
    "R_WE": (3, 3),
    "R_WE_desired": (3, 3),
    "w_WE_desired": (3,),
    "alpha_WE_desired": (3,),
    "v_WE_desired": (3,),
    "a_WE_desired": (3,),
}


@validated
class Telling(Pseudoinverse):
    """A law that tells what it sees."""

    @cached_property
    def inputs(self):
        shapes = {name: shape for name, (_, shape) in super().inputs.parts.items()}
        return Layout(**shapes | SEEN)

    @cached_property
    def observables(self):
        return Layout(**{f"seen_{name}": shape for name, shape in SEEN.items()})

    def diagnostics(self, t, x, u):
        return {f"seen_{name}": u[name] for name in SEEN}


@pytest.fixture
def seen(monkeypatch):
    """The signals at every step of a path that turns the end effector."""
    monkeypatch.setitem(PATHS, "nodding", Nodding)
    monkeypatch.setitem(LAWS, "telling", Telling)
    changes = {"law": {"kind": "telling"}, "duration": 0.6, "window": None, "log_period": STEP}
    series = simulate(make_experiment(document(**changes))).series
    return {name: series[f"seen_{name}"] for name in SEEN}


def rate(values):
    """The derivative in the middle of each three steps."""
    return (values[2:] - values[:-2]) / (2 * STEP)


def test_what_a_law_is_to_follow_are_a_pose_and_its_derivatives(seen):
    """1e-6: a secant's error, a sixth of STEP^2 and of a third derivative of some 0.6."""
    R = seen["R_WE_desired"]
    np.testing.assert_allclose(R[0], seen["R_WE"][0], rtol=0, atol=1e-9)
    turning = rate(R) @ np.swapaxes(R[1:-1], 1, 2)
    w = np.stack((turning[:, 2, 1], turning[:, 0, 2], turning[:, 1, 0]), axis=1)
    assert np.abs(w).max() > 0.1
    np.testing.assert_allclose(w, seen["w_WE_desired"][1:-1], rtol=0, atol=1e-6)
    for velocity, acceleration in (("w", "alpha"), ("v", "a")):
        slope = rate(seen[f"{velocity}_WE_desired"])
        told = seen[f"{acceleration}_WE_desired"][1:-1]
        np.testing.assert_allclose(slope, told, rtol=0, atol=1e-6)
