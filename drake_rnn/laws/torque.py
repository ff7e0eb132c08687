r"""Joint torques by a projection network: least torques, two criteria, or computed torque.

Sources:
    Hollerbach, Suh, "Redundancy resolution of manipulators through torque optimization", IEEE
    Journal on Robotics and Automation 3 (1987), has the least torque at the level of accelerations;
    its closed form, its weighting by the limits, and the damping of joint velocities were read in a
    report with its public code: Aly, "Torque minimization for redundant manipulators" (2020). A
    network for such a program, with limits of torque, is of Zhang, Ge, Lee, "A unified
    quadratic-programming-based dynamical system approach to joint torque optimization of physically
    constrained redundant manipulators", IEEE Transactions on Systems, Man, and Cybernetics B 34
    (2004), of which an abstract was read. Computed torque is from memory (Luh, Walker, Paul 1980).
    That a mass matrix is learned while a network controls: Li, Su, Yu, Mao, Liu, Fu, "Recurrent
    neural network for trajectory tracking control of manipulator with unknown mass matrix",
    Frontiers in Neurorobotics 18 (2024), of which abstract and introduction were read.

With the dynamics :math:`\tau = M \ddot q + h`, h the torques of velocities and of gravity, the
network (`drake_rnn.laws.projection`) solves in each sample

.. math::
    \min_\tau \tfrac w 2 |\tau - \tau_0|^2 + \tfrac{1 - w} 2 |\ddot q - a_0|^2
    \quad \text{s.t.} \quad J \ddot q = b, \quad |\tau| \le \overline \tau, \quad
    \underline a(q, \dot q) \le \ddot q \le \overline a(q, \dot q)

with

.. math::
    b = \ddot p_d + 2 K (\dot p_d - J \dot q) + K^2 (p_d - p) - \dot J \dot q, \qquad
    \tau_0 = -d M \dot q, \qquad a_0 = -2 k \dot q - k^2 (q - q_0) .

=============  =============  ========================================================
paper          here           meaning
=============  =============  ========================================================
tau            torque         joint torques, which are commanded (state)
M, n = c + g   M, h           mass matrix, torques of velocities and gravity
K_P, K_D       feedback       gains of the feedback, K^2 and 2 K [1/s]
D              damping        rate d at which the least torques take momentum away [1/s]
w              torque_weight  weight of the torques; 0 for accelerations alone
=============  =============  ========================================================

Not in the papers:
    Drake's plant makes its step before the law is sampled: what the law sees is the arm when its
    torque begins to act, one period after the time of the sample, and so is the path that it is
    shown (`p_preview`). Torques are the
    variables of the network, so their limits are what it projects on; what is commanded is clipped
    to them besides, whatever the network has reached. The task and the bounds of joints are soft,
    so that the limits of torque come first where not all can hold.

A mass matrix that is learned. One sample of Drake's discrete plant obeys, with what acted in it,

.. math::
    \tau - h = (\hat M, \hat \tau) (\Delta \dot q / \Delta t, 1)^T

up to the change of M within the sample. Recursive least squares with a random walk of the entries
(`wander`) follow them: all rows see the same regressor, so they share a covariance. The matrix that
is used is the symmetric part, with its eigenvalues raised to a least one. tau_hat takes what h does
not know, such as the weight of a payload.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np

from ..arrays.algebra import (
    acts,
    clip,
    dot,
    functions_of,
    join,
    matmul,
    matvec,
    outer,
    scale,
    solve,
    solved_for,
    transpose,
    vecmat,
)
from ..inputs.fields import (
    Array,
    Bounds,
    Flag,
    Gain,
    GainOrZero,
    NonNegative,
    Positive,
    Vector,
    Weight,
    between,
    validated,
)
from ..inputs.keys import Meaning, Only
from ..robot.limits import JointLimits
from .law import Layout, SampledLaw, Signals
from .parts.programs import Program, Rates, stacked_rows
from .projection import ProjectionNetwork

_OF_NETWORK = (Only("network", "lvi", "simplified_lvi"),)
_OF_LEARNING = (Only("mass", "learned"),)
_NO_RATES = Rates()
# Metrics of joints beyond their limits, with their units; less than that is rounding.
_VIOLATIONS = {
    "position": ("position_violation_max_rad", "rad"),
    "velocity": ("velocity_violation_max_rad_s", "rad/s"),
    "acceleration": ("acceleration_violation_max_rad_s2", "rad/s²"),
}
_ROUNDING = 1e-6
# Variance of an entry of M_hat at the start [kg^2 m^4], and its size there [kg m^2].
_UNKNOWN, _GUESS = 10.0, 0.5
# Frequencies of the excitation of the first joint and the last [Hz].
_SLOWEST, _FASTEST = 5.0, 20.0


@validated
class JointTorque(SampledLaw):
    """A sampled law whose command is a torque of each joint."""

    kind: Literal["joint_torque"] = "joint_torque"
    summary = "Joint torques by a projection network: least torques, two criteria, computed torque."
    limits: Annotated[
        JointLimits,
        Meaning("Limits of the joints; with ``bounds: joints`` those up to the acceleration."),
    ]
    home: Annotated[
        Vector,
        Meaning("Posture at the start, which the joints return to, shape (n,).", unit="rad"),
    ]
    torque_limits: Annotated[
        Bounds | None,
        Meaning(
            "Largest torques, shape (n,); infinite for a joint without one, None for no limits.",
            unit="N m",
        ),
    ] = None
    task_size: Annotated[Literal[1, 2, 3], Meaning("Number of rows of J.")] = 3
    torque_share: Annotated[
        Positive, between(1e-3, 1.0), Meaning("Share of the arm's limits of torque that it uses.")
    ] = 1.0
    network: Annotated[
        Literal["simplified_lvi", "lvi", "none"],
        Meaning(
            "``simplified_lvi`` or ``lvi``, see `drake_rnn.laws.projection`; ``none`` for the "
            "closed form of the program without bounds, clipped to the limits of torque.",
        ),
    ] = "simplified_lvi"
    torque_weight: Annotated[
        NonNegative,
        between(0.0, 1.0),
        Meaning(
            "Weight w of the torques beside the accelerations, whose is 1 - w: 1 for the least "
            "torques, 0 for computed torque.",
        ),
    ] = 1.0
    weighed: Annotated[
        Literal["motion", "all"],
        Meaning(
            "Which torques are weighed: ``motion``, those beside what holds the weight; ``all``, "
            "with which an arm under gravity falls wherever the task leaves it free to.",
        ),
    ] = "motion"
    shares: Annotated[
        Flag, Meaning("Whether torques are weighed as shares of their limits, not in N m.")
    ] = False
    feedback: Annotated[
        Gain,
        Meaning("Gain K of the feedback, K^2 of the position.", unit="1/s"),
    ] = 20.0
    velocity_feedback: Annotated[
        Gain | None,
        Meaning("Gain of the feedback of the velocity; by default 2 K.", unit="1/s"),
    ] = None
    damping: Annotated[
        GainOrZero,
        Meaning(
            "Rate d at which the least torques take momentum from motions that the task leaves "
            "free; 0 for the least torques as they are.",
            unit="1/s",
        ),
    ] = 10.0
    return_gain: Annotated[
        GainOrZero,
        Meaning(
            "Gain k of the way back to the posture at the start, in the accelerations that are "
            "preferred.",
            unit="1/s",
        ),
    ] = 2.0
    bounds: Annotated[
        Literal["none", "joints"],
        Meaning(
            "``joints`` has accelerations after which the limits of position, velocity and "
            "acceleration can still be kept as inequalities of the program; ``none`` has none.",
            only=_OF_NETWORK,
        ),
    ] = "none"
    gain: Annotated[Gain, Meaning("Gain gamma of the network.", unit="1/s", only=_OF_NETWORK)] = 1e8
    softness: Annotated[
        Weight,
        Meaning("Softness of the task and of the bounds of joints, of a program scaled to 1."),
    ] = 1e-5
    mass: Annotated[
        Literal["known", "learned"],
        Meaning("``known`` reads M; ``learned`` learns it from torques and velocities."),
    ] = "known"
    wander: Annotated[
        NonNegative,
        Meaning("Growth of the variance of M_hat's entries [kg^2 m^4 / s].", only=_OF_LEARNING),
    ] = 0.01
    variance: Annotated[
        Positive,
        Meaning("Variance of the torque that the model leaves [N^2 m^2].", only=_OF_LEARNING),
    ] = 1e-4
    least_mass: Annotated[
        Positive,
        Meaning("Least eigenvalue of M_hat.", unit="kg m^2", only=_OF_LEARNING),
    ] = 1e-2
    excitation: Annotated[
        NonNegative,
        between(0.0, 1.0),
        Meaning(
            "Amplitude of sines that are added to the torques, as a share of their limits; each "
            "joint has a frequency of its own."
        ),
    ] = 0.0

    takes_many = True
    commands_torque = True

    def __post_init__(self) -> None:
        self.limits.require_size("home", self.home)
        if self.torque_limits is not None:
            self.limits.require_size("torque_limits", self.torque_limits)
            if not (self.torque_limits > 0.0).all():
                text = self.torque_limits.tolist()
                raise ValueError(f"torque_limits: must be positive, not {text}")
        if self.bounds == "joints":
            if self.network == "none":
                raise ValueError("bounds: joints needs a network: lvi or simplified_lvi")
            self.limits.require("acceleration", "bounds: joints")
        if acts(self.excitation) and not np.isfinite(self._most).all():
            raise ValueError(
                "excitation: is a share of the limits of torque, but joint "
                f"{int(np.argmin(np.isfinite(self._most))) + 1} has none; leave it out"
            )

    @cached_property
    def _learns(self) -> bool:
        return self.mass == "learned"

    @cached_property
    def _most(self) -> Array:
        """Largest torques that it commands, shape (n,) [Nm]."""
        if self.torque_limits is None:
            return np.full(self.limits.size, np.inf)
        return self.torque_share * self.torque_limits

    @cached_property
    def _scale(self) -> Array:
        """Torques that count as 1, shape (n,) [Nm]."""
        xp = functions_of(self._most)
        return xp.where(xp.isfinite(self._most), self._most, 1.0)

    @cached_property
    def _network(self) -> ProjectionNetwork | None:
        if self.network == "none":
            return None
        n, m = self.limits.size, self.task_size
        rows = 2 * n if self.bounds == "joints" else 0
        return ProjectionNetwork(
            *(self.network, n, m, True, rows, self.gain, "implicit", 0, self.softness)
        )

    @cached_property
    def state(self) -> Layout:
        n = self.limits.size
        parts: dict[str, tuple[int, ...]] = {"v": (n,), "torque": (n,)}
        if self._network is not None:
            parts |= self._network.shapes
        if self._learns:
            parts |= {"M_hat": (n, n), "torque_hat": (n,), "covariance": (n + 1, n + 1)}
            parts |= {"h_before": (n,), "velocity_before": (n,)}
        if acts(self.excitation):
            parts["phases"] = (n,)
        return Layout(**parts)

    @cached_property
    def inputs(self) -> Layout:
        n, m = self.limits.size, self.task_size
        known = {} if self._learns else {"M": (n, n)}
        path = {f"{letter}_preview": (m,) for letter in "pva"}
        parts: dict[str, tuple[int, ...]] = {
            **{"position": (n,), "velocity": (n,), "p_WE": (m,), "J": (m, n), "Jdot_v": (m,)},
            **{**known, "bias": (n,), "gravity": (n,)},
            **path,
        }
        return Layout(**parts)

    @cached_property
    def observables(self) -> Layout:
        return Layout(torque_share=(1,), saturated=(1,), joint_power=(1,))

    @property
    def keeps_torque(self) -> tuple[float, ...] | None:
        """See `Law.keeps_torque`; what it commands is clipped to them."""
        most = np.asarray(self._most)
        return tuple(most.tolist()) if np.isfinite(most).any() else None

    @property
    def loop_gains(self) -> Mapping[str, float]:
        return {"feedback": self.feedback}

    @property
    def sampled_gains(self) -> Mapping[str, float]:
        return {
            "feedback": self.feedback,
            "damping": self.damping,
            "return_gain": self.return_gain,
        }

    @property
    def limits_remedy(self) -> str:
        return "a slower path asks for less, and bounds: joints counts with the limits of joints"

    def caveats(self, metrics: Mapping[str, float]) -> list[str]:
        """Return warnings of torques at their limits and of joints beyond theirs.

        See `Reading.caveats`.
        """
        sentences = []
        if (share := metrics.get("saturated_fraction", 0.0)) > 0.0:
            sentences.append(
                f"law: a limit of torque acts in {share:.2g} of the samples; torques come first "
                "there, before the path and the limits of joints"
            )
        if self.bounds == "joints":
            excesses = [
                f"{name} by {value:.3g} {unit}"
                for name, (metric, unit) in _VIOLATIONS.items()
                if (value := metrics.get(metric, 0.0)) > _ROUNDING
            ]
            if excesses:
                sentences.append(
                    "law: bounds: joints are approached by the network and not kept by "
                    f"construction; beyond its limit is {', '.join(excesses)}"
                )
        return sentences

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        """Return a state that holds the arm, see `Reading.initial_state`."""
        n = self.limits.size
        parts = {name: np.zeros(shape) for name, shape in self.state.shapes.items()}
        parts["torque"] = clip(-u["gravity"], -self._most, self._most)
        if self._learns:
            parts["M_hat"] = _GUESS * np.eye(n)
            parts["covariance"] = _UNKNOWN * np.eye(n + 1)
            parts["h_before"] = u["bias"] - u["gravity"]
            parts["velocity_before"] = u["velocity"]
        if acts(self.excitation):
            parts["phases"] = rng.uniform(0.0, 2.0 * np.pi, n)
        return self.state.from_parts(parts)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        state = self.state.by_name(x)
        M, h, learned = self._dynamics(state, u, period)
        drift, B = (
            -solved_for(M, h),
            solve(M, self._scale[..., None] * np.eye(self.limits.size) + 0.0 * M),
        )
        program = self._program(u, M, B, drift, period)
        network: Mapping[str, Array] = {}
        if self._network is None:
            optimum = _unbounded(program, self.softness)
        else:
            optimum, network = self._network.step(state, u, period, t, program, _NO_RATES)
        torque = self._scale * optimum
        if acts(self.excitation):
            turns = 2.0 * np.pi * np.linspace(_SLOWEST, _FASTEST, self.limits.size)
            sines = functions_of(torque).sin(turns * t + state["phases"])
            torque = torque + self.excitation * self._most * sines
            network = {**network, "phases": state["phases"]}
        torque = clip(torque, -self._most, self._most)
        v = u["velocity"] + period * (solved_for(M, torque) + drift)
        return self.state.from_parts({"v": v, "torque": torque, **network, **learned})

    def _program(self, u: Signals, M: Array, B: Array, drift: Array, period: float) -> Program:
        """Return the program of a sample, in shares of the limits of torque.

        Args:
            u: Signals.
            M: Mass matrix, shape (..., n, n).
            B: Accelerations of these shares, shape (..., n, n).
            drift: Those without any torque, shape (..., n).
            period: Time until the next sample [s].
        """
        J, velocity = u["J"], u["velocity"]
        K, k, w = self.feedback, self.return_gain, self.torque_weight
        D = 2.0 * K if self.velocity_feedback is None else self.velocity_feedback
        b = u["a_preview"] + D * (u["v_preview"] - matvec(J, velocity))
        b = b + K * K * (u["p_preview"] - u["p_WE"]) - u["Jdot_v"] - matvec(J, drift)
        preferred = -2.0 * k * velocity - k * k * (u["position"] - self.home) - drift
        target = -self.damping * matvec(M, velocity)
        if self.weighed == "motion":
            target = target - u["gravity"]
        target = target / self._scale
        unit = np.ones_like(self._scale) if self.shares else self._scale
        square = unit * unit
        W = scale(w, square[..., None] * np.eye(square.shape[-1]))
        W = W + scale(1.0 - w, matmul(transpose(B), B))
        c = -w * square * target - (1.0 - w) * vecmat(preferred, B)
        A = matmul(J, B)
        # Everything in its own unit, so that one softness suits all.
        size, length = _mean_diagonal(W), _root(_mean_diagonal(matmul(A, transpose(A))))
        xp = functions_of(self._most)
        most = xp.where(xp.isfinite(self._most), 1.0, 1e6)
        limits = -most + 0.0 * c, most + 0.0 * c
        program = Program(W / size[..., None], c / size, A / length[..., None], b / length, limits)
        if self.bounds == "none":
            return program
        lower, upper = self.limits.acceleration_box(u["position"], velocity, period)
        own = _root(_mean_diagonal(matmul(B, transpose(B))))
        rows = B / own[..., None]
        sides = join(((upper - drift) / own, (drift - lower) / own))
        return program._replace(C=stacked_rows([rows, -rows]), d=sides, soft=self.softness)

    def _dynamics(
        self, state: Mapping[str, Array], u: Signals, period: float
    ) -> tuple[Array, Array, Mapping[str, Array]]:
        """Return M, h and the parts of the state of what is learned."""
        h = u["bias"] - u["gravity"]
        if not self._learns:
            return u["M"], h, {}
        theta = self._learn(state, u, period)
        M_hat, torque_hat = theta["M_hat"], theta["torque_hat"]
        memory = {"h_before": h, "velocity_before": u["velocity"]}
        return self._definite(M_hat), h + torque_hat, {**theta, **memory}

    def _learn(self, state: Mapping[str, Array], u: Signals, period: float) -> dict[str, Array]:
        """Return M_hat, torque_hat and their covariance after what the last sample showed."""
        acceleration = (u["velocity"] - state["velocity_before"]) / period
        phi = join((acceleration, 1.0 + 0.0 * acceleration[..., :1]))
        residual = state["torque"] - state["h_before"]
        residual = residual - matvec(state["M_hat"], acceleration) - state["torque_hat"]
        covariance = state["covariance"]
        reach = matvec(covariance, phi)
        gain = reach / (self.variance + dot(phi, reach))
        covariance = covariance - outer(gain, reach)
        covariance = covariance + scale(period * self.wander, np.eye(self.limits.size + 1))
        change = outer(residual, gain)
        return {
            "M_hat": state["M_hat"] + change[..., :-1],
            "torque_hat": state["torque_hat"] + change[..., -1],
            "covariance": 0.5 * (covariance + transpose(covariance)),
        }

    def _definite(self, M_hat: Array) -> Array:
        """Return the symmetric part of a matrix, its eigenvalues raised to the least one."""
        symmetric = 0.5 * (M_hat + transpose(M_hat))
        xp = functions_of(symmetric)
        values, vectors = xp.linalg.eigh(symmetric)
        raised = xp.maximum(values, self.least_mass)
        return matmul(vectors * raised[..., None, :], transpose(vectors))

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        torque = self.state.part(x, "torque")
        share = self.torque_share * abs(torque / self._most).max(axis=-1, keepdims=True)
        at_limit = share >= self.torque_share * (1.0 - 1e-9)
        power = abs(torque * u["velocity"]).sum(axis=-1, keepdims=True)
        return {
            "torque_share": share,
            "saturated": at_limit.astype(float),
            "joint_power": power,
        }


def _mean_diagonal(A: Array) -> Array:
    """Return the mean of the diagonal of a matrix, shape (..., n, n), of shape (..., 1)."""
    return (A * np.eye(A.shape[-1])).sum(axis=(-2, -1))[..., None] / A.shape[-1]


def _root(square: Array) -> Array:
    """Return the roots of squares; of nothing, a number by which it can be divided."""
    xp = functions_of(square)
    return xp.sqrt(xp.maximum(square, 1e-24))


def _unbounded(program: Program, softness: Any) -> Array:
    """Return the optimum of a program without its bounds, shape (..., k)."""
    W, c, A, b = program[:4]
    T, least = solve(W, transpose(A)), solved_for(W, c)
    soft = matmul(A, T) + scale(softness, np.eye(b.shape[-1]))
    return matvec(T, solved_for(soft, b + matvec(A, least))) - least
