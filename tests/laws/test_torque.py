"""Joint torques: limits that always hold, the optimum of the program, a mass matrix learned."""

import daqp
import numpy as np
import pytest

from drake_rnn import InvalidInputError, JointLimits, JointTorque
from row_helpers import each

N, M_ROWS, PERIOD = 7, 3, 1e-3
MOST = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])
LIMITS = JointLimits(
    position_lower=np.full(N, -2.8),
    position_upper=np.full(N, 2.8),
    velocity=np.full(N, 2.0),
    acceleration=np.full(N, 10.0),
)
HOME = np.linspace(-0.5, 0.5, N)


def law(**options):
    return JointTorque(**{"limits": LIMITS, "home": HOME, "torque_limits": MOST, **options})


def signals(rng, scale=1.0):
    """Signals of an arm with a mass matrix of a Panda's size; ``scale`` makes them wild."""
    root = rng.normal(size=(N, N)) * np.sqrt([0.8, 1.0, 0.6, 0.6, 0.05, 0.05, 0.02])[:, None]
    return {
        "position": HOME + 0.3 * scale * rng.normal(size=N),
        "velocity": 0.3 * scale * rng.normal(size=N),
        "p_WE": 0.01 * scale * rng.normal(size=M_ROWS),
        "J": rng.normal(size=(M_ROWS, N)),
        "Jdot_v": 0.1 * scale * rng.normal(size=M_ROWS),
        "M": root @ root.T + 0.02 * np.eye(N),
        "bias": scale * rng.normal(size=N),
        "gravity": 0.2 * MOST * rng.normal(size=N),
        "p_preview": np.zeros(M_ROWS),
        "v_preview": 0.1 * scale * rng.normal(size=M_ROWS),
        "a_preview": scale * rng.normal(size=M_ROWS),
    }


def command(this, u, steps=1):
    """Return the torques that a law commands after some samples of the same signals."""
    u = {name: u[name] for name in this.inputs.parts}
    x = this.initial_state(np.random.default_rng(0), u)
    for k in range(steps):
        x = this.step(k * PERIOD, x, u, PERIOD)
    return this.state.part(x, "torque")


@each(
    "options",
    [
        {"network": "none"},
        {"gain": 10.0},
        {"network": "lvi", "bounds": "joints", "gain": 1e3},
        {"torque_weight": 0.0, "bounds": "joints", "torque_share": 0.1},
        {"mass": "learned", "excitation": 0.5},
    ],
)
def test_no_input_leads_a_torque_beyond_its_limit(options):
    """Also where the network has not converged, or nothing keeps the task and all bounds."""
    this, rng = law(**options), np.random.default_rng(0)
    most = options.get("torque_share", 1.0) * MOST
    reached = 0.0
    for _ in range(20):
        u = {name: v for name, v in signals(rng, 30.0).items() if name in this.inputs.parts}
        x = rng.normal(size=this.state.size) * 1e3
        if "covariance" in this.state:
            x = this.state.with_parts(x, covariance=np.eye(N + 1), M_hat=np.eye(N))
        torque = this.state.part(this.step(0.0, x, u, PERIOD), "torque")
        assert (np.abs(torque) <= most).all()
        reached = max(reached, (np.abs(torque) / most).max())
    assert reached == 1.0


def demand(this, u):
    """Return the acceleration of the end effector that a law asks for."""
    K = this.feedback
    away, behind = u["p_preview"] - u["p_WE"], u["v_preview"] - u["J"] @ u["velocity"]
    return u["a_preview"] + 2 * K * behind + K * K * away - u["Jdot_v"]


@each("network", ["none", "lvi", "simplified_lvi"])
def test_least_torques_do_the_task_and_no_others_that_do_are_smaller(network):
    """Among the torques that make the demanded acceleration: the gradient has no free part."""
    u, options = signals(np.random.default_rng(1)), {"network": network, "softness": 1e-9}
    options["torque_limits"] = 20.0 * MOST
    this = law(damping=3.0, **options)
    h = u["bias"] - u["gravity"]
    torque = command(this, u, 3)
    acceleration = np.linalg.solve(u["M"], torque - h)
    assert u["J"] @ acceleration == pytest.approx(demand(this, u), abs=1e-5)
    beyond = torque + u["gravity"] + 3.0 * u["M"] @ u["velocity"]
    rows = u["J"] @ np.linalg.inv(u["M"])
    free = np.eye(N) - np.linalg.pinv(rows) @ rows
    assert np.abs(free @ beyond).max() < 1e-4
    easy = command(law(torque_weight=0.0, **options), u, 3)
    assert u["J"] @ np.linalg.solve(u["M"], easy - h) == pytest.approx(demand(this, u), abs=1e-5)
    least = np.linalg.norm(beyond)
    assert least < np.linalg.norm(easy + u["gravity"] + 3.0 * u["M"] @ u["velocity"])


