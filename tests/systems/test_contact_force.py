"""The sum of what touches a tool."""

import numpy as np
import pytest
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from drake_rnn.systems import ContactForce

MASS, RADIUS = 2.0, 0.05


def resting(kind="hydroelastic", of="ball", ball_first=True, height=None):
    """The force on a ball, or on the ground, once the ball lies on it."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    friction = CoulombFriction(0.5, 0.5)

    def add_ball():
        inertia = SpatialInertia.SolidSphereWithMass(MASS, RADIUS)
        body = plant.AddRigidBody("ball", inertia)
        properties = ProximityProperties()
        if kind == "hydroelastic":
            AddCompliantHydroelasticProperties(0.02, 1e6, properties)
        AddContactMaterial(dissipation=2.0, friction=friction, properties=properties)
        shape = Sphere(RADIUS)
        return body, [
            plant.RegisterCollisionGeometry(body, RigidTransform(), shape, "ball", properties)
        ]

    def add_ground():
        properties = ProximityProperties()
        if kind == "hydroelastic":
            AddRigidHydroelasticProperties(0.5, properties)
        AddContactMaterial(dissipation=2.0, friction=friction, properties=properties)
        body = plant.AddRigidBody("ground", SpatialInertia.SolidSphereWithMass(1.0, 1.0))
        plant.WeldFrames(plant.world_frame(), body.body_frame())
        return body, [
            plant.RegisterCollisionGeometry(
                body, RigidTransform([0, 0, -0.05]), Box(0.5, 0.5, 0.1), "ground", properties
            )
        ]

    parts = {}
    for add in (add_ball, add_ground) if ball_first else (add_ground, add_ball):
        parts[add.__name__[4:]] = add()
    plant.Finalize()
    body, geometries = parts[of]
    force = builder.AddSystem(ContactForce(body.index(), geometries))
    builder.Connect(plant.get_contact_results_output_port(), force.get_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    start = RADIUS if height is None else height
    ball = parts["ball"][0]
    plant.SetFreeBodyPose(plant.GetMyContextFromRoot(context), ball, RigidTransform([0, 0, start]))
    simulator.AdvanceTo(0.05 if height else 1.0)
    return force.get_output_port().Eval(force.GetMyContextFromRoot(context))


@pytest.mark.parametrize("kind", ["hydroelastic", "point"])
@pytest.mark.parametrize("ball_first", [True, False])
def test_a_ball_at_rest_is_carried_by_its_weight(kind, ball_first):
    """Whichever of the two Drake names first; 1e-3 N: it still settles."""
    np.testing.assert_allclose(resting(kind, "ball", ball_first), [0, 0, MASS * 9.81], atol=1e-3)


@pytest.mark.parametrize("kind", ["hydroelastic", "point"])
def test_what_carries_it_feels_the_opposite(kind):
    np.testing.assert_allclose(resting(kind, "ground"), [0, 0, -MASS * 9.81], atol=1e-3)


def test_what_flies_feels_nothing():
    np.testing.assert_array_equal(resting(height=1.0), 0.0)
