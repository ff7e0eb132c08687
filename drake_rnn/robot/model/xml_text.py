"""XML as robot models use it, with prefixes that are not declared."""

from __future__ import annotations

from xml.etree.ElementTree import Element, TreeBuilder, tostring
from xml.parsers import expat

#: Size of a model file; its meshes are files of their own [bytes].
MOST_BYTES = 20_000_000


def parse_xml(text: bytes) -> Element | None:
    """Return the root element of a document; None if it is not well-formed.

    Prefixes stay part of the names, as in ``drake:acceleration``: models use them undeclared, which
    a parser that knows of namespaces refuses. Comments are left out.

    Raises:
        ValueError: If it has a document type, whose entities could be other files or without end.
    """
    builder = TreeBuilder()
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartDoctypeDeclHandler = _refuse_document_type
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(text, True)
    except expat.ExpatError:
        return None
    return builder.close()


def _refuse_document_type(*_: object) -> None:
    raise ValueError("has a document type, <!DOCTYPE ...>; write out what its entities stand for")


def write_xml(root: Element) -> str:
    """Return a document as text."""
    return tostring(root, encoding="unicode")
