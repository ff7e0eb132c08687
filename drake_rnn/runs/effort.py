"""What a run takes, estimated before it starts."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import InvalidInputError
from ..experiment import Experiment, ExperimentDocument
from ..systems import BODIES
from ..systems.plant_settings import PlantSettings

#: Time that a run may be expected to take unless it is told to run anyway [s].
LONGEST = 3 * 3600.0
#: Samples that a run may store: some 1.5 kB each.
MOST_SAMPLES = 1e7
# What a step costs, roughly, by what makes it [s].
_COSTS = {"period": 5e-5, "integrator.step": 1.5e-4, "plant.time_step": 2e-4}
_COSTS |= {"dither.hold": 5e-5, "disturbance.hold": 5e-5}


@dataclass(frozen=True)
class Effort:
    """What a run is expected to take.

    Attributes:
        key: Key of the document that determines it; empty if an integrator chooses its steps.
        step: Its value [s].
        steps: Number of steps.
        time: Time on a usual machine, within a factor of a few [s].
    """

    key: str = ""
    step: float = 0.0
    steps: float = 0.0
    time: float = 0.0


def effort_of(document: ExperimentDocument) -> Effort:
    """Return what a run is expected to take; nothing is known of an integrator's own steps.

    Args:
        document: Document of the experiment.
    """
    held = {
        "period": document.period,
        "integrator.step": document.integrator and document.integrator.step,
        "dither.hold": document.dither and document.dither.hold,
        "disturbance.hold": document.disturbance and document.disturbance.hold,
    }
    if BODIES[document.level].has_motors:
        held["plant.time_step"] = (document.plant or PlantSettings()).time_step
    efforts = [
        Effort(key, step, document.duration / step, document.duration / step * _COSTS[key])
        for key, step in held.items()
        if step
    ]
    return max(efforts, key=lambda effort: effort.time, default=Effort())


def check_effort(experiment: Experiment, stored_period: float) -> None:
    """Raise an InvalidInputError if a run would take very long, or store very many samples.

    Args:
        experiment: The experiment.
        stored_period: Time between two stored samples [s].
    """
    document = experiment.document
    require_effort(effort_of(document), document.duration)
    samples = document.duration / stored_period
    if samples > MOST_SAMPLES:
        raise InvalidInputError(
            f"log_period: {document.log_period:g} s stores {samples:.2g} samples in "
            f"{document.duration:g} s; a run may store {MOST_SAMPLES:g}; `drake-rnn run "
            "--anyway` (in Python: anyway=True) makes it nevertheless"
        )


def require_effort(effort: Effort, duration: float) -> None:
    """Raise an InvalidInputError if a run would take very long.

    Args:
        effort: What it is expected to take.
        duration: Its duration [s].
    """
    if effort.time > LONGEST:
        raise InvalidInputError(
            f"{effort.key}: {effort.step:g} s makes {effort.steps:.2g} steps in "
            f"{duration:g} s, which may take {effort.time / 3600:.2g} hours; a run may "
            f"take {LONGEST / 3600:g} hours; `drake-rnn run --anyway` (in Python: anyway=True) "
            "makes it nevertheless"
        )
