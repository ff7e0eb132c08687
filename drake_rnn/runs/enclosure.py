"""What the folder of a result encloses, so that it can be read where its inputs are not.

- Copies of the files that its document names, with their digests: models with their meshes.
- Stand-ins for a law and a path of modules that are not there: what these said of themselves, and
  where the path led. No code is enclosed, and nothing that is read here runs any.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from io import BytesIO
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.trajectories import PiecewisePolynomial, PiecewiseQuaternionSlerp

from ..errors import InvalidInputError
from ..experiment import Experiment
from ..experiment.components import GIVEN_KIND
from ..experiment.files import named_files, resolve_files
from ..inputs.fields import Array
from ..inputs.files import arrays_of, content_of, is_file, json_of
from ..inputs.kinds import Kinds, Modules
from ..inputs.messages import nearest
from ..laws import LAWS, PostureLaw, SampledLaw
from ..laws.checks import check_declared
from ..laws.law import Layout
from ..laws.parts.secondary import OBJECTIVES
from ..paths import PATHS, PlacedPath
from ..paths import Path as MotionPath
from ..paths.path import Motion
from ..paths.trajectory import SlerpTurning
from ..robot.arm_description import PACKAGE
from ..robot.load_arm import shipped_arms
from ..robot.model.meshes import companions
from ..robot.model.mjcf import include_files
from ..robot.model.ros_packages import (
    MOST_BYTES,
    Packages,
    expand_xacro,
    is_xacro,
    parse_xml,
    write_xml,
)

#: Folder of what is enclosed, and the list of it, in the folder of a result.
INPUTS = "inputs"
LIST = f"{INPUTS}/inputs.json"
_PATH = f"{INPUTS}/path.npz"
# Largest size of all copies together, and of a file that is no model [bytes].
_MOST, _MOST_FILE = 50_000_000, 1_000_000_000
_TOO_LARGE = f"larger than {_MOST / 1e6:g} MB with what is enclosed"
# Attributes and elements of a model by which it names a file.
_ATTRIBUTES, _ELEMENTS = ("filename", "file"), ("uri", "albedo_map", "normal_map")
# Folders of MJCF, by the elements whose files are in them.
_MJCF = {"mesh": "meshdir", "hfield": "meshdir", "skin": "meshdir", "texture": "texturedir"}
# Most samples of an enclosed path.
_SAMPLES = 4001


@dataclass
class Enclosure:
    """What is to be written beside a result.

    Attributes:
        document: Contents of the document, which names the copies.
        contents: Content of each file, by its name in the folder.
        files: A line for each copy: its key, the file's name before, its copy and their digests.
        left_out: What is not enclosed, and why, by key.
        stand_ins: What law and path say of themselves, if their classes are not shipped.
    """

    document: dict[str, Any]
    contents: dict[str, bytes] = field(default_factory=dict)
    files: list[dict[str, str]] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    stand_ins: dict[str, Any] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Size of all of it [bytes]."""
        return sum(map(len, self.contents.values()))

    def write(self, folder: Path) -> None:
        """Write it to the folder of a result; OSError if that fails."""
        if not (self.files or self.left_out or self.stand_ins):
            return
        (folder / INPUTS).mkdir(exist_ok=True)
        contents = {name: getattr(self, name) for name in ("files", "left_out", "stand_ins")}
        # First, so that what was written before an error is known.
        (folder / LIST).write_text(json.dumps(contents, indent=2) + "\n")
        for name, content in self.contents.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)

    def add(self, key: str, file: Path, name: str, content: bytes, source: bytes) -> bool:
        """Add a copy of a file; return whether there is room for it.

        Args:
            key: What names the file.
            file: The file.
            name: Name of the copy in the folder.
            content: Content of the copy.
            source: Content of the file.
        """
        if name not in self.contents:
            if self.size + len(content) > _MOST:
                return False
            self.contents[name] = content
            digests = {"sha256": _digest(content), "sha256_of_source": _digest(source)}
            self.files.append({"key": key, "source": file.name, "copy": name, **digests})
        return True


