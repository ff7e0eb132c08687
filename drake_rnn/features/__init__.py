"""Features: what an experiment may have besides a law, an arm and a path, one file for each.

`FEATURES` has them all. A package of a user's own adds one as an entry point of the group
``drake_rnn.features``: the key of its section, and a class that extends `Feature`.
"""

from collections.abc import Container, Iterable
from functools import lru_cache
from importlib.metadata import EntryPoint

from ..errors import InvalidInputError
from ..inputs.kinds import described, offered
from ..measures import METRICS as METRICS
from .camera import CameraFeature
from .contact import ContactFeature
from .feature import Feature as Feature
from .filter import FilterFeature
from .joint_noise import DisturbanceFeature, DitherFeature
from .locks import LocksFeature
from .obstacles import ObstaclesFeature
from .safety import SafetyFeature
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
    LocksFeature(),
    CameraFeature(),
    ContactFeature(),
    DitherFeature(),
    DisturbanceFeature(),
    SafetyFeature(),
)

for _feature in FEATURES:
    METRICS.add(*_feature.metrics)


def installed_features(keys: Iterable[str], known: Container[str]) -> tuple[Feature, ...]:
    """Return the features of installed packages whose sections have some keys.

    Args:
        keys: Keys of a document.
        known: Keys that every document may have.

    Raises:
        InvalidInputError: If packages offer the same key, or one that is known, or if one cannot be
            loaded.
    """
    return tuple(found for key in keys if (found := _installed(key, known)) is not None)


def _installed(key: str, known: Container[str]) -> Feature | None:
    offers = list(offered(_GROUP).select(name=key))
    if offers and key in known:
        raise InvalidInputError(
            f"{key}: is a key of drake_rnn, but is also offered by {_package(offers[0])}; that one "
            "needs another name"
        )
    if len(offers) > 1:
        packages = " and by ".join(map(_package, offers))
        raise InvalidInputError(f"{key}: is offered by {packages}; keep one")
    return _loaded(offers[0]) if offers else None


@lru_cache(maxsize=64)
def _loaded(offer: EntryPoint) -> Feature:
    what = f"{offer.name}: is offered by {_package(offer)} as {offer.value}"
    try:
        found = offer.load()
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise InvalidInputError(f"{what}, which cannot be loaded: {described(error)}") from error
    if not (isinstance(found, type) and issubclass(found, Feature)):
        raise InvalidInputError(f"{what}, which is no class that extends Feature")
    if found.key != offer.name or found.section is None:
        raise InvalidInputError(f"{what}, which must have this key, and a section")
    METRICS.add(*found.metrics)
    return found()


def _package(offer: EntryPoint) -> str:
    return "an installed package" if offer.dist is None else f"the package {offer.dist.name}"
