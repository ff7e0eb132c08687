"""What a batch of robots cannot do."""

from __future__ import annotations

from ..errors import InvalidInputError
from ..experiment import Experiment
from ..laws import SampledReading
from ..laws.checks import sampled_reading
from ..robot.arm_screws import screws_of
from .signals import PREVIEWS

#: Signals that a law in a batch may see.
SIGNALS = PREVIEWS | {
    *("position", "velocity", "p_WE", "v_WE", "J", "R_WE", "J_omega", "Jdot_v"),
    *("p_WE_desired", "v_WE_desired", "a_WE_desired"),
    *("R_WE_desired", "w_WE_desired", "alpha_WE_desired"),
}
_SCHEMES = ("explicit_euler", "runge_kutta2")


def why_not(experiment: Experiment) -> str | None:
    """Return why `run_many` cannot run an experiment, in a sentence; None if it can.

    What it cannot run, `simulate` runs, and `sweep` in processes.

    Args:
        experiment: The experiment.
    """
    document = experiment.document
    if experiment.level.has_motors:
        return f"level: {document.level} needs Drake's plant; a batch has kinematics alone"
    if document.period is None:
        return "integrator: is Drake's; a batch needs a sampled law, give a period"
    unable = {
        "environment": document.environment,
        "filter": document.filter,
        "sensing": document.sensing,
    }
    for name, part in unable.items():
        if part is not None:
            return f"{name}: a batch has none yet; simulate has"
    return _of_law(experiment, document.period) or _of_arm(experiment)


def _of_law(experiment: Experiment, period: float) -> str | None:
    kind = experiment.document.law["kind"]
    if experiment.law.joint_preview is not None:
        return f"law: {kind} plans ahead; a batch knows no future joint positions"
    reading: SampledReading = sampled_reading(experiment.law, period)
    if not reading.takes_many:
        return f"law: {kind} runs one robot at a time; it has no algebra for many"
    if unknown := sorted(reading.inputs.parts.keys() - SIGNALS):
        return f"law: {kind} sees {', '.join(unknown)}, which a batch does not compute"
    if (scheme := reading.integration_scheme) not in _SCHEMES:
        return f"law: {kind} has its command integrated by {scheme}; a batch knows {_SCHEMES}"
    return None


def _of_arm(experiment: Experiment) -> str | None:
    try:
        screws_of(experiment.arm)
    except InvalidInputError as error:
        return str(error)
    return None
