"""The table of signals: what each follows from, and that runs and blocks have what it says."""

import numpy as np
import pytest

from drake_rnn import Circle, load_arm, load_experiment
from drake_rnn.robot.task import TASKS
from drake_rnn.signals import (
    AHEAD,
    SERIES_SHAPES,
    SERIES_UNITS,
    SIGNALS,
    DelayedPath,
    View,
    at_steps,
    input_description,
    names_of,
)
from drake_rnn.systems.body import Dynamics, Kinematics
from drake_rnn.systems.sources import PathSource
from row_helpers import each
from shared_runs import shared_run

ARM = load_arm("panda")
N = ARM.n
STEP = 1e-6
Q, V, T = ARM.home + 0.1, np.linspace(-0.4, 0.5, N), 0.7
PATH = Circle(size=0.05, period=4.0).placed(ARM.kinematics().p_WE(ARM.home), np.eye(3))
NORMAL = np.array([0.0, 0.0, 1.0])
FOLLOWING = [name for name, signal in SIGNALS.items() if signal.function is not None]


def view(task="xyz"):
    return View(TASKS[task], ARM.kinematics(), DelayedPath(PATH), ARM.believed_dynamics(), NORMAL)


def value(name, q=Q, v=V, t=T, task="xyz"):
    return np.array(SIGNALS[name].function(view(task), q, v, t))


def rate(name):
    """Central difference in time along a motion with constant joint velocities."""
    after, before = (value(name, Q + s * STEP * V, V, T + s * STEP) for s in (1, -1))
    return (after - before) / (2.0 * STEP)


def test_velocities_and_accelerations_are_the_derivatives_of_positions():
    assert rate("position") == pytest.approx(V, abs=1e-8)
    assert rate("p_WE") == pytest.approx(value("v_WE"), abs=1e-8)
    assert rate("v_WE") == pytest.approx(value("Jdot_v"), abs=1e-7)
    assert rate("p_WE_desired") == pytest.approx(value("v_WE_desired"), abs=1e-8)
    assert rate("v_WE_desired") == pytest.approx(value("a_WE_desired"), abs=1e-7)
    assert value("v_WE") == pytest.approx(value("J") @ V, abs=1e-14)


@each("name", FOLLOWING)
def test_a_signal_follows_from_its_causes_alone_and_has_the_shape_of_its_row(name):
    signal = SIGNALS[name]
    blank = {cause: None for cause in "qvt" if cause not in signal.causes}
    assert np.array_equal(value(name, **blank), value(name))
    for task, chosen in TASKS.items():
        lengths = {"n": N, "axes": len(chosen.axes), "rows": chosen.size}
        assert value(name, task=task).shape == signal.lengths(**lengths)


@pytest.mark.parametrize("name", ["adaptive_moving_obstacle", "adaptive_two_arms", "dual_circle"])
def test_the_table_says_what_each_input_of_a_law_is(name):
    """For the header of a law in C; those of a user's own are told as such."""
    inputs = load_experiment(name).law.sampled(1e-3).inputs.parts
    assert {"p_WO", "other_v", "R_WE_desired"} & inputs.keys()
    assert [each for each in inputs if "not declared" in input_description(each)] == []


def test_blocks_offer_what_the_table_says():
    def ports(system):
        count = range(system.num_output_ports())
        return [system.get_output_port(port).get_name() for port in count]

    assert ports(Kinematics(ARM)) == [*names_of("kinematics")]
    assert ports(Dynamics(ARM)) == [*names_of("dynamics")]
    path = ports(PathSource(PATH, preview=1e-3))
    assert {*path} == {*names_of("path")} | {SIGNALS[name].ahead for name in names_of("path")}
    assert [AHEAD[name] for name in path if name in AHEAD] == [*names_of("path")]


def test_at_steps_gives_each_step_its_own_value_with_steps_in_front():
    times, position = np.array([0.0, T]), np.stack([ARM.home, Q])
    found = at_steps(view(), ["J", "p_WE_desired"], times, position, axes=3, rows=3)
    assert np.array_equal(found["J"][1], value("J"))
    assert np.array_equal(found["p_WE_desired"][1], value("p_WE_desired"))
    assert not np.array_equal(found["J"][0], found["J"][1])


@pytest.mark.parametrize(
    "name", ["slc_nephroid_known", "adaptive_measured", "adaptive_contact_circle"]
)
def test_series_of_runs_are_rows_of_the_table_with_their_shapes(name):
    result = shared_run(name, {"duration": 0.1, "window": None, "accept": None})
    known = {"n": N, "axes": result.series["p_WE"].shape[1], "rows": result.series["J"].shape[1]}
    for series in result.series.keys() & SERIES_SHAPES.keys():
        axes = SERIES_SHAPES[series]
        shape = tuple(3 if axis == "xyz" else known[axis] for axis in axes)
        assert result.series[series].shape[1:] == shape, series
    assert {"position", "v_WE", "acceleration"} <= SERIES_UNITS.keys() & result.series.keys()
