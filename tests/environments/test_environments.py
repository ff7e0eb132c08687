"""What a tool is pressed against."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydrake.math import RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from drake_rnn import (
    Contact,
    ContactModel,
    ElasticSurface,
    ForceProfile,
    InvalidInputError,
    ModelSurface,
    PlantArm,
    Plate,
    TipMaterial,
    load_arm,
    load_experiment,
    validated,
)
from drake_rnn.environments import ENVIRONMENTS

normals = arrays(float, 3, elements=st.floats(-1, 1)).filter(lambda n: np.linalg.norm(n) > 0.1)
points = arrays(float, 3, elements=st.floats(-1, 1))
IIWA = load_arm("iiwa14", frame="tip")
PAD = """<robot name="pad"><link name="pad"><inertial><mass value="1"/>
  <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="0 0 -0.05"/><geometry><box size="0.2 0.2 0.1"/></geometry></collision>
  </link>{more}</robot>"""
TWO = """<sdf version="1.9"><model name="one"><link name="a"/></model>
  <model name="other"><link name="b"/></model></sdf>"""


@given(normals)
def test_a_normal_may_be_of_any_length(normal):
    surface = Plate(normal=normal)
    assert np.linalg.norm(surface.normal_W) == pytest.approx(1.0)
    assert surface.normal_W.dot(normal) == pytest.approx(np.linalg.norm(normal))


def test_what_the_law_believes_is_the_normal_unless_it_is_told_another():
    np.testing.assert_array_equal(Plate(normal=[0, 3, 4]).believed_normal_W, [0.0, 0.6, 0.8])
    wrong = Plate(normal=[0, 3, 4], believed_normal=[0, 0, 2])
    np.testing.assert_array_equal(wrong.believed_normal_W, [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(wrong.normal_W, [0.0, 0.6, 0.8])


@given(normals, points, points)
def test_a_plates_upper_face_is_the_surface(normal, p_WS, offset):
    """Its z along the normal, its middle half a thickness below, moved only within its plane."""
    n = Plate(normal=normal).normal_W
    offset = offset - n.dot(offset) * n
    X_WP = Plate(normal=normal, offset=offset, thickness=0.03).pose(p_WS)
    # 2e-6: the square root of what two normals may differ by to count as one.
    np.testing.assert_allclose(X_WP.rotation().col(2), n, atol=2e-6)
    along = X_WP.multiply(np.array([0.0, 0.0, 0.015])) - p_WS
    np.testing.assert_allclose(along, offset, atol=1e-7)


def test_a_plate_that_is_all_but_level_is_tilted_as_it_says():
    """Its face, not only the law's normal: 0.04 rad over 0.2 m is 8 mm."""
    plate = Plate(normal=[0.04, 0.0, 1.0])
    np.testing.assert_allclose(plate.pose(np.zeros(3)).rotation().col(2), plate.normal_W)


@pytest.mark.parametrize("z", [1.0, -1.0])
def test_a_level_plates_edges_lie_along_the_axes_of_the_base(z):
    R = Plate(normal=[0, 0, z]).pose(np.zeros(3)).rotation().matrix()
    np.testing.assert_allclose(np.abs(R), np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)


def pad(tmp_path, more=""):
    file = tmp_path / "pad.urdf"
    file.write_text(PAD.format(more=more))
    return str(file)


def pressed(surface):
    return PlantArm(IIWA, IIWA.home, Contact(surface, ForceProfile(value=5.0)))


def test_a_model_is_placed_with_its_origin_on_the_surface(tmp_path):
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    surface = ModelSurface(model=pad(tmp_path), rotation=[0.1, 0.2, 0.3], offset=[0.0, 0.1, 0.02])
    surface.add_to(plant, np.array([0.5, 0.0, 0.2]))
    plant.Finalize()
    diagram = builder.Build()
    context = plant.GetMyContextFromRoot(diagram.CreateDefaultContext())
    X_WB = plant.GetBodyByName("pad").EvalPoseInWorld(context)
    np.testing.assert_allclose(X_WB.translation(), [0.5, 0.1, 0.22], atol=1e-12)
    expected = RollPitchYaw(0.1, 0.2, 0.3).ToRotationMatrix().matrix()
    np.testing.assert_allclose(X_WB.rotation().matrix(), expected, atol=1e-12)
    assert plant.num_positions() == 0


HELD = '<link name="world"/><joint name="w" type="fixed"><parent link="world"/><child link="pad"/></joint>'  # noqa: E501


def test_a_model_that_holds_itself_is_refused(tmp_path):
    surface = ModelSurface(model=pad(tmp_path, HELD))
    with pytest.raises(InvalidInputError, match=r"environment\.model: .*pad\.urdf"):
        pressed(surface)


