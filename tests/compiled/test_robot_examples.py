"""The examples for loops of robots, built with stand-ins for the robots' libraries, and run."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from drake_rnn import load_experiment
from drake_rnn.law_files import write_law

pytest.importorskip("jax")
CXX = next((path for name in ("c++", "g++", "clang++") if (path := shutil.which(name))), None)
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(
        CXX is None or shutil.which("cmake") is None, reason="needs CMake and a compiler of C++"
    ),
]

EXAMPLES = Path(__file__).parents[2] / "examples"
STAND_INS = Path(__file__).parent / "stand_ins"
SAMPLES, STILL, PERIOD = 3000, 25, 1e-3
# Bounds of the acceleration and of the jerk [rad/s^2, rad/s^3].
ACCELERATION, JERK = 10.0, 5000.0
ROS = ("controller_interface", "hardware_interface", "pluginlib", "rclcpp", "rclcpp_lifecycle")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("law")
    write_law("adaptive_fr3", place, samples=SAMPLES)
    return place


@pytest.fixture(scope="module")
def vector(folder):
    """Positions given to NumPy's steps with Drake's kinematics, and velocities of these steps."""
    texts = (folder / "vector.h").read_text().split("[SAMPLES] = ")[1:]
    numbers = [re.findall(r"-?\d+\.?\d*(?:e[-+]?\d+)?", text) for text in texts]
    given, made = (np.array(each, dtype=float).reshape(SAMPLES, -1) for each in numbers)
    return given[:, :7], made[:, -7:]


@pytest.fixture(scope="module")
def expected(vector):
    return vector[1]


@pytest.fixture(scope="module")
def start(vector):
    return vector[0][0]


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """A folder in which CMake finds the stand-ins as packages."""
    place = tmp_path_factory.mktemp("packages")
    for name in (*ROS, "Franka"):
        (place / f"{name}Config.cmake").write_text(
            f"add_library({name}::{name} INTERFACE IMPORTED)\n"
            f'target_include_directories({name}::{name} INTERFACE "{STAND_INS}")\n'
        )
    (place / "ament_cmakeConfig.cmake").write_text(
        "function(pluginlib_export_plugin_description_file)\nendfunction()\n"
        "function(ament_package)\nendfunction()\n"
    )
    return place


def build(name, folder, packages, place):
    """Return the folder in which an example has been built, without a warning."""
    configure = ["cmake", "-S", EXAMPLES / name, "-B", place, f"-DLAW={folder}"]
    found = [f"-D{each}_DIR={packages}" for each in (*ROS, "Franka", "ament_cmake")]
    options = ["-DCMAKE_CXX_FLAGS=-Werror", "-DCMAKE_C_FLAGS_RELEASE=-O0", "--no-warn-unused-cli"]
    for command in ([*configure, *found, *options], ["cmake", "--build", place]):
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stdout + run.stderr
    return place


@pytest.fixture(scope="module")
def franka(folder, packages, tmp_path_factory):
    place = build("libfranka", folder, packages, tmp_path_factory.mktemp("franka"))
    return place / "compiled_franka"


@pytest.fixture(scope="module")
def controller(folder, packages, tmp_path_factory):
    place = build("ros2_control", folder, packages, tmp_path_factory.mktemp("ros2"))
    program = place / "run_controller"
    includes = [f"-I{each}" for each in (STAND_INS, folder)]
    library = next(place.glob("libcompiled_law_controller.*"))
    files = [STAND_INS / "run_controller.cpp", library, f"-Wl,-rpath,{place}"]
    # The start of the law is in the library of the law.
    command = [CXX, "-std=c++17", *includes, "-o", program, *files, *place.glob("law/liblaw.*")]
    subprocess.run([*command, "-lm"], check=True, capture_output=True, text=True)
    return program


def check_limits(velocities, start):
    """The law's limits hold from rest to rest, whatever was lost."""
    arm = load_experiment("adaptive_fr3").arm
    accelerations = np.diff(velocities, axis=0, prepend=0.0) / PERIOD
    jerks = np.diff(accelerations, axis=0, prepend=0.0) / PERIOD
    assert np.all(np.abs(velocities) <= arm.limits.velocity + 1e-9)
    assert np.abs(accelerations).max() <= ACCELERATION
    assert np.abs(jerks).max() <= JERK + 1e-6
    positions = start + PERIOD * velocities.cumsum(axis=0)
    assert np.all(positions <= arm.limits.position_upper)
    assert np.all(positions >= arm.limits.position_lower)
    assert not velocities[-STILL:].any()


def check_steps(velocities, expected):
    assert not velocities[:STILL].any()
    assert np.abs(velocities[STILL : STILL + SAMPLES] - expected).max() <= 1e-9


def test_the_callback_of_libfranka_makes_the_steps_of_numpy(franka, expected, start, tmp_path):
    trace = tmp_path / "trace"
    subprocess.run([franka, trace, "3"], check=True, timeout=60)
    velocities = np.loadtxt(trace)
    # The reference slows down within a second.
    assert len(velocities) < SAMPLES + 2000
    check_steps(velocities, expected)
    check_limits(velocities, start)


def test_lost_cycles_of_a_franka_break_no_limit(franka, expected, start, tmp_path):
    trace = tmp_path / "trace"
    subprocess.run([franka, f"lossy:{trace}", "3"], check=True, timeout=60)
    velocities = np.loadtxt(trace)
    check_limits(velocities, start)
    # Cycle 1000 was the last before the loss; in the next three the acceleration went on.
    accelerations = np.diff(velocities[999:1005], axis=0) / PERIOD
    assert np.allclose(accelerations[1:4], accelerations[0], atol=1e-6)
    assert not np.allclose(accelerations[4], accelerations[0], atol=1e-6)
    # Some time later it is where it would have been.
    assert np.abs(velocities[2500:2900] - expected[2500 - STILL : 2900 - STILL]).max() < 1e-3


def test_a_franka_that_does_not_follow_is_stopped(franka, start, tmp_path):
    trace = tmp_path / "blocked"
    subprocess.run([franka, trace, "3"], check=True, timeout=60)
    velocities = np.loadtxt(trace)
    assert len(velocities) < 1000
    check_limits(velocities, start)
    assert 0.05 < np.abs(PERIOD * velocities.sum(axis=0)).max() < 0.3


def test_a_franka_that_cannot_be_had_is_told(franka, tmp_path):
    command = [franka, tmp_path / "none" / "trace"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (1, "no connection\n")
    assert subprocess.run([franka], capture_output=True, check=False).returncode == 2


@pytest.mark.parametrize("lost", [0, 1])
def test_the_controller_makes_the_steps_of_numpy(controller, expected, start, lost):
    joints = load_experiment("adaptive_fr3").arm.joints
    command = [controller, "3", str(lost), *joints]
    run = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    velocities = np.array([line.split() for line in run.stdout.splitlines()], dtype=float)
    if not lost:
        check_steps(velocities, expected)
        check_limits(velocities, start)
    assert not velocities[-STILL:].any()


def test_the_controller_refuses_other_joints(controller):
    run = subprocess.run([controller, "3", "0", "a"], capture_output=True, text=True, check=False)
    assert run.returncode == 4
    assert "joints: the law has 7" in run.stdout


def test_the_controller_refuses_joints_in_another_order_than_the_law(controller):
    joints = list(load_experiment("adaptive_fr3").arm.joints)
    joints[2:4] = joints[3:1:-1]
    command = [controller, "3", "0", *joints]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 4
    assert f"joints: {joints[2]} is number 4 of the law, and 3 here" in run.stdout
