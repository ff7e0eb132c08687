"""Rows on disk: whole or not there."""

import json
import os
from dataclasses import replace
from importlib.util import module_from_spec

import pytest

from drake_rnn import InvalidInputError
from drake_rnn.jobs.requests import RecordStore, RunRecord, RunRequest
from drake_rnn.jobs.summary import Line
from drake_rnn.moved_modules import MovedModules

REQUEST = RunRequest("ab12", {"seed": 3}, "drake 1", "")
RECORD = RunRecord(
    "failed",
    "lost",
    0.1 + 0.2,
    {"a": 1 / 3, "b": float("nan")},
    {"a": True},
    ("a",),
    ([0.0, 0.1], [1 / 7, 2.0]),
    0.5,
)


def test_a_row_reads_back_to_the_last_bit(tmp_path):
    store = RecordStore(tmp_path)
    assert store.get("ab12") is None
    store.put(REQUEST, RECORD)
    found = store.get("ab12")
    assert repr(found) == repr(RECORD)
    (file,) = tmp_path.rglob("*.json")
    assert json.loads(file.read_text())["document"] == {"seed": 3}
    assert not list(tmp_path.rglob("*.new"))


@pytest.mark.parametrize("damage", ["", '{"status": ', "{}", "[]", '{"status": "walking"}'])
def test_half_a_row_is_none(tmp_path, damage):
    """As a file system may leave it when power fails."""
    store = RecordStore(tmp_path)
    store.put(REQUEST, RECORD)
    (file,) = tmp_path.rglob("*.json")
    file.write_text(damage)
    assert store.get("ab12") is None


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("metrics", {"a": "1"}),
        ("metrics", {"a": 10**400}),
        ("metrics", [1.0]),
        ("kept", {"a": 1}),
        ("failure", None),
        ("until_s", "1"),
        ("accepted", "a"),
        ("learning", [[0.0]]),
        ("learning", [[0.0], ["a"]]),
    ],
)
def test_a_row_of_other_kinds_is_none(tmp_path, key, value):
    store = RecordStore(tmp_path)
    store.put(REQUEST, RECORD)
    (file,) = tmp_path.rglob("*.json")
    file.write_text(json.dumps({**json.loads(file.read_text()), key: value}))
    assert store.get("ab12") is None


@pytest.mark.parametrize("make", ["pipe", "nested"])
def test_what_is_no_row_is_none(tmp_path, make):
    store = RecordStore(tmp_path)
    store.put(REQUEST, RECORD)
    (file,) = tmp_path.rglob("*.json")
    file.unlink()
    if make == "pipe":
        os.mkfifo(file)
    else:
        file.write_text("[" * 100_000)
    assert store.get("ab12") is None


def test_two_do_not_work_at_the_same_rows(tmp_path):
    store = RecordStore(tmp_path)
    refused = pytest.raises(InvalidInputError, match="another process is working")
    with store.claim(), refused, RecordStore(tmp_path).claim():
        pass
    with store.claim():
        pass


def test_a_folder_that_cannot_be_made_is_a_sentence(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match=r"^rows .*Not a directory$"):
        RecordStore(tmp_path / "file" / "rows")


#: A row as version 0.3.0 wrote it, but for most metrics and keys of the document.
ROW = (
    '{"status": "complete", "failure": "", "until_s": 0.05, "metrics": {"position_error_max_m": '
    '1.2104481054423204e-12}, "kept": {"position_error_max_m": true}, "accepted": '
    '["position_error_max_m"], "learning": [], "wall_time_s": 0.37326697400203557, "method": '
    '"simulate", "versions": "drake-rnn 0.3.0, drake 1.51.1, numpy 2.4.6, code 81ad8f624fb3", '
    '"document": {"period": 0.001}}'
)


def test_a_row_of_the_released_version_is_read_and_written_to_the_last_character(tmp_path):
    store, request = RecordStore(tmp_path), RunRequest("ab12", {"period": 0.001})
    (tmp_path / "ab").mkdir()
    file = tmp_path / "ab" / "ab12.json"
    file.write_text(ROW)
    record = store.get("ab12")
    assert (record.complete, record.not_met, record.until_s) == (True, (), 0.05)
    store.put(replace(request, stamp=json.loads(ROW)["versions"]), record)
    assert file.read_text() == ROW


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        ("campaigns", "Order", RunRequest),
        ("campaigns.outcome", "Outcome", RunRecord),
        ("campaigns.store", "RowStore", RecordStore),
    ],
)
def test_names_of_the_released_version_work_with_a_warning(module, old, new):
    with pytest.warns(DeprecationWarning, match=rf"drake_rnn\.{module} is now drake_rnn\.jobs"):
        spec = MovedModules().find_spec(f"drake_rnn.{module}", None)
    found = module_from_spec(spec)
    spec.loader.exec_module(found)
    assert vars(found)[old] is new


def test_a_line_has_its_record_under_its_old_name():
    with pytest.warns(DeprecationWarning, match="outcome is now record"):
        assert Line(0, {}, RECORD).outcome is RECORD
