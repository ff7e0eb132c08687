"""An FR3 by the manufacturer's bindings, read and answered once in each cycle."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pylibfranka import ControllerMode, JointPositions, RealtimeConfig, Robot, RobotMode, RobotState

from .pacer import State

#: Is there where the kernel is a real-time one.
REALTIME = Path("/sys/kernel/realtime")


class Franka:
    """A `drake_rnn.drive.pacer.PacedRobot` in joint position mode.

    If the robot stands still after an error, that is acknowledged.

    Args:
        address: Name or IP address of the robot.
    """

    def __init__(self, address: str) -> None:
        kind = RealtimeConfig.kEnforce if REALTIME.exists() else RealtimeConfig.kIgnore
        self._robot = Robot(address, kind)
        if self._robot.read_once().robot_mode == RobotMode.Reflex:
            self._robot.automatic_error_recovery()

    def look(self) -> State:
        """See `PacedRobot.look`."""
        return _state(self._robot.read_once())

    def begin(self) -> None:
        """See `PacedRobot.begin`."""
        self._control = self._robot.start_joint_position_control(ControllerMode.JointImpedance)

    def read(self) -> State:
        """See `PacedRobot.read`."""
        state, _ = self._control.readOnce()
        return _state(state)

    def answer(self, position: Sequence[float], is_last: bool) -> None:
        """See `PacedRobot.answer`."""
        command = JointPositions(position)
        command.motion_finished = is_last
        self._control.writeOnce(command)


def _state(state: RobotState) -> State:
    return State(
        state.time.to_sec(), state.q, state.dq, state.q_d, state.control_command_success_rate
    )
