"""What the tool of an experiment presses on, and what that is to the arm's other bodies."""

from __future__ import annotations

from ..environments import ENVIRONMENTS, ContactModel, Surface
from ..environments.solids import solids_of
from ..errors import InvalidInputError
from ..inputs.documents import construct, without_kind
from ..inputs.fields import Array
from ..inputs.modules import Modules
from ..robot.arm import Arm
from ..robot.clearance.obstacles import Obstacle
from ..systems import BODIES, Contact
from .document import ExperimentDocument

_NO_EXTENT = (
    "obstacles: the surface of environment is a spring without extent, which only the end effector "
    "meets; distances from it are not looked at"
)


def described_contact(document: ExperimentDocument, modules: Modules) -> Contact | None:
    """Return the contact that a document describes; None without an environment.

    Args:
        document: Document of the experiment.
        modules: Modules that may be imported for the environment.

    Raises:
        InvalidInputError: If a key is missing or wrong.
    """
    section = document.environment
    if section is None:
        return None
    kind = ENVIRONMENTS.named_by(section, modules)
    BODIES[document.level].check_surface(kind)
    if document.force is None:
        raise InvalidInputError("force: must be given with an environment")
    surface: Surface = construct(kind, without_kind(section), "environment")
    return Contact(surface, document.force, document.sensor)


def pressed_solids(
    contact: Contact | None, arm: Arm, start: Array
) -> tuple[tuple[Obstacle, ...], tuple[str, ...]]:
    """Return what the surface of a contact is to bodies that do not press on it, and warnings.

    Args:
        contact: The contact; None without one.
        arm: The arm.
        start: Start posture, shape (n,) [rad].

    Raises:
        InvalidInputError: If the arm has no tool, or no solid fits round the surface.
    """
    if contact is None:
        return (), ()
    surface = contact.surface
    if not isinstance(surface, ContactModel):
        return (), (_NO_EXTENT,)
    return solids_of(surface, contact.place(arm, start)), ()
