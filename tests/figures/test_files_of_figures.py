"""What is saved of a figure: quick ways to it must not change what it shows."""

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from drake_rnn.colours import TRACED
from drake_rnn.figures.style import common_style, save, single


def drawn(time, values, limits=None) -> tuple[Figure, Axes]:
    with common_style():
        figure, ax = single()
        ax.plot(time, values, color=TRACED)
        ax.set_xlim(time[0], time[-1])
        if limits is not None:
            ax.set_ylim(*limits)
    return figure, ax


def labels(ax):
    return [label.get_text() for label in ax.get_yticklabels()]


@pytest.mark.parametrize("at", [1, 12_345, 50_000, 99_998])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_peak_of_one_sample_is_seen_among_many(at, sign, tmp_path):
    """Of 100000 samples on some 600 pixels one is 1, the others are less than .1."""
    time = np.linspace(0.0, 10.0, 100_000)
    values = 0.1 * np.sin(37.0 * time)
    values[at] = sign
    figure, ax = drawn(time, values, limits=(-1.2, 1.2))
    save(figure, tmp_path / "peak.png")
    pixels = np.asarray(Image.open(tmp_path / "peak.png").convert("RGB")).astype(int)
    height = pixels.shape[0]
    foot, tip = (
        round(height - 1 - ax.transData.transform((time[at], sign * level))[1])
        for level in (0.3, 0.97)
    )
    column = round(ax.transData.transform((time[at], 0.0))[0])
    colour = 255 * np.array(to_rgb(TRACED))
    # The line is 2.8 pixels wide at 200 dots per inch, its point is slimmer and at most a pixel
    # aside; no white pixel may be left in any row from foot to tip.
    rows = slice(min(foot, tip), max(foot, tip) + 1)
    near = np.abs(pixels[rows, column - 2 : column + 3] - colour).max(axis=2)
    assert near.min(axis=1).max() < 120


def test_numbers_at_ticks_are_as_matplotlib_writes_them(tmp_path):
    """Plain text in place of a formula of the same characters, and the common power as it was."""
    for scale in (1.0, 1e-5, 1e7):
        figure, ax = drawn(np.linspace(0, 1, 5), scale * np.linspace(-2.5, 2.5, 5))
        with common_style():
            FigureCanvasAgg(figure).draw()
        formulas, power = labels(ax), ax.yaxis.get_offset_text().get_text()
        save(figure, tmp_path / "numbers.png")
        assert labels(ax) == [
            text.removeprefix(r"$\mathdefault{").removesuffix("}$") for text in formulas
        ]
        assert not any("$" in text for text in labels(ax))
        assert ax.yaxis.get_offset_text().get_text() == power
        assert ("$" in power) == (scale != 1.0)


def test_a_tick_without_an_offset_stays_without(tmp_path):
    figure, ax = drawn(np.linspace(0, 1, 5), 100.0 + 1e-4 * np.linspace(0.0, 1.0, 5))
    ax.ticklabel_format(axis="y", useOffset=False)
    save(figure, tmp_path / "numbers.png")
    assert ax.yaxis.get_offset_text().get_text() == ""


@pytest.mark.parametrize("alpha", [1.0, 0.35])
def test_the_file_has_the_colours_that_were_drawn(alpha, tmp_path):
    """Also where curves are pale, overlap, or change their colour along the way."""
    figure, ax = drawn(np.linspace(0, 1, 50), np.sin(np.linspace(0, 9, 50)))
    ax.imshow(np.random.default_rng(1).random((40, 40)), aspect="auto", alpha=alpha, cmap="hsv")
    with common_style():
        FigureCanvasAgg(figure).draw()  # which settles the layout
    save(figure, tmp_path / "colours.png")
    canvas = FigureCanvasAgg(figure)
    with common_style():
        canvas.draw()
    with Image.open(tmp_path / "colours.png") as image:
        off = np.asarray(image).astype(int) - np.asarray(canvas.buffer_rgba())[..., :3]
    # Where a layout settles again, edges move by parts of a pixel.
    assert np.abs(off).max() <= 1
