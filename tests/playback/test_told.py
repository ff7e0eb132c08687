"""What a page tells of a run: curves, criteria and limits, and what it takes from Drake's page."""

from __future__ import annotations

import base64
import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from test_playback import Page

from drake_rnn import Result, load_experiment, simulate, write_playback
from drake_rnn.experiment.document import Acceptance
from drake_rnn.measures import METRICS, format_quantity
from drake_rnn.playback import chart as accepted
from drake_rnn.playback.chart import (
    Curve,
    accepted_bounds,
    curves_of,
    image_of,
    nearest,
)
from drake_rnn.playback.page import outcome_of, parse_static_html
from drake_rnn.playback.replay import pack, replayed_motion, simplify
from drake_rnn.playback.viewpoint import (
    facing,
    outermost,
)
from drake_rnn.runs.limit_use import conclusion_of
from drake_rnn.runs.result import (
    bound_text,
    value_text,
    words_of,
)


@pytest.fixture(scope="module")
def learned() -> Result:
    changes = {"duration": 0.5, "window": None, "limits.acceleration": 0.2}
    accept = {"accept": {"position_error_max_m": {"at_most": 1e-9}}}
    return simulate(load_experiment("slc_nephroid_known", changes | accept))


def floats(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype="<f4").astype(float)


def test_peaks_of_a_long_run_are_in_its_chart_and_samples_at_its_frames() -> None:
    time = np.arange(100_001) / 1000.0
    values = np.ones_like(time)
    values[77_777], values[12_345] = 40.0, -3.0
    frames = np.arange(6401) / 64.0
    data = Curve("key", "name", "m", time, values).as_data(frames)
    low, high = floats(data["low"]), floats(data["high"])
    assert (low.min(), high.max()) == (-3.0, 40.0)
    peak = floats(data["begins"])[np.argmax(high)]
    assert peak == pytest.approx(77.777, abs=0.06)
    np.testing.assert_allclose(floats(data["time"]), time[nearest(time, frames)], rtol=1e-6)
    assert len(pack(high)) < 12_000


def test_of_a_short_run_every_sample_is_in_the_page() -> None:
    time, values = np.arange(10) / 10.0, np.append(np.arange(9.0), np.nan)
    data = Curve("key", "name", "N", time, values, desired=2.0 * values).as_data(time)
    np.testing.assert_array_equal(floats(data["values"]), values)
    np.testing.assert_array_equal(floats(data["desired"]), 2.0 * values)
    assert "low" not in data


@pytest.mark.parametrize("count", [1, 2, 5])
def test_the_nearest_sample(count: int) -> None:
    time = np.arange(count) / 10.0
    wanted = np.array([-1.0, 0.04, 0.06, 0.31, 9.0])
    expected = [np.argmin(np.abs(time - t)) for t in wanted]
    assert nearest(time, wanted).tolist() == expected


def test_ratios_to_bounds_are_those_of_the_metrics(learned: Result) -> None:
    """The acceleration's is the largest of every step, not of the samples alone."""
    curves = {curve.key: curve for curve in curves_of(replayed_motion(learned))}
    ratio = curves["acceleration_ratio"].values.max()
    assert ratio == pytest.approx(learned.metrics["limit_ratio_2_max"], rel=1e-9)
    assert curves["velocity_ratio"].bound == 1.0
    margin = curves["margin"].values.min()
    assert margin == pytest.approx(learned.metrics["joint_limit_margin_min_rad"], rel=1e-3)


def test_differences_end_where_the_run_does() -> None:
    changes = {"duration": 0.5, "window": None, "limits.jerk": 100.0}
    run = simulate(load_experiment("slc_nephroid_known", changes))
    (jerk,) = [one for one in curves_of(replayed_motion(run)) if one.key == "jerk_ratio"]
    assert 0.0 < jerk.time[0] < jerk.time[-1] < run.time[-1]
    v = run.series["velocity"]
    second = np.abs(np.diff(v, n=2, axis=0)).max(axis=1) / 0.01**2 / 100.0
    np.testing.assert_allclose(jerk.values, second, rtol=1e-6)


def test_what_is_accepted_of_a_curve_is_a_level_of_it(learned: Result) -> None:
    """A limit's bound of 1 is a bound of the curve, and is not repeated."""
    (bound,) = [one for one in accepted_bounds(learned) if one.key == "position_error"]
    assert (bound.level, bound.text, bound.met) == (1e-9, "largest ≤ 1 nm", False)
    assert bound.windowed
    shown = {curve.key for curve in curves_of(replayed_motion(learned))}
    ratios = {one.key: one.level for one in accepted_bounds(learned) if one.key.endswith("ratio")}
    assert "acceleration_ratio" in ratios.keys() & shown
    assert all(level == pytest.approx(1.0) for level in ratios.values())


