"""Metrics of what a camera sees, of two points, before and after a swap."""

import numpy as np
import pytest
from motions import metrics, metrics_of_parts, motion

from drake_rnn.measures import ImageMotion

TIME = np.linspace(0.0, 1.0, 11)
#: Distances of the second point from where it is to be; the first is .1 px off.
AWAY = np.array([4.0, 2.0, 0.4, 0.6, 0.3, 0.2, 5.0, 3.0, 0.49, 0.2, 0.2])
SWAPPED = (0.6, 0.6)


def seen(steps=slice(None), swapped=SWAPPED):
    away = AWAY[steps]
    k = len(away)
    pixels = np.full((k, 4), 100.0)
    pixels[:, 0] += 0.1
    # In a direction of its own: 3, 4, 5.
    pixels[:, 2] += 0.6 * away
    pixels[:, 3] -= 0.8 * away
    margin = 50.0 - 10.0 * away
    return ImageMotion(pixels, np.full((k, 4), 100.0), np.ones((k, 4, 2)), margin, swapped)


def test_the_point_that_is_farthest_off_counts():
    found = metrics(motion(TIME, image=seen()))
    assert found["pixel_error_max_px"] == pytest.approx(5.0)
    assert found["pixel_error_rms_px"] == pytest.approx(np.sqrt(np.mean(AWAY**2)))
    assert found["image_margin_min_px"] == pytest.approx(0.0)


def test_an_error_is_that_of_its_camera():
    found = metrics(motion(TIME, image=seen()))
    assert found["pixel_error_before_swap_max_px"] == pytest.approx(4.0)
    assert found["pixel_error_after_swap_max_px"] == pytest.approx(5.0)
    late = metrics(motion(TIME, image=seen()), window=(0.25, 1.0))
    assert late["pixel_error_before_swap_max_px"] == pytest.approx(0.6)


def test_it_has_settled_when_it_stays_near():
    """Whether it was near before the last swap is no matter; 0.49 px at 0.8 s is near."""
    found = metrics(motion(TIME, image=seen()))
    assert found["pixel_settling_time_s"] == pytest.approx(0.8)
    assert found["pixel_resettling_time_s"] == pytest.approx(0.8)
    near = metrics(motion(TIME[:6], image=seen(slice(0, 6), (0.45, 0.45))))
    assert near["pixel_settling_time_s"] == pytest.approx(0.4)
    assert near["pixel_resettling_time_s"] == pytest.approx(0.5)


def test_without_a_swap_there_is_nothing_before_and_after():
    found = metrics(motion(TIME, image=seen(swapped=None)))
    names = {name for name in found if "swap" in name or "resettling" in name}
    assert names == set()
    assert "pixel_error_max_px" in found
    assert not any("pixel" in name or "image" in name for name in metrics(motion(TIME)))


def test_of_parts_they_are_those_of_the_whole():
    whole = metrics(motion(TIME, image=seen()))
    parts = [
        motion(TIME[:7], image=seen(slice(0, 7))),
        motion(TIME[6:], image=seen(slice(6, None)), origin=0.0),
    ]
    cut = metrics_of_parts(parts)
    assert {name: cut[name] for name in cut if "pixel" in name or "image" in name} == pytest.approx(
        {name: whole[name] for name in whole if "pixel" in name or "image" in name}
    )
