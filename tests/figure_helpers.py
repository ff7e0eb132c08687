"""What tests of figures share: how one is drawn, and what is read off it."""

from dataclasses import replace

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from drake_rnn.experiment.document import make_experiment
from drake_rnn.figures import FIGURES


def changed(result, **changes):
    """The same series under another experiment."""
    document = result.experiment.document() | changes
    return replace(result, experiment=make_experiment(document))


def draw(result, name):
    return FIGURES[name].draw(result)


def panel(result, name):
    return draw(result, name).get_axes()[0]


def curves(ax, count=7):
    """Of the first lines, shape (k, count)."""
    return np.stack([line.get_ydata() for line in ax.lines[:count]], axis=1)


def is_dashed(line):
    return line.get_linestyle() == "--"


def dashed_levels(ax):
    """Of the horizontal dashed lines."""
    dashed = [line.get_ydata() for line in ax.lines if is_dashed(line)]
    return sorted(values[0] for values in dashed if np.ptp(values) == 0)


def skeleton(result, q):
    return result.experiment.setup.arm.kinematics().skeleton(q)


def assert_no_text_is_cut_off(figure, endings="]"):
    """Of those that end so: ticks out of view are texts, too."""
    figure.canvas = FigureCanvasAgg(figure)
    figure.canvas.draw()
    for text in figure.findobj(Text):
        if text.get_visible() and text.get_text().endswith(endings):
            box = text.get_window_extent()
            assert min(box.x0, box.y0) > -1, text.get_text()
            assert box.x1 < figure.bbox.x1 + 1, text.get_text()
            assert box.y1 < figure.bbox.y1 + 1, text.get_text()