def enclosure_of(experiment: Experiment) -> Enclosure:
    """Return what the folder of a result of an experiment encloses.

    What cannot be read, or has no room, is left out: the document names it as before.
    """
    enclosure = Enclosure(experiment.document.contents())
    entries = [
        (key, sec, name, sec.get(name)) for key, sec, name in named_files(enclosure.document)
    ]
    # What only looks depend on comes last, if there is room.
    entries.sort(key=lambda each: each[0].endswith(".looks"))
    for key, section, name, value in entries:
        if not isinstance(value, str) or ".packages." in key or not is_file(value):
            continue
        if name == "model" and value in shipped_arms():
            continue
        try:
            copy = _enclose(enclosure, key, Path(value), section)
        except (OSError, ValueError) as error:
            enclosure.left_out[key] = str(error)
        else:
            if copy:
                section[name] = copy
            else:
                enclosure.left_out[key] = _TOO_LARGE
    for prefix in ("", "second."):
        _drop_packages(enclosure, prefix)
    _stand_in(enclosure, experiment)
    return enclosure


def _drop_packages(enclosure: Enclosure, prefix: str) -> None:
    """Leave out the folders of packages, if the copies of models do not need them."""
    document = enclosure.document if not prefix else _section(enclosure.document, "second")
    if not any(key.startswith(f"{prefix}arm.") for key in enclosure.left_out):
        arm = _section(document, "arm")
        for section in (arm, _section(arm, "gripper")):
            section.pop("packages", None)


def _enclose(enclosure: Enclosure, key: str, file: Path, section: Mapping[str, Any]) -> str:
    """Add the copies of a file that a document names; return its name, empty without room."""
    name = f"{INPUTS}/{_folder(key)}/{file.name}"
    if not key.endswith((".model", ".looks")) and not key.startswith("obstacles["):
        source = content_of(file, _MOST_FILE)
        return name if enclosure.add(key, file, name, source, source) else ""
    source = content_of(file, MOST_BYTES)
    packages = Packages(section.get("packages") or {}, file)
    root = parse_xml(source)
    if root is None:
        return name if enclosure.add(key, file, name, source, source) else ""
    is_expanded = is_xacro(root)
    if is_expanded:
        root = parse_xml(expand_xacro(file, packages))
        assert root is not None
        stem = file.name.removesuffix(".xacro").removesuffix(".urdf")
        name = f"{INPUTS}/{_folder(key)}/{stem}.urdf"
    before = write_xml(root)
    _name_copies(enclosure, key, root, packages, PurePosixPath(name).parent)
    after = write_xml(root)
    content = source if after == before and not is_expanded else after.encode()
    return name if enclosure.add(key, file, name, content, source) else ""


def _folder(key: str) -> str:
    return "".join(each if each.isalnum() or each in "._" else "_" for each in key)


def _name_copies(
    enclosure: Enclosure, key: str, root: Element, packages: Packages, place: PurePosixPath
) -> None:
    """Add copies of the files that a model names, and name these in it, relative to the model.

    All that the files take is either enclosed or left out.

    Args:
        enclosure: What copies are added to.
        key: Key of the model.
        root: The model.
        packages: Where its files are.
        place: Folder of the model's copy, in the folder of the result.
    """
    changes = _changes(root, packages)
    contents = _mesh_contents([file for _, file in changes])
    if enclosure.size + sum(len(content) for _, content in contents.values()) > _MOST:
        enclosure.left_out[f"{key}: meshes"] = _TOO_LARGE
        return
    for name, (file, content) in contents.items():
        enclosure.add(f"{key}: meshes", file, str(place / name), content, content)
    names = {file: name for name, (file, _) in contents.items()}
    for change, file in changes:
        change(names[file])
    for compiler in root.findall("compiler") if root.tag == "mujoco" else ():
        for name in ("meshdir", "texturedir", "assetdir"):
            compiler.attrib.pop(name, None)


def _changes(root: Element, packages: Packages) -> list[tuple[Callable[[str], None], Path]]:
    """Return the files that a model names, each with what gives it another name there."""
    if root.tag == "mujoco":
        include_files(root, packages)
    folders = _mjcf_folders(root)
    changes = []
    for element, uri, change in _names(root):
        inside = folders.get(element.tag, "")
        file = packages.file(str(Path(inside) / uri) if inside else uri)
        if file is not None and element.tag != "include":
            changes.append((change, file))
    return changes


