"""The tutorial does what it says, from its document to the printed page."""

import re
import shlex
import shutil
import subprocess

import pytest
from make_tutorial import PAGE, commands, files
from typer.testing import CliRunner

from drake_rnn import Result
from drake_rnn.cli.commands import app
from drake_rnn.inputs.documents import parse_yaml

SCHEMES = ("adaptive", "pseudoinverse", "zeroing")


def leaves(document):
    """Number of the keys of a document that have a value of their own."""
    return sum(leaves(v) if isinstance(v, dict) else 1 for v in document.values())


def test_the_task_takes_few_commands_and_keys():
    document = parse_yaml(files()["letter_a.yaml"], "letter_a.yaml")
    assert len(commands()) + leaves(document) < 20
    # What was asked for: noise of .1 mm, a delay of 2 ms, 500 Hz, motors, and the letter.
    assert document["sensing"] == {"p_WE_noise": 1e-4, "delay": 2e-3}
    assert (document["arm"], document["period"], document["level"]) == ("ur5", 2e-3, "dynamic")
    assert document["path"]["text"] == "A"


@pytest.mark.long
def test_the_tutorial_makes_a_figure_and_a_table_in_a_page(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, contents in files().items():
        (tmp_path / name).write_text(contents)
    for command in commands():
        carry_out(command)
    assert (tmp_path / "out" / SCHEMES[0] / "playback.html").is_file()
    table = (tmp_path / "table.tex").read_text()
    for scheme in SCHEMES:
        result = Result.load(tmp_path / "out" / scheme)
        error = result.metrics["position_error_max_m"]
        # Below two standard deviations of the camera's noise, and no less than motors lag by.
        assert 0.5 * result.metrics["command_error_max_m"] < error < 2e-4
        assert f"{1e6 * error:.4g}" in table or f"{1e3 * error:.4g}" in table
    assert b"/FontFile2" in (tmp_path / "figure.pdf").read_bytes()
    # The page shows the same table as the files, up to what another processor rounds.
    shown = re.findall(r"[\d.]+(?= [†|])", PAGE.read_text())
    assert len(shown) >= 4 * len(SCHEMES)
    if shutil.which("pdflatex") is None:
        pytest.skip("pdflatex is not installed: the page was not set")
    log = (tmp_path / "paper.log").read_text()
    assert not re.search(r"^!|Overfull|undefined|Missing character", log, re.MULTILINE)
    assert "(1 page" in log
    if shutil.which("pdffonts") is not None:
        fonts = subprocess.run(
            ["pdffonts", tmp_path / "paper.pdf"], capture_output=True, text=True, check=True
        ).stdout
        assert "Type 3" not in fonts
        assert " no " not in re.sub(r"(yes|no) +\d+ +\d+$", "", fonts, flags=re.MULTILINE)


def carry_out(command):
    """In this process: one of their own would import everything again for each command."""
    name, *arguments = shlex.split(command)
    if name == "drake-rnn":
        # Of runs whose pictures are like those of the first one, nobody looks at them.
        is_like_the_first = any(scheme in command for scheme in SCHEMES[1:])
        if arguments[0] == "run" and is_like_the_first:
            arguments += ["--no-figures", "--no-playback"]
        ended = CliRunner().invoke(app, arguments)
        assert ended.exit_code == 0, (command, ended.output)
    elif shutil.which(name) is not None:
        subprocess.run([name, *arguments], check=True, capture_output=True)
