"""When a robot is stopped, and how it is brought to the start."""

from __future__ import annotations

from typing import Annotated

from ..inputs.fields import NonNegative, Positive, Time, between, validated

Share = Annotated[Positive, between(0.01, 1.0)]


@validated
class DriveSettings:
    """What a drive waits for, tolerates and moves to its start with.

    Args:
        contact: Time to wait for a first status [s].
        listen: Time for which the robot is listened to before a first command, and must stand
            still [s]; drake-iiwa-driver gives up if commanded within a quarter of a second.
        still: Speed below which a joint stands still [rad/s].
        silence: Time without a status after which the robot is stopped [s].
        late: Time that the robot's clock may pass between two cycles, on either side's account,
            before the robot is stopped [s].
        lag: Distance of a joint from its command at which the robot is stopped [rad].
        jump: Distance that a measured joint may jump beyond what its largest speed explains [rad].
        hold: Time without a command after which the robot has stopped by itself, so that it is
            told to stay where it was commanded to be last [s].
        approach_velocity: Largest speed of a joint on the way to the start [rad/s].
        approach_acceleration: Largest acceleration on that way [rad/s^2].
        approach_jerk: Largest jerk on that way [rad/s^3].
        approach_time: Time that the way to the start may take [s].
    """

    contact: Time = 5.0
    listen: Annotated[Time, between(0.3, 60.0)] = 0.5
    still: Positive = 0.02
    silence: Time = 0.1
    late: Time = 0.1
    lag: Positive = 0.1
    jump: NonNegative = 0.02
    hold: Time = 0.1
    approach_velocity: Positive = 0.3
    approach_acceleration: Positive = 0.5
    approach_jerk: Positive = 5.0
    approach_time: Time = 120.0
