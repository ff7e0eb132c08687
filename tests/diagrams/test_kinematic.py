"""Loops with an `IdealArm`: wiring by name, and a whole loop in a user's own diagram."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_rnn import (
    AddLoop,
    Contact,
    ContinuousController,
    DitherSettings,
    ElasticSurface,
    FilterSettings,
    ForceProfile,
    IdealArm,
    InvalidInputError,
    JointDriftFree,
    JointReference,
    MovingAverage,
    NullSpaceAdjustment,
    PathSource,
    Plate,
    Pseudoinverse,
    RecedingHorizon,
    SampledController,
    SelfMotion,
    SensorSettings,
    SimultaneousLearning,
    load_arm,
)
from drake_rnn.laws import JointPreview
from drake_rnn.paths import Circle, Rest
from drake_rnn.systems.sources import held_posture

PANDA = load_arm("panda").with_limits(
    load_arm("panda").limits.replace(velocity=0.5, acceleration=1.0)
)


def law(jacobian="known", arm=PANDA):
    return SimultaneousLearning(limits=arm.limits, home=arm.home, jacobian=jacobian)


def build(jacobian="known", dither=None, body=None, period=1e-3, **loop):
    builder = DiagramBuilder()
    p_WE = PANDA.kinematics().p_WE(PANDA.home)
    path = builder.AddNamedSystem("path", PathSource(Circle(size=0.05, period=4.0), p_WE))
    controller = SampledController(law(jacobian), period)
    arm = IdealArm(PANDA, **(body or {}))
    loop = AddLoop(builder, arm, controller, path, dither=dither, **loop)
    return builder.Build(), loop


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
    loop = AddLoop(builder, IdealArm(PANDA), controller, point, task="pose")
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
    loop = AddLoop(builder, IdealArm(PANDA), SampledController(law(), 1e-3), reference)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(2.0)
    context = loop.kinematics.GetMyContextFromRoot(simulator.get_context())
    reached = loop.kinematics.GetOutputPort("p_WE").Eval(context)
    np.testing.assert_allclose(reached, p_WE + 0.05, atol=2e-3)


def test_a_signal_that_nothing_offers_is_named():
    builder = DiagramBuilder()
    reference = builder.AddNamedSystem("point", ConstantVectorSource(np.zeros(3)))
    with pytest.raises(InvalidInputError, match="nothing in this diagram offers 'p_WE_desired'"):
        AddLoop(builder, IdealArm(PANDA), SampledController(law(), 1e-3), reference)


def test_a_law_of_another_size_is_refused():
    planar = SimultaneousLearning(
        limits=PANDA.limits, home=PANDA.home, jacobian="known", task_size=2
    )
    builder = DiagramBuilder()
    p_WE = PANDA.kinematics().p_WE(PANDA.home)
    path = builder.AddNamedSystem("path", PathSource(Circle(size=0.05, period=4.0), p_WE))
    message = "task: may be xy for this SimultaneousLearning, not xyz; or give the law task_size=3"
    with pytest.raises(InvalidInputError, match=message):
        AddLoop(builder, IdealArm(PANDA), SampledController(planar, 1e-3), path)


def test_a_reference_of_another_size_is_refused():
    builder = DiagramBuilder()
    path = PathSource(Circle(size=0.05, period=4.0), np.zeros(3), "xy")
    builder.AddNamedSystem("path", path)
    message = r"path\.p_WE_desired: must have 3 entries, like controller\.p_WE_desired, not 2"
    with pytest.raises(InvalidInputError, match=message):
        AddLoop(builder, IdealArm(PANDA), SampledController(law(), 1e-3), path)


def test_a_law_for_another_arm_is_refused():
    other = SampledController(Pseudoinverse(limits=load_arm("ur5").limits), 1e-3)
    message = r"limits: those of Pseudoinverse must be for 7 joints, like panda, not for 6"
    with pytest.raises(InvalidInputError, match=message):
        AddLoop(DiagramBuilder(), IdealArm(PANDA), other)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("dither", {"sigma": 1}, r"dither: .* JointNoise or None, not \{'sigma': 1\}"),
        ("filter", FilterSettings(), "filter: .* MovingAverage or None, not FilterSettings"),
        ("parts", [Plate()], r"parts\[0\]: must be of class LoopPart, not Plate"),
        ("parts", Plate(), "parts: must be a list, not Plate"),
        ("body", {"contact": Plate()}, "contact: must be of class Contact or None, not Plate"),
    ],
)
def test_an_argument_of_another_class_is_refused_by_name(name, value, message):
    with pytest.raises(InvalidInputError, match=message):
        build(**{name: value})


def test_a_law_or_a_name_in_place_of_a_system_or_an_arm_is_refused():
    with pytest.raises(InvalidInputError, match=r"controller: .* not SimultaneousLearning"):
        AddLoop(DiagramBuilder(), IdealArm(PANDA), law())
    with pytest.raises(InvalidInputError, match="arm: must be of class Arm, not 'panda'"):
        AddLoop(DiagramBuilder(), IdealArm("panda"), SampledController(law(), 1e-3))
    for body, given in (("panda", "'panda'"), (PANDA, "Arm")):
        with pytest.raises(InvalidInputError, match=f"body: must be of class Body, not {given}"):
            AddLoop(DiagramBuilder(), body, SampledController(law(), 1e-3))


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
        build(body={"start": start})


def test_a_start_outside_the_limits_is_accepted_as_far_as_is_said():
    start = [2.95, *PANDA.home[1:]]
    build(body={"start": start, "outside": 0.1})
    with pytest.raises(InvalidInputError, match=r"panda_joint1 is at 2\.95 rad; .* to 2\.9473"):
        build(body={"start": start, "outside": 0.05})


def test_two_arms_share_a_diagram():
    """Names are the user's: systems of one loop do not collide with those of another."""
    builder = DiagramBuilder()
    p_WE = PANDA.kinematics().p_WE(PANDA.home)
    path = builder.AddNamedSystem("path", PathSource(Circle(size=0.05, period=4.0), p_WE))
    for name in ("left", "right"):
        AddLoop(builder, IdealArm(PANDA), SampledController(law(), 1e-3), path, prefix=f"{name}_")
    names = {system.get_name() for system in builder.Build().GetSystems()}
    assert {"left_controller", "right_arm", "path"} <= names


