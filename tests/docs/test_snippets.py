"""Every piece of Python in the pages runs, and imports only what is public."""

import subprocess
import sys

import pytest
from doc_pages import PAGES, ROOT, assert_public, fenced

from drake_rnn import (
    ExperimentDocument,
    InvalidInputError,
    check_reach,
    make_experiment,
    simulate,
)
from drake_rnn.inputs.documents import construct, parse_yaml, without_extensions
from drake_rnn.inputs.fields import field_names
from drake_rnn.jobs import plan_campaign, read_campaign
from drake_rnn.robot.clearance.arm_capsules import CapsulesFile
from drake_rnn.robot.limits_file import read_limits

#: What else a snippet may import.
OTHERS = {"concurrent", "gymnasium", "numpy", "pydrake", "time"}


def blocks(language: str) -> list:
    return [
        pytest.param(page, line, code, id=f"{page}:{line}")
        for page in PAGES
        for line, code in fenced(page, language)
    ]


def test_there_are_snippets():
    assert len(blocks("python")) >= 8
    assert {"README.md", "docs/python.md"} <= {block.values[0] for block in blocks("python")}


@pytest.mark.parametrize(("page", "line", "code"), blocks("python"))
def test_a_snippet_imports_only_what_is_public(page, line, code):
    assert_public(code, OTHERS)


@pytest.mark.long
@pytest.mark.parametrize(("page", "line", "code"), blocks("python"))
@pytest.mark.usefixtures("registries")
def test_a_snippet_runs(page, line, code, monkeypatch):
    monkeypatch.chdir(ROOT)
    try:
        exec(compile("\n" * (line - 1) + code, page, "exec"), {"__name__": "snippet"})
    except InvalidInputError as error:
        if "needs jax, which is not installed" in str(error):
            pytest.skip(str(error))
        raise
    except ModuleNotFoundError as error:
        if error.name == "gymnasium":
            pytest.skip(str(error))
        raise


@pytest.mark.long
@pytest.mark.parametrize(
    ("page", "line", "code"),
    [block for block in blocks("python") if '__name__ == "__main__"' in block.values[2]],
)
def test_a_script_runs(page, line, code, tmp_path):
    """Those whose processes import them."""
    script = tmp_path / "script.py"
    script.write_text(code)
    run = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (0, "")
    assert run.stdout


@pytest.mark.parametrize(("page", "line", "code"), blocks("yaml"))
def test_a_document_can_be_run_or_is_a_part_of_one(page, line, code, tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    document = without_extensions(parse_yaml(code, f"{page}:{line}"))
    if "vary" in document:
        plan_campaign(read_campaign(document))
        return
    if "joints" in document:
        (tmp_path / "my.limits.yaml").write_text(code)
        read_limits(tmp_path / "my.limits.yaml", document["joints"], document["joints"])
        return
    if "capsules" in document:
        construct(CapsulesFile, document, f"{page}:{line}")
        return
    assert document.keys() <= set(field_names(ExperimentDocument))
    if "duration" in document:
        make_experiment(document)
        assert document["accept"]
    elif "file" not in (path := document.get("path", {"file": None})):
        # Any arm will do; what it is to follow must be within its reach.
        task = "pose" if "rpy" in path else "xyz"
        law = {"kind": "pseudoinverse"}
        tracked = {"arm": "panda", "task": task, "law": law, "period": 1e-3, "duration": 7.0}
        assert not check_reach(make_experiment({**tracked, "path": path}))


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("page", "line", "code"),
    [
        block
        for block in blocks("yaml")
        if "duration:" in block.values[2] and "vary:" not in block.values[2]
    ],
)
def test_a_printed_document_does_what_it_accepts(page, line, code, monkeypatch):
    """The figures that the page says are the bounds of the document's own ``accept``."""
    monkeypatch.chdir(ROOT)
    result = simulate(parse_yaml(code, f"{page}:{line}"))
    assert [verdict for verdict in result.verdicts if not verdict.met] == []
