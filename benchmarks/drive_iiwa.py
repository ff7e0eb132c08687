"""Drive the simulated iiwa with faults, and print what ended each run, when and how.

In lock step, within this process and without any clock but the robot's; with --processes as two
processes that exchange messages, where either side is killed, too; with --tries N the drive of the
page without faults, N times, and with --beside while a campaign takes all cores::

    python benchmarks/drive_iiwa.py --tries 20
    python benchmarks/drive_iiwa.py --tries 20 --beside
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import numpy as np
from pydrake.lcm import DrakeLcm

from drake_rnn import (
    IIWA,
    Array,
    Faults,
    IiwaLcm,
    Result,
    SimulatedIiwa,
    drive_experiment,
    driven_experiment,
    lock_step,
)
from drake_rnn.drive import open_lcm
from drake_rnn.drive.iiwa_lcm import STATUS, decoded_status

EXPERIMENT = "slc_nephroid_known"
#: Faults of the messages, during the whole run.
LASTING = {
    "none": {},
    "5 % lost": {"loss": 0.05},
    "5 % overtaken": {"reorder": 0.05},
    "10 ms late": {"delay": 0.01},
    "noise of 0.1 mrad": {"noise": 1e-4},
}
#: What happens once, and the options of `drake-rnn robot` that ask for it.
SUDDEN = {
    "it tells nothing for 0.6 s": ({"silence": 0.6}, ("--silence", "0.6")),
    "it stalls for 0.6 s": ({"stall": 0.6}, ("--stall", "0.6")),
    "its clock jumps by 5 s": ({"clock": 5.0}, ("--clock", "5")),
    "its clock jumps by -5 s": ({"clock": -5.0}, ("--clock", "-5")),
    "a position is NaN": ({"nan": True}, ("--nan",)),
    "a joint is beyond its limit": ({"beyond": True}, ("--beyond",)),
    "it stops at a limit": ({"deaf": np.inf}, ("--limit-stop",)),
}
#: What is driven in a try, as on the page.
DRIVEN = ("--set", "arm=iiwa14", "--set", "path.size=0.03", "--duration", "8")
#: Time after which a try has hung [s].
HUNG = 600.0
#: A campaign that does not end meanwhile.
CAMPAIGN = {
    "name": "beside",
    "experiment": EXPERIMENT,
    "vary": {"law.kappa": {"kind": "log_uniform", "low": 1.0, "high": 10.0}},
    "samples": 100_000,
}
#: Time of the fault after the first command [s]; joints are as fast as they get then.
AT = 1.3
# Speed below which the robot rests [rad/s].
_REST = 0.02


class Heard:
    """What the robot has told anybody who listens: arrivals [s] and largest speeds [rad/s]."""

    def __init__(self, lcm: DrakeLcm, now: Callable[[], float]) -> None:
        self.at: list[float] = []
        self.speed: list[float] = []
        self._now = now
        lcm.Subscribe(STATUS, self._hear)

    def _hear(self, data: bytes) -> None:
        self.at.append(self._now())
        self.speed.append(float(np.abs(decoded_status(data).velocity).max()))

    def fastest_after(self, fault: float) -> float:
        """Return the largest speed of a joint after a time [rad/s]."""
        return max((v for t, v in zip(self.at, self.speed, strict=True) if t > fault), default=0.0)

    def rest_after(self, fault: float) -> float:
        """Return how long after a time the robot moved last [s]."""
        at, speed = np.array(self.at), np.array(self.speed)
        moved = at[(speed > _REST) & (at > fault)]
        return float(moved.max() - fault) if moved.size else 0.0


def path_errors(result: Result, since: float) -> list[str]:
    """RMS and largest error of what was measured and of what was commanded [mm]."""
    kinematics = result.experiment.arm.kinematics()
    late, found = result.time >= since, []
    for name in ("position", "position_commanded"):
        p = np.array([kinematics.p_WE(q) for q in result.series[name][late]])
        error = 1e3 * np.linalg.norm(p - result.series["p_WE_desired"][late], axis=1)
        found.append(f"{np.sqrt((error**2).mean()):.2f} / {error.max():.2f}")
    return found


def largest_acceleration(clock: Array, q: Array) -> float:
    """Return the largest acceleration of what was sent, by the robot's clock [rad/s^2].

    Where that jumps, a cycle has passed.
    """
    sent = np.isfinite(q).all(axis=1)
    steps = np.diff(clock, prepend=clock[:1])
    clock = np.cumsum(np.where(np.abs(steps) > 0.1, IIWA.period, steps))
    v = np.diff(q[sent], axis=0) / np.diff(clock[sent])[:, None]
    middle = (clock[sent][1:] + clock[sent][:-1]) / 2
    return float(np.abs(np.diff(v, axis=0) / np.diff(middle)[:, None]).max())


def row(*cells: object) -> None:
    """Print a row of a table."""
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def head(*cells: str) -> None:
    """Print the head of a table."""
    row(*cells)
    row(*["---"] * len(cells))


def lock_stepped(faults: dict, off: float, duration: float) -> tuple:
    """Drive a robot in this process; return the result, the drive, and what was heard."""
    experiment = driven_experiment(EXPERIMENT, IIWA, {"duration": duration})
    lcm = DrakeLcm("memq://")
    robot = SimulatedIiwa(lcm, experiment.start + off, Faults(at=AT, **faults))
    heard = Heard(lcm, lambda: robot.time)
    connection = IiwaLcm(lcm, lock_step(robot, lcm), lambda: robot.time)
    result, driven = drive_experiment(experiment, IIWA, connection)
    for _ in range(1000):
        robot.step()
        lcm.HandleSubscriptions(0)
    return result, driven, heard


def in_lock_step() -> None:
    """Print the tables of runs without processes."""
    head("messages", "ended by", "lost", "late", "measured", "commanded", "acceleration")
    for name, faults in LASTING.items():
        result, driven, _ = lock_stepped(faults, 0.1, 10.0)
        run = driven.log.of("run")
        ended = driven.stopped.watch if driven.stopped else "its end"
        most = largest_acceleration(run["time"], run["position_sent"])
        errors = path_errors(result, 5.0)
        row(name, ended, driven.lost, driven.late, *errors, f"{most:.5f}")
    print()
    head("fault", "ended by", "stop took", "acceleration", "at rest after", "fastest", "result")
    for name, (faults, _) in SUDDEN.items():
        result, driven, heard = lock_stepped(faults, 0.0, 4.0)
        log = driven.log.arrays()
        most = largest_acceleration(log["time"], log["position_sent"])
        first = log["host_time"][np.isfinite(log["position_sent"]).all(axis=1)][0]
        rest = f"{heard.rest_after(first + AT):.2f}"
        fast = f"{heard.fastest_after(first + AT):.2f}"
        watch = driven.stopped.watch if driven.stopped else "its end"
        row(name, watch, f"{driven.rested:.3f}", f"{most:.5f}", rest, fast, result.status)


class Processes:
    """A robot and who drives it, as two processes; this one listens."""

    def __init__(self, url: str, folder: Path, late: float, options: tuple[str, ...]) -> None:
        self._url = url
        self.robot = self._begin("robot", "iiwa", "--at", str(AT), *options)
        assert self.robot.stdout is not None
        self.robot.stdout.readline()
        self._lcm = open_lcm(url)
        self.heard = Heard(self._lcm, time.monotonic)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()
        quiet = ("--no-figures", "--no-playback", "--duration", "4", "--out", str(folder))
        patient = ("--wait", "20", "--late", str(late), "--silence", str(late))
        self._said: list[str] = []
        self.drive = self._begin("drive", EXPERIMENT, *quiet, *patient)

    def _begin(self, *arguments: str) -> subprocess.Popen:
        line = [sys.executable, "-m", "drake_rnn", *arguments, "--url", self._url]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        return subprocess.Popen(line, **pipes)

    def _listen(self) -> None:
        while not self._ended.is_set():
            self._lcm.HandleSubscriptions(20)

    def running(self) -> float:
        """Wait until the law commands; return when it began [s]."""
        assert self.drive.stdout is not None
        for line in self.drive.stdout:
            self._said.append(line)
            if line.startswith("run: "):
                break
        return time.monotonic()

    def end(self) -> str:
        """Wait for the drive, end all, and return what it said."""
        said = "".join(self._said) + self.drive.communicate()[0]
        time.sleep(1.0)
        self._ended.set()
        self._thread.join()
        self.robot.kill()
        self.robot.wait()
        return said


def in_processes(url: str, repeats: int, late: float) -> None:
    """Print the table of runs in two processes."""
    head("fault", "ended by", "status", "at rest after", "result")
    killed = {"drive killed": (), "robot killed": (), "drive told to end": ()}
    faults = {"none": ()} | {name: options for name, (_, options) in SUDDEN.items()} | killed
    for name, options in faults.items():
        for _ in range(repeats):
            with tempfile.TemporaryDirectory() as folder:
                processes = Processes(url, Path(folder), late, options)
                fault = processes.running() + AT
                time.sleep(max(fault - time.monotonic(), 0.0))
                if name == "drive killed":
                    processes.drive.kill()
                elif name == "robot killed":
                    processes.robot.kill()
                elif name == "drive told to end":
                    processes.drive.send_signal(signal.SIGINT)
                said = processes.end()
                rest = f"{processes.heard.rest_after(fault):.2f}"
                row(
                    name,
                    reason(said),
                    processes.drive.returncode,
                    "" if name in ("none", "robot killed") else rest,
                    saved(Path(folder) / EXPERIMENT),
                )


def reason(said: str) -> str:
    """Return why a drive has ended, by what it said."""
    starts = ("stopped by ", "failed ", "error ")
    lines = [line for line in said.splitlines() if line.startswith(starts)]
    return lines[0].removeprefix("stopped by ") if lines else "its end"


def in_tries(url: str, count: int, late: float) -> None:
    """Print the table of drives without faults, each of a new robot, and how many ended how."""
    head("try", "ended by", "status", "result", "cycles", "lost", "late", "wall time [s]", "load")
    ended: Counter[str] = Counter()
    for number in range(1, count + 1):
        with tempfile.TemporaryDirectory() as folder, begun("robot", "iiwa", "--url", url) as robot:
            assert robot.stdout is not None
            robot.stdout.readline()
            line = ("drive", EXPERIMENT, *DRIVEN, "--url", url, "--out", folder)
            quiet = ("--no-figures", "--no-playback", "--late", str(late), "--silence", str(late))
            began = time.monotonic()
            with begun(*line, *quiet) as drive:
                said, _ = drive.communicate(timeout=HUNG)
            why, took = reason(said), time.monotonic() - began
            place = Path(folder) / EXPERIMENT
            timings = {}
            if (place / "run.json").is_file():
                timings = json.loads((place / "run.json").read_text())["timings"]
            counts = (timings.get(f"cycles{of}", "") for of in ("", "_lost", "_late"))
            load = f"{os.getloadavg()[0]:.1f}"
            status = drive.returncode
            row(number, why, status, saved(place), *counts, f"{took:.1f}", load)
            ended[why.partition(":")[0]] += 1
    print("\n" + ", ".join(f"{why}: {times} of {count}" for why, times in ended.items()))


@contextmanager
def begun(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Begin a command of the package, which is ended with the block."""
    line = [sys.executable, "-m", "drake_rnn", *arguments]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    process = subprocess.Popen(line, **pipes, text=True)
    try:
        yield process
    finally:
        process.terminate()
        process.communicate()