SYSTEMS = {"controller", "kinematics", "joint_command", "arm"}
DITHER = DitherSettings(sigma=0.03, hold=1e-3)


def moving_average():
    return MovingAverage(PANDA.limits, 1e-3)


def contact(sensor=None):
    surface = ElasticSurface(stiffness=500.0)
    return {"contact": Contact(surface, ForceProfile(value=5.0), sensor)}


CONTACT_SYSTEMS = {"contact_reference", "normal_force", "force_watch"}


@pytest.mark.parametrize(
    ("loop", "more"),
    [
        ({}, set()),
        ({"dither": DITHER}, {"dither", "dithered_velocity"}),
        ({"filter": moving_average}, {"filter"}),
        (
            {"filter": moving_average, "feedback": "unfiltered"},
            {"filter", "virtual_arm", "virtual_kinematics", "virtual_joint_command"},
        ),
        ({"body": contact()}, CONTACT_SYSTEMS),
        ({"body": contact(SensorSettings())}, {"force_sensor", *CONTACT_SYSTEMS}),
    ],
)
@pytest.mark.parametrize("prefix", ["", "left_"])
def test_a_loop_names_all_that_was_added(loop, more, prefix):
    """Without the prefix that the diagram's own names have."""
    loop = {name: made() if callable(made) else made for name, made in loop.items()}
    diagram, added = build(prefix=prefix, **loop)
    assert added.systems.keys() == SYSTEMS | more
    for name, system in added.systems.items():
        assert system.get_name() == prefix + name
        assert diagram.GetSubsystemByName(prefix + name) is system
    assert len(diagram.GetSystems()) == len(added.systems) + 1  # the path
    for name in ("controller", "kinematics", "joint_command", "arm", "filter", "virtual_arm"):
        assert getattr(added, name) is added.systems.get(name)


def test_forces_are_those_of_the_arm_that_moves_and_the_one_the_law_is_shown():
    _, added = build(body=contact())
    felt = {name: port.get_system() for name, port in added.forces.items()}
    arm, normal = added.arm, added.systems["normal_force"]
    assert felt == {"contact_force": arm, "tool_force": arm, "normal_force": normal}
    _, added = build(body=contact(SensorSettings()))
    assert added.forces["normal_force"].get_system() is added.systems["force_sensor"]
    _, added = build(body=contact(), filter=moving_average(), feedback="unfiltered")
    assert added.forces["tool_force"].get_system() is added.arm
    assert added.virtual_arm is not added.arm
    assert not added.virtual_arm.HasOutputPort("tool_force")
    _, added = build()
    assert added.forces == {}


def test_a_sensor_needs_a_controller_that_is_sampled():
    p_WE = PANDA.kinematics().p_WE(PANDA.home)
    builder = DiagramBuilder()
    path = builder.AddNamedSystem("path", PathSource(Rest(), p_WE))
    body = IdealArm(PANDA, **contact(SensorSettings()))
    with pytest.raises(InvalidInputError, match="sensor: needs a sampled law; give a period"):
        AddLoop(builder, body, ContinuousController(law()), path)


def test_a_planar_task_with_a_contact_is_refused():
    with pytest.raises(InvalidInputError, match="task: may be xyz, pose with a contact, not xy"):
        build(body=contact(), task="xy")


