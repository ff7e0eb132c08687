"""One robot's compiled step, called in a loop of one's own."""

import numpy as np
import pytest

from drake_rnn import CompiledStep, InvalidInputError, load_experiment, run_many

pytest.importorskip("jax")


def experiment(name, duration, **changes):
    return load_experiment(name, {"duration": duration, "window": None, **changes})


@pytest.fixture(scope="module")
def known():
    return CompiledStep(experiment("slc_nephroid_known", 0.2))


def travelled(step):
    """Joint positions of an arm that follows each command exactly."""
    robot, q = step.start(), step.home
    for _ in range(robot.samples):
        q = q + robot.period * robot.step(q)
    return q


@pytest.mark.long
def test_an_arm_that_follows_the_steps_is_where_the_run_ends(known):
    wanted = run_many([experiment("slc_nephroid_known", 0.2)]).position[0]
    found = travelled(known)
    assert np.abs(found - known.home).max() > 1e-3
    assert found == pytest.approx(wanted, abs=1e-12)
    # A robot of its own from the start.
    np.testing.assert_array_equal(travelled(known), found)


@pytest.mark.long
@pytest.mark.parametrize("name", ["slc_nephroid_warm_up", "naljdf_table1", "pinv_waypoints"])
def test_other_laws_step_likewise(name):
    """Those that accelerate over a sample, too: the velocity is the mean until the next one."""
    made = experiment(name, 0.3)
    assert travelled(CompiledStep(made)) == pytest.approx(run_many([made]).position[0], abs=1e-11)


@pytest.mark.long
def test_a_robot_that_a_noise_moves_tells_its_velocity():
    """With the experiment's own noise it is the experiment's run."""
    made = experiment("slc_nephroid", 0.03)
    from drake_rnn.batch.signals import Noises

    noises, step = Noises([made]), CompiledStep(made)
    robot, q, moved = step.start(), made.start, np.zeros(made.arm.n)
    for k in range(robot.samples):
        commanded = robot.step(q, moved)
        moved = commanded + noises.of_each(noises.row(k * robot.period))[0]
        q = q + robot.period * moved
    assert q == pytest.approx(run_many([made]).position[0], abs=1e-11)


def test_a_measured_velocity_counts(known):
    """At the start the known law does not see it."""
    q = known.home
    assert known.start().step(q, np.ones(7)) == pytest.approx(known.start().step(q))


def test_more_samples_than_the_experiment_has_are_refused(known):
    robot = known.start()
    robot.number = robot.samples
    with pytest.raises(InvalidInputError, match="all 200 samples of the experiment have been made"):
        robot.step(known.home)


@pytest.mark.parametrize(
    ("position", "velocity", "message"),
    [
        ([0.0] * 7, None, "position: must be an array, shape (7,), not [0.0,"),
        (np.zeros(6), None, "position: must be an array, shape (7,), not "),
        (np.zeros(7), np.zeros(6), "velocity: must be an array, shape (7,), not "),
        (np.full(7, np.nan), None, "step: the velocity of sample 0 is not finite"),
    ],
)
def test_what_is_no_position_is_refused(known, position, velocity, message):
    with pytest.raises(InvalidInputError) as refused:
        known.start().step(position, velocity)
    assert message in str(refused.value)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("motion_force_cat", "environment: a compiled step sees no contact"),
        ("slc_nephroid_virtual", "dither.model: virtual is for simulations"),
        ("slc_nephroid_known_continuous", "integrator: is Drake's"),
    ],
)
def test_what_a_step_cannot_be_is_refused(name, message):
    with pytest.raises(InvalidInputError) as refused:
        CompiledStep(name)
    assert message in str(refused.value)


@pytest.mark.long
def test_one_build_serves_scenes_with_other_obstacles_starts_and_paths():
    balls = [{"kind": "ball", "center": [0.45, y, 0.55], "radius": 0.06} for y in (0.25, -0.25)]
    here = experiment("adaptive_obstacles", 0.2, accept=None, obstacles=balls[:1])
    start = here.start + 0.02
    own = {"start": start.tolist(), "path.size": 0.03, "obstacles": balls[1:]}
    there = experiment("adaptive_obstacles", 0.25, accept=None, **own)
    step = CompiledStep(here)
    for scene in (here, there):
        robot, q = step.start(scene), scene.start
        assert robot.samples == round(scene.document.duration / robot.period)
        for _ in range(robot.samples):
            q = q + robot.period * robot.step(q)
        assert np.abs(q - scene.start).max() > 1e-3
        # Near its start the law enlarges differences of rounding.
        assert q == pytest.approx(run_many([scene]).position[0], abs=1e-5)
    for changes in ({"obstacles": balls}, {"limits.velocity": 0.3}, {"arm": "fr3"}):
        with pytest.raises(InvalidInputError, match="may differ from that of the step in obst"):
            step.start(experiment("adaptive_obstacles", 0.2, accept=None, **changes))
