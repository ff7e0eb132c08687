"""A campaign that is killed with -9, again and again, against the same one left alone.

Each time at a random moment, in turn: the command itself, one of its processes, and the scheduler
of a Dask cluster that it runs on. Needs the extra `cluster`. Prints one line for each kill, and
whether both tables are the same to the last bit. Rows are run in batches unless told otherwise.

    python benchmarks/campaign_kills.py --rows 2000 --kills 10
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CAMPAIGN = """
name: kills
experiment: pinv_line
changes: {{duration: 0.05}}
vary: {{law.damping: {{kind: log_uniform, low: 1.0e-6, high: 1.0e-2}}}}
samples: {rows}
method: {method}
"""
CLUSTER = """
import time
from distributed import LocalCluster
if __name__ == "__main__":
    cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    print(cluster.scheduler_address, flush=True)
    time.sleep(1e6)
"""


class Campaign:
    """A campaign that runs as a command, in processes of its own.

    Args:
        folder: Folder with its document and results.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.process: subprocess.Popen | None = None
        self.cluster: subprocess.Popen | None = None

    @property
    def kept(self) -> int:
        return len(list((self.folder / "out" / "campaign_kills" / "rows").rglob("*.json")))

    def start(self, on_cluster: bool) -> None:
        where = ["--jobs", "2"]
        if on_cluster:
            self.cluster = _started([sys.executable, str(self.folder / "cluster.py")])
            where = ["--scheduler", self.cluster.stdout.readline().strip()]
        command = [sys.executable, "-m", "drake_rnn", "campaign", str(self.folder / "kills.yaml")]
        out = str(self.folder / "out")
        self.process = _started([*command, "--out", out, "--quiet", *where])

    def wait(self, count: int) -> None:
        while self.kept < count and self.process.poll() is None:
            time.sleep(0.02)

    def stop(self) -> None:
        if self.cluster is not None:
            os.killpg(self.cluster.pid, signal.SIGKILL)
            self.cluster.wait()
        self.process.wait()
        self.process = self.cluster = None

    def children(self) -> list[int]:
        tasks = Path(f"/proc/{self.process.pid}/task")
        pids = " ".join(each.read_text() for each in tasks.glob("*/children")).split()
        return [pid for pid in map(int, pids) if b"spawn_main" in _words(pid)]


def _words(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def _started(command: list[str]) -> subprocess.Popen:
    return subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )


def disturb(campaign: Campaign, victim: str, count: int, rng: random.Random) -> None:
    """Run a campaign until some rows are kept, at least one of them new, and kill a part of it."""
    # Rows of a batch are kept at once, perhaps beyond this moment.
    count = max(count, campaign.kept + 1)
    campaign.start(on_cluster=victim == "scheduler")
    campaign.wait(count)
    if campaign.process.poll() is not None:
        print(f"{victim}: it had ended before")
    elif victim == "command":
        campaign.process.kill()
    elif victim == "scheduler":
        campaign.cluster.kill()
    else:
        os.kill(rng.choice(campaign.children()), signal.SIGKILL)
        campaign.wait(count + 10)
        campaign.process.terminate()
    campaign.process.wait()
    campaign.stop()
    print(f"{victim} killed at {count} rows; {campaign.kept} are kept", flush=True)


def main() -> None:
    """Run both and compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=int, default=2000)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--method", default="batch")
    given = parser.parse_args()
    rng = random.Random(given.seed)
    tables = []
    for disturbed in (True, False):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "kills.yaml").write_text(
                CAMPAIGN.format(rows=given.rows, method=given.method)
            )
            (folder / "cluster.py").write_text(CLUSTER)
            campaign, began = Campaign(folder), time.monotonic()
            moments = sorted(rng.sample(range(given.rows), given.kills)) if disturbed else []
            for number, count in enumerate(moments):
                disturb(campaign, ("command", "process", "scheduler")[number % 3], count, rng)
            campaign.start(on_cluster=False)
            campaign.stop()
            tables.append((folder / "out" / "campaign_kills" / "table.csv").read_bytes())
            print(f"{len(moments)} kills: {campaign.kept} rows in {time.monotonic() - began:.0f} s")
    same = tables[0] == tables[1]
    lines = tables[0].count(b"\n") - 1
    print(f"{lines} rows; the tables are {'the same to the last bit' if same else 'NOT the same'}")
    sys.exit(not same or lines != given.rows)


if __name__ == "__main__":
    main()
