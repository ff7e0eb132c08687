"""cbfpy among obstacles: a filter by control barrier functions behind placo.

cbfpy has no distances of its own: a user writes them in JAX. The filter changes what the tool does
as little as it can, then what the joints do, as OSCBF has it (D. Morton and M. Pavone, "Safe,
Task-Consistent Manipulation with Operational Space Control Barrier Functions", 2025).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from cbfpy import CBF, CBFConfig
from jax.typing import ArrayLike

from drake_rnn import Array
from peer_schemes.jax_distances import Things, gaps_of
from peer_schemes.obstacle_scheme import ObstacleScheme
from peer_schemes.obstacle_tasks import ObstacleTask
from peer_schemes.placo_scheme import Placo
from peer_schemes.scheme import Aim, NoSolutionError, in_the_middle
from peer_schemes.tasks import POSTURE_WEIGHT

jax.config.update("jax_enable_x64", True)

# Of the residuals of the program; the default, 1e-3, leaves a hundredth of the bounds.
_TOLERANCE = 1e-8
# Filters that are compiled, by form and numbers of obstacles; the arm is always the same.
_FILTERS: dict[Any, CBF] = {}


class Given(NamedTuple):
    """What a filter is given at each step.

    Attributes:
        J: Jacobian of the tool's position, shape (3, n).
        things: The obstacles.
        gain: Gain of the barriers [1/s].
        margin: Distance that they keep [m].
    """

    J: ArrayLike
    things: Things
    gain: float = 1.0
    margin: float = 0.0


class _Barriers(CBFConfig):
    """What all forms share: the objective, and the gains.

    Args:
        task: What it is to do.
        about: Numbers of states and bounds of what is commanded.
    """

    def __init__(self, task: ObstacleTask, **about: Any) -> None:
        self._gaps, self._n = gaps_of(task.clearance), task.arm.n
        self._v_max = jnp.asarray(task.limits.velocity)
        super().__init__(
            m=task.arm.n,
            relax_qp=True,
            solver_tol=_TOLERANCE,
            init_args=(Given(np.ones((3, self._n)), Things.of(task.clearance.solids)),),
            **about,
        )

    def alpha(self, h: jax.Array, given: Given) -> jax.Array:
        return given.gain * h

    def alpha_2(self, h_2: jax.Array, given: Given) -> jax.Array:
        return given.gain * h_2

    def P(self, z: jax.Array, u_des: jax.Array, given: Given) -> jax.Array:
        return 2.0 * (given.J.T @ given.J + POSTURE_WEIGHT * jnp.eye(self._n))

    def q(self, z: jax.Array, u_des: jax.Array, given: Given) -> jax.Array:
        return -self.P(z, u_des, given) @ u_des

    def _room(self, q: jax.Array, given: Given) -> jax.Array:
        return self._gaps(q, given.things) - given.margin


class _OfVelocity(_Barriers):
    """The state is q, the command v: barriers of relative degree one."""

    def __init__(self, task: ObstacleTask) -> None:
        bound = task.limits.velocity
        super().__init__(task, n=task.arm.n, u_min=-bound, u_max=bound)

    def f(self, z: jax.Array, given: Given) -> jax.Array:
        return jnp.zeros(self._n)

    def g(self, z: jax.Array, given: Given) -> jax.Array:
        return jnp.eye(self._n)

    def h_1(self, z: jax.Array, given: Given) -> jax.Array:
        return self._room(z, given)


class _OfAcceleration(_Barriers):
    """The state is (q, v), the command the acceleration: distances are of relative degree two."""

    def __init__(self, task: ObstacleTask) -> None:
        bound = task.limits.acceleration
        super().__init__(task, n=2 * task.arm.n, u_min=-bound, u_max=bound)

    def f(self, z: jax.Array, given: Given) -> jax.Array:
        return jnp.concatenate((z[self._n :], jnp.zeros(self._n)))

    def g(self, z: jax.Array, given: Given) -> jax.Array:
        return jnp.concatenate((jnp.zeros((self._n, self._n)), jnp.eye(self._n)))

    def h_1(self, z: jax.Array, given: Given) -> jax.Array:
        v = z[self._n :]
        return jnp.concatenate((self._v_max - v, self._v_max + v))

    def h_2(self, z: jax.Array, given: Given) -> jax.Array:
        return self._room(z[: self._n], given)


class CbfpyOnVelocities(in_the_middle(Placo), ObstacleScheme):
    """What placo wants at the middle of the sample, through a filter of velocities."""

    name = "cbfpy behind placo, velocities"
    setting = "barriers of degree one, relaxed; no bound of the acceleration"
    form: ClassVar[type[_Barriers]] = _OfVelocity
    chosen: ClassVar[Mapping[str, Any]] = {"gain": 5.0, "margin": 0.01}
    grid: ClassVar[Mapping[str, Sequence[Any]]] = {"gain": (2.0, 5.0, 10.0), "margin": (0.01,)}

    def __init__(self, task: ObstacleTask) -> None:
        super().__init__(task)
        self._kinematics = task.arm.kinematics()
        self._given = Given(np.zeros((3, task.arm.n)), Things.of(task.clearance.solids))
        self._given = self._given._replace(**self.chosen)
        # Compiling takes a quarter of a minute: filters of as many obstacles are kept.
        kind = (self.form, *map(len, self._given.things))
        if kind not in _FILTERS:
            _FILTERS[kind] = CBF.from_config(self.form(task))
        self._filter = _FILTERS[kind]
        # Compiles before the steps are timed.
        self._filtered(task.start, np.zeros(task.arm.n), np.zeros(task.arm.n))

    def towards(self, aim: Aim, q: Array, v: Array) -> Array:
        found = self._filtered(aim.q, v, super().towards(aim, q, v))
        if not np.isfinite(found).all():
            raise NoSolutionError
        return found

    def _filtered(self, q: Array, v: Array, wanted: Array) -> Array:
        given = self._given._replace(J=self._kinematics.J(q))
        return np.asarray(self._filter.safety_filter(q, wanted, given))

    def gaps(self, q: Array) -> Array:
        return np.asarray(jax.jit(gaps_of(self.task.clearance))(q, self._given.things))


class CbfpyOnAccelerations(CbfpyOnVelocities):
    """The same through a filter of accelerations."""

    name = "cbfpy behind placo, accelerations"
    setting = "barriers of degree two, relaxed"
    form = _OfAcceleration
    chosen: ClassVar[Mapping[str, Any]] = {"gain": 2.0, "margin": 0.01}

    def _filtered(self, q: Array, v: Array, wanted: Array) -> Array:
        h, z = self.task.period, np.concatenate((q, v))
        given = self._given._replace(J=self._kinematics.J(q))
        a = self._filter.safety_filter(z, (wanted - v) / h, given)
        return v + h * np.asarray(a)


SCHEMES = (CbfpyOnVelocities, CbfpyOnAccelerations)
