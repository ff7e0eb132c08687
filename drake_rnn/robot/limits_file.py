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

The files of others are read as well: ``joint_limits.yaml`` of MoveIt and of ROS 2 control, of
Universal Robots' and Franka's descriptions, and lists of joints with their limits, as Kinova has
them. Joints may lack the prefix or the ending ``_joint`` of the model's names.

SRDF, MoveIt's description beside a model: named postures, and pairs of bodies not to look at.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any
from xml.etree.ElementTree import Element, ParseError, fromstring

import numpy as np
from pydantic import Field

from ..errors import InvalidInputError
from ..inputs.documents import construct, read_yaml
from ..inputs.fields import Array, Bounds, validated
from ..inputs.files import content_of, is_file
from ..inputs.messages import decimal, given_twice, is_number, nearest, plural
from .limits import FIELD_UNITS, LOWER, JointLimits
from .model.ros_packages import MOST_BYTES, Packages, expand_xacro, is_xacro, parse_xml

_NOT_PUBLISHED = "unpublished"
_POSITION = ("position_lower", "position_upper")
#: Limits that a file may state, and their units for a revolute joint.
LIMIT_UNITS = {**FIELD_UNITS, "effort": "N m"}
# What the bound downwards of a joint without one is mirrored of.
_MIRRORED = {lower: name for name, lower in LOWER.items()}
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
        warnings: What of the file is not used, and likely mistakes.
    """

    joints: list[str] | None
    entries: dict[str, PublishedLimit]
    warnings: list[str] = Field(default_factory=list)

    def __post_init__(self) -> None:
        if (twice := given_twice(self.joints or ())) is not None:
            raise InvalidInputError(f"joints: names {twice} twice")
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
            by_joint = dict(zip(self.joints, entry.value, strict=True))
            return np.array([by_joint.get(joint, np.nan) for joint in joints])
        if entry.value.size != len(joints):
            raise InvalidInputError(
                f"{name}.value: has {plural(entry.value.size, 'entry', 'entries')} for "
                f"{plural(len(joints), 'joint')}; name "
                "their joints with the key joints"
            )
        return np.array(entry.value)

    def over(self, own_limits: JointLimits, joints: Sequence[str], file: str) -> JointLimits:
        """Return the limits of this file, and those of a model where the file states none.

        Args:
            own_limits: Limits of the joints that the model states.
            joints: Names of the joints.
            file: Name of the file, for messages.

        Raises:
            InvalidInputError: If a list has another size, or the limits contradict each other.
        """
        limits: dict[str, Any] = {}
        for name in FIELD_UNITS:
            values = self.values(name, joints)
            bound = own_limits.bounds[name]
            if np.isnan(values).all():
                limits[name] = bound
                continue
            # A joint that neither file nor model names has no known limit.
            none = 0.0 if name == "envelope_offset" else np.inf
            otherwise = np.full(len(joints), none) if bound is None else bound
            if bound is None and name in _MIRRORED and limits[_MIRRORED[name]] is not None:
                otherwise = -limits[_MIRRORED[name]]
            limits[name] = np.where(np.isnan(values), otherwise, values)
        _require_order(limits, joints, file)
        try:
            return construct(JointLimits, limits, "")
        except InvalidInputError as error:
            raise InvalidInputError(f"{file}: {error}") from None


def _require_order(limits: Mapping[str, Array], joints: Sequence[str], file: str) -> None:
    """Raise an InvalidInputError that names a joint whose lower limit is not below its upper."""
    lower, upper = (limits[name] for name in _POSITION)
    for joint, low, high in zip(joints, lower, upper, strict=True):
        if not low < high:
            raise InvalidInputError(
                f"{file}: position_lower: must be below position_upper, but they are {low:g} and "
                f"{high:g} for {joint}"
            )


def read_limits(
    file: Path, movable: Sequence[str], joints: Sequence[str], sliding: Collection[str] = ()
) -> LimitsFile:
    """Return the contents of a file of limits.

    Args:
        file: The file.
        movable: Names of all movable joints of the arm's model.
        joints: Names of the controlled joints.
        sliding: Names of the movable joints that slide; the others turn.

    Raises:
        InvalidInputError: If the file cannot be read, or a key, a joint, a value or a unit in it is
            wrong; the message names the file.
    """
    if not is_file(file):
        raise InvalidInputError(f"arm.limits: no file {str(file)!r}")
    contents = read_yaml(file, _ANGLES)
    if not isinstance(contents, Mapping):
        raise InvalidInputError(f"{file}: must be a mapping of limits to their value and source")
    try:
        warnings, contents = list[str](), dict(contents)
        if (other_form := _stated_by_others(contents)) is not None:
            contents, warnings = _translate(other_form, movable, joints)
        sheet = _sheet(contents, warnings)
        _require_joints(sheet, movable)
        _require_units(sheet, joints, sliding)
        for name in sheet.entries:
            sheet.values(name, joints)
    except InvalidInputError as error:
        raise InvalidInputError(f"{file}: {error}") from None
    sheet.warnings.extend(_suspected_degrees(sheet))
    return sheet


def _sheet(contents: Mapping[str, Any], warnings: list[str]) -> LimitsFile:
    """Return what a file in our own words says."""
    names = ["joints", *LIMIT_UNITS]
    for name in contents:
        if name not in names:
            raise InvalidInputError(f"{name}: no such key; {nearest(str(name), names)}")
    entries = {name: entry for name, entry in contents.items() if name != "joints"}
    limits = {name: construct(PublishedLimit, entry, name) for name, entry in entries.items()}
    fields = {"joints": contents.get("joints"), "entries": limits, "warnings": warnings}
    return construct(LimitsFile, fields, "")


# Position limits between two turns in radians and in degrees are suspected to be degrees.
_TURNS, _DEGREES = 4.0 * np.pi + 0.1, 720.0


def _suspected_degrees(sheet: LimitsFile) -> list[str]:
    """Return a warning about position limits that are likely to be degrees."""
    for name in _POSITION:
        numbers = np.abs(sheet.entries[name].numbers) if name in sheet.entries else np.zeros(0)
        if ((numbers > _TURNS) & (numbers <= _DEGREES)).any():
            return [f"{name}: more than two turns; are they in degrees?"]
    return []


# Files of others.


def _decimal_times(factor: float) -> Callable[[str], float]:
    return lambda text: factor * decimal(text)


# Tags that Universal Robots' files have.
_ANGLES = (
    ("!degrees", _decimal_times(np.pi / 180.0)),
    ("!radians", _decimal_times(1.0)),
)
# Their names of limits: of ROS's parameters, where has_NAME_limits may turn one off, and of URDF.
_THEIRS = {
    "min_position": "position_lower",
    "max_position": "position_upper",
    "max_velocity": "velocity",
    "max_acceleration": "acceleration",
    "max_deceleration": "acceleration",
    "max_jerk": "jerk",
    "max_effort": "effort",
    "lower": "position_lower",
    "upper": "position_upper",
    "joint_limits_min": "position_lower",
    "joint_limits_max": "position_upper",
    "velocity": "velocity",
    "acceleration": "acceleration",
    "jerk": "jerk",
    "effort": "effort",
    "velocity_offset": "envelope_offset",
    "deceleration_limit": "envelope_deceleration",
}
# Sections of a joint that hold such names, and of a file that hold joints.
_OF_JOINT = ("limit", "limits", "position_based_velocity_limits")
_OF_FILE = ("/**", "ros__parameters", "robot_description_planning", "joint_limits", "limits")
# Lists of the limits of joints.
_LISTS = ("joint_limits_min", "joint_limits_max", "max_velocity", "max_acceleration")
# What has_NAME_limits may say, as ROS reads it.
_YES, _NO = ("true", "yes", "on", "y"), ("false", "no", "off", "n")
_ARGUMENT = re.compile(r"\$\((?:arg|var) \w+\)|\$\{\w+\}")


def _stated_by_others(contents: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]] | None:
    """Return the joints of another's file with what it says of each, and keys that are no joints.

    None for a file in our own words.
    """
    unused_keys = list[str]()
    for section in _OF_FILE:
        if isinstance(inside := contents.get(section), Mapping):
            unused_keys += [str(key) for key in contents if key != section]
            contents = inside
    for beginning in ("", "gripper_"):
        if isinstance(names := contents.get(f"{beginning}joint_names"), list):
            return _of_lists(contents, names, beginning), unused_keys
    own = {"joints", *LIMIT_UNITS}
    joints = {str(key): each for key, each in contents.items() if isinstance(each, Mapping)}
    if not joints or (own & set(contents) and not unused_keys):
        return None
    known_keys = {*_THEIRS, *_OF_JOINT}
    if not unused_keys and not any(known_keys & {*each} for each in joints.values()):
        return None
    return joints, unused_keys + [str(key) for key in contents if str(key) not in joints]


def _of_lists(contents: Mapping[str, Any], names: list[Any], beginning: str) -> dict[str, Any]:
    """Return the joints of lists with their limits.

    Raises:
        InvalidInputError: If it has no limits, or a list another size.
    """
    limits: dict[str, dict[str, Any]] = {str(name): {} for name in names}
    if len(limits) < len(names):
        again = given_twice(map(str, names))
        raise InvalidInputError(f"{beginning}joint_names: names {again} twice")
    for key in _LISTS:
        if (values := contents.get(beginning + key, contents.get(key))) is None:
            continue
        if not isinstance(values, list) or len(values) != len(names):
            raise InvalidInputError(
                f"{key}: must have {plural(len(names), 'entry', 'entries')}, one for each joint"
            )
        for joint, value in zip(limits, values, strict=True):
            limits[joint][key] = value
            limits[joint][f"has_{_kind(key)}_limits"] = True
    if not any(limits.values()):
        raise InvalidInputError(
            f"names {plural(len(names), 'joint')} and states no limit; give the file of the "
            "robot's MoveIt configuration, joint_limits.yaml"
        )
    return limits


def _translate(
    contents: tuple[Mapping[str, Any], list[str]], movable: Sequence[str], joints: Sequence[str]
) -> tuple[dict[str, Any], list[str]]:
    """Return another's file in our own words, and one line about what is not used of it."""
    translation: dict[str, dict[str, float]] = {}
    remarks = _Remarks()
    theirs_by_name, absent = dict[str, str](), list[str]()
    for theirs, entry in contents[0].items():
        name = _joint_named(theirs, movable, joints)
        if name is None:
            absent.append(theirs)
            continue
        if name in theirs_by_name:
            raise InvalidInputError(f"{theirs}: is {name} of the model, as {theirs_by_name[name]}")
        theirs_by_name[name] = theirs
        for limit, value in _of_joint(theirs, entry, remarks).items():
            translation.setdefault(limit, {})[name] = value
    if len(absent) == len(contents[0]):
        raise InvalidInputError(
            f"none of its joints is in the model: {', '.join(absent[:4])}; the model has "
            + ", ".join(movable[:8])
        )
    unused_keys = [*contents[1], *remarks.unused(len(theirs_by_name))]
    text = [f"not used: {', '.join(unused_keys)}"] if unused_keys else []
    text += [f"joints that the model has not: {', '.join(absent)}"] if absent else []
    text += remarks.doubts()
    entries = {limit: {"value": values} for limit, values in translation.items()}
    return entries, ["; ".join(text)] if text else []


