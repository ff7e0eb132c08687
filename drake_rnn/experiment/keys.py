"""Keys of an experiment's document: meanings, units, which of them do nothing, JSON schema.

Meaning and unit are told where a field is declared, by `drake_rnn.inputs.keys.Meaning`. The schema,
for editors, is made from the classes that check documents, and from the sections that name their
classes by a ``kind``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any

from pydrake.systems.analysis import GetIntegrationSchemes

from ..environments import ENVIRONMENTS
from ..errors import InvalidInputError
from ..features.second import COMMON_KEYS, Base
from ..inputs.keys import (
    Classes,
    Key,
    Only,
    Schema,
    default_of,
    described_class,
    format_value,
    keys_of,
    meanings_of,
    of_kinds,
    whole_document,
    with_kind,
)
from ..inputs.kinds import Kinds
from ..inputs.messages import field_names, fields_of, plain
from ..laws import LAWS, Law, PostureLaw
from ..laws.parts.secondary import OBJECTIVES, Secondary
from ..measures import METRICS
from ..paths import PATHS, Part
from ..robot.arm_description import ArmDescription, PairDescription
from ..robot.clearance.model_obstacle import KINDS as OBSTACLES
from ..robot.clearance.obstacles import Obstacle
from ..robot.limits import FIELD_UNITS, JointLimits
from ..robot.load_arm import shipped_arms, shipped_limits
from ..robot.task import TASKS
from ..robot.task_objectives import TASK_OBJECTIVES
from ..systems import BODIES
from .components import ORIGINS
from .document import Acceptance, ExperimentDocument, IntegratorSettings

_KINDS: dict[str, Kinds[Any]] = {"law": LAWS, "path": PATHS, "environment": ENVIRONMENTS}


def key_meanings() -> dict[str, str]:
    """Return the meanings of a document's keys, in order."""
    return {key.name: key.meaning for key in keys_of(ExperimentDocument, ())}


def section_meanings(name: str, value: Any) -> dict[str, str]:
    """Return the meanings of the keys of a section; empty if it has no keys.

    Args:
        name: Name of the section.
        value: The section's contents in the document.

    Raises:
        InvalidInputError: If the section names a kind that there is not.
    """
    return {key: meaning.meaning for key, meaning in _section_keys(name, value).items()}


def unit_of_key(document: Mapping[str, Any], key: str) -> str:
    """Return the unit of a key such as ``law.kappa``; empty if it has none, or is not known.

    Args:
        document: Document with the key; its kinds of law, path and environment decide the meaning.
        key: The dotted key, perhaps with the index of an entry, as in ``start[0]``.
    """
    section, *inner = re.sub(r"\[\d+\]", "", key).split(".")
    try:
        entry = _key(section, document.get(section, {}), inner)
    except InvalidInputError:  # The document names an unknown kind.
        entry = None
    return "" if entry is None else entry.unit


def _key(section: str, value: Any, inner: list[str]) -> Key | None:
    """Return a section's key, or a key within it; None if there is no such key."""
    if not inner:
        return _keys(ExperimentDocument).get(section)
    if len(inner) == 1:
        return _section_keys(section, value).get(inner[0])
    cls = _class_of(section, value)
    for part in inner[:-1]:
        cls = described_class(cls, part) if cls else None
    return _keys(cls).get(inner[-1]) if cls else None


def _section_keys(name: str, value: Any) -> dict[str, Key]:
    if not isinstance(value, Mapping):
        return {}
    if name == "accept":
        return {
            metric.name: Key(metric.name, None, f"{metric.meaning} [{metric.unit}]", metric.unit)
            for metric in METRICS
        }
    if name == "limits":
        return {limit: Key(limit, None, f"[{unit}]", unit) for limit, unit in FIELD_UNITS.items()}
    cls = _class_of(name, value)
    if cls is None:
        return {}
    return _keys(cls) | ({"kind": Key("kind", None, "")} if name in _KINDS else {})


