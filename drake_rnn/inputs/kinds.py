"""Classes that a document names by their ``kind``: shipped, registered, installed, or a user's own.

- `Kinds`: the classes that a section of a document may name.
- ``module:Class``: classes of a user's own modules.
- What installed packages offer. To find it, Python reads the entry points of every installed
  package, which took a quarter of the time in which an experiment is made: so it is read again only
  once something was installed.
- Errors in a user's own code, as a sentence that names the code.
"""

from __future__ import annotations

import importlib
import inspect
import os
import re
import sys
from collections.abc import Collection, Iterator, Mapping, MutableMapping
from contextlib import contextmanager
from functools import lru_cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from importlib.util import find_spec
from operator import attrgetter
from pathlib import Path
from types import ModuleType, NoneType
from typing import Any, Generic, TypeVar, cast

from ..errors import DrakeRnnError, InvalidInputError, OldName
from .messages import field_names, nearest, require_type, short


@contextmanager
def naming(
    place: str,
    t: float | None = None,
    *,
    but: type[Exception] = DrakeRnnError,
    key: str = "",
    own: type = NoneType,
) -> Iterator[None]:
    """Turn any error raised within into an `InvalidInputError` that names the place.

    Errors of this package already say what is wrong, and pass. One that blames a key of the arm, or
    an argument, names the key of the section instead that has a field of this name: it was given
    there, e.g. ``frame`` to an objective that looks at a link of the arm.

    Args:
        place: Code that runs within, e.g. ``MyLaw.step``.
        t: Simulated time [s]; None outside of a simulation.
        but: Further errors that pass.
        key: Key of a section.
        own: Class that is made of that section.
    """
    try:
        yield
    except InvalidInputError as error:
        cause, colon, message = str(error).partition(": ")
        name = cause.removeprefix("arm.")
        if not (key and colon and name in field_names(own)):
            raise
        raise InvalidInputError(f"{key}.{name}: {message}") from error
    except (DrakeRnnError, KeyboardInterrupt, but):
        raise
    except BaseException as error:
        raise InvalidInputError(f"{place} raised {describe(error)}{at(t)}") from error


def describe(error: BaseException) -> str:
    """Return an error as a text of one line: its class and its message."""
    message = " ".join(str(error).split())
    return f"{type(error).__name__}: {message}" if message else type(error).__name__


def at(t: float | None) -> str:
    """Return a simulated time [s] as the end of a message; nothing for None."""
    return "" if t is None else f" (at t = {t:.6g} s)"


#: Modules that may be imported: True for any, False for none, or names of modules and packages.
#: Whatever has been imported already may be used.
Modules = bool | Collection[str]

_NAME = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*(\.[^\W\d]\w*)*")


def object_named(name: str, key: str, modules: Modules) -> object:
    """Return what ``module:Class`` names; the module is imported if that is allowed.

    Args:
        name: Name of the form ``package.module:Class``.
        key: Key of the name in a document, for messages.
        modules: Modules that may be imported.

    Raises:
        InvalidInputError: If the name has another form; if the module must not be imported, does
            not exist or fails; or if it has no such class.
    """
    if not _NAME.fullmatch(name):
        raise InvalidInputError(
            f"{key}: must be module:Class, e.g. my_package.my_law:MyLaw, not {name!r}"
        )
    module_name, _, place = name.partition(":")
    module = sys.modules.get(module_name)
    if module is None:
        _require_allowed(module_name, key, modules)
        module = _import(module_name, key)
    try:
        return attrgetter(place)(module)
    except AttributeError:
        raise InvalidInputError(f"{key}: the module {module_name!r} has no {place!r}") from None


def look_beside(document: Any, folder: Path) -> None:
    """Let Python find modules of a document beside it, where it finds none of that name elsewhere.

    Args:
        document: Contents of the document.
        folder: Its folder.
    """
    for name in _modules_named(document):
        top = name.partition(".")[0]
        beside = (folder / f"{top}.py", folder / top / "__init__.py")
        if str(folder) in sys.path or not any(file.is_file() for file in beside):
            continue
        try:
            is_importable = find_spec(top) is not None
        except (ImportError, ValueError):
            is_importable = True
        if not is_importable:
            # Last, so that it takes the place of nothing.
            sys.path.append(str(folder))
            importlib.invalidate_caches()


def _modules_named(value: Any, key: str = "") -> Iterator[str]:
    """Yield the modules of the classes that sections name by their ``kind``."""
    if isinstance(value, Mapping):
        for name, each in value.items():
            yield from _modules_named(each, str(name))
    elif isinstance(value, list) and value and isinstance(value[0], (Mapping, str)):
        for each in value:
            yield from _modules_named(each, key)
    elif isinstance(value, str) and key.rpartition(".")[2] == "kind" and _NAME.fullmatch(value):
        yield value.partition(":")[0]


def require_modules(modules: Modules) -> None:
    """Raise an InvalidInputError unless it is said which modules may be imported."""
    require_type("modules", modules, bool, Collection)
    if not isinstance(modules, bool) and not all(isinstance(name, str) for name in modules):
        raise InvalidInputError(f"modules: must be names of modules, not {short(modules)}")


def _require_allowed(module: str, key: str, modules: Modules) -> None:
    if isinstance(modules, bool):
        is_allowed = modules
    else:
        names = [modules] if isinstance(modules, str) else list(modules)
        is_allowed = any(module == name or module.startswith(f"{name}.") for name in names)
    if not is_allowed:
        raise InvalidInputError(
            f"{key}: is in the module {module!r}, which is imported only when told to: give "
            f"modules=[{module!r}], or modules=True"
        )


