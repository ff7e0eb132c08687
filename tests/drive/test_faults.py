"""Messages that are late, lost or overtaken."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError
from drake_rnn.drive import Faults
from drake_rnn.drive.iiwa_lcm import Wire


def through(faults, count=2000, seed=0):
    """Number and time of each message that arrives, of one every 5 ms."""
    wire, found = Wire(faults, (seed,)), []
    for k in range(count * 5 + 100):
        if k % 5 == 0 and k < count * 5:
            wire.put(k * 1e-3, str(k).encode())
        found += [(int(data), k) for data in wire.take(k * 1e-3)]
    return np.array(found)


def test_a_wire_without_faults_is_at_once():
    sent, came = through(Faults()).T
    np.testing.assert_array_equal(sent, came)
    assert sent.size == 2000


def test_messages_are_late_lost_and_overtaken_as_often_as_asked():
    sent, came = through(Faults(delay=0.02)).T
    np.testing.assert_array_equal(came - sent, 20)
    sent, _ = through(Faults(loss=0.1)).T
    assert 1740 < sent.size < 1860
    sent, _ = through(Faults(reorder=0.1)).T
    assert sent.size == 2000
    assert 140 < (np.diff(sent) < 0).sum() < 260
    np.testing.assert_array_equal(through(Faults(loss=0.1)), through(Faults(loss=0.1)))


def test_shares_are_shares():
    with pytest.raises(InvalidInputError, match="loss"):
        Faults(loss=1.5)
