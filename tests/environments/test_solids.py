"""What a surface is to bodies that do not press on it: solids where the plant has its shapes."""

import numpy as np
import pytest
from pydrake.geometry import HalfSpace, ProximityProperties, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import CoulombFriction

from drake_rnn import InvalidInputError, ModelSurface, Plate, validated
from drake_rnn.environments import ContactModel, solids_of
from drake_rnn.robot.clearance.obstacles import BallObstacle, BoxObstacle

P = np.array([0.5, 0.1, 0.2])
# The body that is welded is not where its model's frame is, and the box not where the body is.
SLAB = """<sdf version="1.9"><model name="slab"><link name="slab"><pose>1 2 3 0 0 0.4</pose>
  <inertial><mass>1</mass></inertial><collision name="c"><pose>0 0 -0.05 0 0 0</pose>
  <geometry><box><size>0.3 0.2 0.1</size></box></geometry></collision></link></model></sdf>"""


@pytest.mark.parametrize("normal", [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])
def test_a_plate_is_a_box_below_its_surface(normal):
    plate = Plate(normal=normal, size=0.3, thickness=0.02)
    (box,) = solids_of(plate, P)
    assert isinstance(box, BoxObstacle)
    assert (box.name, box.size.tolist()) == ("environment", [0.3, 0.3, 0.02])
    np.testing.assert_allclose(box.center, P - 0.01 * plate.normal_W, atol=1e-12)
    np.testing.assert_allclose(box.R_WO[:, 2], plate.normal_W, atol=1e-9)


def test_a_models_shape_is_where_the_plant_that_is_simulated_has_it(tmp_path):
    file = tmp_path / "slab.sdf"
    file.write_text(SLAB)
    turned = np.array([0.0, 0.0, 0.3])
    (box,) = solids_of(ModelSurface(model=str(file), rotation=turned), P)
    np.testing.assert_allclose(box.center, P - np.array([0.0, 0.0, 0.05]), atol=1e-12)
    np.testing.assert_allclose(box.R_WO, RollPitchYaw(turned).ToRotationMatrix().matrix())


@validated
class Own(ContactModel):
    """Surfaces of a user's own, of any shapes."""

    shapes: tuple = ()

    def add_to(self, plant, p_WS):
        properties = ProximityProperties()
        properties.AddProperty("material", "coulomb_friction", CoulombFriction(0.3, 0.3))
        for k, shape in enumerate(self.shapes):
            plant.RegisterCollisionGeometry(
                plant.world_body(), RigidTransform(p_WS), shape, f"shape {k}", properties
            )


def test_those_of_a_surface_of_ones_own_are_found_too():
    balls = solids_of(Own(shapes=(Sphere(0.1), Sphere(0.2))), P)
    assert all(isinstance(ball, BallObstacle) for ball in balls)
    assert sorted((ball.name, ball.radius) for ball in balls) == [
        ("environment 1", 0.1),
        ("environment 2", 0.2),
    ]
    (floor,) = solids_of(Own(shapes=(HalfSpace(),)), P)
    np.testing.assert_allclose([floor.normal_W, floor.point], [[0.0, 0.0, 1.0], P], atol=1e-12)


def test_a_surface_of_too_many_shapes_is_refused():
    with pytest.raises(InvalidInputError, match="may have up to 200 geometries, not 201"):
        solids_of(Own(shapes=tuple(Sphere(0.1) for _ in range(201))), P)
