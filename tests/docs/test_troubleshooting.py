"""What the page of troubleshooting says one sees is what one sees."""

import ast
import re
import shlex

import pytest
from doc_pages import ROOT, text_of
from typer.testing import CliRunner

from drake_rnn.cli.commands import app

PAGE = "docs/troubleshooting.md"
#: A model of the reader's: a mesh that is not there, no accelerations.
_MODEL = """
<robot name="my">
  <link name="base"/>
  <link name="upper">
    <visual><geometry><mesh filename="package://lost_package/upper.dae"/></geometry></visual>
  </link>
  <link name="tool0"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="10" velocity="1"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="tool0"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="10" velocity="1"/>
  </joint>
</robot>
"""
_BLOCK = re.compile(r"^```(sh|text)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def messages():
    """Return each message with the command above it in its section, if there is one."""
    found = []
    for section in re.split(r"^#{2,3} ", text_of(PAGE), flags=re.MULTILINE):
        command = None
        for language, text in _BLOCK.findall(section):
            if language == "sh":
                command = text.strip()
            else:
                found.append((command, " ".join(text.split())))
                command = None
    return found


PROVOKED = [(command, message) for command, message in messages() if command]
QUOTED = [message for command, message in messages() if not command]


def test_most_messages_are_provoked_by_a_command():
    assert len(PROVOKED) > len(QUOTED)


def without_numbers(text):
    """The last digits of a number may differ between machines."""
    return re.sub(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?", "#", " ".join(text.split()))


@pytest.mark.long
@pytest.mark.parametrize(("command", "message"), PROVOKED)
def test_a_command_says_what_the_page_says(command, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my.urdf").write_text(_MODEL)
    program, *arguments = shlex.split(command)
    assert program == "drake-rnn"
    said = CliRunner().invoke(app, arguments, env={"COLUMNS": "1000"})
    assert without_numbers(message) in without_numbers(said.output)
    expected = {"error": 2, "warning": 0, "failed": 1}[message.split()[0]]
    assert said.exit_code == expected


def texts():
    """Return all texts of the package, with dots for what is filled in."""
    found = []
    for room in (ROOT / "drake_rnn").iterdir():
        for file in [room] if room.suffix == ".py" else room.rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.JoinedStr):
                    parts = [
                        part.value if isinstance(part, ast.Constant) else "..."
                        for part in node.values
                    ]
                    found.append("".join(parts))
                elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                    found.append(node.value)
    return found


@pytest.mark.long
def test_messages_that_are_quoted_are_those_of_the_package():
    known = texts()
    for message in QUOTED:
        pieces = [piece.strip() for piece in message.removeprefix("MyLaw").split("...")]
        for piece in filter(None, pieces):
            assert any(piece in text or fills(piece, text) for text in known), piece


def fills(piece, text):
    """Return whether a piece of a message is a text of some words, filled in."""
    given = text.split("...")
    if len("".join(given)) <= 20 or not all(part in piece for part in given):
        return False
    return re.fullmatch(".+".join(map(re.escape, given)), piece)