def _class_of(section: str, value: Any) -> type | None:
    """Return the class that a section of a document describes; None if it has no keys."""
    if section in _KINDS:
        return _KINDS[section].named_by(value, modules=True)
    if section == "arm":
        return ArmDescription
    return described_class(ExperimentDocument, section)


def _keys(cls: type) -> dict[str, Key]:
    return {key.name: key for key in keys_of(cls, ())}


#: A section with its dotted name, which ends in a point unless it is the document's own.
_Scope = tuple[str, Any]


def idle_keys(document: Any, **sections: Any) -> Iterator[str]:
    """Yield a sentence for each key of a document that does nothing beside the others.

    Args:
        document: The document.
        sections: What was made of sections that it holds as plain data, by name.
    """
    for name, value in fields_of(document).items():
        section = sections.get(name, value)
        values = value if isinstance(value, Mapping) else _changes_of(value)
        yield from _idle(values, [(f"{name}.", section), ("", document)])


def acting_keys(document: Any, name: str, component: Any) -> dict[str, Key]:
    """Return the keys of a section that do something beside the others of a document, by name.

    Fields that follow from other sections are left out.

    Args:
        document: The document.
        name: Name of the section.
        component: What was made of it.
    """
    scopes = [(f"{name}.", component), ("", document)]
    cls = type(component)
    names = keys_of(cls, ("kind", *_left_out(cls))) if field_names(cls) else []
    return {key.name: key for key in names if _first_unmet(key.name, scopes) is None}


def _changes_of(section: Any) -> dict[str, Any]:
    """Return the fields of a section that differ from their defaults, and those within them."""
    changes = {}
    for field in fields(section) if field_names(type(section)) else ():
        name, default = field.name, default_of(field)
        value = fields_of(section)[name]
        if type(value) is type(default) and field_names(type(value)):
            if within := _changes_of(value):
                changes[name] = within
        elif plain(value) != plain(default):
            changes[name] = value
    return changes


def _idle(values: Mapping[str, Any], scopes: Sequence[_Scope]) -> Iterator[str]:
    """Yield a sentence for each idle key of a section, the first of the scopes."""
    place, owner = scopes[0]
    for key, value in values.items():
        if (unmet := _first_unmet(key, scopes)) is not None:
            yield f"{place}{key}: does nothing here; it acts only with {unmet}"
            continue
        inner = fields_of(owner).get(key)
        if isinstance(value, Mapping):
            yield from _idle(value, [(f"{place}{key}.", inner), *scopes])
        elif isinstance(value, list) and isinstance(inner, tuple) and len(value) == len(inner):
            for number, (entry, each) in enumerate(zip(value, inner, strict=True)):
                if isinstance(entry, Mapping):
                    yield from _idle(entry, [(f"{place}{key}[{number}].", each), *scopes])


def _unmet(condition: Only, key: str, scopes: Sequence[_Scope]) -> str | None:
    """Return what a condition is, and what there is instead; None if it holds.

    It does not hold either if the other key does nothing itself.
    """
    for number, (place, owner) in enumerate(scopes):
        # No key is its own condition: it may be called as a section further out.
        values = fields_of(owner)
        if condition.key not in values or (not number and condition.key == key):
            continue
        value = values[condition.key]
        if condition.holds(value):
            return _first_unmet(condition.key, scopes[number:])
        expectation = f": {condition}" if condition.values else ""
        instead = "is not given" if value is None else f"is {format_value(plain(value))}"
        return f"{place}{condition.key}{expectation}, which {instead}"
    return None


def _first_unmet(key: str, scopes: Sequence[_Scope]) -> str | None:
    """Return what a key of the first scope lacks to act; None if it acts."""
    cls: Any = type(scopes[0][1])
    conditions = _conditions(cls, key)
    unmet = (_unmet(each, key, scopes) for each in conditions)
    return next((each for each in unmet if each is not None), None)


def _conditions(cls: type, key: str) -> tuple[Only, ...]:
    """Return what a key of a class acts with; empty if it always acts."""
    names = meanings_of(cls).get(key) if field_names(cls) else None
    return () if names is None else names.only


