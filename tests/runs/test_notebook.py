"""What a notebook shows of a result and of an arm."""

import re
from base64 import b64decode
from html import unescape

import pytest
from matplotlib.figure import Figure

from drake_rnn import InvalidInputError, figure, load_arm, load_experiment, simulate
from drake_rnn.figures import drawable
from drake_rnn.runs.result import value_and_unit


@pytest.fixture(scope="module")
def result():
    return simulate(load_experiment("pinv_line", {"duration": 0.05}))


def test_a_result_is_one_short_line(result):
    assert repr(result) == (
        f"<Result pinv_line: complete, 0.05 s, {len(result.metrics)} metrics, 2 of 2 bounds kept>"
    )


@pytest.mark.long
def test_a_result_is_a_table_with_units_the_overview_and_the_playback(result):
    shown = result._repr_html_()
    table, rest = shown.split("</table>")
    bounds = {verdict.metric: verdict.bound for verdict in result.verdicts}
    for name, value in result.metrics.items():
        bound = bounds.get(name)
        for text in value_and_unit(name, value, bound):
            assert re.search(rf">{name}<.*?>{re.escape(text)}<", table)
    assert "≤ 2 µm ok" in table
    picture, frame = re.fullmatch(
        r'<img [^>]*base64,([^"]*)"><iframe [^>]*srcdoc="([^"]*)"></iframe>', rest
    ).groups()
    assert b64decode(picture).startswith(b"\x89PNG")
    assert "<title>pinv_line</title>" in unescape(frame)


def test_a_figure_can_be_had_as_matplotlib_has_it(result):
    assert isinstance(figure(result), Figure)
    name = drawable(result)[-1]
    assert isinstance(figure(result, name), Figure)
    with pytest.raises(InvalidInputError, match="no figure 'overvew' of this result; nearest: ove"):
        figure(result, "overvew")


def test_an_arm_is_one_short_line_and_a_table_of_its_limits():
    arm = load_arm("panda")
    assert repr(arm) == "<Arm panda: 7 joints, task frame panda_link8, with a ball of 12 mm>"
    shown = arm._repr_html_()
    assert shown.count("<tr>") == 8
    assert "velocity [rad/s]" in shown
    assert "2.175" in shown
    # One without accelerations has no column of them.
    assert "acceleration" not in load_arm("planar6")._repr_html_()
