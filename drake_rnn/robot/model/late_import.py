"""Modules that are imported when they are first used."""

from __future__ import annotations

import sys
from importlib.util import LazyLoader, find_spec, module_from_spec
from typing import Any


def late_import(name: str) -> Any:
    """Return a module that Python imports when one of its names is first used.

    For large modules that few runs need. This is the recipe of Python's `importlib`.

    Args:
        name: Full name of the module.

    Returns:
        The module, or None if it is not installed.
    """
    if name in sys.modules:
        return sys.modules[name]
    spec = find_spec(name)
    if spec is None or spec.loader is None:
        return None
    spec.loader = LazyLoader(spec.loader)
    module = module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
