"""The comments at the head of documents that are written: their schema, and the versions."""

from __future__ import annotations

from ..diagrams import SCHEMAS
from ..inputs.versions import versions


def schema_line(document: str, place: str | None = None) -> str:
    """Return the line by which language servers of editors find the schema of a document.

    Args:
        document: ``experiment``, ``campaign`` or ``claims``.
        place: The schema's file, relative to the document; by default that of this installation.
    """
    place = (SCHEMAS / f"{document}.json").as_uri() if place is None else place
    return f"# yaml-language-server: $schema={place}\n"


def written_head(document: str) -> str:
    """Return the head of a document that a run writes: its schema, and what the run was made by."""
    made_by = "".join(f"# {package} {number}\n" for package, number in versions().items())
    return schema_line(document) + made_by
