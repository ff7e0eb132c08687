"""Where joints pass that stop within their jerk, against a loop over the stop's samples."""

import numpy as np
import pytest

from drake_rnn.robot.jerk_stop import HeldJerkStop, stop

MOST, JERK, PERIOD = np.full(40, 3.0), np.geomspace(5.0, 2000.0, 40), 1e-2


def states(seed):
    rng = np.random.default_rng(seed)
    v, a = 0.3 * rng.uniform(-1.0, 1.0, 40), rng.uniform(-3.0, 3.0, 40)
    b = np.clip(a + rng.uniform(-1.0, 1.0, 40) * JERK * PERIOD, -MOST, MOST)
    return HeldJerkStop(v, MOST, JERK, PERIOD), b


def looped(of, b, samples):
    """Positions and ways gone, from the start on, with b in the first sample."""
    q, way, v, a = np.zeros(40), np.zeros(40), of.v, b
    found = [(q, way)]
    for _ in range(samples):
        v = v + PERIOD * a
        q, way = q + PERIOD * v, way + PERIOD * np.abs(v)
        found.append((q, way))
        a = stop(q, v, a, MOST, JERK, PERIOD).first
    return np.array(found).swapaxes(0, 1)


@pytest.mark.parametrize("seed", range(10))
def test_it_passes_where_a_loop_does_and_goes_as_far(seed):
    """1e-9 rad: rounding of some hundred samples, in which a step may be taken a sample later."""
    of, b = states(seed)
    count = int(of.samples(b))
    q, way = looped(of, b, count + 3)
    k = np.arange(count + 4.0)
    assert of.travel(b, k) == pytest.approx(q, abs=1e-9)
    for found, expected in zip(of.travel_and_way(b, k), (q, way), strict=True):
        assert found == pytest.approx(expected, abs=1e-9)
    middles = 0.5 * (q[1:] + q[:-1])
    assert of.travel(b, k[1:] - 0.5) == pytest.approx(middles, abs=1e-9)
    assert of.way(b) == pytest.approx(np.abs(q).max(axis=0), abs=1e-9)
    # From the count on all joints rest, and one sample earlier some do not.
    assert np.ptp(q[count:], axis=0).max() < 1e-9
    assert (way[-1] > np.abs(q[-1]) + 1e-6).any(), "some joint turns"


@pytest.mark.parametrize("seed", range(10))
def test_what_is_left_of_it_after_a_sample_is_the_stop_from_there(seed):
    """So that one that is certified stays so."""
    of, b = states(seed)
    k = np.arange(1.0, of.samples(b) + 1.0)
    v = of.v + PERIOD * b
    later = HeldJerkStop(v, MOST, JERK, PERIOD)
    first = stop(0.0 * v, v, b, MOST, JERK, PERIOD).first
    rest = of.travel(b, np.ones(1)) + later.travel(first, k)
    assert rest == pytest.approx(of.travel(b, k + 1.0), abs=1e-9)
