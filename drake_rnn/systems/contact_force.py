"""The true contact force on a tool, taken from the simulated contact."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import GeometryId
from pydrake.multibody.plant import ContactResults
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from .block import Block


class ContactForce(Block):
    """Sum of all contact forces on a tool: the true force, to compare sensor readings with.

    The input is ``contact_results`` of a plant, the output ``contact_force``, shape (3,) [N], in
    the world frame.

    Args:
        body: Index of the tool's body.
        geometries: Collision geometries of the tool.
    """

    def __init__(self, body: BodyIndex, geometries: Iterable[GeometryId]) -> None:
        super().__init__()
        # By their numbers: an identifier that a plant has returned keeps that plant alive.
        own = {geometry.get_value() for geometry in geometries}
        results = self.DeclareAbstractInputPort("contact_results", Value[ContactResults]())

        def contact_force(context: Context, output: Any) -> None:
            contacts = results.Eval(context)
            total = np.zeros(3)
            for k in range(contacts.num_hydroelastic_contacts()):
                patch = contacts.hydroelastic_contact_info(k)
                surface = patch.contact_surface()
                # Drake reports the force on the body of geometry M.
                if surface.id_M().get_value() in own:
                    total += patch.F_Ac_W().translational()
                elif surface.id_N().get_value() in own:
                    total -= patch.F_Ac_W().translational()
            for k in range(contacts.num_point_pair_contacts()):
                pair = contacts.point_pair_contact_info(k)
                if pair.bodyB_index() == body:
                    total += pair.contact_force()
                elif pair.bodyA_index() == body:
                    total -= pair.contact_force()
            output.set_value(total)

        self.DeclareVectorOutputPort("contact_force", 3, contact_force, {results.ticket()})