def test_metrics_that_levels_are_taken_from_are_metrics() -> None:
    assert accepted._METRIC_CURVES.keys() <= {metric.name for metric in METRICS}


def test_a_line_says_what_a_run_has_come_to(learned: Result) -> None:
    met = sum(verdict.met for verdict in learned.verdicts)
    told_of = f"{met} of {len(learned.verdicts)} criteria met"
    assert str(conclusion_of(learned)) == f"not accepted: {told_of}; limits kept"
    metrics = learned.metrics | {"limit_ratio_2_max": 1.2}
    assert str(conclusion_of(dataclasses.replace(learned, metrics=metrics))).endswith(
        "; limits broken: acceleration"
    )


def test_what_a_camera_sees_is_in_the_page() -> None:
    changes = {"duration": 0.1, "window": None, "accept": None}
    motion = replayed_motion(simulate(load_experiment("adaptive_camera", changes)))
    image, camera = image_of(motion, np.array([0.0, 0.1])), motion.result.experiment.document.camera
    assert camera is not None
    assert image is not None
    assert (image["size"], image["points"]) == (list(camera.image_size), len(camera.points))
    seen = floats(image["seen"]).reshape(-1, camera.size)
    np.testing.assert_allclose(seen[-1], motion.result.series["pixels"][-1], rtol=1e-6)
    assert "position error, not controlled" in [curve.name for curve in curves_of(motion)]


def test_a_limit_of_which_only_rounding_is_used_has_none_of_its_digits(learned: Result) -> None:
    metrics = {**learned.metrics, "limit_ratio_2_max": 8.8e-17}
    limits = outcome_of(dataclasses.replace(learned, metrics=metrics))["limits"]
    assert "none of its bound" in [
        each["text"] for each in limits if each["name"] == "acceleration"
    ]


def test_far_below_a_bound_there_are_no_digits() -> None:
    bound = Acceptance(at_most=1e-6)
    assert value_text("position_error_max_m", 0.9e-12, bound) == "0 m"
    assert value_text("position_error_max_m", 1.1e-12, bound) == "0.0011 nm"
    assert bound_text("jerk_violation_max_rad_s3", Acceptance(at_most=1e-9)) == "none allowed"
    assert bound_text("jerk_violation_max_rad_s3", Acceptance(at_most=1e-3)) == "≤ 1 mrad/s³"


def test_violations_of_rounding_are_none() -> None:
    assert value_text("position_violation_max_rad", 1.1e-13) == "none"
    assert value_text("velocity_violation_max_rad_s", 1e-9) == "1 nrad/s"
    assert value_text("settling_time_s", None) == "not reached"


def test_criteria_and_limits_are_told_with_what_came_out(learned: Result) -> None:
    outcome = outcome_of(learned)
    rows = {row["name"]: row for row in outcome["criteria"]}
    row = rows["position error max"]
    assert not row["met"]
    assert row["bound"] == "≤ 1 nm"
    assert row["value"] == format_quantity(learned.metrics["position_error_max_m"], "m")
    assert (outcome["kind"], outcome["verdict"]) == ("bad", "not accepted")
    limits = {limit["name"]: limit for limit in outcome["limits"]}
    assert limits["velocity"]["kept"]
    for order, name in ((1, "velocity"), (2, "acceleration")):
        assert limits[name]["kept"] == (learned.metrics[f"limit_ratio_{order}_max"] <= 1.0 + 1e-9)
    metrics = learned.metrics | {"limit_ratio_1_max": 1.2, "joint_limit_margin_min_rad": -0.1}
    broken = outcome_of(dataclasses.replace(learned, metrics=metrics))
    assert {"position", "velocity"} <= set(broken["broken"])
    (text,) = [one["text"] for one in broken["limits"] if one["name"] == "position"]
    assert text == "exceeded by 0.1 rad"


def test_of_a_run_of_which_nothing_is_asked_nothing_is_claimed() -> None:
    """The pseudoinverse keeps no limit by itself, so that without `accept` nothing is judged."""
    changes = {"duration": 0.1, "window": None, "accept": {}}
    outcome = outcome_of(simulate(load_experiment("pinv_circle", changes)))
    assert (outcome["kind"], outcome["verdict"]) == ("", "ran to its end")


