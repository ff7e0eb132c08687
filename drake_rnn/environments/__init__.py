"""Surfaces that a tool is pressed against, modelled as a spring or as bodies in contact."""

from ..inputs.kinds import Kinds
from .contact_model import ContactModel, TipMaterial
from .elastic_surface import ElasticSurface
from .model_surface import ModelSurface
from .plate import Plate
from .surface import Surface

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

__all__ = [
    "ENVIRONMENTS",
    "ContactModel",
    "ElasticSurface",
    "ModelSurface",
    "Plate",
    "Surface",
    "TipMaterial",
]
