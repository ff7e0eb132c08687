"""franka-sim as a robot on a computer of its own: in its own environment, with both its rules."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

HOST, PORT = "127.0.0.1", 1337
#: Scheduling priority and core of the robot, which has a computer of its own in reality.
PRIORITY, CORE = 60, 0
# Time that it may take to come up [s].
_STARTS = 20.0


def _apart() -> None:
    """Give this process a core and a priority, where the system lets it."""
    os.sched_setaffinity(0, {CORE})
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except PermissionError:
        return


class Server:
    """A franka-sim server, whose model follows its commands; see `fr3_model.py`.

    Args:
        python: A Python that has franka-sim.
        folder: Folder for the model and the log.
    """

    def __init__(self, python: str, folder: Path) -> None:
        self._python, self.log = python, folder / "franka_sim.log"
        self._model = folder / "fr3.xml"
        script = Path(__file__).with_name("fr3_model.py")
        subprocess.run([python, script, self._model], check=True)
        self._process: subprocess.Popen | None = None
        self.start()

    def start(self) -> None:
        """Start it, and wait until it listens."""
        rules = ("--enforce-motion-limits", "--enforce-comm-constraints")
        line = [self._python, "-m", "franka_sim.run_server", "--no-gripper", *rules]
        with self.log.open("a") as log:
            self._process = subprocess.Popen(
                line,
                env=os.environ | {"FR3_MJCF": str(self._model)},
                stdout=log,
                stderr=log,
                preexec_fn=_apart,
            )
        until = time.monotonic() + _STARTS
        while time.monotonic() < until:
            if self._process.poll() is not None:
                sys.exit(f"franka-sim: {self.log.read_text()[-400:]}")
            if not _is_free():
                return
            time.sleep(0.1)
        sys.exit("franka-sim: does not listen")

    def kill(self) -> None:
        """Kill it."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def complaints(self) -> list[str]:
        """Return what it has aborted motions for, since the start."""
        lines = self.log.read_text().splitlines()
        return [line for line in lines if "aborting the motion" in line]


def _is_free() -> bool:
    """Return whether nothing listens at the port, without a connection."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("0.0.0.0", PORT))
        except OSError:
            return False
        return True


@contextmanager
def served(python: str) -> Iterator[Server]:
    """Run a server, and have this process use the other cores."""
    if not _is_free():
        sys.exit(f"port {PORT} is in use; end what listens there")
    before = os.sched_getaffinity(0)
    with tempfile.TemporaryDirectory() as folder:
        server = Server(python, Path(folder))
        os.sched_setaffinity(0, before - {CORE} or before)
        try:
            yield server
        finally:
            server.kill()
            os.sched_setaffinity(0, before)
