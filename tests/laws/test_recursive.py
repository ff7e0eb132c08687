"""The recursive network as plain arrays: its equations, its bounds, what its theory is worth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drake_rnn import InvalidInputError, JointLimits, Recursive, load_arm
from drake_rnn.robot.limits import DERIVATIVE_UNITS

N = 7
BOUNDS = {"circle": (0.2, 0.1, 0.1, 0.2, 0.2), "square": (0.1, 0.15, 0.2, 0.4, 0.5)}
GAINS = {"circle": (100, 1e4, 2e4, 2e4, 2e4), "square": (100, 1e5, 1.5e5, 2.5e5, 3e5)}
FILTERS = {"reading": "filters", "time_constants": [1e-4, 0.9, 0.8, 0.7, 0.7]}
START = np.array([0.4, 0.8, -0.3, -1.2, 0.5, 0.9, 0.2])


def limits(shape="circle", n=5):
    bounds = zip(DERIVATIVE_UNITS, BOUNDS[shape][:n], strict=False)
    return JointLimits(
        position_lower=np.full(N, -2.0),
        position_upper=np.full(N, 2.0),
        **{name: np.full(N, bound) for name, bound in bounds},
    )


def make(n=5, shape="circle", **fields):
    if "time_constants" in fields:
        fields["time_constants"] = fields["time_constants"][:n]
    fields = {"gains": GAINS[shape][:n], "limits": limits(shape), **fields}
    return Recursive(**{name: _array(value) for name, value in fields.items()})


def _array(value):
    return np.array(value, dtype=float) if isinstance(value, (tuple, list)) else value


def signals(rng, lead=(), error=0.1):
    return {
        "position": rng.uniform(-2, 2, (*lead, N)),
        "J": rng.standard_normal((*lead, 3, N)),
        "p_WE": error * rng.standard_normal((*lead, 3)),
        "p_WE_desired": error * rng.standard_normal((*lead, 3)),
    }


def on_its_path(rng):
    """At the middle of the position limits, without an error: w_1 = 0."""
    return {
        **signals(rng),
        "position": np.zeros(N),
        "p_WE": np.zeros(3),
        "p_WE_desired": np.zeros(3),
    }


# What is refused.


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"gains": []}, "gains: must"),
        ({"gains": [1.0] * 6}, "gains: must have 1 to 5 entries, not 6"),
        ({"gains": [100.0, 0.0]}, "gains: must be positive, not [100.0, 0.0]"),
        ({"gains": [-100.0]}, "gains: must be positive, not [-100.0]"),
        ({"gains": [100.0, np.nan]}, "gains: must"),
        (
            {"reading": "filters"},
            "time_constants: must be given with reading: filters, one per level",
        ),
        (
            {"time_constants": [1.0] * 5},
            "time_constants: must be given with reading: filters, one per level",
        ),
        (
            {"reading": "filters", "time_constants": [1e-4, 1.0]},
            "time_constants: must be 5 positive numbers, not [0.0001, 1.0]",
        ),
        (
            {"reading": "filters", "time_constants": [1e-4, 1.0, 1.0, 1.0, 0.0]},
            "time_constants: must be 5 positive numbers",
        ),
        ({"reading": "both"}, "reading: must be 'printed' or 'filters', not 'both'"),
        ({"limit_stiffness": 0.0}, "limit_stiffness: must be greater than 0"),
        ({"task_size": 6}, "task_size: must be 1, 2, 3, 4 or 5, not 6"),
    ],
)
def test_what_it_cannot_be_is_refused(fields, message):
    with pytest.raises(InvalidInputError) as caught:
        make(**fields)
    assert message in str(caught.value)


@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_a_bound_that_a_level_needs_is_named(n):
    name = list(DERIVATIVE_UNITS)[n - 1]
    with pytest.raises(InvalidInputError, match=rf"limits\.{name}: not known .* {n} gains; give"):
        make(n, limits=limits(n=n - 1))
    make(n - 1, limits=limits(n=n - 1))


# The equations.


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("reading", ["printed", "filters"])
def test_targets_are_those_of_the_equations(n, reading):
    """(8) with the projections of section 5.1, joint by joint."""
    rng = np.random.default_rng(n)
    # Gains of order one, so that some joints are at their bounds and others are not.
    fields = FILTERS if reading == "filters" else {}
    law = make(n, gains=list(rng.uniform(0.3, 3.0, n)), **fields)
    x, u = 0.2 * rng.standard_normal(law.state.size), signals(rng)
    found, cut = law.targets(x, u), 0
    for joint in range(N):
        q = u["position"][joint]
        levels = x.reshape(-1, N)[:, joint]
        w = -law.gains[0] * u["J"][:, joint] @ (u["p_WE"] - u["p_WE_desired"])
        w = min(max(w, -0.2, -(q + 2.0)), 0.2, -(q - 2.0))
        assert found[0, joint] == pytest.approx(w, rel=1e-12)
        for i in range(1, n):
            sought = -law.gains[i] * (levels[i - 1] - w)
            w = min(max(sought, -BOUNDS["circle"][i]), BOUNDS["circle"][i])
            cut += w != sought
            assert found[i, joint] == pytest.approx(w, rel=1e-12)
    assert n == 1 or 0 < cut < N * (n - 1)


def test_one_level_is_the_conventional_network():
    """(2): printed it is the projection itself, as a filter it nears it in epsilon."""
    rng = np.random.default_rng(0)
    u = signals(rng)
    printed, filters = make(1), make(1, **FILTERS)
    target = printed.targets(np.zeros(N), u)[0]
    np.testing.assert_array_equal(printed.step(0.0, np.zeros(N), u, 1e-3), target)
    followed = filters.step(0.0, np.zeros(N), u, 1e-4)
    np.testing.assert_allclose(followed, (1 - np.exp(-1)) * target, rtol=1e-12)
    assert "levels" not in filters.state


@pytest.mark.parametrize("n", [2, 3, 4, 5])
@pytest.mark.parametrize("reading", ["printed", "filters"])
def test_a_step_is_what_tiny_steps_come_to(n, reading):
    """1e-4: Euler's method with 20000 steps; the targets are held, as a sampled law has them."""
    rng = np.random.default_rng(n)
    law = make(n, **(FILTERS if reading == "filters" else {}))
    x, u, period, steps = rng.standard_normal(law.state.size), signals(rng), 0.05, 20_000
    targets, levels, h = law.targets(x, u), x.reshape(-1, N).copy(), 0.05 / 20_000
    for _ in range(steps):
        if reading == "filters":
            levels += h * (targets - levels) / law.time_constants[:, np.newaxis]
        else:
            levels += h * np.vstack((levels[1:], targets[-1]))
    np.testing.assert_allclose(law.step(0.0, x, u, period), levels.ravel(), rtol=1e-4, atol=1e-5)
    np.testing.assert_array_equal(law.commanded_velocity(0.0, x), x[:N])
    np.testing.assert_array_equal(law.initial_state(rng, u), np.zeros(law.state.size))


