"""The example that leads from a policy to an FR3, with a robot that judges what it is sent."""

import importlib.util
import os
import re
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from fr3_stand_in import H, StandIn

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "policy_to_fr3.py"
PORT = 1337
HAS_JAX = importlib.util.find_spec("jax") and shutil.which("cc")


class Robot(StandIn):
    """One whose lost cycles take their time."""

    def _go_on(self):
        super()._go_on()
        self.due += H


def assert_it_ends(said):
    """At its end, without a reflex, and the arm not far off what is commanded."""
    assert "ended by: its end, no reflex" in said
    assert float(re.search(r"error of a joint: (\S+) rad", said)[1]) < 0.02


@pytest.mark.long
@pytest.mark.skipif(not HAS_JAX, reason="needs JAX and a C compiler")
def test_a_robot_that_judges_takes_the_commands_of_a_policy(monkeypatch, capsys):
    """It aborts at the first command that breaks one of its limits, after lost cycles too."""
    monkeypatch.syspath_prepend(str(EXAMPLE.parent))
    import policy_to_fr3

    policy_to_fr3.main(Robot, "lose=700:5", seconds=1.5)
    said = capsys.readouterr().out
    assert_it_ends(said)
    assert "of which the robot lost 5" in said


@pytest.mark.nightly
def test_franka_sim_takes_the_commands_of_a_policy(tmp_path):
    server = shutil.which("run-franka-sim-server")
    if server is None or importlib.util.find_spec("pylibfranka") is None:
        pytest.skip("needs run-franka-sim-server of franka-sim in PATH, and pylibfranka")
    python, model = Path(server).with_name("python"), tmp_path / "fr3.xml"
    subprocess.run([python, ROOT / "benchmarks" / "fr3_model.py", model], check=True)
    rules = ("--no-gripper", "--enforce-motion-limits", "--enforce-comm-constraints")
    environment = os.environ | {"FR3_MJCF": str(model)}
    with (tmp_path / "log").open("w") as log:
        robot = subprocess.Popen([server, *rules], env=environment, stdout=log, stderr=log)
    try:
        _wait_for_port(robot)
        line = [sys.executable, EXAMPLE, "127.0.0.1"]
        run = subprocess.run(line, capture_output=True, text=True, timeout=200, check=True)
    finally:
        robot.kill()
        robot.wait()
    assert_it_ends(run.stdout)


def _wait_for_port(robot):
    until = time.monotonic() + 30.0
    while time.monotonic() < until and robot.poll() is None:
        with socket.socket() as probe:
            try:
                probe.bind(("0.0.0.0", PORT))
            except OSError:
                return
        time.sleep(0.1)
    pytest.fail("franka-sim does not listen")
