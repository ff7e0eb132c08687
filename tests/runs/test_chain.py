"""The chain of moving averages in the diagram: both wirings, their delay, and what is refused."""

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder

from drake_rnn import (
    AddLoop,
    DitherSettings,
    IdealArm,
    InvalidInputError,
    Layout,
    MovingAverage,
    Pseudoinverse,
    SampledController,
    SampledLaw,
    SimultaneousLearning,
    build_diagram,
    load_arm,
    load_experiment,
    make_experiment,
    simulate,
)
from drake_rnn.inputs.documents import parse_yaml
from limit_helpers import broken
from shared_runs import shared_run

CIRCLE, SQUARE, LEARNING = "chain_circle", "chain_square", "slc_nephroid_chain"
NAMES = [CIRCLE, SQUARE, LEARNING]
# Coarse, to be quick: the same windows in seconds, a fifth of the samples.
COARSE = {"period": 5e-3}
# The learning experiment with J given: 1 kHz will do, and less time.
KNOWN = {
    "law.jacobian": "known",
    "law.rho": None,
    "law.J_hat_initial": None,
    "dither": None,
    "period": 1e-3,
    "duration": 12,
    "window": [8, 12],
    "accept": None,
}


def metrics(name, **changes):
    return simulate(load_experiment(name, changes)).metrics


def largest_ratio(found):
    return max(found[f"limit_ratio_{order}_max"] for order in range(1, 6))


def connections(experiment):
    diagram, _ = build_diagram(experiment)
    return {
        f"{system.get_name()}.{system.get_input_port(port).get_name()}": (
            f"{origin.get_name()}.{origin.get_output_port(out).get_name()}"
        )
        for (system, port), (origin, out) in diagram.connection_map().items()
    }


# The experiments.


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "error", "delay"),
    [(CIRCLE, 5e-3, 4.499), pytest.param(SQUARE, 2e-3, 2.716, marks=pytest.mark.nightly)],
)
def test_the_arm_follows_its_path_late_and_keeps_all_bounds(name, error, delay):
    """Half the windows, of 4, 2, 1 and 2 s: 4.5 s; and of 1.33, 1.5, 1 and 1.6 s: 2.72 s.

    Of the windows, the first sample is not late, and of the loop, a tick is.
    """
    result = shared_run(name)
    found = result.metrics
    assert found["position_error_max_m"] < error
    assert found["path_delay_s"] == pytest.approx(delay)
    assert largest_ratio(found) < 0.42
    assert broken(found) == {}
    for metric, bounds in result.experiment.document.accept.items():
        assert bounds.holds(found[metric]), metric


@pytest.mark.nightly
def test_it_learns_behind_the_chain_and_keeps_all_bounds():
    """1.2e-2 m where 8e-4 without a filter: what five bounds cost, .22 s of delay in the loop."""
    experiment = load_experiment(LEARNING)
    found = simulate(experiment).metrics
    assert found["path_delay_s"] == pytest.approx(0.2199)
    assert 5e-3 < found["position_error_max_m"] <= 1.5e-2
    assert found["jacobian_error_median"] < 3e-3
    assert largest_ratio(found) <= 1 + 1e-9
    for metric, bounds in experiment.document.accept.items():
        assert bounds.holds(found[metric]), metric


@pytest.mark.long
def test_without_precompensation_the_error_is_three_times_as_large():
    without = metrics(CIRCLE, **COARSE, **{"filter.precompensate": False, "accept": None})
    assert 1.1e-2 < without["position_error_max_m"] < 1.3e-2


@pytest.mark.long
def test_bounds_are_kept_on_a_path_that_no_law_can_follow_within_them():
    """At constant speed from rest: 1.9e-2 m behind at first, where no filter breaks bounds."""
    raw = {**COARSE, "path.timing": "uniform", "path.ramp": None, "path.laps": None, "accept": None}
    found = metrics(CIRCLE, **raw)
    assert found["position_error_max_m"] < 2e-2
    assert largest_ratio(found) <= 1 + 1e-9
    unbounded = metrics(CIRCLE, **raw, duration=5, filter=None, feedback="commanded")
    assert largest_ratio(unbounded) > 100


# Wirings.


