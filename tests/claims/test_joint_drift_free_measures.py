"""What the joint-drift-free claims are measured by, on motions whose measures are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_rnn import load_experiment
from drake_rnn.claims.papers import joint_drift_free as measures

TIME = np.linspace(0.0, 10.0, 1001)


def made(**series):
    """A function that returns one result, whatever experiment is asked for."""
    result = SimpleNamespace(time=TIME, series=series, position_error=series.get("error"))
    return lambda name, changes: result


def still():
    return np.zeros((TIME.size, 3))


def test_an_error_that_grows_to_the_end_is_told_from_one_that_does_not():
    assert measures.error_at_end(made(error=TIME), "any") == 1.0
    rising_and_falling = np.sin(np.pi * TIME / 10.0)
    assert measures.error_at_end(made(error=rising_and_falling), "any") < 1e-9


def test_the_misfit_of_sigma_is_a_share_of_the_error_once_it_has_settled():
    """What differs in the first second does not count."""
    sigma = np.column_stack((TIME, TIME, TIME)) + (TIME < 0.995)[:, np.newaxis]
    run = made(v_WE=1.25 * np.outer(TIME, np.ones(3)), v_WE_desired=still())
    run("any", None).series["velocity_error_predicted"] = sigma
    assert measures.sigma_misfit(run, "any") == pytest.approx(0.2)


def test_what_is_left_of_the_velocity_error_is_a_share_of_its_start():
    v_WE = np.outer(np.where(TIME <= 0.1, 4.0, np.where(TIME < 1.0, 9.0, 1.0)), [1.0, 0.0, 0.0])
    assert measures.velocity_error_left(made(v_WE=v_WE, v_WE_desired=still()), "any") == 0.25


def test_the_factor_to_the_table_counts_either_way():
    """Twice and half the printed figures are as far from them."""
    printed = measures._TABLE_1["galjdf"]

    def run(factor):
        def result(name, changes):
            figures = printed[changes["law.return_weight"]]
            found = zip(measures._COLUMNS, figures, strict=True)
            return SimpleNamespace(metrics={metric: factor * value for metric, value in found})

        return result

    for factor in (2.0, 0.5):
        assert measures.ratio_to_table_1(run(factor), "galjdf_any") == pytest.approx(2.0)


def test_torques_are_told_apart():
    run = made(torque=np.outer(TIME - 2.0, [1.0, 2.0]))
    found = [measures.torque(run, "any", which) for which in ("smallest", "largest", "initial")]
    assert found == [-4.0, 16.0, -2.0]


@pytest.mark.parametrize(("gain", "root"), [(1.0, 0.0), (250.0, 498.4995)])
def test_roots_are_those_of_the_equation_with_delta(gain, root):
    assert measures.root_mismatch(made(), gain) == pytest.approx(root, abs=1e-4)


def test_algebra_of_the_remarks():
    """Rounding alone where it holds, much where it does not."""
    assert measures.projection_residual(made()) < 1e-14
    assert measures.block_mismatch(made(), "singular") < 1e-14
    assert measures.block_mismatch(made(), "joints") > 0.1
    assert measures.optimality_gap(made(), "moaljdf") < 1e-12
    assert measures.optimality_gap(made(), "moaljdf_printed") > 1.0


def test_networks_converge_from_anywhere_once_all_else_stands_still():
    assert measures.growth_rate(made(), "moaljdf_printed") < -1.0
    assert measures.growth_rate(made(), "moaljdf") < -1.0


def test_an_error_that_comes_with_every_lap_lasts_and_one_of_the_start_does_not():
    """Two laps, of 10 s."""
    time = np.linspace(0.0, 20.0, 2001)
    every_lap, of_the_start = np.sin(np.pi * time / 10.0) ** 2, np.exp(-time)
    for error, left in ((every_lap, 1.0), (of_the_start, np.exp(-10.0))):
        series = {"v_WE": np.outer(2.0 * error, [0.0, 0.0, 1.0]), "v_WE_desired": 0.0}
        result = SimpleNamespace(time=time, position_error=error, series=series)
        for velocity in (False, True):
            found = measures.lasting_error(lambda *_, of=result: of, "any", 2, velocity)
            assert found == pytest.approx(left)


def test_the_offsets_own_part_is_what_it_adds_to_the_error():
    """Here a quarter of it, beside an error that both runs have and a path that is moved."""

    def run(name, changes):
        offset = np.array(changes.get("path.offset", [0.0, 0.0, 0.0]))
        desired = np.tile(offset, (TIME.size, 1))
        return SimpleNamespace(
            time=TIME, series={"p_WE_desired": desired, "p_WE": 1.25 * desired + 3e-6}
        )

    assert measures.offset_part_left(run, "any", 5) == pytest.approx(0.25)


@pytest.mark.parametrize(("factor", "missing"), [(1.0, 0.0), (3.0, 2.0)])
def test_equation_37_is_missed_by_what_an_error_decays_faster(factor, missing):
    """Of e = exp(-r t), e' + beta2 e is (beta2 - r) e, and (36) follows from both derivatives."""
    law = load_experiment("naljdf_clover").law
    beta, gamma, rate = law.task_beta, law.task_gamma, factor * law.task_beta
    e = np.exp(-rate * TIME)[:, np.newaxis] * np.ones(3)
    run = made(p_WE=e, v_WE=-rate * e, p_WE_desired=still(), v_WE_desired=still())
    run("any", None).experiment = SimpleNamespace(law=law)
    assert measures.proof_misfit(run, "any", 37) == pytest.approx(missing, abs=1e-12)
    d = beta * gamma - (beta + gamma) * rate
    assert measures.proof_misfit(run, "any", 36) == pytest.approx(
        abs(d + rate**2) / rate**2, abs=1e-2
    )


def test_at_rest_the_velocity_error_is_that_of_theorem_1():
    """With a posture, a path and signals that stand still; the law of Fig. 2."""
    experiment = load_experiment("galjdf_clover_fig2")
    arm, q = experiment.arm.kinematics(), experiment.start
    rows = {"position": q, "p_WE": arm.p_WE(q), "p_WE_desired": arm.p_WE(q) + 1e-4, "J": arm.J(q)}
    rows["v_WE_desired"] = np.array([0.01, 0.02, 0.0])
    series = {name: np.array([row] * 3) for name, row in rows.items()}
    result = SimpleNamespace(time=np.arange(3.0), series=series, experiment=experiment)
    assert measures.frozen_misfit(lambda *_: result, "any") < 1e-5
    assert measures.frozen_rate(lambda *_: result, "any") < -1.0