def test_dynamics_are_computed_for_a_law_that_asks_for_them_only():
    p_WE = PANDA.kinematics().p_WE(PANDA.home)
    for scheme in ("naljdf", "moaljdf"):
        builder = DiagramBuilder()
        source = PathSource(Circle(size=0.05, period=4.0), p_WE, preview=1e-3)
        path = builder.AddNamedSystem("path", source)
        asking = JointDriftFree(scheme=scheme, limits=PANDA.limits, home=PANDA.home)
        loop = AddLoop(builder, IdealArm(PANDA), SampledController(asking, 1e-3), path)
        assert ("dynamics" in loop.systems) == (scheme == "moaljdf")


def test_a_reference_for_the_joints_must_be_of_the_laws_interval():
    bounds = dict.fromkeys(("velocity", "acceleration", "jerk", "snap", "crackle"), 1.0)
    planning = RecedingHorizon(limits=PANDA.limits.replace(**bounds))
    assert planning.joint_preview == JointPreview(interval=0.1, count=80)
    builder = DiagramBuilder()
    source = JointReference(held_posture(PANDA.home), 7, 0.05, planning.horizon)
    path = builder.AddNamedSystem("path", source)
    with pytest.raises(InvalidInputError, match=r"interval: must be the law's, 0\.1, not 0\.05"):
        AddLoop(builder, IdealArm(PANDA), SampledController(planning, 0.01), path)


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
        AddLoop(builder, IdealArm(arm), SampledController(law, 1e-3), path)


@pytest.mark.parametrize("preview", [-1.0, float("nan"), float("inf"), "x"])
def test_a_preview_that_is_no_time_is_refused(preview):
    with pytest.raises(InvalidInputError, match="preview: must be a time of 0 or more"):
        PathSource(Circle(size=0.05, period=4.0), np.zeros(3), preview=preview)


def test_a_signal_that_nothing_asks_for_is_refused():
    builder = DiagramBuilder()
    path = PathSource(Circle(size=0.05, period=4.0), PANDA.kinematics().p_WE(PANDA.home))
    builder.AddNamedSystem("path", path)
    signals = {"p_WE_desird": path.GetOutputPort("p_WE_desired")}
    controller = SampledController(law(), 1e-3)
    with pytest.raises(InvalidInputError, match=r"signals\.p_WE_desird: .* nearest: p_WE_desired"):
        AddLoop(builder, IdealArm(PANDA), controller, path, signals=signals)


def test_a_second_loop_needs_systems_and_names_of_its_own():
    builder = DiagramBuilder()
    path = PathSource(Circle(size=0.05, period=4.0), PANDA.kinematics().p_WE(PANDA.home))
    builder.AddNamedSystem("path", path)
    body = IdealArm(PANDA)
    AddLoop(builder, body, SampledController(law(), 1e-3), path)
    with pytest.raises(InvalidInputError, match="prefix: there is a system 'controller'"):
        AddLoop(builder, IdealArm(PANDA), SampledController(law(), 1e-3), path)
    with pytest.raises(InvalidInputError, match="arm: is in this diagram already"):
        AddLoop(builder, body, SampledController(law(), 1e-3), path, prefix="other_")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"builder": None}, "builder: must be of class DiagramBuilder, not None"),
        ({"reference": "path"}, "reference: must be of class System or None, not 'path'"),
        ({"signals": ["J"]}, r"signals: must be of class Mapping or None, not \['J'\]"),
        ({"signals": {"J": 3}}, r"signals\.J: must be of class OutputPort, not 3"),
        ({"seed": 0.5}, "seed: must be a whole number of at least 0, not 0.5"),
        ({"seed": -1}, "seed: must be a whole number of at least 0, not -1"),
        ({"prefix": 1}, "prefix: must be of class str, not 1"),
    ],
)
def test_an_argument_of_another_kind_is_named(arguments, message):
    arm = load_arm("panda")
    law = SimultaneousLearning(limits=arm.limits, home=arm.home, jacobian="known")
    given = {"builder": DiagramBuilder(), **arguments}
    with pytest.raises(InvalidInputError, match=f"^{message}$"):
        AddLoop(body=IdealArm(arm), controller=SampledController(law, 1e-3), **given)


def test_a_reference_that_was_not_added_is_named():
    arm = load_arm("panda")
    law = SimultaneousLearning(limits=arm.limits, home=arm.home, jacobian="known")
    path = PathSource(Circle(size=0.05, period=4.0), arm.kinematics().p_WE(arm.home))
    with pytest.raises(InvalidInputError, match=r"^reference: PathSource is not in this diagram"):
        AddLoop(DiagramBuilder(), IdealArm(arm), SampledController(law, 1e-3), path)