@pytest.mark.parametrize("fields", [{}, FILTERS, {"gains": [100.0]}])
def test_diagnostics_of_many_instants_are_those_of_each(fields):
    rng = np.random.default_rng(3)
    law = make(**fields)
    t, x = np.linspace(0, 1, 9), 1e-3 * rng.standard_normal((9, law.state.size))
    u = signals(rng, (9,), error=1e-4)
    together = law.diagnostics(t, x, u)
    for k in range(9):
        alone = law.diagnostics(t[k], x[k], {name: value[k] for name, value in u.items()})
        assert alone.keys() == together.keys() == law.observables.parts.keys()
        assert alone["saturated"].shape == law.observables.parts["saturated"][1]
        np.testing.assert_array_equal(together["saturated"][k], alone["saturated"])


def test_saturated_tells_of_the_top_level():
    rng = np.random.default_rng(0)
    still, u = np.zeros(4 * N), on_its_path(rng)
    law = make()
    assert law.diagnostics(0.0, still, u)["saturated"] == [0.0]
    assert law.diagnostics(0.0, still + 1.0, u)["saturated"] == [1.0]


# The bounds.


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(2, 5))
def test_printed_only_the_top_bound_holds_whatever_comes(seed, n):
    """1e-9: the rounding of a difference of levels of size one over a thousandth of a second."""
    rng = np.random.default_rng(seed)
    law, h, bound = make(n), 1e-3, BOUNDS["circle"][n - 1]
    x = np.zeros(law.state.size)
    for k in range(50):
        before = x
        x = law.step(k * h, x, signals(rng), h)
        top = (x - before)[-N:] / h
        assert np.abs(top).max() <= bound * (1 + 1e-9)


