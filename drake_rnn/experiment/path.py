"""The path that an experiment's document describes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydrake.trajectories import Trajectory

from ..errors import InvalidInputError
from ..inputs.complaints import require_type
from ..inputs.documents import construct, without_kind
from ..inputs.modules import Modules
from ..paths import PATHS, Drawing, Part, Path, Rest, Sequence, as_path
from ..paths.timed import TimedPath
from .arms import Arms
from .document import ExperimentDocument

#: Section of a document in place of a path that was made in Python.
GIVEN = {"kind": "given"}


def path_of(
    document: ExperimentDocument,
    arms: Arms,
    seeks_posture: bool,
    given: Path | Trajectory | None,
    modules: Modules,
) -> tuple[Path, list[str]]:
    """Return the path of an experiment, shared by documents that describe the same, and warnings.

    Args:
        document: Document of the experiment.
        arms: Parts that documents share.
        seeks_posture: Whether its law seeks a posture while the end effector stays.
        given: Path that was made in Python, in place of one that the document describes.
        modules: Modules that may be imported for the path.

    Raises:
        InvalidInputError: If a key is wrong; if the path must be given or left out; or if its times
            begin after the run's end.
    """
    if seeks_posture:
        return Rest(), []
    if given is not None:
        path = as_path(given)
        require_type("path", path, Path)
    else:
        path = _described(document.path, arms, modules)
    return path, _doubts(path, document.duration)


def _described(section: Mapping[str, Any] | None, arms: Arms, modules: Modules) -> Path:
    if section is None:
        raise InvalidInputError("path: must be given")
    if section == GIVEN:
        raise InvalidInputError(
            "path: was made in Python, which a document does not hold; give it again, as the "
            "argument path"
        )
    return arms.shared("path", section, lambda: described_path(section, "path", modules))


def described_path(section: Mapping[str, Any], key: str, modules: Modules) -> Path:
    """Return the path that a section of a document describes.

    Args:
        section: Its ``kind`` and fields.
        key: Key of the section in the document.
        modules: Modules that may be imported for it.

    Raises:
        InvalidInputError: If the kind is unknown or a field is wrong.
    """
    return _made(section, key, modules, {})


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


def _made(
    section: Mapping[str, Any], key: str, modules: Modules, known: dict[str, type[Path]]
) -> Path:
    """Return the path that a section describes; each part of a sequence is such a section too.

    Args:
        section: The section.
        key: Key of the section in the document.
        modules: Modules that may be imported.
        known: Classes found so far, by kind: finding a class takes milliseconds, and a sequence
            may have thousands of parts.
    """
    name = section.get("kind")
    kind = known.get(name) if isinstance(name, str) else None
    if kind is None:
        kind = known[str(name)] = PATHS.named_by(section, modules, key)
    fields = without_kind(section)
    if issubclass(kind, Sequence) and isinstance(fields.get("parts"), list):
        fields["parts"] = [
            _part(part, f"{key}.parts.{number}", modules, known)
            for number, part in enumerate(fields["parts"])
        ]
    path: Path = construct(kind, fields, key)
    return path


def _part(section: Any, key: str, modules: Modules, known: dict[str, type[Path]]) -> Part:
    if not isinstance(section, Mapping) or not isinstance(section.get("path"), Mapping):
        raise InvalidInputError(
            f"{key}: must be a mapping with a path, and perhaps lasts and bridge, not {section!r}"
        )
    path = _made(section["path"], f"{key}.path", modules, known)
    return construct(Part, {**section, "path": path}, key)