def test_unfiltered_the_law_goes_round_an_arm_of_its_own():
    wires = connections(load_experiment(CIRCLE))
    assert wires["virtual_joint_command.u0"] == "controller.commanded_velocity"
    assert wires["filter.commanded_velocity"] == "controller.commanded_velocity"
    assert wires["joint_command.u0"] == "filter.filtered_velocity"
    assert wires["arm.velocity_commanded"] == "filter.filtered_velocity"
    assert wires["kinematics.position"] == "joint_command.y0"
    seen = {port: origin for port, origin in wires.items() if port.startswith("controller.")}
    assert {origin.split(".")[0] for origin in seen.values()} == {"virtual_kinematics", "path"}


def test_commanded_the_filter_is_within_the_loop():
    """And the noise that the law is shown stays out of it."""
    wires = connections(load_experiment(LEARNING))
    assert wires["filter.commanded_velocity"] == "controller.commanded_velocity"
    assert wires["joint_command.u0"] == "filter.filtered_velocity"
    assert wires["dithered_velocity.u0"] == "filter.filtered_velocity"
    assert wires["controller.velocity"] == "dithered_velocity.sum"
    assert wires["controller.position"] == "joint_command.y0"
    assert wires["controller.p_WE_desired"] == "delayed_path.p_WE_desired"
    assert wires["controller.v_WE_desired"] == "path.v_WE_desired"
    undelayed = connections(load_experiment(LEARNING, {"filter.delay_desired": False}))
    assert undelayed["controller.p_WE_desired"] == "path.p_WE_desired"


def test_another_law_need_not_see_the_desired_position():
    """Nor its delay, although the experiment's own law does."""

    class Still(SampledLaw):
        state = Layout(v=(7,))
        inputs = Layout(position=(7,))

        def step(self, t, x, u, period):
            return x

    experiment = load_experiment(LEARNING)
    diagram, loop = build_diagram(experiment, Still())
    assert not diagram.HasSubsystemNamed("delayed_path")
    assert loop.controller.num_input_ports() == 1


