"""Where the end effector is in the newest of some joint targets."""

# No postponed annotations: see `path`.
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from pydrake.math import RigidTransform

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..robot.kinematics import ArmKinematics
from .joint_targets import JointTargets
from .path import Motion, Path, PlacedPath


@dataclass(frozen=True, eq=False)
class TargetPath(Path):
    """The end effector in the newest joint target that is followed: a place that jumps.

    It depends on all of an arm, and is placed by an arm's kinematics.

    Attributes:
        targets: The joint targets.
    """

    targets: JointTargets

    def placed(
        self,
        p_WE: Array | None = None,
        R_WE: Array | None = None,
        frames: Mapping[str, RigidTransform] | None = None,
    ) -> PlacedPath:
        """See `Path.placed`.

        Raises:
            InvalidInputError: Always, as a pose says nothing of other postures.
        """
        raise InvalidInputError("path: joint targets are placed by an arm, not by a pose")

    def placed_by(self, kinematics: ArmKinematics, q: Array) -> PlacedPath:
        """See `Path.placed_by`."""
        postures = np.vstack((q, self.targets.followed.position))
        return PlacedTargets(self.targets, np.array([kinematics.p_WE(each) for each in postures]))


@dataclass(frozen=True, eq=False)
class PlacedTargets(PlacedPath):
    """A `TargetPath` of an arm.

    Attributes:
        targets: The joint targets.
        p_WE: Place of the end effector at the start and in each target that is followed, shape
            (k + 1, 3) [m].
    """

    targets: JointTargets
    p_WE: Array
    _rest: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def duration(self) -> float:
        """See `Passage.duration`; the time at which the last target came."""
        return float(self.targets.time[-1])

    @property
    def oriented(self) -> bool:
        """See `PlacedPath.oriented`; it is not, since joints alone are followed."""
        return False

    def position(self, t: float) -> Motion:
        """See `PlacedPath.position`; between targets it rests."""
        if not np.isfinite(t):
            raise InvalidInputError(f"t: must be finite, not {t}")
        newest = int(self.targets.followed.newest(np.array(t)))
        return self.p_WE[newest + 1].copy(), self._rest.copy(), self._rest.copy()

    def orientation(self, t: float) -> Motion:
        """See `PlacedPath.orientation`.

        Raises:
            InvalidInputError: Always.
        """
        raise InvalidInputError("path: joint targets are followed by the joints, not by a pose")

    def _breaks(self, until: float) -> list[Array | float]:
        return [*super()._breaks(until), self.targets.time]
