"""Signatures as one reads them.

``Annotated[float, ...]``, which also says how a field is validated, is shown as ``float``, and an
array by its public name. Fields of named tuples, which stand in the text of their class, are not
listed once more.
"""

from __future__ import annotations

import inspect
import types
from collections.abc import Iterator
from functools import reduce
from operator import or_
from typing import Any, Union, get_args, get_origin, get_type_hints

from sphinx.application import Sphinx
from sphinx.config import Config

import drake_rnn

_PACKAGE = "drake_rnn"
#: Stands for `drake_rnn.Array`, which as an alias has no name.
_ARRAY = type("Array", (), {"__module__": _PACKAGE})


def _simplified(annotated: Any) -> None:
    """Replace the annotations of a class or function by plain types."""
    try:
        hints = get_type_hints(annotated)
    except NameError:
        # Names that only a type checker imports stay as they are written.
        return
    own = annotated.__annotations__
    own.update({name: _named(hint) for name, hint in hints.items() if name in own})


def _named(hint: Any) -> Any:
    """Return a type with the public name of arrays, wherever they stand in it."""
    if hint == drake_rnn.Array:
        return _ARRAY
    origin, inner = get_origin(hint), get_args(hint)
    named = tuple(
        [_named(each) for each in part] if isinstance(part, list) else _named(part)
        for part in inner
    )
    if origin is None or named == inner:
        return hint
    if origin in (Union, types.UnionType):
        return reduce(or_, named)
    return origin[named]


def _annotated(public: Any) -> Iterator[Any]:
    """Yield what is annotated in a public class or function."""
    if inspect.isfunction(public):
        yield public
    if inspect.isclass(public):
        for cls in public.__mro__:
            if cls.__module__.startswith(_PACKAGE):
                yield from filter(inspect.isfunction, vars(cls).values())
                if "__annotations__" in vars(cls):
                    yield cls


def _simplify(app: Sphinx, config: Config) -> None:
    for name in drake_rnn.__all__:
        for annotated in _annotated(getattr(drake_rnn, name)):
            _simplified(annotated)


def _is_alias(app: Sphinx, what: str, name: str, member: Any, *others: Any) -> bool | None:
    alias = (inspect.getdoc(member) or "").startswith("Alias for field number")
    return True if alias else None


def setup(app: Sphinx) -> dict[str, Any]:
    """Simplify all that is public."""
    app.connect("config-inited", _simplify)
    app.connect("autodoc-skip-member", _is_alias)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
