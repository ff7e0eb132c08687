"""Units with their signs: µm, µrad and rad/s² where tables that were made have um and ^2."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

_TAG = re.compile(r"(<[^>]+>)")
# What is shown as it is written, and formulas.
_AS_WRITTEN = re.compile(r"<(/?)(code|pre|script|style|svg)\b|<(/?)(?:div|span) [^>]*math")
_MICRO = re.compile(r"(?<![\w.])u(?=(?:m|rad|s|N)\b(?![\w(]))")
_POWER = re.compile(r"(?<=[a-z])\^([2-9])(?!\d)")
_RAISED = str.maketrans("23456789", "²³⁴⁵⁶⁷⁸⁹")


def with_signs(text: str) -> str:
    """Return HTML with the signs of units in its text, outside of code and formulas."""
    parts, within = _TAG.split(text), ""
    for k, part in enumerate(parts):
        if part.startswith("<"):
            name = re.match(r"</?(\w+)", part)
            if not within and _AS_WRITTEN.match(part) and not part.startswith("</"):
                within = name[1] if name else ""
            elif within and part == f"</{within}>":
                within = ""
        elif not within and "\\(" not in part:
            signed = _MICRO.sub("µ", part)
            parts[k] = _POWER.sub(lambda found: found[1].translate(_RAISED), signed)
    return "".join(parts)


def _sign(app: Sphinx, page: str, template: str, context: dict[str, Any], tree: Any) -> None:
    if isinstance(body := context.get("body"), str):
        context["body"] = with_signs(body)


def setup(app: Sphinx) -> dict[str, Any]:
    """Enter the extension."""
    app.connect("html-page-context", _sign)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
