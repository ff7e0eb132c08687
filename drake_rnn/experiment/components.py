"""The arm, path and law that a document describes.

- Arms and other parts that several experiments share, so that each is made only once.
- The path that an experiment's document describes.
- The law that an experiment's document describes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any, TypeVar, get_args

from pydrake.trajectories import Trajectory

from ..errors import InvalidInputError
from ..features.pairs import refuse
from ..features.sensing import measurement_of
from ..inputs.documents import construct, without_kind
from ..inputs.fields import Array
from ..inputs.keys import described_class
from ..inputs.kinds import Modules
from ..inputs.messages import field_names, plain, require_type, short
from ..laws import Law, PostureLaw
from ..laws.checks import check_declared, continuous_reading, sampled_reading
from ..laws.parts.secondary import OBJECTIVES, Objective, Secondary
from ..paths import PATHS, Drawing, Part, Path, Rest, Sequence, as_path
from ..paths.trajectory import TimedPath
from ..robot.arm import Arm
from ..robot.arm_description import LinkErrorSettings
from ..robot.clearance import Clearance
from ..robot.load_arm import load_arm
from ..robot.task import TASKS, Task, suits, tasks_suiting
from .document import ExperimentDocument, combination_of

T = TypeVar("T")

# Largest number of arms, and of parts of each kind, that are kept: a plant takes up to 1 MB.
_MOST_KEPT = 20


class Arms:
    """Arms by their descriptions in documents, each loaded when it is first needed.

    An arm never changes after it was made, so experiments may share it; the same holds for paths,
    limits and classes of laws. A file that changes later is not read again, and kinematics are
    shared too: use one object for one batch of experiments, in one thread.
    """

    def __init__(self) -> None:
        self._known: dict[str, Arm] = {}
        self._parts: dict[str, dict[str, Any]] = {}

    def of(self, description: str | Mapping[str, Any]) -> Arm:
        """Return the arm that the section ``arm`` of a document describes.

        Raises:
            InvalidInputError: If there is no such arm, or a key of it is wrong.
        """
        if isinstance(description, Mapping) and description.get("link_errors") is not None:
            # There may be thousands of link errors, and adding them to a loaded arm is quick.
            rest = {key: value for key, value in description.items() if key != "link_errors"}
            errors = construct(LinkErrorSettings, description["link_errors"], "arm.link_errors")
            return self.of(rest).with_link_errors(errors)
        return _keep(self._known, _text(description), lambda: _load(description))

    def add(self, name: str, arm: Arm) -> None:
        """Let documents name an arm that was made otherwise."""
        _keep(self._known, _text(name), lambda: arm)

    def share(self, part: str, description: Any, make: Callable[[], T]) -> T:
        """Return a part of an experiment, made once for all documents that describe the same part.

        Args:
            part: Kind of the part.
            description: Everything that the part depends on, as plain data.
            make: Function that makes the part.
        """
        return _keep(self._parts.setdefault(part, {}), _text(description), make)


def _keep(parts: dict[str, Any], text: str, make: Callable[[], T]) -> T:
    """Return what is kept under a text, made if it is not there; the oldest goes if there are many.

    What is asked for again becomes the newest.
    """
    part: T = parts.pop(text) if text in parts else make()
    while len(parts) >= _MOST_KEPT:
        del parts[next(iter(parts))]
    parts[text] = part
    return part


def _text(description: Any) -> str:
    return json.dumps(plain(description), sort_keys=True, default=repr)


def _load(description: str | Mapping[str, Any]) -> Arm:
    if isinstance(description, str):
        return load_arm(description)
    fields = dict(description)
    if not isinstance(model := fields.pop("model", None), str):
        raise InvalidInputError("arm.model: must be given: a shipped arm or a model file")
    return load_arm(model, **fields)


#: Section of a document in place of a path that was made in Python.
GIVEN_KIND = {"kind": "given"}


def path_of(
    document: ExperimentDocument,
    arms: Arms,
    seeks_posture: bool,
    own_path: Path | Trajectory | None,
    modules: Modules,
) -> tuple[Path, list[str]]:
    """Return the path of an experiment, shared by documents that describe the same, and warnings.

    Args:
        document: Document of the experiment.
        arms: Parts that documents share.
        seeks_posture: Whether its law seeks a posture while the end effector stays.
        own_path: Path that was made in Python, in place of one that the document describes.
        modules: Modules that may be imported for the path.

    Raises:
        InvalidInputError: If a key is wrong; if the path must be given or left out; or if its times
            begin after the run's end.
    """
    if seeks_posture:
        return Rest(), []
    if own_path is not None:
        path = as_path(own_path)
        require_type("path", path, Path)
    else:
        path = _describe(document.path, arms, modules)
    return path, [*(f"path: {note}" for note in path.notes), *_doubts(path, document.duration)]


def _describe(section: Mapping[str, Any] | None, arms: Arms, modules: Modules) -> Path:
    if section is None:
        raise InvalidInputError("path: must be given")
    if section == GIVEN_KIND:
        raise InvalidInputError(
            "path: was made in Python, which a document does not hold; give it again, as the "
            "argument path"
        )
    return arms.share("path", section, lambda: described_path(section, "path", modules))


def described_path(section: Mapping[str, Any], key: str, modules: Modules) -> Path:
    """Return the path that a section of a document describes.

    Args:
        section: Its ``kind`` and fields.
        key: Key of the section in the document.
        modules: Modules that may be imported for it.

    Raises:
        InvalidInputError: If the kind is unknown or a field is wrong.
    """
    return _make(section, key, modules, {})


def _doubts(path: Path, duration: float) -> list[str]:
    """Return a warning about a path that ends after the run; refuse one that begins after it."""
    if not isinstance(path, (Drawing, TimedPath)):
        return []
    if isinstance(path, TimedPath) and path.begins >= duration:
        raise InvalidInputError(
            f"path: begins at {path.begins:g} s, and the run ends at {duration:g} s"
        )
    if path.duration > duration * (1.0 + 1e-9):
        return [f"path: ends at {path.duration:g} s, and the run at {duration:g} s"]
    return []


def _make(
    section: Mapping[str, Any], key: str, modules: Modules, parts: dict[str, type[Path]]
) -> Path:
    """Return the path that a section describes; each part of a sequence is such a section too.

    Args:
        section: The section.
        key: Key of the section in the document.
        modules: Modules that may be imported.
        parts: Classes found so far, by kind: finding a class takes milliseconds, and a sequence
            may have thousands of parts.
    """
    name = section.get("kind")
    kind = parts.get(name) if isinstance(name, str) else None
    if kind is None:
        kind = parts[str(name)] = PATHS.named_by(section, modules, key)
    fields = without_kind(section)
    if issubclass(kind, Sequence) and isinstance(fields.get("parts"), list):
        fields["parts"] = [
            _part(part, f"{key}.parts.{number}", modules, parts)
            for number, part in enumerate(fields["parts"])
        ]
    path: Path = construct(kind, fields, key)
    return path


def _part(section: Any, key: str, modules: Modules, values: dict[str, type[Path]]) -> Part:
    if not isinstance(section, Mapping) or not isinstance(section.get("path"), Mapping):
        raise InvalidInputError(
            f"{key}: must be a mapping with a path, and perhaps lasts and bridge, not {section!r}"
        )
    path = _make(section["path"], f"{key}.path", modules, values)
    return construct(Part, {**section, "path": path}, key)


#: Sections that determine the fields of a law which a document must not give.
ORIGINS = {
    "limits": "arm and limits",
    "home": "start",
    "torque_limits": "arm",
    "endless": "arm",
    "task_size": "task",
    "objectives": "task",
    "measurement": "sensing",
    "clearance": "arm and obstacles",
    "other": "second",
    "detours": "detour",
    "sees_axes": "arm and sensing",
    "points": "camera",
    "pixel_size": "camera",
}


#: Sections that determine the fields of an objective which a document must not give.
OBJECTIVE_ORIGINS = {"limits": "arm and limits", "home": "start", "arm": "arm"}


def make_law(
    document: ExperimentDocument,
    kind: type[Law],
    arm: Arm,
    start: Array,
    clearance: Clearance | None,
    task: Task,
    modules: Modules = True,
) -> Law:
    """Return the law, including the fields that follow from limits, start and task.

    Args:
        document: Document of the experiment.
        kind: Class of the law.
        arm: The arm, with the limits of the experiment.
        start: Start posture, shape (n,) [rad].
        clearance: What the arm is to stay clear of; None for nothing.
        task: What is asked of the end effector.
        modules: Modules that may be imported for its objectives.

    Raises:
        InvalidInputError: If a field is wrong, or given although it follows from something else;
            if the law does not fit the task or a feature; or if it cannot be sampled at this
            period, or not be integrated.
    """
    camera = document.camera
    size = task.size if camera is None else camera.size
    available = {"limits": arm.limits, "home": start, "task_size": size}
    noise = 0.0 if camera is None else camera.noise * camera.pixel_size
    measurement = measurement_of(document.sensing, noise, turns=task.with_orientation)
    available |= {"measurement": measurement, "clearance": clearance, "other": None}
    available |= {"endless": arm.endless.tolist(), "torque_limits": arm.effort}
    available |= {"objectives": task.blocks or None, "detours": document.detour is not None}
    available["sees_axes"] = not (arm.description.pair or arm.base or document.sensing)
    if camera is not None:
        available |= {"points": len(camera.points), "pixel_size": camera.pixel_size}
    fields = field_names(kind)
    values = {name: value for name, value in available.items() if name in fields}
    for name in ORIGINS:
        if name in fields and name in document.law:
            raise InvalidInputError(f"law.{name}: follows from {ORIGINS[name]}; leave it out")
    _require_size(document.task, task, kind)
    section = without_kind(document.law)
    if issubclass(kind, PostureLaw) and isinstance(section.get("target"), str):
        section["target"] = arm.named_posture("law.target", section["target"])
    if described_class(kind, "secondary") is Secondary:
        section |= _with_objectives(section, arm, start, modules)
    law: Law = construct(kind, {**values, **section}, "law")
    check_declared(law)
    refuse(combination_of(document, kind, law, task))
    parts = {**law.state.parts, **law.inputs.parts}
    shapes = {name: shape for name, (_, shape) in parts.items()}
    if camera is None and not suits(task, shapes):
        able = ", ".join(tasks_suiting(shapes))
        raise InvalidInputError(f"task: may be {able} for this law, not {document.task}")
    if document.period is not None:
        sampled_reading(law, document.period)
    else:
        continuous_reading(law)
    return law


def _with_objectives(
    law: Mapping[str, Any], arm: Arm, start: Array, modules: Modules
) -> dict[str, Any]:
    """Return the key ``secondary`` of a law with its objectives made, if there are any.

    Args:
        law: Keys of the law.
        arm: The arm, with the limits of the experiment.
        start: Start posture, shape (n,) [rad].
        modules: Modules that may be imported for a class.
    """
    secondary = law.get("secondary")
    if not isinstance(secondary, Mapping) or not isinstance(secondary.get("objectives"), list):
        return {}
    available = {"limits": arm.limits, "home": start, "arm": arm}
    objectives = [
        _objective(section, f"law.secondary.objectives[{number}]", available, modules)
        for number, section in enumerate(secondary["objectives"])
    ]
    return {"secondary": {**secondary, "objectives": objectives}}


def _objective(section: Any, key: str, context: Mapping[str, Any], modules: Modules) -> Objective:
    """Return the objective that an entry of a document describes.

    Args:
        section: The entry.
        key: Its key in the document.
        context: Values of fields that follow from other sections, by name.
        modules: Modules that may be imported for the class.
    """
    if not isinstance(section, Mapping):
        raise InvalidInputError(f"{key}: must be a mapping of keys to values, not {short(section)}")
    kind = OBJECTIVES.named_by(section, modules, key)
    fields = field_names(kind)
    for name in context:
        if name in fields and name in section:
            raise InvalidInputError(
                f"{key}.{name}: follows from {OBJECTIVE_ORIGINS[name]}; leave it out"
            )
    values = {name: value for name, value in context.items() if name in fields}
    return construct(kind, {**values, **without_kind(section)}, key)


def _require_size(name: Any, task: Task, kind: Any) -> None:
    """Raise an InvalidInputError if the law's field ``task_size`` does not allow the task."""
    if "task_size" not in field_names(kind):
        return
    sizes = get_args(kind.__pydantic_fields__["task_size"].annotation)
    if task.objectives and task.size == 6 and "objectives" not in field_names(kind):
        raise InvalidInputError(
            "task: 6 rows are taken for a pose by this law; give task: pose, or another number of "
            "rows"
        )
    if not sizes or task.size in sizes:
        return
    if task.objectives:
        raise InvalidInputError(
            f"task: may have {min(sizes)} to {max(sizes)} rows for this law, not {task.size}: "
            f"{', '.join(f'{each.size} of {each.text}' for each in task.objectives)}"
        )
    able = ", ".join(name for name, size in TASKS.items() if size.size in sizes)
    raise InvalidInputError(f"task: may be {able} for this law, not {name}")
