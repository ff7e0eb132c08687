"""The chain of moving averages: bounds that hold for any input, exactly, and what it costs."""

from itertools import product

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from drake_rnn import InvalidInputError, JointLimits, SimulationError
from drake_rnn.features.filter import MovingAverage
from drake_rnn.robot.limits import DERIVATIVE_UNITS

ORDERS = list(DERIVATIVE_UNITS)
CIRCLE, SQUARE = (0.2, 0.1, 0.1, 0.2, 0.2), (0.1, 0.15, 0.2, 0.4, 0.5)
LEARNING = (0.5, 5.0, 100.0, 5e3, 1e5)


def limits(*bounds):
    """From one tuple of bounds a joint, velocity first."""
    columns = dict(zip(ORDERS, np.array(bounds, dtype=float).T, strict=False))
    return JointLimits(
        position_lower=[-9.0] * len(bounds), position_upper=[9.0] * len(bounds), **columns
    )


class Tape(LeafSystem):
    """Rows, one a period, as a sampled law would command them; the last stays."""

    def __init__(self, rows, period):
        super().__init__()
        state = self.DeclareDiscreteState(rows.shape[1])
        self.DeclareStateOutputPort("rows", state)

        def update(context, state):
            state.set_value(rows[min(round(context.get_time() / period), len(rows) - 1)])

        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, update)


def filtered(rows, bounds, period, **options):
    """What comes out in each period, from the one on in which the first row goes in."""
    builder = DiagramBuilder()
    tape = builder.AddSystem(Tape(rows, period))
    chain = builder.AddSystem(MovingAverage(limits(*bounds), period, **options))
    builder.Connect(tape.get_output_port(), chain.get_input_port())
    simulator = Simulator(builder.Build())
    context = chain.GetMyContextFromRoot(simulator.get_context())
    port, seen = chain.get_output_port(), []
    for k in range(len(rows)):
        # Half a period on: after the updates at k.
        simulator.AdvanceTo((k + 0.5) * period)
        seen.append(port.Eval(context))
    return chain, np.array(seen)


def ratios(v, bounds, period):
    """Largest magnitude of v and of its difference quotients over its bounds, a row an order."""
    v = np.concatenate((np.zeros((len(bounds[0]), v.shape[1])), v))
    return np.array(
        [
            np.abs(np.diff(v, n=order, axis=0)).max(axis=0) / period**order / bound
            for order, bound in enumerate(np.array(bounds).T)
        ]
    )


def garbage(rng, kind, count):
    """Of +-9 rad/s and more: noise, steps, a relay, spikes beside a drift."""
    if kind == 0:
        return rng.uniform(-9, 9, count)
    if kind == 1:
        return np.repeat(rng.uniform(-9, 9, count), rng.integers(1, 2000, count))[:count]
    if kind == 2:
        return 1e9 * np.sign(np.sin(np.arange(count) * rng.uniform(1e-3, 1e-2)))
    spikes = rng.standard_normal(count) ** 9 * (rng.uniform(size=count) < 0.05)
    return 0.1 * np.sin(np.arange(count) * 1e-3) + spikes


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(3))
def test_garbage_for_a_minute_keeps_every_bound(seed):
    """Sixteen joints at once, half of them with bounds of their own."""
    rng = np.random.default_rng(seed)
    period, count = 5e-3, 12000
    own = [tuple(10 ** rng.uniform(-0.1, 0.4, 5)) for _ in range(8)]
    bounds = [CIRCLE, SQUARE] * 4 + own
    u = np.stack([garbage(rng, joint % 4, count) for joint in range(16)], axis=1)
    _, v = filtered(u, bounds, period)
    found = ratios(v, bounds, period)
    # Of a difference of order k, the rounding of v makes up to 2^k steps of 2^-54 of it.
    order = np.arange(5)[:, np.newaxis]
    rounding = 2.0 ** (order - 53) * np.array(bounds).T[0] / period**order / np.array(bounds).T
    assert (found <= 1 + 1e-9 + rounding).all()
    # Not for want of motion.
    assert (found.max(axis=1) > [0.9, 0.5, 0.2, 0.1, 0.1]).all()


def test_no_chain_can_be_promised_more():
    """The worst input attains the highest bound, and no rounding at all is seen.

    Its signs are those of the response of the highest difference, backwards. Windows and bounds
    are powers of two, so that all of it is exact.
    """
    period, windows = 2.0**-10, (16, 8, 4, 32)
    bound, bounds = 1.0, [1.0]
    for window in windows:
        bound *= 2.0 / (window * period)
        bounds.append(bound)
    taps = np.zeros(sum(windows) + 1)
    for signs in product((0, 1), repeat=4):
        taps[np.dot(signs, windows)] = (-1) ** sum(signs)
    u = np.sign(taps[::-1])[:, np.newaxis]
    u = np.concatenate((u, np.zeros((80, 1))))
    chain, v = filtered(7.0 * u, [tuple(bounds)], period)
    assert chain.windows.T.tolist() == [list(windows)]
    found = ratios(v, [tuple(bounds)], period)[:, 0]
    assert found[-1] == 1.0
    assert (found <= 1.0).all()


