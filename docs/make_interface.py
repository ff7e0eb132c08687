"""Print the public interface.

A release has `python docs/make_interface.py > tests/data/interface_VERSION.txt`.

A line for each public name: of a function its parameters, of a class also its members, those from
this package. `tests/test_public_interface.py` compares it with that of the last release, and
COMPATIBILITY.md says what may change.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator

import drake_rnn


def parameters(thing: object) -> list[str]:
    """Return the names of what may be given; ``=`` stands behind what need not be."""
    try:
        given = inspect.signature(thing).parameters.values()  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return []
    free = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    return [
        each.name + ("=" if each.default is not each.empty or each.kind in free else "")
        for each in given
        if not each.name.startswith("_")
    ]


def members(cls: type) -> list[str]:
    """Return the public members of a class that it has from classes of this package."""
    ours = [base for base in cls.__mro__ if base.__module__.startswith("drake_rnn")]
    names = {
        name for base in ours for name in (*vars(base), *vars(base).get("__annotations__", ()))
    }
    return sorted(
        name for name in names if not name.startswith("_") and not name.startswith("model_")
    )


def interface() -> Iterator[str]:
    """Yield the lines."""
    for name in sorted(drake_rnn.__all__):
        thing = vars(drake_rnn).get(name) or inspect.getattr_static(drake_rnn, name, None)
        if thing is None:
            thing = drake_rnn.__getattr__(name)
        if isinstance(thing, type):
            yield f"class {name}({', '.join(parameters(thing))}): {', '.join(members(thing))}"
        elif callable(thing):
            yield f"def {name}({', '.join(parameters(thing))})"
        else:
            yield f"{type(thing).__name__} {name}"


if __name__ == "__main__":
    print("\n".join(interface()))
