"""Tuning of gains: lower errors, bounds kept, verified by Drake."""

import numpy as np
import pytest

from drake_rnn import (
    LAWS,
    InvalidInputError,
    JointLimits,
    Layout,
    SampledLaw,
    functions_of,
    load_experiment,
    require_jax,
    simulate,
    tune,
    validated,
)
from drake_rnn.laws.zeroing_design import activation
from drake_rnn.tuning import (
    Trial,
    Tuning,
    bounds_of,
    choose,
    descend,
    gains_at,
    parse_between,
)

RMS = "position_error_rms_m"


def bowl(x):
    """A narrow valley with its lowest point at (1, -2)."""
    away = x - np.array([1.0, -2.0])
    weights = np.array([1.0, 50.0])
    return 1.0 + (weights * away**2).sum(axis=1), 2.0 * weights * away


WIDE = (np.full(2, -9.0), np.full(2, 9.0))


def test_descent_finds_the_bottom_of_a_valley():
    points = descend(bowl, np.array([4.0, 2.0]), WIDE, 30, lambda point: None)
    values = [point.value for point in points]
    assert values == sorted(values, reverse=True)
    assert points[-1].value < 1.01
    assert len(points) < 15


def test_descent_stays_within_bounds_and_goes_on_along_them():
    low, high = np.array([2.0, -9.0]), np.array([9.0, 9.0])
    points = descend(bowl, np.array([4.0, 2.0]), (low, high), 30, lambda point: None)
    assert points[-1].x == pytest.approx([2.0, -2.0], abs=0.02)
    assert all((point.x >= low).all() and (point.x <= high).all() for point in points)


def test_descent_turns_back_from_a_cliff():
    """Beyond x = 3 there are no numbers, and the slope leads there."""

    def cliff(x):
        values, slopes = bowl(-x)
        return np.where(x[:, 0] > 0.5, np.nan, values), -slopes

    points = descend(cliff, np.array([0.0, 2.0]), WIDE, 30, lambda point: None)
    assert points[-1].value < points[0].value
    assert points[-1].x[0] <= 0.5


def test_descent_ends_where_no_slope_leads_on():
    start = np.array([1.0, -2.0])
    assert len(descend(bowl, start, WIDE, 30, lambda point: None)) == 1


@pytest.fixture(scope="module")
def known():
    return load_experiment("slc_nephroid_known", {"duration": 0.1, "window": None})


def test_bounds_are_those_that_the_law_allows(known):
    keys, start = ["law.kappa", "law.rate"], np.array([4.0, 1000.0])
    low, high = bounds_of(known, keys, start, {"law.rate": (500.0, 2000.0)})
    assert low == pytest.approx([4.0 / 30.0, 500.0])
    assert high == pytest.approx([120.0, 2000.0])
    # Nothing moves at 20 m/s.
    limited = load_experiment(known, {"law.feedback_limit": 10.0})
    low, high = bounds_of(limited, ["law.feedback_limit"], np.array([10.0]), {})
    assert 19.9 < high[0] <= 20.0
    load_experiment(limited, {"law.feedback_limit": float(high[0])})


@pytest.mark.parametrize(
    ("between", "message"),
    [
        ({"law.kappa": (5.0, 9.0)}, "between: law.kappa: must have the start, 4, between both"),
        ({"law.kappa": (0.0, 9.0)}, "between: law.kappa: must be two numbers greater than 0"),
        ({"law.kappa": (9.0, 1.0)}, "between: law.kappa: must be two numbers greater than 0"),
        ({"law.rho": (1.0, 9.0)}, "between: law.rho is not among law.kappa"),
        ({"law.kappa": (1.0, 1e12)}, "law.kappa: may be 1e-06 to 1e+09"),
    ],
)
def test_bounds_that_are_none_are_refused(known, between, message):
    with pytest.raises(InvalidInputError) as refused:
        bounds_of(known, ["law.kappa"], np.array([4.0]), between)
    assert message in str(refused.value)


def test_what_is_zero_cannot_be_tuned(known):
    with pytest.raises(InvalidInputError, match="must be greater than 0 to be tuned by factors"):
        bounds_of(known, ["law.return_gain"], np.array([0.0]), {})


