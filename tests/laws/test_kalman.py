"""The learned Jacobian: what a motion teaches, and where a Jacobian is taken from."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_arm
from drake_rnn.laws.parts.jacobian import (
    LearnedJacobian,
    MiddleJacobian,
    kalman_update,
)

M, N = 3, 7
R = 1e-5


def learned(count, J, directions, rng, wander=0.0, noise=0.0):
    J_hat, C = np.zeros((M, N)), np.eye(N)
    for k in range(count):
        w = directions[k % len(directions)]
        y = J @ w + noise * rng.normal(size=M)
        J_hat, C = kalman_update(J_hat, C, w, y, wander, R)
    return J_hat, C


def test_it_is_the_least_squares_of_all_that_was_measured():
    """Without wander: the minimum of |y - J w|^2 / R + |J|^2 over all samples; 1e-9: rounding."""
    rng = np.random.default_rng(0)
    W, J = 0.1 * rng.normal(size=(40, N)), rng.normal(size=(M, N))
    Y = W @ J.T + 1e-3 * rng.normal(size=(40, M))
    J_hat, C = np.zeros((M, N)), np.eye(N)
    for w, y in zip(W, Y, strict=True):
        J_hat, C = kalman_update(J_hat, C, w, y, 0.0, R)
    information = np.eye(N) + W.T @ W / R
    np.testing.assert_allclose(C, np.linalg.inv(information), rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(J_hat, (np.linalg.inv(information) @ W.T @ Y / R).T, atol=1e-7)


def test_one_motion_teaches_its_own_direction_and_no_other():
    rng = np.random.default_rng(1)
    J, w = rng.normal(size=(M, N)), 0.3 * np.eye(N)[2]
    J_hat, C = learned(1, J, [w], rng)
    # R / (w^2 C) = 1.1e-4 of the column is left.
    np.testing.assert_allclose(J_hat[:, 2], J[:, 2], rtol=2e-4)
    assert (np.delete(J_hat, 2, axis=1) == 0.0).all()
    assert C[2, 2] < 2e-4
    np.testing.assert_array_equal(np.delete(np.diag(C), 2), 1.0)


def test_at_rest_nothing_is_learned_and_certainty_fades_at_the_rate_of_the_wander():
    rng = np.random.default_rng(2)
    J_hat, C = learned(5, rng.normal(size=(M, N)), list(0.2 * np.eye(N)), rng)
    same, later = kalman_update(J_hat, C, np.zeros(N), np.ones(M), 1e-3, R)
    np.testing.assert_array_equal(same, J_hat)
    np.testing.assert_allclose(later, C + 1e-3 * np.eye(N), atol=1e-16)


def test_what_has_not_been_moved_for_long_is_learned_at_once_again():
    """The column changes; the first motion after 1000 samples of rest makes up for nearly all."""
    rng = np.random.default_rng(3)
    J, w = rng.normal(size=(M, N)), 0.3 * np.eye(N)[1]
    J_hat, C = learned(50, J, [w], rng)
    for _ in range(1000):
        J_hat, C = kalman_update(J_hat, C, np.zeros(N), np.zeros(M), 1e-3, R)
    J_hat, _ = kalman_update(J_hat, C, w, (J + 1.0) @ w, 1e-3, R)
    np.testing.assert_allclose(J_hat[:, 1], J[:, 1] + 1.0, rtol=1e-3, atol=1e-3)


def test_the_covariance_stays_symmetric_and_positive():
    """A million times the variance of a motion is what it begins with; 1e-9 of rounding."""
    rng = np.random.default_rng(4)
    C, J_hat = np.eye(N), np.zeros((M, N))
    for _ in range(5000):
        w = rng.normal(size=N) * 10.0 ** rng.uniform(-4, 0)
        J_hat, C = kalman_update(J_hat, C, w, J_hat @ w, 1e-3, R)
    np.testing.assert_allclose(C, C.T, atol=1e-12)
    assert np.linalg.eigvalsh((C + C.T) / 2).min() > 0.0


def test_one_robot_and_many_learn_alike():
    rng = np.random.default_rng(5)
    J_hat, C = rng.normal(size=(4, M, N)), np.broadcast_to(np.eye(N), (4, N, N))
    w, y = rng.normal(size=(4, N)), rng.normal(size=(4, M))
    many = kalman_update(J_hat, C, w, y, 1e-3, R)
    for k in range(4):
        for all_, alone in zip(
            many, kalman_update(J_hat[k], C[k], w[k], y[k], 1e-3, R), strict=True
        ):
            np.testing.assert_allclose(all_[k], alone, rtol=1e-12, atol=1e-14)


@pytest.fixture(scope="module")
def kinematics():
    return load_arm("panda").kinematics()


def seen(kinematics, q):
    return {
        "position": q,
        "p_WE": kinematics.p_WE(q),
        "R_WE": kinematics.R_WE(q),
        "J": np.vstack((kinematics.J_omega(q), kinematics.J(q))),
    }


@pytest.mark.parametrize(("m", "samples"), [(3, 1), (6, 1), (3, 4), (6, 4)])
def test_an_arm_that_moves_about_teaches_its_jacobian(kinematics, m, samples):
    """5e-3 in the median: what J changes over some tens of samples at 1 rad/s, 1 kHz.

    Six rows begin with those of the rotation.
    """
    source = LearnedJacobian(m, N, samples, 1.0, R, 0.0, "zero", turns=m == 6)
    rng = np.random.default_rng(6)
    q, h = np.array([0.0, 0.3, 0.1, -1.8, 0.2, 2.0, 0.5]), 1e-3
    kept = source.init(seen(kinematics, q), rng)
    assert {name: np.shape(part) for name, part in kept.items()} == source.shapes
    for k in range(400):
        q = q + h * np.where(np.arange(N) == (k // 10) % N, 1.0, 0.05) * (-1.0) ** (k // 70)
        J_hat, kept = source.step(kept, seen(kinematics, q), h)
    J = seen(kinematics, q)["J"][-m:]
    assert np.abs(J_hat - J).max() < 2e-2
    assert np.median(np.abs(J_hat - J)) < 5e-3


def test_velocities_are_those_over_the_samples_that_it_is_told(kinematics):
    """The first measurement counts until it is that old: an arm at rest before it began."""
    source = LearnedJacobian(3, 2, 3, 0.0, R, 0.0, "zero")
    places = [np.array([x, 0.0]) for x in (0.0, 0.1, 0.3, 0.6, 1.0)]
    u = [{"position": q, "p_WE": np.array([2 * q[0], 0, 0])} for q in places]
    kept = source.init(u[0], np.random.default_rng(0))
    for signals in u[1:]:
        _, kept = source.step(kept, signals, 0.1)
    np.testing.assert_array_equal(kept["q_before"], [[1.0, 0], [0.6, 0], [0.3, 0]])
    # Whatever the secant, the motion was along the first column.
    np.testing.assert_allclose(kept["J_hat"], [[2, 0], [0, 0], [0, 0]], rtol=1e-4)


@pytest.mark.parametrize("still", [pytest.param(0.0, marks=pytest.mark.long), 3e-3])
def test_an_arm_at_rest_learns_nothing_from_errors_of_measurement(kinematics, still):
    """Half a minute, 10 um of noise, joints that tremble by the feedback: else J_hat walks away."""
    q = np.array([0.0, 0.3, 0.1, -1.8, 0.2, 2.0, 0.5])
    u, rng, h = seen(kinematics, q), np.random.default_rng(8), 1e-3
    source = LearnedJacobian(3, N, 10, 0.1, 4e-4, still, "exact")
    kept = source.init(u | {"J": u["J"][-3:]}, rng)
    for _ in range(30_000):
        tremble = rng.normal(0.0, 2e-6, N)
        noisy = {"position": q + tremble, "p_WE": u["p_WE"] + rng.normal(0.0, 1e-5, 3)}
        J_hat, kept = source.step(kept, noisy, h)
    off = np.linalg.norm(J_hat - u["J"][-3:])
    assert off == 0.0 if still else off > 0.1


def test_how_it_begins(kinematics):
    u = seen(kinematics, np.zeros(N)) | {"J": np.ones((3, N))}
    rng = np.random.default_rng(7)
    begins = {
        kind: LearnedJacobian(3, N, 1, 1.0, R, 0.0, kind).init(u, rng)["J_hat"]
        for kind in ("uniform", "zero", "exact")
    }
    assert (begins["zero"] == 0.0).all()
    np.testing.assert_array_equal(begins["exact"], u["J"])
    assert 0.0 <= begins["uniform"].min() < 0.3 < 0.7 < begins["uniform"].max() <= 1.0
    del u["J"]
    with pytest.raises(InvalidInputError, match=r"^law\.J_hat_initial: exact needs the arm's J"):
        LearnedJacobian(3, N, 1, 1.0, R, 0.0, "exact").init(u, rng)


@pytest.mark.parametrize("late", [0, 1, 4])
def test_the_known_jacobian_is_that_in_the_middle_of_the_next_sample(kinematics, late):
    """Halving the period quarters the error of the extrapolation; that of the last J it halves.

    However late the posture is that J is of.
    """
    q, v = np.array([0.0, 0.3, 0.1, -1.8, 0.2, 2.0, 0.5]), np.linspace(-1, 1, N)
    source, errors, last = MiddleJacobian(3, N, late), [], []
    for h in (2e-3, 1e-3):
        now, middle = (kinematics.J(q + s * h * v) for s in (-late, 0.5))
        rows = [kinematics.J(q - s * h * v) for s in range(late + 1, late + 1 + max(late, 1))]
        J, kept = source.step({"J_before": np.array(rows)}, {"J": now}, h)
        np.testing.assert_array_equal(kept["J_before"], [now, *rows[:-1]])
        errors.append(np.abs(J - middle).max())
        last.append(np.abs(now - middle).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)
    assert last[0] / last[1] == pytest.approx(2.0, rel=0.05)