def test_a_run_that_broke_off_is_not_accepted(learned: Result, tmp_path: Path) -> None:
    failed = dataclasses.replace(learned, status="failed", failure="the law <b>v</b> is NaN")
    outcome = outcome_of(failed)
    assert (outcome["kind"], outcome["verdict"]) == ("bad", failed.ending)
    assert outcome["summary"] == "criteria not judged"
    assert not any(row["met"] or row["judged"] for row in outcome["criteria"])
    text = write_playback(failed, tmp_path / "playback.html", 8).read_text()
    assert f"failed at t = {failed.until:g} s: the law &lt;b&gt;v&lt;/b&gt; is NaN" in text


def test_no_text_ends_a_script(learned: Result, tmp_path: Path) -> None:
    document = dataclasses.replace(learned.experiment.document, expect="</script><b>", name="a<b")
    experiment = dataclasses.replace(learned.experiment, document=document)
    named = dataclasses.replace(learned, experiment=experiment)
    page = Page(write_playback(named, tmp_path / "playback.html", 8, beside=[named]))
    assert page.data["labels"][0]["name"] == "a<b"
    assert "</script><b>" not in page.text


def test_metrics_are_told_words_of() -> None:
    assert words_of("position_error_max_m") == "position error max"
    assert words_of("acceleration_violation_max_rad_s2") == "acceleration violation max"
    assert words_of("limit_ratio_3_max") == "jerk / bound max"
    words = [words_of(metric.name) for metric in METRICS]
    assert all(word and "_" not in word for word in words)


def test_a_page_that_drake_writes_differently_is_refused() -> None:
    with pytest.raises(RuntimeError, match="this version of Drake"):
        parse_static_html("<html><script>MeshCat</script></html>")


def test_a_line_keeps_what_it_needs() -> None:
    """A corner, the ends, and in time what lets it grow; nothing else of a straight line."""
    way = np.linspace(0.0, 2.0, 201)
    points = np.stack((np.minimum(way, 1.0), np.maximum(way - 1.0, 0.0), 0.0 * way), axis=1)
    kept = simplify(points, 1e-3)
    assert kept == [0, 100, 200]
    timed = simplify(points, 1e-3, np.linspace(0.0, 1.0, 201))
    assert {0, 100, 200} <= set(timed)
    assert np.diff(timed).max() <= 201 / 24 + 1
    angles = np.linspace(0.0, math.tau, 2001)
    circle = np.stack((np.cos(angles), np.sin(angles), 0.0 * angles), axis=1)
    few = circle[simplify(circle, 1e-3)]
    assert len(few) < 120
    middles = np.linalg.norm((few[1:] + few[:-1]) / 2.0, axis=1)
    assert middles.min() > 1.0 - 2e-3


def test_a_path_is_faced() -> None:
    towards = np.array([0.6, 0.0, 0.8])
    angles = np.linspace(0.0, 6.0, 50)
    circle = np.stack((np.cos(angles), np.sin(angles), 0.0 * angles), axis=1)
    upright = circle[:, [2, 0, 1]]
    np.testing.assert_allclose(facing(upright, towards), [1.0, 0.0, 0.0], atol=1e-9)
    # From above, with y upwards in the picture: the camera is a little towards -y.
    from_above = facing(circle, towards)
    assert from_above[2] > 0.95
    assert from_above[1] < -0.1
    assert from_above[0] == pytest.approx(0.0, abs=1e-9)
    line = np.outer(np.arange(5.0), [0.0, 1.0, 0.0])
    np.testing.assert_array_equal(facing(line, towards), towards)


def test_the_outermost_points_stand_for_all() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(5000, 3)) * [1.0, 0.3, 0.1]
    few = outermost(points)
    assert len(few) < 400
    directions = rng.normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    reach, held = (points @ directions.T).max(axis=0), (few @ directions.T).max(axis=0)
    assert (held >= 0.97 * reach).all()


def test_a_run_of_which_limits_alone_are_asked_is_not_called_accepted(learned: Result) -> None:
    """It may be anywhere."""
    document = dataclasses.replace(learned.experiment.document, accept={})
    experiment = dataclasses.replace(learned.experiment, document=document)
    bare = dataclasses.replace(learned, experiment=experiment)
    count = len(bare.verdicts)
    assert count > 0
    assert (
        str(conclusion_of(bare)) == f"ran to its end: {count} of {count} criteria met; limits kept"
    )