@pytest.mark.parametrize("text", ["law.kappa", "law.kappa=1", "law.kappa=1,2,3", "law.kappa=a,b"])
def test_a_text_that_is_no_bound_is_refused(text):
    with pytest.raises(InvalidInputError, match="--between: must be KEY=LOW,HIGH"):
        parse_between(text)


def history(*kappas):
    return [Trial({"law.kappa": kappa}, 1.0, {}) for kappa in kappas]


def test_gains_between_two_steps_are_geometric_means():
    assert gains_at(history(1.0, 4.0, 16.0), 1.5) == {"law.kappa": pytest.approx(8.0)}


#: From the start on the error is inverse to the gain.
ON_PATH = {"duration": 0.3, "window": None, "path.offset": [0, 0, 0]}


def test_the_best_gains_that_keep_bounds_are_taken():
    """A bound on the joints' speed lies between two steps of the history."""
    made = load_experiment("slc_nephroid_known", ON_PATH)
    wild = simulate(load_experiment(made, {"law.kappa": 16.0})).metrics
    calm = simulate(made).metrics
    name = "joint_velocity_max_rad_s"
    assert calm[name] < wild[name]
    accept = {name: {"at_most": 0.5 * (calm[name] + wild[name])}}
    before = simulate(load_experiment(made, {"accept": accept}))
    steps = history(4.0, 8.0, 16.0)
    place, stopped_by, after = choose(before, steps, RMS)
    assert 0.0 < place < 2.0
    assert stopped_by == (name,)
    assert after.metrics[RMS] < before.metrics[RMS]
    assert all(verdict.met for verdict in after.verdicts)


def test_nothing_is_taken_that_is_not_better():
    before = simulate(load_experiment("slc_nephroid_known", ON_PATH))
    place, _, after = choose(before, history(4.0, 0.5), RMS)
    assert (place, after) == (0.0, before)


@pytest.mark.long
def test_tuning_lowers_the_error_and_keeps_bounds():
    pytest.importorskip("jax")
    made = load_experiment(
        "slc_nephroid_known", {"law.feedback_limit": 0.1, "duration": 4, "window": [3, 4]}
    )
    keys = ["law.kappa", "law.return_gain", "law.feedback_limit"]
    told = []
    tuned = tune(made, keys, RMS, between={"law.kappa": (1.0, 20.0)}, progress=told.append)
    assert tuple(told) == tuned.history
    # The lag of a first-order loop is inverse to its gain.
    assert tuned.after.metrics[RMS] < 0.3 * tuned.before.metrics[RMS]
    assert tuned.history[0].value == pytest.approx(tuned.before.metrics[RMS], rel=1e-9)
    assert 10.0 < tuned.gains["law.kappa"] <= 20.0
    kept = {verdict.metric for verdict in tuned.before.verdicts if verdict.met}
    assert kept <= {verdict.metric for verdict in tuned.after.verdicts if verdict.met}
    again = tune(made, keys, RMS, between={"law.kappa": (1.0, 20.0)})
    assert again.gains == tuned.gains