class _Remarks:
    """What is said of another's file, each time with the joints of which it is true."""

    def __init__(self) -> None:
        self._unused: dict[str, list[str]] = {}
        self._doubts: dict[tuple[str, str], list[str]] = {}

    def leave_out(self, joint: str, key: str) -> None:
        """Note a key of a joint that is not used."""
        self._unused.setdefault(key, []).append(joint)

    def doubt(self, joint: str, key: str, what: str) -> None:
        """Note what may not be meant by a key of a joint."""
        self._doubts.setdefault((key, what), []).append(joint)

    def unused(self, count: int) -> list[str]:
        """Return the keys that are not used, with their joints unless all have them.

        Args:
            count: Number of joints of the file.
        """
        names = [*_THEIRS, *(f"has_{kind}_limits" for kind in sorted(_KINDS))]
        texts = list[str]()
        for key, joints in self._unused.items():
            close = get_close_matches(key, names, n=1, cutoff=0.8)
            where = "" if len(joints) == count > 1 and not close else f" of {_some(joints)}"
            texts.append(f"{key}{where}" + (f" (nearest: {close[0]})" if close else ""))
        return texts

    def doubts(self) -> list[str]:
        """Return what may not be meant, one text each."""
        return [f"{key} of {_some(j)} {what}" for (key, what), j in self._doubts.items()]