def _mesh_contents(files: Iterable[Path]) -> dict[str, tuple[Path, bytes]]:
    """Return files that a model names, and those that these name, by the names of their copies."""
    names: dict[Path, str] = {}
    for file in files:
        names.setdefault(file, f"meshes/{_number(names, file)}/{file.name}")
    contents = {name: (file, content_of(file, _MOST_FILE)) for file, name in names.items()}
    for file, name in names.items():
        for other in companions(file):
            beside = os.path.normpath(Path(name).parent / os.path.relpath(other, file.parent))
            if beside.startswith("meshes/"):
                contents.setdefault(beside, (other, content_of(other, _MOST_FILE)))
    return contents


def _number(names: Mapping[Path, str], file: Path) -> int:
    """Return the number of the folder for copies from the folder of a file."""
    folders = list(dict.fromkeys([each.parent for each in names]))
    return folders.index(file.parent) if file.parent in folders else len(folders)


def _names(root: Element) -> Iterable[tuple[Element, str, Callable[[str], None]]]:
    """Yield each element of a model that may name a file, the name, and what changes it."""
    for element in root.iter():
        for attribute in _ATTRIBUTES:
            if uri := element.get(attribute, "").strip():

                def change(
                    name: str, element: Element = element, attribute: str = attribute
                ) -> None:
                    element.set(attribute, name)

                yield element, uri, change
        if element.tag in _ELEMENTS and (uri := (element.text or "").strip()):

            def change_text(name: str, element: Element = element) -> None:
                element.text = name

            yield element, uri, change_text


def _mjcf_folders(root: Element) -> dict[str, str]:
    """Return the folder of files by the tag that names them; empty but for MJCF."""
    if root.tag != "mujoco":
        return {}
    folders: dict[str, str] = {}
    for compiler in root.findall("compiler"):
        folders |= compiler.attrib
    return {tag: folders.get(name) or folders.get("assetdir", "") for tag, name in _MJCF.items()}


def _digest(content: bytes) -> str:
    return sha256(content).hexdigest()


def find_files(document: dict[str, Any], folder: Path) -> list[str]:
    """Name the files of a saved document where they are now, in place; return warnings.

    Args:
        document: Contents of the document in the folder.
        folder: Folder of the result.

    Raises:
        InvalidInputError: If what the folder encloses cannot be read.
    """
    entries = _read_list(folder)
    warnings = [
        f"{entry['copy']}: is not what the run has read; it was changed since"
        for entry in entries["files"]
        if _differs(folder / entry["copy"], entry["sha256"])
    ]
    resolve_files(document, folder)
    for key, section, name in named_files(document):
        looks = section.get(name)
        if name == "looks" and isinstance(looks, str) and looks != PACKAGE and not is_file(looks):
            del section[name]
            warnings.append(f"{key}: no file {looks!r}; the arm is drawn as its model says")
    return warnings


def name_sources(document: dict[str, Any], source: dict[str, Any]) -> None:
    """Name in a saved document, in place of copies, the files that they are copies of.

    Args:
        document: Contents of the document in the folder of a result.
        source: Contents of the document of its run.
    """
    sources = {key: section.get(name) for key, section, name in named_files(source)}
    for key, section, name in named_files(document):
        if str(section.get(name)).startswith(f"{INPUTS}/") and key in sources:
            section[name] = sources[key]
    for now, then in (
        (document, source),
        (_section(document, "second"), _section(source, "second")),
    ):
        if packages := _section(then, "arm").get("packages"):
            _section(now, "arm").setdefault("packages", packages)


def _section(document: Mapping[str, Any], key: str) -> dict[str, Any]:
    section = document.get(key)
    return section if isinstance(section, dict) else {}


def _read_list(folder: Path) -> dict[str, Any]:
    """Return what a folder says that it encloses.

    Raises:
        InvalidInputError: If that cannot be read.
    """
    try:
        entries = json_of(folder / LIST)
        files, stand_ins = entries["files"], entries["stand_ins"]
        if not isinstance(stand_ins, dict):
            raise ValueError("stand_ins: must be a mapping")
        return {
            "files": [{name: str(each[name]) for name in ("copy", "sha256")} for each in files],
            "stand_ins": stand_ins,
        }
    except FileNotFoundError:
        return {"files": [], "stand_ins": {}}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InvalidInputError(f"{folder}: {LIST}: cannot be read: {error}") from None


