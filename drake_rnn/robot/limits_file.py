"""Files of joint limits: what a maker publishes about an arm, each value with its source.

Such a file is a YAML mapping from limits to their ``value``, ``unit`` and ``source``::

    joints: [joint1, joint2, joint3]       # order of the lists; by default the controlled joints
    velocity:
      value: [2.0, 2.0, 3.0]               # or one number for all, or {joint1: 2.0, ...}
      unit: rad/s
      source: data sheet of 2024, p. 12
    acceleration: {value: unpublished, source: asked the maker}

A limit that is left out or ``unpublished``, for all joints or for one, is read from the model file.
`drake_rnn.load_arm` finds ``my.limits.yaml`` beside ``my.urdf`` by itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ..errors import InvalidInputError
from ..inputs.documents import construct, read_yaml
from ..inputs.fields import Array, Bounds, validated
from ..inputs.files import is_file
from ..inputs.messages import nearest
from .limits import FIELD_UNITS, JointLimits

_UNPUBLISHED = "unpublished"
_POSITION = ("position_lower", "position_upper")
#: Limits that a file may state, and their units for a revolute joint.
LIMIT_UNITS = {**FIELD_UNITS, "effort": "N m"}
# Strict: neither true nor "4" is a number.
_Number = Annotated[float, Field(strict=True)]
# Other ways to write the same unit, and those of a prismatic joint.
_SPELLINGS = {"N m": ("Nm", "N")}


@validated
class PublishedLimit:
    """One limit of all joints.

    Args:
        value: One number for each joint, one for all, or a mapping from joints to numbers;
            ``unpublished`` where there is none.
        unit: Its unit, which must be the SI unit of `LIMIT_UNITS`.
        source: Source of the value.
    """

    value: _Number | dict[str, _Number] | Bounds | str
    unit: str | None = None
    source: str = ""

    @property
    def numbers(self) -> Array:
        """All numbers of the value; none if it is unpublished."""
        if isinstance(self.value, str):
            return np.array([])
        if isinstance(self.value, dict):
            return np.array([*self.value.values()])
        return np.atleast_1d(self.value)


@validated
class LimitsFile:
    """Contents of a file of limits.

    Args:
        joints: Joints in the order of the lists; None if the file does not name the joints.
        entries: The limits by name.
    """

    joints: list[str] | None
    entries: dict[str, PublishedLimit]

    def __post_init__(self) -> None:
        for name, entry in self.entries.items():
            _check_entry(name, entry, self.joints)

    def values(self, name: str, joints: Sequence[str]) -> Array:
        """Return a limit of some joints, shape (len(joints),); NaN where it is unpublished.

        Args:
            name: Key of `LIMIT_UNITS`.
            joints: Names of the joints.

        Raises:
            InvalidInputError: If the file gives a list of another size, without names.
        """
        nothing = np.full(len(joints), np.nan)
        entry = self.entries.get(name)
        if entry is None or isinstance(entry.value, str):
            return nothing
        if isinstance(entry.value, dict):
            return np.array([entry.value.get(joint, np.nan) for joint in joints], dtype=float)
        if isinstance(entry.value, float):
            return np.full(len(joints), entry.value)
        if self.joints is not None:
            known = dict(zip(self.joints, entry.value, strict=True))
            return np.array([known.get(joint, np.nan) for joint in joints])
        if entry.value.size != len(joints):
            raise InvalidInputError(
                f"{name}.value: has {entry.value.size} entries for {len(joints)} joints; name "
                "their joints with the key joints"
            )
        return np.array(entry.value)

    def over(self, stated: JointLimits, joints: Sequence[str], file: str) -> JointLimits:
        """Return the limits of this file, and those of a model where the file states none.

        Args:
            stated: Limits of the joints that the model states.
            joints: Names of the joints.
            file: Name of the file, for messages.

        Raises:
            InvalidInputError: If a list has another size, or the limits contradict each other.
        """
        merged: dict[str, Any] = {}
        for name in FIELD_UNITS:
            published = self.values(name, joints)
            known = stated.bounds[name]
            if np.isnan(published).all():
                merged[name] = known
                continue
            # A joint that neither file nor model names has no known limit.
            otherwise = np.full(len(joints), np.inf) if known is None else known
            merged[name] = np.where(np.isnan(published), otherwise, published)
        try:
            return construct(JointLimits, merged, "")
        except InvalidInputError as error:
            raise InvalidInputError(f"{file}: {error}") from None


def read_limits(file: Path, movable: Sequence[str], joints: Sequence[str]) -> LimitsFile:
    """Return the contents of a file of limits.

    Args:
        file: The file.
        movable: Names of all movable joints of the arm's model.
        joints: Names of the controlled joints.

    Raises:
        InvalidInputError: If the file cannot be read, or a key, a joint, a value or a unit in it is
            wrong; the message names the file.
    """
    if not is_file(file):
        raise InvalidInputError(f"arm.limits: no file {str(file)!r}")
    contents = read_yaml(file)
    if not isinstance(contents, Mapping):
        raise InvalidInputError(f"{file}: must be a mapping of limits to their value and source")
    names = ["joints", *LIMIT_UNITS]
    for name in contents:
        if name not in names:
            raise InvalidInputError(f"{file}: {name}: no such key; {nearest(str(name), names)}")
    entries = {name: entry for name, entry in contents.items() if name != "joints"}
    try:
        limits = {name: construct(PublishedLimit, entry, name) for name, entry in entries.items()}
        fields = {"joints": contents.get("joints"), "entries": limits}
        sheet = construct(LimitsFile, fields, "")
        _require_joints(sheet, movable)
        for name in entries:
            sheet.values(name, joints)
    except InvalidInputError as error:
        raise InvalidInputError(f"{file}: {error}") from None
    return sheet


def limits_beside(model: Path) -> Path | None:
    """Return the file of limits that belongs to a model by its name, None if there is none.

    The file of ``my.urdf`` is ``my.limits.yaml``. A file called only ``limits.yaml`` may belong to
    another model in the folder, and must be named in the description.
    """
    file = model.parent / f"{model.stem}.limits.yaml"
    return file if is_file(model) and is_file(file) else None


def _check_entry(name: str, entry: PublishedLimit, joints: Sequence[str] | None) -> None:
    """Raise a ValueError for a value or a unit that cannot be."""
    unit = LIMIT_UNITS[name]
    allowed = (unit, *_SPELLINGS.get(unit, (unit.replace("rad", "m", 1),)))
    if entry.unit is not None and entry.unit not in allowed:
        raise ValueError(f"{name}.unit: must be {' or '.join(allowed)}, not {entry.unit!r}")
    if isinstance(entry.value, str) and entry.value != _UNPUBLISHED:
        raise ValueError(f"{name}.value: must be numbers or {_UNPUBLISHED}, not {entry.value!r}")
    numbers = entry.numbers
    if isinstance(entry.value, np.ndarray) and joints is not None and numbers.size != len(joints):
        raise ValueError(f"{name}.value: has {numbers.size} entries for {len(joints)} joints")
    if np.isnan(numbers).any():
        raise ValueError(f"{name}.value: must be numbers, not {numbers.tolist()}")
    if name not in _POSITION and not (numbers > 0.0).all():
        raise ValueError(f"{name}.value: must be positive, not {numbers.tolist()}")


def _require_joints(sheet: LimitsFile, movable: Sequence[str]) -> None:
    """Raise an InvalidInputError for a joint that the model does not have."""
    named = {"joints": sheet.joints or []}
    named |= {k: [*e.value] for k, e in sheet.entries.items() if isinstance(e.value, dict)}
    for key, joints in named.items():
        for joint in joints:
            if joint not in movable:
                raise InvalidInputError(
                    f"{key}: no movable joint {joint!r} in the model; "
                    + nearest(joint, list(movable))
                )
