r"""Data-driven motion-force control: the arm follows a path on a surface and presses against it.

Source:
    "Data-driven motion-force control scheme for redundant manipulators: a kinematic
    perspective". RNN (19) knows the Jacobian, (21) and (22) learn it.

At every instant the network tracks the solution of

.. math::
    \min_v \tfrac12 v^T v \quad \text{s.t.} \quad A J v = W, \quad H v = w_d, \quad
    \underline{v}(q) \le v \le \overline{v}(q)

by the projected primal-dual dynamics

.. math::
    \delta \dot v = -v + P(-J^T A^T \lambda_1 - H^T \lambda_2), \qquad
    \delta \dot\lambda_1 = A J v - W, \qquad \delta \dot\lambda_2 = H v - w_d,

where A splits the velocity of the tip into the part along the surface's normal n, which presses,
and the part along the surface, with P_n = n n^T and P_t = I - P_n, and

.. math:: W = A\,[P_t (\dot p_d + k (p_d - p)) + k\, e\, n], \qquad e = (F - F_d) / \eta

is the desired value of A J v. ``jacobian: learned`` replaces J by a learned Jacobian.

========  =======================  ==========================================
paper     here                     meaning
========  =======================  ==========================================
q         position                 joint positions
q-dot     v                        joint velocities (state)
lambda_1  multipliers              multipliers of the position rows (state)
lambda_2  orientation_multipliers  multipliers of the orientation rows (state)
J-tilde   J_hat                    learned Jacobian of the position (state)
R         R_WE                     orientation, the tool's axes as columns
f_b, f_d  normal_force(_desired)   pressing force, >= 0 [N]
eta       stiffness                stiffness of the surface [N/m]
delta     time_constant            time constant of the network [s]
k         gain                     gain of position and force feedback [1/s]
rho       rho                      time constant of the learning [rad^2/s]
alpha     limit_stiffness          velocity per radian to a position limit [1/s]
-         normal_WE                outward normal n of the surface
========  =======================  ==========================================

Corrected:
    (8) rotates by R, but its columns require R^T; n is the surface's normal. (3) has its
    bounds swapped, and (28a) repeats lambda_1. (21a) and (22a) use the true J^T although the
    structure is unknown: ``jacobian: printed`` does so too, ``learned`` uses the learned one.
    w = [b2, b3, c2, c3] (11) has rank 1 instead of 3 for a tool that points straight down,
    so ``orientation: printed`` drifts there. ``rotation`` uses the angular velocity instead,
    H = J_omega, with feedback of the rotation error, and follows a path that turns the tool.

Left out:
    The rate of the desired force in W of (14) and (15). It is zero for a constant force, as in the
    paper; a force that rises is followed with a lag of its rate over the gain.

Not in the paper:
    ``form: normalised`` divides the force rows by eta, so that A = [P_n; P_t], and merges the
    two multipliers of each direction, which have the same effect on the joints. It has three
    multipliers instead of the paper's six and can be sampled at 1 kHz. The network's fastest
    mode oscillates at ``eta |J| / (2 pi delta)``, several kHz for ``form: literal``, which
    therefore takes substeps of 20 us; in return, its remaining force error is smaller by a
    factor of eta^2. The paper computes F as eta times the depth of the tip according to its
    own kinematics, ``force_feedback: assumed``. ``measured`` uses a sensor, and eta then acts
    as a gain: integral control of the force, with the rate k K / eta for a contact of
    stiffness K. `OnlineStiffness` learns eta, ``approach_speed`` bounds the speed along the
    normal, and `ContactLoss` defines the reaction to a lost contact.

    The least-norm v has no term that brings the joints back after a lap. With ``return_gain`` kappa
    the network minimises ``|v - kappa (q_0 - q)|^2 / 2`` instead: the joints return to the start
    posture q_0 as far as the tasks leave them free.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Literal

import numpy as np

from ..arrays.algebra import acts, flat, functions_of, join, matmul, matvec
from ..errors import InvalidInputError
from ..inputs.fields import (
    Array,
    Gain,
    GainOrZero,
    NonNegative,
    Positive,
    Speed,
    Stiffness,
    TimeConstant,
    Vector,
    Weight,
    validated,
)
from ..inputs.keys import Meaning, Only
from ..robot.limits import JointLimits
from ..robot.rotation import rotation_error
from .law import (
    Circumstances,
    ContinuousLaw,
    ContinuousReading,
    Layout,
    SampledLaw,
    SampledReading,
    Signals,
)
from .parts.bounded_velocity import kept_with_lag
from .parts.jacobian import (
    first_J_hat,
    gradient,
    rank_one_update,
)
from .parts.programs import PrimalDual, check_substeps, not_outward, substeps, within
from .parts.surface_task import (
    ContactLoss,
    FixedStiffness,
    OnlineStiffness,
    SurfaceTask,
    printed_orientation_rows,
    surface_split,
)

# Fewer than of other networks: each takes four evaluations of longer equations.
_MOST_SUBSTEPS = 1000


@validated
class MotionForce(SampledLaw, ContinuousLaw):
    """RNN (19), (21) or (22), with extensions for a real contact."""

    kind: Literal["motion_force"] = "motion_force"
    summary = (
        "Data-driven motion-force control: the arm follows a path on a surface and presses "
        "against it."
    )
    limits: Annotated[JointLimits, Meaning("Position and velocity limits of the joints.")]
    stiffness: Annotated[
        Stiffness | OnlineStiffness,
        Meaning(
            "Stiffness of the surface [N/m], or an `OnlineStiffness` that learns it.",
            unit="N/m",
        ),
    ]
    jacobian: Annotated[
        Literal["known", "learned", "printed"],
        Meaning("``known``; ``learned``; or ``printed``, learned except for J^T in (22a)."),
    ] = "known"
    J_hat_initial: Annotated[
        Literal["zero", "exact"],
        Meaning(
            "Initial value of a learned Jacobian: ``zero``, or ``exact``, the true one.",
            only=(Only("jacobian", "learned", "printed"),),
        ),
    ] = "zero"
    multipliers_initial: Annotated[
        NonNegative,
        Meaning(
            "Upper end of the uniform draw, from zero, of all initial multipliers; the paper's "
            "is 0.1.",
        ),
    ] = 0.0
    rho: Annotated[
        Weight,
        Meaning(
            "Time constant of the learning.",
            unit="rad^2/s",
            only=(Only("jacobian", "learned", "printed"),),
        ),
    ] = 1e-6
    gain: Annotated[Gain, Meaning("Gain of the position and force feedback.", unit="1/s")] = 10.0
    orientation: Annotated[
        Literal["rotation", "printed"],
        Meaning("``rotation``, or the paper's ``printed``."),
    ] = "rotation"
    orientation_gain: Annotated[
        GainOrZero,
        Meaning("Gain of the rotation error.", unit="1/s", only=(Only("orientation", "rotation"),)),
    ] = 10.0
    form: Annotated[
        Literal["normalised", "literal"],
        Meaning("``normalised``, or the paper's ``literal``."),
    ] = "normalised"
    force_feedback: Annotated[
        Literal["measured", "assumed"],
        Meaning("``measured``, or the paper's ``assumed``."),
    ] = "measured"
    approach_speed: Annotated[
        Speed | None,
        Meaning("Largest commanded speed along the normal; None for no bound.", unit="m/s"),
    ] = None
    contact_loss: Annotated[
        ContactLoss | None,
        Meaning("Reaction to a lost contact; None to ignore it."),
    ] = None
    return_gain: Annotated[
        GainOrZero,
        Meaning(
            "Rate of return to the start posture [1/s], where the tasks leave the joints free; "
            "the paper has none.",
            unit="1/s",
        ),
    ] = 0.0
    home: Annotated[
        Vector | None,
        Meaning("Posture to return to, shape (n,); needed with ``return_gain`` only.", unit="rad"),
    ] = None
    time_constant: Annotated[
        TimeConstant,
        Meaning("Time constant of the network.", unit="s"),
    ] = 1e-3
    multiplier_limit: Annotated[
        Positive | Literal["none"],
        Meaning(
            "Largest norm of what the position rows' multipliers, and of what those of the "
            "orientation, ask of the tool [rad^2/(s m), rad/s]; ``none`` for no bound, as in the "
            "paper. On a path that an arm can follow they reach about 1.",
        ),
    ] = 10.0
    limit_stiffness: Annotated[
        Gain,
        Meaning("Velocity allowed per radian left to a position limit.", unit="1/s"),
    ] = 10.0

    takes_many = True

    def __post_init__(self) -> None:
        learns_stiffness = isinstance(self.stiffness, OnlineStiffness)
        if self.force_feedback == "assumed":
            for name, value in (
                ("stiffness", learns_stiffness),
                ("contact_loss", self.contact_loss is not None),
            ):
                if value:
                    raise ValueError(
                        f"{name}: needs force_feedback: measured; with assumed there is no force "
                        "signal"
                    )
        if self.form == "literal" and learns_stiffness:
            raise ValueError(
                "stiffness: must be a number with form: literal, which scales its rows by it"
            )
        if self.home is not None:
            self.limits.require_size("home", self.home)
        if self.return_gain > 0.0 and self.home is None:
            raise ValueError("return_gain: needs home, the posture to return to")

    @property
    def learns_jacobian(self) -> bool:
        """See `Law.learns_jacobian`; also the Jacobian that is printed is learned in part."""
        return self.jacobian != "known"

    @property
    def presses(self) -> bool:
        """See `Law.presses`."""
        return True

    @cached_property
    def _task(self) -> SurfaceTask:
        stiffness = self.stiffness
        surface = stiffness if isinstance(stiffness, OnlineStiffness) else FixedStiffness(stiffness)
        is_measured = self.force_feedback == "measured"
        return SurfaceTask(self.gain, surface, is_measured, self.approach_speed, self.contact_loss)

    @cached_property
    def _dual(self) -> Layout:
        """State of the network, with which the state begins."""
        return Layout(
            v=(self.limits.size,),
            multipliers=(6,) if self.form == "literal" else (3,),
            orientation_multipliers=(4,) if self.orientation == "printed" else (3,),
        )

    @cached_property
    def state(self) -> Layout:
        network = {name: shape for name, (_, shape) in self._dual.parts.items()}
        jacobian_part = {"J_hat": (3, self.limits.size)} if self.learns_jacobian else {}
        return Layout(**network, **jacobian_part, **self._task.shapes)

    @cached_property
    def inputs(self) -> Layout:
        n = self.limits.size
        parts: dict[str, tuple[int, ...]] = {
            "position": (n,),
            "p_WE": (3,),
            "R_WE": (3, 3),
            "J_omega": (3, n),
            "p_WE_desired": (3,),
            "v_WE_desired": (3,),
            "R_WE_desired": (3, 3),
            "w_WE_desired": (3,),
            **self._task.inputs,
        }
        if self.jacobian != "learned":
            parts["J"] = (3, n)
        if self.learns_jacobian:
            parts |= {"velocity": (n,), "v_WE": (3,)}
        return Layout(**parts)

    @cached_property
    def observables(self) -> Layout:
        n = self.limits.size
        parts = {"velocity_lower": (n,), "velocity_upper": (n,), "saturated": (1,)}
        if self.orientation == "printed":
            parts["orientation_rank"] = (1,)
        return Layout(**parts, **self._task.observables)

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        parts = {name: np.zeros(shape) for name, (_, shape) in self.state.parts.items()}
        if self.learns_jacobian:
            parts["J_hat"] = first_J_hat(self.J_hat_initial, parts["J_hat"].shape, rng, u)
        if self.multipliers_initial > 0.0:
            for name in ("multipliers", "orientation_multipliers"):
                parts[name] = rng.uniform(0.0, self.multipliers_initial, parts[name].shape)
        parts |= self._task.init(u, rng)
        return self.state.join(*parts.values())

    def continuous(self) -> ContinuousReading:
        """Return the law itself.

        Raises:
            InvalidInputError: If ``stiffness`` is learned or ``contact_loss`` is given; both are
                updated sample by sample.
        """
        for what, value in (
            ("stiffness: learning it", self._task.learns_stiffness),
            ("contact_loss:", self.contact_loss is not None),
        ):
            if value:
                raise InvalidInputError(
                    f"law.{what} needs a sampled law; give a period instead of an integrator"
                )
        return super().continuous()

    @property
    def sampled_gains(self) -> Mapping[str, float]:
        return {
            "gain": self.gain,
            "orientation_gain": self.orientation_gain,
            "return_gain": self.return_gain,
        }

    def sampled(self, period: float) -> SampledReading:
        """Return the law itself.

        Raises:
            InvalidInputError: If the network would take too many substeps.
        """
        scale, text = 1.0, f"time_constant: {self.time_constant:g} s"
        if self.form == "literal":
            scale = max(1.0, self._task.stiffness)
            text = f"form: literal with stiffness {scale:g} N/m"
        # Estimated for a Jacobian of norm 2.
        check_substeps(substeps(period, 2.0 * scale, self.time_constant), text, _MOST_SUBSTEPS)
        return super().sampled(period)

    def derivatives(self, t: float, x: Array, u: Signals) -> Array:
        """Return the right-hand side of (19), (21) or (22)."""
        self.continuous()  # refuses a law that is not
        J_hat = self.state.part(x, "J_hat") if self.learns_jacobian else u["J"]
        z = x[..., : self._dual.size]
        z_dot = self._bounded_rate(self._network(x, u, J_hat).rate(z), z, u)
        if not self.learns_jacobian:
            return z_dot
        rate = gradient(J_hat, u["velocity"], u["v_WE"], self.rho)
        return join((z_dot, flat(rate)))

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        """Integrate the learning exactly, with its inputs held; then the network by Runge-Kutta."""
        x = self._learn(x, u, period)
        J_hat = self.state.part(x, "J_hat") if self.learns_jacobian else u["J"]
        end = self._dual.size
        z = self._bound(self._network(x, u, J_hat).after(x[..., :end], period), u)
        return z if end == self.state.size else join((z, x[..., end:]))

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        J = u["J"] if self.jacobian != "learned" else self.state.part(x, "J_hat")
        dual = x[..., self.limits.size : self._dual.size]
        _, columns = self._rows(J, J, u)
        xp = functions_of(x, columns)
        sought = -xp.einsum("...m,...mn->...n", dual, columns)
        if acts(self.return_gain):
            sought = sought + self._preferred_velocity(u)
        lower, upper = self.limits.velocity_box(u["position"], self.limit_stiffness)
        outside = ((sought < lower) | (sought > upper)).any(axis=-1, keepdims=True)
        observables = {
            "velocity_lower": lower,
            "velocity_upper": upper,
            "saturated": outside.astype(float),
        }
        if self.orientation == "printed":
            singular = xp.linalg.svd(self._orientation_rows(u), compute_uv=False)
            observables["orientation_rank"] = (
                (singular > 0.02).sum(axis=-1, keepdims=True).astype(float)
            )
        return observables | self._task.diagnostics(self.state.by_name(x))

    def doubts(self, circumstances: Circumstances) -> list[str]:
        """Return no warnings: there is only something to check.

        Raises:
            InvalidInputError: If the pressing force is not above ``contact_loss.floor`` and would
                count as no contact; or if ``orientation: printed``, which can only hold an
                orientation, is to follow a path that turns.
        """
        if self.orientation == "printed" and circumstances.path_turns:
            raise InvalidInputError(
                "law.orientation: must be rotation for a path that turns the tool, not printed, "
                "which can only hold it"
            )
        self._task.check("law.contact_loss", circumstances.pressing_force)
        return []

    @property
    def keeps(self) -> tuple[str, ...]:
        return kept_with_lag(self.limit_stiffness, self.time_constant)

    def caveats(self, metrics: Mapping[str, float]) -> list[str]:
        sentences = []
        rank = metrics.get("orientation_rank_min", 3.0)
        if rank < 3.0:
            sentences.append(
                f"law.orientation: the rows of w have rank {rank:.0f}, but a rotation needs 3, so "
                "the orientation is not held; consider orientation: rotation"
            )
        return sentences + self._task.caveats("law.contact_loss", metrics)

    def _bound(self, z: Array, u: Signals) -> Array:
        """Return the network's state with its multipliers bounded."""
        limit = self.multiplier_limit
        if isinstance(limit, str):
            return z
        v, multipliers, turning = self._dual.split(z)
        pushing = within(multipliers, limit, self._split(u))
        return join((v, pushing, within(turning, limit)))

    def _bounded_rate(self, rate: Array, z: Array, u: Signals) -> Array:
        """Return the network's rate, which does not lead beyond the bound of the multipliers."""
        limit = self.multiplier_limit
        if isinstance(limit, str):
            return rate
        _, multipliers, turning = self._dual.split(z)
        v_dot, pushing, turning_rate = self._dual.split(rate)
        pushing = not_outward(pushing, multipliers, limit, self._split(u))
        return join((v_dot, pushing, not_outward(turning_rate, turning, limit)))

    def _split(self, u: Signals) -> Array | None:
        """Return the rows A of the literal form, by which its multipliers act on the tip."""
        if self.form != "literal":
            return None
        return surface_split(u["normal_WE"], self._task.stiffness)

    def _learn(self, x: Array, u: Signals, period: float) -> Array:
        """Return the state with Jacobian, stiffness and contact updated from one sample."""
        estimates: dict[str, Array] = {}
        if self.learns_jacobian:
            J_hat = self.state.part(x, "J_hat")
            estimates["J_hat"] = rank_one_update(J_hat, u["velocity"], u["v_WE"], self.rho, period)
        estimates |= self._task.step(self.state.by_name(x), u, period)[1]
        return self.state.with_parts(x, **estimates) if estimates else x

    def _network(self, x: Array, u: Signals, J_hat: Array) -> PrimalDual:
        """Return the network with its inputs held for one sample."""
        J_drive = J_hat if self.jacobian == "learned" else u["J"]
        rows, drive = self._rows(J_hat, J_drive, u)
        demand = self._task.tip_velocity(self.state.by_name(x), u)
        split = self._split(u)
        if split is not None:
            demand = matvec(split, demand)
        turn = np.zeros((*demand.shape[:-1], 4))
        if self.orientation == "rotation":
            back = self.orientation_gain * rotation_error(u["R_WE"], u["R_WE_desired"])
            turn = u["w_WE_desired"] + back
        lower, upper = self.limits.velocity_box(u["position"], self.limit_stiffness)
        aims = join((demand, turn))
        v_preferred = self._preferred_velocity(u) if acts(self.return_gain) else None
        return PrimalDual(drive, rows, aims, lower, upper, self.time_constant, v_preferred)

    def _preferred_velocity(self, u: Signals) -> Array:
        """Return the joint velocities towards the start posture, shape (..., n) [rad/s]."""
        assert self.home is not None
        return self.return_gain * (self.home - u["position"])

    def _rows(self, J_sense: Array, J_drive: Array, u: Signals) -> tuple[Array, Array]:
        """Return [A J; H] for the constraints, with J_sense, and for the drive, with J_drive.

        Args:
            J_sense: Jacobian that predicts the tip's velocity, shape (..., 3, n).
            J_drive: Jacobian by which the multipliers drive the joints, shape (..., 3, n).
            u: Signals at the sample.
        """
        H = self._orientation_rows(u)
        A = self._split(u)

        def stacked(J: Array) -> Array:
            rows = (J if A is None else matmul(A, J), H)
            return functions_of(*rows).concatenate(rows, axis=-2)

        rows = stacked(J_sense)
        return rows, rows if J_drive is J_sense else stacked(J_drive)

    def _orientation_rows(self, u: Signals) -> Array:
        if self.orientation == "rotation":
            return u["J_omega"]
        return printed_orientation_rows(u["J_omega"], u["R_WE"])
