"""`drake-rnn shield` of a stream of two arms: their shield commands what it is given by name."""

import json

import numpy as np
import pytest
from cli_helpers import call, sentence

from drake_rnn import DualArmShield, ShieldSettings, load_arm

BASE = {"translation": [1.1, 0.0, 0.0], "rpy": [0.0, 0.0, 3.14]}
PAIR = f"arm.pair={{arm: panda, base: {BASE}}}".replace("'", "")
LIMITS = {"velocity": 0.8, "acceleration": 4.0, "jerk": 100.0}
PERIOD = 0.02


def written(file, columns):
    """Write a file of columns by their names."""
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(map(repr, map(float, row))) for row in rows]
    file.write_text("\n".join([",".join(columns), *lines]) + "\n")
    return file


def shielded(file, place, *options):
    given = ("--set", PAIR, "--set", f"limits={LIMITS}".replace("'", ""), "--period", PERIOD)
    return call("shield", file, "--arm", "panda", "--out", place, *given, *options)


def test_each_arm_follows_its_own_columns_of_its_own_kind(tmp_path):
    """The left one joint positions, the right one twists, as behind a shield in Python."""
    t = np.arange(0.0, 0.6, 0.05)
    arm = load_arm("panda", pair={"arm": "panda", "base": BASE})
    turn = arm.home[:7] + 0.4 * np.sin(2.0 * t)[:, None] * np.eye(7)[0]
    rise = np.outer(np.ones(len(t)), [0.0, 0.0, 0.0, 0.0, 0.0, 0.05])
    columns = {"t": t, **{f"left/q{k + 1}": turn[:, k] for k in range(7)}}
    names = ("wx", "wy", "wz", "vx", "vy", "vz")
    columns |= {f"right/{name}": rise[:, k] for k, name in enumerate(names)}
    file = written(tmp_path / "two.csv", columns)
    result = shielded(file, tmp_path, "--set", "shield.yields=left")
    assert result.exit_code == 0, result.stderr
    commands = np.loadtxt(tmp_path / "two" / "commands.csv", delimiter=",", skiprows=1)
    limits, settings = arm.limits.replace(**LIMITS), ShieldSettings(compiled=False)
    shield = DualArmShield(arm, PERIOD, settings, yields="left", limits=limits)
    coming = list(zip(t, turn, rise, strict=True))
    for now, *q in commands.tolist():
        while coming and coming[0][0] <= now + 1e-9:
            start, posture, V_WE = coming.pop(0)
            shield["left"].follow_positions(posture, start=start, t=now)
            shield["right"].follow_twists(V_WE, start=start, t=now)
        np.testing.assert_array_equal(shield.command(now), q)
    assert not coming
    report = json.loads((tmp_path / "two" / "stream.json").read_text())
    assert [report["arms"][name]["kind"] for name in ("left", "right")] == ["positions", "twists"]
    assert report["command_nearest"]["distance"] > 0.005
    assert not any(use["is_broken"] for own in report["arms"].values() for use in own["command"])
    np.testing.assert_allclose(commands[-1, 1], turn[-1, 0], atol=2e-3)
    kinematics = arm.parts[1].kinematics()
    rose = kinematics.p_WE(commands[-1, 8:]) - kinematics.p_WE(arm.home[7:])
    assert rose[2] > 0.02


@pytest.mark.parametrize(
    ("names", "options", "message"),
    [
        (["left/q", "q"], (), "columns q1, q2, .* are of no arm"),
        (["left/q", "right/q"], ("--live",), "--live: must be left out; a stream of two arms"),
        (["left/q", "right/q"], ("--set", "shield.yields=up"), "yields: must be 'left', 'right'"),
        (["left/q", "right/q"], ("--set", "shield.names=[a, a]"), "names: must be two different"),
        (["q"], (), "or columns by arm, left/q1 ... and right/q1 ..."),
    ],
)
def test_what_is_unclear_is_refused(tmp_path, names, options, message):
    columns = {f"{name}{k + 1}": [0.0, 0.0] for name in names for k in range(7)}
    file = written(tmp_path / "two.csv", {"t": [0.0, 0.1], **columns})
    assert message.split(" .* ")[-1] in sentence(shielded(file, tmp_path, *options))
