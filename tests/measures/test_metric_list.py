"""The one list of metrics: names, units, and that nothing is measured that it does not name."""

import re
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from drake_rnn import METRICS, InvalidInputError, JointLimits
from drake_rnn.features import FEATURES
from drake_rnn.measures import (
    ImageMotion,
    Motion,
    Pressing,
    RunMetrics,
    Yardsticks,
    place_metrics,
)
from drake_rnn.measures.metric import Over, ReportPart

#: How a name ends that has this unit.
ENDINGS = {
    "m": "_m",
    "m/s": "_m_s",
    "s": "_s",
    "us": "_us",
    "rad": "_rad",
    "rad/s": "_rad_s",
    "rad/s^2": "_rad_s2",
    "rad/s^3": "_rad_s3",
    "rad/s^4": "_rad_s4",
    "rad/s^5": "_rad_s5",
    "N": "_N",
    "J": "_J",
    "px": "_px",
}
#: What is said of a Jacobian is in the unit of J, which the names leave out.
OF_THE_JACOBIAN = {
    "jacobian_error_median",
    "jacobian_error_max",
    "jacobian_error_excited_median",
    "singular_value_min",
}
#: What `drake_rnn.simulate` and `drake_rnn.fastest` know, and no motion shows.
OF_THE_RUN = {"path_delay_s", "shortest_duration_s"}
ORDERS = ("velocity", "acceleration", "jerk", "snap", "crackle")
BOUNDS = {"position_lower": -1.0, "position_upper": 1.0, **dict.fromkeys(ORDERS, 1.0)}
BOUNDS |= {"envelope_offset": 0.1, "envelope_deceleration": 1.0}
BOUNDED = JointLimits.unlimited(2).replace(**BOUNDS)


def test_names_are_unique():
    METRICS.add(METRICS[0])
    with pytest.raises(InvalidInputError, match="there is another metric of this name"):
        METRICS.add(replace(METRICS[0]))


def test_a_name_ends_in_its_unit():
    """The longest unit that it ends in: ``_m_s`` is no time."""
    for metric in METRICS:
        ends = [unit for unit, end in ENDINGS.items() if metric.name.endswith(end)]
        longest = max(ends, key=lambda unit: len(ENDINGS[unit]), default=None)
        if metric.name in OF_THE_JACOBIAN:
            assert (longest, metric.unit) == (None, "m"), metric.name
        else:
            assert (longest or "1") == metric.unit, metric.name


def test_a_metric_says_what_it_is():
    for metric in METRICS:
        assert re.fullmatch("[a-z][a-z0-9_]*(_N|_J)?", metric.name)
        assert metric.meaning, metric.name
        assert metric.over in get_args(Over), metric.name
        assert {*metric.shown} <= {*get_args(ReportPart)}, metric.name


def test_a_metric_of_differences_says_over_what_time():
    """Beyond the acceleration they are taken over 10 ms, and up to it over a tick or step."""
    for metric in METRICS:
        name = metric.name
        beyond = re.search("^(?!held).*(jerk|snap|crackle)|limit_ratio_[345]", name) is not None
        assert metric.meaning.endswith("over 10 ms") == beyond, name


def test_what_is_shown_comes_in_the_order_of_the_list():
    for place in get_args(ReportPart):
        places = [METRICS.names.index(name) for name in place_metrics(place)]
        assert places
        assert places == sorted(places)


def swing(**fields):
    """An arm that swings for a second, and presses on a surface from which it is lifted."""
    time = np.arange(0.0, 1.0, 1e-3)
    k = time.size
    velocity = np.column_stack((0.3 * np.cos(2 * time), -0.1 * np.cos(2 * time)))
    at_rest = np.zeros((k, 3))
    J = np.broadcast_to(np.eye(3, 2), (k, 3, 2))
    force = np.where((time > 0.1) & (time < 0.5), 5.0, 0.0)
    there = {
        "position": velocity / 3,
        "velocity": velocity,
        "network_velocity": velocity / 2,
        "p_WE": at_rest,
        "v_WE": at_rest,
        "p_WE_desired": at_rest,
        "v_WE_desired": at_rest,
        "J": J,
        "J_hat": 0.9 * J,
        "orientation_error": np.zeros(k),
        "position_commanded": velocity / 3,
        "p_WE_commanded": at_rest,
        "distance": 0.1 + time,
        "distance_moving": 0.2 + time,
        "arms_distance": 0.3 + time,
        "lap_start": 0.0,
        "pressing": Pressing(
            normal=np.eye(3)[2], force=force, desired=np.full(k, 5.0), desired_end=5.0
        ),
    }
    return Motion(time=time, **{**there, **fields})


def observed(k):
    """All that a law may tell of itself."""
    return {
        "saturated": np.zeros((k, 1)),
        "acceleration_demand": np.ones((k, 2)),
        "orientation_rank": np.full((k, 1), 3.0),
        "contact_lost": np.ones((k, 1)),
        "torque_share": np.full((k, 1), 0.5),
        "joint_power": np.ones((k, 1)),
        "displacement": np.zeros((k, 3)),
    }


def test_every_metric_that_is_taken_is_in_the_list_and_the_other_way_round():
    """Along a path, to a target at which the arm arrives, to many, in an image, and of a law."""
    along = swing(velocity=4.0 * swing().velocity, tick=1e-3)
    towards = swing(target=np.zeros(2), position=np.zeros((1000, 2)))
    stream = swing(target=np.zeros((1000, 2)))
    locks = swing(locked=(0.1, 0.2))
    still = np.zeros((1000, 2))
    image = ImageMotion(still, still, np.zeros((1000, 2, 2)), np.ones(1000), (0.1, 0.2))
    seen = swing(image=image)
    taken = set()
    for motion in (along, towards, stream, locks, seen):
        metrics = RunMetrics(Yardsticks.of(BOUNDED, None, 1e-3))
        metrics.add(replace(motion, observed=observed(motion.time.size)))
        taken |= metrics.metrics().keys()
    assert taken <= {*METRICS.names}
    of_features = {metric.name for feature in FEATURES for metric in feature.metrics}
    assert {*METRICS.names} - taken == OF_THE_RUN | of_features
