"""A surface from a model file."""

# No postponed annotations: see `surface`.
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from ..errors import InvalidInputError
from ..inputs.fields import Angles, Array, Point, validated, zeros
from ..inputs.given_file import content_of, is_file
from ..inputs.keys import Meaning
from ..robot.contact_mesh import require_coarse_balls
from ..robot.model.still import require_finite_meshes
from ..robot.model.xml_text import MOST_BYTES, parse_xml
from .contact_model import ContactModel


@validated
class ModelSurface(ContactModel):
    """A surface given by a model file; the model's origin lies on it, below the tool."""

    # The file may contain any shape.
    is_plane = False

    kind: Literal["model"] = "model"
    model: Annotated[
        str,
        Meaning(
            "URDF, SDF or MJCF file. Its first body is welded to the world, so the file must "
            "leave it free; its collision geometry needs hydroelastic properties.",
        ),
    ]
    rotation: Annotated[
        Angles,
        Meaning("Roll, pitch and yaw of the model in the base frame.", unit="rad"),
    ] = Field(default_factory=zeros)
    offset: Annotated[
        Point,
        Meaning("Offset of the model's origin, in the base frame, shape (3,).", unit="m"),
    ] = Field(default_factory=zeros)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not is_file(self.model):
            raise ValueError(f"model: no file {self.model!r}")
        root = parse_xml(content_of(self.model, MOST_BYTES))
        if root is not None:
            require_coarse_balls("model", root)
            require_finite_meshes("model", root, Path(self.model))

    def add_to(self, plant: MultibodyPlant, p_WS: Array) -> None:
        """See `ContactModel.add_to`.

        Raises:
            InvalidInputError: If the file cannot be read, does not hold exactly one model, or the
                model has no body that can be welded.
        """
        parser = Parser(plant)
        parser.SetAutoRenaming(True)
        try:
            instances = parser.AddModels(self.model)
            bodies = [body for instance in instances for body in plant.GetBodyIndices(instance)]
            if len(instances) != 1 or not bodies:
                raise InvalidInputError(
                    f"environment.model: {self.model} holds {len(instances)} models with "
                    f"{len(bodies)} bodies of their own; it must hold one model with a body to weld"
                )
            base = plant.get_body(bodies[0])
            X_WM = RigidTransform(RollPitchYaw(*self.rotation), p_WS + self.offset)
            plant.WeldFrames(plant.world_frame(), base.body_frame(), X_WM)
        except RuntimeError as error:
            raise InvalidInputError(
                f"environment.model: {self.model}: {' '.join(str(error).split())}"
            ) from None
