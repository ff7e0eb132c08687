"""Command lines that mean nothing: exit status 2 and one sentence, and nothing is written."""

import os
import shlex

import pytest
from refusing import at_once, lots, table
from typer.testing import CliRunner

from drake_rnn.cli.commands import app
from row_helpers import assert_each


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with files that are none of what they should be."""
    monkeypatch.chdir(tmp_path)
    texts = {
        "FILE": "here",
        "EMPTY.yaml": "",
        "LIST.yaml": "- a\n- b\n",
        "TAB.yaml": "arm: panda\nlaw:\n\tkind: pseudoinverse\n",
        "LATIN.yaml": "expect: größer\n".encode("latin-1"),
        "UTF16.yaml": "arm: panda\n".encode("utf-16"),
        "BINARY.yaml": bytes(range(256)),
        "TWICE.yaml": "arm: panda\narm: ur5\n",
        "TWODOCS.yaml": "arm: panda\n---\narm: ur5\n",
        "CRLF.yaml": "arm: panda\r\nlaw: {kind: pseudoinverse}\r\nperiod: 1e-3\r\nduration: 1\r\n",
        "BOM.yaml": b"\xef\xbb\xbfarm: panda\nlaw: {kind: pseudoinverse}\nperiod: 1e-3\n",
        "BROKEN/experiment.yaml": "arm: panda\n",
        "raiser.py": "class Odd(BaseException): pass\nraise Odd('on its own')\n",
        "BROKEN/result.npz": "",
        "TRUNCATED/run.json": '{"status": "incomplete"}',
    }
    for name in ("DIR.yaml", "EMPTYDIR", "BROKEN", "TRUNCATED"):
        (tmp_path / name).mkdir()
    os.mkfifo(tmp_path / "PIPE.yaml")
    monkeypatch.syspath_prepend(tmp_path)
    for name, content in texts.items():
        content = content if isinstance(content, bytes) else content.encode()
        (tmp_path / name).write_bytes(content)
    return tmp_path


@pytest.mark.parametrize("rows", lots(table("command_lines.txt")))
def test_each_is_one_sentence_and_nothing_is_written(folder, rows):
    def assert_refused(arguments, said):
        before = _files(folder)
        with at_once():
            result = CliRunner().invoke(app, shlex.split(arguments))
        assert isinstance(result.exception, SystemExit), result.exception
        assert result.exit_code == 2, (result.stdout, result.stderr)
        (line,) = result.stderr.splitlines()
        assert line.startswith(f"error {said}"), line
        assert _files(folder) == before

    assert_each(assert_refused, rows)


def _files(folder):
    """Return what a folder holds, but for what Python itself keeps of modules that it imports."""
    return sorted(file for file in folder.rglob("*") if "__pycache__" not in file.parts)
