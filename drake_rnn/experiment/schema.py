"""The JSON schema of experiments: keys, meanings, units and defaults, for editors.

It is made from the classes that check documents, and from the sections that name their classes by
a ``kind``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from pydrake.systems.analysis import GetIntegrationSchemes

from ..environments import ENVIRONMENTS
from ..inputs.json_schema import Classes, Schema, of_kinds, whole_document, with_kind
from ..inputs.keys import keys_of
from ..inputs.kinds import Kinds
from ..laws import LAWS, Law
from ..measures import METRICS
from ..paths import PATHS, Part
from ..robot.arm_description import ArmDescription
from ..robot.clearance.described_obstacles import KINDS as OBSTACLES
from ..robot.clearance.obstacles import Obstacle
from ..robot.limits import FIELD_UNITS, JointLimits
from ..robot.load_arm import shipped_arms, shipped_limits
from ..robot.task import TASKS
from ..systems import BODIES
from .document import Acceptance, ExperimentDocument, IntegratorSettings
from .law import ORIGINS
from .second import SHARED, Base

_KINDS: dict[str, Kinds[Any]] = {"law": LAWS, "path": PATHS, "environment": ENVIRONMENTS}
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
    known = {**_OPEN_FIELDS, **open_fields}

    def told(cls: type, field: str) -> Schema | None:
        return next((known[each, field] for each in cls.__mro__ if (each, field) in known), None)

    named = [cls for kinds in _KINDS.values() for cls in kinds.shipped.values()]
    wholes = [ExperimentDocument, ArmDescription, Acceptance, Base, Part]
    classes = Classes([*wholes, *named, *OBSTACLES.values(), *others], told, _left_out)
    found = classes.definitions
    for section, kinds in _KINDS.items():
        found[section] = _section(classes, kinds.shipped, own=True)
    found["obstacle"] = _section(classes, OBSTACLES, own=False)
    # Of a shipped arm the frame is known.
    classes.of(ArmDescription)["required"] = ["model"]
    found["arm"] = {"anyOf": [{"enum": shipped_arms()}, classes.ref(ArmDescription)]}
    found["limits"] = {"anyOf": [_only(_limits()), {"enum": ["none", *sorted(shipped_limits())]}]}
    found["accept"] = _only(
        {
            metric.name: {
                **classes.ref(Acceptance),
                "description": f"{metric.meaning} [{metric.unit}]",
            }
            for metric in METRICS
        }
    )
    document = classes.of(ExperimentDocument)
    found["second"] = _second(document, classes.ref(Base))
    document["allOf"] = [_only_shipped("over", "law", "path", "environment")]
    keys = dict(_dotted(document, found))
    found["changes"] = {"type": "object", "properties": keys}
    found["known_changes"] = {
        "properties": dict.fromkeys(keys, True),
        "patternProperties": {_OPEN: True},
        "additionalProperties": False,
    }
    return found


#: What a document may have in fields that their classes leave open.
_OPEN_FIELDS: OpenFields = {
    (Part, "path"): _PATH,
    (Obstacle, "moves"): _PATH,
    (IntegratorSettings, "scheme"): {"enum": [*GetIntegrationSchemes()]},
    (ExperimentDocument, "task"): {"enum": [*TASKS]},
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
    told = {key.name: key.meaning for key in keys_of(JointLimits, ())}
    return {
        name: {**each, "description": f"{told[name]} Unit: {unit}."}
        for name, unit in FIELD_UNITS.items()
    }


def _only(properties: dict[str, Schema]) -> Schema:
    """Return the schema of a mapping with no other keys."""
    return {"type": "object", "properties": properties, "additionalProperties": False}


def _second(document: Schema, base: Schema) -> Schema:
    own = {name: found for name, found in document["properties"].items() if name not in SHARED}
    follows = {"type": "boolean", "description": "Its path goes along with the first arm's tool."}
    return _only({"base": base, "follows": follows, **own})


def _only_shipped(changes: str, *sections: str) -> Schema:
    """Return that dotted keys are known ones if sections name shipped kinds, or are not there."""
    own = {"properties": {"kind": {"pattern": ":"}}, "required": ["kind"]}
    return {
        "if": {"anyOf": [{"required": [s], "properties": {s: own}} for s in sections]},
        "else": {"properties": {changes: KNOWN_CHANGES}},
    }


def _dotted(schema: Schema, definitions: dict[str, Schema]) -> Iterator[tuple[str, Schema]]:
    """Yield the dotted keys of a document, each with its meaning; of a law's, that of the first."""
    meanings: dict[str, str] = {}
    for key, value in _keys(schema, definitions, "", _DEEPEST):
        meanings.setdefault(key, value.get("description", ""))
    for key, meaning in meanings.items():
        yield key, {"description": meaning} if meaning else {}


def _keys(
    schema: Schema, definitions: dict[str, Schema], prefix: str, deep: int
) -> Iterator[tuple[str, Schema]]:
    """Yield the keys of a schema and of what its values may be."""
    for each in _alternatives(schema, definitions):
        for name, value in each.get("properties", {}).items():
            yield prefix + name, value
            if deep > 1 and name not in ("second", "over"):
                yield from _keys(value, definitions, f"{prefix}{name}.", deep - 1)


def _alternatives(schema: Schema, definitions: dict[str, Schema]) -> Iterator[Schema]:
    """Yield what a value may be: a schema, what it refers to, and its branches."""
    yield schema
    if "$ref" in schema:
        yield from _alternatives(definitions[schema["$ref"].rpartition("/")[2]], definitions)
    for branch in (*schema.get("anyOf", ()), *schema.get("allOf", ())):
        yield from _alternatives(branch.get("then", branch), definitions)
