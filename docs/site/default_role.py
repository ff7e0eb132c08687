"""What single backticks mean in docstrings: code, and a link if it is a public name.

Also leads references to classes, which Python writes with their module, to where they are
documented: at the name by which they are public.
"""

from __future__ import annotations

from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.domains.python import PyXRefRole
from sphinx.environment import BuildEnvironment
from sphinx.util.nodes import make_refnode

import drake_rnn

ROLE = "name"
_PACKAGE = "drake_rnn"


class NameRole(PyXRefRole):
    """The role of single backticks."""

    def process_link(
        self,
        env: BuildEnvironment,
        refnode: nodes.Element,
        has_explicit_title: bool,
        title: str,
        target: str,
    ) -> tuple[str, str]:
        """Mark the reference as one that need not lead anywhere."""
        refnode["py:module"] = env.ref_context.get("py:module")
        refnode["py:class"] = env.ref_context.get("py:class")
        refnode["may_be_code"] = True
        refnode["refdomain"], refnode["reftype"] = "py", "obj"
        return title, target


def _public(target: str) -> str | None:
    """Return the public name of an object that is named with its module."""
    parts = target.split(".")
    for first, part in enumerate(parts):
        if part in drake_rnn.__all__:
            return ".".join([_PACKAGE, *parts[first:]])
    return None


def _elsewhere(
    app: Sphinx, env: BuildEnvironment, node: addnodes.pending_xref, content: nodes.TextElement
) -> nodes.Node | None:
    """Resolve what Python's domain has not found."""
    if node.get("refdomain") != "py":
        return None
    target = node["reftarget"]
    if public := _public(target):
        found = env.domains.python_domain.find_obj(env, None, None, public, None, 0)
        for _, entry in found:
            return make_refnode(
                app.builder, node["refdoc"], entry.docname, entry.node_id, content, public
            )
    # Names of other modules are code.
    if node.get("may_be_code") or node["reftype"] == "exc" or target.startswith(f"{_PACKAGE}."):
        return content
    return None


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the role."""
    app.add_role(ROLE, NameRole())
    app.connect("missing-reference", _elsewhere)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
