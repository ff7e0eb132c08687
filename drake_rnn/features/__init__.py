"""Features: what an experiment may have besides a law, an arm and a path, one file for each.

`FEATURES` has them all. A package of a user's own adds one as an entry point of the group
``drake_rnn.features``: the key of its section, and a class that extends `Feature`.
"""

from collections.abc import Container, Iterable
from functools import lru_cache
from importlib.metadata import EntryPoint, EntryPoints

from ..errors import InvalidInputError
from ..inputs.kinds import describe, find_entry_points
from ..measures import METRICS as METRICS
from .base import BaseFeature
from .camera import CameraFeature
from .contact import ContactFeature
from .detour import DetourFeature
from .feature import Feature as Feature
from .filter import FilterFeature
from .joint_noise import DisturbanceFeature, DitherFeature
from .locks import LocksFeature
from .objectives import ObjectivesFeature
from .handling import GoalsFeature
from .obstacles import ObstaclesFeature, SafetyFeature
from .second import SecondFeature
from .sensing import SensingFeature

_GROUP = "drake_rnn.features"

#: The features of this package, in the order in which they are asked. Each hands on what it leaves
#: of the guarantees to the next one.
FEATURES: tuple[Feature, ...] = (
    SecondFeature(),
    FilterFeature(),
    SensingFeature(),
    ObstaclesFeature(),
    DetourFeature(),
    GoalsFeature(),
    LocksFeature(),
    CameraFeature(),
    ContactFeature(),
    DitherFeature(),
    DisturbanceFeature(),
    SafetyFeature(),
    ObjectivesFeature(),
    BaseFeature(),
)

for _feature in FEATURES:
    METRICS.add(*_feature.metrics)


def installed_features(keys: Iterable[str], built_in: Container[str]) -> tuple[Feature, ...]:
    """Return the features of installed packages whose sections have some keys.

    Args:
        keys: Keys of a document.
        built_in: Keys that every document may have.

    Raises:
        InvalidInputError: If packages offer the same key, or one that is known, or if one cannot be
            loaded.
    """
    all_offers = find_entry_points(_GROUP)
    found = (_find_installed(key, all_offers, built_in) for key in keys)
    return tuple(feature for feature in found if feature is not None)


def _find_installed(key: str, all_offers: EntryPoints, built_in: Container[str]) -> Feature | None:
    offers = list(all_offers.select(name=key))
    if offers and key in built_in:
        raise InvalidInputError(
            f"{key}: is a key of drake_rnn, but is also offered by {_package(offers[0])}; that one "
            "needs another name"
        )
    if len(offers) > 1:
        packages = " and by ".join(map(_package, offers))
        raise InvalidInputError(f"{key}: is offered by {packages}; keep one")
    return _load(offers[0]) if offers else None


@lru_cache(maxsize=64)
def _load(offer: EntryPoint) -> Feature:
    what = f"{offer.name}: is offered by {_package(offer)} as {offer.value}"
    try:
        feature = offer.load()
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise InvalidInputError(f"{what}, which cannot be loaded: {describe(error)}") from error
    if not (isinstance(feature, type) and issubclass(feature, Feature)):
        raise InvalidInputError(f"{what}, which is no class that extends Feature")
    if feature.key != offer.name or feature.section is None:
        raise InvalidInputError(f"{what}, which must have this key, and a section")
    METRICS.add(*feature.metrics)
    return feature()


def _package(offer: EntryPoint) -> str:
    return "an installed package" if offer.dist is None else f"the package {offer.dist.name}"
