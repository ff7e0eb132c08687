"""A shield around an environment of Gymnasium, whose actions are joint positions, poses or so.

For each action of a policy the wrapper gives it to the shield, makes the shield's commands until
the environment's next step, and takes that step with the last of them. The environment is
Gymnasium's, of the optional package ``gymnasium``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInputError
from ..inputs.fields import Array, checked, number
from ..inputs.messages import is_whole, short
from ..inputs.packages import import_extra
from ..robot.clearance.capsules import Displacements
from .chunks import WIDTHS, Kind
from .process import Shield

(gymnasium,) = import_extra("shields around environments", "gym", "gymnasium")


class ShieldedEnvironment(gymnasium.Wrapper):  # type: ignore[name-defined]
    """An environment that is given a shield's commands in place of a policy's actions.

    What an action has besides the targets of the arm, such as the gripper's, is passed on as it is.
    ``info["shield"]`` has the `ShieldStatus` after each step, and ``info["intervention"]`` by how
    much the command differs from the action at most.

    Args:
        env: The environment, whose actions are joint positions where the arm is concerned.
        make_shield: Returns a shield for an arm that rests in a posture, shape (n,) [rad]; asked
            after each reset. Its period must divide ``interval``.
        posture: Returns the posture of the arm after a reset, shape (n,) [rad], of the environment
            and its observation.
        interval: Time that a step of the environment takes [s].
        joints: Place in an action of the environment of each of the arm's joints, in the order of
            these; by default all.
        kind: What the first numbers of a policy's action are: ``positions`` in the places of the
            joints, or ``velocities``, ``poses`` or ``twists``, as the shield follows them, before
            all that is passed on.
        wait: Time for which an action is repeated at most while the arm is behind it [s].
        behind: How far behind counts as that [rad].

    Raises:
        InvalidInputError: If the package is not installed, or an argument is not as described.
    """

    @checked(interval=number(above=0.0, most=60.0), wait=number(0.0, most=60.0), behind=number(0.0))
    def __init__(
        self,
        env: Any,
        make_shield: Callable[[Array], Shield],
        posture: Callable[[Any, Any], Array],
        interval: float,
        *,
        joints: Any = None,
        kind: Kind = "positions",
        wait: float = 0.0,
        behind: float = 0.05,
    ) -> None:
        super().__init__(env)
        self._make, self._posture, self._interval = make_shield, posture, interval
        self._kind, self._wait, self._behind = kind, wait, behind
        self._p_WO: Displacements = {}
        self._shield: Shield | None = None
        if kind not in WIDTHS:
            raise InvalidInputError(f"kind: may be {', '.join(WIDTHS)}, not {short(kind)}")
        space = env.action_space
        if not isinstance(space, gymnasium.spaces.Box) or len(space.shape) != 1:
            raise InvalidInputError(
                f"env: must have a Box of one axis as its space of actions, not {space}"
            )
        size = space.shape[0]
        self._joints = _joint_places(joints, size)
        self._others = np.setdiff1d(np.arange(size), self._joints)
        if kind != "positions":
            width = WIDTHS[kind] or self._joints.size
            far = np.full(width, np.inf)
            low = np.concatenate((-far, space.low[self._others]))
            high = np.concatenate((far, space.high[self._others]))
            self.action_space = gymnasium.spaces.Box(low, high, dtype=np.float64)

    @property
    def shield(self) -> Shield:
        """The shield of this episode.

        Raises:
            InvalidInputError: Before the first reset.
        """
        if self._shield is None:
            raise InvalidInputError("reset: must be called before a step")
        return self._shield

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Reset the environment, and begin a shield where its arm rests."""
        observation, info = self.env.reset(**options)
        self._p_WO = {}
        self._shield = shield = self._make(np.asarray(self._posture(self.env, observation)))
        if shield.arm.n != self._joints.size:
            raise InvalidInputError(
                f"joints: {self._joints.size} are given, but {shield.arm.name} has {shield.arm.n}"
            )
        self._count = round(self._interval / shield.period)
        if self._count < 1 or abs(self._count * shield.period - self._interval) > 1e-9:
            raise InvalidInputError(
                f"interval: must be a multiple of the shield's period, {shield.period:g} s, not "
                f"{short(self._interval)}"
            )
        return observation, {**info, "shield": shield.status}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Take a step with what the shield makes of an action; more than one while it waits."""
        shield, total, waits = self.shield, 0.0, 0.0
        wanted, rest = self._split(np.asarray(action, dtype=float))
        while True:
            shield.follow(self._kind, wanted)
            for _ in range(self._count):
                q = shield.command(p_WO=self._p_WO if shield.moving_obstacles else None)
                # Until places are told again, nothing is measured.
                self._p_WO = {}
            observation, reward, ends, cut, info = self.env.step(self._command(q, rest))
            total += float(reward)
            status = shield.status
            waits += self._interval
            if ends or cut or status.behind <= self._behind or waits > self._wait + 1e-9:
                break
        difference = wanted - q if self._kind == "positions" else np.zeros(1)
        told = {"shield": status, "intervention": float(np.abs(difference).max())}
        return observation, total, ends, cut, {**info, **told}

    def place_obstacles(self, p_WO: Displacements) -> None:
        """Tell how far obstacles that may move have gone, before a step; see `Shield`.

        The arm stands until it is told for the first time.

        Args:
            p_WO: Rows or displacements by name, as in `StreamShield.command`.
        """
        self._p_WO = p_WO

    def _split(self, action: Array) -> tuple[Array, Array]:
        """Return what an action asks of the arm, and the rest of it."""
        if action.shape != self.action_space.shape:
            raise InvalidInputError(
                f"action: must be of shape {self.action_space.shape}, not {action.shape}"
            )
        if self._kind == "positions":
            return action[self._joints], action[self._others]
        size = action.size - self._others.size
        return action[:size], action[size:]

    def _command(self, q: Array, rest: Array) -> Array:
        """Return the action that the environment is given."""
        space = self.env.action_space
        command = np.empty(space.shape, dtype=space.dtype)
        command[self._joints], command[self._others] = q, rest
        return command


def _joint_places(joints: Any, size: int) -> NDArray[np.intp]:
    """Return the places of joints in an action of a size, checked; None for all."""
    if joints is None:
        return np.arange(size)
    places = list(joints) if isinstance(joints, (Sequence, range, np.ndarray)) else [joints]
    is_place = [is_whole(place) and 0 <= place < size for place in places]
    if not all(is_place) or len(set(places)) < len(places):
        raise InvalidInputError(
            f"joints: must be different places in an action, from 0 to {size - 1}, not "
            f"{short(places)}"
        )
    return np.array(places, dtype=np.intp)
