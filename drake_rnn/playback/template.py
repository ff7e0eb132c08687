"""The page's own HTML, style and scripts, which are files in ``web``, put together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .. import colours
from ..inputs.page_templates import page_templates
from .recorded import Recorded

#: The folder of the page's files.
WEB = Path(__file__).parent / "web"
#: The scripts of any page with such a picture and chart, in the order in which they run; they share
#: one scope. Those of a playback come behind them.
SCRIPTS = (
    "numbers.js",
    "notice.js",
    "scene.js",
    "camera.js",
    "picture.js",
    "curves.js",
    "axes.js",
    "lines.js",
    "chart.js",
    "legend.js",
    "hover.js",
    "choosing.js",
    "keys.js",
    "effort.js",
    "looks.js",
)
_OF_PLAYBACK = (
    "player.js",
    "zoom.js",
    "loop.js",
    "joints.js",
    "parts.js",
    "menus.js",
    "saving.js",
    "link.js",
    "main.js",
)


def rendered(
    title: str,
    scene: Recorded,
    outcomes: Sequence[Mapping[str, Any]],
    data: Mapping[str, Any],
) -> str:
    """Return the page.

    Args:
        title: Title of the page.
        scene: The scene with its animation.
        outcomes: The outcome of the run and of those beside it, from `outcome_of`.
        data: The data that the page's scripts read.
    """
    page = page_templates(WEB).get_template("page.html.jinja")
    return page.render(
        title=title,
        scene=scene,
        outcome=outcomes[0],
        outcomes=outcomes,
        data=data,
        scripts=SCRIPTS + _OF_PLAYBACK,
        colours=colours,
    )
