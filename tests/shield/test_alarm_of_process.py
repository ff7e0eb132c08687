"""What a shield's process tells of an arm that does not get on, and that has arrived."""

from functools import partial

import numpy as np
import pytest

from drake_rnn import Shield, ShieldSettings, load_arm
from process_helpers import wait_for

ARM = load_arm("planar6")
HOME = np.asarray(ARM.home)
LIMITS = ARM.limits.replace(velocity=1.0, acceleration=5.0, jerk=100.0)
#: Where the tool gets with the first joint turned.
TURN = 0.8 * np.eye(ARM.n)[0]
BALL = {
    "kind": "ball",
    "name": "post",
    "center": ARM.kinematics().p_WE(HOME + TURN).tolist(),
    "radius": 0.05,
}


def note(file, status):
    """Write what is told of a blockage into a file."""
    with open(file, "a") as stream:
        stream.write(f"{status.blocked_for:.3f} {'; '.join(status.limited_by)}\n")


@pytest.mark.long
def test_a_process_calls_back_names_the_pair_and_tells_when_its_arm_has_arrived(tmp_path):
    """As a shield without one does; by a function that the process calls."""
    file, settings = tmp_path / "told", ShieldSettings(compiled=False)
    options = {"limits": LIMITS, "obstacles": [BALL], "on_blocked": partial(note, file)}
    with Shield(ARM, 0.02, settings, process=True, **options) as shield:
        shield.follow_positions(HOME + 1.5 * TURN)
        assert wait_for(lambda: file.exists() and file.read_text().endswith("\n"))
        blocked, pairs = file.read_text().partition("\n")[0].split(" ", 1)
        assert 0.3 <= float(blocked) < 0.4
        assert "post" in pairs
        assert wait_for(lambda: shield.status.blocked_for > 1.0)
        status = shield.status
        assert any("post" in name for name in status.limited_by)
        assert status.arrived == 0
        number = shield.follow_positions(HOME - 0.1)
        assert wait_for(lambda: shield.status.arrived == number == 2)
        assert np.abs(shield.position - HOME + 0.1).max() < 2e-3
        assert shield.status.blocked_for == 0.0
