"""A law is tried before it moves an arm: one that takes one robot is refused in a batch."""

import numpy as np
import pytest

from drake_rnn import (
    InvalidInputError,
    JointLimits,
    Positive,
    SampledLaw,
    make_experiment,
    run_many,
    simulate,
    validated,
)
from drake_rnn.arrays.algebra import matmul, solved_for, transpose, vecmat
from drake_rnn.laws.checks import stack
from seeing_law import SeesTask


@validated
class OfOne(SeesTask, SampledLaw):
    """A law that says it takes many robots, and multiplies as if there were one."""

    limits: JointLimits

    takes_many = True

    def step(self, t, x, u, period):
        return 5.0 * u["J"].T @ (u["p_WE_desired"] - u["p_WE"])


@validated
class OfNone(OfOne):
    """A law that fails for any robot until there are true signals."""

    def step(self, t, x, u, period):
        raise np.linalg.LinAlgError("Singular matrix")


@validated
class MixesRobots(OfOne):
    """A law that returns the right shape, and to each robot a share of the others' commands."""

    def step(self, t, x, u, period):
        v = 5.0 * vecmat(u["p_WE_desired"] - u["p_WE"], u["J"])
        return v if v.ndim == 1 else 0.5 * (v + v.mean(axis=0))


@validated
class MixesGains(OfOne):
    """A law that takes many robots with one gain; a gain of each is taken for that of each axis."""

    damping: Positive = 0.1

    def step(self, t, x, u, period):
        A = matmul(u["J"], transpose(u["J"])) + self.damping**2 * np.eye(3)
        return vecmat(solved_for(A, u["p_WE_desired"] - u["p_WE"]), u["J"])


DOCUMENT = {
    "arm": "panda",
    "path": {"kind": "circle", "size": 0.05, "period": 1.0},
    "law": {"kind": f"{__name__}:OfOne"},
    "period": 1e-3,
    "duration": 0.05,
}


def made(law, **gains):
    return make_experiment({**DOCUMENT, "law": {"kind": f"{__name__}:{law}", **gains}})


@pytest.mark.parametrize("count", [1, 2])
def test_a_batch_of_a_law_that_takes_one_robot_is_refused_before_it_begins(count):
    said = (
        r"^OfOne\.step: called with two robots, as takes_many allows, must return a NumPy array "
        r"of floats, shape \(2, 7\), not \(7, 3, 3\) \(at t = 0 s\); arguments were x \(2, 7\), "
    )
    with pytest.raises(InvalidInputError, match=said):
        run_many([made("OfOne")] * count)


@pytest.mark.parametrize("count", [1, 3])
def test_a_batch_of_a_law_that_mixes_robots_is_refused(count):
    for _ in range(2):  # however often it is asked for
        with pytest.raises(InvalidInputError, match=r"^MixesRobots\.step: .* each gets alone"):
            run_many([made("MixesRobots")] * count)


@pytest.mark.parametrize("dampings", [(0.1, 0.2), (0.1, 0.1, 0.2), (0.05, 0.1, 0.2)])
def test_a_batch_of_a_law_whose_gains_have_no_axis_of_robots_is_refused(dampings):
    """Three robots with three gains would run to their end, each with the gains of all."""
    with pytest.raises(InvalidInputError, match=r"^MixesGains\.step: called with two robots"):
        run_many([made("MixesGains", damping=damping) for damping in dampings])
    # With one gain for all it is as alone.
    same = run_many([made("MixesGains"), made("MixesGains")])
    alone = simulate(made("MixesGains")).metrics["position_error_max_m"]
    assert same.metrics["position_error_max_m"] == pytest.approx([alone, alone], rel=1e-9)


def test_a_law_that_fails_with_signals_that_no_arm_has_is_left_to_the_run():
    law = OfNone(limits=JointLimits.unlimited(7))
    assert isinstance(stack([law, law]), OfNone)
