"""Surfaces that a tool is pressed against, modelled as a spring or as bodies in contact."""

from ..inputs.kinds import Kinds
from .contact_model import ContactModel as ContactModel, TipMaterial as TipMaterial
from .elastic_surface import ElasticSurface as ElasticSurface
from .model_surface import ModelSurface as ModelSurface
from .plate import Plate as Plate
from .surface import Surface as Surface

#: Environments by their ``kind``.
ENVIRONMENTS: Kinds[Surface] = Kinds(
    "environment",
    Surface,
    {
        "elastic_surface": ElasticSurface,
        "plate": Plate,
        "model": ModelSurface,
    },
)