def _differs(file: Path, digest: str) -> bool:
    """Return whether a copy is there, and not as it was written."""
    try:
        return _digest(content_of(file, _MOST_FILE)) != digest
    except (OSError, ValueError):
        return False


def missing_files(document: Any, folder: Path, error: str) -> str:
    """Return what else is to be said of an error: how what is missing can be given; or nothing.

    Args:
        document: Contents of the document in the folder.
        folder: Folder of the result.
        error: The error. Only the file that it is about is named.
    """
    if any(error.startswith(f"{key}.kind: ") for key in ("law", "path", "environment")):
        if (folder / INPUTS).is_dir():
            return ""
        return f"; {INPUTS}, where the run has kept what stands for it, is missing in the folder"
    for key, section, name in named_files(document) if isinstance(document, dict) else ():
        value = section.get(name)
        exists = isinstance(value, str) and (Path(value).exists() or value in shipped_arms())
        # Texts without a folder may be other than files.
        of_other = not error.startswith(key.partition(".")[0])
        if isinstance(value, str) and not exists and os.sep in value and not of_other:
            return f"; say where it is now: --set {key}=FILE, in Python files={{{key!r}: FILE}}"
    return ""


def replace_files(document: dict[str, Any], files: Mapping[str, Any]) -> None:
    """Put files in the place of those that a document names, by dotted key.

    Raises:
        InvalidInputError: If a key names none.
    """
    places = {key: (section, name) for key, section, name in named_files(document)}
    keys = [key for key, (section, name) in places.items() if section.get(name) is not None]
    for key, value in files.items():
        if key not in keys and not key.startswith("arm.packages."):
            names = f"its files are {', '.join(keys)}" if keys else "it names no files"
            hint = f"; {nearest(key, keys)}" if keys else ""
            raise InvalidInputError(
                f"{key}: of a saved result only the files can be given anew; {names}{hint}"
            )
        if not isinstance(value, (str, Path)):
            raise InvalidInputError(f"{key}: must be the name of a file, not {value!r}")
        if key in places:
            section, name = places[key]
        else:
            arm = document["arm"]
            section, name = arm.setdefault("packages", {}), key.removeprefix("arm.packages.")
        section[name] = str(Path(value).absolute())


# What a law says of itself that is asked after a run, by name, with the kinds of values.
_TRAITS: dict[str, tuple[type, ...]] = {
    **dict.fromkeys(("levels_are_derivatives", "follows_joint_targets", "stays_on_path"), (bool,)),
    **dict.fromkeys(("learns_jacobian", "sees_jacobian", "sees_velocity"), (bool,)),
    **dict.fromkeys(("sees_tool_velocity", "sees_pixels", "sees_turning"), (bool,)),
    **dict.fromkeys(("follows_position", "sees_desired_motion", "follows_orientation"), (bool,)),
    **dict.fromkeys(("presses", "measures_force"), (bool,)),
    "keeps": (list,),
    "keeps_distance": (float, int, type(None)),
    "limits_remedy": (str,),
}


def _stand_in(enclosure: Enclosure, experiment: Experiment) -> None:
    """Add what stands in for a law or path whose class others may not have."""
    document, law = experiment.document, experiment.law
    if not all(kind in shipped_kinds for kind, shipped_kinds in _kinds_of(document.law)):
        traits: dict[str, Any] = {name: getattr(law, name) for name in _TRAITS}
        traits |= {"class": type(law).__name__, "target": None, "keeps": list(law.keeps)}
        for name in ("state", "inputs"):
            shapes = getattr(law, name).shapes
            traits[name] = {part: [int(size) for size in shape] for part, shape in shapes.items()}
        if isinstance(law, PostureLaw):
            traits["target"] = law.target.tolist()
        enclosure.stand_ins["law"] = traits
    path = document.path
    if path is not None and any(kind not in PATHS.shipped_classes for kind in _path_kinds(path)):
        enclosure.contents[_PATH] = _record_path(experiment)
        enclosure.stand_ins["path"] = _PATH


