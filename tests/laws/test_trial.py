"""A law is tried before it moves an arm: a batch of one that takes one robot is refused."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, JointLimits, Layout, SampledLaw, run_many, validated
from drake_rnn.experiment import make_experiment
from drake_rnn.laws.stacked import stacked


@validated
class OfOne(SampledLaw):
    """A law that says it takes many robots, and multiplies as if there were one."""

    limits: JointLimits

    takes_many = True

    @property
    def state(self):
        return Layout(v=(self.limits.size,))

    @property
    def inputs(self):
        return Layout(p_WE=(3,), p_WE_desired=(3,), J=(3, self.limits.size))

    def step(self, t, x, u, period):
        return 5.0 * u["J"].T @ (u["p_WE_desired"] - u["p_WE"])


@validated
class OfNone(OfOne):
    """A law that fails for any robot until there are true signals."""

    def step(self, t, x, u, period):
        raise np.linalg.LinAlgError("Singular matrix")


DOCUMENT = {
    "arm": "panda",
    "path": {"kind": "circle", "size": 0.05, "period": 1.0},
    "law": {"kind": f"{__name__}:OfOne"},
    "period": 1e-3,
    "duration": 0.05,
}
SAID = (
    r"^OfOne\.step: with takes_many it must take robots along leading axes; of two, with "
    r"x \(2, 7\), p_WE \(2, 3\), p_WE_desired \(2, 3\), J \(2, 3, 7\): must return a NumPy array "
    r"of floats, shape \(2, 7\), not \(7, 3, 3\)"
)


@pytest.mark.parametrize("count", [1, 2])
def test_a_batch_of_a_law_that_takes_one_robot_is_refused_before_it_begins(count):
    with pytest.raises(InvalidInputError, match=SAID):
        run_many([make_experiment(DOCUMENT)] * count)


def test_a_law_that_fails_with_signals_that_no_arm_has_is_left_to_the_run():
    law = OfNone(limits=JointLimits.unlimited(7))
    assert isinstance(stacked([law, law]), OfNone)


def test_a_law_is_tried_once():
    calls = []

    class Counted(OfOne):
        def step(self, t, x, u, period):
            calls.append(x.shape)
            return x

    law = Counted(limits=JointLimits.unlimited(7))
    for _ in range(3):
        stacked([law])
    assert calls == [(7,), (2, 7)]
