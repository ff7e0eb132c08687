"""What an experiment's tool presses against, made and checked as a whole."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .arms import Arm
from .diagrams.contact import Contact
from .documents import construct, kind_of, without_kind
from .environments import ENVIRONMENTS, ContactModel, ElasticSurface, ModelSurface, Plate, Surface
from .errors import InvalidInputError
from .fields import Array
from .laws import Law
from .paths import Path

if TYPE_CHECKING:
    from .experiment import Experiment

_SURFACES: dict[str, type[Surface]] = {"kinematic": ElasticSurface, "dynamic": ContactModel}

# How far a path may lead off a surface, along whose normal only the force rules [m].
_OFF = 1e-3


def make_contact(
    experiment: Experiment, law: Law, path: Path, arm: Arm, start: Array
) -> tuple[Contact | None, list[str]]:
    """The contact, if the experiment has one, and what is doubtful about it.

    Args:
        experiment: What is described.
        law: Its law.
        path: Its path.
        arm: Its arm.
        start: Posture to start from, shape (n,) [rad].

    Raises:
        InvalidInputError: Naming the key, its value and what it may be.
    """
    _require_level(experiment)
    document = experiment.environment
    if document is None:
        if "normal_WE" in law.inputs:
            raise InvalidInputError("environment: must be given; this law presses on a surface")
        for name in ("force", "sensor"):
            if getattr(experiment, name) is not None:
                raise InvalidInputError(f"{name}: only with an environment")
        return None, []
    kind = kind_of(document, ENVIRONMENTS, "environment")
    able = _SURFACES[experiment.level]
    if not issubclass(kind, able):
        names = ", ".join(name for name, known in ENVIRONMENTS.items() if issubclass(known, able))
        raise InvalidInputError(
            f"environment.kind: may be {names} at level: {experiment.level}, not {document['kind']}"
        )
    if experiment.force is None:
        raise InvalidInputError("force: must be given with an environment")
    _require_sensed(experiment, law)
    surface: Surface = construct(kind, without_kind(document), "environment")
    contact = Contact(surface, experiment.force, experiment.sensor)
    _require_along(surface, path)
    return contact, _doubts(contact, path, arm, start)


def _require_level(experiment: Experiment) -> None:
    if experiment.level == "kinematic":
        if experiment.plant is not None:
            raise InvalidInputError("plant: only at level: dynamic")
        return
    if experiment.period is None:
        raise InvalidInputError("period: must be given at level: dynamic, no integrator")
    if experiment.plant is not None and experiment.plant.time_step > experiment.period:
        raise InvalidInputError(
            f"plant.time_step: may be at most the controller's period, {experiment.period:g} s, "
            f"not {experiment.plant.time_step:g}"
        )


def _require_sensed(experiment: Experiment, law: Law) -> None:
    if experiment.sensor is not None:
        if experiment.period is None:
            raise InvalidInputError("sensor: is sampled like the law; give a period, no integrator")
        if "normal_force" not in law.inputs:
            raise InvalidInputError("sensor: this law, as it is set, does not see the force")
    loss = getattr(law, "contact_loss", None)
    if loss is not None and experiment.force is not None and loss.floor >= experiment.force.value:
        raise InvalidInputError(
            f"law.contact_loss.floor: must be below force.value, {experiment.force.value:g} N, "
            f"not {loss.floor:g}"
        )


def _require_along(surface: Surface, path: Path) -> None:
    """What of a path leads off a plane would be dropped without a word."""
    if isinstance(surface, ModelSurface):
        return  # which need not be plane
    extent = float(np.ptp(path.sample(100) @ surface.normal_W))
    if extent > _OFF:
        raise InvalidInputError(
            f"path: leads off the surface by {extent:.3g} m, where the force rules; give one in "
            f"the plane with the normal {np.round(surface.normal_W, 4).tolist()}"
        )


def _doubts(contact: Contact, path: Path, arm: Arm, start: Array) -> list[str]:
    surface = contact.surface
    p_WS = contact.place(arm, start)
    doubts = []
    if isinstance(surface, ContactModel) and surface.gap < 0.0:
        doubts.append(
            f"environment.gap: the tool starts {-surface.gap:.3g} m inside the surface, which "
            "pushes it out at once"
        )
    if isinstance(surface, Plate):
        origin = path.start_point(p_WS)
        points = surface.pose(p_WS).inverse().multiply((origin + path.sample(200)).T)
        beyond = float(np.abs(points[:2]).max()) - surface.size / 2.0
        if beyond > 0.0:
            doubts.append(f"path: leads {beyond:.3g} m beyond the plate's edges")
    return doubts
