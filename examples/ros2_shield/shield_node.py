"""A ROS 2 node around a shield, whose commands come from a process of their own.

It follows ``trajectory_msgs/JointTrajectory`` on the topic ``targets``, whose time stamps are those
of the sender's clock; a stamp of zero means now. It publishes what is commanded as
``sensor_msgs/JointState`` on ``command``, and what limits the arm as a text on ``limited_by``. If
the shield's process is late, commands go on along the certified stop of its last one.

    pip install drake-rnn ros-rclpy ros-rmw-fastrtps-cpp ros-trajectory-msgs ros-sensor-msgs
    python shield_node.py panda
"""

import sys
import time

import numpy as np
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from drake_rnn import CommandReader, InvalidInputError, Shield, load_arm

PERIOD, PUBLISHED = 5e-3, 0.01


class ShieldNode(Node):
    """The node.

    Args:
        shield: A shield in a process of its own.
    """

    def __init__(self, shield):
        super().__init__("shield")
        self._shield, self._reader = shield, CommandReader(shield.path)
        # Times of a regular clock, whenever the timer comes.
        self._time = time.monotonic()
        self._command = self.create_publisher(JointState, "command", 10)
        self._limited = self.create_publisher(String, "limited_by", 10)
        self.create_subscription(JointTrajectory, "targets", self._follow, 10)
        self.create_timer(PUBLISHED, self._publish)

    def _follow(self, message):
        try:
            order = [message.joint_names.index(name) for name in self._shield.arm.joints]
            rows = np.array([point.positions for point in message.points])[:, order]
            times = np.array([_seconds(point.time_from_start) for point in message.points])
            stamp = _seconds(message.header.stamp)
            clock = {"sent": stamp} if stamp else {}
            begin = stamp or time.monotonic()
            self._shield.follow_positions(rows, times=begin + times, **clock)
        except (InvalidInputError, ValueError, IndexError) as error:
            self.get_logger().error(f"trajectory refused: {error}")

    def _publish(self):
        self._time += PUBLISHED * max((time.monotonic() - self._time) // PUBLISHED, 0.0)
        command = self._reader.at(self._time)
        message = JointState(name=list(self._shield.arm.joints))
        message.header.stamp = self.get_clock().now().to_msg()
        message.position = self._reader.position_at(self._time).tolist()
        message.velocity = command.velocity.tolist()
        self._command.publish(message)
        if command.number % 10 == 0:
            self._limited.publish(String(data=", ".join(self._shield.status.limited_by)))


def _seconds(stamp):
    return stamp.sec + 1e-9 * stamp.nanosec


def main():
    """Run the node for an arm, by its name."""
    arm = load_arm(sys.argv[1] if len(sys.argv) > 1 else "panda")
    limits = arm.limits.replace(velocity=1.0, acceleration=5.0, jerk=100.0)
    rclpy.init()
    with Shield(arm, PERIOD, limits=limits, process=True) as shield:
        rclpy.spin(ShieldNode(shield))


if __name__ == "__main__":
    main()
