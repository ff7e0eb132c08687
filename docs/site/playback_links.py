"""Links to live playbacks, which are made for the site and stand in no repository.

A link ``playbacks/NAME.html`` of a page in docs/ leads to the page that `docs/make_gallery.py` has
written, if it has; without it, it is text.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

_FOLDER = "playbacks/"


class LinksToPlaybacks(SphinxTransform):
    """Lets links to playbacks be."""

    default_priority = 400

    def apply(self, **kwargs: Any) -> None:
        """Change the links of one page."""
        for link in list(self.document.findall(addnodes.pending_xref)):
            target = link["reftarget"]
            if not target.startswith(_FOLDER):
                continue
            made = any(
                (Path(folder) / "docs" / target).is_file() for folder in self.config.html_extra_path
            )
            new = nodes.reference("", "", *link.children, internal=False, refuri=target)
            link.replace_self(new if made else nodes.inline("", "", *link.children))


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the transform."""
    app.add_transform(LinksToPlaybacks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
