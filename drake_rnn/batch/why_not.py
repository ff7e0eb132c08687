"""Why a batch cannot run an experiment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ..errors import InvalidInputError
from ..experiment import Described, Experiment, ExperimentDocument, load_experiment
from ..experiment.document import combination_of
from ..features.pairs import refuse
from ..laws import Law, SampledReading
from ..laws.called import require_many
from ..robot.arm import Arm
from ..robot.arm_screws import screws_of
from ..signals import PATH_AHEAD, names_of

#: Signals that a law in a batch may see.
_COMPUTED = PATH_AHEAD | {*names_of("joints", "kinematics", "path", "surface")}
_SCHEMES = ("explicit_euler", "runge_kutta2")


def why_not(experiment: Described) -> str | None:
    """Return why `run_many` cannot run an experiment, in a sentence; None if it can.

    `simulate` and, in processes, `sweep` run the others.

    Args:
        experiment: The experiment, or what `load_experiment` takes.
    """
    made = experiment if isinstance(experiment, Experiment) else load_experiment(experiment)
    return why_not_law(made.document, made.law) or why_not_arm(made.arm)


def why_not_law(document: ExperimentDocument, law: Law) -> str | None:
    """Return why a batch cannot run a document with its law, whatever the arm is; None if it can.

    Args:
        document: The document.
        law: Its law.
    """
    return _refusal(lambda: able_reading(document, law))


def why_not_arm(arm: Arm) -> str | None:
    """Return why a batch knows no kinematics of an arm; None if it does.

    Args:
        arm: The arm.
    """
    return _refusal(lambda: screws_of(arm))


def _refusal(attempt: Callable[[], object]) -> str | None:
    try:
        attempt()
    except InvalidInputError as error:
        return str(error)
    return None


def able_reading(document: ExperimentDocument, law: Law) -> SampledReading:
    """Return the reading of the law that a batch runs, whatever the arm is.

    Raises:
        InvalidInputError: If a batch cannot run the experiment; the message says why.
    """
    refuse(replace(combination_of(document, type(law), law), host="batch"))
    assert document.period is not None
    return _able_reading(law, document.period)


def _able_reading(law: Law, period: float) -> SampledReading:
    name = type(law).__name__
    # The law's declarations were checked when the experiment was made.
    reading = law.sampled(period)
    require_many(reading)
    if unknown := sorted(reading.inputs.parts.keys() - _COMPUTED):
        raise InvalidInputError(
            f"law: {name} sees {', '.join(unknown)}, which a batch does not compute"
        )
    if (scheme := reading.integration_scheme) not in _SCHEMES:
        raise InvalidInputError(
            f"law: the command of {name} is integrated by {scheme}; a batch knows "
            f"{' and '.join(_SCHEMES)}"
        )
    return reading
