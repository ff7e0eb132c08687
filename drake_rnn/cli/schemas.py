"""JSON schemas of documents, for editors."""

from __future__ import annotations

import json

import typer

from ..inputs.lending import lent
from .asked import PrintSchema

#: What makes the schema of each kind of document; each imports much.
_MADE_BY = {
    "experiment": "drake_rnn.experiment.schema:experiment_schema",
    "campaign": "drake_rnn.campaigns.schema:campaign_schema",
    "claims": "drake_rnn.claims.schema:claims_schema",
}
#: Kinds of documents that have a schema.
DOCUMENTS = tuple(_MADE_BY)


def print_schema(asked: PrintSchema) -> None:
    """Print the schema of a kind of documents."""
    typer.echo(schema_text(asked.document), nl=False)


def schema_text(document: str) -> str:
    """Return the JSON schema of a kind of documents, one of `DOCUMENTS`, as text."""
    return json.dumps(lent(_MADE_BY[document])(), indent=1) + "\n"
