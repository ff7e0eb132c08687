"""Scalar expressions of a program: equal ones exist once, and those of constants are folded.

Folding keeps the bits, with three exceptions: 0 x is 0 although x may not be finite, x + 0 is x
although x may be -0, and -(a - b) is b - a, which has another zero where a is b.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from math import ceil, cos, floor, inf, isfinite, isnan, nan, sin, sqrt
from typing import Any, Literal

import numpy as np

#: What an expression is: a double, an int or a truth value, or a step with several results.
Kind = Literal["double", "int", "truth", "results"]


class Scope:
    """What is evaluated together: the program itself, or one round of a loop in it.

    Args:
        outer: The scope that it lies in; None for the program.
    """

    def __init__(self, outer: Scope | None = None) -> None:
        self.outer = outer
        self.depth: int = 0 if outer is None else outer.depth + 1

    def lies_in(self, other: Scope) -> bool:
        """Return whether this is another scope, or lies in it."""
        scope: Scope | None = self
        while scope is not None and scope.depth > other.depth:
            scope = scope.outer
        return scope is other


@dataclass(frozen=True, eq=False)
class Node:
    """An expression.

    Attributes:
        op: Its operation; ``constant``, ``leaf`` and ``carry`` have no arguments.
        args: Its arguments.
        kind: What it is.
        scope: The innermost scope of its arguments, in which it is evaluated.
        number: Larger than those of its arguments.
        stage: Largest number of sweeps of which each needs the last one's results, see `Sweep`.
        detail: The value of a constant, the name of a leaf, the index of a result, or what else
            the operation needs.
    """

    op: str
    args: tuple[Node, ...]
    kind: Kind
    scope: Scope
    number: int
    stage: int = 0
    detail: Any = None

    @property
    def causes(self) -> Sequence[Node]:
        """What must be evaluated before."""
        return self.detail.inputs if self.op == "sweep" else self.args


@dataclass(eq=False)
class Memory:
    """Where the entries of a large array lie, in blocks that loops run over.

    Attributes:
        kind: What they are.
        size: Number of entries of a block.
        blocks: Number of blocks.
        values: The values of a table of constants.
        leaves: The names of leaves, of what is given from outside.
        sources: The two memories of which it is one, if a condition decides which.
        is_joined: Whether blocks lie one behind the other, since an index leads to several.
    """

    kind: Kind
    size: int
    blocks: int = 1
    values: tuple[Any, ...] | None = None
    leaves: tuple[str, ...] | None = None
    sources: tuple[Memory, Memory] | None = None
    is_joined: bool = False


@dataclass(frozen=True, eq=False)
class Store:
    """What a sweep writes to memory: at an index of a block, or of all blocks if ``block`` is None.

    Attributes:
        memory: The memory.
        block: The block.
        index: Where.
        value: What.
        start: What the block holds before the sweep, if that is read.
    """

    memory: Memory
    block: int | None
    index: Node
    value: Node
    start: Node | None = None

    def concerns(self, memory: Memory, block: int | None) -> bool:
        """Return whether it writes to a block of a memory; None for all blocks."""
        return self.memory is memory and (None in (block, self.block) or self.block == block)


@dataclass(eq=False)
class Sweep:
    """Nested loops over the entries of arrays, which evaluate expressions and write them to memory.

    What is evaluated for arrays of the same shape stands in one sweep, as long as it does not need
    what is complete only after it. While a program is traced, a sweep gets further stores.

    Attributes:
        lengths: Numbers of rounds, those of the outermost loop first.
        indices: Leaves that count them.
        step: The sweep as an operation of the scope around it.
        stores: What may be written.
        live: Those of which something is read.
        inputs: What it needs of the scopes around it.
    """

    lengths: tuple[int, ...]
    indices: list[Node]
    step: Node
    stores: list[Store] = field(default_factory=list)
    live: list[Store] = field(default_factory=list)
    inputs: list[Node] = field(default_factory=list)

    @property
    def scopes(self) -> list[Scope]:
        """The scopes of its loops."""
        return [index.scope for index in self.indices]

    def of(self, memory: Memory, block: int | None) -> list[Store]:
        """Return what writes to a block of a memory, or to all blocks."""
        return [store for store in self.stores if store.concerns(memory, block)]


@dataclass(eq=False)
class Loop:
    """Rounds that are repeated while a condition holds.

    Attributes:
        scope: Scope of a round.
        carries: Leaves of what goes from round to round.
        condition: Whether there is another round.
        after: What is carried, after a round.
        most: Largest number of rounds; None if it is not known.
        copies: Memory that goes from round to round, and what it becomes after a round.
        writes: What writes to memory in a round: operations and their memories.
        outside: Expressions of outer scopes that a round uses.
    """

    scope: Scope
    carries: list[Node]
    condition: Node
    after: list[Node]
    most: int | None
    copies: list[Copy] = field(default_factory=list)
    writes: list[tuple[Node, Memory]] = field(default_factory=list)
    outside: list[Node] = field(default_factory=list)

    @property
    def roots(self) -> list[Node]:
        """What a round evaluates, but for the condition."""
        steps = [step for copy in self.copies for step in copy.steps]
        return [*self.after, *steps, *(step for step, _ in self.writes)]


@dataclass(frozen=True, eq=False)
class Copy:
    """Memory that is copied to other memory, once ``steps`` have written it."""

    target: Memory
    source: Memory
    steps: tuple[Node, ...]
    starts: tuple[Node, ...]


class Graph:
    """The expressions of a program."""

    def __init__(self) -> None:
        self.top = Scope()
        self._nodes: dict[Any, Node] = {}
        self._count = 0
        #: Where the leaves of arrays lie.
        self.places: dict[Node, tuple[Memory, int]] = {}

    def constant(self, value: Any) -> Node:
        """Return a constant: a truth value, a whole number or a float, of Python or NumPy."""
        value = value.item() if isinstance(value, np.generic) else value
        kind: Kind = "double"
        if isinstance(value, (bool, int)):
            kind = "truth" if isinstance(value, bool) else "int"
        key = ("constant", kind, repr(value))
        return self._once(key, "constant", (), kind, self.top, value)

    def leaf(self, name: str) -> Node:
        """Return a number that is given from outside, by its name."""
        return self._once(("leaf", name), "leaf", (), "double", self.top, name)

    def array(self, names: Sequence[str]) -> list[Node]:
        """Return numbers that are given from outside, one behind the other, by their names."""
        memory = Memory("double", len(names), leaves=tuple(names))
        nodes = [self.leaf(name) for name in names]
        self.places.update((node, (memory, k)) for k, node in enumerate(nodes))
        return nodes

    def carry(self, kind: Kind, scope: Scope, stage: int = 0) -> Node:
        """Return what a loop carries into a round, whose scope is given."""
        return self._once(("carry", self._count), "carry", (), kind, scope, None, stage)

    def sweep(self, lengths: tuple[int, ...], scope: Scope, stage: int) -> Sweep:
        """Return a sweep of a scope that follows the sweeps of lower stages."""
        indices = []
        inner = scope
        for _ in lengths:
            inner = Scope(inner)
            indices.append(self.carry("int", inner, stage))
        key = ("sweep", self._count)
        step = self._once(key, "sweep", (), "results", scope, None, stage + 1)
        sweep = Sweep(lengths, indices, step)
        object.__setattr__(step, "detail", sweep)
        return sweep

    def apply(self, op: str, *args: Node) -> Node:
        """Return an operation, folded."""
        # Few begin with a constant, so that the others are seldom looked at.
        is_known = args[0].op == "constant" and all(arg.op == "constant" for arg in args)
        if is_known and (fold := _FOLDS.get(op)) is not None:
            return self.constant(fold(*(arg.detail for arg in args)))
        if (rule := _RULES.get(op)) is not None and (simpler := rule(self, *args)) is not None:
            return simpler
        if op in _COMMUTES and args[0].number > args[1].number:
            args = args[::-1]
        return self.make(op, args, _kind(op, args))

    def make(self, op: str, args: Sequence[Node], kind: Kind, detail: Any = None) -> Node:
        """Return an operation as it is."""
        mark = detail if detail is None or isinstance(detail, (int, str, tuple)) else id(detail)
        key = (op, *[arg.number for arg in args], mark)
        # Most exist already.
        if (node := self._nodes.get(key)) is not None:
            return node
        scope = self.top
        for arg in args:
            if arg.scope.depth > scope.depth:
                scope = arg.scope
        return self._once(key, op, tuple(args), kind, scope, detail)

    def results(
        self, op: str, args: Sequence[Node], kinds: Sequence[Kind], detail: Any = None
    ) -> list[Node]:
        """Return the results of an operation that has several."""
        step = self.make(op, args, "results", detail)
        return [
            self.make("result", (step,), kind, (number, kind)) for number, kind in enumerate(kinds)
        ]

    def _once(
        self,
        key: Any,
        op: str,
        args: tuple[Node, ...],
        kind: Kind,
        scope: Scope,
        detail: Any,
        stage: int = 0,
    ) -> Node:
        if (node := self._nodes.get(key)) is None:
            self._count += 1
            stage = max([arg.stage for arg in args], default=stage)
            node = Node(op, args, kind, scope, self._count, stage, detail)
            self._nodes[key] = node
        return node


def _reads(node: Node) -> list[tuple[Node, Memory, int | None]]:
    """Return what an operation reads of memory: what has written it, the memory, and the block."""
    if node.op == "load":
        return [(step, *node.detail) for step in node.args[1:]]
    if node.op == "held":
        memory, block, sweep = node.detail
        return [(sweep.step, memory, block)]
    if node.op == "choose":
        _, sources, count = node.detail
        return [(step, sources[k >= count], None) for k, step in enumerate(node.args[1:])]
    return []


def _needs(node: Node, within: Scope) -> Iterator[Node]:
    """Yield what a node needs; what sweeps within a scope write, as far as it is read, too."""
    yield from node.args
    for step, memory, block in _reads(node):
        if step.op == "sweep" and step.scope.lies_in(within):
            for store in step.detail.of(memory, block):
                yield store.index
                yield store.value


def outside(loop: Loop) -> Iterator[Node]:
    """Yield the expressions of outer scopes that a round of a loop uses, once each."""
    stack = [loop.condition, *loop.roots]
    for step, memory in round_writes(loop):
        if step.op == "sweep" and step.scope.lies_in(loop.scope):
            for store in step.detail.of(memory, None):
                stack += [store.index, store.value]
    seen: set[Node] = set()
    while stack:
        node = stack.pop()
        if node in seen or node.op == "constant":
            continue
        seen.add(node)
        if node.scope.lies_in(loop.scope):
            stack += _needs(node, loop.scope)
        else:
            yield node


def round_writes(loop: Loop) -> list[tuple[Node, Memory]]:
    """Return what writes memory in a round that is read after it, and the memory."""
    return [*((step, each.source) for each in loop.copies for step in each.steps), *loop.writes]


class _Reads:
    """What is read of memory, found from what is evaluated."""

    def __init__(self, roots: Iterable[Node]) -> None:
        self.blocks: dict[tuple[Memory, int | None], None] = {}
        self.live: dict[Sweep, dict[Store, None]] = {}
        self._stack, seen = list(roots), set[Node]()
        while self._stack:
            node = self._stack.pop()
            if node not in seen:
                seen.add(node)
                self._stack += node.args
                self._visit(node)

    def _visit(self, node: Node) -> None:
        if node.op == "load":
            self.blocks[node.detail] = None
        for step, memory, block in _reads(node):
            self._read(step, memory, block)
        if node.op == "choose":
            # Nothing writes a table.
            self.blocks |= {(each, None): None for each in node.detail[1] if each.values}
        if node.op == "loop":
            loop: Loop = node.detail
            self._stack += [loop.condition, *loop.roots]
            for step, memory in round_writes(loop):
                self._read(step, memory, None)
            for each in loop.copies:
                self.blocks[each.target, None] = None
                for step in each.starts:
                    self._read(step, each.target, None)

    def _read(self, step: Node, memory: Memory, block: int | None) -> None:
        self.blocks[memory, block] = None
        if step.op == "sweep":
            live = self.live.setdefault(step.detail, {})
            for store in step.detail.of(memory, block):
                if store not in live:
                    live[store] = None
                    self._stack += (store.index, store.value)


def mark_live(roots: Iterable[Node]) -> list[tuple[Memory, int | None]]:
    """Find which stores of sweeps are read, and what sweeps need.

    Returns:
        The blocks of memory that are read, None for all of a memory.
    """
    reads = _Reads(roots)
    for sweep, live in reads.live.items():
        sweep.live = [store for store in sweep.stores if store in live]
        sweep.inputs = list(_inputs(sweep))
    return list(reads.blocks)


def _inputs(sweep: Sweep) -> Iterator[Node]:
    """Yield what the stores of a sweep that are read need of the scopes around it."""
    stack = [each for store in sweep.live for each in (store.index, store.value)]
    inner, seen = sweep.scopes[0], set[Node]()
    while stack:
        node = stack.pop()
        if node in seen or node.op == "constant":
            continue
        seen.add(node)
        if node.scope.lies_in(inner):
            stack += node.args
        else:
            yield node


_TRUE = frozenset(("lt", "le", "gt", "ge", "eq", "ne", "and", "or", "not", "is_finite", "signbit"))
_COMMUTES = frozenset(("add", "mul", "and", "or", "eq", "ne"))


def _kind(op: str, args: tuple[Node, ...]) -> Kind:
    if op in _TRUE:
        return "truth"
    if op in ("double", "int"):
        return "double" if op == "double" else "int"
    return args[-1].kind


def _divide(a: float, b: float) -> float:
    with np.errstate(all="ignore"):
        return float(np.float64(a) / np.float64(b))


def _least(a: float, b: float) -> float:
    return nan if isnan(a) or isnan(b) else min(a, b)


def _most(a: float, b: float) -> float:
    return nan if isnan(a) or isnan(b) else max(a, b)


def _number(function: Callable[[float], float]) -> Callable[[float], float]:
    """Return a function of Python that leaves alone what is not finite."""
    return lambda x: float(function(x)) if isfinite(x) else x


_FOLDS: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": _divide,
    "neg": lambda a: -a,
    "abs": abs,
    "min": _least,
    "max": _most,
    "sqrt": lambda a: sqrt(a) if a >= 0.0 else nan,
    "sin": lambda a: sin(a) if isfinite(a) else nan,
    "cos": lambda a: cos(a) if isfinite(a) else nan,
    "floor": _number(floor),
    "ceil": _number(ceil),
    "exp": lambda a: float(np.exp(a)),
    "lt": lambda a, b: a < b,
    "le": lambda a, b: a <= b,
    "gt": lambda a, b: a > b,
    "ge": lambda a, b: a >= b,
    "eq": lambda a, b: a == b,
    "ne": lambda a, b: a != b,
    "and": lambda a, b: a and b,
    "or": lambda a, b: a or b,
    "not": lambda a: not a,
    "is_finite": isfinite,
    "signbit": lambda a: bool(np.signbit(a)),
    "double": float,
    "int": lambda a: int(a) if isfinite(a) else 0,
    "select": lambda c, a, b: a if c else b,
}


def _is(node: Node, *values: Any) -> bool:
    return node.op == "constant" and any(node.detail == value for value in values)


def _add(graph: Graph, a: Node, b: Node) -> Node | None:
    if _is(a, 0):
        return b
    if _is(b, 0):
        return a
    if b.op == "neg":
        return graph.apply("sub", a, b.args[0])
    return graph.apply("sub", b, a.args[0]) if a.op == "neg" else None


def _sub(graph: Graph, a: Node, b: Node) -> Node | None:
    if _is(b, 0):
        return a
    if _is(a, 0):
        return graph.apply("neg", b)
    return graph.apply("add", a, b.args[0]) if b.op == "neg" else None


def _mul(graph: Graph, a: Node, b: Node) -> Node | None:
    if a.op != "constant":
        a, b = b, a
    if _is(a, 0):
        return graph.constant(0.0 if a.kind == "double" else 0)
    if _is(a, 1):
        return b
    if _is(a, -1):
        return graph.apply("neg", b)
    return None


def _div(graph: Graph, a: Node, b: Node) -> Node | None:
    if _is(a, 0):
        return a
    if _is(b, 1):
        return a
    if _is(b, -1):
        return graph.apply("neg", a)
    if b.op == "constant" and b.detail and isfinite(b.detail) and np.frexp(b.detail)[0] == 0.5:
        return graph.apply("mul", a, graph.constant(1.0 / b.detail))
    return None


def _neg(graph: Graph, a: Node) -> Node | None:
    if a.op == "neg":
        return a.args[0]
    return graph.apply("sub", a.args[1], a.args[0]) if a.op == "sub" else None


def _abs(graph: Graph, a: Node) -> Node | None:
    if a.op == "abs":
        return a
    return graph.apply("abs", a.args[0]) if a.op == "neg" else None


def _min(graph: Graph, a: Node, b: Node) -> Node | None:
    return _bound(a, b, inf)


def _max(graph: Graph, a: Node, b: Node) -> Node | None:
    return _bound(a, b, -inf)


def _bound(a: Node, b: Node, none: float) -> Node | None:
    if _is(a, none) or a is b:
        return b
    return a if _is(b, none) else None


def _and(graph: Graph, a: Node, b: Node) -> Node | None:
    return _join(a, b, True)


def _or(graph: Graph, a: Node, b: Node) -> Node | None:
    return _join(a, b, False)


def _join(a: Node, b: Node, neutral: bool) -> Node | None:
    for one, other in ((a, b), (b, a)):
        if one.op == "constant":
            return other if bool(one.detail) == neutral else one
    return a if a is b else None


def _not(graph: Graph, a: Node) -> Node | None:
    return a.args[0] if a.op == "not" else None


def _select(graph: Graph, c: Node, a: Node, b: Node) -> Node | None:
    if c.op == "constant":
        return a if c.detail else b
    if a is b:
        return a
    if c.op == "not":
        return graph.apply("select", c.args[0], b, a)
    if a.kind == "truth" and a.op == "constant":
        return graph.apply("or", c, b) if a.detail else graph.apply("and", _no(graph, c), b)
    if b.kind == "truth" and b.op == "constant":
        return graph.apply("or", _no(graph, c), a) if b.detail else graph.apply("and", c, a)
    # What a branch decides again by the same condition.
    if a.op == "select" and a.args[0] is c:
        return graph.apply("select", c, a.args[1], b)
    if b.op == "select" and b.args[0] is c:
        return graph.apply("select", c, a, b.args[2])
    return None


def _no(graph: Graph, c: Node) -> Node:
    return graph.apply("not", c)


def _unequal(graph: Graph, a: Node, b: Node) -> Node | None:
    """Simplify ``ne`` of a truth value and 0, which is how it is converted from a number."""
    for one, other in ((a, b), (b, a)):
        if _is(other, 0):
            if one.kind == "truth":
                return one
            if one.op == "double" and one.args[0].kind == "truth":
                return one.args[0]
    return None


def _same_kind(kind: Kind) -> Callable[[Graph, Node], Node | None]:
    return lambda graph, a: a if a.kind == kind else None


_RULES: dict[str, Callable[..., Node | None]] = {
    "add": _add,
    "sub": _sub,
    "mul": _mul,
    "div": _div,
    "neg": _neg,
    "abs": _abs,
    "min": _min,
    "max": _max,
    "and": _and,
    "or": _or,
    "not": _not,
    "select": _select,
    "ne": _unequal,
    "double": _same_kind("double"),
    "int": _same_kind("int"),
}