def test_printed_the_bounds_below_the_top_are_of_targets_alone():
    """Jerk and what is below run away while the target below them is held at its bound."""
    law, h = make(), 1e-2
    u = {**on_its_path(np.random.default_rng(0)), "p_WE": np.ones(3)}
    x, worst = np.zeros(law.state.size), np.zeros((4, N))
    for k in range(3000):
        x = law.step(k * h, x, u, h)
        worst = np.maximum(worst, np.abs(x.reshape(4, N)))
        assert (np.abs(law.targets(x, u)) <= limits_of(law)).all()
    ratio = (worst / limits_of(law)[:4]).max(axis=1)
    assert (ratio[:3] > [3.0, 2.0, 1.5]).all()


def limits_of(law):
    return np.array([getattr(law.limits, name) for name in DERIVATIVE_UNITS])


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 5),
    period=st.sampled_from([1e-4, 1e-3, 0.1, 10.0]),
)
def test_filters_hold_their_signals_within_the_bounds_whatever_comes(seed, n, period):
    rng = np.random.default_rng(seed)
    law = make(n, **FILTERS)
    x, bound = np.zeros(law.state.size), limits_of(law)[:n]
    for k in range(50):
        x = law.step(k * period, x, signals(rng), period)
        assert (np.abs(x.reshape(n, N)) <= bound * (1 + 1e-12)).all()


def test_what_the_filters_hold_is_not_what_the_arm_does():
    """Its velocity leaps to its bound in a tenth of a millisecond; the signal says 0.1 rad/s^2."""
    law, h = make(**FILTERS), 1e-3
    u = {**on_its_path(np.random.default_rng(0)), "p_WE": np.ones(3)}
    x = np.zeros(law.state.size)
    first = law.step(0.0, x, u, h)
    true = np.abs(law.commanded_velocity(h, first) - law.commanded_velocity(0.0, x)) / h
    assert true.min() > 1000 * BOUNDS["circle"][1]
    assert np.abs(first[N : 2 * N]).max() < BOUNDS["circle"][1]


# The theory.


def growth(law):
    """Largest real part of the chain's roots [1/s], the law's own targets told apart.

    On its path and unsaturated: the signals are so small that no bound is felt.
    """
    u = on_its_path(np.random.default_rng(0))
    tiny = 1e-25
    slopes = []
    for k in range(4):
        x = np.zeros((4, N))
        x[k, 0] = tiny
        slopes.append(law.targets(x.ravel(), u)[-1, 0] / tiny)
    # In units of 1e4 / s, or its entries would be of sizes from 1 to 1e17.
    rate = 1e4
    A = np.diag(np.ones(3), 1)
    A[3] = [slope / rate ** (4 - k) for k, slope in enumerate(slopes)]
    return rate * np.linalg.eigvals(A).real.max()


class TestRoots:
    """s^4 + k5 s^3 + k5 k4 s^2 + k5 k4 k3 s + k5 k4 k3 k2, the printed law near its target."""

    @pytest.mark.parametrize(
        ("shape", "k3", "real"),
        [("circle", 2e4, 3376), ("square", 1.5e5, -13411), ("square", 2e5, 7379)],
    )
    def test_the_printed_gains(self, shape, k3, real):
        """k3 is printed twice; the square's two values differ."""
        k1, k2, _, k4, k5 = GAINS[shape]
        found = growth(make(gains=[k1, k2, k3, k4, k5]))
        assert found == pytest.approx(real, abs=1)
        scale = 1e4 ** np.arange(5)
        polynomial = np.array([1.0, k5, k5 * k4, k5 * k4 * k3, k5 * k4 * k3 * k2]) / scale
        assert found == pytest.approx(1e4 * np.roots(polynomial).real.max(), rel=1e-6)

    @settings(max_examples=50)
    @given(st.lists(st.floats(3.0, 5.5), min_size=4, max_size=4))
    def test_what_hurwitz_asks_of_the_gains(self, exponents):
        k2, k3, k4, k5 = 10.0 ** np.array(exponents)
        margin = min(k5 - k3, k4 * (k5 - k3) / k5 - k2)
        if abs(margin) < 1e-3 * max(k2, k3, k4, k5):
            return  # too near the edge for rounded roots
        assert (growth(make(gains=[100.0, k2, k3, k4, k5])) < 0) == (margin > 0)

    @pytest.mark.parametrize(("off", "settles"), [(4e-23, True), (4e-20, False)])
    def test_the_squares_first_set_is_stable_in_next_to_nothing(self, off, settles):
        """Nothing saturates while |x_1| < 0.5 / (k2 k3 k4 k5) = 4e-22 rad/s.

        From a tenth of that it comes to rest, from a hundred times that the relays swing. The
        samples are ten to a time constant of the fastest level, the signals those of a point at
        rest.
        """
        law, u = make(shape="square"), on_its_path(np.random.default_rng(0))
        k2, k3, k4, k5 = GAINS["square"][1:]
        assert BOUNDS["square"][4] / (k2 * k3 * k4 * k5) == pytest.approx(4.4e-22, rel=0.02)
        x, h = np.zeros(4 * N), 0.1 / k5
        x[:N] = off
        for k in range(8000):
            x = law.step(k * h, x, u, h)
        assert (np.abs(x[:N]).max() < off / 100) == settles
        assert settles or np.abs(x[:N]).max() > 100 * off


