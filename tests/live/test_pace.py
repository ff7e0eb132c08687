import pytest

from drake_rnn.live.play import Pace


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def slices_until(pace, clock, end, cost=0.001):
    """Return how many slices are simulated by a time, each of which takes so long."""
    count = 0
    while clock.now < end:
        if (wait := pace.wait()) > 0.0:
            clock.now += min(wait, 0.01)
            continue
        clock.now += cost
        pace.note_slice()
        count += 1
    return count


def test_slices_come_at_the_rate_of_real_time():
    clock = Clock()
    pace = Pace(0.02, clock)
    assert slices_until(pace, clock, 110.0) == pytest.approx(500, abs=2)
    assert pace.rate == pytest.approx(1.0, abs=0.02)


def test_a_stall_is_not_made_up_for():
    clock = Clock()
    pace = Pace(0.02, clock)
    slices_until(pace, clock, 101.0)
    clock.now += 3.0
    # At once a tenth of a second may follow, and then no more than time has passed.
    assert slices_until(pace, clock, 105.0) <= 50 + 6
    assert slices_until(pace, clock, 106.0) <= 51


def test_what_is_too_slow_says_so():
    clock = Clock()
    pace = Pace(0.02, clock)
    slices_until(pace, clock, 110.0, cost=0.04)
    assert pace.rate == pytest.approx(0.5, abs=0.02)


def test_a_pause_is_not_made_up_for():
    clock = Clock()
    pace = Pace(0.02, clock)
    clock.now += 60.0
    pace.begin()
    assert slices_until(pace, clock, 161.0) == pytest.approx(50, abs=2)
