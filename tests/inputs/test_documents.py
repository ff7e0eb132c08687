"""YAML in and out."""

from math import inf, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import Field

from drake_rnn import InvalidInputError
from drake_rnn.inputs.documents import construct, parse_yaml, read_yaml, to_yaml
from drake_rnn.inputs.fields import Count, Positive, Vector, validated
from drake_rnn.inputs.messages import nearest, plural


@validated
class Wheel:
    radius: Positive
    spokes: Count = 3


@validated
class Cart:
    wheels: dict[str, Wheel] = Field(default_factory=dict)
    spare: Wheel | None = None
    load: Vector | None = None
    brake: float | str = 1.0

    def __post_init__(self):
        if self.load is not None and self.load.size > 3:
            raise ValueError("load: must have at most 3 entries")


def refusal(values, key="cart"):
    with pytest.raises(InvalidInputError) as caught:
        construct(Cart, values, key)
    message = str(caught.value)
    assert "\n" not in message
    assert "pydantic" not in message
    return message


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-6", 1e-6),
        ("1E3", 1000.0),
        ("-2.5e+3", -2500.0),
        (".5", 0.5),
        ("1_000", 1000),
        ("0o17", 15),
        (".inf", inf),
        ("-.inf", -inf),
        ("yes", "yes"),
        ("off", "off"),
        ("12:30", "12:30"),
        ("true", True),
        ("null", None),
        ("none", "none"),
        ("010", 10),
    ],
)
def test_scalars_are_those_of_yaml_1_2(text, value):
    """In YAML 1.1 1e-6 is a string, yes is true, 12:30 is 750 and 010 is 8."""
    read = parse_yaml(text, "here")
    assert read == value
    assert type(read) is type(value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\nb: 2\na: 3\n", "f.yaml: the key 'a' is given twice"),
        ("a: {b: 1, b: 2}", "f.yaml: the key 'b' is given twice"),
        (
            "a: [1\nb: 2\n",
            "f.yaml: not a YAML document: line 2, column 2: expected ',' or ']', but got ':'",
        ),
        ("a:\n\t- b\n", "f.yaml: not a YAML document: line 2, column 1: found character"),
        ("a: 1\n---\nb: 2\n", "f.yaml: not a YAML document: line 2, column 1: found another doc"),
        ("a: !!python/object:os.system {}", "f.yaml: not a YAML document: line 1, column 4: "),
        ("a: \x01", "f.yaml: not a YAML document: unacceptable character #x0001"),
        ("a: *b", "f.yaml: not a YAML document: line 1, column 4: found undefined alias"),
    ],
)
def test_what_is_no_yaml_is_refused_with_its_place(text, message):
    with pytest.raises(InvalidInputError) as caught:
        parse_yaml(text, "f.yaml")
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_a_file_that_cannot_be_read_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match="No such file"):
        read_yaml(tmp_path / "nowhere.yaml")
    with pytest.raises(InvalidInputError, match="directory"):
        read_yaml(tmp_path)
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InvalidInputError, match="not a text file"):
        read_yaml(tmp_path / "binary.yaml")


letters = st.characters(codec="utf-8", exclude_categories=["C"])
keys, words = st.text(letters, max_size=20), st.text(letters, max_size=120)
scalars = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | words
values = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3),
    max_leaves=4,
)


@settings(max_examples=60)
@given(st.dictionaries(keys, values, max_size=3))
def test_what_is_written_is_read_back_to_the_last_bit(document):
    assert parse_yaml(to_yaml(document), "here") == document


def test_arrays_are_written_as_lists():
    document = {"a": np.array([0.1, 1 / 3]), "b": np.float64(1e-9), "c": np.arange(2), "d": (1, 2)}
    assert parse_yaml(to_yaml(document), "here") == {
        "a": [0.1, 1 / 3],
        "b": 1e-9,
        "c": [0, 1],
        "d": [1, 2],
    }


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([1], "cart: must be a mapping of keys to values, not [1]"),
        ({"lod": []}, "cart.lod: no such key; nearest: load"),
        ({"zzz": 1}, "cart.zzz: no such key; it may be wheels, spare, load, brake"),
        ({"spare": {}}, "cart.spare.radius: must be given"),
        ({"spare": {"radus": 1}}, "cart.spare.radus: no such key; nearest: radius"),
        ({"spare": 3}, "cart.spare: must be a mapping of keys to values, not 3"),
        ({"spare": {"radius": -1}}, "cart.spare.radius: must be greater than 0, not -1"),
        ({"spare": {"radius": nan}}, "cart.spare.radius: must be a finite number, not nan"),
        ({"spare": {"radius": "big"}}, "cart.spare.radius: must be a number, not 'big'"),
        ({"spare": {"radius": 1, "spokes": 2.5}}, "cart.spare.spokes: must be an integer, not 2.5"),
        (
            {"wheels": {"left": {"radis": 1}}},
            "cart.wheels.left.radis: no such key; nearest: radius",
        ),
        ({"load": [1, "x"]}, "cart.load: must be a list of numbers, not [1, 'x']"),
        ({"load": [1, inf]}, "cart.load: must be finite, not [1, inf]"),
        ({"load": [1, 2, 3, 4]}, "cart.load: must have at most 3 entries"),
        ({"brake": []}, "cart.brake: must be a number or text, not []"),
    ],
)
def test_a_refusal_names_the_key_its_value_and_what_it_may_be(values, message):
    assert refusal(values) == message


def test_a_long_value_is_cut():
    message = refusal({"load": "x" * 1000})
    assert len(message) < 120


def test_a_value_within_itself_is_refused():
    """A YAML alias may stand within what it stands for."""
    with pytest.raises(InvalidInputError, match=r"^here: refers to itself"):
        parse_yaml("spare: &a {radius: *a}", "here")
    inner = {}
    inner["radius"] = inner
    assert refusal({"spare": inner}) == (
        "cart.spare.radius: must be a number, not a dict that contains itself"
    )


def test_nearest_tells_all_there_is_where_nothing_is_like_it():
    assert nearest("kapa", ["kappa", "rate"]) == "nearest: kappa"
    assert nearest("zzz", ["kappa", "rate"]) == "it may be kappa, rate"


def test_a_count_of_one_is_no_plural():
    counts = [plural(0, "pair"), plural(1, "pair"), plural(2, "pair")]
    assert counts == ["0 pairs", "1 pair", "2 pairs"]
    assert [plural(k, "entry", "entries") for k in (1, 2)] == ["1 entry", "2 entries"]
