"""Helpers of the figure tests: draw a figure, and read values from it."""

from dataclasses import replace

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from drake_rnn.experiment import make_experiment
from drake_rnn.figures import FIGURES
from drake_rnn.figures.style import (
    BOUND,
    TARGET,
)


def changed(result, **changes):
    """Return a result with the same series and a changed experiment."""
    document = result.experiment.document.contents() | changes
    return replace(result, experiment=make_experiment(document))


def draw(result, name):
    return FIGURES[name].draw(result)


def panel(result, name):
    return draw(result, name).get_axes()[0]


def curves(ax, count=7):
    """Return the values of the first lines, shape (k, count)."""
    return np.stack([line.get_ydata() for line in ax.lines[:count]], axis=1)


def dashes(line):
    """Return the pattern of a line's dashes in multiples of its width; None for a solid line."""
    return line._unscaled_dash_pattern[1]  # Matplotlib tells only that there is one.


def is_dashed(line):
    """Whether a line is that of a bound, a desired value, a target or a prediction."""
    return dashes(line) in [look["linestyle"][1] for look in (BOUND, TARGET)]


def dashed_levels(ax):
    """Return the levels of the horizontal dashed lines."""
    dashed = [line.get_ydata() for line in ax.lines if is_dashed(line)]
    return sorted(values[0] for values in dashed if np.ptp(values) == 0)


def skeleton(result, q):
    return result.experiment.arm.kinematics().skeleton(q)


def assert_no_text_is_cut_off(figure, endings="]"):
    """Check the texts with these endings; others, such as ticks out of view, may be outside."""
    figure.canvas = FigureCanvasAgg(figure)
    figure.canvas.draw()
    for text in figure.findobj(Text):
        if text.get_visible() and text.get_text().endswith(endings):
            box = text.get_window_extent()
            assert min(box.x0, box.y0) > -1, text.get_text()
            assert box.x1 < figure.bbox.x1 + 1, text.get_text()
            assert box.y1 < figure.bbox.y1 + 1, text.get_text()
