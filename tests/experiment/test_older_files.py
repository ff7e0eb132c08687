"""What earlier versions wrote is read: documents, campaigns and results.

The archives in tests/data hold what the versions shipped, and results that they wrote of two of
their experiments, 0.1 s of an ideal arm and of one with motors.
"""

import json
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from drake_rnn import InvalidInputError, Result, make_experiment, simulate
from drake_rnn.experiment import read_document
from drake_rnn.jobs import read_campaign

ARCHIVES = sorted((Path(__file__).parents[1] / "data").glob("written_by_*.zip"))
#: Shipped to show that it is refused.
REFUSED = "state_adjustment_printed"


@pytest.fixture(params=ARCHIVES, ids=lambda file: file.stem.removeprefix("written_by_"))
def written(request, tmp_path):
    """A folder with what a version wrote."""
    with ZipFile(request.param) as archive:
        archive.extractall(tmp_path)
    return tmp_path


def test_results_are_read_and_the_same_run_comes_out_again(written):
    """To 1e-9: the algebra of a law may round otherwise."""
    folders = sorted((written / "results").iterdir())
    assert len(folders) == 2
    for folder in folders:
        result = Result.load(folder)
        assert result.status == "complete"
        with np.load(folder / "result.npz") as stored:
            assert set(stored.files) == {"time", *result.series}
        kept = json.loads((folder / "metrics.json").read_text())
        assert {name: result.metrics[name] for name in kept} == pytest.approx(kept, nan_ok=True)
        again = simulate(read_document(str(folder / "experiment.yaml")))
        np.testing.assert_allclose(again.time, result.time, atol=1e-12)
        for name in ("position", "p_WE"):
            np.testing.assert_allclose(
                again.series[name], result.series[name], atol=1e-9, err_msg=f"{folder.name} {name}"
            )


def test_campaigns_are_read(written):
    files = sorted((written / "campaigns").glob("*.yaml"))
    assert len(files) >= 4
    for file in files:
        assert read_campaign(file).vary


@pytest.mark.long
def test_documents_make_experiments(written):
    files = sorted((written / "documents").glob("*/*.yaml"))
    assert len(files) >= 115
    for file in files:
        if file.stem == REFUSED:
            with pytest.raises(InvalidInputError, match=r"law.target: moves the end effector"):
                make_experiment(read_document(str(file)))
            continue
        make_experiment(read_document(str(file)))