def _some(names: Sequence[str]) -> str:
    """Return the first of some names, and how many more there are."""
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")


def _joint_named(theirs: str, movable: Sequence[str], joints: Sequence[str]) -> str | None:
    """Return the joint that a file means by a name that may lack a prefix or an ending.

    Raises:
        InvalidInputError: If several may be meant.
    """
    bare = _ARGUMENT.sub("", theirs)
    ends = tuple(f"{sign}{bare}{end}" for sign in "_/-" for end in ("", "_joint"))
    for among in (joints, movable):
        exact = [name for name in (bare, f"{bare}_joint") if name in among]
        fitting = exact[:1] or [name for name in among if name.endswith(ends)]
        if len(fitting) > 1 and among is joints:
            raise InvalidInputError(f"{theirs}: may be {' or '.join(fitting)} of the model")
        if fitting:
            return fitting[0]
    return None


def _of_joint(joint: str, entry: Any, remarks: _Remarks) -> dict[str, float]:
    """Return the limits of a joint by our names; what is not used or in doubt becomes a remark.

    Raises:
        InvalidInputError: If a limit is no number, not positive, or no limits have room between.
    """
    if not isinstance(entry, Mapping):
        remarks.leave_out(joint, joint)
        return {}
    limits, keys = dict[str, float](), dict[str, str]()
    for key, value in entry.items():
        if key in _OF_JOINT:
            limits |= _of_joint(joint, value, remarks)
        elif key in _THEIRS:
            keys[_kind(key)] = key
            number = _limit(joint, key, value)
            if _holds(joint, entry, _kind(key)) is not False:
                _state(limits, key, _positive(joint, key, number))
        elif not (str(key).startswith("has_") and str(key)[4:].removesuffix("_limits") in _KINDS):
            remarks.leave_out(joint, str(key))
    _require_room(joint, entry, limits)
    for kind in sorted(_KINDS):
        _doubt(joint, entry, kind, keys.get(kind), remarks)
    return limits


