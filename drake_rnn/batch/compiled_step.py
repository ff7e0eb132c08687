"""A sample of one robot's law with its kinematics, compiled by JAX for a user's own loop."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from math import isfinite
from typing import Any

import numpy as np

from ..arrays.algebra import AnyArray
from ..arrays.substeps import require_jax
from ..errors import InvalidInputError
from ..experiment import Described
from ..features.pairs import refuse
from ..inputs.fields import Array
from ..inputs.messages import short
from ..laws.called import unchecked
from .compiled_runs import (
    compilable,
    compiled_in_order,
)
from .robots import Moving, Robots


class CompiledStep:
    """A sample of an experiment's law: from joint positions to a joint velocity.

    Kinematics, path and law are compiled together. A table has the experiment's path at all
    samples. ::

        robot = CompiledStep("slc_nephroid_known").start()
        for _ in range(robot.samples):
            v = robot.step(q)        # q as measured, or as commanded
            q = q + robot.period * v

    On a CPU, JAX hands each call to a thread, and waiting for it takes most of a step. To avoid
    this, call ``require_jax().config.update("jax_cpu_enable_async_dispatch", False)`` before JAX
    computes anything.

    Args:
        experiment: An experiment that `run_many` can run, or what `load_experiment` takes, without
            contact. Its dither may only be ``actuated``: the caller's own loop then adds the noise.

    Attributes:
        samples: Number of samples of the experiment.
        period: Sampling period [s].
        first: Number, law's state and mean velocity before the first sample, an array of JAX.

    Raises:
        InvalidInputError: If JAX is not installed, or the experiment cannot be run so.
    """

    def __init__(self, experiment: Described) -> None:
        jax = require_jax()
        robots = compilable([experiment])
        self.document = robots[0].experiment.document
        refuse(replace(robots[0].experiment.combination, host="compiled step"))
        self._robots = Robots(robots)
        schedule = self._robots.schedule
        self.samples, self.period = int(schedule.samples.sum()), schedule.period
        self.joints = robots[0].experiment.arm.n
        self.home = robots[0].experiment.start
        table = jax.tree.map(
            lambda values: values[schedule.samples],
            (schedule.times, self._robots.all_around()),
        )
        packed = import_module("jax.flatten_util").ravel_pytree
        self._unpacked = packed(jax.tree.map(lambda values: values[0], table))[1]
        # One array for the table and one for the state: each argument of a call takes time.
        self._table = jax.vmap(lambda row: packed(row)[0])(table)
        x = self._robots.started().x[0]
        self.first = jax.device_put(np.concatenate(([0.0], x, np.zeros(self.joints))))
        self._jax = jax
        self._compiled = compiled_in_order(self._step)
        # Compiled here, and not at the first sample.
        for velocity in (None, np.zeros(self.joints)):
            self._compiled(self._table, self.first, self.home, velocity)

    def start(self) -> SteppedRobot:
        """Return a robot at the start of the experiment; there may be several."""
        return SteppedRobot(self)

    def _step(
        self, table: AnyArray, state: AnyArray, q: AnyArray, velocity: AnyArray | None
    ) -> AnyArray:
        """Return number, law's state and mean velocity one sample later."""
        law, h, xp = self._robots.law, self.period, self._jax.numpy
        number, x = state[0], state[None, 1 : 1 + law.state.size]
        t, around = self._unpacked(table[number.astype(int)])
        q = xp.asarray(q)[None]
        told = law.commanded_velocity(t, x) if velocity is None else xp.asarray(velocity)[None]
        look = self._robots.look(t, q, around)
        step: Any = unchecked(law.step)
        x = step(t, x, self._robots.signals(look, Moving(q, x, told, None)), h)
        still = Moving(xp.zeros_like(q), x, told, None)
        after = self._robots.moved(law, still, t, t + h)
        mean = after.command if law.holds_command else after.q / h
        return xp.concatenate((number[None] + 1.0, x[0], mean[0]))

    def advanced(self, state: AnyArray, q: Array, velocity: Array | None) -> AnyArray:
        """Return number, law's state and mean velocity one sample later, as an array of JAX.

        Args:
            state: The same of the sample before.
            q: Joint positions, shape (n,) [rad].
            velocity: Joint velocities, shape (n,) [rad/s]; None for those that the law commands.
        """
        return self._compiled(self._table, state, q, velocity)


class SteppedRobot:
    """A robot that steps from sample to sample.

    Args:
        step: The compiled step.

    Attributes:
        number: Number of the next sample.
    """

    def __init__(self, step: CompiledStep) -> None:
        self._step, self._state = step, step.first
        self._shape = (step.joints,)
        self.number = 0

    @property
    def samples(self) -> int:
        """Number of samples of the experiment."""
        return self._step.samples

    @property
    def period(self) -> float:
        """Sampling period [s]."""
        return self._step.period

    def step(self, position: Array, velocity: Array | None = None) -> Array:
        """Return the joint velocity to command until the next sample, shape (n,) [rad/s].

        It is the mean over the period: an arm that follows the command is then at ``position +
        period * velocity``. Where the command is held, it is the command.

        Args:
            position: Joint positions, shape (n,) [rad].
            velocity: Joint velocities, shape (n,) [rad/s]; by default those that the law commands.
                If noise moves the arm, they must be given: as measured, or with the noise.

        Raises:
            InvalidInputError: If an argument is no such array, all samples have been made, or the
                velocity is not finite.
        """
        if not (type(position) is np.ndarray and position.shape == self._shape):
            raise InvalidInputError(
                f"position: must be an array, shape {self._shape}, not {short(position)}"
            )
        if velocity is not None and np.shape(velocity) != self._shape:
            raise InvalidInputError(
                f"velocity: must be an array, shape {self._shape}, not {short(velocity)}"
            )
        if self.number >= self._step.samples:
            raise InvalidInputError(
                f"step: all {self._step.samples} samples of the experiment have been made"
            )
        self._state = self._step.advanced(self._state, position, velocity)
        self.number += 1
        v = np.asarray(self._state)[-self._shape[0] :]
        # For a few numbers faster than NumPy.
        if not isfinite(sum(v.tolist())):
            raise InvalidInputError(
                f"step: the velocity of sample {self.number - 1} is not finite: either the law has "
                f"failed, or what it was given is not finite, {short(position)}"
            )
        return v
