"""Kill and stall what drives franka-sim's FR3, and print what ended each run, when and how.

Each run is ``drake-rnn drive adaptive_fr3`` as a user starts it; the fault comes while the arm
joins its path, fast. Each run starts by itself after the one before::

    python benchmarks/fr3_faults.py --judge /path/to/venv/bin/python
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from drake_rnn import Array
from drake_rnn.drive import read_record
from franka_sim_server import HOST, Server, served
from markdown_table import head, row
from shared_options import add_judge

_COMMAND = "python benchmarks/fr3_faults.py"
EXPERIMENT = "adaptive_fr3"
#: Time of the fault after the run has begun [s].
AT = 0.3
#: Largest acceleration of the robot [rad/s^2].
ACCELERATION = 10.0
#: Times for which the pacer is stalled [ms].
LOST = (1, 2, 5, 10, 15, 19, 25)


class Drive:
    """A run of the command.

    Args:
        folder: Its folder.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        quick = ("--no-figures", "--no-playback", "--duration", "2", "--out", str(folder))
        line = [sys.executable, "-u", "-m", "drake_rnn", "drive", EXPERIMENT, "--robot", "fr3"]
        self._process = subprocess.Popen(
            [*line, "--url", HOST, *quick],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.pid, self.said = self._process.pid, ""

    def running(self) -> bool:
        """Wait until the law commands; return whether it does."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.said += line
            if line.startswith("run: "):
                return True
        return False

    @property
    def pacer(self) -> int:
        """Number of the pacer's process."""
        children = Path(f"/proc/{self.pid}/task/{self.pid}/children").read_text().split()
        return int(children[0])

    def ended(self) -> int:
        """Wait for its end, and return the exit status."""
        assert self._process.stdout is not None
        self.said += self._process.stdout.read()
        return self._process.wait()

    def cycles(self) -> dict[str, Array] | None:
        """Return every cycle, of the run's folder or of what the pacer has left."""
        kept, left = self._folder / EXPERIMENT / "pacer.npz", self._folder / f"{EXPERIMENT}.cycles"
        if kept.is_file():
            with np.load(kept) as file:
                return dict(file)
        until = time.monotonic() + 3.0
        while not left.is_file() and time.monotonic() < until:
            time.sleep(0.05)
        return read_record(left) if left.is_file() else None


def stalled(pid: int, length: float) -> None:
    """Stop a process for a time [s]."""
    os.kill(pid, signal.SIGSTOP)
    time.sleep(length)
    os.kill(pid, signal.SIGCONT)


#: What is done to a drive and to its robot, by its name.
Fault = Callable[[Drive, Server], Any]
FAULTS: dict[str, Fault] = {
    "none": lambda drive, server: None,
    "law killed": lambda drive, server: os.kill(drive.pid, signal.SIGKILL),
    "law stalled for 20 ms": lambda drive, server: stalled(drive.pid, 0.02),
    "law stalled for 500 ms": lambda drive, server: stalled(drive.pid, 0.5),
    "pacer killed": lambda drive, server: os.kill(drive.pacer, signal.SIGKILL),
    "robot killed": lambda drive, server: server.kill(),
}


@dataclass(frozen=True)
class Outcome:
    """What one run came to.

    Attributes:
        status: Exit status.
        ended: What ended it, in words.
        reflex: Whether the robot has aborted the motion.
        rest: Time from the fault until the command rested [s]; NaN where it never did.
        needed: Time that the fastest joint needed at least [s].
        lost: Cycles that the robot lost.
        recorded: Whether there is a record.
    """

    status: int
    ended: str
    reflex: bool
    rest: float
    needed: float
    lost: int
    recorded: bool


def outcome(fault: Fault, server: Server) -> Outcome:
    """Run one drive with a fault."""
    before = len(server.complaints())
    with tempfile.TemporaryDirectory() as folder:
        drive = Drive(Path(folder))
        at = np.inf
        if drive.running():
            time.sleep(AT)
            at = time.monotonic()
            fault(drive, server)
        status, cycles = drive.ended(), drive.cycles()
        stops = [s for s in drive.said.splitlines() if s.startswith(("stopped by ", "robot: "))]
        ended = stops[0].removeprefix("stopped by ").split(":")[0] if stops else "its end"
        if status == -signal.SIGKILL:
            ended = "killed"
        reflex = len(server.complaints()) > before
        if cycles is None:
            return Outcome(status, ended, reflex, np.nan, np.nan, 0, recorded=False)
        speed = np.abs(cycles["velocity_commanded"]).max(axis=1)
        after = cycles["answered"] >= at
        rests = np.flatnonzero(after & (speed == 0.0))
        rest = cycles["answered"][rests[0]] - at if rests.size else np.nan
        fastest = speed[np.flatnonzero(~after)[-1]] if after.any() else np.nan
        lost = int((cycles["passed"].astype(int) - 1).clip(0).sum())
        return Outcome(status, ended, reflex, rest, fastest / ACCELERATION, lost, recorded=True)


def told(name: str, outcomes: list[Outcome]) -> None:
    """Print the row of one fault."""
    # Where a run has gone on, its first rest is its end.
    stopped = [each for each in outcomes if each.status and np.isfinite(each.rest)]
    over = [1e3 * (each.rest - each.needed) for each in stopped]
    row(
        name,
        len(outcomes),
        ", ".join(sorted({str(each.status) for each in outcomes})),
        ", ".join(sorted({each.ended for each in outcomes})),
        sum(each.reflex for each in outcomes),
        f"{max(each.rest for each in stopped):.3f}" if stopped else "",
        f"{max(over):.0f}" if stopped else "",
        max(each.lost for each in outcomes),
        sum(each.recorded for each in outcomes),
    )
    sys.stdout.flush()


def losing(length: int) -> Fault:
    """Return the fault of a pacer that is stalled for a time [ms], and loses cycles."""
    return lambda drive, server: stalled(drive.pacer, 1e-3 * length)


STALLS = {f"pacer stalled for {length} ms": losing(length) for length in LOST}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add_judge(parser, required=True)
    parser.add_argument("--repeats", type=int, default=10, help="of each fault")
    parser.add_argument("--losses", type=int, default=1, help="repeats of each number lost")
    faults = FAULTS | STALLS
    parser.add_argument("--only", nargs="+", choices=faults, metavar="FAULT", help="faults to try")
    asked = parser.parse_args()
    head(
        *("fault", "runs", "exit status", "ended by", "reflexes", "at rest after [s]"),
        *("beyond v / 10 [ms]", "lost", "records"),
        made_by=f"{_COMMAND} --judge PYTHON",
    )
    with served(asked.judge) as server:
        for name in asked.only or faults:
            found = []
            for _ in range(asked.losses if name in STALLS else asked.repeats):
                found.append(outcome(faults[name], server))
                if name == "robot killed":
                    server.start()
            told(name, found)


if __name__ == "__main__":
    main()
