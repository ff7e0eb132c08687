"""The kinematic diagram: wiring by name, and a whole loop in a user's own diagram."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_rnn import (
    DitherSettings,
    InvalidInputError,
    NullSpaceAdjustment,
    PathSource,
    Plate,
    Pseudoinverse,
    SampledController,
    SelfMotion,
    SimultaneousLearning,
    load_arm,
)
from drake_rnn.diagrams.kinematic import AddKinematicLoop
from drake_rnn.paths import Circle, Rest
from drake_rnn.systems.moving_average import FilterSettings

PANDA = load_arm("panda").with_limits(
    load_arm("panda").limits.replace(velocity=0.5, acceleration=1.0)
)


def law(jacobian="known", arm=PANDA):
    return SimultaneousLearning(limits=arm.limits, home=arm.home, jacobian=jacobian)


def build(jacobian="known", dither=None, start=None, period=1e-3, **loop):
    builder = DiagramBuilder()
    p_WE = PANDA.kinematics().p_WE(PANDA.home)
    path = builder.AddNamedSystem("path", PathSource(Circle(size=0.05, period=4.0), p_WE))
    controller = SampledController(law(jacobian), period)
    systems = AddKinematicLoop(builder, PANDA, controller, path, start=start, dither=dither, **loop)
    return builder.Build(), systems


def connections(diagram):
    return {
        f"{system.get_name()}.{system.get_input_port(port).get_name()}": (
            f"{origin.get_name()}.{origin.get_output_port(out).get_name()}"
        )
        for (system, port), (origin, out) in diagram.connection_map().items()
    }


def test_everything_has_a_name():
    diagram, _ = build("learned", DitherSettings(sigma=0.03, hold=1e-3))
    names = {system.get_name() for system in diagram.GetSystems()}
    assert names == {
        "path",
        "controller",
        "dither",
        "dithered_velocity",
        "joint_command",
        "arm",
        "kinematics",
    }


def test_a_law_that_learns_is_not_wired_to_the_jacobian():
    known, learned = (connections(build(jacobian)[0]) for jacobian in ("known", "learned"))
    assert known["controller.J"] == "kinematics.J"
    assert "kinematics.J" not in learned.values()
    assert learned["controller.v_WE"] == "kinematics.v_WE"


@pytest.mark.parametrize(
    ("model", "moved", "measured", "shown"),
    [
        (
            None,
            "controller.commanded_velocity",
        )
        + ("controller.commanded_velocity",) * 2,
        ("actuated",) + ("dithered_velocity.sum",) * 3,
        ("virtual", "controller.commanded_velocity") + ("dithered_velocity.sum",) * 2,
        ("printed",) + ("controller.commanded_velocity",) * 2 + ("dithered_velocity.sum",),
    ],
)
def test_noise_models_are_wirings(model, moved, measured, shown):
    """Where the noise goes: into the arm, into what v_WE shows, into what the law is shown."""
    dither = model and DitherSettings(model=model, sigma=0.03, hold=1e-3)
    wires = connections(build("learned", dither)[0])
    assert wires["joint_command.u0"] == moved
    assert wires["arm.velocity_commanded"] == moved
    assert wires["kinematics.velocity"] == measured
    assert wires["controller.velocity"] == shown


def test_the_arm_follows_the_path():
    diagram, loop = build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(3.0)
    root = simulator.get_context()
    p_WE = loop.kinematics.GetOutputPort("p_WE").Eval(loop.kinematics.GetMyContextFromRoot(root))
    path = diagram.GetSubsystemByName("path")
    desired = path.GetOutputPort("p_WE_desired").Eval(path.GetMyContextFromRoot(root))
    # The network lags behind by about one over rate times kappa of the path's speed.
    assert np.linalg.norm(p_WE - desired) < 1e-3


def test_a_law_that_holds_a_pose_is_wired_to_its_orientation_and_holds_it():
    """1e-5 m and rad: what feedback of 50 / s leaves of a motion of 1 rad/s at 1 kHz."""
    kinematics = PANDA.kinematics()
    p_WE, R_WE = kinematics.p_WE(PANDA.home), kinematics.R_WE(PANDA.home)
    target = SelfMotion(PANDA, PANDA.home, "pose").somewhere(0.3)
    held = NullSpaceAdjustment(target=target, limits=PANDA.limits, task_size=6)
    builder = DiagramBuilder()
    point = builder.AddNamedSystem("point", PathSource(Rest(), p_WE, "pose", R_WE))
    controller = SampledController(held, 1e-3)
    loop = AddKinematicLoop(builder, PANDA, controller, point, task="pose")
    diagram = builder.Build()
    wires = connections(diagram)
    assert wires["controller.R_WE_desired"] == "point.R_WE_desired"
    assert wires["controller.R_WE"] == "kinematics.R_WE"
    simulator = Simulator(diagram)
    context = loop.arm.GetMyContextFromRoot(simulator.get_context())
    for t in (0.5, 1.0, 3.0):
        simulator.AdvanceTo(t)
        q = loop.arm.GetOutputPort("position").Eval(context)
        np.testing.assert_allclose(kinematics.p_WE(q), p_WE, atol=1e-5)
        np.testing.assert_allclose(kinematics.R_WE(q), R_WE, atol=1e-5)
    np.testing.assert_allclose(q, target, atol=1e-3)


def test_the_command_is_integrated_exactly():
    """Positions are the sums of the held velocities."""
    diagram, loop = build()
    simulator = Simulator(diagram)
    times, rows = [], []
    port = loop.arm.GetOutputPort("velocity")
    context = loop.arm.GetMyContextFromRoot(simulator.get_context())

    def watch(root):
        times.append(root.get_time())
        rows.append(port.Eval(context))

    simulator.set_monitor(watch)
    simulator.AdvanceTo(0.5)
    moved = (np.array(rows[1:]) * np.diff(times)[:, np.newaxis]).sum(axis=0)
    q = loop.arm.GetOutputPort("position").Eval(context)
    np.testing.assert_allclose(q - PANDA.home, moved, atol=1e-12)


def test_any_system_with_the_right_ports_can_be_the_reference():
    """A Drake trajectory, say."""
    p_WE = PANDA.kinematics().p_WE(PANDA.home)
    p = PiecewisePolynomial.FirstOrderHold([0.0, 2.0], np.column_stack((p_WE, p_WE + 0.05)))
    builder = DiagramBuilder()
    inner = DiagramBuilder()
    for name, trajectory in (("p", p), ("v", p.derivative())):
        source = inner.AddSystem(TrajectorySource(trajectory))
        inner.ExportOutput(source.get_output_port(), f"{name}_WE_desired")
    reference = builder.AddNamedSystem("trajectory", inner.Build())
    loop = AddKinematicLoop(builder, PANDA, SampledController(law(), 1e-3), reference)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(2.0)
    context = loop.kinematics.GetMyContextFromRoot(simulator.get_context())
    reached = loop.kinematics.GetOutputPort("p_WE").Eval(context)
    np.testing.assert_allclose(reached, p_WE + 0.05, atol=2e-3)


def test_a_signal_that_nothing_offers_is_named():
    builder = DiagramBuilder()
    reference = builder.AddNamedSystem("point", ConstantVectorSource(np.zeros(3)))
    with pytest.raises(InvalidInputError, match="nothing in this diagram offers 'p_WE_desired'"):
        AddKinematicLoop(builder, PANDA, SampledController(law(), 1e-3), reference)


def test_a_law_of_another_size_is_refused():
    planar = SimultaneousLearning(
        limits=PANDA.limits, home=PANDA.home, jacobian="known", task_size=2
    )
    builder = DiagramBuilder()
    p_WE = PANDA.kinematics().p_WE(PANDA.home)
    path = builder.AddNamedSystem("path", PathSource(Circle(size=0.05, period=4.0), p_WE))
    message = "task: may be xy for SimultaneousLearning .*, not xyz; or give the law task_size=3"
    with pytest.raises(InvalidInputError, match=message):
        AddKinematicLoop(builder, PANDA, SampledController(planar, 1e-3), path)


def test_a_reference_of_another_size_is_refused():
    builder = DiagramBuilder()
    path = PathSource(Circle(size=0.05, period=4.0), np.zeros(3), "xy")
    builder.AddNamedSystem("path", path)
    message = r"path\.p_WE_desired: must have 3 entries, as controller\.p_WE_desired, not 2"
    with pytest.raises(InvalidInputError, match=message):
        AddKinematicLoop(builder, PANDA, SampledController(law(), 1e-3), path)


def test_a_law_for_another_arm_is_refused():
    other = SampledController(Pseudoinverse(limits=load_arm("ur5").limits), 1e-3)
    message = r"limits: those of Pseudoinverse must be of 7 joints, as panda has, not of 6"
    with pytest.raises(InvalidInputError, match=message):
        AddKinematicLoop(DiagramBuilder(), PANDA, other)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("dither", {"sigma": 1}, r"dither: .* DitherSettings or None, not \{'sigma': 1\}"),
        ("filter", FilterSettings(), "filter: .* MovingAverage or None, not FilterSettings"),
        ("contact", Plate(), "contact: must be of class Contact or None, not Plate"),
    ],
)
def test_an_argument_of_another_class_is_refused_by_name(name, value, message):
    with pytest.raises(InvalidInputError, match=message):
        build(**{name: value})


def test_a_law_or_a_name_in_place_of_a_system_or_an_arm_is_refused():
    with pytest.raises(InvalidInputError, match=r"controller: .* not SimultaneousLearning"):
        AddKinematicLoop(DiagramBuilder(), PANDA, law())
    with pytest.raises(InvalidInputError, match="arm: must be of class Arm, not 'panda'"):
        AddKinematicLoop(DiagramBuilder(), "panda", SampledController(law(), 1e-3))


@pytest.mark.parametrize(
    ("start", "message"),
    [
        (np.zeros(6), "start: has 6 entries for 7 joints"),
        ([3.0, *PANDA.home[1:]], "panda_joint1 is at 3 rad; it may be -2.8973 to"),
        (PANDA.home * np.nan, "start: panda_joint1 is at nan"),
    ],
)
def test_a_start_posture_outside_the_limits_is_refused(start, message):
    with pytest.raises(InvalidInputError, match=message):
        build(start=start)


def test_a_start_outside_the_limits_is_accepted_as_far_as_is_said():
    start = [2.95, *PANDA.home[1:]]
    build(start=start, outside=0.1)
    with pytest.raises(InvalidInputError, match=r"panda_joint1 is at 2\.95 rad; .* to 2\.9473"):
        build(start=start, outside=0.05)


def test_two_arms_share_a_diagram():
    """Names are the user's: systems of one loop do not collide with those of another."""
    builder = DiagramBuilder()
    p_WE = PANDA.kinematics().p_WE(PANDA.home)
    path = builder.AddNamedSystem("path", PathSource(Circle(size=0.05, period=4.0), p_WE))
    for name in ("left", "right"):
        AddKinematicLoop(builder, PANDA, SampledController(law(), 1e-3), path, prefix=f"{name}_")
    names = {system.get_name() for system in builder.Build().GetSystems()}
    assert {"left_controller", "right_arm", "path"} <= names


@pytest.mark.parametrize("preview", [0.0, 2e-3])
def test_a_law_that_sees_ahead_must_see_one_period_ahead(preview):
    arm = load_arm("panda")
    law = Pseudoinverse(limits=arm.limits)
    path = PathSource(
        Circle(size=0.05, period=4.0), arm.kinematics().p_WE(arm.home), preview=preview
    )
    builder = DiagramBuilder()
    builder.AddNamedSystem("path", path)
    with pytest.raises(InvalidInputError, match=r"preview: must be the controller's period, 0.001"):
        AddKinematicLoop(builder, arm, SampledController(law, 1e-3), path)


@pytest.mark.parametrize("preview", [-1.0, float("nan"), float("inf"), "x"])
def test_a_preview_that_is_no_time_is_refused(preview):
    with pytest.raises(InvalidInputError, match="preview: must be a time of 0 or more"):
        PathSource(Circle(size=0.05, period=4.0), np.zeros(3), preview=preview)
