"""Campaigns on a Dask cluster of this machine."""

import csv
import os
import signal
import subprocess
import sys

import dask
import pytest
from distributed import Client, LocalCluster
from typer.testing import CliRunner

from drake_rnn.cli.commands import app
from drake_rnn.jobs import cluster_at, run_campaign

LINE = {
    "name": "lines",
    "experiment": "pinv_line",
    "changes": {"duration": 0.05, "law.kind": "fatal_law:Fatal"},
    "vary": {"law.feedback": {"kind": "uniform", "low": 5.0, "high": 20.0}},
    "samples": 6,
}
# A scheduler that gives a task up with its first worker, and starts workers again at once.
AT_ONCE = {"distributed.scheduler.allowed-failures": 0, "distributed.comm.timeouts.connect": "5s"}


def statuses(folder):
    with (folder / "table.csv").open(newline="") as stream:
        return [row["status"] for row in csv.DictReader(stream)]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The table of a campaign that ran through, in this process."""
    folder = tmp_path_factory.mktemp("undisturbed")
    run_campaign(LINE, folder, jobs=0)
    return (folder / "table.csv").read_bytes()


@pytest.fixture
def cluster():
    """A cluster of two processes."""
    with dask.config.set(AT_ONCE), LocalCluster(**SMALL) as cluster:
        yield cluster


SMALL = {
    "n_workers": 2,
    "threads_per_worker": 1,
    "processes": True,
    "dashboard_address": None,
    "silence_logs": 50,
}


@pytest.mark.long
def test_a_cluster_makes_the_same_table_also_when_a_worker_is_killed(
    cluster, tmp_path, undisturbed
):
    killed = []

    def kill(ended, runs, outcome):
        if ended == 2:
            killed.append(next(iter(cluster.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    with Client(cluster) as client:
        result = run_campaign(LINE, tmp_path, executor=client, progress=kill)
        assert client.status == "running"
    assert killed
    assert (result.ending, result.missing) == ("complete", 0)
    assert (tmp_path / "table.csv").read_bytes() == undisturbed


@pytest.mark.long
def test_a_run_that_kills_its_workers_is_named(cluster, tmp_path):
    vary = {"law.fate": ["live", "kill", "live"], "seed": [1, 2, 3]}
    campaign = {**LINE, "vary": vary, "together": [list(vary)]}
    campaign.pop("samples")
    run_campaign(campaign, tmp_path, executor=cluster_at(cluster.scheduler_address))
    assert statuses(tmp_path) == ["complete", "killed its worker", "complete"]


SCHEDULER = """
import time
from distributed import LocalCluster
if __name__ == "__main__":
    cluster = LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None)
    print(cluster.scheduler_address, flush=True)
    time.sleep(600)
"""


@pytest.fixture
def scheduler(tmp_path):
    """The process and the address of a scheduler."""
    (tmp_path / "scheduler.py").write_text(SCHEDULER)
    process = subprocess.Popen(
        [sys.executable, tmp_path / "scheduler.py"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    yield process, process.stdout.readline().strip()
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()


@pytest.mark.long
def test_a_scheduler_that_is_lost_is_a_sentence_and_the_table_goes_on(scheduler, tmp_path):
    """Its third run does not end before."""
    process, address = scheduler
    wait = tmp_path / "mark.wait"
    wait.touch()
    vary = {"law.fate": ["live", "live", "wait", "live"], "seed": [1, 2, 3, 4]}
    changes = {**LINE["changes"], "law.mark": str(tmp_path / "mark")}
    campaign = {**LINE, "changes": changes, "vary": vary, "together": [list(vary)]}
    campaign.pop("samples")

    def kill(ended, runs, outcome):
        if ended == 2:
            process.kill()

    out = tmp_path / "out"
    lost = run_campaign(campaign, out, executor=cluster_at(address), progress=kill, batch=1)
    assert (lost.ending, lost.reason) == ("lost", f"the scheduler at {address} is lost")
    assert len(lost.lines) == 2
    wait.unlink()
    rest = run_campaign(campaign, out, jobs=0)
    assert (rest.ending, rest.kept) == ("complete", 2)
    run_campaign(campaign, tmp_path / "undisturbed", jobs=0)
    assert (out / "table.csv").read_bytes() == (tmp_path / "undisturbed/table.csv").read_bytes()


@pytest.mark.long
def test_the_command_runs_on_a_cluster(scheduler, tmp_path):
    _, address = scheduler
    options = ["--samples", "4", "--duration", "0.05", "--out", str(tmp_path)]
    result = CliRunner().invoke(app, ["campaign", "line_starts", "--scheduler", address, *options])
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("line_starts: 4 rows: 4 complete, 4 in batches\n")
