"""Write the badges of README: python docs/make_badges.py docs/badges.

What they say is read from `pyproject.toml` and from the page of claims; a test compares them.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

from jinja2 import Template

from drake_rnn import colours

ROOT = Path(__file__).parents[1]
#: Width of a letter and of the space beside a word, in units of the picture.
_LETTER, _SPACE = 6.6, 8.0
_BADGE = Template(
    """\
<svg xmlns="http://www.w3.org/2000/svg" width="{{ width }}" height="20" role="img" \
aria-label="{{ name }}: {{ value }}">
<clipPath id="round"><rect width="{{ width }}" height="20" rx="3"/></clipPath>
<g clip-path="url(#round)"><rect width="{{ width }}" height="20" fill="#444"/>
<rect x="{{ middle }}" width="{{ width }}" height="20" fill="{{ colour }}"/></g>
<g fill="#fff" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11">
<text x="{{ space }}" y="14" textLength="{{ name_length }}">{{ name }}</text>
<text x="{{ middle + space }}" y="14" textLength="{{ value_length }}">{{ value }}</text></g>
</svg>
""",
    autoescape=True,
)


def badges() -> dict[str, str]:
    """Return the badges as SVG, by name of the file without its suffix."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    drake = next(entry for entry in project["dependencies"] if entry.startswith("drake"))
    values = {
        "version": project["version"],
        "python": project["requires-python"].replace(">=", "≥ "),
        "drake": drake.removeprefix("drake").replace(">=", "≥ "),
        "licence": project["license"],
    }
    names = {"claims": "papers' claims"}
    values["claims"] = _claims()
    return {name: _badge(names.get(name, name), value) for name, value in values.items()}


def _claims() -> str:
    """Return what the page of claims counts, over all papers."""
    page = (ROOT / "docs" / "claims.md").read_text()
    rows = re.findall(
        r"^\| [a-z ]+ \| (\d+) \| (\d+) \| (\d+) \| (\d+) \| (\d+) \|$", page, re.MULTILINE
    )
    total, holds, corrected, _, unchecked = (
        sum(map(int, column)) for column in zip(*rows, strict=True)
    )
    return f"{total - unchecked} judged, {holds} hold, {corrected} with correction"


def _badge(name: str, value: str) -> str:
    name_length, value_length = (round(_LETTER * len(word), 1) for word in (name, value))
    middle = round(name_length + 2.0 * _SPACE, 1)
    return _BADGE.render(
        name=name,
        value=value,
        name_length=name_length,
        value_length=value_length,
        middle=middle,
        width=round(middle + value_length + 2.0 * _SPACE, 1),
        space=_SPACE,
        colour=colours.DESIRED,
    )


def main(folder: Path) -> None:
    """Write all badges into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in badges().items():
        (folder / f"{name}.svg").write_text(text)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
