"""Texts of all pages for the search of the site, which has no server to fetch pages from.

`search.js` beside this file orders the results by them, and shows excerpts.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

_NAME = "search_texts.js"
# What readers do not see, and formulas.
_HIDDEN = (nodes.comment, nodes.raw, nodes.math, nodes.math_block, nodes.system_message)


def sections(tree: nodes.document) -> Iterator[tuple[str, str]]:
    """Yield the anchor and the text of each section of a page, without those of sections in it."""
    for section in tree.findall(nodes.section):
        words = (_text(child) for child in section.children if not isinstance(child, nodes.section))
        title = section.next_node(nodes.title)
        text = re.sub(r"\s+", " ", " ".join(words)).strip()
        if title is not None:
            text = text.removeprefix(title.astext()).strip()
        yield section["ids"][-1], text


def _text(node: nodes.Node) -> str:
    if isinstance(node, nodes.Text):
        return node.astext()
    if isinstance(node, _HIDDEN) or _is_second_name(node):
        return ""
    blocks = any(isinstance(child, (nodes.Body, nodes.Part)) for child in node.children)
    return (" " if blocks else "").join(map(_text, node.children))


def _is_second_name(node: nodes.Node) -> bool:
    """Return whether a name of a type is the long one of two, of which a page shows the short."""
    is_choice = isinstance(node, addnodes.pending_xref_condition)
    return is_choice and node["condition"] != "resolved"


def _write(app: Sphinx, error: Exception | None) -> None:
    if error is not None or app.builder.format != "html":
        return
    texts = {page: list(sections(app.env.get_doctree(page))) for page in sorted(app.env.found_docs)}
    written = json.dumps(texts, ensure_ascii=False, separators=(",", ":"))
    (Path(app.outdir) / "_static" / _NAME).write_text(f"const SEARCH_TEXTS = {written};\n")


def _load(app: Sphinx, page: str, template: str, context: dict[str, Any], tree: Any) -> None:
    if page == "search":
        # Before the search itself, which is of priority 500.
        app.add_js_file(_NAME, priority=400)


def setup(app: Sphinx) -> dict[str, Any]:
    """Enter the extension."""
    app.connect("html-page-context", _load)
    app.connect("build-finished", _write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
