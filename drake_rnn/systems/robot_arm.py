"""A real arm, or one behind the same messages: whoever holds the connection tells where it is."""

from __future__ import annotations

from typing import ClassVar

from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import PassThrough

from ..environments import Surface
from ..errors import InvalidInputError
from ..inputs.fields import Array
from .block import Block
from .body import Body, Feedback
from .plant_settings import PlantSettings

#: Why such an arm presses on nothing.
NO_FORCE = "environment: must be left out at level: robot, where no force is measured"


class RobotArm(Body):
    """An arm that another program moves: a robot's own controller, behind its messages.

    Arguments and ports are those of `Body`. Between two steps of a simulator the holder of the
    connection writes what the robot has measured (`measure`), advances the simulator to the
    robot's time, and sends what is then commanded (`command`); `drake_rnn.drive_experiment` does
    so for experiments, and `drake_rnn.drive_diagram` for a diagram of your own. Until it is told
    something else, the arm rests at its start.
    """

    level = "robot"
    default_feedback: ClassVar[Feedback] = "commanded"
    surfaces: ClassVar[type[Surface]] = Surface
    has_motors = True
    is_simulated = False

    def _build(self, builder: DiagramBuilder) -> None:
        n = self.arm.n
        self._told = builder.AddNamedSystem("told", _Told(self.start))
        for name in ("position", "velocity"):
            block = builder.AddNamedSystem(f"{name}_commanded", PassThrough(n))
            builder.ExportInput(block.get_input_port(), f"{name}_commanded")
            builder.ExportOutput(self._told.GetOutputPort(name), name)

    @property
    def tick(self) -> float | None:
        """Time between two messages, for which the measured velocity holds [s]; None if unknown."""
        return self.arm.description.message_period

    def remedy(self, joint: int, off: float) -> str:
        """See `Body.remedy`."""
        return "give the law lower limits or lower gains, or the robot a stiffer controller"

    @classmethod
    def check_plant(cls, settings: PlantSettings | None, period: float | None) -> None:
        """Raise an InvalidInputError if there are settings of a plant: nothing is simulated."""
        if settings is not None:
            raise InvalidInputError("plant: only at level: dynamic")

    @classmethod
    def check_loop(cls, period: float | None, feedback: Feedback, *, sensed: bool = False) -> None:
        """Raise an InvalidInputError if the law is not sampled."""
        super().check_loop(period, feedback, sensed=sensed)
        if period is None:
            raise InvalidInputError(
                "period: must be given at level: robot, instead of an integrator"
            )

    @classmethod
    def check_surface(cls, kind: type[Surface]) -> None:
        """Raise an InvalidInputError: no force is measured of a robot yet."""
        raise InvalidInputError(NO_FORCE)

    def measure(self, root: Context, position: Array, velocity: Array) -> None:
        """Write what the robot has measured.

        Args:
            root: Context of the whole diagram.
            position: Joint positions, shape (n,) [rad].
            velocity: Joint velocities, shape (n,) [rad/s].
        """
        state = self._told.GetMyMutableContextFromRoot(root).get_mutable_discrete_state()
        state.set_value(0, position)
        state.set_value(1, velocity)

    def command(self, root: Context) -> tuple[Array, Array]:
        """Return the commanded positions and velocities, shape (n,) each [rad, rad/s].

        Args:
            root: Context of the whole diagram.
        """
        context = self.GetMyContextFromRoot(root)
        position, velocity = (
            self.GetInputPort(f"{name}_commanded").Eval(context).copy()
            for name in ("position", "velocity")
        )
        return position, velocity


class _Told(Block):
    """Joint positions and velocities as a state that no event changes."""

    def __init__(self, start: Array) -> None:
        super().__init__()
        for name, value in (("position", start), ("velocity", 0.0 * start)):
            self.DeclareStateOutputPort(name, self.DeclareDiscreteState(value))
