"""The classes that a section of a document may name by its ``kind``."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping, MutableMapping
from importlib.metadata import EntryPoint
from typing import Any, Generic, TypeVar, cast

from ..errors import InvalidInputError
from .complaints import nearest, short
from .modules import Modules, object_named
from .offers import offered
from .own_code import described

T = TypeVar("T")


class Kinds(MutableMapping[str, type[T]], Generic[T]):
    """Classes by their ``kind``: shipped, registered in Python, or those of installed packages.

    ``KINDS["my_kind"] = MyClass`` registers a class. Installed packages offer theirs as entry
    points of the group ``drake_rnn.<section>s``, which are loaded when their name is asked for.
    Classes of any other module have the name ``module:Class``.

    Args:
        section: Name of the document's section.
        base: Class that all of them extend.
        shipped: Classes of this package by their ``kind``.
    """

    def __init__(self, section: str, base: type, shipped: Mapping[str, type[T]]) -> None:
        self.section = section
        self.group = f"drake_rnn.{section}s"
        self._base = base
        self._shipped = dict(shipped)
        self._known = dict(shipped)

    @property
    def shipped(self) -> dict[str, type[T]]:
        """The classes of this package, by their ``kind``."""
        return dict(self._shipped)

    def __getitem__(self, kind: str) -> type[T]:
        return self._known[kind]

    def __setitem__(self, kind: str, cls: type[T]) -> None:
        """Register a class.

        A class may be replaced by a new version of itself, as when a cell of a notebook runs again.

        Raises:
            InvalidInputError: If the name is taken or is none, or the class does not fit.
        """
        if not isinstance(kind, str) or not kind.strip() or ":" in kind:
            raise InvalidInputError(
                f"{self.section}.kind: must be a text without a colon, not {short(kind)}"
            )
        self._fitting(cls, f"{self.section}.kind: {kind}")
        known = self._known.get(kind)
        if known is not None and _name(known) != _name(cls):
            raise InvalidInputError(
                f"{self.section}.kind: {kind!r} is {_name(known)} already; {_name(cls)} needs "
                "another name"
            )
        self._known[kind] = cls

    def __delitem__(self, kind: str) -> None:
        """Forget a registered class; shipped ones stay.

        Raises:
            InvalidInputError: If the class is a shipped one.
        """
        if kind in self._shipped:
            raise InvalidInputError(f"{self.section}.kind: {kind!r} is shipped, and stays")
        del self._known[kind]

    def __iter__(self) -> Iterator[str]:
        return iter(self._known)

    def __len__(self) -> int:
        return len(self._known)

    def named_by(
        self, section: Mapping[str, Any], modules: Modules = True, place: str | None = None
    ) -> type[T]:
        """Return the class that the ``kind`` of a document's section names.

        Args:
            section: The section.
            modules: Modules that may be imported for a ``kind`` of the form ``module:Class``.
            place: Key of the section in the document, for messages; by default its name.

        Raises:
            InvalidInputError: If ``kind`` is missing, names nothing, or names what cannot be
                imported or used.
        """
        key, kind = f"{place or self.section}.kind", section.get("kind")
        if kind is None:
            raise InvalidInputError(f"{key}: must be given; it may be {', '.join(self)}")
        if isinstance(kind, str) and ":" in kind:
            return self._fitting(object_named(kind, key, modules), f"{key}: {kind}")
        offers = list(offered(self.group).select(name=kind)) if isinstance(kind, str) else []
        if isinstance(kind, str) and kind in self._known:
            return self._unrivalled(kind, offers, key)
        if not offers:
            every = [*self, *sorted(offered(self.group).names)]
            raise InvalidInputError(
                f"{key}: no {self.section} {short(kind)}; {nearest(str(kind), every)}; one of "
                "your own is named module:Class"
            )
        if len(offers) > 1:
            raise InvalidInputError(
                f"{key}: {kind!r} is offered by {' and by '.join(map(_offer, offers))}; name the "
                "one you mean as module:Class"
            )
        return self._loaded(offers[0], key)

    def _unrivalled(self, kind: str, offers: list[EntryPoint], key: str) -> type[T]:
        """Return a known class, unless an installed package offers another one of its name."""
        known = self._known[kind]
        for offer in offers:
            if kind in self._shipped or self._loaded(offer, key) is not known:
                raise InvalidInputError(
                    f"{key}: {kind!r} is {_name(known)}, but is also offered by "
                    f"{_offer(offer)}; that one needs another name"
                )
        return known

    def _loaded(self, offer: EntryPoint, key: str) -> type[T]:
        try:
            found = offer.load()
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            raise InvalidInputError(
                f"{key}: {offer.name!r} is offered by {_offer(offer)}, which cannot be loaded: "
                f"{described(error)}"
            ) from error
        return self._fitting(found, f"{key}: {offer.value}")

    def _fitting(self, found: Any, what: str) -> type[T]:
        """Return ``found``, of the key and name ``what``, if a document can describe it."""
        if not (isinstance(found, type) and issubclass(found, self._base)):
            raise InvalidInputError(
                f"{what}: must be a class that extends {self._base.__name__}, not {_nature(found)}"
            )
        if inspect.isabstract(found):
            lacking = ", ".join(sorted(vars(found)["__abstractmethods__"]))
            raise InvalidInputError(f"{what}: {found.__name__} must have {lacking} as well")
        # Inherited fields do not count: pydantic would make an object of the base class.
        if "__pydantic_fields__" not in vars(found):
            raise InvalidInputError(
                f"{what}: {found.__name__} must be decorated with @validated from drake_rnn, "
                "which checks its fields"
            )
        return cast("type[T]", found)


def _name(cls: type) -> str:
    return f"{cls.__module__}.{cls.__qualname__}"


def _offer(offer: EntryPoint) -> str:
    package = "an installed package" if offer.dist is None else f"the package {offer.dist.name}"
    return f"{package} as {offer.value}"


def _nature(found: object) -> str:
    if isinstance(found, type):
        return f"the class {_name(found)}"
    return f"of class {type(found).__name__}"