def _kind(key: str) -> str:
    """Return what a key limits, as in has_KIND_limits."""
    if _THEIRS[key] in _POSITION:
        return "position"
    return key.removeprefix("max_")


def _holds(joint: str, entry: Mapping[str, Any], kind: str) -> bool | None:
    """Return what has_KIND_limits of a joint says; None if it is not there.

    Raises:
        InvalidInputError: If it is neither true nor false.
    """
    key = f"has_{kind}_limits"
    if (value := entry.get(key)) is None:
        return None
    word = str(value).lower()
    if isinstance(value, bool | str) and word in _YES + _NO:
        return word in _YES
    raise InvalidInputError(f"{joint}.{key}: must be true or false, not {value!r}")


def _limit(joint: str, key: str, value: Any) -> float:
    """Return a limit of a joint, a finite number."""
    if not is_number(value):
        raise InvalidInputError(f"{joint}.{key}: must be a number, not {value!r}")
    return float(value)


def _positive(joint: str, key: str, value: float) -> float:
    """Return a limit, which is positive unless it is one of the position."""
    if _THEIRS[key] not in _POSITION and not (value > 0.0 or (key in _SIGNED and value < 0.0)):
        raise InvalidInputError(f"{joint}.{key}: must be positive, not {value:g}")
    return value


def _require_room(joint: str, entry: Mapping[str, Any], limits: Mapping[str, float]) -> None:
    """Raise an InvalidInputError if a joint's lower limit is not below its upper one."""
    lower, upper = (limits.get(name) for name in _POSITION)
    if lower is not None and upper is not None and not lower < upper:
        keys = {_THEIRS[key]: key for key in entry if key in _THEIRS}
        low, high = (keys.get(name, name) for name in _POSITION)
        raise InvalidInputError(f"{joint}.{low}: must be below {high}, {upper:g}, not {lower:g}")


