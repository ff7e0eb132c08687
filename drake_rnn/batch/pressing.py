"""Elastic surfaces that many robots press on, and the forces between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays.algebra import functions_of
from ..arrays.namespace import AnyArray
from ..environments import ElasticSurface
from ..experiment import Experiment
from ..inputs.fields import Array
from ..measures import Pressing
from .grouping import contents


class Surfaces:
    """The surface of each robot, a spring as in `drake_rnn.systems.spring_contact`.

    Args:
        experiments: The robots' experiments, each with an `ElasticSurface`.
    """

    def __init__(self, experiments: Sequence[Experiment]) -> None:
        contacts = [each.contact for each in experiments if each.contact is not None]
        surfaces = [each.surface for each in contacts if isinstance(each.surface, ElasticSurface)]
        self._normal = np.stack([surface.normal_W for surface in surfaces], axis=-1)
        self._believed = np.stack([surface.believed_normal_W for surface in surfaces], axis=-1)
        self._stiffness = np.array([surface.stiffness for surface in surfaces])
        places = zip(contacts, experiments, strict=True)
        p_WS = [contact.place(each.arm, each.start) for contact, each in places]
        self._height = _added(self._normal * np.stack(p_WS, axis=-1))
        keys = [contents(contact.force) for contact in contacts]
        distinct = list(dict.fromkeys(keys))
        self._profiles = [contacts[keys.index(key)].force for key in distinct]
        self._which = np.array([distinct.index(key) for key in keys])
        ends = [each.document.duration for each in experiments]
        self._desired_end = np.array(
            [contact.force.at(end) for contact, end in zip(contacts, ends, strict=True)]
        )

    def row(self, t: float) -> Array:
        """Return the desired force of each profile at a time [s], shape (profiles,) [N]."""
        return np.array([profile.at(t) for profile in self._profiles])

    def pressed(self, row: AnyArray, p_WE: AnyArray) -> Pressing:
        """Return the forces, in NumPy or in JAX.

        Args:
            row: The desired force of each profile, shape (profiles,) [N].
            p_WE: Positions of the end effectors, shape (robots, 3) [m].
        """
        depth = self._height - _added(self._normal * p_WE.T)
        pushes = functions_of(depth).where(depth > 0.0, self._stiffness * depth, 0.0)
        force = _added(pushes * self._normal * self._normal)
        return Pressing(self._normal.T, force, row[self._which], self._desired_end)

    def signals(self, pressed: Pressing) -> dict[str, Array]:
        """Return what the laws are told of the contact, by name.

        Args:
            pressed: The forces, along the true normals.
        """
        force = pressed.force * self._normal
        return {
            "normal_WE": self._believed.T,
            "normal_force": _added(self._believed * force)[:, np.newaxis],
            "normal_force_desired": pressed.desired[:, np.newaxis],
        }


def _added(rows: AnyArray) -> AnyArray:
    """Return the sum of three rows, shape (robots,)."""
    return rows[0] + rows[1] + rows[2]
