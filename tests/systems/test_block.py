"""Systems in Python are freed: by the collector, and at once when their diagram is released."""

import gc
import inspect
import weakref
from contextlib import contextmanager

import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem

import drake_rnn.systems
from drake_rnn import build_diagram, load_experiment
from drake_rnn.features import (
    admittance,
    camera,
    contact,
    filter,
    joint_noise,
    locks,
    obstacles,
    second,
    sensing,
)
from drake_rnn.systems import Controller, Kinematics, PathSource
from drake_rnn.systems.block import Block, Collectable, release
from drake_rnn.systems.body import _MeasuredJoints

# Of each body, with a filter, sensors, a contact, obstacles, a camera, locks and a second arm.
NAMES = (
    "slc_nephroid_known",
    "slc_nephroid_continuous",
    "adaptive_smooth",
    "adaptive_measured",
    "adaptive_moving_obstacle",
    "adaptive_camera",
    "adaptive_locked_joint",
    "adaptive_two_arms_together",
    "contact_cat_learned",
    "motion_force_cat",
)


class Told(Block):
    """A block whose functions refer to it in every way that there is."""

    def __init__(self) -> None:
        super().__init__()
        port = self.DeclareVectorInputPort("u", 1)
        self.read = port.Eval
        self.DeclareVectorOutputPort("method", 1, self.calc)
        self.DeclareVectorOutputPort("port", 1, lambda c, y: y.set_value(port.Eval(c)))
        self.DeclareVectorOutputPort(
            name="self",
            size=1,
            calc=lambda c, y: self.calc(c, y),
            prerequisites_of_calc={port.ticket()},
        )
        self.DeclareDiscreteState(1)
        self.DeclarePeriodicDiscreteUpdateEvent(0.1, 0.0, self.update)
        self.DeclareInitializationDiscreteUpdateEvent(self.update)

    def calc(self, context: Context, output) -> None:
        output.set_value(self.read(context))

    def update(self, context: Context, state) -> None:
        state.set_value(0, self.read(context))


@contextmanager
def without_collection():
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def in_diagram():
    builder = DiagramBuilder()
    block = builder.AddSystem(Told())
    builder.ExportInput(block.get_input_port())
    for port in range(3):
        builder.ExportOutput(block.get_output_port(port))
    return builder.Build(), block


def test_every_system_of_this_package_is_one_that_is_freed():
    rooms = (drake_rnn.systems, admittance, camera, contact, filter, joint_noise, locks, obstacles)
    found = {
        each
        for room in (*rooms, second, sensing)
        for _, each in inspect.getmembers(room, inspect.isclass)
        if each.__module__.startswith("drake_rnn.")
    }
    systems = [
        each for each in (*found, _MeasuredJoints) if issubclass(each, (LeafSystem, Diagram))
    ]
    assert len(systems) > 30
    assert not [each for each in systems if not isinstance(each, Collectable)]
    assert not [e for e in systems if issubclass(e, LeafSystem) and not issubclass(e, Block)]


def test_a_block_is_called_as_any_system_of_drake():
    diagram, _ = in_diagram()
    context = diagram.CreateDefaultContext()
    diagram.get_input_port().FixValue(context, [3.0])
    assert [diagram.get_output_port(k).Eval(context)[0] for k in range(3)] == [3.0] * 3


def test_a_diagram_is_freed_by_the_collector():
    diagram, block = in_diagram()
    freed = weakref.ref(block)
    del diagram, block
    gc.collect()
    assert freed() is None


def test_a_diagram_that_is_released_is_freed_at_once():
    with without_collection():
        diagram, block = in_diagram()
        freed = weakref.ref(block)
        release(diagram)
        del diagram, block
        assert freed() is None


@pytest.mark.parametrize("held", [True, False])
def test_what_is_released_is_not_evaluated_and_does_not_crash(held):
    """The diagram holds its systems, which no longer hold it."""
    diagram, block = in_diagram()
    before = diagram.CreateDefaultContext()
    release(diagram)
    if not held:
        freed = weakref.ref(block)
        del block
    for context in (before, diagram.CreateDefaultContext()):
        diagram.get_input_port().FixValue(context, [3.0])
        for port in range(3):
            with pytest.raises(ReferenceError):
                diagram.get_output_port(port).Eval(context)
    if held:
        with pytest.raises(ReferenceError):
            Simulator(diagram).Initialize()
    else:
        assert freed() is not None
        del diagram, context, before
        # A port that is asked for and its diagram keep each other alive.
        gc.collect()
        assert freed() is None


@pytest.mark.parametrize(
    "name", [NAMES[0], *(pytest.param(name, marks=pytest.mark.long) for name in NAMES[1:])]
)
def test_the_systems_of_an_experiment_are_freed(name):
    experiment = load_experiment(name)
    gc.collect()
    diagram, loop = build_diagram(experiment)
    freed = [weakref.ref(system) for system in diagram.GetSystems() if isinstance(system, Block)]
    freed += [weakref.ref(loop.arm), weakref.ref(loop.arm.kinematics)]
    assert {type(each()) for each in freed} & {Kinematics, PathSource}
    assert any(isinstance(each(), Controller) for each in freed)
    del diagram, loop
    gc.collect()
    assert not [each() for each in freed if each() is not None]
    with without_collection():
        diagram, loop = build_diagram(experiment)
        freed = [weakref.ref(system) for system in (*diagram.GetSystems(), loop.arm.kinematics)]
        release(diagram)
        del diagram, loop
        assert not [each() for each in freed if each() is not None]