def _import(name: str, key: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is not None and (name == error.name or name.startswith(f"{error.name}.")):
            raise InvalidInputError(
                f"{key}: there is no module {name!r} where Python looks for modules; for the "
                "command line also in the current folder, PYTHONPATH and the document's folder"
            ) from None
        raise InvalidInputError(_failure(name, key, error)) from error
    except KeyboardInterrupt:
        raise
    # A module that is a script may also end the program, or raise an exception of another kind.
    except BaseException as error:
        raise InvalidInputError(_failure(name, key, error)) from error


def _failure(name: str, key: str, error: BaseException) -> str:
    return f"{key}: the module {name!r} cannot be imported: {describe(error)}"


def find_entry_points(group: str) -> EntryPoints:
    """Return the entry points of a group, of all packages that can be imported now."""
    return _read(group, tuple((folder, _time_of_change(folder)) for folder in sys.path))


@lru_cache(maxsize=64)
def _read(group: str, places: tuple[tuple[str, int], ...]) -> EntryPoints:
    """Return those of a group; they depend on the places only by what is installed there."""
    return entry_points(group=group)


def _time_of_change(folder: str) -> int:
    """Return when a package was last put into a folder, or taken from it [ns]; -1 without one."""
    try:
        return os.stat(folder or ".").st_mtime_ns
    except OSError:
        return -1


T = TypeVar("T")
# How a class of a user's own is named.
_OWN = "one of your own is named module:Class"


class Kinds(MutableMapping[str, type[T]], Generic[T]):
    """Classes by their ``kind``: shipped, registered in Python, or those of installed packages.

    ``KINDS["my_kind"] = MyClass`` registers a class. Installed packages offer theirs as entry
    points of the group ``drake_rnn.<section>s``, which are loaded when their name is asked for.
    Classes of any other module have the name ``module:Class``.

    Args:
        section: Name of the document's section.
        base: Class that all of them extend.
        kinds: Classes of this package by their ``kind``.
    """

    def __init__(self, section: str, base: type, kinds: Mapping[str, type[T]]) -> None:
        self.section = section
        self.group = f"drake_rnn.{section}s"
        self._base = base
        self._shipped = dict(kinds)
        self._known = dict(kinds)

    @property
    def shipped_classes(self) -> dict[str, type[T]]:
        """The classes of this package, by their ``kind``."""
        return dict(self._shipped)

    shipped = OldName("shipped_classes")

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
        present = self._known.get(kind)
        if present is not None and _name(present) != _name(cls):
            raise InvalidInputError(
                f"{self.section}.kind: {kind!r} is {_name(present)} already; {_name(cls)} needs "
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
            text = f"it may be {', '.join(self)}" if self else _OWN
            raise InvalidInputError(f"{key}: must be given; {text}")
        if isinstance(kind, str) and ":" in kind:
            return self._fitting(object_named(kind, key, modules), f"{key}: {kind}")
        offers = (
            list(find_entry_points(self.group).select(name=kind)) if isinstance(kind, str) else []
        )
        if isinstance(kind, str) and kind in self._known:
            return self._refuse_rivals(kind, offers, key)
        if not offers:
            every = [*self, *sorted(find_entry_points(self.group).names)]
            raise InvalidInputError(
                f"{key}: no {self.section.replace('_', ' ')} {short(kind)}; "
                f"{nearest(str(kind), every) + '; ' if every else ''}{_OWN}"
            )
        if len(offers) > 1:
            raise InvalidInputError(
                f"{key}: {kind!r} is offered by {' and by '.join(map(_offer, offers))}; name the "
                "one you mean as module:Class"
            )
        return self._load(offers[0], key)

    def _refuse_rivals(self, kind: str, offers: list[EntryPoint], key: str) -> type[T]:
        """Return a known class, unless an installed package offers another one of its name."""
        present = self._known[kind]
        for offer in offers:
            if kind in self._shipped or self._load(offer, key) is not present:
                raise InvalidInputError(
                    f"{key}: {kind!r} is {_name(present)}, but is also offered by "
                    f"{_offer(offer)}; that one needs another name"
                )
        return present

    def _load(self, offer: EntryPoint, key: str) -> type[T]:
        try:
            cls = offer.load()
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            raise InvalidInputError(
                f"{key}: {offer.name!r} is offered by {_offer(offer)}, which cannot be loaded: "
                f"{describe(error)}"
            ) from error
        return self._fitting(cls, f"{key}: {offer.value}")

    def _fitting(self, cls: Any, what: str) -> type[T]:
        """Return ``cls``, of the key and name ``what``, if a document can describe it."""
        if not (isinstance(cls, type) and issubclass(cls, self._base)):
            raise InvalidInputError(
                f"{what}: must be a class that extends {self._base.__name__}, not {_nature(cls)}"
            )
        if inspect.isabstract(cls):
            lacking = ", ".join(sorted(vars(cls)["__abstractmethods__"]))
            raise InvalidInputError(f"{what}: {cls.__name__} must have {lacking} as well")
        # Inherited fields do not count: pydantic would make an object of the base class.
        if "__pydantic_fields__" not in vars(cls):
            raise InvalidInputError(
                f"{what}: {cls.__name__} must be decorated with @validated from drake_rnn, "
                "which checks its fields"
            )
        return cast("type[T]", cls)


def _name(cls: type) -> str:
    return f"{cls.__module__}.{cls.__qualname__}"


def _offer(offer: EntryPoint) -> str:
    package = "an installed package" if offer.dist is None else f"the package {offer.dist.name}"
    return f"{package} as {offer.value}"


def _nature(cls: object) -> str:
    if isinstance(cls, type):
        return f"the class {_name(cls)}"
    return f"of class {type(cls).__name__}"
