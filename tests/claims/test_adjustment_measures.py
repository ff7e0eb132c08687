"""The measures of state adjustment's claims, on results whose numbers are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_rnn import JointLimits, StateAdjustment
from drake_rnn.claims.papers import state_adjustment as measures

TIME = np.linspace(0.0, 3.0, 301)


def result(error, velocity):
    """What a run returns, with seven joints that share a course of error and velocity."""
    size = {"position_lower": np.full(7, -3.0), "position_upper": np.full(7, 3.0)}
    limits = JointLimits(**size, velocity=np.full(7, 1.5))
    law = StateAdjustment(target=np.zeros(7), limits=limits, rate=4.0)
    series = {
        "joint_error": np.outer(error, np.ones(7)),
        "velocity": np.outer(velocity, np.ones(7)),
    }
    return SimpleNamespace(
        time=TIME,
        series=series,
        metrics={"joint_velocity_max_rad_s": np.abs(velocity).max()},
        experiment=SimpleNamespace(law=law, limits=limits),
    )


def test_an_exponential_is_on_its_curve_and_falls_at_its_rate():
    exact = result(np.exp(-4.0 * TIME), np.zeros(301))
    assert measures.exponential_curve_error(lambda *_: exact, "any") < 1e-12
    assert measures.rate_of_decay(lambda *_: exact, "any", 0.5, 2.5) == pytest.approx(4.0)


def test_a_slower_one_is_off_by_what_it_lags():
    """exp(-2 t) - exp(-4 t) is largest, 1/4, where exp(-2 t) is 1/2."""
    slow = result(np.exp(-2.0 * TIME), np.zeros(301))
    off = measures.exponential_curve_error(lambda *_: slow, "any")
    assert off == pytest.approx(0.25, abs=1e-4)
    assert measures.rate_of_decay(lambda *_: slow, "any", 0.5, 2.5) == pytest.approx(2.0)


def test_speeds():
    """Falling from 1.5 rad/s to zero at 3 s: below a twentieth of that from 2.85 s on."""
    falling = result(np.ones(301), 1.5 - 0.5 * TIME)
    run = lambda *_: falling  # noqa: E731
    assert measures.time_until_slow(run, "any", 0.05) == pytest.approx(2.86, abs=0.011)
    assert measures.mean_speed(run, "any", 0.0, 3.0) == pytest.approx(0.75 * np.sqrt(7))
    assert measures.speed_at(run, "any", 1.0) == pytest.approx(1.0)


def test_the_time_at_the_speed_limit_is_that_of_one_joint():
    """Joint 6 is at its limit for the first half second, and joint 7 never."""
    limited = result(np.ones(301), np.where(TIME <= 0.5, 1.5, 0.5))
    limited.series["velocity"][:, 6] = 1.4
    run = lambda *_: limited  # noqa: E731
    assert measures.time_at_speed_limit(run, "any", 6) == pytest.approx(0.5)
    assert measures.time_at_speed_limit(run, "any", 7) == 0.0


def test_the_factor_to_the_table_is_of_the_worst_joint_either_way():
    ends = result(np.ones(301), np.zeros(301))
    ends.series["joint_error"] = np.outer(np.ones(301), measures._TABLES[2])
    run = lambda *_: ends  # noqa: E731
    assert measures.factor_to_table(run, "any", 2) == 1.0
    ends.series["joint_error"][-1, 2] *= -4.0
    ends.series["joint_error"][-1, 5] /= 8.0
    assert measures.factor_to_table(run, "any", 2) == pytest.approx(8.0)
