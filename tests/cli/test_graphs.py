"""Drawings of an experiment's wiring."""

import shutil

import pytest
from cli_helpers import KNOWN, call, sentence


def test_show_draws_the_wiring_in_place_of_the_document(tmp_path):
    file = tmp_path / "wiring.dot"
    result = call("show", KNOWN, "--diagram", file)
    assert result.exit_code == 0
    assert result.stdout == ""
    assert "<b>controller</b>" in file.read_text()


@pytest.mark.skipif(shutil.which("dot") is None, reason="needs Graphviz")
def test_show_draws_a_picture(tmp_path):
    file = tmp_path / "wiring.svg"
    assert call("show", "contact_circle", "--diagram", file).exit_code == 0
    assert "force_watch" in file.read_text()


def test_what_cannot_be_drawn_is_refused(tmp_path, monkeypatch):
    said = sentence(call("show", KNOWN, "--diagram", tmp_path / "wiring.gif"))
    assert said == "--diagram: must end with one of .dot, .svg, .png, .pdf, not 'wiring.gif'"
    said = sentence(call("show", KNOWN, "--diagram", tmp_path / "no" / "wiring.dot"))
    assert said.startswith("--diagram: ")
    assert said.endswith("No such file or directory")
    monkeypatch.setattr("shutil.which", lambda program: None)
    said = sentence(call("show", KNOWN, "--diagram", tmp_path / "wiring.svg"))
    assert "needs Graphviz" in said
    assert not list(tmp_path.iterdir())
