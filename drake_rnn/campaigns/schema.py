"""The JSON schema of campaigns, for editors."""

from __future__ import annotations

from typing import Any

from ..experiment import shipped_experiments
from ..experiment.schema import CHANGES, KNOWN_CHANGES, OpenFields, experiment_definitions
from ..inputs.json_schema import Schema, of_kinds, whole_document, with_kind
from ..measures import METRIC_NAMES
from .document import CampaignDocument
from .variation import VARIATIONS

# Changes that may name a class of a user's own, which has keys of its own.
_MAY_BE_OWN = [key for name in ("law", "path", "environment") for key in (name, f"{name}.kind")]
_VARIATION = {"$ref": "#/$defs/variation"}


def campaign_schema() -> Schema:
    """Return the JSON schema of a campaign's document."""
    shipped: Schema = {"enum": shipped_experiments()}
    open_fields: OpenFields = {
        (CampaignDocument, "experiment"): {
            "anyOf": [
                shipped,
                {"type": "string", "pattern": r"\.ya?ml$"},
                {"$ref": "#/$defs/ExperimentDocument"},
            ]
        },
        (CampaignDocument, "changes"): CHANGES,
        (CampaignDocument, "vary"): {"allOf": [CHANGES], "additionalProperties": _VARIATION},
        (CampaignDocument, "metrics"): {"type": "array", "items": {"enum": [*METRIC_NAMES]}},
    }
    definitions = experiment_definitions(open_fields, CampaignDocument, *VARIATIONS.values())
    for kind, cls in VARIATIONS.items():
        with_kind(definitions[cls.__name__], kind)
    refs: dict[str, Schema] = {
        kind: {"$ref": f"#/$defs/{cls.__name__}"} for kind, cls in VARIATIONS.items()
    }
    listed: Schema = {"type": "array", "minItems": 1}
    definitions["variation"] = {"anyOf": [listed, of_kinds(refs, VARIATIONS, own=False)]}
    document = definitions.pop("CampaignDocument")
    own: Any = {"anyOf": [{"required": [key]} for key in _MAY_BE_OWN]}
    document["if"] = {
        "required": ["experiment"],
        "properties": {"experiment": shipped, "changes": {"not": own}, "vary": {"not": own}},
    }
    document["then"] = {"properties": {"changes": KNOWN_CHANGES, "vary": KNOWN_CHANGES}}
    return whole_document(document, "A campaign of drake_rnn", definitions)
