"""Documents of experiments that mean nothing, cannot be run or would never end."""

import pytest
from refusing import refusal, table, within

from drake_rnn import check_experiment, load_experiment
from drake_rnn.inputs.documents import parse_yaml


def rows():
    """Experiment, change and what is said of it."""
    name = ""
    for change, said in table("documents.txt"):
        if change.startswith("[") and not said:
            name = change.strip("[]")
        else:
            yield pytest.param(name, change, said, id=f"{name}: {change}")


@pytest.mark.parametrize(("name", "change", "said"), list(rows()))
def test_it_is_refused_or_warned_of(name, change, said):
    def checked():
        return check_experiment(load_experiment(name, parse_yaml(change, "change")))

    if said.startswith("warns: "):
        with within():
            warnings = checked()
        assert any(text.startswith(said.removeprefix("warns: ")) for text in warnings)
    else:
        assert refusal(checked).startswith(said)


def test_a_sequence_of_three_thousand_parts_is_read_at_once():
    """It took half a minute."""
    parts = [
        {"path": {"kind": "line", "by": [sign * 0.01, 0, 0], "period": 0.5, "timing": "quintic"}}
        for sign in (1, -1) * 1500
    ]
    path = {"kind": "sequence", "parts": parts}
    with within():
        experiment = load_experiment("pinv_line", {"path": path})
    assert experiment.desired.duration == pytest.approx(1500.0)


def test_a_path_far_out_of_reach_is_refused_at_once():
    """It took minutes: ten thousand points were sought in vain."""
    line = {"kind": "line", "by": [500.0, 0.0, 0.0], "period": 4.0}
    experiment = load_experiment("pinv_line", {"path": line})
    assert "out of reach" in refusal(lambda: check_experiment(experiment))


def test_a_number_without_a_point_before_its_exponent_is_a_number():
    """In YAML 1.1 it would be a text."""
    assert load_experiment("pinv_line", parse_yaml("period: 1e-3", "")).document.period == 1e-3
