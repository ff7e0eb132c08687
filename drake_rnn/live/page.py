"""The live page: that of the playback, with controls in place of what has come out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .. import colours
from ..inputs.page_templates import page_templates
from ..playback.recorded import Recorded
from ..playback.template import SCRIPTS, WEB
from .gauge import Shown

#: Time that the chart shows [s].
WINDOW = 20.0
# Scripts behind those of any page.
_OWN = ("wire.js", "panel.js", "drag.js", "live.js")


def live_page(
    title: str,
    told: Mapping[str, str],
    scene: Recorded,
    seen: Mapping[str, Any],
    numbers: Sequence[Shown],
    port: int,
    *,
    obstacles: bool,
) -> str:
    """Return the page.

    Args:
        title: Its title.
        told: What the document says of itself, ``expect`` and ``paper``.
        scene: The scene at the start.
        seen: What its picture is drawn with.
        numbers: Numbers that come with each sample, in their order.
        port: Port of Meshcat's websocket.
        obstacles: Whether obstacles may be dragged.
    """
    curves = [
        {**each.as_data(), "time": "", "values": "", "accepted": []}
        for each in numbers
        if each.key != "force_desired"
    ]
    data = {
        **seen,
        "name": title,
        "beside": [],
        "duration": WINDOW,
        "rate": 30,
        "window": None,
        "curves": curves,
        # The arm fills the picture; a path that is dragged has no place to be enlarged at.
        "inset": False,
        "numbers": [each.key for each in numbers],
        "obstacles": obstacles,
        "port": port,
    }
    page = page_templates(Path(__file__).parent / "web", WEB).get_template("live.html.jinja")
    return page.render(
        title=title,
        scene=scene,
        outcome=told,
        data=data,
        scripts=SCRIPTS + _OWN,
        colours=colours,
    )
