"""Classes of a user's own modules, by the name ``module:Class``."""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Collection
from operator import attrgetter
from types import ModuleType

from ..errors import InvalidInputError
from .complaints import require_type, short
from .own_code import described

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
        module = _imported(module_name, key)
    try:
        return attrgetter(place)(module)
    except AttributeError:
        raise InvalidInputError(f"{key}: the module {module_name!r} has no {place!r}") from None


def require_modules(modules: Modules) -> None:
    """Raise an InvalidInputError unless it is said which modules may be imported."""
    require_type("modules", modules, bool, Collection)
    if not isinstance(modules, bool) and not all(isinstance(name, str) for name in modules):
        raise InvalidInputError(f"modules: must be names of modules, not {short(modules)}")


def _require_allowed(module: str, key: str, modules: Modules) -> None:
    if isinstance(modules, bool):
        allowed = modules
    else:
        names = [modules] if isinstance(modules, str) else list(modules)
        allowed = any(module == name or module.startswith(f"{name}.") for name in names)
    if not allowed:
        raise InvalidInputError(
            f"{key}: is in the module {module!r}, which is imported only when told to: give "
            f"modules=[{module!r}], or modules=True"
        )


def _imported(name: str, key: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is not None and (name == error.name or name.startswith(f"{error.name}.")):
            raise InvalidInputError(
                f"{key}: there is no module {name!r} where Python looks for modules; for the "
                "command line that includes the current folder and PYTHONPATH"
            ) from None
        raise InvalidInputError(_failure(name, key, error)) from error
    except KeyboardInterrupt:
        raise
    # A module that is a script may also end the program, or raise an exception of another kind.
    except BaseException as error:
        raise InvalidInputError(_failure(name, key, error)) from error


def _failure(name: str, key: str, error: BaseException) -> str:
    return f"{key}: the module {name!r} cannot be imported: {described(error)}"
