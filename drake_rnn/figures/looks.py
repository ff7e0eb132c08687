"""Colours, dashes and widths of curves, by the meaning of the curves.

Curves with a meaning have its colour in `drake_rnn.colours`, as in playbacks. Joints, axes, laws
and other curves of one kind have a colour and a pattern of dashes each, from `nth`. All other
curves, such as errors, norms and singular values, are drawn in ink.
"""

from __future__ import annotations

from typing import Any

from .. import colours

Style = dict[str, Any]

_DASHED = (0, (4, 2))
_DOTTED = (0, (1.5, 1.5))

#: Colours of joints and of other curves that are told apart by number.
SERIES = colours.SERIES
#: Dashes of these curves. Colours and dashes repeat after seven and four: all of 28 curves differ.
DASHES: tuple[Any, ...] = ("-", (0, (6, 1.2)), (0, (6, 1.2, 1.2, 1.2)), (0, (1.8, 0.9)))

DESIRED: Style = {"color": colours.DESIRED, "linestyle": _DASHED, "linewidth": 1.0}
TRACED: Style = {"color": colours.TRACED, "linewidth": 1.8}
TARGET: Style = {"color": colours.TARGET, "linestyle": _DOTTED, "linewidth": 1.0}
FORCE: Style = {"color": colours.FORCE}
BOUND: Style = {"color": colours.BOUND, "linestyle": _DASHED, "linewidth": 0.8}

#: Colour of errors, norms and other curves without a meaning of their own.
INK = colours.CURVE
#: Wide curves behind others: norms behind components, readings behind true values.
BEHIND: Style = {"color": "0.78", "linewidth": 2.2}
#: Values that a theory predicts or a law asks for, drawn over the values that were reached.
PREDICTED: Style = {"color": INK, "linestyle": _DASHED, "linewidth": 1.0}
#: A time at which something happened.
MOMENT: Style = {"color": INK, "linestyle": ":", "linewidth": 1.0}
NOTE: Style = {"color": "0.35", "fontsize": 6.5}
SHADE: Style = {"color": "0.93", "linewidth": 0, "zorder": 0}
#: Notes on broken bounds are as red as on the terminal; a word or a sign always goes with the red.
BROKEN = "#B00020"
ALARM: Style = {"color": BROKEN, "fontsize": 6.5, "weight": "bold"}


def nth(k: int) -> Style:
    """Return colour and dashes of curve ``k`` of several; of a joint the same in all figures."""
    return {"color": SERIES[k % len(SERIES)], "linestyle": DASHES[k % len(DASHES)]}
