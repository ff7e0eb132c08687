"""The JSON schema of files of claims, for editors."""

from __future__ import annotations

from ..experiment import shipped_experiments
from ..experiment.schema import CHANGES, KNOWN_CHANGES, OpenFields, experiment_definitions
from ..inputs.json_schema import Schema, or_null, whole_document
from ..measures import METRIC_NAMES
from .claim import Claim, Paper, Quantity
from .reading import ClaimsFile


def claims_schema() -> Schema:
    """Return the JSON schema of a file of claims."""
    open_fields: OpenFields = {
        (Quantity, "run"): or_null({"enum": shipped_experiments()}),
        (Quantity, "metric"): or_null({"enum": [*METRIC_NAMES]}),
        (Quantity, "set"): {"allOf": [CHANGES, KNOWN_CHANGES]},
        (ClaimsFile, "paper"): {"$ref": "#/$defs/Paper"},
        (ClaimsFile, "claims"): {"type": "array", "items": {"$ref": "#/$defs/Claim"}},
    }
    definitions = experiment_definitions(open_fields, ClaimsFile, Claim, Paper)
    document = definitions.pop("ClaimsFile")
    return whole_document(document, "Claims of a paper, judged by drake_rnn", definitions)