def _doubt(
    joint: str, entry: Mapping[str, Any], kind: str, key: str | None, remarks: _Remarks
) -> None:
    """Note a has_KIND_limits without a limit, and a limit of ROS's parameters without the other."""
    holds = _holds(joint, entry, kind)
    if key is None and holds:
        remarks.doubt(joint, f"has_{kind}_limits", "is true without a value: the model's counts")
    elif kind == "position" and holds and len(_position_keys(entry)) == 1:
        remarks.doubt(joint, f"has_{kind}_limits", f"is true with {key} alone")
    elif key is not None and key.startswith(("min_", "max_")) and holds is None:
        remarks.doubt(joint, key, f"counts without has_{kind}_limits")


def _position_keys(entry: Mapping[str, Any]) -> set[str]:
    return {_THEIRS[key] for key in entry if key in _THEIRS} & {*_POSITION}


_KINDS = frozenset(name.removeprefix("max_") for name in _THEIRS if name.startswith("max_"))
# Of these the amount counts.
_SIGNED = ("max_deceleration",)


def _state(limits: dict[str, float], key: str, value: float) -> None:
    """Add a limit; of an acceleration and a deceleration the smaller one counts for both."""
    name = _THEIRS[key]
    if key in _SIGNED:
        value = abs(value)
    limits[name] = min(value, limits.get(name, np.inf)) if name == "acceleration" else value


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
    units = (unit, *_SPELLINGS.get(unit, (unit.replace("rad", "m", 1),)))
    if entry.unit is not None and entry.unit not in units:
        raise ValueError(f"{name}.unit: must be {' or '.join(units)}, not {entry.unit!r}")
    if isinstance(entry.value, str) and entry.value != _NOT_PUBLISHED:
        raise ValueError(f"{name}.value: must be numbers or {_NOT_PUBLISHED}, not {entry.value!r}")
    numbers, names = entry.numbers, joints
    if isinstance(entry.value, dict):
        names = [*entry.value]
    if isinstance(entry.value, np.ndarray) and joints is not None and numbers.size != len(joints):
        raise ValueError(
            f"{name}.value: has {plural(numbers.size, 'entry', 'entries')} for "
            f"{plural(len(joints), 'joint')}"
        )
    sign = -1.0 if name in _MIRRORED else 1.0
    is_wrong = np.isnan(numbers) | ((sign * numbers <= 0.0) & (name not in _POSITION))
    if is_wrong.any():
        k = int(is_wrong.argmax())
        right = "positive" if sign > 0.0 else "negative"
        what = "numbers" if np.isnan(numbers[k]) else right
        of = f" for {names[k]}" if names and numbers.size == len(names) else ""
        where = of or (f", entry {k + 1}" if numbers.size > 1 else "")
        raise ValueError(f"{name}.value: must be {what}, not {numbers[k]:g}{where}")


def _require_joints(sheet: LimitsFile, movable: Sequence[str]) -> None:
    """Raise an InvalidInputError for a joint that the model does not have."""
    columns = {"joints": sheet.joints or []}
    columns |= {k: [*e.value] for k, e in sheet.entries.items() if isinstance(e.value, dict)}
    for key, joints in columns.items():
        for joint in joints:
            if joint not in movable:
                raise InvalidInputError(
                    f"{key}: no movable joint {joint!r} in the model; "
                    + nearest(joint, list(movable))
                )


def _require_units(sheet: LimitsFile, joints: Sequence[str], sliding: Collection[str]) -> None:
    """Raise an InvalidInputError for a unit that is that of none of its joints."""
    for key, entry in sheet.entries.items():
        names = [*entry.value] if isinstance(entry.value, dict) else sheet.joints or joints
        if entry.unit is None or not names:
            continue
        of_turning = entry.unit.startswith("rad") or entry.unit in ("N m", "Nm")
        if all((name in sliding) == of_turning for name in names):
            unit = LIMIT_UNITS[key]
            other = "N" if unit == "N m" else unit.replace("rad", "m", 1)
            does, right = ("turns", unit) if not of_turning else ("slides", other)
            raise InvalidInputError(
                f"{key}.unit: must be {right}, as {names[0]} {does}, not {entry.unit!r}"
            )


