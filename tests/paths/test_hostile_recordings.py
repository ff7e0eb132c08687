"""Recordings of a few bytes that would take gigabytes, and names that command a terminal."""

import json
import struct
from time import process_time

import numpy as np
import pytest
from rich import markup

from drake_rnn import InvalidInputError
from drake_rnn.cli.console import SafeConsole
from drake_rnn.inputs.documents import parse_yaml
from drake_rnn.paths import recordings
from drake_rnn.paths.joint_targets import RecordedTargets
from row_helpers import assert_each


def refused(file, said, **fields):
    began = process_time()
    with pytest.raises(InvalidInputError) as caught:
        RecordedTargets(file=str(file), **fields)
    assert said in str(caught.value), caught.value
    assert process_time() - began < 5.0


def of_zeros(rows, length):
    """A column of lists of zeros, which take a byte each in memory and none in a file."""
    arrow = pytest.importorskip("pyarrow")
    ends = arrow.array(np.arange(rows + 1, dtype=np.int32) * length)
    return arrow.ListArray.from_arrays(ends, arrow.array(np.zeros(rows * length, dtype=np.int8)))


def test_parquet_files_have_bounds(tmp_path, monkeypatch):
    """Before, one list of 954 bytes took 1.9 GB and more than 40 s. Bounds are lower here."""
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    assert recordings._MOST_NUMBERS <= 20_000_000
    monkeypatch.setattr(recordings, "_MOST_NUMBERS", 20_000)
    t = np.arange(21) * 0.01
    inner = of_zeros(21 * 150, 7)
    chunks = arrow.ListArray.from_arrays(np.arange(22, dtype=np.int32) * 150, inner)
    tables = {
        "many": ({"t": t, "q": of_zeros(21, 1000)}, {}, "has 21021 numbers in"),
        "one": ({"t": t[:1], "q": of_zeros(1, 21_000)}, {}, "its part 1 has 21001 numbers"),
        "groups": ({"t": t, "q": of_zeros(21, 1000)}, {"row_group_size": 2}, "more than 20000 n"),
        "nested": ({"t": t, "action": chunks}, {}, "numbers in"),
        "wide": (
            {"t": t[:9], "q": of_zeros(9, 1001)},
            {},
            "lists of 1001 numbers, and may have 1000",
        ),
        "ragged": ({"t": t[:2], "q": arrow.array([[1.0], [1.0, 2.0]])}, {}, "of several lengths"),
        "missing": ({"t": t[:2], "q": arrow.array([[1.0], None])}, {}, "lists of several lengths"),
        "texts": ({"t": t[:2], "episode_index": [1, None], "q": t[:2]}, {}, "must be whole number"),
        "none": ({"t": t[:0], "q": t[:0]}, {}, "has no rows"),
    }

    def check(columns, options, said):
        file = tmp_path / "t.parquet"
        parquet.write_table(arrow.table(columns), file, compression="zstd", **options)
        assert file.stat().st_size < 40_000
        refused(file, said)

    assert_each(check, tables)


def written_mcap(file, topic, data, compression="zstd"):
    writing = pytest.importorskip("mcap.writer")
    kind = getattr(writing.CompressionType, compression.upper())
    with file.open("wb") as stream:
        writer = writing.Writer(stream, compression=kind, chunk_size=10**9)
        writer.start()
        schema = writer.register_schema("sensor_msgs/msg/JointState", "jsonschema", b"{}")
        channel = writer.register_channel(topic, "json", schema)
        writer.add_message(channel, 0, data, 0)
        writer.finish()
    return file


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_chunks_of_mcap_have_bounds(tmp_path, monkeypatch, compression):
    """A chunk says how long it is, which may be true, or less or more than that."""
    message = json.dumps({"name": ["a"], "position": [0.0]}).encode()
    good = written_mcap(tmp_path / "good.mcap", "/q", message, compression)
    assert RecordedTargets(file=str(good)).of_arm(("a",)).position.shape == (1, 1)
    file = written_mcap(tmp_path / "r.mcap", "/q", message + 1_000_000 * b" ", compression)
    content = file.read_bytes()
    # Of the record of the chunk: its kind and length, two times, and then its size.
    place = 8 + 9 + struct.unpack_from("<Q", content, 9)[0] + 9 + 16
    (size,) = struct.unpack_from("<Q", content, place)
    assert 1_000_000 < size < 1_001_000
    for wrong in (10, size + 1):
        lying = tmp_path / "lying.mcap"
        lying.write_bytes(content[:place] + struct.pack("<Q", wrong) + content[place + 8 :])
        refused(lying, f"has a chunk that is not of {wrong} bytes, as it says")
    assert recordings._MOST_CHUNK <= 100_000_000
    monkeypatch.setattr(recordings, "_MOST_CHUNK", 500_000)
    refused(file, "has a chunk of 1 MB, and may have 0.5 MB")
    monkeypatch.setattr(recordings, "_MOST_CHUNK", 2_000_000)
    monkeypatch.setattr(recordings, "_MOST_MESSAGES", 500_000)
    refused(file, "topic: /q has more than 0.5 MB of messages")


