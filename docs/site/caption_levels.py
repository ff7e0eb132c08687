"""Captions of lists of pages with the level that readers of screens ask of a heading."""

from __future__ import annotations

from typing import Any

from sphinx.application import Sphinx

# What Sphinx writes for a caption, which is below the title of a page.
_WRITTEN, _WITH_LEVEL = 'role="heading">', 'role="heading" aria-level="2">'
# After the theme, which makes the tree beside a page.
_LATE = 900


def _with_levels(app: Sphinx, page: str, template: str, context: dict[str, Any], tree: Any) -> None:
    for name in ("body", "furo_navigation_tree"):
        if isinstance(text := context.get(name), str):
            context[name] = text.replace(_WRITTEN, _WITH_LEVEL)


def setup(app: Sphinx) -> dict[str, Any]:
    """Enter the extension."""
    app.connect("html-page-context", _with_levels, priority=_LATE)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
