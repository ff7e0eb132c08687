"""The page of the gallery, docs/gallery.md, as docs/gallery.yaml has it.

``python docs/gallery_page.py`` writes it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from textwrap import wrap
from typing import Any

from drake_rnn import METRICS
from drake_rnn.inputs.documents import parse_yaml
from drake_rnn.measures import format_quantity

DOCS = Path(__file__).parent
_UNITS = {metric.name: metric.unit for metric in METRICS}
_PLACEHOLDER = re.compile(r"\{([\w.]+)\}")

_HEAD = """\
# Gallery

<!-- Made by `python docs/gallery_page.py` from docs/gallery.yaml. -->

Each picture is a [film](python.md#films) of a run, sped up where it says so. Live playbacks work
only on the site; the folder of a run has its own.

```sh
drake-rnn run contact_cat
drake-rnn film out/contact_cat
```
"""


def gallery() -> dict[str, Any]:
    """Return the contents of docs/gallery.yaml."""
    file = DOCS / "gallery.yaml"
    found: dict[str, Any] = parse_yaml(file.read_text(), str(file))
    return found


def runs_of(entry: Mapping[str, Any]) -> list[str]:
    """Return the experiments of an entry, that of its name first."""
    return [entry["run"], *entry.get("beside", [])]


def page(contents: Mapping[str, Any]) -> str:
    """Return the page."""
    return _HEAD + "".join(map(_section, contents["entries"]))


def _section(entry: Mapping[str, Any]) -> str:
    name = entry["run"]
    beside = "".join(f" --beside {other}" for other in entry.get("beside", []))
    sentence = "\n".join(wrap(said(entry), 100, break_long_words=False, break_on_hyphens=False))
    return f"""
## {entry["title"]}

![{entry["title"]}](gallery/{name}.webp)

{sentence}

```sh
drake-rnn run {name}{beside}
```

[Live playback](playbacks/{name}.html) · [the scheme]({entry["page"]})
"""


def said(entry: Mapping[str, Any]) -> str:
    """Return the sentence of an entry with its figures."""
    figures = entry["figures"]

    def written(found: re.Match[str]) -> str:
        name = found[1]
        return format_quantity(figures[name], _UNITS[name.rpartition(".")[2]], 2)

    return _PLACEHOLDER.sub(written, entry["says"])


if __name__ == "__main__":
    (DOCS / "gallery.md").write_text(page(gallery()))