# What is read, and what only says how the rest is to be understood.
_READ = frozenset({"group", "group_state", "disable_collisions", "enable_collisions"})


@dataclass(frozen=True)
class Srdf:
    """The contents of an SRDF file.

    Attributes:
        file: The file.
        postures: Positions of joints by the name of the posture, ``group/name`` [rad or m].
        disabled: Pairs of links that are not to be looked at, each with its reason.
        unused: Kinds of elements that are not used.
        robot: Name of the robot.
    """

    file: Path
    postures: Mapping[str, Mapping[str, float]]
    disabled: Mapping[frozenset[str], str]
    unused: tuple[str, ...]
    robot: str = ""

    def joints_missing(self, name: str, joints: Sequence[str]) -> list[str]:
        """Return those of some joints that a posture leaves out; none if there is no such posture.

        Args:
            name: Name of the posture, with or without its group.
            joints: Names of the joints.
        """
        posture = next(
            (p for n, p in self.postures.items() if name in (n, n.partition("/")[2])), None
        )
        return [] if posture is None else [joint for joint in joints if joint not in posture]


def read_srdf(
    file: Path, packages: Mapping[str, str], arguments: Mapping[str, object] | None = None
) -> Srdf:
    """Return the contents of an SRDF file, whose macros are expanded.

    Args:
        file: The file.
        packages: Folders of packages by name.
        arguments: Arguments of its macros.

    Raises:
        InvalidInputError: If it cannot be read, or a position in it is no number.
    """
    if not is_file(file):
        raise InvalidInputError(f"arm.srdf: no file {str(file)!r}")
    try:
        content = content_of(file, MOST_BYTES)
        root = parse_xml(content)
        if root is not None and is_xacro(root):
            content = expand_xacro(file, Packages(packages, file), arguments, "arm.srdf")
            root = parse_xml(content)
        if root is None:
            raise ValueError(f"is no SRDF file: {_xml_fault(content)}")
        if root.tag != "robot":
            raise ValueError(f"is no SRDF file: it begins with <{root.tag}>, not <robot>")
        if root.find("link") is not None:
            raise ValueError("is a model, which is given in arm.model; an SRDF file has no links")
        return _read(file, root)
    except InvalidInputError:
        raise
    except ValueError as error:
        raise InvalidInputError(f"arm.srdf: {file} {error}") from None


def _read(file: Path, root: Element) -> Srdf:
    postures = dict[str, dict[str, float]]()
    for state in root.findall("group_state"):
        name = f"{state.get('group', '')}/{state.get('name', '')}"
        if name in postures:
            raise ValueError(f"has the state {name} twice")
        postures[name] = _positions(state)
    pairs = {_pair(each): each.get("reason", "") for each in root.findall("disable_collisions")}
    for each in root.findall("enable_collisions"):
        pairs.pop(_pair(each), None)
    unused_tags = dict.fromkeys(child.tag for child in root if child.tag not in _READ)
    return Srdf(file, postures, pairs, tuple(unused_tags), root.get("name", ""))


def _xml_fault(content: bytes) -> str:
    """Return why a text is no XML, with the line."""
    if not content.strip():
        return "it is empty"
    try:
        fromstring(content)
    except ParseError as error:
        return str(error)
    return "it is no XML"


def _pair(element: Element) -> frozenset[str]:
    """Return the links of a pair.

    Raises:
        ValueError: If it names only one.
    """
    names = [element.get(key, "") for key in ("link1", "link2")]
    for key, other in (("link1", names[1]), ("link2", names[0])):
        if not element.get(key):
            of = f" of {other}" if other else ""
            raise ValueError(f"{element.tag}{of}: has no {key}")
    return frozenset(names)


def _positions(state: Element) -> dict[str, float]:
    """Return the position of each joint of a state; those of joints with several are left out."""
    entries = {}
    for joint in state.findall("joint"):
        name, values = joint.get("name", ""), joint.get("value", "").split()
        if name in entries:
            raise ValueError(f"{state.get('name')}: gives {name} twice")
        if len(values) == 1:
            try:
                entries[name] = decimal(values[0])
            except ValueError as error:
                raise ValueError(f"{state.get('name')}: {name}: {error}") from None
    return entries
