"""Zeroing networks by themselves: their limit, their order, and what noise leaves."""

import numpy as np
import pytest
from program_helpers import optimum, random_program, turning_program, variables_of

from drake_rnn.laws.parts.programs import (
    Program,
    Rates,
)
from drake_rnn.laws.zeroing import Optimality, ZeroingNetwork
from drake_rnn.laws.zeroing_design import (
    FIXED_TIME,
    FORMULAS,
    Design,
    GrowingGain,
    NetworkNoise,
    activation,
)
from row_helpers import each

H = 1e-3
SHAPES = (
    "linear",
    "power",
    "bipolar_sigmoid",
    "power_sigmoid",
    "hyperbolic_sine",
    "power_sum",
    "sign_bi_power",
    "fixed_time",
)


def network(program, gain=1000.0, shape="linear", integral=0.0, form="implicit", noise=None):
    return ZeroingNetwork(
        variables_of(program),
        Design(activation(shape, None, None), integral),
        GrowingGain(gain, "none", 1.0),
        FORMULAS.get(form),
        1e-14,
        noise,
    )


def course(net, program_at, period, count):
    """The parts of the state after each sample, and the errors in between."""
    kept = net.init({}, np.random.default_rng(0))
    for k in range(count):
        program, rates = program_at(k * period)
        kept["samples"] = np.array([float(k)])
        _, kept = net.step(kept, {}, period, k * period, program, rates)
        yield kept


def still(program):
    return lambda t: (program, Rates())


@pytest.mark.parametrize("gain", [200.0, 1e6])
def test_its_limit_is_the_optimum_of_a_random_program(gain):
    """Programs with equations, with a box, with other inequalities, and with both."""
    for seed in range(60 if gain > 1e3 else 24):
        rng = np.random.default_rng(seed)
        program = random_program(rng, box=seed % 3 != 1, rows=seed % 3 != 2)
        *_, last = course(network(program, gain), still(program), H, 20 if gain > 1e3 else 150)
        np.testing.assert_allclose(last["optimum"], optimum(program), atol=1e-6)
        assert last.get("bound_multipliers", np.zeros(1)).min() > -1e-7


@each("form", ["implicit", *FORMULAS])
@each("shape", SHAPES)
def test_with_every_activation_and_formula_it_comes_to_the_same_optimum(shape, form):
    """But for a power, whose slope vanishes: an error falls as 1/sqrt(2 gamma t) alone.

    And but for a slope that is infinite, under an explicit formula: a sample's step overshoots.
    """
    program = random_program(np.random.default_rng(1), box=False, rows=False)
    program = program._replace(c=0.3 * program.c, b=0.3 * program.b)
    *_, last = course(network(program, 200.0, shape, form=form), still(program), H, 300)
    off = np.abs(last["optimum"] - optimum(program)).max()
    if shape == "power":
        assert 1e-3 < off < 2.0 / np.sqrt(2.0 * 200.0 * 0.3)
    elif shape in FIXED_TIME and form != "implicit":
        assert 1e-9 < off < 0.3
    else:
        assert off < 1e-6


def test_a_steep_activation_leaves_its_program_from_far_unless_steps_are_implicit():
    """sinh(2 E) of an error of 4 is 1500: at 200 /s and 1 ms, 70 times too much for Euler."""
    program = random_program(np.random.default_rng(1), box=False, rows=False)
    program = program._replace(c=program.c + 4.0)
    for form, stays in (("implicit", True), ("euler", False)):
        net = network(program, 200.0, "hyperbolic_sine", form=form)
        first, *_ = course(net, still(program), H, 2)
        size = np.abs(first["optimum"]).max()
        assert (size < 10.0) == stays