@pytest.mark.long
def test_a_virtual_arm_moves_as_if_there_were_no_filter_and_the_arm_as_it_did():
    """Bit for bit; and the result is of the arm, beside the path as it was then."""
    changes = {**COARSE, "duration": 12, "accept": None, "log_period": 5e-3}
    chained = simulate(load_experiment(CIRCLE, changes))
    alone = simulate(load_experiment(CIRCLE, {**changes, "filter": None, "feedback": "commanded"}))
    np.testing.assert_array_equal(
        chained.series["network_velocity"], alone.series["network_velocity"]
    )
    # 4.495 s, the delay at 5 ms: half of (4 + 2 + 1 + 2) s less four samples, and a tick.
    late = round(chained.metrics["path_delay_s"] / 5e-3)
    assert late == 899
    for series in ("position", "p_WE"):
        then, now = alone.series[series][:-late], chained.series[series][late:]
        assert np.abs(now - then).max() < 5e-3 < np.abs(now - alone.series[series][late:]).max()
    asked = alone.series["p_WE_desired"]
    np.testing.assert_allclose(
        chained.series["p_WE_desired"][late:], asked[:-late], rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(chained.series["p_WE_desired"][:late], asked[:1].repeat(late, 0))


@pytest.mark.long
def test_what_was_learned_is_compared_with_the_arm_that_the_law_sees():
    """Unfiltered, that is the virtual one; the arm itself is elsewhere."""
    changes = {
        **{key: value for key, value in KNOWN.items() if key != "law.jacobian"},
        "law.J_hat_initial": "exact",
        "dither": {"sigma": 0.03, "hold": 1e-3},
        "filter.delay_desired": False,
        "feedback": "unfiltered",
        "duration": 3,
        "window": None,
    }
    result = simulate(load_experiment(LEARNING, changes))
    off = np.linalg.norm(result.series["J"] - result.series["J_hat"], axis=(1, 2))
    assert result.metrics["jacobian_error_median"] < 0.8 * np.median(off)
    assert largest_ratio(result.metrics) <= 1 + 1e-9


# Stability.


@pytest.fixture(scope="module")
def known():
    return metrics(LEARNING, **KNOWN)


@pytest.mark.long
def test_the_loop_is_stable_while_gain_times_delay_is_below_one(known, monkeypatch):
    """D is .22 s, kappa 4. Twice that gain is refused, and is lost; the bounds are not."""
    assert known["position_error_max_m"] < 1.5e-2
    monkeypatch.setattr(SimultaneousLearning, "loop_gains", {})
    beyond = metrics(LEARNING, **KNOWN, **{"law.kappa": 8})
    assert beyond["position_error_max_m"] > 0.1
    assert largest_ratio(beyond) <= 1 + 1e-9


@pytest.mark.long
def test_the_desired_position_has_to_be_late_too(known):
    """Else the feedback asks the arm to be where it can only be in .22 s: 3 times the error."""
    now = metrics(LEARNING, **KNOWN, **{"filter.delay_desired": False})
    assert known["position_error_max_m"] < 0.5 * now["position_error_max_m"]
    assert "path_delay_s" in known
    assert "path_delay_s" not in now


# Documents and refusals.


@pytest.mark.parametrize("name", NAMES)
def test_written_and_read_it_is_the_same(name):
    experiment = load_experiment(name)
    again = make_experiment(parse_yaml(experiment.document.to_yaml(), name))
    assert again.document.contents() == experiment.document.contents()
    assert again.path_delay == experiment.path_delay


BAD = [
    (CIRCLE, {"filter": None}, "feedback: unfiltered needs a filter"),
    (CIRCLE, {"feedback": "commanded"}, "filter.precompensate: only with feedback: unfiltered"),
    (
        CIRCLE,
        {"feedback": "none"},
        "feedback: must be 'commanded', 'measured' or 'unfiltered', not 'none'",
    ),
    (CIRCLE, {"filter.kind": "mean"}, "filter.kind: must be 'moving_average', not 'mean'"),
    (CIRCLE, {"filter.windw": 1}, "filter.windw: no such key"),
    (CIRCLE, {"filter.delay_desired": True}, "filter.delay_desired: only with feedback: comm"),
    (CIRCLE, {"limits.jerk": None}, "limits.jerk: not known for this arm, but needed for filter"),
    (CIRCLE, {"limits": "none"}, "limits.acceleration: not known"),
    (CIRCLE, {"limits.snap": 0}, "limits.snap: must be positive, not [0.0"),
    (CIRCLE, {"limits.crackle": 1e-3}, "filter: with these limits its delay is 203.5 s; the dura"),
    (
        CIRCLE,
        {"feedback": "commanded", "filter.precompensate": False},
        "law.feedback: must be below 0.2223 /s with the filter's delay of 4.499 s in its loop, "
        "not 10; or give feedback: unfiltered",
    ),
    (
        CIRCLE,
        {"feedback": "commanded", "filter": {"delay_desired": True}},
        "filter.delay_desired: only for a law that sees p_WE_desired and v_WE_desired",
    ),
    (LEARNING, {"law.kappa": 5}, "law.kappa: must be below 4.548 /s with the filter's delay of 0."),
    (LEARNING, {"limits.jerk": 10}, "law.kappa: must be below 1.534 /s with the filter's delay"),
    (LEARNING, {"dither.model": "actuated"}, "dither.model: actuated would move the arm behind"),
    (
        LEARNING,
        {"integrator": {"step": 1e-3}},
        "filter: needs a sampled law; give a period instead of an integrator",
    ),
]


@pytest.mark.parametrize(("name", "changes", "message"), BAD, ids=[case[-1] for case in BAD])
def test_what_cannot_be_is_refused_by_key_and_value(name, changes, message):
    with pytest.raises(InvalidInputError) as caught:
        load_experiment(name, changes)
    assert str(caught.value).startswith(message)


def test_doubts_are_told():
    unknown = {"law": {"kind": "recursive", "gains": [100.0]}, "filter": {}}
    told = load_experiment(CIRCLE, {**unknown, "feedback": "commanded"}).warnings
    doubt = "whether recursive stays stable with this delay is not known"
    assert any(doubt in text for text in told)
    both = {"law.acceleration_bound": "scalar", "filter.delay_desired": False}
    told = load_experiment(LEARNING, both).warnings
    assert any("already keeps the bound, and the arm may lose the path" in text for text in told)


def test_python_users_are_refused_the_same():
    arm = load_arm("panda")
    law = Pseudoinverse(limits=arm.limits, feed_forward=False)
    for options, message in (
        ({"feedback": "unfiltered"}, "feedback: unfiltered"),
        ({"feedback": "no"}, "feedback: may be commanded, measured, unfiltered, not 'no'"),
        (
            {
                "filter": MovingAverage(arm.limits, 1e-3),
                "dither": DitherSettings(sigma=0.1, hold=1e-3),
            },
            "dither.model: actuated",
        ),
        (
            {"filter": MovingAverage(arm.limits, 2e-3)},
            "filter: its period, 0.002 s, must be the contro",
        ),
    ):
        builder = DiagramBuilder()
        with pytest.raises(InvalidInputError, match=message):
            AddLoop(builder, IdealArm(arm), SampledController(law, 1e-3), **options)
