"""The text in C99 of an expression graph: statements, branches and loops.

What only one side of a choice needs is evaluated in an ``if``, where it is worth one. A loop stays
a loop; what does not change in it is evaluated before it. Nothing is allocated, nothing is global.
"""

from __future__ import annotations

import re
import textwrap
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from heapq import heappop, heappush
from math import inf, isfinite, isnan
from typing import Any

from .graph import Loop, Memory, Node, Scope, Store, Sweep, mark_live
from .recurring_blocks import without_recurring_blocks

#: A condition and the value at which something is needed.
Side = tuple[Node, bool]
Guard = frozenset[Side]
_ALWAYS: Guard = frozenset()

# What an operation costs, in additions; of others 1.
_COSTS = {
    **{"div": 5, "sqrt": 6, "sin": 20, "cos": 20, "cbrt": 30, "exp": 20, "log": 20, "tanh": 30},
    **{"eigen": 300, "factors": 60, "loop": 300, "result": 0, "pow": 40},
    **{"sweep": 300, "put": 0, "choose": 0},
}
# Branches that save less are choices between numbers.
_LEAST = 24
# Rounds of loops that cost less are made whatever comes of them, two or more at once.
_LEAST_ROUND = 60
# Longer expressions get a name.
_LONGEST = 88

_INFIX = {
    **{"add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "gt": ">"},
    **{"ge": ">=", "eq": "==", "ne": "!=", "and": "&&", "or": "||"},
}
#: Functions of ``math.h`` by operation.
LIBRARY = {
    **{"sqrt": "sqrt", "sin": "sin", "cos": "cos", "abs": "fabs", "floor": "floor"},
    **{"ceil": "ceil", "is_finite": "isfinite", "signbit": "signbit", "exp": "exp"},
    **{"log": "log", "tanh": "tanh", "cbrt": "cbrt", "nextafter": "nextafter", "pow": "pow"},
    **{"atan2": "atan2", "acos": "acos", "asin": "asin", "atan": "atan", "tan": "tan"},
    **{
        "log1p": "log1p",
        "expm1": "expm1",
        "sinh": "sinh",
        "cosh": "cosh",
        "rem": "fmod",
        "exp2": "exp2",
        "rint": "rint",
        "round": "round",
    },
}
#: Those that any law may use; others are named in the header of the file.
USUAL = frozenset(("sqrt", "sin", "cos", "fabs", "floor", "ceil", "isfinite", "signbit"))

_HELPERS = {
    "smaller": """\
static double smaller(double a, double b)
{
    return a < b || a != a ? a : b;
}
""",
    "larger": """\
static double larger(double a, double b)
{
    return a > b || a != a ? a : b;
}
""",
    "whole": """\
static int whole(double x)
{
    return x > -2147483648.0 && x < 2147483647.0 ? (int)x : 0;
}
""",
    # Cyclic Jacobi rotations; for n = 6 they end after 5 to 7 sweeps.
    "eigen": """\
/* Eigenvalues w, ascending, and eigenvectors, columns of V unless it is
 * null, of a symmetric A, which is lost. */
static void eigen(int n, double *A, double *w, double *V)
{
    double size = 0.0;
    for (int i = 0; i < n * n; ++i) {
        size += A[i] * A[i];
    }
    for (int i = 0; V && i < n * n; ++i) {
        V[i] = i % (n + 1) == 0 ? 1.0 : 0.0;
    }
    for (int sweep = 0; sweep < 16; ++sweep) {
        double off = 0.0;
        for (int p = 0; p < n - 1; ++p) {
            for (int q = p + 1; q < n; ++q) {
                off += A[n * p + q] * A[n * p + q];
            }
        }
        if (!(off > 1e-34 * size)) {
            break;
        }
        for (int p = 0; p < n - 1; ++p) {
            for (int q = p + 1; q < n; ++q) {
                const double a = A[n * p + q];
                if (!(a * a > 1e-37 * size)) {
                    continue;
                }
                const double d = A[n * q + q] - A[n * p + p];
                const double r = sqrt(d * d + 4.0 * a * a);
                const double t = 2.0 * a / (d < 0.0 ? d - r : d + r);
                const double c = 1.0 / sqrt(t * t + 1.0), s = t * c;
                A[n * p + p] -= t * a;
                A[n * q + q] += t * a;
                A[n * p + q] = 0.0;
                for (int i = 0; i < n; ++i) {
                    if (i != p && i != q) {
                        double *x = i < p ? A + n * i + p : A + n * p + i;
                        double *y = i < q ? A + n * i + q : A + n * q + i;
                        const double f = *x, g = *y;
                        *x = c * f - s * g;
                        *y = s * f + c * g;
                    }
                }
                for (int i = 0; V && i < n; ++i) {
                    const double f = V[n * i + p], g = V[n * i + q];
                    V[n * i + p] = c * f - s * g;
                    V[n * i + q] = s * f + c * g;
                }
            }
        }
    }
    for (int i = 0; i < n; ++i) {
        w[i] = A[n * i + i];
    }
    for (int i = 0; i < n - 1; ++i) {
        int least = i;
        for (int k = i + 1; k < n; ++k) {
            least = w[k] < w[least] ? k : least;
        }
        const double value = w[i];
        w[i] = w[least];
        w[least] = value;
        for (int k = 0; V && k < n; ++k) {
            const double entry = V[n * k + i];
            V[n * k + i] = V[n * k + least];
            V[n * k + least] = entry;
        }
    }
}
""",
    "factors": """\
/* Factors of a matrix A, in its place, with the order p of its rows. */
static void factors(int n, double *A, int *p)
{
    for (int i = 0; i < n; ++i) {
        p[i] = i;
    }
    for (int k = 0; k < n; ++k) {
        int best = k;
        for (int i = k + 1; i < n; ++i) {
            best = fabs(A[n * i + k]) > fabs(A[n * best + k]) ? i : best;
        }
        if (best != k) {
            const int row = p[k];
            p[k] = p[best];
            p[best] = row;
            for (int j = 0; j < n; ++j) {
                const double entry = A[n * k + j];
                A[n * k + j] = A[n * best + j];
                A[n * best + j] = entry;
            }
        }
        for (int i = k + 1; i < n; ++i) {
            A[n * i + k] /= A[n * k + k];
            for (int j = k + 1; j < n; ++j) {
                A[n * i + j] -= A[n * i + k] * A[n * k + j];
            }
        }
    }
}
""",
}


@dataclass(eq=False)
class _Block:
    """Statements that are made if all conditions of a guard hold."""

    side: Side | None
    outer: _Block | None
    items: list[Node | _Block] = field(default_factory=list)

    @property
    def chain(self) -> list[_Block]:
        """This block and those that it lies in."""
        blocks, block = [], self
        while block is not None:
            blocks.append(block)
            block = block.outer  # type: ignore[assignment]
        return blocks


@dataclass(frozen=True)
class Body:
    """Statements of a function.

    Attributes:
        lines: Their text.
        helpers: The functions that they call, as text.
        operations: How many operations there are at most, by their names in C; of loops of unknown
            length one round is counted.
        is_bounded: Whether the number of rounds of each loop is known.
        memory: Size of the arrays that lie on the stack [bytes].
    """

    lines: list[str]
    helpers: str
    operations: Mapping[str, int]
    is_bounded: bool
    memory: int = 0


def body_of(inputs: Mapping[str, str], outputs: Sequence[tuple[str, Node]]) -> Body:
    """Return the statements that set outputs.

    Args:
        inputs: The text of each leaf of a graph, by its name.
        outputs: What is set, in C, and to what.
    """
    ends = _Ends(outputs)
    printer = _Printer(inputs, mark_live(node for _, node in outputs))
    lines = printer.scope(_top(node for _, node in outputs), ends.roots)
    finish = ends.lines(printer)
    reads = [f"const double {name} = {inputs[name]};" for name in inputs if name in printer.leaves]
    lines = [*reads, *printer.shared([*lines, *finish])]
    tables = [f"{each}\n" for each in printer.tables(lines)]
    functions = [text for name, text in _HELPERS.items() if name in printer.helpers]
    blocks, lines = without_recurring_blocks(lines)
    return Body(
        lines,
        "\n".join([*tables, *functions, *blocks]),
        printer.operations,
        printer.is_bounded,
        printer.memory,
    )


# Outputs that lie side by side in memory, at least so many, are copied in a loop.
_RUN = 9


class _Ends:
    """The statements that set outputs.

    Args:
        outputs: What is set, in C, and to what.
    """

    def __init__(self, outputs: Sequence[tuple[str, Node]]) -> None:
        # Entries of a block of memory that go to an array.
        groups: dict[Any, list[tuple[int, int, Node]]] = {}
        self._single = []
        for place, node in outputs:
            if node.op == "load" and node.args[0].op == "constant" and place.endswith("]"):
                name, at = _split_place(place)
                key = (name, node.detail, node.args[1:])
                groups.setdefault(key, []).append((node.args[0].detail, at, node))
            else:
                self._single.append((place, node))
        self._runs = []
        for (name, _, _), entries in groups.items():
            entries.sort(key=lambda each: each[:2])
            for run in _even_runs(entries):
                if len(run) >= _RUN:
                    self._runs.append((name, run))
                else:
                    self._single += [(f"{name}[{at}]", node) for _, at, node in run]

    @property
    def roots(self) -> list[Node]:
        """What is to be evaluated first."""
        runs = [arg for _, entries in self._runs for arg in entries[0][2].args]
        return [*(node for _, node in self._single), *runs]

    def lines(self, printer: _Printer) -> list[str]:
        """Return the statements, once what they need has been evaluated."""
        lines = [f"{place} = {printer.text_of(node)};" for place, node in self._single]
        for name, entries in self._runs:
            (first, at, node), (second, next_at, _) = entries[:2]
            source = printer.place_of(node.detail, first, _times(second - first, "k"))
            lines += [
                f"for (int k = 0; k < {len(entries)}; ++k) {{",
                f"    {name}[{_plus(_times(next_at - at, 'k'), at)}] = {source};",
                "}",
            ]
        return lines


def _even_runs(entries: Sequence[tuple[int, int, Node]]) -> list[list[tuple[int, int, Node]]]:
    """Return runs of entries in which both numbers rise by the same each time."""
    runs = [[entries[0]]]
    for entry in entries[1:]:
        run = runs[-1]
        step = (entry[0] - run[-1][0], entry[1] - run[-1][1])
        if len(run) > 1 and step != (run[1][0] - run[0][0], run[1][1] - run[0][1]):
            runs.append([entry])
        else:
            run.append(entry)
    return runs


def _times(factor: int, index: str) -> str:
    return index if factor == 1 else f"{factor} * {index}"


def _split_place(place: str) -> tuple[str, int]:
    """Return the name and the index of an entry of an array in C."""
    name, _, index = place.rpartition("[")
    return (name, int(index[:-1])) if name else (place, -1)


def _join_choices(memories: Iterable[Memory]) -> None:
    """Lay the blocks of memories behind each other where those of one to choose from do."""
    choices = [(each, *each.sources) for each in memories if each.sources is not None]
    while any(any(each.is_joined for each in all_) != all(each.is_joined for each in all_)
              for all_ in choices):  # fmt: skip
        for group in choices:
            if any(each.is_joined for each in group):
                for each in group:
                    each.is_joined = True


def _plus(index: str, first: int) -> str:
    """Return the text of an index that is counted from another."""
    if index.lstrip("-").isdigit():
        return str(int(index) + first)
    is_wrapped = _is_wrapped(index)
    if first:
        return f"{first} + {index}" if is_wrapped or "?" not in index else f"{first} + ({index})"
    return index[1:-1] if is_wrapped else index


def _top(roots: Iterable[Node]) -> Scope:
    scope = next(iter(roots)).scope
    while scope.outer is not None:
        scope = scope.outer
    return scope


class _Printer:
    """Statements of scopes, the innermost last."""

    def __init__(
        self, inputs: Mapping[str, str], blocks: Sequence[tuple[Memory, int | None]]
    ) -> None:
        self._inputs = inputs
        self._blocks: dict[Memory, set[int | None]] = {}
        self._numbers: dict[Memory, int] = {}
        for memory, block in blocks:
            self._blocks.setdefault(memory, set()).add(block)
            self._numbers.setdefault(memory, len(self._numbers))
        _join_choices(self._numbers)
        self._texts: dict[Node, str] = {}
        self.leaves: set[str] = set()
        self.helpers: set[str] = set()
        self.operations: Counter[str] = Counter()
        self.is_bounded = True
        self.memory = 0
        self._rounds = 1

    def scope(self, scope: Scope, roots: Sequence[Node], *, branches: bool = True) -> list[str]:
        """Return the statements of a scope after which its roots have texts."""
        plan = _Plan(scope, roots, self._texts, _LEAST if branches else None)
        block = plan.schedule()
        early: list[str] = []
        lines = self._block(block, plan, early)
        return [*early, *lines]

    def text_of(self, node: Node) -> str:
        """Return the text of an expression whose statement has been made."""
        if node.op == "constant":
            return _constant(node)
        if node.op == "leaf":
            self.leaves.add(node.detail)
            return str(node.detail)
        if node.op == "result":
            index = node.detail[0]
            return f"{self._texts[node.args[0]]}{_place(node.args[0], index)}"
        return self._texts[node]

    def _block(self, block: _Block, plan: _Plan, early: list[str]) -> list[str]:
        lines: list[str] = []
        previous: Side | None = None
        for item in block.items:
            if isinstance(item, Node):
                lines += self._statement(item, plan, early)
                previous = None
                continue
            inner = ["    " + line for line in self._block(item, plan, early)]
            if not inner:
                continue
            assert item.side is not None
            condition, value = item.side
            if previous is not None and previous == (condition, not value) and lines[-1] == "}":
                lines[-1] = "} else {"
            else:
                text = self.text_of(condition)
                lines.append(f"if ({text if value else f'!{text}'}) {{")
            lines += [*inner, "}"]
            previous = item.side
        return lines

    def _statement(self, node: Node, plan: _Plan, early: list[str]) -> list[str]:
        """Return the statements of an expression; none if its text stands where it is used."""
        if node.op in ("result", "constant", "leaf"):
            return []
        if node.kind == "results":
            return self._step(node, plan, early)
        text = self._text(node)
        self._count(node)
        if plan.stays_inline(node) and len(text) < _LONGEST:
            self._texts[node] = text
            return []
        name = f"{'x' if node.kind == 'double' else 'n'}{node.number}"
        self._texts[node] = name
        kind = "double" if node.kind == "double" else "int"
        text = text[1:-1] if _is_wrapped(text) else text
        if plan.escapes(node):
            early.append(f"{kind} {name} = {'0.0' if kind == 'double' else '0'};")
            return [f"{name} = {text};"]
        return [f"const {kind} {name} = {text};"]

    def _step(self, node: Node, plan: _Plan, early: list[str]) -> list[str]:
        """Return the statements of an operation that has several results."""
        is_guarded = plan.homes[node].side is not None
        name = self._texts[node] = f"r{node.number}"
        if node.op == "loop":
            return self._loop(node, name, is_guarded, early)
        if node.op == "sweep":
            return self._sweep(node.detail)
        if node.op in ("put", "choose"):
            return self._put(node) if node.op == "put" else self._choose(node)
        self.helpers.add(node.op)
        vectors = any(user.detail[0] >= node.detail for user in plan.users(node))
        n = node.detail
        values = ", ".join(self.text_of(arg) for arg in node.args)
        start = " = {0}" if is_guarded else ""
        if node.op == "factors":
            declarations = [f"double {name}m[{n * n}]{start};", f"int {name}p[{n}]{start};"]
            call = f"factors({n}, {name}m, {name}p);"
            self.operations["factors"] += self._rounds
        else:
            arrays = [("m", n * n), ("w", n), *([("v", n * n)] if vectors else [])]
            declarations = [f"double {name}{letter}[{size}]{start};" for letter, size in arrays]
            call = f"eigen({n}, {name}m, {name}w, {f'{name}v' if vectors else '0'});"
            self.operations["eigen"] += self._rounds
        sets = [f"{name}m[{k}] = {text};" for k, text in enumerate(values.split(", "))]
        if is_guarded:
            early += declarations
            return [*sets, call]
        return [f"{declarations[0][:-1]} = {{{values}}};", *declarations[1:], call]

    def _loop(self, node: Node, name: str, is_guarded: bool, early: list[str]) -> list[str]:
        loop: Loop = node.detail
        kinds = ["double" if each.kind == "double" else "int" for each in loop.carries]
        inits = [self.text_of(arg) for arg in node.args[: len(kinds)]]
        for k, carry in enumerate(loop.carries):
            self._texts[carry] = f"{name}_{k}"
        if is_guarded:
            early += [f"{kind} {name}_{k} = 0;" for k, kind in enumerate(kinds)]
            kinds = [""] * len(kinds)
        lines = [
            f"{kind} {name}_{k} = {init};".strip()
            for k, (kind, init) in enumerate(zip(kinds, inits, strict=True))
        ]
        self.is_bounded &= loop.most is not None
        before, self._rounds = self._rounds, self._rounds * (loop.most or 1)
        inner: list[str] = []
        if loop.condition.op != "constant":
            inner += self.scope(loop.scope, [loop.condition], branches=False)
            inner.append(f"if (!{self._wrap(loop.condition)}) {{")
            inner += ["    break;", "}"]
        inner += self.scope(loop.scope, loop.roots)
        inner += self._carry(name, loop)
        for each in loop.copies:
            inner += self._copy(each.target, each.source)
        self._rounds = before
        head = f"for (int {name} = 0; {name} < {loop.most}; ++{name}) {{"
        if loop.most is None:
            head = "for (;;) {"
        return [*lines, head, *("    " + line for line in inner), "}"]

    # Large arrays.

    def _sweep(self, sweep: Sweep) -> list[str]:
        """Return the loops of a sweep."""
        lines = []
        for store in sweep.live:
            if store.start is not None:
                lines += self._fill(store)
        before = self._rounds
        names = [f"{letter}{sweep.step.number}" for letter in "ijklmn"]
        for index, name in zip(sweep.indices, names, strict=False):
            self._texts[index] = name
        lines += self._nest(sweep, 0)
        self._rounds = before
        return lines

    def _fill(self, store: Store) -> list[str]:
        assert store.start is not None
        assert store.block is not None
        memory, text = store.memory, self.text_of(store.start)
        if memory.size == 1:
            return [f"{self.place_of((memory, store.block), 0, '0')} = {text};"]
        return [
            f"for (int k = 0; k < {memory.size}; ++k) {{",
            f"    {self.place_of((memory, store.block), 0, 'k')} = {text};",
            "}",
        ]

    def _nest(self, sweep: Sweep, depth: int) -> list[str]:
        """Return a loop of a sweep, with those in it."""
        self._rounds *= sweep.lengths[depth]
        scope, name = sweep.scopes[depth], self._texts[sweep.indices[depth]]
        head = f"for (int {name} = 0; {name} < {sweep.lengths[depth]}; ++{name}) {{"
        roots = [each for store in sweep.live for each in (store.index, store.value)]
        if depth < len(sweep.lengths) - 1:
            roots = [node for node in _below(roots, sweep.scopes[depth + 1]) if node.scope is scope]
            lines = self.scope(scope, roots, branches=False) + self._nest(sweep, depth + 1)
        elif (condition := self._shared_condition(sweep, scope)) is not None:
            return self._sparse_rounds(sweep, scope, head, condition)
        else:
            lines = self.scope(scope, roots, branches=False)
            lines += self._stores(sweep, [store.value for store in sweep.live])
        return [head, *("    " + line for line in lines), "}"]

    def _sparse_rounds(self, sweep: Sweep, scope: Scope, head: str, condition: Node) -> list[str]:
        """Return the innermost loop of a sweep as two, the second one for some rounds alone.

        The first one writes constants, many at once; in branches of one loop that takes longer.
        """
        indices = [store.index for store in sweep.live]
        _, values, constants = zip(*(store.value.args for store in sweep.live), strict=True)
        first = self.scope(scope, indices, branches=False)
        lines = [*first, *self.scope(scope, [condition], branches=False)]
        inner = self.scope(scope, values, branches=False) + self._stores(sweep, values)
        first += self._stores(sweep, constants)
        return [
            head,
            *("    " + line for line in first),
            "}",
            head,
            *("    " + line for line in lines),
            f"    if ({self.text_of(condition)}) {{",
            *("        " + line for line in inner),
            "    }",
            "}",
        ]

    def _shared_condition(self, sweep: Sweep, scope: Scope) -> Node | None:
        """Return the condition without which a round writes constants alone, if one is worth it."""
        values = [store.value for store in sweep.live]
        if any(value.op != "select" or value.args[2].op != "constant" for value in values):
            return None
        if any(store.start is not None for store in sweep.live):
            # Rounds go on from what others have written.
            return None
        condition = values[0].args[0]
        if condition.scope is not scope or any(v.args[0] is not condition for v in values):
            return None
        cost = sum(_COSTS.get(node.op, 1) for node in _reachable(scope, values, self._texts))
        return condition if cost >= _LEAST_ROUND else None

    def _stores(self, sweep: Sweep, values: Sequence[Node]) -> list[str]:
        """Return the statements that write what a round of a sweep gives."""
        lines = []
        for store, value in zip(sweep.live, values, strict=True):
            place = self.place_of((store.memory, store.block), 0, self.text_of(store.index))
            lines.append(f"{place} = {self.text_of(value)};")
        return lines

    def _put(self, node: Node) -> list[str]:
        """Return the statements that write expressions to memory."""
        memory, targets = node.detail
        at, *values = node.args
        block = 0 if memory.blocks == 1 else None
        lines = []
        for target, value in zip(targets, values, strict=True):
            part, index = divmod(target, memory.size) if block is None else (0, target)
            place = self.place_of((memory, part), index, self.text_of(at))
            lines.append(f"{place} = {self.text_of(value)};")
        return lines

    def _choose(self, node: Node) -> list[str]:
        """Return the statements after which a memory is one of two others."""
        memory, (then, otherwise), _ = node.detail
        condition = self._wrap(node.args[0])
        return [
            f"{self._name(memory, k)} = {condition} ? {self._name(then, k)} : "
            f"{self._name(otherwise, k)};"
            for k in self._parts(memory)
        ]

    def _copy(self, target: Memory, source: Memory) -> list[str]:
        lines = []
        for block in range(target.blocks):
            to = self.place_of((target, block), 0, "k")
            lines.append(f"    {to} = {self.place_of((source, block), 0, 'k')};")
        return [f"for (int k = 0; k < {target.size}; ++k) {{", *lines, "}"]

    def _parts(self, memory: Memory) -> list[int | None]:
        """Return the blocks of a memory that are arrays of their own; None for all in one."""
        if memory.is_joined or memory.blocks == 1:
            return [None]
        blocks = self._blocks[memory]
        return [k for k in range(memory.blocks) if None in blocks or k in blocks]

    def _name(self, memory: Memory, part: int | None) -> str:
        if memory.values is not None:
            return f"t{self._numbers[memory]}"
        name = f"m{self._numbers[memory]}"
        return name if part is None or memory.blocks == 1 else f"{name}_{part}"

    def place_of(self, block: tuple[Memory, int | None], first: int, index: str) -> str:
        """Return the text of an entry of a block of memory.

        Args:
            block: The memory and the block.
            first: Where the index counts from.
            index: Text of the index.
        """
        memory, part = block
        if memory.leaves is not None:
            name, start = _split_place(self._inputs[memory.leaves[0]])
            return f"{name}[{_plus(index, first + start)}]"
        if memory.values is not None:
            return f"t{self._numbers[memory]}[{_plus(index, first)}]"
        if memory.is_joined:
            return f"{self._name(memory, None)}[{_plus(index, first + (part or 0) * memory.size)}]"
        return f"{self._name(memory, part)}[{_plus(index, first)}]"

    def shared(self, lines: Sequence[str]) -> list[str]:
        """Return statements after declarations of memory, in which arrays share places."""
        arrays: dict[str, tuple[str, int]] = {}
        chosen: dict[str, tuple[str, ...]] = {}
        pointers = []
        lines, used = _without_unread(lines)
        for memory in self._numbers:
            if memory.values is not None or memory.leaves is not None:
                continue
            kind = "double" if memory.kind == "double" else "int"
            for part in self._parts(memory):
                name = self._name(memory, part)
                if name not in used:
                    continue
                if memory.sources is not None:
                    pointers.append(f"const {kind} *{name} = 0;")
                    chosen[name] = tuple(self._name(each, part) for each in memory.sources)
                else:
                    arrays[name] = (kind, memory.size * (memory.blocks if part is None else 1))
        shares = _share(arrays, _spans(lines, arrays, chosen))
        names = {name: share[0] for name, share in shares.items()}
        sizes = {name: (kind, size) for name, kind, size in shares.values()}
        self.memory = sum(size * (8 if kind == "double" else 4) for kind, size in sizes.values())
        declarations = [f"{kind} {name}[{size}];" for name, (kind, size) in sizes.items()]
        renamed = [_NAME.sub(lambda found: names.get(found[0], found[0]), line) for line in lines]
        return [*declarations, *pointers, *renamed]

    def tables(self, lines: Iterable[str]) -> list[str]:
        """Return the tables of constants that statements read."""
        texts, used = [], {name for line in lines for name in _TABLE.findall(line)}
        for memory, number in self._numbers.items():
            if memory.values is not None and f"t{number}" in used:
                kind = "double" if memory.kind == "double" else "int"
                # Blocks of zeros are one, unless an index leads through all.
                size = memory.size * (memory.blocks if memory.is_joined else 1)
                values = [_number(value, memory.kind == "double") for value in memory.values[:size]]
                values = ["0"] if {*values} <= {"0", "0.0"} else values
                text = textwrap.fill(", ".join(values), 88, break_on_hyphens=False)
                head = f"static const {kind} t{number}[{size}] = {{"
                texts.append(f"{head}\n{text}\n}};")
        return texts

    def _wrap(self, node: Node) -> str:
        text = self.text_of(node)
        return text if _is_wrapped(text) or text.isalnum() else f"({text})"

    def _carry(self, name: str, loop: Loop) -> list[str]:
        """Return the statements that end a round: what is carried takes its next values."""
        carries = {each: k for k, each in enumerate(loop.carries)}
        lines, ends = [], []
        for k, after in enumerate(loop.after):
            text = self.text_of(after)
            if (which := carries.get(after)) is not None and which < k:
                kind = "double" if after.kind == "double" else "int"
                lines.append(f"const {kind} {name}_{k}n = {text};")
                text = f"{name}_{k}n"
            if which != k:
                ends.append(f"{name}_{k} = {text};")
        return lines + ends

    def _count(self, node: Node) -> None:
        name = LIBRARY.get(node.op, _INFIX.get(node.op, node.op))
        self.operations[name] += self._rounds

    def _text(self, node: Node) -> str:
        args, op = node.args[:1] if node.op in ("load", "held") else node.args, node.op
        texts = [self.text_of(arg) for arg in args]
        if op in _INFIX:
            return f"({texts[0]} {_INFIX[op]} {texts[1]})"
        if op == "rem" and node.kind == "int":
            return f"({texts[0]} % {texts[1]})"
        if op in LIBRARY:
            text = f"{LIBRARY[op]}({', '.join(texts)})"
            return f"({text} != 0)" if op in ("is_finite", "signbit") else text
        return _TEXTS[op](self, node, texts)

    def bound(self, node: Node, texts: list[str], sign: str, helper: str) -> str:
        """Return the text of a minimum or a maximum, in which what is no number stays."""
        for k, arg in enumerate(node.args):
            if arg.op == "constant" or node.kind == "int":
                other = texts[1 - k]
                if other.isidentifier() or arg.op != "constant":
                    return f"({other} {sign} {texts[k]} ? {texts[k]} : {other})"
        self.helpers.add(helper)
        return f"{helper}({texts[0]}, {texts[1]})"

    def whole(self, node: Node, texts: list[str]) -> str:
        """Return the text of a number without its fraction."""
        if node.args[0].kind == "truth":
            return f"({texts[0]} ? 1 : 0)"
        self.helpers.add("whole")
        return f"whole({texts[0]})"


_TEXTS: dict[str, Callable[[_Printer, Node, list[str]], str]] = {
    "load": lambda printer, node, texts: printer.place_of(node.detail, 0, texts[0]),
    "held": lambda printer, node, texts: printer.place_of(node.detail[:2], 0, texts[0]),
    "neg": lambda printer, node, texts: f"(-{texts[0]})",
    "not": lambda printer, node, texts: f"(!{texts[0]})",
    "select": lambda printer, node, texts: f"({texts[0]} ? {texts[1]} : {texts[2]})",
    "min": lambda printer, node, texts: printer.bound(node, texts, ">", "smaller"),
    "max": lambda printer, node, texts: printer.bound(node, texts, "<", "larger"),
    "int": lambda printer, node, texts: printer.whole(node, texts),
    "double": lambda printer, node, texts: (
        f"({texts[0]} ? 1.0 : 0.0)" if node.args[0].kind == "truth" else f"(double){texts[0]}"
    ),
}


def _constant(node: Node) -> str:
    return _number(node.detail, node.kind == "double")


def _number(value: float, is_double: bool) -> str:
    if not is_double:
        return str(int(value))
    if isfinite(value):
        text = repr(float(value))
        return f"({text})" if text.startswith("-") else text
    return "NAN" if isnan(value) else "HUGE_VAL" if value == inf else "(-HUGE_VAL)"


def _is_wrapped(text: str) -> bool:
    """Return whether parentheses enclose the whole of a text."""
    if not text.startswith("("):
        return False
    depth = 0
    for k, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if depth == 0:
            return k == len(text) - 1
    return False


def _place(step: Node, index: int) -> str:
    """Return the text of a result of an operation, after its name."""
    if step.op == "loop":
        return f"_{index}"
    n = step.detail
    if step.op == "factors":
        return f"m[{index}]" if index < n * n else f"p[{index - n * n}]"
    return f"w[{index}]" if index < n else f"v[{index - n}]"


class _Plan:
    """The order of the statements of a scope, and the branches that they are in.

    Args:
        scope: The scope.
        roots: What is to be evaluated.
        texts: What has a text already.
        least: What a branch must save; None for no branches.
    """

    def __init__(
        self, scope: Scope, roots: Sequence[Node], texts: Mapping[Node, str], least: int | None
    ) -> None:
        self._roots = frozenset(roots)
        self._nodes = _reachable(scope, roots, texts)
        self._users: dict[Node, list[Node]] = {node: [] for node in self._nodes}
        for node in self._nodes:
            for arg in node.causes:
                if arg in self._users:
                    self._users[arg].append(node)
        self._guards = self._find_guards()
        self._weights = self._drop_light_branches(least)
        self.homes: dict[Node, _Block] = {}

    def users(self, node: Node) -> list[Node]:
        """Return what uses an expression."""
        return self._users[node]

    def stays_inline(self, node: Node) -> bool:
        """Return whether an expression is used once, in the branch where it is evaluated."""
        users = self._users[node]
        if len(users) != 1 or node in self._roots or node in self._conditions:
            return False
        user = users[0]
        return (
            user.kind != "results"
            and self.homes[user] is self.homes[node]
            and not (user.op in ("min", "max") and node.op != "leaf")
        )

    def escapes(self, node: Node) -> bool:
        """Return whether an expression is used outside of the branch where it is evaluated."""
        home = self.homes[node]
        if home.side is None:
            return False
        if node in self._roots:
            return True
        for user in self._users[node]:
            if home not in self.homes[user].chain:
                return True
        # The conditions of branches are read where these stand.
        return node in self._conditions

    def schedule(self) -> _Block:
        """Return the statements in their order."""
        waits: dict[Node, int] = {}
        frees: dict[Node, list[Node]] = {node: [] for node in self._nodes}
        self._ready: dict[Guard, list[tuple[int, Node]]] = {}
        for node in self._nodes:
            causes = {cause for cause in node.causes if cause in frees}
            for condition, _ in self._guards[node]:
                if condition in frees:
                    causes.add(condition)
            waits[node] = len(causes)
            for cause in causes:
                frees[cause].append(node)
            if not causes:
                self._await(node)
        self._waits, self._frees = waits, frees
        top = _Block(None, None)
        self._fill(top, frozenset())
        return top

    @cached_property
    def _conditions(self) -> frozenset[Node]:
        return frozenset(condition for guard in self._guards.values() for condition, _ in guard)

    def _await(self, node: Node) -> None:
        heappush(self._ready.setdefault(self._guards[node], []), (node.number, node))

    def _fill(self, block: _Block, guard: Guard) -> None:
        while True:
            if heap := self._ready.get(guard):
                node = heappop(heap)[1]
                block.items.append(node)
                self.homes[node] = block
                for successor in self._frees[node]:
                    self._waits[successor] -= 1
                    if self._waits[successor] == 0:
                        self._await(successor)
                continue
            side = self._next_side(block, guard)
            if side is None:
                return
            inner = _Block(side, block)
            block.items.append(inner)
            self._fill(inner, guard | {side})

    def _next_side(self, block: _Block, guard: Guard) -> Side | None:
        """Return the condition of the next branch; the other side of the last one first."""
        open_ones = {
            side
            for other, heap in self._ready.items()
            if heap and guard < other
            for side in other - guard
        }
        if not open_ones:
            return None
        if block.items and isinstance(last := block.items[-1], _Block) and last.side is not None:
            other = (last.side[0], not last.side[1])
            if other in open_ones:
                return other
        return max(open_ones, key=lambda each: (self._weights[each], -each[0].number, each[1]))

    def _find_guards(self) -> dict[Node, Guard]:
        """Return the conditions under which each expression is needed."""
        guards: dict[Node, Guard] = {}
        for node in reversed(self._nodes):
            guards[node] = _ALWAYS if node in self._roots else self._guard_of(node, guards)
        return guards

    def _guard_of(self, node: Node, guards: Mapping[Node, Guard]) -> Guard:
        """Return what the guards of all users of an expression have in common."""
        found: Guard | None = None
        for user in self._users[node]:
            use = guards[user]
            if user.op == "select":
                condition, then, otherwise = user.args
                is_side = node is not condition and (then is node) != (otherwise is node)
                if is_side and condition.op != "constant":
                    use = use | {(condition, then is node)}
            elif user.op == "choose" and (value := _chosen_side(user, node)) is not None:
                use = use | {(user.args[0], value)}
            found = use if found is None else found & use
            if not found:
                return _ALWAYS
        assert found is not None
        return found

    def _drop_light_branches(self, least: int | None) -> dict[Side, int]:
        """Leave out branches that save little; return what those that are left save."""
        weights: Counter[Side] = Counter()
        for node, guard in self._guards.items():
            for side in guard:
                weights[side] += _COSTS.get(node.op, 1)
        heavy = {
            side: weight
            for side, weight in weights.items()
            if least is not None and weight >= least
        }
        for node, guard in self._guards.items():
            if guard:
                self._guards[node] = frozenset(side for side in guard if side in heavy)
        return heavy


_NAME, _TABLE = re.compile(r"\bm\d+(?:_\d+)?\b"), re.compile(r"\bt\d+\b")


# A statement that sets which array a name stands for.
_CHOICE = re.compile(r"\s*(m\d+(?:_\d+)?) = ")


def _without_unread(lines: Sequence[str]) -> tuple[list[str], set[str]]:
    """Return statements without those that set names that are never read, and the names left."""
    choices = {line: found[1] for line in lines if (found := _CHOICE.match(line))}
    sources: dict[str, set[str]] = {}
    used = {name for line in lines if line not in choices for name in _NAME.findall(line)}
    for line, name in choices.items():
        sources.setdefault(name, set()).update(_NAME.findall(line))
    waiting = [*used & sources.keys()]
    while waiting:
        further = sources[waiting.pop()] - used
        used |= further
        waiting += further & sources.keys()
    return [line for line in lines if line not in choices or choices[line] in used], used


def _spans(
    lines: Sequence[str], arrays: Mapping[str, Any], chosen: Mapping[str, tuple[str, ...]]
) -> dict[str, list[int]]:
    """Return the first and the last line in which what an array holds matters."""
    spans: dict[str, list[int]] = {}
    for number, line in enumerate(lines):
        for name in _NAME.findall(line):
            spans.setdefault(name, [number, number])[1] = number
    spans = {name: span for name, span in spans.items() if name in arrays or name in chosen}
    loops = _loops(lines)
    # What a name stands for is extended by the name, and both by loops.
    for _ in range(2):
        for name in reversed(list(chosen)):
            for source in chosen[name] if name in spans else ():
                _extend(spans.setdefault(source, list(spans[name])), *spans[name])
        for loop in loops:
            _extend_by_loop(spans.values(), *loop)
    return spans


def _extend_by_loop(spans: Iterable[list[int]], first: int, last: int, is_sweep: bool) -> None:
    for span in spans:
        apart = span[1] < first or last < span[0]
        within = first <= span[0] and span[1] <= last
        # What lies within a round is written in it before it is read.
        if not apart and (is_sweep or not within):
            _extend(span, first, last)


def _extend(span: list[int], first: int, last: int) -> None:
    span[:] = [min(span[0], first), max(span[1], last)]


def _loops(lines: Sequence[str]) -> list[tuple[int, int, bool]]:
    """Return the first and last lines of loops, inner ones first, and whether they are sweeps."""
    loops: list[tuple[int, int, bool]] = []
    open_blocks: list[int] = []
    for number, line in enumerate(lines):
        text = line.strip()
        if text.startswith("}"):
            begin = open_blocks.pop()
            head = lines[begin].strip()
            if head.startswith("for"):
                is_round = head.startswith(("for (int r", "for (;"))
                loops.append((begin, number, not is_round))
        if text.endswith("{"):
            open_blocks.append(number)
    return loops


def _share(
    arrays: Mapping[str, tuple[str, int]], spans: Mapping[str, list[int]]
) -> dict[str, tuple[str, str, int]]:
    """Return new names of arrays, with kinds and sizes; those not needed at once share one."""
    # Of each place its kind, its size, and the last line in which it is needed.
    places: list[tuple[str, int, int]] = []
    which: dict[str, int] = {}
    for name in sorted(arrays, key=lambda each: spans.get(each, [0, 0])[0]):
        (kind, size), (first, last) = arrays[name], spans.get(name, [0, 0])
        fitting = [
            (abs(other - size), k)
            for k, (its_kind, other, end) in enumerate(places)
            if its_kind == kind and end < first and max(size, other) < 2 * min(size, other)
        ]
        if fitting:
            k = min(fitting)[1]
            places[k] = (kind, max(size, places[k][1]), last)
        else:
            k = len(places)
            places.append((kind, size, last))
        which[name] = k
    return {name: (f"a{k}", *places[k][:2]) for name, k in which.items()}


def _chosen_side(user: Node, node: Node) -> bool | None:
    """Return for which value of its condition a choice needs a node; None for both."""
    count = user.detail[2]
    then, otherwise = user.args[1 : 1 + count], user.args[1 + count :]
    if node is user.args[0] or (node in then) == (node in otherwise):
        return None
    return node in then


def _reachable(scope: Scope, roots: Sequence[Node], texts: Mapping[Node, str]) -> list[Node]:
    """Return what must be evaluated in a scope, each after its arguments."""
    nodes: set[Node] = set()
    stack = list(roots)
    while stack:
        node = stack.pop()
        if node in nodes or node in texts or node.op in ("constant", "leaf", "carry"):
            continue
        if node.scope is not scope:
            continue
        nodes.add(node)
        stack += node.causes
    return sorted(nodes, key=lambda node: (node.stage, node.number))


def _below(roots: Sequence[Node], scope: Scope) -> list[Node]:
    """Return what expressions need that is evaluated outside of a scope, which they are in."""
    found: dict[Node, None] = {}
    seen: set[Node] = set()
    stack = list(roots)
    while stack:
        node = stack.pop()
        if node in seen or node.op == "constant":
            continue
        seen.add(node)
        if node.scope.lies_in(scope):
            stack += node.args
        else:
            found[node] = None
    return list(found)