def test_sums_are_exact_however_long_the_run():
    """After garbage, rest is rest: not a bit is left. In between, means are means."""
    rng = np.random.default_rng(0)
    bounds, period, count = [LEARNING, CIRCLE[:1] + LEARNING[1:]], 1e-3, 20000
    u = rng.uniform(-0.4, 0.4, (count, 2)) * np.array([1, 0.5])
    u[-500:] = 0.0
    chain, v = filtered(u, bounds, period)
    assert chain.windows.sum(axis=0).tolist() == [440, 440]
    assert (v[-50:] == 0.0).all()
    for joint in range(2):
        expected = np.concatenate(([0.0], u[:-1, joint]))
        for window in chain.windows[:, joint]:
            expected = np.convolve(expected, np.full(window, 1 / window))[:count]
        np.testing.assert_allclose(v[:, joint], expected, atol=1e-14)


@pytest.mark.parametrize("precompensate", [False, True])
def test_all_joints_are_delayed_alike(precompensate):
    """What a step of the command is ahead of the arm is its speed times the delay."""
    bounds, period = [CIRCLE, SQUARE, (0.15, 1.0, 1.0, 1.0, np.inf)], 1e-2
    speed = np.array([0.1, -0.05, 0.12])
    rows = np.tile(speed, (2000, 1))
    # So that clipping takes nothing away: from rest, gently.
    ramp = np.minimum(np.arange(2000) / 900, 1.0)[:, np.newaxis]
    rows = rows * (ramp * ramp * (3 - 2 * ramp) if precompensate else 1.0)
    rows *= 0.9
    chain, v = filtered(rows, bounds, period, precompensate=precompensate)
    assert chain.delay == pytest.approx(4.5, abs=0.03)
    np.testing.assert_allclose(v[-1], 0.9 * speed, rtol=1e-12)
    # The precompensation is over once the ramp is.
    ahead = period * (rows - v).sum(axis=0)
    np.testing.assert_allclose(ahead, 0.9 * speed * chain.delay, rtol=1e-9)


def test_precompensation_undoes_what_the_means_take():
    """Of a slow sine, to fourth order in frequency times window."""
    period, frequency = 1e-2, 0.3
    time = np.arange(4000) * period
    u = 0.1 * np.sin(frequency * time)[:, np.newaxis]
    errors = []
    for precompensate in (False, True):
        chain, v = filtered(u, [CIRCLE], period, precompensate=precompensate)
        delayed = 0.1 * np.sin(frequency * (time - chain.delay))
        errors.append(np.abs(v[1500:, 0] - delayed[1500:]).max())
    assert errors[0] == pytest.approx(0.1 * frequency**2 * 25 / 24, rel=0.05)
    assert errors[1] < 0.06 * errors[0]


def test_windows_are_whole_samples_and_never_too_short():
    """0.3 rad/s^2 from 0.2 rad/s would be 1.33 s; without a bound above, one sample will do."""
    bounds = limits((0.2, 0.3, 2.0), (0.2, 0.3, np.inf))
    chain = MovingAverage(bounds, 0.1)
    assert chain.windows[1].tolist() == [3, 1]
    # The joint whose windows are shorter waits for the other in its first.
    assert chain.windows[0].tolist() == [14, 16]
    assert chain.delay == pytest.approx(0.1 * (1 + 15 / 2))


@pytest.mark.parametrize(
    ("bounds", "changes", "message"),
    [
        (CIRCLE[:1], {}, "limits.acceleration: not known .* needed for filter: moving_average"),
        (CIRCLE, {"jerk": None}, "limits.jerk: not known .* needed for filter: moving_average"),
        (CIRCLE, {"velocity": np.inf}, r"limits.velocity: must be finite .* not \[inf\]"),
        (CIRCLE, {"snap": np.inf}, r"limits.snap: must be finite .* not \[inf\]"),
    ],
)
def test_a_bound_that_is_missing_is_named(bounds, changes, message):
    with pytest.raises(InvalidInputError, match=f"^{message}"):
        MovingAverage(limits(bounds).replace(**changes), 1e-3)


@pytest.mark.parametrize("period", [0.0, -1.0, np.nan, np.inf])
def test_a_period_must_be_one(period):
    with pytest.raises(InvalidInputError, match="period: must be positive"):
        MovingAverage(limits(CIRCLE), period)


def test_what_is_not_a_number_stops_the_run():
    """It would stay in the sums for ever."""
    with pytest.raises(SimulationError, match=r"commanded_velocity is \[nan\]"):
        filtered(np.full((5, 1), np.nan), [CIRCLE], 1e-2)
