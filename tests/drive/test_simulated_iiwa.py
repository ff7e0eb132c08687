"""The simulated iiwa behind Drake's messages, in lock step within this process."""

import numpy as np
import pytest
from drake import lcmt_iiwa_command, lcmt_iiwa_status
from drive_helpers import derivatives, known, simulated
from pydrake.lcm import DrakeLcm

from drake_rnn.drive import IIWA, Command, Faults, IiwaLcm, Motion, drive_experiment
from drake_rnn.drive.iiwa_lcm import COMMAND, encoded_command, open_lcm
from drake_rnn.errors import RobotError


def path_errors(result, since):
    """RMS and largest error [m] of what was measured and of what was commanded."""
    kinematics = result.experiment.arm.kinematics()
    late = result.time >= since
    found = []
    for name in ("position", "position_commanded"):
        p = np.array([kinematics.p_WE(q) for q in result.series[name][late]])
        error = np.linalg.norm(p - result.series["p_WE_desired"][late], axis=1)
        found.append((np.sqrt((error**2).mean()), error.max()))
    return found


def resting(position, time):
    return Command(time, Motion(position, np.zeros(7), np.zeros(7)), IIWA.command_limits)


def test_it_stands_until_it_is_commanded_and_then_goes_there():
    connection, robot = simulated(known())
    first = connection.next(0.1)
    assert robot.time < 0.02
    np.testing.assert_allclose(first.position, known().start, atol=1e-9)
    target = known().start + 0.05
    times = [first.time]
    for _ in range(200):
        times.append((status := connection.next(0.1)).time)
        connection.send(resting(target, status.time))
    np.testing.assert_allclose(np.diff(times), IIWA.period, atol=1.1e-6)
    np.testing.assert_allclose(status.commanded, target, atol=1e-12)
    np.testing.assert_allclose(status.position, target, atol=2e-3)
    assert connection.others() == 0


def test_of_messages_that_come_together_all_are_returned():
    lcm = DrakeLcm("memq://")
    connection = IiwaLcm(lcm)
    for time in (3000, 1000, 2000):
        message = lcmt_iiwa_status()
        message.utime = time
        lcm.Publish("IIWA_STATUS", message.encode())
    while lcm.HandleSubscriptions(0):
        pass
    newest = connection.next(0.1)
    assert newest.time == pytest.approx(3e-3)
    assert [each.time for each in newest.earlier] == pytest.approx([1e-3, 2e-3])


def test_messages_are_those_of_the_driver_and_others_are_noticed():
    lcm = DrakeLcm("memq://")
    connection = IiwaLcm(lcm, now=lambda: 0.0)
    message = lcmt_iiwa_command.decode(encoded_command(np.arange(7.0), 1.25))
    assert (message.utime, message.num_joints, message.num_torques) == (1_250_000, 7, 0)
    assert list(message.joint_position) == list(range(7))
    connection.send(resting(np.zeros(7), 0.0))
    lcm.Publish(COMMAND, encoded_command(np.zeros(7), 0.0))
    lcm.HandleSubscriptions(0)
    assert connection.others() == 1
    assert open_lcm("memq://") is not None
    with pytest.raises(RobotError, match="must begin with udpm:// or memq://, not be 'nonsense'"):
        open_lcm("nonsense")


@pytest.mark.long
def test_a_limit_stop_is_noticed_by_the_lag():
    connection, _ = simulated(known(), faults=Faults(deaf=np.inf, at=0.4))
    result, driven = drive_experiment(known(), IIWA, connection)
    assert driven.stopped.watch == "lag"
    assert result.status == "failed"
    assert derivatives(driven.log, "run")[1] <= 1.0 + 1e-4


@pytest.mark.long
def test_an_experiment_is_followed_as_in_simulation():
    experiment = known(10.0)
    connection, _ = simulated(experiment, off=0.1)
    result, driven = drive_experiment(experiment, IIWA, connection)
    (measured_rms, measured_max), (commanded_rms, commanded_max) = path_errors(result, 5.0)
    assert measured_max <= 2e-3
    # The same law at level: kinematic: 0.29 and 0.51 mm.
    assert commanded_rms == pytest.approx(0.29e-3, rel=0.1)
    assert commanded_max == pytest.approx(0.51e-3, rel=0.1)
    assert measured_rms <= 1e-3
    approach = driven.log.of("approach")["position_sent"]
    assert np.abs(approach[-1] - experiment.start).max() <= 1e-6
    # Its motors take it beyond limits, which is told; its command is not.
    (told,) = (text for text in result.warnings if text.startswith("measured: "))
    assert told.endswith("of what it was commanded: ran to its end: no criteria; limits kept")
    # Straight after it, the second run starts as well as the first.
    again, _ = drive_experiment(experiment, IIWA, connection)
    np.testing.assert_allclose(path_errors(again, 5.0)[1], path_errors(result, 5.0)[1], rtol=0.01)


SUDDEN = {
    "silence": {"silence": 0.6},
    "stall": {"stall": 0.6},
    "clock": {"clock": 5.0},
    "clock back": {"clock": -5.0},
    "status": {"nan": True},
    "limits": {"beyond": True},
    "lag": {"deaf": np.inf},
}


@pytest.mark.long
@pytest.mark.parametrize("name", SUDDEN)
def test_every_fault_ends_at_rest(name):
    connection, robot = simulated(known(), faults=Faults(at=0.4, **SUDDEN[name]))
    result, driven = drive_experiment(known(), IIWA, connection)
    assert driven.stopped.watch == {"stall": "silence", "clock back": "clock"}.get(name, name)
    assert driven.rested <= 0.6
    assert result.status == "failed"
    assert derivatives(driven.log, "run")[1] <= 1.0 + 1e-4
    for _ in range(1200):
        robot.step()
    status = connection.next(0.1)
    assert np.abs(status.velocity).max() < 1e-2


@pytest.mark.long
@pytest.mark.parametrize("share", ["loss", "reorder"])
def test_lost_and_overtaken_messages_cost_accuracy_but_no_bound(share):
    experiment = known(10.0)
    connection, _ = simulated(experiment, faults=Faults(**{share: 0.05}))
    result, driven = drive_experiment(experiment, IIWA, connection)
    assert driven.stopped is None
    assert derivatives(driven.log, "run")[1] <= 1.0 + 1e-4
    assert path_errors(result, 5.0)[0][1] <= 6e-3