def test_where_limits_act_a_network_is_at_the_optimum_and_clipping_is_not():
    """The optimum is that of daqp, for the program with the task as an equation."""
    u, this = signals(np.random.default_rng(5)), law(torque_weight=0.4, softness=1e-9)
    h, B = u["bias"] - u["gravity"], np.linalg.inv(u["M"])
    free = command(law(torque_weight=0.4, network="none", softness=1e-9), u, 1)
    # Less than what the joint of the largest share would get.
    share = 0.9 * float((np.abs(free) / MOST).max())
    this = law(torque_weight=0.4, torque_share=share, softness=1e-9)
    target = -u["gravity"] - this.damping * u["M"] @ u["velocity"]
    k = this.return_gain
    preferred = -2 * k * u["velocity"] - k * k * (u["position"] - HOME) + B @ h
    H = 0.4 * np.eye(N) + 0.6 * B.T @ B
    f = -0.4 * target - 0.6 * B.T @ preferred
    rows, sides = u["J"] @ B, demand(this, u) + u["J"] @ B @ h
    lower = np.concatenate((-share * MOST, sides))
    upper = np.concatenate((share * MOST, sides))
    sense = np.array([0] * N + [5] * M_ROWS, dtype=np.int32)
    best, _, flag, _ = daqp.solve(H, f, rows, upper, lower, sense)
    assert flag > 0
    torque = command(this, u, 5)
    assert torque == pytest.approx(best, abs=2e-3)
    clipped = np.clip(free, -share * MOST, share * MOST)
    off = [np.linalg.norm(rows @ each - sides) for each in (torque, clipped)]
    assert off[0] < 1e-3 < 0.1 < off[1]


def test_bounds_of_joints_give_way_where_torques_are_at_their_limits():
    """A joint that falls faster than it may: with torque to spare it is braked, without, not."""
    u = signals(np.random.default_rng(2))
    u |= {"velocity": np.array([1.9999, 0, 0, 0, 0, 0, 0]), "J": np.zeros((M_ROWS, N))}
    u["gravity"] = np.array([60.0, 0, 0, 0, 0, 0, 0])
    found = {}
    for share in (1.0, 0.1):
        for bounds in ("joints", "none"):
            this = law(bounds=bounds, torque_share=share, torque_weight=1.0, damping=0.0)
            torque = command(this, {**u, "gravity": u["gravity"]}, 5)
            assert (np.abs(torque) <= share * MOST).all()
            acceleration = np.linalg.solve(u["M"], torque - u["bias"] + u["gravity"])
            found[share, bounds] = acceleration[0]
    _, upper = LIMITS.acceleration_box(u["position"], u["velocity"], PERIOD)
    assert found[1.0, "joints"] <= upper[0] + 1e-3
    assert found[0.1, "joints"] > upper[0] + 1.0


def test_a_constant_mass_matrix_is_learned_from_what_torques_do():
    """Eight samples with independent accelerations leave nothing to be known of n + 1 columns."""
    rng = np.random.default_rng(4)
    this = law(
        network="none",
        torque_weight=0.0,
        mass="learned",
        excitation=0.2,
        wander=0.0,
        variance=1e-12,
    )
    u = signals(rng)
    M, load = u["M"], rng.normal(size=N)
    told = {name: u[name] for name in this.inputs.parts}
    x = this.initial_state(rng, told)
    velocity, errors = u["velocity"].copy(), []
    for k in range(40):
        # What the plant makes of the law's torques, its h, and a load that it does not know.
        torque = this.state.part(x, "torque")
        h = u["bias"] - u["gravity"] + load
        velocity = velocity + PERIOD * np.linalg.solve(M, torque - h)
        x = this.step(k * PERIOD, x, {**told, "velocity": velocity}, PERIOD)
        errors.append(np.abs(this.state.part(x, "M_hat") - M).max())
    assert errors[0] > 0.1
    assert errors[-1] < 1e-5
    assert this.state.part(x, "torque_hat") == pytest.approx(load, abs=1e-4)


def test_the_matrix_that_is_used_is_symmetric_and_positive():
    this = law(mass="learned", least_mass=0.05)
    used = this._definite(np.diag([1.0, -3.0, 0.01, 1, 1, 1, 1]) + np.triu(np.ones((N, N)), 1))
    assert used == pytest.approx(used.T)
    assert np.linalg.eigvalsh(used).min() >= 0.05 - 1e-12


@each(
    ("options", "said"),
    [
        ({"bounds": "joints", "network": "none"}, "bounds: joints needs a network"),
        ({"torque_weight": 2.0}, "torque_weight"),
        ({"torque_share": 0.0}, "torque_share"),
        ({"excitation": 0.1, "torque_limits": None}, "excitation: is a share of the limits"),
        ({"torque_limits": -MOST}, "torque_limits: must be positive"),
        ({"torque_limits": MOST[:3]}, "torque_limits: must have"),
    ],
)
def test_what_makes_no_law_is_refused(options, said):
    with pytest.raises(InvalidInputError, match=said):
        JointTorque(**{"limits": LIMITS, "home": HOME, "torque_limits": MOST, **options})