@contextmanager
def beside_a_campaign() -> Iterator[None]:
    """Run a campaign with as many workers as there are cores."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "beside.yaml"
        file.write_text(json.dumps(CAMPAIGN))
        jobs = str(os.cpu_count())
        with begun("campaign", str(file), "--jobs", jobs, "--out", folder, "--quiet"):
            time.sleep(15.0)
            yield


def saved(folder: Path) -> str:
    """Return what the record of a folder says."""
    return Result.load(folder).status if (folder / "run.json").is_file() else "none"


def main() -> None:
    """Read the options and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--processes", action="store_true", help="two processes over LCM")
    parser.add_argument("--tries", type=int, default=0, help="drives without faults, over LCM")
    parser.add_argument("--beside", action="store_true", help="a campaign runs meanwhile")
    parser.add_argument("--repeats", type=int, default=1, help="of each fault")
    parser.add_argument("--url", default="udpm://239.255.76.67:7790?ttl=0")
    parser.add_argument("--late", type=float, default=0.1, help="silence and lateness [s]")
    asked = parser.parse_args()
    if asked.tries:
        with beside_a_campaign() if asked.beside else nullcontext():
            in_tries(asked.url, asked.tries, asked.late)
    elif asked.processes:
        in_processes(asked.url, asked.repeats, asked.late)
        print(f"\nload of the machine {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    else:
        in_lock_step()


if __name__ == "__main__":
    main()
