"""Large arrays of a traced program: expressions of their entries in loops, and places in memory.

Axes of up to `SHORT` entries are unrolled; the others are those of loops, the lanes of an array. In
memory the lanes of each unrolled entry lie in a block of their own, so that the innermost loop runs
over what lies side by side. An array is one of three:

- an object array of expressions, as small ones are;
- `Lanes`, an expression for each unrolled entry, in a sweep;
- a `View` of entries in memory, in any order: slices, transposes and known indices are views.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import prod
from typing import Any

import numpy as np

from .graph import Graph, Kind, Memory, Node, Store, Sweep

#: Longest axis that is unrolled.
SHORT = 9
#: Arrays of more entries are large, if they have a longer axis.
_LARGE = 64

# Constants whose bits are all 0.
_ZEROS = ("0.0", "0", "False")

# What a sweep evaluates again, instead of reading what another one has written: up to so many
# additions for each entry.
_CHEAP = 12
_COSTS = {"div": 5, "sqrt": 6, "sin": 20, "cos": 20, "exp": 20, "pow": 40}

#: An array: of objects, `Lanes` or `View`.
Nodes = Any
Positions = Any
Shape = tuple[int, ...]


def lane_axes(shape: Shape) -> list[int]:
    """Return the axes of a shape that loops run over."""
    return [axis for axis, size in enumerate(shape) if size > SHORT]


def is_large(shape: Shape) -> bool:
    """Return whether an array of a shape is evaluated in loops."""
    return prod(shape) > _LARGE and bool(lane_axes(shape))


def is_laned(value: Nodes) -> bool:
    """Return whether an array is of expressions in loops, or of places in memory."""
    return isinstance(value, (Lanes, View))


def lane_shape(shape: Shape) -> Shape:
    """Return the numbers of rounds of the loops over an array."""
    return tuple(size for size in shape if size > SHORT)


def short_shape(shape: Shape) -> Shape:
    """Return the shape of what is unrolled of an array."""
    return tuple(size for size in shape if size <= SHORT)


def planar(shape: Shape) -> Positions:
    """Return the positions in memory of an array that lies in blocks of lanes."""
    lanes = lane_axes(shape)
    order = [axis for axis in range(len(shape)) if axis not in lanes] + lanes
    counts = np.arange(prod(shape)).reshape([shape[axis] for axis in order])
    return counts.transpose(np.argsort(order))


def by_entry(array: Any) -> Any:
    """Return an array with a row for each entry that is unrolled, of its lanes."""
    lanes = lane_axes(array.shape)
    order = [axis for axis in range(array.ndim) if axis not in lanes] + lanes
    return array.transpose(order).reshape(prod(short_shape(array.shape)), -1)


@dataclass(eq=False)
class Lanes:
    """An array that a sweep evaluates.

    Attributes:
        sweep: The sweep.
        entries: The expressions of its unrolled entries.
        shape: Shape of the array.
    """

    sweep: Sweep
    entries: Any
    shape: Shape

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)


@dataclass(eq=False)
class Content:
    """What lies in memory.

    Attributes:
        memory: The memory.
        steps: The operations that write it; None before they are made by ``fill``.
        entries: What a sweep writes to each block, if it comes from one.
        nodes: What each entry is, if that is known.
        fill: Makes the operations.
        parts: Arrays whose entries it has, and where, if it is filled from these.
    """

    memory: Memory
    steps: tuple[Node, ...] | None
    entries: list[Node] | None = None
    nodes: list[Node] | None = None
    fill: Callable[[], tuple[Node, ...]] | None = None
    parts: list[tuple[Nodes, Positions]] = field(default_factory=list)

    @property
    def written(self) -> tuple[Node, ...]:
        """The operations that write it."""
        if self.steps is None:
            assert self.fill is not None
            self.steps = self.fill()
        return self.steps


@dataclass(frozen=True, eq=False)
class View:
    """An array whose entries lie in memory.

    Attributes:
        content: What lies there.
        positions: Where each entry lies.
    """

    content: Content
    positions: Positions

    @property
    def shape(self) -> Shape:
        """Shape of the array."""
        return tuple(self.positions.shape)

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)


class Arrays:
    """Makes the sweeps of a program.

    Args:
        graph: Where the expressions are.

    Attributes:
        region: Number of the branch that is being traced; sweeps are not shared between branches.
    """

    def __init__(self, graph: Graph) -> None:
        self.graph, self.region = graph, 0
        self._sweeps: dict[Any, Sweep] = {}
        self._regions: dict[Sweep, tuple[int, Any]] = {}
        self._tables: dict[Any, Content] = {}
        self._pools: dict[Any, Content] = {}
        self._written: dict[Any, Content] = {}

    # Sweeps, and expressions in them.

    def sweep_for(self, shape: Shape, values: Sequence[Nodes], tag: Any = None) -> Sweep:
        """Return the sweep that evaluates an array of a shape from others.

        Args:
            shape: The shape.
            values: The others.
            tag: Sets it apart from sweeps that cannot do the same at once.
        """
        nodes = [self.graph.constant(0)]
        for value in values:
            if isinstance(value, View):
                nodes += value.content.written
            elif not isinstance(value, Lanes):
                nodes += {node: None for node in value.flat}
        stage = max(node.stage for node in nodes)
        scope = max((node.scope for node in nodes), key=lambda each: each.depth)
        own = {value.sweep: None for value in values if isinstance(value, Lanes)}
        lengths, mark = lane_shape(shape), (self.region, tag)
        for sweep in sorted(own, key=lambda each: -each.step.stage):
            here = sweep.step.scope
            rest = [each for each in own if each is not sweep]
            if (
                self._regions[sweep] == mark
                and sweep.lengths == lengths
                and scope.depth <= here.depth
                and all(each.step.scope.depth <= here.depth for each in rest)
                and all(each.step.stage < sweep.step.stage for each in rest)
                and stage < sweep.step.stage
            ):
                return sweep
        stage = max([stage, *(sweep.step.stage for sweep in own)])
        scope = max([scope, *(sweep.step.scope for sweep in own)], key=lambda each: each.depth)
        key = (lengths, mark, scope, stage)
        if key not in self._sweeps:
            sweep = self._sweeps[key] = self.graph.sweep(lengths, scope, stage)
            self._regions[sweep] = mark
        return self._sweeps[key]

    def entries(self, value: Nodes, sweep: Sweep) -> Any:
        """Return the expressions in a sweep of the unrolled entries of an array."""
        if isinstance(value, Lanes):
            if value.sweep is sweep:
                return value.entries
            if (again := self._repeated(value, sweep)) is not None:
                return again
            value = self.view(value)
        if value.ndim == 0:
            return value
        found = np.empty(prod(short_shape(value.shape)), dtype=object)
        if isinstance(value, View):
            for k, positions in enumerate(by_entry(value.positions)):
                found[k] = self._read(value.content, positions, sweep)
        else:
            for k, nodes in enumerate(by_entry(value)):
                found[k] = self._spread(nodes, sweep)
        return found.reshape(short_shape(value.shape))

    def _repeated(self, value: Lanes, sweep: Sweep) -> Any:
        """Return what another sweep evaluates as this one does; None if to read it is cheaper."""
        if value.sweep.lengths != sweep.lengths:
            return None
        inner = value.sweep.scopes[0]
        cost, stack, seen = 0, list(value.entries.flat), set[Node]()
        while stack:
            node = stack.pop()
            if node in seen or not node.scope.lies_in(inner) or node.op == "carry":
                continue
            seen.add(node)
            cost += _COSTS.get(node.op, 1)
            if cost > _CHEAP * value.entries.size or node.op in ("held", "result"):
                return None
            stack += node.args
        again = dict(zip(value.sweep.indices, sweep.indices, strict=True))
        for node in sorted(seen, key=lambda each: each.number):
            args = [again.get(arg, arg) for arg in node.args]
            again[node] = self.graph.make(node.op, args, node.kind, node.detail)
        found = np.empty(value.entries.size, dtype=object)
        found[:] = [again.get(node, node) for node in value.entries.flat]
        return found.reshape(value.entries.shape)

    def map(
        self,
        rule: Callable[..., Sequence[Any]],
        shapes: Sequence[Shape],
        *values: Nodes,
        tag: Any = None,
    ) -> list[Nodes]:
        """Return arrays that a rule for object arrays makes of the unrolled entries of others."""
        widest = max(
            (tuple(value.shape) for value in values), key=lambda each: prod(lane_shape(each))
        )
        sweep = self.sweep_for(widest, values, tag)
        results = rule([self.entries(value, sweep) for value in values])
        return [
            Lanes(sweep, np.broadcast_to(np.asarray(each, object), short_shape(shape)), shape)
            for each, shape in zip(results, shapes, strict=True)
        ]

    def spread(self, value: Nodes, shape: Sequence[int]) -> Nodes:
        """Return an array that is repeated along axes of one entry."""
        if tuple(shape) == tuple(value.shape) or value.ndim == 0:
            return value
        if is_laned(value):
            return self.move(value, lambda array: np.broadcast_to(array, shape))
        return np.broadcast_to(value, shape)

    def _spread(self, nodes: Any, sweep: Sweep) -> Node:
        """Return the expression of lanes of an object array."""
        first: Node = nodes[0]
        if all(node is first for node in nodes):
            return first
        if all(node.op == "constant" for node in nodes):
            return self._constants([node.detail for node in nodes], first.kind, sweep)
        content, positions = self._pool(nodes)
        return self._read(content, positions, sweep)

    def _pool(self, nodes: Any) -> tuple[Content, Positions]:
        """Return a memory that expressions lie in, and where."""
        found = [self._place(node) for node in nodes]
        content = found[0][0]
        if content is not None and all(each is content for each, _ in found):
            return content, np.array([position for _, position in found])
        unique = {node: None for node in nodes}
        key = tuple(node.number for node in unique)
        if key not in self._pools:
            memory = Memory(nodes[0].kind, len(unique))
            step = self._put(memory, list(unique))
            self._pools[key] = Content(memory, (step,), nodes=list(unique))
        order = {node: k for k, node in enumerate(unique)}
        return self._pools[key], np.array([order[node] for node in nodes])

    def lies_in_memory(self, value: Nodes) -> bool:
        """Return whether an object array is large, and its entries lie in memory already."""
        return is_large(value.shape) and all(self._place(node)[0] for node in value.flat)

    def _place(self, node: Node) -> tuple[Content | None, int]:
        """Return where an expression lies already."""
        if (place := self.graph.places.get(node)) is not None:
            memory, position = place
            return self._tables.setdefault(memory, Content(memory, ())), position
        if node.op == "load" and node.args[0].op == "constant":
            memory, block = node.detail
            key = (memory, node.args[1:])
            content = self._tables.setdefault(key, Content(memory, node.args[1:]))
            return content, (block or 0) * memory.size + node.args[0].detail
        return None, 0

    def _put(
        self, memory: Memory, nodes: Sequence[Node], targets: Any = None, at: Node | None = None
    ) -> Node:
        targets = range(len(nodes)) if targets is None else targets
        args = (at or self.graph.constant(0), *nodes)
        return self.graph.make("put", args, "results", (memory, tuple(map(int, targets))))

    def _constants(self, values: Sequence[Any], kind: Kind, sweep: Sweep) -> Node:
        """Return the expression of lanes of constants."""
        array = np.array(values).reshape(sweep.lengths)
        axes = [
            axis
            for axis in range(array.ndim)
            if not np.array_equal(array, np.repeat(array.take([0], axis), array.shape[axis], axis))
        ]
        if not axes:
            return self.graph.constant(values[0])
        flat = array[tuple(slice(None) if k in axes else 0 for k in range(array.ndim))]
        indices = [sweep.indices[axis] for axis in axes]
        if kind == "int" and (line := self._line(flat, indices)) is not None:
            return line
        index = self._line(np.arange(flat.size).reshape(flat.shape), indices)
        assert index is not None
        return self.graph.make("load", (index,), kind, (self._table(flat, kind).memory, 0))

    def _table(self, values: Any, kind: Kind) -> Content:
        key = (kind, values.tobytes())
        if key not in self._tables:
            memory = Memory(kind, values.size, values=tuple(values.ravel().tolist()))
            self._tables[key] = Content(memory, ())
        return self._tables[key]

    def _line(self, numbers: Any, indices: Sequence[Node]) -> Node | None:
        """Return whole numbers as a sum of multiples of indices; None if they are none."""
        first, steps = int(numbers.flat[0]), []
        for axis in range(numbers.ndim):
            along = np.diff(numbers, axis=axis)
            if along.size and np.ptp(along):
                return None
            steps.append(int(along.flat[0]) if along.size else 0)
        return self._sum(first, steps, indices)

    def _sum(self, first: int, steps: Sequence[int], indices: Sequence[Node]) -> Node:
        total = self.graph.constant(0)
        for step, index in zip(steps, indices, strict=True):
            term = self.graph.apply("mul", self.graph.constant(step), index)
            total = self.graph.apply("add", total, term)
        return self.graph.apply("add", total, self.graph.constant(first))

    def _index(self, numbers: Any, sweep: Sweep) -> Node:
        """Return the expression of an index, by lanes."""
        if (line := self._line(numbers, sweep.indices)) is not None:
            return line
        # An index of one axis alone has a table of this axis.
        parts, rest = [], numbers - numbers.flat[0]
        for axis in range(numbers.ndim):
            along = rest[tuple(slice(None) if k == axis else 0 for k in range(numbers.ndim))]
            parts.append(along)
        total: Any = sum(np.ix_(*parts), np.zeros((), int))
        if not np.array_equal(total, rest):
            return self._constants(numbers.ravel().tolist(), "int", sweep)
        index = self.graph.constant(int(numbers.flat[0]))
        for along, leaf in zip(parts, sweep.indices, strict=True):
            term = self._line(along, [leaf])
            if term is None:
                table = self._table(along, "int").memory
                term = self.graph.make("load", (leaf,), "int", (table, 0))
            index = self.graph.apply("add", term, index)
        return index

    def _read(
        self,
        content: Content,
        positions: Any,
        sweep: Sweep,
        offset: Node | None = None,
        reach: int = 0,
    ) -> Node:
        """Return the expression of lanes that lie in memory.

        Args:
            content: The memory.
            positions: Where, for each lane.
            sweep: The sweep.
            offset: What is added to the positions.
            reach: The most that this is.
        """
        memory = content.memory
        low, high = int(positions.min()), int(positions.max()) + reach
        if low == high:
            return self.entry(content, low)
        block = low // memory.size if low // memory.size == high // memory.size else None
        if block is None:
            memory.is_joined = True
        elif content.entries is not None:
            node = content.entries[block]
            if node.scope.depth <= content.written[0].scope.depth:
                return node
        start = 0 if block is None else block * memory.size
        index = self._index(positions.reshape(sweep.lengths) - start, sweep)
        if offset is not None:
            index = self.graph.apply("add", index, offset)
        return self.load(content, block, index)

    def load(self, content: Content, block: int | None, index: Node) -> Node:
        """Return the expression of an entry of a block of memory, or of all blocks."""
        memory = content.memory
        return self.graph.make("load", (index, *content.written), memory.kind, (memory, block))

    def entry(self, content: Content, position: int) -> Node:
        """Return the expression of an entry whose position is known."""
        memory = content.memory
        if memory.values is not None:
            return self.graph.constant(memory.values[position])
        if memory.leaves is not None:
            return self.graph.leaf(memory.leaves[position])
        for value, positions in content.parts:
            if is_laned(value) or is_large(value.shape):
                continue
            if (at := np.flatnonzero(positions.ravel() == position)).size:
                node: Node = value.ravel()[at[0]]
                return node
        block, index = divmod(position, memory.size)
        if content.nodes is not None:
            return content.nodes[position]
        return self.load(content, block, self.graph.constant(index))

    def nodes(self, value: Nodes) -> Any:
        """Return the expressions of all entries."""
        if not is_laned(value):
            return value
        view = self.view(value)
        result = np.empty(view.positions.size, dtype=object)
        for k, position in enumerate(view.positions.flat):
            result[k] = self.entry(view.content, int(position))
        return result.reshape(view.shape)

    # Memory.

    def view(self, value: Nodes) -> View:
        """Return an array as it lies in memory, to which it is written if need be."""
        if isinstance(value, View):
            return value
        if not isinstance(value, Lanes):
            return self._view_of_nodes(value)
        key = (value.sweep, *value.entries.flat)
        if key not in self._written:
            entries = list(value.entries.flat)
            memory = Memory(entries[0].kind, prod(value.sweep.lengths), len(entries))
            for k, node in enumerate(entries):
                self._store(value.sweep, memory, k, planar(value.sweep.lengths), node)
            self._written[key] = Content(memory, (value.sweep.step,), entries)
        return View(self._written[key], planar(value.shape))

    def _view_of_nodes(self, value: Any) -> View:
        nodes = value.ravel()
        if all(node.op == "constant" for node in nodes):
            content = self._table(np.array([node.detail for node in nodes]), nodes[0].kind)
            return View(content, np.arange(value.size).reshape(value.shape))
        content, positions = self._pool(nodes)
        return View(content, positions.reshape(value.shape))

    def _store(
        self,
        sweep: Sweep,
        memory: Memory,
        block: int | None,
        numbers: Any,
        node: Node,
        at: Node | None = None,
    ) -> None:
        index = self._index(numbers.reshape(sweep.lengths), sweep)
        if at is not None:
            index = self.graph.apply("add", index, at)
        sweep.stores.append(Store(memory, block, index, node))

    def write(self, value: Nodes, memory: Memory, targets: Any, at: Node | None = None) -> Node:
        """Return the operation that writes an array to memory.

        Args:
            value: The array.
            memory: The memory.
            targets: Where each entry goes.
            at: What is added to that; the memory then has one block.
        """
        if not is_laned(value) and not is_large(value.shape):
            return self._put(memory, list(value.flat), targets.ravel(), at)
        if not lane_axes(value.shape):
            return self._put(memory, list(self.nodes(value).flat), targets.ravel(), at)
        moment = [] if at is None else [np.array([at], dtype=object)]
        sweep = self.sweep_for(value.shape, [value, *moment])
        entries = self.entries(value, sweep)
        for numbers, node in zip(by_entry(targets), entries.flat, strict=True):
            block, last = int(numbers.min()) // memory.size, int(numbers.max()) // memory.size
            if block != last:
                memory.is_joined = True
                self._store(sweep, memory, None, numbers, node, at)
            else:
                self._store(sweep, memory, block, numbers - block * memory.size, node, at)
        return sweep.step

    def join(self, values: Sequence[Nodes], targets: Sequence[Any], memory: Memory) -> Content:
        """Return a memory to which arrays are written once it is read.

        Args:
            values: The arrays.
            targets: Where each entry of each of them goes.
            memory: The memory.
        """
        parts = list(zip(values, targets, strict=True))

        def fill() -> tuple[Node, ...]:
            steps = (self.write(value, memory, where) for value, where in parts)
            return tuple({step: None for step in steps})

        return Content(memory, None, fill=fill, parts=parts)

    def own(self, value: Nodes, memory: Memory | None = None) -> View:
        """Return an array in blocks of lanes in a memory of its own."""
        if memory is None and isinstance(value, Lanes):
            return self.view(value)
        shape = tuple(value.shape)
        if memory is None:
            memory = Memory(kind_of(value), prod(lane_shape(shape)), prod(short_shape(shape)))
        content = self.join([value], [planar(shape)], memory)
        return View(content, planar(shape))

    def in_blocks(self, value: Nodes) -> View:
        """Return an array in blocks of lanes in memory, where it lies if it lies there so."""
        if isinstance(value, Lanes):
            return self.view(value)
        if not isinstance(value, View) and (zeros := self._zeros(value)) is not None:
            return zeros
        if isinstance(value, View):
            memory, shape = value.content.memory, value.shape
            lies = memory.values is None and memory.leaves is None
            fits = (memory.size, memory.blocks) == (
                prod(lane_shape(shape)),
                prod(short_shape(shape)),
            )
            if lies and fits and np.array_equal(value.positions, planar(shape)):
                return value
        return self.own(value)

    def _zeros(self, value: Any) -> View | None:
        """Return an array in blocks of a table, which nothing is written to, if it is of zeros."""
        zero = value.flat[0]
        if repr(zero.detail) not in _ZEROS or any(node is not zero for node in value.flat):
            return None
        shape = tuple(value.shape)
        size, blocks = prod(lane_shape(shape)), prod(short_shape(shape))
        key = ("zeros", zero.kind, size, blocks)
        if key not in self._tables:
            values = (zero.detail,) * (size * blocks)
            self._tables[key] = Content(Memory(zero.kind, size, blocks, values=values), ())
        return View(self._tables[key], planar(shape))

    # Moves.

    def move(self, value: Nodes, move: Callable[[Any], Any]) -> Nodes:
        """Return an array with its entries moved, as a function moves any array's entries."""
        if isinstance(value, Lanes):
            positions = move(planar(value.shape))
            if lane_shape(positions.shape) == value.sweep.lengths:
                rows, size = by_entry(positions), prod(value.sweep.lengths)
                numbers, starts = np.divmod(rows[:, 0], size)
                if not starts.any() and (rows == rows[:, :1] + np.arange(size)).all():
                    entries = value.entries.ravel()[numbers]
                    shape = tuple(positions.shape)
                    return Lanes(value.sweep, entries.reshape(short_shape(shape)), shape)
            return self._settled(View(self.view(value).content, positions))
        return self._settled(View(value.content, move(value.positions)))

    def _settled(self, view: View) -> Nodes:
        """Return a view, or the expressions of its entries if no loop runs over it."""
        return view if lane_axes(view.shape) else self.nodes(view)

    def concatenate(self, values: Sequence[Nodes], axis: int, shape: Shape) -> Nodes:
        """Return arrays one behind the other along an axis."""
        values = [value for value in values if value.shape[axis]]
        if shape[axis] <= SHORT:
            sweep = self.sweep_for(shape, values)
            rows = [self.entries(value, sweep) for value in values]
            along = sum(size <= SHORT for size in shape[:axis])
            return Lanes(sweep, np.concatenate(rows, axis=along), shape)
        memory = Memory(kind_of(*values), prod(lane_shape(shape)), prod(short_shape(shape)))
        ends = np.cumsum([value.shape[axis] for value in values])[:-1]
        targets = np.split(planar(shape), ends, axis=axis)
        return View(self.join(values, targets, memory), planar(shape))

    def pick(self, values: Sequence[Nodes], place: Callable[[list[Any]], Any]) -> Nodes:
        """Return an array of entries of others, at places that are known.

        Args:
            values: The arrays.
            place: Returns, of arrays of numbers, the one whose entries are taken.
        """
        starts = np.cumsum([0, *(prod(value.shape) for value in values)])
        targets = [
            start + planar(tuple(value.shape)) for value, start in zip(values, starts, strict=False)
        ]
        memory = Memory(kind_of(*values), int(starts[-1]))
        return self._settled(View(self.join(values, targets, memory), np.asarray(place(targets))))

    def take(
        self,
        value: Nodes,
        numbers_at: Callable[[Any, list[int]], Any],
        indices: Sequence[Nodes],
        limits: Sequence[int],
    ) -> Nodes:
        """Return entries of an array at places that are known only at run time.

        Args:
            value: The array.
            numbers_at: Returns, of an array of numbers, those taken with given indices.
            indices: The indices, of shapes that broadcast to that of the result.
            limits: The largest value of each; they are clamped.
        """
        view = self._even(value)
        zeros = [0] * len(indices)
        base = np.asarray(numbers_at(view.positions, zeros))
        steps = []
        for k, limit in enumerate(limits):
            one = [int(k == other and limit > 0) for other in range(len(indices))]
            steps.append(int((np.asarray(numbers_at(view.positions, one)) - base).flat[0]))
        reach = sum(step * limit for step, limit in zip(steps, limits, strict=True))
        shape = tuple(base.shape)
        bounded = [
            self._clamped(index, limit) for index, limit in zip(indices, limits, strict=True)
        ]
        if lane_axes(shape):
            return self._lanes_at(view.content, base, steps, bounded, reach)
        result = np.empty(shape, dtype=object)
        spread: list[Any] = [np.broadcast_to(self.nodes(each), shape) for each in bounded]
        for where in np.ndindex(*shape):
            offset = self._sum(0, steps, [each[where] for each in spread])
            result[where] = self._at(view.content, int(base[where]), offset, reach)
        return result

    def _lanes_at(
        self,
        content: Content,
        base: Positions,
        steps: Sequence[int],
        indices: Sequence[Nodes],
        reach: int,
    ) -> Lanes:
        """Return what lies in memory at positions and multiples of indices."""
        shape = tuple(base.shape)
        wide = [
            self.move(each, lambda array: np.broadcast_to(array, shape))
            if is_laned(each)
            else np.broadcast_to(each, shape)
            for each in indices
        ]
        written = [np.array([step], dtype=object) for step in content.written]
        sweep = self.sweep_for(shape, [*wide, *written])
        rows = [self.entries(each, sweep).ravel() for each in wide]
        found = np.empty(prod(short_shape(shape)), dtype=object)
        for k, positions in enumerate(by_entry(base)):
            offset = self._sum(0, steps, [row[k] for row in rows])
            found[k] = self._read_at(content, positions, sweep, offset, reach)
        return Lanes(sweep, found.reshape(short_shape(shape)), shape)

    def _read_at(
        self, content: Content, positions: Any, sweep: Sweep, at: Node, reach: int
    ) -> Node:
        if reach == 0:
            return self._read(content, positions, sweep)
        return self._read(content, positions, sweep, at, reach)

    def _at(self, content: Content, position: int, at: Node, reach: int) -> Node:
        if at.op == "constant":
            return self.entry(content, position + int(at.detail))
        size = content.memory.size
        block = position // size if position // size == (position + reach) // size else None
        if block is None:
            content.memory.is_joined = True
        first = position - (0 if block is None else block * size)
        return self.load(content, block, self.graph.apply("add", at, self.graph.constant(first)))

    def _even(self, value: Nodes) -> View:
        """Return a view whose positions are even along each axis, so that an index leads to any."""
        view = self.view(value)
        for axis in range(view.ndim):
            along = np.diff(view.positions, axis=axis)
            if along.size and (np.ptp(along) or along.flat[0] < 0):
                return self.own(view)
        return view

    def _clamped(self, index: Nodes, limit: int) -> Nodes:
        low, high = self.graph.constant(0), self.graph.constant(limit)

        def clamp(rows: list[Any]) -> list[Any]:
            bound = np.frompyfunc(
                lambda node: self.graph.apply("min", self.graph.apply("max", node, low), high), 1, 1
            )
            return [np.asarray(bound(rows[0]), dtype=object)]

        if is_laned(index):
            return self.map(clamp, [index.shape], index)[0]
        return clamp([index])[0]

    # Sums and the like along loops.

    def folded(
        self,
        rule: Callable[[Any, Any, Any], Sequence[Any]],
        starts: Sequence[Any],
        values: Sequence[Nodes],
        axes: Sequence[int],
        runs: bool = False,
    ) -> list[Nodes]:
        """Return what is made of entries along loops, one after the other.

        Args:
            rule: Returns what is held after an entry, given what was held before, the entries of
                the arrays and their number along the only axis.
            starts: What is held at first.
            values: The arrays, of one shape.
            axes: The axes, all of them of loops.
            runs: Whether what is held after each entry is returned, not only after the last one.
        """
        shape = tuple(values[0].shape)
        lanes = lane_axes(shape)
        reduced = [lanes.index(axis) for axis in axes]
        tag = ("fold", tuple(reduced)) if len(lanes) - 1 in reduced else None
        read = values if tag is None else [self.view(value) for value in values]
        sweep = self.sweep_for(shape, read, tag)
        rows = [self.entries(value, sweep) for value in values]
        entries = rows[0]
        kept = [k for k in range(len(lanes)) if k not in reduced]
        sizes = [sweep.lengths[k] for k in kept]
        strides = [prod(sizes[k + 1 :]) for k in range(len(sizes))]
        index = self._sum(0, strides, [sweep.indices[k] for k in kept])
        constants = [self.graph.constant(start) for start in starts]
        memories = [Memory(each.kind, prod(sizes), entries.size) for each in constants]
        after: list[list[Node]] = [[] for _ in starts]
        for k, nodes in enumerate(zip(*(row.flat for row in rows), strict=True)):
            held = [
                self.graph.make("held", (index, sweep.indices[-1]), memory.kind, (memory, k, sweep))
                for memory in memories
            ]
            results = rule(held, nodes, sweep.indices[reduced[0]])
            for which, (memory, result) in enumerate(zip(memories, results, strict=True)):
                sweep.stores.append(Store(memory, k, index, result, constants[which]))
                after[which].append(result)
        rest = tuple(size for axis, size in enumerate(shape) if axis not in axes)
        if runs:
            array = np.empty(entries.size, dtype=object)
            array[:] = after[0]
            return [Lanes(sweep, array.reshape(short_shape(shape)), shape)]
        contents = [Content(memory, (sweep.step,)) for memory in memories]
        return [self._settled(View(content, planar(rest))) for content in contents]


def kind_of(*values: Nodes) -> Kind:
    """Return what the entries of arrays are."""
    value = values[0]
    if isinstance(value, View):
        return value.content.memory.kind
    node: Node = (value.entries if isinstance(value, Lanes) else value).flat[0]
    return node.kind
