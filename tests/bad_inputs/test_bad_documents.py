"""Documents of experiments that mean nothing, cannot be run or would never end."""

import pytest
from refusing import at_once, lots, refusal, table

from drake_rnn import check_experiment, load_experiment, simulate
from drake_rnn.inputs.documents import parse_yaml
from row_helpers import assert_each

PLANAR = """\
arm: planar6
path: {kind: circle, size: 0.05, period: 5}
law: {kind: motion_force, stiffness: 1000}
environment: {kind: elastic_surface, stiffness: 1000}
force: {value: 1}
period: 1e-3
duration: 0.1
"""
#: Documents, and what is said of them.
DOCUMENTS = {
    "a normal along which the arm cannot move": (
        PLANAR,
        "environment.normal: the arm cannot move its tool along [0.0, 0.0, 1.0] from its start",
    ),
    "a sweep over no key": (
        PLANAR + "over: {lwa.kappa: [1, 2]}\n",
        "over.lwa.kappa: no such key; nearest: law",
    ),
    "a document without an end": ("arm: &a\n  model: *a\n", "refers to itself"),
    "an anchor under a key of its own": (
        PLANAR + "mine: &mine {kind: circle, size: 1, period: 1}\nover: {path: [*mine]}\n",
        "mine: no such key; give what several keys share under a key that begins with x-, such as "
        "x-mine",
    ),
    "a number of 5000 digits": (PLANAR + f"seed: {'9' * 5000}\n", "holds a number of too many"),
    "one in hexadecimals": (PLANAR + f"seed: 0x{'f' * 5000}\n", "holds a number of too many"),
    "a document of two megabytes": (PLANAR + "#" * 2_000_000, "has 2 MB, and may have 1 MB"),
    "merges of merges": (
        "x-a: &a {k: 1}\n"
        + "".join(
            f"x-{c}: &{c} {{<<: [{', '.join(['*' + b] * 9)}]}}\n"
            for b, c in zip("abcdefgh", "bcdefghi", strict=True)
        )
        + PLANAR,
        "its merges (<<) repeat more than 1000000 keys",
    ),
    "lists of lists": (
        "x-a: &a [1]\n"
        + "".join(
            f"x-{c}: &{c} [{', '.join(['*' + b] * 9)}]\n"
            for b, c in zip("abcdefgh", "bcdefghi", strict=True)
        )
        + PLANAR,
        "refers to itself, or holds more than 1000000 values",
    ),
    "a value that is not as its tag": (PLANAR + "seed: !!bool x\n", "not as its tag says: 'x'"),
    "a whole number that is none": (PLANAR + "seed: !!int x\n", "not as its tag says: invalid"),
    "a class of Python": (PLANAR + "name: !!python/object:os.system x\n", "not a YAML document"),
    "many unknown keys": (
        PLANAR + "".join(f"k{number}: 1\n" for number in range(10_000)),
        "k0: no such key",
    ),
    "a key that is a list": (PLANAR + "? [a, b]\n: 3\n", "keys should be strings, not ['a', 'b'"),
    "a tab": (PLANAR + "\taccept: {}\n", "line 8, column 1: found character"),
    "a date": (PLANAR + "seed: 2020-01-01\n", "seed: must be an integer, not datetime.date(2020"),
    "a list of 200 000 numbers": (
        PLANAR + f"points: [{', '.join(['1'] * 200_000)}]\n",
        "has more than 50000 lines and commas; a long list of numbers belongs into a CSV file",
    ),
    "a list of 60 000 lines": (PLANAR + "points:\n" + "- 1\n" * 60_000, "has more than 50000"),
    "lines of an old kind": (PLANAR + "points:\r" + "- 1\r" * 60_000, "has more than 50000 lines"),
    "a document 400 deep": (f"arm: {'[' * 400}{']' * 400}", "nested too deeply"),
}


def rows():
    """Experiment, change and what is said of it."""
    name = ""
    for change, said in table("documents.txt"):
        if change.startswith("[") and not said:
            name = change.strip("[]")
        else:
            yield name, change, said


def assert_refused_or_warned_of(name, change, said):
    def checked():
        return check_experiment(load_experiment(name, parse_yaml(change, "change")))

    if said.startswith("warns: "):
        with at_once():
            warnings = checked()
        assert any(text.startswith(said.removeprefix("warns: ")) for text in warnings), warnings
    else:
        message = refusal(checked)
        assert message.startswith(said), message


@pytest.mark.parametrize("rows", lots(list(rows())))
def test_they_are_refused_or_warned_of(rows):
    assert_each(assert_refused_or_warned_of, rows)


def test_a_sequence_of_three_thousand_parts_is_read_at_once():
    """It took half a minute."""
    parts = [
        {"path": {"kind": "line", "by": [sign * 0.01, 0, 0], "period": 0.5, "timing": "quintic"}}
        for sign in (1, -1) * 1500
    ]
    path = {"kind": "sequence", "parts": parts}
    with at_once():
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


@pytest.mark.parametrize(("text", "said"), DOCUMENTS.values(), ids=DOCUMENTS)
def test_a_file_is_refused(tmp_path, text, said):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    assert said in refusal(lambda: check_experiment(load_experiment(file)))


def test_what_takes_long_runs_if_it_is_told_to():
    short = {"duration": 0.1, "window": None, "accept": None, "period": 1e-12}
    assert check_experiment(load_experiment("slc_nephroid_known", short), anyway=True) == []


def test_a_name_is_enough_for_a_run():
    """In Python as on the command line."""
    with pytest.raises(AssertionError, match="a run was started"):
        simulate("pinv_line")


@pytest.mark.parametrize("key", ["model", "limits", "looks", "capsules"])
def test_a_name_that_no_file_can_have_is_that_of_none(key):
    arm = {"model": "panda", key: "x" * 5000}
    assert refusal(lambda: load_experiment("pinv_line", {"arm": arm})).startswith("arm")