#: What a document may have in a field of a class.
OpenFields = dict[tuple[type, str], Schema]
_PATH: Schema = {"$ref": "#/$defs/path"}
_OBSTACLE: Schema = {"$ref": "#/$defs/obstacle"}
_SEVERAL: Schema = {"type": "array", "minItems": 1}
#: Dotted keys, each with a value, and what they may be where all kinds are shipped ones.
CHANGES: Schema = {"$ref": "#/$defs/changes"}
KNOWN_CHANGES: Schema = {"$ref": "#/$defs/known_changes"}
#: How deep dotted keys lead: ``law.avoidance.margin``.
_DEEPEST = 3
#: Dotted keys into what has keys of any name, or those of a whole experiment.
_OPEN = r"^(arm\.(lock|packages)|second|over)\."


def experiment_schema() -> Schema:
    """Return the JSON schema of an experiment's document."""
    definitions = experiment_definitions({})
    document = definitions.pop("ExperimentDocument")
    return whole_document(document, "An experiment of drake_rnn", definitions)


def experiment_definitions(open_fields: OpenFields, *others: type) -> dict[str, Schema]:
    """Return the schemas of all that an experiment's document may hold, by name.

    ``ExperimentDocument`` is the whole, ``changes`` a mapping of dotted keys to new values, and
    ``known_changes`` what is added to it where no class of a user's own has keys of its own.

    Args:
        open_fields: What a document may have in fields that their classes leave open.
        others: Further classes that a document holds.
    """
    open_schemas = {**_OPEN_FIELDS, **open_fields}

    def told(cls: type, field: str) -> Schema | None:
        return next(
            (open_schemas[each, field] for each in cls.__mro__ if (each, field) in open_schemas),
            None,
        )

    classes_of_kinds = [cls for kinds in _KINDS.values() for cls in kinds.shipped_classes.values()]
    wholes = [ExperimentDocument, ArmDescription, PairDescription, Acceptance, Base, Part]
    classes_of_kinds += TASK_OBJECTIVES.shipped_classes.values()
    classes = Classes([*wholes, *classes_of_kinds, *OBSTACLES.values(), *others], told, _left_out)
    schemas = classes.definitions
    for section, kinds in _KINDS.items():
        schemas[section] = _section(classes, kinds.shipped_classes, own=True)
    schemas["obstacle"] = _section(classes, OBSTACLES, own=False)
    schemas["task_objective"] = _section(classes, TASK_OBJECTIVES.shipped_classes, own=True)
    schemas["objective"] = _section(classes, OBJECTIVES.shipped_classes, own=True)
    # Of a shipped arm the frame is known.
    classes.of(ArmDescription)["required"] = ["model"]
    schemas["arm"] = {"anyOf": [{"enum": shipped_arms()}, classes.ref(ArmDescription)]}
    schemas["limits"] = {"anyOf": [_only(_limits()), {"enum": ["none", *sorted(shipped_limits())]}]}
    schemas["accept"] = _only(
        {
            metric.name: {
                **classes.ref(Acceptance),
                "description": f"{metric.meaning} [{metric.unit}]",
            }
            for metric in METRICS
        }
    )
    document = classes.of(ExperimentDocument)
    schemas["second"] = _second(document, classes.ref(Base))
    document["allOf"] = [_only_shipped("over", "law", "path", "environment")]
    keys = dict(_dotted_keys(document, schemas))
    schemas["changes"] = {"type": "object", "properties": keys}
    schemas["known_changes"] = {
        "properties": dict.fromkeys(keys, True),
        "patternProperties": {_OPEN: True},
        "additionalProperties": False,
    }
    return schemas


