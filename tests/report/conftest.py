"""Reports of a few claims, and what is simulated for them."""

from pathlib import Path

import pytest
from report_helpers import CLAIMS

from drake_rnn.claims import read_claims, schemes_in
from drake_rnn.inputs.documents import to_yaml
from drake_rnn.report import ReportSettings, make_report


@pytest.fixture
def tiny(tmp_path):
    """Return a function that writes a claims file and returns what is chosen of it."""

    def written(contents=CLAIMS):
        folder = tmp_path / "claims"
        folder.mkdir(exist_ok=True)
        (folder / "joint_drift_free.yaml").write_text(to_yaml(contents))
        return [
            (paper, list(paper.claims))
            for paper in (read_claims(scheme, folder) for scheme in schemes_in(folder))
        ]

    return written


@pytest.fixture
def report(tmp_path):
    """Return a function that makes a report in this process, without pictures unless asked for."""

    def made(chosen, folder=tmp_path / "report", **settings):
        return make_report(
            chosen, folder, ReportSettings(**{"jobs": 0, "pictures": False} | settings)
        )

    return made


@pytest.fixture
def fatal(monkeypatch):
    """A law that ends badly."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "jobs"))
    return {"law.kind": "fatal_law:Fatal"}