@pytest.mark.nightly
def test_a_law_that_learns_is_tuned():
    """Its value is Drake's to 1e-6: learning in the warm-up multiplies rounding."""
    pytest.importorskip("jax")
    made = load_experiment("slc_nephroid_warm_up", {"duration": 8, "window": [4, 8]})
    tuned = tune(made, ["law.kappa", "law.rho"], RMS, steps=6)
    assert tuned.better
    assert tuned.after.metrics[RMS] < 0.5 * tuned.before.metrics[RMS]
    assert tuned.history[0].value == pytest.approx(tuned.before.metrics[RMS], rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("shape", ["sign_bi_power", "fixed_time"])
def test_activations_of_infinite_slope_have_derivatives_where_an_error_is_zero(shape):
    """An error that is exactly 0, as of a joint that the path leaves alone, stays so."""
    jax = pytest.importorskip("jax")
    require_jax()
    phi = activation(shape, None, None)
    x = np.array([0.0, 1e-9, -0.3, 2.0])
    value, slope = jax.jvp(phi, (jax.numpy.asarray(x),), (jax.numpy.array([0.0, 1.0, 1.0, 1.0]),))
    np.testing.assert_allclose(value, phi(x), rtol=1e-15)
    assert slope[0] == 0.0
    h = 1e-6 * np.abs(x[1:])
    np.testing.assert_allclose(slope[1:], (phi(x[1:] + h) - phi(x[1:] - h)) / (2.0 * h), rtol=1e-6)
    # The values are those of the formula, bit for bit.
    p, size = phi.exponent, np.abs(x)
    half = size**p + size ** (1.0 / p)
    expected = 0.5 * half if shape == "sign_bi_power" else half + size
    np.testing.assert_array_equal(phi(x), np.sign(x) * expected)


def test_what_has_no_derivative_at_the_start_is_refused_with_its_value(known, monkeypatch):
    pytest.importorskip("jax")
    tuning = Tuning(known, ["law.kappa"], RMS)
    at = (np.full(4, 0.011), np.full((4, 1), np.nan))
    monkeypatch.setattr(tuning, "_of_logarithms", lambda x: at)
    with pytest.raises(InvalidInputError) as refused:
        tuning.run(2)
    assert str(refused.value).startswith(
        f"law.kappa: the derivative of {RMS} by it is not a number at the start, where the value "
        "is 0.011: "
    )


def own_law(name, **methods):
    """A law of this module, the template's algebra with other methods."""

    def step(self, t, x, u, period):
        xp = functions_of(x)
        J_T = xp.swapaxes(u["J"], -1, -2)
        z = self.state.part(x, "z") + period * self.gain * (u["p_WE_desired"] - u["p_WE"])
        return self.state.join((J_T @ z[..., None])[..., 0], z)

    parts = {
        "__annotations__": {"limits": JointLimits, "gain": float},
        "__module__": __name__,
        "gain": 5.0,
        "takes_many": True,
        "state": property(lambda self: Layout(v=(self.limits.size,), z=(3,))),
        "inputs": property(
            lambda self: Layout(p_WE=(3,), p_WE_desired=(3,), J=(3, self.limits.size))
        ),
        "step": step,
    }
    return validated(type(name, (SampledLaw,), parts | methods))


def with_numpy(self, t, x, u, period):
    z = np.linalg.pinv(u["J"]) @ (u["p_WE_desired"] - u["p_WE"])[..., None]
    return self.state.join(z[..., 0], self.state.part(x, "z"))


def with_a_branch(self, t, x, u, period):
    return -x if u["p_WE"].sum() > 100.0 else x


def with_a_gain_and_a_matrix(self, t, x, u, period):
    return x + 0.0 * (self.gain * np.eye(3)).sum()


def with_fewer_robots(self, t, x, u, period):
    return x if isinstance(x, np.ndarray) else x[0]


@pytest.mark.long
@pytest.mark.parametrize(
    ("methods", "message"),
    [
        (
            {"takes_many": False},
            r"^law: Own runs one robot at a time; .* declares takes_many = True",
        ),
        ({"step": with_numpy}, r"^Own.step, line \d+: calls a function of NumPy .* functions_of"),
        ({"step": with_a_branch}, r"^Own.step, line \d+: decides by numbers .* by where"),
        (
            {"step": with_a_gain_and_a_matrix},
            r"^Own.step, line \d+: .*before a matrix, gain\[..., N",
        ),
        ({"step": with_fewer_robots}, r"^Own.step: returns shape \(9,\) of float64 for states of"),
    ],
)
def test_a_law_that_cannot_be_compiled_is_refused_with_its_line(monkeypatch, methods, message):
    pytest.importorskip("jax")
    monkeypatch.setitem(LAWS, "own", own_law("Own", **methods))
    with pytest.raises(InvalidInputError, match=message) as refused:
        tune(OWN, ["law.gain"], RMS)
    assert "experiments" not in str(refused.value)
    assert len(str(refused.value)) < 400


OWN = {
    "arm": "planar6",
    "law": {"kind": "own"},
    "path": {"kind": "line", "by": [0.0, 0.01, 0.0], "period": 1.0},
    "period": 1e-2,
    "duration": 0.1,
}


@pytest.mark.long
def test_a_network_with_a_state_beside_its_velocity_is_tuned(monkeypatch):
    pytest.importorskip("jax")
    monkeypatch.setitem(LAWS, "own", own_law("Own"))
    tuned = tune(OWN, ["law.gain"], RMS, steps=3)
    assert tuned.after.metrics[RMS] < tuned.before.metrics[RMS]