#: What a document may have in fields that their classes leave open.
_OPEN_FIELDS: OpenFields = {
    (Part, "path"): _PATH,
    # By numbers or by its name.
    (PostureLaw, "target"): {
        "anyOf": [{"type": "array", "items": {"type": "number"}}, {"type": "string"}]
    },
    (Obstacle, "moves"): _PATH,
    (Secondary, "objectives"): {"type": "array", "items": {"$ref": "#/$defs/objective"}},
    (IntegratorSettings, "scheme"): {"enum": [*GetIntegrationSchemes()]},
    (ExperimentDocument, "task"): {
        "anyOf": [
            {"enum": [*TASKS]},
            {"type": "array", "items": {"$ref": "#/$defs/task_objective"}, "minItems": 1},
        ]
    },
    (PairDescription, "arm"): {"$ref": "#/$defs/arm"},
    (ExperimentDocument, "level"): {"enum": [*BODIES]},
    (ExperimentDocument, "obstacles"): {"type": "array", "items": _OBSTACLE},
    (ExperimentDocument, "over"): {"allOf": [CHANGES], "additionalProperties": _SEVERAL},
} | {
    (ExperimentDocument, name): {"$ref": f"#/$defs/{name}"}
    for name in ("arm", "path", "law", "environment", "second", "limits", "accept")
}


def _left_out(cls: type) -> Sequence[str]:
    """Return the fields of a class that follow from other sections of a document."""
    return tuple(ORIGINS) if issubclass(cls, Law) else ()


def _section(classes: Classes, kinds: dict[str, type], *, own: bool) -> Schema:
    """Return the schema of a section that names its class by its ``kind``."""
    for kind, cls in kinds.items():
        with_kind(classes.of(cls), kind)
    return of_kinds({kind: classes.ref(cls) for kind, cls in kinds.items()}, kinds, own)


def _limits() -> dict[str, Schema]:
    """Return the schemas of the bounds that a document may override."""
    number: Schema = {"type": "number"}
    each = {"anyOf": [number, {"type": "array", "items": number}, {"type": "null"}]}
    meanings = {key.name: key.meaning for key in keys_of(JointLimits, ())}
    return {
        name: {**each, "description": f"{meanings[name]} Unit: {unit}."}
        for name, unit in FIELD_UNITS.items()
    }


def _only(properties: dict[str, Schema]) -> Schema:
    """Return the schema of a mapping with no other keys."""
    return {"type": "object", "properties": properties, "additionalProperties": False}


def _second(document: Schema, base: Schema) -> Schema:
    own = {
        name: schema for name, schema in document["properties"].items() if name not in COMMON_KEYS
    }
    follows = {"type": "boolean", "description": "Its path goes along with the first arm's tool."}
    return _only({"base": base, "follows": follows, **own})


def _only_shipped(changes: str, *sections: str) -> Schema:
    """Return that dotted keys are known ones if sections name shipped kinds, or are not there."""
    own = {"properties": {"kind": {"pattern": ":"}}, "required": ["kind"]}
    return {
        "if": {"anyOf": [{"required": [s], "properties": {s: own}} for s in sections]},
        "else": {"properties": {changes: KNOWN_CHANGES}},
    }


def _dotted_keys(schema: Schema, definitions: dict[str, Schema]) -> Iterator[tuple[str, Schema]]:
    """Yield the dotted keys of a document, each with its meaning; of a law's, that of the first."""
    meanings: dict[str, str] = {}
    for key, value in _schema_keys(schema, definitions, "", _DEEPEST):
        meanings.setdefault(key, value.get("description", ""))
    for key, meaning in meanings.items():
        yield key, {"description": meaning} if meaning else {}


def _schema_keys(
    schema: Schema, definitions: dict[str, Schema], prefix: str, deep: int
) -> Iterator[tuple[str, Schema]]:
    """Yield the keys of a schema and of what its values may be."""
    for each in _alternatives(schema, definitions):
        for name, value in each.get("properties", {}).items():
            yield prefix + name, value
            if deep > 1 and name not in ("second", "over"):
                yield from _schema_keys(value, definitions, f"{prefix}{name}.", deep - 1)


def _alternatives(schema: Schema, definitions: dict[str, Schema]) -> Iterator[Schema]:
    """Yield what a value may be: a schema, what it refers to, and its branches."""
    yield schema
    if "$ref" in schema:
        yield from _alternatives(definitions[schema["$ref"].rpartition("/")[2]], definitions)
    for branch in (*schema.get("anyOf", ()), *schema.get("allOf", ())):
        yield from _alternatives(branch.get("then", branch), definitions)
