"""The plug-in of LeRobot and the node of ROS 2, beside stand-ins of what they are made for."""

import sys
import time
from dataclasses import dataclass, field
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from drake_rnn import Shield, load_arm
from process_helpers import wait_for

EXAMPLES, ARM = Path(__file__).parents[2] / "examples", load_arm("planar6")
NAMES = [f"motor{k}" for k in range(ARM.n)]


def imported(file, monkeypatch, **modules):
    """An example, which imports stand-ins in place of some modules."""
    for name, contents in modules.items():
        module = ModuleType(name.replace("__", "."))
        vars(module).update(contents)
        monkeypatch.setitem(sys.modules, name.replace("__", "."), module)
    spec = spec_from_file_location(file.stem + "_example", file)
    module = module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    return module


class Motors:
    """A robot of LeRobot, whose motors are where they are told, in degrees."""

    def __init__(self):
        self.action_features = {f"{n}.pos": float for n in (*NAMES, "gripper")}
        self.observation_features = self.action_features
        self.is_connected, self.is_calibrated = False, True
        self.now = dict(zip(self.action_features, [*np.rad2deg(ARM.home), 3.0], strict=True))
        self.taken = []

    def connect(self, calibrate):
        self.is_connected = True

    def disconnect(self):
        self.is_connected = False

    def get_observation(self):
        return dict(self.now)

    def send_action(self, action):
        self.now.update({key: action[key] for key in self.now})
        self.taken.append((time.monotonic(), [self.now[key] for key in self.now], action))


@pytest.fixture
def plug_in(monkeypatch):
    class RobotConfig:
        @staticmethod
        def register_subclass(name):
            assert name == "shielded"
            return lambda kind: kind

    class Robot:
        def __init__(self, config):
            pass

    file = EXAMPLES / "lerobot_robot_shielded" / "lerobot_robot_shielded" / "__init__.py"
    return imported(
        file,
        monkeypatch,
        lerobot={},
        lerobot__robots={"Robot": Robot, "RobotConfig": RobotConfig},
        lerobot__robots__utils={"make_robot_from_config": lambda config: config},
    )


def test_a_robot_of_lerobot_gets_commands_within_bounds_while_its_policy_stalls(plug_in):
    motors = Motors()
    config = plug_in.ShieldedConfig(robot=motors, arm="planar6", rate=100.0, jerk=80.0)
    robot = plug_in.Shielded(config)
    with pytest.raises(ConnectionError, match="connect must be called before send_action"):
        robot.send_action({})
    robot.connect()
    # Before an action the gripper is told to stay where it is.
    assert wait_for(lambda: motors.taken)
    assert motors.taken[0][2]["gripper.pos"] == 3.0
    goal = [*np.rad2deg(np.asarray(ARM.home) + 0.2), 7.0]
    action = dict(zip(motors.action_features, goal, strict=True))
    robot.send_action(action)

    # One action alone: the policy stalls.
    def is_there():
        return np.abs(np.array(list(motors.now.values())) - goal).max() < 0.1

    assert wait_for(is_there)
    assert motors.taken[-1][2]["gripper.pos"] == 7.0
    assert robot.status.behind < 0.01
    robot.disconnect()
    assert not motors.is_connected
    q = np.deg2rad([each[:-1] for _, each, _ in motors.taken])
    v = np.diff(q, axis=0, prepend=[ARM.home]) / 0.01
    assert np.abs(v).max() <= 1.0 + 1e-9
    assert np.abs(np.diff(v, axis=0)).max() <= 5.0 * 0.01 * (1.0 + 1e-6)
    with pytest.raises(ValueError, match="joints: must be 6 motors of motor0"):
        plug_in.Shielded(plug_in.ShieldedConfig(robot=motors, arm="planar6", joints=["wrist"]))


def test_motors_with_the_names_of_joints_are_theirs_in_any_order(plug_in):
    motors = Motors()
    names = [*ARM.joints[::-1], "gripper"]
    motors.action_features = {f"{name}.pos": float for name in names}
    robot = plug_in.Shielded(plug_in.ShieldedConfig(robot=motors, arm="planar6"))
    assert robot.joints == list(ARM.joints)
    seen = {f"{name}.pos": float(k) for k, name in enumerate(ARM.joints)}
    np.testing.assert_allclose(robot._posture(seen), np.deg2rad(np.arange(ARM.n)))
    del motors.action_features[f"{ARM.joints[2]}.pos"]
    with pytest.raises(ValueError, match="joints: must be 6 motors of"):
        plug_in.Shielded(plug_in.ShieldedConfig(robot=motors, arm="planar6"))


@dataclass
class Message:
    """Any message of ROS 2."""

    header: object = field(default_factory=lambda: SimpleNamespace(stamp=stamp(0.0)))
    name: list = field(default_factory=list)
    data: str = ""


def stamp(seconds):
    return SimpleNamespace(sec=int(seconds), nanosec=round(1e9 * (seconds % 1.0)))


class Node:
    """A node, whose messages are kept."""

    def __init__(self, name):
        self.published, self.errors = [], []

    def create_publisher(self, kind, topic, depth):
        return SimpleNamespace(publish=lambda message: self.published.append((topic, message)))

    def create_subscription(self, kind, topic, follow, depth):
        self.receive = follow

    def create_timer(self, period, function):
        self.tick = function

    def get_logger(self):
        return SimpleNamespace(error=self.errors.append)

    def get_clock(self):
        now = SimpleNamespace(to_msg=lambda: stamp(time.time()))
        return SimpleNamespace(now=lambda: now)


@pytest.mark.long
def test_a_node_of_ros_2_follows_trajectories_of_a_clock_since_1970(monkeypatch):
    example = imported(
        EXAMPLES / "ros2_shield" / "shield_node.py",
        monkeypatch,
        rclpy={},
        rclpy__node={"Node": Node},
        sensor_msgs={},
        sensor_msgs__msg={"JointState": Message},
        std_msgs={},
        std_msgs__msg={"String": Message},
        trajectory_msgs={},
        trajectory_msgs__msg={"JointTrajectory": Message},
    )
    limits, home = ARM.limits.replace(velocity=1.0, acceleration=5.0, jerk=100.0), ARM.home

    def trajectory(names, begin):
        points = [
            SimpleNamespace(
                positions=[x + 0.05 * k for x in reversed(home)], time_from_start=stamp(0.1 * k)
            )
            for k in range(5)
        ]
        header = SimpleNamespace(stamp=stamp(begin))
        return SimpleNamespace(joint_names=names, points=points, header=header)

    with Shield(ARM, 0.01, limits=limits, collisions=False, process=True) as shield:
        node = example.ShieldNode(shield)
        backwards = list(reversed(ARM.joints))
        for begin in (time.time(), 0.0):
            node.receive(trajectory(backwards, begin))
            assert wait_for(lambda: np.abs(shield.position - home - 0.2).max() < 1e-3)
        assert wait_for(lambda: shield.status.arrived == 2)
        assert not node.errors
        node.receive(trajectory(["wheel"], 0.0))
        assert node.errors[0].startswith("trajectory refused: ")
        assert node.errors[0].endswith(" is not in list")
        node.tick()
        topic, message = node.published[0]
        assert topic == "command"
        np.testing.assert_allclose(message.position, home + 0.2, atol=1e-3)
        assert message.name == list(ARM.joints)