def test_deep_records_are_refused(tmp_path):
    for name, text in {
        "t.json": 2000 * "[" + 2000 * "]",
        "t.yaml": 2000 * "[" + 2000 * "]",
        "u.yaml": "".join(k * " " + "- \n" for k in range(1100)),
        "keys.json": 3000 * '{"a":' + "1" + 3000 * "}",
    }.items():
        (tmp_path / name).write_text(text)
        refused(tmp_path / name, "deep" if ".json" in name else "exceeded max")
    for text in ("".join(k * " " + "- \n" for k in range(300)), 600 * '{"a":'):
        with pytest.raises(InvalidInputError, match="nested too deeply"):
            parse_yaml(text, "a document")


#: Files of a few bytes that have no end, hardly one, or mean nothing; and what is said of them.
ENDLESS = {
    "aliases of aliases": (
        "a.yaml",
        "a: &a {x: {y: 1}}\n"
        + "".join(
            f"{c}: &{c} {{{', '.join(f'k{k}: *{b}' for k in range(9))}}}\n"
            for b, c in zip("abcdefgh", "bcdefghi", strict=True)
        ),
        "refers to itself, or holds more than",
    ),
    "a list of itself": ("a.yaml", "&a [*a, *a]", "refers to itself"),
    "chunks of chunks": ("a.yaml", "&a {chunks: [*a]}", "refers to itself"),
    "lists in lists": ("a.json", 500 * "[" + "1" + 500 * "]", "nested too deeply"),
    "a number of 400 digits": (
        "a.json",
        f'{{"t": 0, "positions": [{"9" * 400}]}}',
        "holds a number of too many digits",
    ),
    "many joints": (
        "a.json",
        json.dumps({"name": [f"j{k}" for k in range(100_000)], "position": [0.0]}),
        "name: has 100000 joints, and may have 1000",
    ),
    "many keys": (
        "a.json",
        "{" + ", ".join(f'"k{k}": 1' for k in range(100_000)) + ', "k99999": 2}',
        "the key 'k99999' is given twice",
    ),
    "a whole number by its tag": ("a.yaml", "t: !!int ''", "line 1, column 4: '' is not as its"),
    "a flag by its tag": ("a.yaml", "t: !!bool x", "line 1, column 4: 'x' is not as its form"),
    "a time by its tag": ("a.yaml", "t: !!timestamp x", "line 1, column 4: 'x' is not as its"),
    "a date by its form": ("a.yaml", "t: 2020-99-99", "'2020-99-99' is not as its form or tag"),
}


def test_records_have_an_end(tmp_path):
    def check(name, text, said):
        (tmp_path / name).write_text(text)
        refused(tmp_path / name, said)

    assert_each(check, ENDLESS)


def test_arrays_of_a_file_have_bounds(tmp_path):
    """Kilobytes that stand for gigabytes, and what is no number."""
    t = np.arange(50_000)
    columns = np.zeros((50_000, 401), dtype=np.int8)

    def check(said, **arrays):
        np.savez_compressed(tmp_path / "a.npz", **arrays)
        refused(tmp_path / "a.npz", said)

    check("has 20100000 numbers, and may have 20000000", t=t, q=columns)
    few = columns[:3]
    check("has 1204 columns, and may have 1000", t=t[:3], q=few, q_command=few, x=few)
    check("q must hold numbers, not true and false", t=t[:3], q=np.zeros((3, 7), dtype=bool))


def deep_names(depth):
    return {"a": deep_names(depth - 1)} if depth else ["x"]


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ('{"fps": 10, "fps": 20}', "meta/info.json: the key 'fps' is given twice"),
        (
            json.dumps({"features": {"action": {"names": {"a": deep_names(20)}}}}),
            "meta/info.json: names: may be nested 8 deep",
        ),
    ],
)
def test_what_a_data_set_states_has_bounds(tmp_path, stated, said):
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "info.json").write_text(stated)
    table = arrow.table({"timestamp": [0.0, 0.1], "action": [[0.0] * 7] * 2})
    parquet.write_table(table, tmp_path / "a.parquet")
    refused(tmp_path / "a.parquet", said)


def test_a_key_that_is_there_twice_is_refused(tmp_path):
    """Before, the last one counted."""
    text = '{"name": ["a"], "position": [0.0], "position": [1.0]}'
    for name in ("t.json", "t.yaml"):
        (tmp_path / name).write_text(text)
        refused(tmp_path / name, "the key 'position' is given twice")


def test_no_name_of_a_file_commands_a_terminal(tmp_path, capsys):
    """An ESC in the topic of an MCAP file, in a column, and on its way to a styled table."""
    escape = "\x1b[2J\x1b]0;mine\x07\x9b2J"
    file = written_mcap(tmp_path / "r.mcap", f"/q{escape}", b"{}", "lz4")
    with pytest.raises(InvalidInputError) as caught:
        RecordedTargets(file=str(file), topic="other")
    console = SafeConsole(force_terminal=True, width=1000, highlight=False)
    console.print(f"[red]error[/] {markup.escape(f'{caught.value} {escape}')}")
    (printed, _) = capsys.readouterr()
    assert "\x1b[31merror" in printed
    assert r"\x1b]0;mine" in printed
    assert "\x1b]0" not in printed
    assert "\x9b" not in printed
    assert "\x1b[2J" not in printed
