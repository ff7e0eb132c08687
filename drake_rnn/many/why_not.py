"""What a batch of robots cannot do."""

from __future__ import annotations

from ..errors import InvalidInputError
from ..experiment import Experiment
from ..laws import SampledReading
from ..laws.called import require_many
from ..robot.arm_screws import screws_of
from .signals import PREVIEWS

#: Signals that a law in a batch may see.
SIGNALS = PREVIEWS | {
    *("position", "velocity", "p_WE", "v_WE", "J", "R_WE", "J_omega", "Jdot_v"),
    *("p_WE_desired", "v_WE_desired", "a_WE_desired"),
    *("R_WE_desired", "w_WE_desired", "alpha_WE_desired"),
    *("normal_WE", "normal_force", "normal_force_desired"),
}
_SCHEMES = ("explicit_euler", "runge_kutta2")


def why_not(experiment: Experiment) -> str | None:
    """Return why `run_many` cannot run an experiment, in a sentence; None if it can.

    What it cannot run, `simulate` runs, and `sweep` in processes.

    Args:
        experiment: The experiment.
    """
    try:
        able_reading(experiment)
        screws_of(experiment.arm)
    except InvalidInputError as error:
        return str(error)
    return None


def able_reading(experiment: Experiment) -> SampledReading:
    """Return the reading of the law that a batch runs, whatever the arm is.

    Raises:
        InvalidInputError: If a batch cannot run the experiment; the message says why.
    """
    document = experiment.document
    if experiment.level.has_motors:
        raise InvalidInputError(
            f"level: {document.level} needs Drake's plant; a batch has kinematics alone"
        )
    if document.period is None:
        raise InvalidInputError(
            "integrator: is Drake's; a batch needs a sampled law, with a period"
        )
    unable = {
        "sensor": document.sensor,
        "sensing": document.sensing,
    }
    for name, part in unable.items():
        if part is not None:
            raise InvalidInputError(f"{name}: a batch has none; simulate has")
    if document.filter is not None and document.environment is not None:
        raise InvalidInputError("filter: a batch has none in contact; simulate has")
    return _able_reading(experiment, document.period)


def _able_reading(experiment: Experiment, period: float) -> SampledReading:
    law = type(experiment.law).__name__
    if experiment.law.joint_preview is not None:
        raise InvalidInputError(f"law: {law} plans ahead; a batch knows no future joint positions")
    # What it declares was checked when the experiment was made.
    reading = experiment.law.sampled(period)
    require_many(reading)
    if unknown := sorted(reading.inputs.parts.keys() - SIGNALS):
        raise InvalidInputError(
            f"law: {law} sees {', '.join(unknown)}, which a batch does not compute"
        )
    if (scheme := reading.integration_scheme) not in _SCHEMES:
        raise InvalidInputError(
            f"law: the command of {law} is integrated by {scheme}; a batch knows "
            f"{' and '.join(_SCHEMES)}"
        )
    return reading