@pytest.mark.parametrize(
    ("form", "fold"), [("implicit", 4.0), ("euler", 4.0), ("taylor", 8.0), ("four_step", 8.0)]
)
def test_halving_the_period_divides_the_error_by_four_or_eight(form, fold):
    """Over two halvings, at gain times period 0.3; the larger periods miss it by 6 %."""
    left = []
    for period in (8e-3, 4e-3, 2e-3):
        first, _ = turning_program(0.0)
        net, count = network(first, 0.3 / period, form=form), round(2.0 / period)
        norms = [
            float(kept["residual_largest"][0])
            for kept in course(net, turning_program, period, count)
        ]
        left.append(max(norms[count // 2 :]))
    ratios = np.array(left[:-1]) / np.array(left[1:])
    np.testing.assert_allclose(ratios, fold, rtol=0.07)


def test_without_the_rates_the_error_falls_in_proportion_to_the_period_alone():
    left = []
    for period in (4e-3, 2e-3, 1e-3):
        first, _ = turning_program(0.0)
        net, count = network(first, 0.3 / period, form="euler"), round(2.0 / period)
        norms = [
            float(kept["residual_largest"][0])
            for kept in course(net, lambda t: (turning_program(t)[0], Rates()), period, count)
        ]
        left.append(max(norms[count // 2 :]))
    np.testing.assert_allclose(np.array(left[:-1]) / left[1:], 2.0, rtol=0.05)


@pytest.mark.parametrize("form", ["implicit", "euler", "taylor", "four_step"])
def test_it_is_stable_up_to_the_gain_that_the_formula_says(form):
    program = random_program(np.random.default_rng(2), box=False, rows=False)
    for share in (0.98, 1.02):
        most = 1e3 if form == "implicit" else FORMULAS[form].stable_below()
        net = network(program, share * most / H, form=form)
        kept = list(course(net, still(program), H, 1500))
        grows = kept[-1]["residual_largest"] > 2.0 * kept[300]["residual_largest"] + 1e-9
        assert grows == (share > 1.0 and form != "implicit")


def test_a_constant_noise_is_taken_back_by_the_integral_alone():
    """Of a noise of 5 the plain network leaves 5 / gain; the other one a millionth of that."""
    program = random_program(np.random.default_rng(4), box=True, rows=False)
    noise, left = NetworkNoise(kind="constant", size=5.0), {}
    for integral in (0.0, 100.0):
        for form in ("implicit", "euler"):
            net = network(program, 100.0, integral=integral, noise=noise, form=form)
            *_, last = course(net, still(program), H, 1000)
            left[integral, form] = float(last["residual_largest"][0])
    for form in ("implicit", "euler"):
        assert left[0.0, form] == pytest.approx(0.05, rel=1e-6)
        assert left[100.0, form] < 1e-6 * left[0.0, form]


def test_of_a_ramp_the_integral_leaves_a_constant():
    """slope / (gain eta) of a ramp that grows without bound under the plain formula."""
    program = random_program(np.random.default_rng(5), box=False, rows=False)
    noise = NetworkNoise(kind="ramp", size=5.0)
    *_, last = course(network(program, 100.0, integral=100.0, noise=noise), still(program), H, 1000)
    assert last["residual_largest"] == pytest.approx(5.0 / 1e4, rel=0.01)
    kept = list(course(network(program, 100.0, noise=noise), still(program), H, 1000))
    assert kept[-1]["residual_largest"] > 1.9 * kept[500]["residual_largest"]


def test_an_inequality_that_becomes_active_is_followed_through_the_change():
    """The box closes over the optimum, by 1.4 mrad/s a sample; off by less, mostly by much less."""
    base = random_program(np.random.default_rng(6), box=False, rows=False)
    k = base.c.size

    def closing(t):
        width = np.full(k, 1.2 - 1.4 * t)
        return base._replace(box=(-width, width)), Rates(box=(np.full(k, 1.4), np.full(k, -1.4)))

    off, active = [], 0
    for number, kept in enumerate(course(network(closing(0.0)[0], 500.0), closing, H, 480)):
        program, _ = closing((number + 1) * H)
        off.append(np.abs(kept["optimum"] - optimum(program)).max())
        active = max(active, int((kept["bound_multipliers"] > 1e-3).sum()))
    assert active >= 2
    off = np.array(off[50:])
    assert off.max() < 1.4e-3
    assert np.median(off) < 1e-5


def test_slope_and_drift_are_the_derivatives_of_the_error():
    """By central differences, of a program with every part, away from its optimum."""
    rng = np.random.default_rng(7)
    program = random_program(rng)
    like = {"box": tuple(rng.normal(size=b.shape) for b in program.box)}
    like |= {n: rng.normal(size=getattr(program, n).shape) for n in "cAbCd"}
    rates = Rates(W=np.diag(rng.normal(size=7)), **like)
    y, conditions = rng.normal(size=variables_of(program).size), Optimality(program, 1e-2)
    step = 1e-6
    for k in range(y.size):
        aside = step * np.eye(y.size)[k]
        found = (conditions.error(y + aside) - conditions.error(y - aside)) / (2.0 * step)
        np.testing.assert_allclose(conditions.slope(y)[:, k], found, atol=1e-7)
    later, sooner = (Optimality(program.ahead(rates, s), 1e-2).error(y) for s in (step, -step))
    found = (later - sooner) / (2.0 * step)
    np.testing.assert_allclose(conditions.drift(y, rates), found, atol=1e-7)


def test_a_program_without_bounds_has_no_inequalities():
    program = Program(np.eye(2), np.zeros(2), np.ones((1, 2)), np.ones(1))
    assert program.inequalities() is None
    assert Rates().inequalities(program) == (None, None)
