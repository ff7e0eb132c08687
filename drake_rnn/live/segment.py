"""A simulation of one variant, which goes on from where another one ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pydrake.systems.analysis import Simulator

from ..diagrams import Loop
from ..errors import InvalidInputError
from ..experiment import Experiment
from ..inputs.fields import Array
from ..laws import Law
from ..measures import Recorder
from ..runs.diagram import recorded_simulator, start_laws
from ..systems import TunableController
from ..systems.block import release
from .carried import Carried


@dataclass(frozen=True, eq=False)
class Segment:
    """A simulation that has begun, in a time of its own.

    Attributes:
        experiment: What is simulated.
        begin: Time of the session at which it began [s].
        simulator: The simulator.
        loop: Systems of the loop.
        controller: The controller among them.
        recorder: Recorder of every step.
    """

    experiment: Experiment
    begin: float
    simulator: Simulator
    loop: Loop
    controller: TunableController
    recorder: Recorder

    @property
    def root(self) -> Any:
        """Context of the diagram."""
        return self.simulator.get_mutable_context()

    @property
    def x(self) -> Array:
        """State of the law, shape (size,)."""
        return self.controller.state(self.controller.GetMyContextFromRoot(self.root))

    def release(self) -> None:
        """Let the simulation be freed, see `drake_rnn.systems.block`; it cannot go on."""
        release(self.simulator.get_system())

    def carried(self, law: Law) -> Carried:
        """Return what is handed on by a law, which may have other gains than at the beginning."""
        loop, root = self.loop, self.root
        body, layout = loop.arm.GetMyContextFromRoot(root), self.controller.reading.state
        integrator = loop.joint_command.GetMyContextFromRoot(root)
        x = self.x
        return Carried(
            position_commanded=loop.joint_command.get_output_port().Eval(integrator).copy(),
            position=loop.arm.GetOutputPort("position").Eval(body).copy(),
            velocity=loop.arm.GetOutputPort("velocity").Eval(body).copy(),
            kind=type(law),
            parts={name: part.copy() for name, part in layout.named(x).items()},
            shapes={name: shape for name, (_, shape) in layout.parts.items()},
        )

    def set_law(self, law: Law) -> None:
        """Go on with other gains from the next sample on.

        Raises:
            InvalidInputError: If the law cannot take the place of the one that runs.
        """
        context = self.controller.GetMyMutableContextFromRoot(self.root)
        self.controller.set_reading(context, self.controller.read(law))

    def begin_anew(self, law: Law) -> None:
        """Let the law forget all but the motion: what it has learned, and its multipliers."""
        controller, carried = self.controller, self.carried(law)
        context = controller.GetMyMutableContextFromRoot(self.root)
        known = self.loop.kinematics
        J = known.GetOutputPort("J").Eval(known.GetMyContextFromRoot(self.root))
        x = controller.initial_state(context, J=J.reshape(-1, known.arm.n))
        layout = controller.reading.state
        controller.set_state(context, carried.into(layout, x, type(law), anew=True))


def begun(experiment: Experiment, begin: float, carried: Carried | None = None) -> Segment:
    """Return a simulation that has begun.

    Args:
        experiment: What is simulated, from its start; its time 0 is ``begin``.
        begin: Time of the session [s].
        carried: What it goes on from; None to start at rest.

    Raises:
        InvalidInputError: If the law cannot begin there, as where an obstacle is too near.
    """
    document = experiment.document
    if document.period is None:
        raise InvalidInputError("period: must be given")
    controller = TunableController(
        experiment.law, document.period, document.seed, experiment.safety
    )
    simulator, loops, recorder = recorded_simulator(experiment, controller=controller)
    root, (loop,) = simulator.get_mutable_context(), loops
    segment = Segment(experiment, begin, simulator, loop, controller, recorder)
    try:
        start_laws(loops, root)
        if carried is not None:
            context = controller.GetMyMutableContextFromRoot(root)
            layout, kind = controller.reading.state, type(experiment.law)
            controller.set_state(context, carried.into(layout, controller.state(context), kind))
            moved = loop.arm.GetMyMutableContextFromRoot(root)
            loop.arm.set_motion(moved, carried.position, carried.velocity)
        recorder.watch(simulator)
        simulator.Initialize()
    except BaseException:
        segment.release()
        raise
    return segment
