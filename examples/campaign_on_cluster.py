"""Run a campaign on a cluster: of SLURM where there is one, otherwise of two processes here.

On SLURM it needs dask-jobqueue, and runs best as a small job of its own, for as long as the
campaign may take: sbatch --time 1-0 --wrap "python campaign_on_cluster.py". If that ends too early,
start it again: rows that have ended are in the folder, and are not run again.
"""

import shutil
import tempfile

from distributed import Client, LocalCluster

from drake_rnn import run_campaign

CAMPAIGN = {
    "name": "lines",
    "experiment": "pinv_line",
    "changes": {"duration": 0.1},
    "vary": {"law.feedback": {"kind": "uniform", "low": 5.0, "high": 20.0}},
    "samples": 4,
}


def slurm(jobs):
    """Return a cluster of SLURM jobs of one run at a time each, which come and go by themselves."""
    from dask_jobqueue import SLURMCluster

    cluster = SLURMCluster(cores=1, processes=1, memory="2GB", walltime="04:00:00")
    cluster.adapt(minimum=0, maximum=jobs)
    return cluster


def here(jobs):
    """Return a cluster of processes on this machine."""
    return LocalCluster(n_workers=jobs, threads_per_worker=1, dashboard_address=None)


if __name__ == "__main__":
    start, jobs = (slurm, 100) if shutil.which("sbatch") else (here, 2)
    with start(jobs) as cluster, Client(cluster) as client:
        # On a cluster, give a folder that stays.
        folder = tempfile.mkdtemp()
        result = run_campaign(CAMPAIGN, folder, executor=client)
    print(result.summary.statuses, "in", folder)
    error = next(m for m in result.summary.metrics if m.name == "position_error_max_m")
    print("the worst:", error.worst[0].command)
    print("is off its line by up to", error.worst[0].value, "m")
