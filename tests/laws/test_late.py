"""Measurements that come late, and a law that knows how late they are."""

import numpy as np
import pytest
from adaptive_helpers import HOME, LIMITS, PERIOD, N, adaptive, circle, excess, moved

from drake_rnn import load_experiment
from drake_rnn.laws.parts.jacobian import Late

LATE = 5


@pytest.mark.parametrize(("jacobian", "task_size"), [("known", 3), ("learned", 3), ("known", 6)])
@pytest.mark.long
def test_a_delay_that_is_known_is_made_up_for(jacobian, task_size):
    """5 ms on a circle of 4 cm in 4 s, at 63 mm/s: 314 um of way."""
    told = adaptive(jacobian=jacobian, task_size=task_size, measurement={"delay": LATE * PERIOD})
    deaf = adaptive(jacobian=jacobian, task_size=task_size)
    error = {}
    for name, law in (("told", told), ("deaf", deaf)):
        motion = moved(law, circle(), 5.0, late=LATE)
        error[name] = motion.error[3500:].max()
        assert max(excess(motion, LIMITS).values()) < 1e-9
    assert error["told"] < 30e-6
    assert error["deaf"] > 100e-6
    assert error["deaf"] == pytest.approx(2 * np.pi * 0.04 / 4.0 * LATE * PERIOD, rel=0.1)


def test_a_delay_that_is_not_there_is_as_bad():
    wrong = adaptive(measurement={"delay": LATE * PERIOD})
    assert moved(wrong, circle(), 4.0).error[3000:].max() > 100e-6


def test_it_keeps_the_last_commands_and_says_how_far_they_led():
    late = Late(3, 2)
    assert late.shapes == {"q_late": (3, 2)}
    places = [np.array([x, -x]) for x in (0.0, 1.0, 3.0, 6.0, 10.0, 15.0)]
    kept, J = late.init({"position": places[0]}, None), np.eye(2)
    since = []
    for q in places[1:]:
        moved_, kept = late.step({**kept, "commanded": q}, {}, PERIOD, J)
        since.append(float(moved_[0]))
    # Against the command of three samples before, or the first.
    assert since == [1.0, 3.0, 6.0, 9.0, 12.0]
    np.testing.assert_array_equal(kept["q_late"][:, 0], [15.0, 10.0, 6.0])


def test_nothing_is_kept_where_nothing_is_late():
    none = Late(0, N)
    assert none.shapes == {}
    assert none.init({"position": HOME}, None) == {}
    assert none.step({"commanded": HOME}, {}, PERIOD, np.eye(N)) == (None, {})


def test_an_experiment_tells_the_law_what_its_sensors_are_like():
    law = {"kind": "adaptive", "jacobian": "learned"}
    sensing = {"delay": 5e-3, "p_WE_noise": 1e-5, "secant_samples": 12}
    found = load_experiment("adaptive_nephroid", {"law": law, "sensing": sensing}).law.measurement
    assert (found.error, found.delay, found.secant_samples) == (1e-5, 5e-3, 12)
    steps = {"encoder_bits": 20, "position_noise": 1e-6}
    found = load_experiment("adaptive_nephroid", {"law": law, "sensing": steps}).law.measurement
    # Steps of 2 pi / 2^20 rad have their size over sqrt(12), and noise beside it; 0.5 m of lever.
    step = 2 * np.pi / 2**20 / np.sqrt(12)
    assert found.error == pytest.approx(0.5 * np.hypot(step, 1e-6))
    assert found.secant_samples is None
    assert load_experiment("adaptive_nephroid").law.measurement.error == 0.0