def test_a_file_of_two_models_is_refused(tmp_path):
    """The second would fall."""
    file = tmp_path / "two.sdf"
    file.write_text(TWO)
    with pytest.raises(InvalidInputError, match=r"environment\.model: .*two\.sdf.* one model"):
        pressed(ModelSurface(model=str(file)))


NESTED = """<sdf version="1.9"><model name="outer" placement_frame="inner::a">
  <model name="inner"><link name="a"/></model></model></sdf>"""


def test_a_model_within_a_model_is_refused(tmp_path):
    file = tmp_path / "nested.sdf"
    file.write_text(NESTED)
    with pytest.raises(InvalidInputError, match=r"environment\.model: .*nested.* holds 2 models"):
        pressed(ModelSurface(model=str(file)))


def test_a_file_that_is_no_model_is_refused(tmp_path):
    file = tmp_path / "no.urdf"
    file.write_text("no")
    with pytest.raises(InvalidInputError, match=r"environment\.model: .*no\.urdf"):
        pressed(ModelSurface(model=str(file)))


def test_environments_are_known_by_their_kind():
    for kind, environment in ENVIRONMENTS.items():
        assert environment.__dataclass_fields__["kind"].default == kind


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Plate(normal=[0, 0, 0]), "normal: must not be zero"),
        (lambda: Plate(believed_normal=[0, 0, 0]), "believed_normal: must not be zero"),
        (
            lambda: Plate(believed_normal=[0.1, 0, -1]),
            r"believed_normal: must be less than a right angle .* not \[0\.1, 0\.0, -1\.0\]",
        ),
        (lambda: Plate(normal=[0, 1]), "normal: must have 3 entries"),
        (lambda: Plate(friction=-0.1), "friction"),
        (lambda: Plate(offset=[0, 0, 0.1]), r"offset: must be parallel to the plate, not 0\.1 m"),
        (lambda: Plate(thickness=0.001), "thickness"),
        (lambda: Plate(hydroelastic_modulus=0.0), "hydroelastic_modulus"),
        (lambda: Plate(standoff=-0.1), "standoff"),
        (lambda: ElasticSurface(stiffness=0.0), "stiffness"),
        (lambda: ElasticSurface(stiffness=1.0, friction=0.3), "friction"),
        (lambda: ModelSurface(model="nowhere.urdf"), "model: no file 'nowhere.urdf'"),
        (lambda: TipMaterial(hydroelastic_modulus=-1.0), "hydroelastic_modulus"),
        (lambda: TipMaterial(mesh_resolution=0.0), "mesh_resolution"),
        (lambda: TipMaterial(dissipation=-1.0), "dissipation"),
    ],
)
def test_what_it_cannot_be_is_refused_by_name(make, message):
    with pytest.raises(InvalidInputError, match=message):
        make()


class TestOwnSurfaces:
    """A user's own surface that fails is named, with the part."""

    @staticmethod
    def press_on(**members):
        """An arm with a contact on a surface with such members."""
        own = type("Mine", (ContactModel,), {"add_to": lambda self, plant, p_WS: None, **members})
        return PlantArm(IIWA, contact=Contact(own(), ForceProfile(value=1.0)))

    def test_one_with_which_nothing_is_wrong_is_taken(self):
        assert self.press_on().contact.surface.is_plane

    @pytest.mark.parametrize(
        ("members", "message"),
        [
            (
                {"add_to": lambda self, plant, p_WS: 1 / 0},
                r"^Mine\.add_to raised ZeroDivisionError: division by zero$",
            ),
            (
                {"add_to": lambda self, plant: None},
                r"^Mine\.add_to raised TypeError: .* takes 2 positional arguments but 3 were given",
            ),
            (
                {"normal_W": np.array([0.0, 0.0, 2.0])},
                r"^Mine\.normal_W: must be an array of shape \(3,\) and of length 1, not \[0\.0, 0",
            ),
            ({"is_plane": "yes"}, r"^Mine\.is_plane: must be of class bool, not 'yes'$"),
        ],
    )
    def test_one_with_which_something_is_is_refused(self, members, message):
        with pytest.raises(InvalidInputError, match=message):
            self.press_on(**members)

    def test_so_is_an_overhang_that_is_no_length(self, monkeypatch):
        own = validated(type("Mine", (Plate,), {"overhang": lambda self, points, p_WS: None}))
        monkeypatch.setitem(ENVIRONMENTS, "mine", own)
        with pytest.raises(InvalidInputError, match=r"^Mine\.overhang raised TypeError"):
            load_experiment("contact_circle", {"environment": {"kind": "mine"}})