def test_from_a_millionth_of_a_radian_off_it_runs_away():
    """Regulation with all five levels: the speed is three times its bound within 30 s."""
    arm, law, h = load_arm("iiwa14").kinematics(), make(), 1e-3
    q, x, fastest = START + 1e-6, np.zeros(4 * N), 0.0
    u = {"p_WE_desired": arm.p_WE(START)}
    for k in range(30_000):
        u |= {"position": q, "p_WE": arm.p_WE(q), "J": arm.J(q)}
        x = law.step(k * h, x, u, h)
        q = q + h * law.commanded_velocity(k * h, x)
        fastest = np.abs(x[:N]).max()
        if fastest > 3 * BOUNDS["circle"][0]:
            break
    assert fastest > 3 * BOUNDS["circle"][0]
    assert np.linalg.norm(arm.p_WE(q) - u["p_WE_desired"]) > 0.1


class TestConvergenceOfALevel:
    """(31) and (41): each level is within rho / (4 k) of its target, for any rho > 0.

    What holds is (21), and with it (31) of the top level once its target stands still. The other
    levels are told to obey the same equation, which in the chain they do not.
    """

    @settings(max_examples=50)
    @given(seed=st.integers(0, 2**32 - 1))
    def test_a_projection_never_points_away_from_its_target(self, seed):
        """(21), of the top level: [P(-k z)] z <= 0, component by component."""
        rng = np.random.default_rng(seed)
        law, u = make(), signals(rng)
        x = rng.standard_normal(law.state.size)
        found = law.targets(x, u)
        off = x.reshape(4, N) - found[:4]
        for i in range(4):
            assert (found[i + 1] * off[i] <= 0.0).all()

    @pytest.mark.parametrize("rho", [1.0, 1e-3, 1e-6])
    def test_the_top_level_comes_as_near_as_one_likes_to_a_target_at_rest(self, rho):
        """n = 2, posture and path standing still; it comes nearer at every step (22)."""
        law, rng = make(2), np.random.default_rng(0)
        u, k = on_its_path(rng) | {"p_WE": np.array([1e-3, 0, 0])}, GAINS["circle"][1]
        target, h = law.targets(np.zeros(N), u)[0], 0.1 / k
        x = target + 3e-3 * rng.uniform(-1, 1, N)
        distances = [np.linalg.norm(x - target)]
        # At its bound, 0.1 rad/s^2, it is there within 0.03 s; then it nears it at rate k.
        for _ in range(round(0.04 / h)):
            x = law.step(0.0, x, u, h)
            distances.append(np.linalg.norm(x - target))
        assert distances[-1] <= rho / (4 * k) < distances[0]
        assert (np.diff(distances) <= 1e-17).all()

    def test_the_levels_below_do_not(self):
        """(41) with i > 1: the target stands still, x_1 is not near it, nor ever comes to rest.

        rho may be no less than the largest of level 2, 0.1 rad/s^2, to be what (29) says it is.
        """
        law, h = make(), 1e-2
        u = on_its_path(np.random.default_rng(0)) | {"p_WE": np.full(3, 1e-3)}
        x, off = np.zeros(4 * N), []
        for k in range(4000):
            x = law.step(k * h, x, u, h)
            off.append(np.abs(x[:N] - law.targets(x, u)[0]).max())
        late = np.array(off[2000:])
        rho = BOUNDS["circle"][1]
        assert late.max() > 1e5 * rho / (4 * GAINS["circle"][1])

    def test_of_filters_it_holds_and_then_all_they_show_is_zero(self):
        """With the target at rest x_1 is it, and what is shown as its derivatives vanishes."""
        law = make(**FILTERS)
        u = on_its_path(np.random.default_rng(0)) | {"p_WE": np.full(3, 1e-5)}
        x = np.zeros(law.state.size)
        for k in range(2000):
            x = law.step(k * 0.1, x, u, 0.1)
        target = law.targets(x, u)[0]
        assert np.abs(target).min() > 0
        np.testing.assert_allclose(x[:N], target, rtol=1e-12)
        assert np.abs(x[N:]).max() < 1e-8