def _kinds_of(law: Mapping[str, Any]) -> list[tuple[Any, Mapping[str, Any]]]:
    """Return the kinds that the section of a law names, with those that are shipped."""
    return [(law.get("kind"), LAWS.shipped_classes)] + [
        (each.get("kind"), OBJECTIVES.shipped_classes) for each in _objectives(law)
    ]


def _objectives(law: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    secondary = law.get("secondary")
    objectives = secondary.get("objectives") if isinstance(secondary, Mapping) else None
    return [each for each in objectives or [] if isinstance(each, Mapping)]


def _path_kinds(path: Mapping[str, Any]) -> list[Any]:
    """Return the kinds that the section of a path names; parts of a sequence have their own."""
    parts = [each.get("path") for each in path.get("parts") or [] if isinstance(each, Mapping)]
    inner = [kind for each in parts if isinstance(each, Mapping) for kind in _path_kinds(each)]
    return [path.get("kind"), *inner]


def stand_ins(
    document: Mapping[str, Any], folder: Path, modules: Modules
) -> tuple[SampledLaw | None, MotionPath | None, list[str]]:
    """Return what stands in for law and path of a saved run, None for what is known here, and why.

    Args:
        document: Contents of the document.
        folder: Folder of the result.
        modules: Modules that may be imported.

    Raises:
        InvalidInputError: If a stand-in cannot be read.
    """
    entries = _read_list(folder)["stand_ins"]
    law, path, why = None, None, ["", ""]
    sections = [document.get(key) for key in ("law", "path")]
    components: list[tuple[Kinds[Any], Mapping[str, Any], str]]
    if "law" in entries and isinstance(sections[0], Mapping):
        components = [(LAWS, sections[0], "law")]
        components += [(OBJECTIVES, each, "law.secondary") for each in _objectives(sections[0])]
        why[0] = _unknown(components, modules)
        if why[0]:
            law = recorded_law(entries["law"], folder)
    if "path" in entries and isinstance(sections[1], Mapping):
        components = [(PATHS, {"kind": kind}, "path") for kind in _path_kinds(sections[1])]
        why[1] = _unknown(components, modules)
        if why[1]:
            path = RecordedPath(_recorded_motion(folder))
    notes = ("the saved numbers suffice to show the run", "the saved path is shown")
    unlike = zip(why, notes, strict=True)
    return law, path, [f"{text}; {note}" for text, note in unlike if text]


def _unknown(
    components: Iterable[tuple[Kinds[Any], Mapping[str, Any], str]], modules: Modules
) -> str:
    """Return why a class that sections name is not known; empty if all are."""
    for kinds, section, place in components:
        if section.get("kind") == GIVEN_KIND["kind"]:
            return "path: was made in Python"
        try:
            kinds.named_by(section, modules, place)
        except InvalidInputError as error:
            return str(error)
    return ""


def recorded_law(description: Mapping[str, Any], folder: Path) -> SampledLaw:
    """Return a law that says of itself what another one said, and computes nothing.

    Args:
        description: What it said, as `Enclosure.stand_ins` holds it.
        folder: Folder of the result, for messages.

    Raises:
        InvalidInputError: If something is missing or of a wrong kind.
    """
    try:
        name = str(description["class"])
        traits = {each: description[each] for each in _TRAITS}
        wrong = [
            each for each, kinds in _TRAITS.items() if not isinstance(description[each], kinds)
        ]
        if wrong:
            raise ValueError(f"{wrong[0]} is {traits[wrong[0]]!r}")
        layouts = {
            each: Layout(**{part: tuple(shape) for part, shape in description[each].items()})
            for each in ("state", "inputs")
        }
        traits["keeps"] = tuple(traits["keeps"])
        base: Any = SampledLaw
        if (target := description["target"]) is not None:
            base, traits["target"] = PostureLaw, np.array(target, dtype=float)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InvalidInputError(f"{folder}: {LIST}: law: cannot be read: {error}") from None

    def step(self: SampledLaw, t: float, x: Array, u: Any, period: float) -> Array:
        raise InvalidInputError(
            f"law: {name} is not known here; the result says what it was, not how it computes"
        )

    law_class = type(name, (base,), {**traits, **layouts, "step": step})
    law: SampledLaw = object.__new__(law_class)
    check_declared(law)
    return law


def _record_path(experiment: Experiment) -> bytes:
    """Return where a path led during a run, as arrays of numbers."""
    path, document = experiment.desired, experiment.document
    # The instants of the log, where a motion begins and ends.
    count = min(_SAMPLES, max(2, 1 + round(document.duration / document.log_period)))
    time = np.linspace(0.0, document.duration, count)
    positions = [path.position(t) for t in time.tolist()]
    arrays: dict[str, Any] = {
        "time": time,
        "p_WE": np.array([p for p, _, _ in positions]),
        "v_WE": np.array([v for _, v, _ in positions]),
        "duration": np.array(path.duration),
        "traversal": np.array(path.traversal),
        "closed": np.array(path.closed),
        "turns": np.array(path.turns),
    }
    if path.oriented:
        turning_times = time if path.turns else time[:1]
        arrays["R_WE"] = np.array([path.orientation(t)[0] for t in turning_times.tolist()])
    stream = BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


class RecordedMotion(PlacedPath):
    """Where a path has led, between samples of a run.

    Args:
        arrays: Times, positions and velocities, orientations if they are known; how it is passed.
    """

    def __init__(self, arrays: Mapping[str, Array]) -> None:
        time, p, v = arrays["time"], arrays["p_WE"], arrays["v_WE"]
        self._end = float(time[-1])
        self._p = PiecewisePolynomial.CubicHermite(time, p.T, v.T)
        self._v, self._a = self._p.MakeDerivative(1), self._p.MakeDerivative(2)
        self._duration, self._traversal = float(arrays["duration"]), float(arrays["traversal"])
        self._closed, self._turns = bool(arrays["closed"]), bool(arrays["turns"])
        self._R = arrays.get("R_WE")
        self._turning = None
        if self._turns and self._R is not None:
            turns = [RotationMatrix(R).ToQuaternion() for R in self._R]
            self._turning = SlerpTurning(PiecewiseQuaternionSlerp(time, turns))

    @property
    def duration(self) -> float:
        """See `Passage.duration`."""
        return self._duration

    @property
    def traversal(self) -> float:
        """See `Passage.traversal`."""
        return self._traversal

    @property
    def closed(self) -> bool:
        """See `Passage.closed`."""
        return self._closed

    @property
    def turns(self) -> bool:
        """See `Passage.turns`."""
        return self._turns

    @property
    def oriented(self) -> bool:
        """See `PlacedPath.oriented`."""
        return self._R is not None

    def position(self, t: float) -> Motion:
        """See `PlacedPath.position`; after the run, where it ended."""
        t = min(max(t, 0.0), self._end)
        p, v, a = (each.value(t).ravel() for each in (self._p, self._v, self._a))
        return p, v, a

    def orientation(self, t: float) -> Motion:
        """See `PlacedPath.orientation`."""
        if self._R is None:
            raise InvalidInputError("path: its orientation is not known")
        if self._turning is None:
            return self._R[0], np.zeros(3), np.zeros(3)
        return self._turning.at(min(max(t, 0.0), self._end))


class RecordedPath(MotionPath):
    """A path whose class is not known, where a run was led by it.

    Args:
        motion: Where it has led.
    """

    def __init__(self, motion: PlacedPath) -> None:
        self._motion = motion

    @property
    def has_place(self) -> bool:
        """See `Path.has_place`."""
        return True

    def placed(
        self,
        p_WE: Array | None = None,
        R_WE: Array | None = None,
        frames: Mapping[str, RigidTransform] | None = None,
    ) -> PlacedPath:
        """Return where it has led, whatever the pose."""
        return self._motion


def _recorded_motion(folder: Path) -> RecordedMotion:
    try:
        return RecordedMotion(arrays_of(folder / _PATH))
    except (OSError, ValueError, KeyError, IndexError, RuntimeError) as error:
        raise InvalidInputError(f"{folder}: {_PATH}: cannot be read: {error}") from None
