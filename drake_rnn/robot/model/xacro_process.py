"""A process of its own that expands a xacro file, in which macros may compute anything.

It speaks by lines of JSON, with nothing of this package imported: first it is given the file, the
arguments, ``sys.path`` and its bounds; it asks for the folder of each package that it needs, and
ends with what came of it.
"""

from __future__ import annotations

import ast
import json
import resource
import sys
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module
from io import StringIO
from typing import Any

# Size of a whole number [bits], and entries of a text or a list, that macros may make.
_MOST_BITS, _MOST_ENTRIES = 10_000, 1_000_000
# Elements and texts that are evaluated. The largest public files have 2e4 and 1e5.
_MOST_WORK = {"eval_all": 100_000, "eval_text": 300_000}
# Letters of what is said.
_MOST_SAID = 10_000


class _Arguments(dict[str, str]):
    """Arguments of macros that note which of them are asked for."""

    def __init__(self, values: dict[str, str]) -> None:
        super().__init__(values)
        self.asked: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.asked.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.asked.add(name)
        return super().__getitem__(name)


def _bits(value: Any) -> int:
    return value.bit_length() if isinstance(value, int) else 0


def _require_bits(bits: int) -> None:
    if bits > _MOST_BITS:
        raise OverflowError("a whole number is beyond that of any other number")


def _power(base: Any, exponent: Any) -> Any:
    _require_bits(_bits(base) * max(exponent, 0) if isinstance(exponent, int) else 0)
    return base**exponent


def _product(first: Any, second: Any) -> Any:
    _require_bits(_bits(first) + _bits(second))
    for each, times in ((first, second), (second, first)):
        if isinstance(each, (str, bytes, list, tuple)) and isinstance(times, int):
            _require_short(len(each) * times)
    return first * second


def _shift(value: Any, places: Any) -> Any:
    _require_bits(_bits(value) + (places if isinstance(places, int) else 0))
    return value << places


def _require_short(size: int) -> None:
    if size > _MOST_ENTRIES:
        raise OverflowError(f"a text or a list has {size} entries, and may have {_MOST_ENTRIES}")


_OPERATIONS = {ast.Pow: _power, ast.Mult: _product, ast.LShift: _shift}


class _Bounded(ast.NodeTransformer):
    """Calls functions with bounds in the place of operators that make much of little."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        if (function := _OPERATIONS.get(type(node.op))) is None:
            return node
        return ast.Call(ast.Name(function.__name__, ast.Load()), [node.left, node.right], [])


def _safe_eval(text: str, names: Any, locals_: Any = None) -> Any:
    """Evaluate an expression as xacro does, with bounds."""
    tree = _Bounded().visit(ast.parse(text.strip(), "<expression>", "eval"))
    code = compile(ast.fix_missing_locations(tree), "<expression>", "eval")
    if hidden := [name for name in code.co_names if name.startswith("__")]:
        raise NameError(f"the names {', '.join(hidden)} may not be used")
    names.update(__builtins__={each.__name__: each for each in _OPERATIONS.values()})
    return eval(code, names, locals_)


def _say(message: object) -> None:
    assert sys.__stdout__ is not None
    sys.__stdout__.write(json.dumps(message) + "\n")
    sys.__stdout__.flush()


def _find(package: str) -> str:
    """Ask for the folder of a package; by itself xacro needs an installed ROS."""
    _say({"find": package})
    folder: str | None = json.loads(sys.stdin.readline())
    if folder is None:
        raise LookupError(package)
    return folder


def _expand(file: str, arguments: _Arguments) -> str:
    xacro: Any = import_module("xacro")
    substitution: Any = import_module("xacro.substitution_args")
    substitution._eval_find, xacro.safe_eval = _find, _safe_eval
    for name, most in _MOST_WORK.items():
        setattr(xacro, name, _counted(getattr(xacro, name), most))
    return str(xacro.process_file(file, mappings=arguments).toxml())


def _counted(evaluate: Any, most: int) -> Any:
    """Return a function that may be called so often, and whose results have bounds."""
    count = 0

    def evaluate_bounded(*arguments: Any, **named: Any) -> Any:
        nonlocal count
        if (count := count + 1) > most:
            raise OverflowError(f"its macros make more than {most} elements or texts")
        value = evaluate(*arguments, **named)
        if isinstance(value, (str, list)):
            _require_short(len(value))
        return value

    return evaluate_bounded


def _fault(error: BaseException, most_memory: float) -> str:
    """Return what is wrong; what macros raise is not known, for they contain Python."""
    cause: Any = error
    while isinstance(inner := getattr(cause, "exc", None), BaseException):
        cause = inner
    if isinstance(cause, RecursionError):
        return "its macros, expressions or included files contain each other without end"
    if isinstance(cause, MemoryError):
        return f"takes more than {most_memory / 1e9:g} GB of memory"
    return (str(error) or type(cause).__name__)[:_MOST_SAID]


def _bound(kind: int, most: int) -> None:
    _, hard = resource.getrlimit(kind)
    resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def _main() -> None:
    task = json.loads(sys.stdin.readline())
    sys.path[:] = task["path"]
    _bound(resource.RLIMIT_AS, task["most_memory"])
    _bound(resource.RLIMIT_CPU, task["most_seconds"])
    # A core file of what was bounded is of no use.
    _bound(resource.RLIMIT_CORE, 0)
    arguments, said = _Arguments(task["arguments"]), StringIO()
    text, fault = "", ""
    with redirect_stderr(said), redirect_stdout(said):
        try:
            text = _expand(task["file"], arguments)
            if len(text) > task["most_bytes"]:
                text, fault = "", f"becomes longer than {task['most_bytes'] / 1e6:g} MB"
        except BaseException as error:
            fault = _fault(error, task["most_memory"])
    asked = sorted(arguments.asked)
    _say({"text": text, "fault": fault, "asked": asked, "said": said.getvalue()[:_MOST_SAID]})


if __name__ == "__main__":
    _main()
