"""Pages of the source files that the site's pages link to.

On a code host a link to a file shows it. On the site it leads to a page with the file, coloured.
"""

from __future__ import annotations

import html
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexer import Lexer
from pygments.lexers import get_lexer_for_filename
from pygments.lexers.special import TextLexer
from pygments.util import ClassNotFound
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

_PREFIX = "source/"


class LinksToSources(SphinxTransform):
    """Leads links to files of the repository, which would be downloads, to pages of them."""

    default_priority = 400

    def apply(self, **kwargs: Any) -> None:
        """Change the links of one page, and note the files."""
        for link in list(self.document.findall(addnodes.download_reference)):
            file, _ = self.env.relfn2path(link["reftarget"], self.env.docname)
            sources(self.env).setdefault(self.env.docname, set()).add(file)
            page = addnodes.pending_xref(
                "", *link.children, refdomain="", reftype="source-page", reftarget=file
            )
            page["refdoc"] = self.env.docname
            link.replace_self(page)


def sources(env: Any) -> dict[str, set[str]]:
    """Return the files that are linked to, by the page that does."""
    if not hasattr(env, "drake_rnn_sources"):
        env.drake_rnn_sources = {}
    found: dict[str, set[str]] = env.drake_rnn_sources
    return found


def _resolve(
    app: Sphinx, env: Any, node: addnodes.pending_xref, content: nodes.TextElement
) -> nodes.reference | None:
    if node["reftype"] != "source-page":
        return None
    uri = app.builder.get_relative_uri(node["refdoc"], _PREFIX + node["reftarget"])
    return nodes.reference("", "", *node.children, internal=True, refuri=uri)


def _lexer(name: str) -> Lexer:
    try:
        return get_lexer_for_filename(name)
    except ClassNotFound:
        return TextLexer()


def _pages(app: Sphinx) -> Iterator[tuple[str, dict[str, Any], str]]:
    formatter = HtmlFormatter(linenos="inline", lineanchors="line")
    for name in sorted(set().union(*sources(app.env).values())):
        file = Path(app.srcdir) / name
        code = highlight(file.read_text(), _lexer(name), formatter)
        body = f"<h1><code>{html.escape(name)}</code></h1>\n{code}"
        yield _PREFIX + name, {"title": name, "body": body}, "page.html"


def _forget(app: Sphinx, env: Any, page: str) -> None:
    sources(env).pop(page, None)


def _merge(app: Sphinx, env: Any, pages: list[str], other: Any) -> None:
    sources(env).update({page: files for page, files in sources(other).items() if page in pages})


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the transform and the pages."""
    app.add_transform(LinksToSources)
    app.connect("missing-reference", _resolve)
    app.connect("html-collect-pages", _pages)
    app.connect("env-purge-doc", _forget)
    app.connect("env-merge-info", _merge)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
