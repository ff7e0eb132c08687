"""What the tool presses against, where it lies, and what the law is told of it."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from drake_rnn import (
    AddLoop,
    Contact,
    ElasticSurface,
    ForceProfile,
    IdealArm,
    InvalidInputError,
    MotionForce,
    PathSource,
    PlantArm,
    Plate,
    Rest,
    SampledController,
    SensorSettings,
    SimulationError,
    Surface,
    load_arm,
)

IIWA = load_arm("iiwa14", frame="tip")
FORCE = ForceProfile(value=5.0)


@pytest.mark.parametrize("gap", [0.0, 0.01, -1e-3])
def test_the_surface_is_the_gap_and_the_tools_radius_below_it(gap):
    n = np.array([0.6, 0.0, 0.8])
    force = ForceProfile(value=5.0)
    p_WE = IIWA.kinematics().p_WE(IIWA.home)
    plate = Contact(Plate(normal=n, gap=gap), force).place(IIWA, IIWA.home)
    np.testing.assert_allclose(p_WE - plate, (gap + 0.012) * n, atol=1e-12)
    given = Contact(Plate(normal=n, gap=gap, standoff=0.05), force).place(IIWA, IIWA.home)
    np.testing.assert_allclose(p_WE - given, (gap + 0.05) * n, atol=1e-12)
    # Of a spring it is E itself that sinks in.
    spring = ElasticSurface(normal=n, gap=gap, stiffness=100.0)
    placed = Contact(spring, force).place(IIWA, IIWA.home)
    np.testing.assert_allclose(p_WE - placed, gap * n, atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((5.0, FORCE), r"Contact\.surface: must be of class ElasticSurface or .*, not 5\.0"),
        ((Surface(), FORCE), r"Contact\.surface: .* or ContactModel, not Surface"),
        ((Plate(), 5.0), r"Contact\.force: must be of class ForceProfile, not 5\.0"),
        ((Plate(), None), r"Contact\.force: must be of class ForceProfile, not None"),
        ((Plate(), FORCE, {"noise": 1}), r"sensor: .* SensorSettings or None, not \{'noise': 1\}"),
    ],
)
def test_what_is_no_contact_is_refused_by_name(arguments, message):
    with pytest.raises(InvalidInputError, match=message):
        Contact(*arguments)


class Pressing:
    """A law that presses, at either level, on a surface."""

    def __init__(self, surface, sensor=None, force=FORCE, path=None, task="xyz", **law):
        kind = IdealArm if isinstance(surface, ElasticSurface) else PlantArm
        kinematics = IIWA.kinematics()
        p_WE, R_WE = kinematics.p_WE(IIWA.home), kinematics.R_WE(IIWA.home)
        builder = DiagramBuilder()
        path = Rest() if path is None else path
        path = builder.AddNamedSystem("path", PathSource(path, p_WE, "xyz", R_WE))
        law = {"stiffness": 100.0, **law}
        controller = SampledController(MotionForce(limits=IIWA.limits, **law), 1e-3)
        body = kind(IIWA, contact=Contact(surface, force, sensor))
        self.loop = AddLoop(builder, body, controller, path, task=task)
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)

    def after(self, t):
        self.simulator.AdvanceTo(t)
        return self

    def __getitem__(self, name):
        port = self.loop.forces[name]
        return port.Eval(port.get_system().GetMyContextFromRoot(self.simulator.get_context()))

    def seen(self, name):
        controller = self.loop.controller
        context = controller.GetMyContextFromRoot(self.simulator.get_context())
        return controller.GetInputPort(name).Eval(context)


N = np.array([0.1, 0.0, 1.0]) / np.linalg.norm([0.1, 0.0, 1.0])


@pytest.mark.parametrize("normal", [[0.0, 0.0, 1.0], N])
def test_a_spring_is_pressed_with_the_force_asked_for(normal):
    """exp(-10 / s * 1 s) of 5 N is left."""
    pressing = Pressing(ElasticSurface(stiffness=100.0, normal=normal)).after(1.0)
    assert pressing["normal_force"] == pytest.approx([5.0], abs=1e-2)
    np.testing.assert_allclose(pressing["tool_force"], 5.0 * np.asarray(normal), atol=1e-2)


@pytest.mark.long
def test_a_plate_is_pressed_with_the_force_asked_for():
    """0.05 N: what integral control has left after 1 s."""
    pressing = Pressing(Plate(gap=-1e-3), stiffness=5e3).after(1.0)
    assert pressing["normal_force"] == pytest.approx([5.0], abs=0.05)
    assert pressing["contact_force"][2] == pytest.approx(5.0, abs=0.05)


def test_the_law_sees_what_is_believed_of_the_normal():
    """The force along it: of 5 N along the true normal, 0.995 times."""
    surface = ElasticSurface(stiffness=100.0, normal=N, believed_normal=[0, 0, 1], gap=-0.01)
    pressing = Pressing(surface)
    np.testing.assert_array_equal(pressing.seen("normal_WE"), [0.0, 0.0, 1.0])
    force = pressing["contact_force"]
    np.testing.assert_allclose(force, 100.0 * 0.01 * N, atol=1e-9)
    assert pressing.seen("normal_force") == pytest.approx([force[2]])


def test_the_law_sees_what_its_sensor_says():
    """Two samples late, and the sample that sampling takes."""
    sensor = SensorSettings(delay=2e-3)
    pressing = Pressing(ElasticSurface(stiffness=100.0, gap=-0.01), sensor)
    assert pressing.after(1.5e-3).seen("normal_force") == 0.0
    assert pressing.after(3.5e-3).seen("normal_force") == pytest.approx([1.0], rel=0.1)


@pytest.mark.parametrize(
    ("failure", "message"),
    [
        ("nan", r"force_sensor: the force sensor reads nan \(at t = 0\.05 s\)"),
        ("frozen", r"force_watch: the force sensor has been stuck at .* N since t = 0\.05"),
    ],
)
def test_a_sensor_that_breaks_stops_the_run(failure, message):
    sensor = SensorSettings(noise=0.01, failure=failure, fails_at=0.05)
    with pytest.raises(SimulationError, match=message):
        Pressing(ElasticSurface(stiffness=100.0, gap=-0.01), sensor).after(0.3)


def test_a_sensor_that_breaks_stops_a_law_that_does_not_look_at_it():
    sensor = SensorSettings(failure="nan", fails_at=0.05)
    with pytest.raises(SimulationError, match="the force sensor reads nan"):
        Pressing(ElasticSurface(stiffness=100.0), sensor, force_feedback="assumed").after(0.1)


@pytest.mark.parametrize("task", ["xy", "pose"])
@pytest.mark.parametrize("surface", [ElasticSurface(stiffness=100.0), Plate()])
def test_a_law_that_presses_names_the_task_it_is_for(surface, task):
    may_be = "xyz for this MotionForce" if task == "pose" else "xyz, pose with a contact"
    with pytest.raises(InvalidInputError, match=f"task: may be {may_be}.*, not {task}$"):
        Pressing(surface, task=task)


def test_a_delay_that_is_no_number_of_samples_is_refused():
    with pytest.raises(InvalidInputError, match=r"sensor\.delay: must be a multiple"):
        Pressing(ElasticSurface(stiffness=100.0), SensorSettings(delay=1.5e-3))


@pytest.mark.long
def test_the_force_of_a_spring_may_come_to_rest_to_the_last_bit():
    """After some 3 s; which is no sensor that is stuck."""
    sensor = SensorSettings(delay=2e-3)
    pressing = Pressing(ElasticSurface(stiffness=100.0), sensor)
    settled = pressing.after(3.4)["normal_force"]
    np.testing.assert_array_equal(pressing.after(3.6)["normal_force"], settled)
