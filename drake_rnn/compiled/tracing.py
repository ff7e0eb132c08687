"""Programs traced by JAX as expression graphs: each primitive in scalars, loops as loops."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from itertools import pairwise, product
from math import inf, prod
from operator import itemgetter
from pathlib import PurePath
from typing import Any

import numpy as np

from ..arrays.algebra import require_jax
from ..errors import InvalidInputError
from .graph import Copy, Graph, Kind, Loop, Memory, Node, Scope, outside
from .sweeps import (
    SHORT,
    Arrays,
    Content,
    Nodes,
    View,
    is_laned,
    is_large,
    kind_of,
    lane_axes,
    planar,
)

# Longer ones, over arrays, are not unrolled.
_UNROLL_LIMIT = 64
# Orders of more entries are not found by exchanges of neighbours, which are unrolled.
_EXCHANGES = 16
_LONGEST_ORDER = 400


class Tracer:
    """Evaluates what JAX has traced with expressions for numbers.

    Args:
        graph: Where the expressions are.
        what: What is traced, for messages.
    """

    def __init__(self, graph: Graph, what: str) -> None:
        self.graph, self._what = graph, what
        self._jax = require_jax()
        self._arrays = Arrays(graph)
        # What is being evaluated, one within another.
        self._within: list[Any] = []
        # The loops that are being traced, and what their rounds write to memory.
        self._scopes = [graph.top]
        self._writes: list[list[tuple[Node, Memory]]] = []
        self._regions = 0

    def evaluate(self, closed_jaxpr: Any, args: Sequence[Nodes]) -> list[Nodes]:
        """Return the results of a closed jaxpr, arrays of expressions.

        Raises:
            InvalidInputError: If it has an operation that C has not; the message names the line.
        """
        return self._run(
            closed_jaxpr.jaxpr, [self._constants(each) for each in closed_jaxpr.consts], args
        )

    def _constants(self, values: Any) -> Nodes:
        return _map(self.graph.constant, np.asarray(values))

    def _run(self, jaxpr: Any, consts: Sequence[Nodes], args: Sequence[Nodes]) -> list[Nodes]:
        values: dict[Any, Nodes] = {}
        literal = import_module("jax.extend.core").Literal

        def read(var: Any) -> Nodes:
            return self._constants(var.val) if isinstance(var, literal) else values[var]

        values.update(zip(jaxpr.constvars, consts, strict=True))
        values.update(zip(jaxpr.invars, args, strict=True))
        for equation in jaxpr.eqns:
            operands = [read(var) for var in equation.invars]
            self._within.append(equation)
            results = self._apply(equation, operands)
            self._within.pop()
            for var, value in zip(equation.outvars, results, strict=True):
                if not is_laned(value):
                    value = np.broadcast_to(np.asarray(value, dtype=object), var.aval.shape)
                values[var] = value
        return [read(var) for var in jaxpr.outvars]

    def entries(self, value: Nodes) -> Nodes:
        """Return the expressions of all entries of an array."""
        return self._arrays.nodes(value)

    def _apply(self, equation: Any, operands: list[Nodes]) -> Sequence[Nodes]:
        if self._is_wide(equation, operands):
            return self._apply_wide(equation, operands)
        return self._apply_narrow(equation, operands)

    def _is_wide(self, equation: Any, operands: list[Nodes]) -> bool:
        """Return whether an operation is on large arrays, and not on their entries one by one."""
        name = equation.primitive.name
        if name in _CALLS or name in _WHOLE:
            return False
        if any(is_laned(each) for each in operands):
            return True
        if name in _JOINS:
            return any(self._arrays.lies_in_memory(each) for each in operands)
        shapes = [each.shape for each in operands]
        if name not in _MOVES:
            shapes += [var.aval.shape for var in equation.outvars]
        if name in _MOVES or not any(is_large(shape) for shape in shapes):
            return False
        known = operands[1:] if name in ("gather", "dynamic_slice") else operands
        return not all(node.op == "constant" for each in known for node in each.flat)

    def _apply_wide(self, equation: Any, operands: list[Nodes]) -> Sequence[Nodes]:
        name, params = equation.primitive.name, equation.params
        if (rule := _WIDE.get(name)) is not None:
            return rule(self, equation, operands)
        if (moves := _MOVES.get(name)) is not None:
            return [self._arrays.move(operands[0], partial(moves, params))]
        if name in _ELEMENTWISE or name in _BY_ENTRY:
            return self._by_entry(equation, operands)
        raise self._refusal(equation, f"operation {name!r} of a large array")

    def _by_entry(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return what an operation makes of large arrays, whose lanes it leaves as they are."""
        if equation.primitive.name in _OF_MATRICES and _has_long_matrix(operands):
            return list(
                self._apply_narrow(equation, [self._arrays.nodes(each) for each in operands])
            )
        shapes = [tuple(var.aval.shape) for var in equation.outvars]
        if equation.primitive.name not in _OF_MATRICES:
            operands = [self._arrays.spread(each, shapes[0]) for each in operands]
        rule = partial(self._apply_narrow, equation)
        # A call of a function that no compiler vectorizes keeps the rest of a loop from it.
        tag = "call" if equation.primitive.name in _CALLED else None
        return self._arrays.map(rule, shapes, *operands, tag=tag)

    def _apply_narrow(self, equation: Any, operands: list[Nodes]) -> Sequence[Nodes]:
        name = equation.primitive.name
        if (op := _ELEMENTWISE.get(name)) is not None:
            return [self._each(op, *operands)]
        if (moves := _MOVES.get(name)) is not None:
            result = moves(equation.params, *operands)
            return result if isinstance(result, list) else [result]
        if (rule := _RULES.get(name)) is not None:
            return rule(self, equation, operands)
        for key in ("jaxpr", "call_jaxpr", "fun_jaxpr"):
            if name in _CALLS and (inner := equation.params.get(key)) is not None:
                return self.evaluate(inner, operands)
        raise self._refusal(equation, f"operation {name!r}")

    def _refusal(self, equation: Any, what: str) -> InvalidInputError:
        """Return an error that names the line of what cannot be compiled."""
        lines = [line for each in (equation, *reversed(self._within)) if (line := _line(each))]
        place = f", {lines[0]}" if lines else ""
        return InvalidInputError(f"{self._what}{place}: {what} cannot be compiled to C")

    def _each(self, op: str, *operands: Nodes) -> Nodes:
        if any(is_laned(each) for each in operands):
            shape = np.broadcast_shapes(*(each.shape for each in operands))
            spread = [self._arrays.spread(each, shape) for each in operands]
            (result,) = self._arrays.map(lambda rows: [self._each(op, *rows)], [shape], *spread)
            return result
        return _map(lambda *nodes: self.graph.apply(op, *nodes), *operands)

    def _reduce(self, op: str, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        return [self._fold(op, operands[0], equation.params["axes"])]

    def _fold(self, op: str, array: Nodes, axes: Sequence[int]) -> Nodes:
        """Return an array folded along axes, one entry after the other."""
        rest = [axis for axis in range(array.ndim) if axis not in axes]
        shape = tuple(array.shape[axis] for axis in rest)
        rows = array.transpose(*rest, *axes).reshape(*shape, -1)
        total = rows[..., 0]
        for k in range(1, rows.shape[-1]):
            total = self._each(op, total, rows[..., k])
        return total

    def _reduce_wide(self, op: str, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        return [self._fold_wide(op, operands[0], equation.params["axes"])]

    def _fold_wide(self, op: str, value: Nodes, axes: Sequence[int]) -> Nodes:
        """Return a large array folded along axes: unrolled ones first, then those of loops."""
        shape = tuple(value.shape)
        short = [axis for axis in axes if shape[axis] <= SHORT]
        if short:
            rest = tuple(size for axis, size in enumerate(shape) if axis not in short)
            places = [_short_axis(shape, axis) for axis in short]
            (value,) = self._arrays.map(
                lambda rows: [self._fold(op, rows[0], places)], [rest], value
            )
            axes = [axis - sum(each < axis for each in short) for axis in axes if axis not in short]
        if not axes:
            return value
        last = lane_axes(tuple(value.shape))[-1]
        if len(axes) > 1 and last in axes:
            # What is folded along the last axis last is folded by loops along it before.
            value = self._fold_wide(op, value, [axis for axis in axes if axis != last])
            axes = [last - (len(axes) - 1)]
        if (count := _chunk(value.shape, axes)) is not None:
            return self._fold_in_chunks(op, value, axes[0], count)
        start = _start(op, kind_of(value))
        (result,) = self._arrays.folded(
            lambda held, nodes, _: [self.graph.apply(op, held[0], nodes[0])], [start], [value], axes
        )
        return result

    def _fold_in_chunks(self, op: str, value: Nodes, axis: int, count: int) -> Nodes:
        """Return an array folded along its last lanes, so many of which are folded first.

        Each addition waits for the one before it; those of several chunks do not.
        """
        shape = tuple(value.shape)
        rounds, rest = divmod(shape[axis], count)
        split = (*shape[:axis], rounds, count, *shape[axis + 1 :])
        main = self._move(
            value, lambda array: array.take(range(rounds * count), axis).reshape(split)
        )
        total = self._fold_wide(op, main, (axis, axis + 1))
        if rest:
            order = range(rounds * count, shape[axis])
            tail = self._move(value, lambda array: array.take(order, axis))
            fold = self._fold_wide if is_laned(tail) else self._fold
            total = self._each(op, total, fold(op, tail, (axis,)))
        return total

    def _largest_at_wide(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        (axis,) = equation.params["axes"]
        (value,), shape = operands, tuple(operands[0].shape)
        better = "gt" if equation.primitive.name == "argmax" else "lt"
        if shape[axis] <= SHORT:
            return [self._along(better, value, axis)[1]]
        return [self._extreme_wide(better, value, axis)[1]]

    def _extreme_wide(self, better: str, value: Nodes, axis: int) -> list[Nodes]:
        """Return the largest, or the least, entries along loops, and where the first ones are."""
        count = _chunk(value.shape, [axis])
        values, rest = [value], 0
        if count is not None:
            values, rest = self._extremes(better, value, axis, count)

        def rule(held: list[Node], nodes: Sequence[Node], number: Node) -> list[Node]:
            higher = self.graph.apply(better, nodes[0], held[0])
            if count is not None:
                number = self.graph.apply("mul", self.graph.constant(count), number)
                number = self.graph.apply("add", nodes[1], number)
            return [
                self.graph.apply("select", higher, nodes[0], held[0]),
                self.graph.apply("select", higher, number, held[1]),
            ]

        starts = [_start("max" if better == "gt" else "min", kind_of(value)), 0]
        found = self._arrays.folded(rule, starts, values, [axis])
        if not rest:
            return found
        size = value.shape[axis]
        tail = self._move(value, lambda array: array.take(range(size - rest, size), axis))
        best, at = self._along(better, tail, axis)
        higher = self._each(better, best, found[0])
        at = self._each("add", at, self._constants(size - rest))
        return [self._each("select", higher, *each) for each in ((best, found[0]), (at, found[1]))]

    def _extremes(
        self, better: str, value: Nodes, axis: int, count: int
    ) -> tuple[list[Nodes], int]:
        """Return the same of chunks of entries, and the number of those that are left."""
        shape = tuple(value.shape)
        rounds, rest = divmod(shape[axis], count)
        split = (*shape[:axis], rounds, count, *shape[axis + 1 :])
        main = self._move(
            value, lambda array: array.take(range(rounds * count), axis).reshape(split)
        )
        return self._along(better, main, axis + 1), rest

    def _along(self, better: str, value: Nodes, axis: int) -> list[Nodes]:
        """Return the same along an axis that is unrolled."""
        shape = tuple(value.shape)
        rest = shape[:axis] + shape[axis + 1 :]
        if not (is_laned(value) or is_large(shape)):
            return self._extreme(better, value, axis)
        place = _short_axis(shape, axis)
        return self._arrays.map(
            lambda rows: self._extreme(better, rows[0], place), [rest, rest], value
        )

    def _largest_at(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return where the first of the largest, or of the least, entries is."""
        (axis,) = equation.params["axes"]
        better = "gt" if equation.primitive.name == "argmax" else "lt"
        return [self._extreme(better, operands[0], axis)[1]]

    def _extreme(self, better: str, array: Nodes, axis: int) -> list[Nodes]:
        rows = np.moveaxis(array, axis, -1)
        best, at = rows[..., 0], self._constants(np.zeros(rows.shape[:-1], int))
        for k in range(1, rows.shape[-1]):
            higher = self._each(better, rows[..., k], best)
            best = self._each("select", higher, rows[..., k], best)
            at = self._each("select", higher, self._constants(k), at)
        return [best, at]

    def _product(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        (left_sum, right_sum), (left_batch, right_batch) = equation.params["dimension_numbers"]
        left, batch, rows = _arrange(operands[0], left_batch, left_sum)
        right, _, columns = _arrange(operands[1], right_batch, right_sum)
        result = np.empty((left.shape[0], left.shape[1], right.shape[1]), dtype=object)
        for b, i, k in np.ndindex(*result.shape):
            terms = [
                self.graph.apply("mul", x, y) for x, y in zip(left[b, i], right[b, k], strict=True)
            ]
            result[b, i, k] = self._sum(terms)
        return [result.reshape((*batch, *rows, *columns))]

    def _product_wide(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        (left_sum, right_sum), (left_batch, right_batch) = equation.params["dimension_numbers"]
        left, right = operands
        batch = [left.shape[axis] for axis in left_batch]
        rows = [n for k, n in enumerate(left.shape) if k not in (*left_batch, *left_sum)]
        columns = [n for k, n in enumerate(right.shape) if k not in (*right_batch, *right_sum)]
        terms = [left.shape[axis] for axis in left_sum]
        shape = (*batch, *rows, *columns, *terms)

        def spread(array: Any, first: Any, last: Any, between: list[int]) -> Any:
            rest = [axis for axis in range(array.ndim) if axis not in (*first, *last)]
            view = array.transpose(*first, *rest, *last)
            return np.broadcast_to(view.reshape(*batch, *between, *terms), shape)

        wide = [
            self._move(
                left, lambda x: spread(x, left_batch, left_sum, [*rows, *(1 for _ in columns)])
            ),
            self._move(
                right, lambda x: spread(x, right_batch, right_sum, [*(1 for _ in rows), *columns])
            ),
        ]
        (factors,) = self._arrays.map(lambda each: [self._each("mul", *each)], [shape], *wide)
        return [self._fold_wide("add", factors, range(len(shape) - len(terms), len(shape)))]

    def _move(self, value: Nodes, move: Callable[[Any], Any]) -> Nodes:
        """Return an array, large or not, with its entries moved."""
        if is_laned(value):
            return self._arrays.move(value, move)
        return np.asarray(move(value), dtype=object)

    def _sum(self, terms: Sequence[Node]) -> Node:
        total = self.graph.constant(0.0)
        for term in terms:
            total = self.graph.apply("add", total, term)
        return total

    def _power(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        power = equation.params["y"]
        result, square, rest = self._constants(1.0), operands[0], abs(power)
        while rest:
            if rest % 2:
                result = self._each("mul", result, square)
            rest //= 2
            square = self._each("mul", square, square) if rest else square
        return [self._each("div", self._constants(1.0), result) if power < 0 else result]

    def _sign(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        x = operands[0]
        zero, one = self._constants(0.0), self._constants(1.0)
        below = self._each("select", self._each("lt", x, zero), self._each("neg", one), x)
        return [self._each("select", self._each("gt", x, zero), one, below)]

    def _logistic(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        one = self._constants(1.0)
        shrunk = self._each("exp", self._each("neg", operands[0]))
        return [self._each("div", one, self._each("add", one, shrunk))]

    def _select(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        which, *cases = operands
        if len(cases) == 2 and all(node.kind == "truth" for node in which.flat):
            return [self._each("select", which, cases[1], cases[0])]
        return [self._by_index(which, cases)]

    def _by_index(self, which: Nodes, cases: Sequence[Nodes]) -> Nodes:
        result = cases[-1]
        for k in reversed(range(len(cases) - 1)):
            result = self._each(
                "select", self._each("eq", which, self._constants(k)), cases[k], result
            )
        return result

    def _either(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        if any(node.kind != "truth" for each in operands for node in each.flat):
            raise self._refusal(equation, "an exclusive or of bits")
        return [self._each("ne", *operands)]

    def _clamp(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        return [self._each("min", self._each("max", operands[1], operands[0]), operands[2])]

    def _convert(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        kind = np.dtype(equation.params["new_dtype"]).kind
        if kind == "b":
            zero = self._constants(0.0)
            return [_map(lambda x: self._truth(x, zero.item()), operands[0])]
        return [self._each("double" if kind == "f" else "int", operands[0])]

    def _truth(self, x: Node, zero: Node) -> Node:
        return x if x.kind == "truth" else self.graph.apply("ne", x, zero)

    def _bits(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return the bits of numbers, of which only the sign may be asked for."""
        if np.dtype(equation.params["new_dtype"]) != np.int64:
            raise self._refusal(equation, "a number by its bits")
        return [_map(lambda x: self.graph.make("bits", (x,), "int"), operands[0])]

    def _sign_bit(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        if any(x.op != "bits" for x in operands[0].flat) or any(
            by.detail != 63 for by in operands[1].flat
        ):
            raise self._refusal(equation, "a number by its bits")
        return [_map(lambda x: self.graph.apply("signbit", x.args[0]), operands[0])]

    def _iota(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        shape, axis = equation.params["shape"], equation.params["dimension"]
        along = [1] * len(shape)
        along[axis] = shape[axis]
        counts = np.arange(shape[axis]).reshape(along)
        kind = float if np.dtype(equation.params["dtype"]).kind == "f" else int
        return [self._constants(np.broadcast_to(counts, shape).astype(kind))]

    def _call(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        return self.evaluate(equation.params["jaxpr"], operands)

    def _branch(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        which, *args = operands
        cases = [self._case(branch, args) for branch in equation.params["branches"]]
        if which.item().kind == "truth":
            which = self._each("int", which)
        return [self._one_of(which, each) for each in zip(*cases, strict=True)]

    def _case(self, branch: Any, args: Sequence[Nodes]) -> list[Nodes]:
        """Return the results of a branch, whose sweeps are its own."""
        before, self._regions = self._arrays.region, self._regions + 1
        self._arrays.region = self._regions
        results = self.evaluate(branch, args)
        # What is still to be written is written where the branch is taken.
        results = [self._arrays.in_blocks(each) if is_laned(each) else each for each in results]
        for each in results:
            if is_laned(each):
                _ = each.content.written
        self._arrays.region = before
        return results

    def _one_of(self, which: Nodes, cases: Sequence[Nodes]) -> Nodes:
        """Return one of several results of branches; of large ones, where it lies."""
        if not any(is_laned(each) for each in cases):
            return self._by_index(which, cases)
        result = self._arrays.in_blocks(cases[-1])
        for k in reversed(range(len(cases) - 1)):
            condition = self._each("eq", which, self._constants(k)).item()
            case = self._arrays.in_blocks(cases[k])
            if condition.op == "constant":
                result = case if condition.detail else result
            else:
                result = self._chosen(condition, case, result)
        return result

    def _chosen(self, condition: Node, then: View, otherwise: View) -> View:
        first, second = then.content, otherwise.content
        sources = (first.memory, second.memory)
        memory = Memory(first.memory.kind, first.memory.size, first.memory.blocks, sources=sources)
        step = self.graph.make(
            "choose",
            (condition, *first.written, *second.written),
            "results",
            (memory, sources, len(first.written)),
        )
        return View(Content(memory, (step,)), then.positions)

    # Arrays that are moved about; positions that are known only at run time are chosen between.

    def _take(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return what an operation takes from its first argument at places given by the others."""
        operand, *places = operands
        indices = [None if is_laned(each) else _values(each) for each in places]
        if all(each is not None for each in indices):
            return [self._move(operand, lambda array: self._entries_at(equation, array, indices))]
        if equation.primitive.name != "gather":
            return [self._slice(equation, operand, places)]
        numbers = equation.params["dimension_numbers"]
        if len(numbers.start_index_map) != 1 or numbers.operand_batching_dims:
            raise self._refusal(equation, "an index of several axes that is not known before")
        cases = [
            self._entries_at(equation, operand, [np.full(places[0].shape, k)])
            for k in range(operand.shape[numbers.start_index_map[0]])
        ]
        ndim = cases[0].ndim
        batch = [axis for axis in range(ndim) if axis not in numbers.offset_dims]
        which = places[0][..., 0].reshape(
            [cases[0].shape[axis] if axis in batch else 1 for axis in range(ndim)]
        )
        return [self._by_index(np.broadcast_to(which, cases[0].shape), cases)]

    def _take_wide(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return what is taken from a large array, or at many places."""
        operand, *places = operands
        indices = [None if is_laned(each) else _values(each) for each in places]
        if all(each is not None for each in indices):
            return [self._move(operand, lambda array: self._entries_at(equation, array, indices))]
        shape, sizes = equation.outvars[0].aval.shape, equation.params["slice_sizes"]
        if equation.primitive.name == "dynamic_slice":
            axes = range(operand.ndim)
            picked = places
        else:
            numbers = equation.params["dimension_numbers"]
            axes, offsets = numbers.start_index_map, numbers.offset_dims
            along = [1 if axis in offsets else size for axis, size in enumerate(shape)]
            picked = [
                self._move(places[0], partial(_component, number=k, shape=along))
                for k in range(len(axes))
            ]
        limits = [operand.shape[axis] - sizes[axis] for axis in axes]

        def numbers_at(array: Any, at: list[int]) -> Any:
            if equation.primitive.name == "gather":
                wide = np.broadcast_to(np.array(at), places[0].shape)
                return self._entries_at(equation, array, [wide])
            return self._entries_at(equation, array, at)

        return [self._arrays.take(operand, numbers_at, picked, limits)]

    def _replace(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return an array of which parts have been replaced."""
        name = equation.primitive.name
        places = operands[2:] if name == "dynamic_update_slice" else operands[1:2]
        if name != "pad":
            indices = [None if is_laned(each) else _values(each) for each in places]
            if any(each is None for each in indices):
                return [self._replace_at(equation, operands)]
        if self._is_wide(equation, operands):
            return [self._replace_wide(equation, operands)]
        return self._replace_known(equation, operands)

    def _replace_wide(self, equation: Any, operands: list[Nodes]) -> Nodes:
        """Return a large array of which parts, at places that are known, have been replaced."""
        name = equation.primitive.name
        which = [0, 2] if name.startswith("scatter") else [0, 1]
        if name == "scatter-add":
            raise self._refusal(equation, "a sum at places of a large array that are known")

        def place(numbers: list[Any]) -> Any:
            arrays = [
                numbers[which.index(k)] if k in which else _values(each)
                for k, each in enumerate(operands)
            ]
            jax_arrays = [self._jax.numpy.asarray(each) for each in arrays]
            return equation.primitive.bind(*jax_arrays, **equation.params)

        return self._arrays.pick([operands[k] for k in which], place)

    def _replace_at(self, equation: Any, operands: list[Nodes]) -> Nodes:
        """Return an array of which parts, at places known only at run time, have been replaced."""
        result = operands[0]
        if equation.primitive.name == "dynamic_update_slice":
            return self._put_in(result, operands[1], operands[2:], clamps=True)
        numbers, places, updates = equation.params["dimension_numbers"], *operands[1:]
        axes, window = numbers.scatter_dims_to_operand_dims, numbers.update_window_dims
        batching = numbers.operand_batching_dims
        if len(batching) == places.ndim - 1 and batching:
            return self._replace_rows(equation, operands)
        if any(result.shape[axis] > 1 for axis in batching) or prod(places.shape[:-1]) > 64:
            raise self._refusal(equation, "a change at many indices that are not known before")
        batch = [axis for axis in range(updates.ndim) if axis not in window]
        lost = (*numbers.inserted_window_dims, *batching)
        clamps = "clip" in str(equation.params["mode"]).lower()
        for where in np.ndindex(*places.shape[:-1]):

            def cut(array: Any, where: Any = where) -> Any:
                order = dict(zip(batch, where, strict=True))
                part = array[tuple(order.get(axis, slice(None)) for axis in range(array.ndim))]
                return np.expand_dims(part, lost)

            starts = [self._constants(0)] * result.ndim
            for k, axis in enumerate(axes):
                starts[axis] = self._move(places, itemgetter((*where, k)))
            update = self._move(updates, cut)
            adds = equation.primitive.name == "scatter-add"
            result = self._put_in(result, update, starts, clamps=clamps, adds=adds)
        return result

    def _replace_rows(self, equation: Any, operands: list[Nodes]) -> Nodes:
        """Return an array in each of whose rows a part has been replaced, at a place of its own."""
        array, places, updates = operands
        numbers, shape = equation.params["dimension_numbers"], tuple(array.shape)
        batching, window = numbers.operand_batching_dims, numbers.update_window_dims
        rows = [axis for axis in range(updates.ndim) if axis not in window]
        along = [shape[axis] if axis in batching else 1 for axis in range(len(shape))]
        inner = [axis for axis in range(len(shape)) if axis not in batching]
        kept = [axis for axis in inner if axis not in numbers.inserted_window_dims]
        order = {
            axis: rows[k]
            for axis, k in zip(batching, numbers.scatter_indices_batching_dims, strict=True)
        }
        order |= dict(zip(kept, window, strict=True))
        sizes = [updates.shape[order[axis]] if axis in order else 1 for axis in range(len(shape))]
        axes = [order[axis] for axis in sorted(order)]
        update = self._move(updates, lambda x: x.transpose(axes).reshape(sizes))
        turn = [*numbers.scatter_indices_batching_dims]

        def column(x: Any, k: int) -> Any:
            return x[..., k].transpose(turn).reshape(along)

        starts: list[Nodes] = [self._constants(0)] * len(shape)
        for k, axis in enumerate(numbers.scatter_dims_to_operand_dims):
            starts[axis] = self._move(places, partial(column, k=k))
        clamps = "clip" in str(equation.params["mode"]).lower()
        adds = equation.primitive.name == "scatter-add"
        return self._put_in(array, update, starts, clamps=clamps, adds=adds)

    def _put_in(
        self,
        array: Nodes,
        update: Nodes,
        starts: Sequence[Nodes],
        *,
        clamps: bool,
        adds: bool = False,
    ) -> Nodes:
        """Return an array that has others' entries from a place on."""
        shape, sizes = tuple(array.shape), tuple(update.shape)
        partial_axes = [axis for axis in range(len(shape)) if sizes[axis] < shape[axis]]
        inside: Nodes = None
        ways = []
        for axis in partial_axes:
            start, last = starts[axis], shape[axis] - sizes[axis]
            if clamps:
                start = self._each(
                    "max", self._each("min", start, self._constants(last)), self._constants(0)
                )
            counts = np.arange(shape[axis]).reshape(
                [-1 if k == axis else 1 for k in range(len(shape))]
            )
            way = self._wide_each(
                "sub", shape, self._constants(np.broadcast_to(counts, shape)), start
            )
            ways.append(way)
            tests = [("eq", 0)] if sizes[axis] == 1 else [("ge", 0), ("lt", sizes[axis])]
            for op, bound in tests:
                test = self._wide_each(op, shape, way, self._constants(bound))
                inside = test if inside is None else self._wide_each("and", shape, inside, test)

        def numbers_at(numbers: Any, at: list[int]) -> Any:
            chosen = dict(zip(partial_axes, at, strict=True))
            cut = [
                slice(chosen[k], chosen[k] + 1) if k in chosen else slice(None)
                for k in range(len(shape))
            ]
            return np.broadcast_to(numbers[tuple(cut)], shape)

        if all(sizes[axis] == 1 for axis in partial_axes):
            values = self._move(update, lambda x: np.broadcast_to(x, shape))
        else:
            limits = [sizes[axis] - 1 for axis in partial_axes]
            values = self._arrays.take(update, numbers_at, ways, limits)
        if adds:
            values = self._wide_each("add", shape, array, values)
        return values if inside is None else self._wide_each("select", shape, inside, values, array)

    def _wide_each(self, op: str, shape: tuple[int, ...], *values: Nodes) -> Nodes:
        """Return an operation on each entry, in a sweep if the arrays are large."""
        spread = [self._arrays.spread(value, shape) for value in values]
        if is_large(shape) and not any(is_laned(each) for each in spread):
            spread = [value if value.ndim else np.broadcast_to(value, shape) for value in spread]
            (result,) = self._arrays.map(lambda rows: [self._each(op, *rows)], [shape], *spread)
            return result
        return self._each(op, *spread)

    def _replace_known(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        numbers: list[Any] = []
        pool: list[Node] = []
        if equation.primitive.name == "scatter":
            order = [operands[0], None, *operands[2:]]
        else:
            order = list(operands[:2]) + [None] * (len(operands) - 2)
        for k, each in enumerate(order):
            if each is None:
                if (indices := _values(operands[k])) is None:
                    raise self._refusal(equation, "an index that is not known before")
                numbers.append(self._jax.numpy.asarray(indices))
                continue
            first = len(pool)
            pool += list(each.ravel())
            counts = self._jax.numpy.arange(first, len(pool))
            numbers.append(counts.reshape(each.shape))
        where = np.asarray(equation.primitive.bind(*numbers, **equation.params))
        flat = np.empty(len(pool), dtype=object)
        flat[:] = pool
        return [flat[where]]

    def _accumulate(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return the sums of the entries along an axis up to each."""
        params = equation.params
        op = _CUMULATIVE[equation.primitive.name]
        return [self._running(op, operands[0], params["axis"], params["reverse"])]

    def _running(self, op: str, array: Nodes, axis: int, reverse: bool) -> Nodes:
        rows = np.moveaxis(array, axis, 0).copy()
        order = range(len(rows))[:: -1 if reverse else 1]
        for k, after in pairwise(order):
            rows[after, ...] = self._each(op, rows[k, ...], rows[after, ...])
        return np.moveaxis(rows, 0, axis)

    def _accumulate_wide(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        params, (value,), shape = equation.params, operands, tuple(operands[0].shape)
        op, axis, reverse = _CUMULATIVE[equation.primitive.name], params["axis"], params["reverse"]
        if shape[axis] <= SHORT:
            place = _short_axis(shape, axis)
            return self._arrays.map(
                lambda rows: [self._running(op, rows[0], place, reverse)], [shape], value
            )
        flip = partial(np.flip, axis=axis)
        if reverse:
            value = self._move(value, flip)
        start = _start(op, kind_of(value))
        results = self._arrays.folded(
            lambda held, nodes, _: [self.graph.apply(op, held[0], nodes[0])],
            [start],
            [value],
            [axis],
            True,
        )
        return [self._arrays.move(each, flip) for each in results] if reverse else results

    def _round(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        even = int(equation.params["rounding_method"]) == 1
        return [self._each("rint" if even else "round", operands[0])]

    def _slice(self, equation: Any, operand: Nodes, starts: list[Nodes]) -> Nodes:
        sizes = equation.params["slice_sizes"]
        for axis, (start, size) in enumerate(zip(starts, sizes, strict=True)):
            count = operand.shape[axis] - size + 1
            cases = [operand.take(range(k, k + size), axis) for k in range(count)]
            index = _values(start)
            if index is not None:
                operand = cases[int(np.clip(index, 0, count - 1))]
            else:
                operand = self._by_index(np.broadcast_to(start, cases[0].shape), cases)
        return operand

    def _entries_at(self, equation: Any, array: Any, places: Sequence[Any]) -> Any:
        """Return what an operation takes from an array, of numbers or of expressions."""
        sizes = equation.params["slice_sizes"]
        if equation.primitive.name == "gather":
            return _gather(array, places[0], equation.params["dimension_numbers"], sizes)
        starts = [
            int(np.clip(place, 0, length - size))
            for place, length, size in zip(places, array.shape, sizes, strict=True)
        ]
        return array[tuple(slice(k, k + size) for k, size in zip(starts, sizes, strict=True))]

    # Linear algebra.

    def _factors(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return factors of a square matrix, nothing for the swaps, and the order of the rows."""
        n = operands[0].shape[-1]
        matrices = operands[0].reshape(-1, n, n)
        kinds: list[Kind] = ["double"] * (n * n) + ["int"] * n  # type: ignore[assignment]
        results = [
            self.graph.results("factors", tuple(each.ravel()), kinds, n) for each in matrices
        ]
        lead = operands[0].shape[:-2]
        A = _stack([each[: n * n] for each in results]).reshape(*lead, n, n)
        rows = _stack([each[n * n :] for each in results]).reshape(*lead, n)
        return [A, rows, rows]

    def _substitute(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        params = equation.params
        if not params["left_side"] or params.get("conjugate_a"):
            raise self._refusal(equation, "a triangular system from the right")
        A, lower = operands[0], params["lower"]
        if params["transpose_a"]:
            A, lower = np.swapaxes(A, -1, -2), not lower
        lead, (n, m) = operands[1].shape[:-2], operands[1].shape[-2:]
        result = np.empty((prod(lead), n, m), dtype=object)
        pairs = zip(A.reshape(-1, n, n), operands[1].reshape(-1, n, m), strict=True)
        for each, (matrix, right) in enumerate(pairs):
            order = range(n) if lower else range(n - 1, -1, -1)
            for i, column in product(order, range(m)):
                before = range(i) if lower else range(i + 1, n)
                entry = right[i, column]
                for k in before:
                    term = self.graph.apply("mul", matrix[i, k], result[each, k, column])
                    entry = self.graph.apply("sub", entry, term)
                if not params["unit_diagonal"]:
                    entry = self.graph.apply("div", entry, matrix[i, i])
                result[each, i, column] = entry
        return [result.reshape(*lead, n, m)]

    def _solve(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        lengths, jaxprs = equation.params["const_lengths"], equation.params["jaxprs"]
        first = lengths.matvec + lengths.vecmat
        consts = operands[first : first + lengths.solve]
        return self.evaluate(jaxprs.solve, [*consts, *operands[sum(lengths) :]])

    def _eigen(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return eigenvectors and eigenvalues, ascending, of a symmetric matrix."""
        n, lead = operands[0].shape[-1], operands[0].shape[:-2]
        kinds: list[Kind] = ["double"] * (n + n * n)
        results = []
        for each in operands[0].reshape(-1, n, n):
            # Both triangles are the same; what is above the diagonal is read.
            upper = [each[min(i, k), max(i, k)] for i in range(n) for k in range(n)]
            results.append(self.graph.results("eigen", upper, kinds, n))
        w = _stack([each[:n] for each in results]).reshape(*lead, n)
        V = _stack([each[n:] for each in results]).reshape(*lead, n, n)
        return [V, w]

    def _sort(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return arrays in the order of the first, by exchanges of neighbours."""
        axis = equation.params["dimension"]
        if operands[0].shape[axis] > _EXCHANGES and equation.params["num_keys"] == 1:
            if operands[0].shape[axis] > _LONGEST_ORDER:
                raise self._refusal(equation, f"an order of {operands[0].shape[axis]}")
            order = self._order("lt", operands[0], axis)
            return [self._arranged(each, axis, order) for each in operands]
        wide = [is_laned(each) or is_large(each.shape) for each in operands]
        if not any(wide) or operands[0].shape[axis] > SHORT:
            return self._ordered(equation, [self._arrays.nodes(each) for each in operands], axis)
        shape = tuple(operands[0].shape)
        place = _short_axis(shape, axis)
        return self._arrays.map(
            lambda rows: self._ordered(equation, rows, place), [shape] * len(operands), *operands
        )

    def _order(self, better: str, array: Nodes, axis: int) -> Nodes:
        """Return the numbers of the entries along an axis, which comes last, in their order.

        Each has as many before it as are better, or are equal and have lower numbers.
        """
        key = self._move(array, lambda x: np.moveaxis(x, axis, -1))
        n = key.shape[-1]
        shape = (*key.shape, n)
        one = self._move(key, lambda x: np.broadcast_to(x[..., :, None], shape))
        other = self._move(key, lambda x: np.broadcast_to(x[..., None, :], shape))
        counts = np.arange(n)
        numbers, places = (
            self._constants(np.broadcast_to(each, shape)) for each in (counts, counts[:, None])
        )
        earlier = self._wide_each("lt", shape, numbers, places)
        same = self._wide_each("and", shape, self._wide_each("eq", shape, other, one), earlier)
        before = self._wide_each("or", shape, self._wide_each(better, shape, other, one), same)
        rank = self._total("add", self._wide_each("int", shape, before))
        rank = self._move(rank, lambda x: np.broadcast_to(x[..., None, :], shape))
        here = self._wide_each("int", shape, self._wide_each("eq", shape, rank, places))
        return self._total("add", self._wide_each("mul", shape, here, numbers))

    def _total(self, op: str, value: Nodes) -> Nodes:
        """Return an array folded along its last axis."""
        fold = self._fold_wide if is_laned(value) else self._fold
        return fold(op, value, [value.ndim - 1])

    def _arranged(self, array: Nodes, axis: int, order: Nodes) -> Nodes:
        """Return the entries along an axis whose numbers are given, in this order."""
        last = self._move(array, lambda x: np.moveaxis(x, axis, -1))
        shape = tuple(order.shape)

        def numbers_at(numbers: Any, at: list[int]) -> Any:
            return np.broadcast_to(numbers[..., at[0] : at[0] + 1], shape)

        found = self._arrays.take(last, numbers_at, [order], [last.shape[-1] - 1])
        return self._move(found, lambda x: np.moveaxis(x, -1, axis))

    def _best(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return the largest entries along the last axis, and their numbers."""
        (array,), count = operands, equation.params["k"]
        axis = array.ndim - 1
        order = self._move(self._order("gt", array, axis), lambda x: x[..., :count])
        return [self._arranged(array, axis, order), order]

    def _ordered(self, equation: Any, operands: list[Nodes], axis: int) -> list[Nodes]:
        if equation.params["num_keys"] != 1:
            raise self._refusal(equation, "an order of several keys")
        rows = [np.moveaxis(each, axis, -1).copy() for each in operands]
        n = rows[0].shape[-1]
        for k in (k for end in range(n - 1, 0, -1) for k in range(end)):
            swap = self._each("gt", rows[0][..., k], rows[0][..., k + 1])
            for each in rows:
                a, b = each[..., k].copy(), each[..., k + 1].copy()
                each[..., k] = self._each("select", swap, b, a)
                each[..., k + 1] = self._each("select", swap, a, b)
        return [np.moveaxis(each, -1, axis) for each in rows]

    # Loops.

    def _while(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        params = equation.params
        first, second = params["cond_nconsts"], params["body_nconsts"]
        of_condition, of_body = operands[:first], operands[first : first + second]
        lead = params["cond_jaxpr"].out_avals[0].shape

        def goes_on(carry: list[Nodes]) -> Nodes:
            (result,) = self.evaluate(params["cond_jaxpr"], [*of_condition, *carry])
            return result

        def condition(carry: list[Nodes]) -> Node:
            result = goes_on(carry)
            # Of many robots, any.
            if is_laned(result):
                result = self._fold_wide("or", result, range(result.ndim))
            elif result.ndim:
                result = self._fold("or", result, range(result.ndim))
            node: Node = result.item()
            return node

        def body(carry: list[Nodes]) -> list[Nodes]:
            after = self.evaluate(params["body_jaxpr"], [*of_body, *carry])
            which = goes_on(carry) if prod(lead) > 1 else None
            return (
                after
                if which is None
                else [self._kept(which, *each) for each in zip(after, carry, strict=True)]
            )

        return self._loop(operands[first + second :], condition, body, None)

    def _kept(self, which: Nodes, after: Nodes, before: Nodes) -> Nodes:
        """Return what robots carry of which only some make another round."""
        shape = tuple(before.shape)
        along = (*which.shape, *(1 for _ in shape[which.ndim :]))
        wide = self._move(which, lambda x: np.broadcast_to(x.reshape(along), shape))
        return self._wide_each("select", shape, wide, after, before)

    def _scan(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        params = equation.params
        # Versions of JAX name these numbers differently: rows have one axis more outside.
        inner = params["jaxpr"].jaxpr
        seen = _rows_of(equation.invars, inner.invars)
        count = len(equation.outvars) - _rows_of(equation.outvars, inner.outvars)
        consts = len(operands) - seen - count
        constants, carry = operands[:consts], operands[consts : consts + count]
        rows, length = operands[consts + count :], params["length"]
        if not rows and len(equation.outvars) == count:
            return self._loop(
                carry,
                lambda carry: self.graph.constant(True),
                lambda carry: self.evaluate(params["jaxpr"], [*constants, *carry]),
                length,
            )
        shapes = [var.aval.shape for var in equation.outvars[count:]]
        many = any(is_laned(each) for each in operands) or any(map(is_large, shapes))
        if length > (SHORT if many else _UNROLL_LIMIT):
            return self._long_scan(equation, constants, carry, rows)
        order = range(length)[:: -1 if params["reverse"] else 1]
        each: dict[int, list[Nodes]] = {}
        for k in order:
            now = [self._move(row, itemgetter(k)) for row in rows]
            results = self.evaluate(params["jaxpr"], [*constants, *carry, *now])
            carry, each[k] = results[:count], results[count:]
        ends = [self._stack([each[k][i] for k in range(length)]) for i in range(len(each[0]))]
        return [*carry, *ends]

    def _expanded(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return the results of an operation that JAX keeps whole until it compiles it."""
        primitive, tree = equation.params["_prim"], self._jax.tree
        like = [self._jax.ShapeDtypeStruct(v.aval.shape, v.aval.dtype) for v in equation.invars]

        def function(*args: Any) -> Any:
            return primitive.expand(*tree.unflatten(primitive.in_tree, args))

        return self.evaluate(self._jax.make_jaxpr(function)(*like), operands)

    def _stack(self, rows: Sequence[Nodes]) -> Nodes:
        if not any(is_laned(row) for row in rows):
            return np.stack(rows)
        shape = (len(rows), *rows[0].shape)
        wide = [self._move(row, lambda array: array[None]) for row in rows]
        return self._arrays.concatenate(wide, 0, shape)

    def _long_scan(
        self, equation: Any, constants: list[Nodes], carry: list[Nodes], rows: list[Nodes]
    ) -> list[Nodes]:
        """Return the results of a loop over rows of arrays, which writes its own rows to memory."""
        params, count = equation.params, len(carry)
        length, ends = params["length"], equation.outvars[count:]
        memories = [
            Memory(_KINDS[np.dtype(var.aval.dtype).kind], prod(var.aval.shape)) for var in ends
        ]

        def body(state: list[Nodes]) -> list[Nodes]:
            number, *carry = state
            at = number
            if params["reverse"]:
                at = self._each("sub", self._constants(length - 1), number)
            now = [self._row(row, at) for row in rows]
            results = self.evaluate(params["jaxpr"], [*constants, *carry, *now])
            for memory, row in zip(memories, results[count:], strict=True):
                size = memory.size // length
                place = self.graph.apply("mul", self.graph.constant(size), at.item())
                targets = planar(tuple(row.shape))
                self._writes[-1].append((self._arrays.write(row, memory, targets, place), memory))
            return [self._each("add", number, self._constants(1)), *results[:count]]

        start = [self._constants(0), *carry]
        results, step = self._rounds(start, lambda _: self.graph.constant(True), body, length)
        written = []
        for memory, var in zip(memories, ends, strict=True):
            row = planar(tuple(var.aval.shape[1:]))
            starts = np.arange(0, memory.size, max(row.size, 1)).reshape(
                -1, *(1 for _ in row.shape)
            )
            written.append(View(Content(memory, (step,)), starts + row))
        views = [view if lane_axes(view.shape) else self._arrays.nodes(view) for view in written]
        return [*results[1:], *views]

    def _row(self, array: Nodes, at: Nodes) -> Nodes:
        """Return the row of an array whose number is known only at run time."""
        return self._arrays.take(
            array, lambda numbers, where: numbers[where[0]], [at], [array.shape[0] - 1]
        )

    def _loop(
        self,
        start: Sequence[Nodes],
        condition: Callable[[list[Nodes]], Node],
        body: Callable[[list[Nodes]], list[Nodes]],
        most: int | None,
    ) -> list[Nodes]:
        """Return what is carried after the last round; what does not change is not carried."""
        return self._rounds(start, condition, body, most)[0]

    def _rounds(
        self,
        start: Sequence[Nodes],
        condition: Callable[[list[Nodes]], Node],
        body: Callable[[list[Nodes]], list[Nodes]],
        most: int | None,
    ) -> tuple[list[Nodes], Node]:
        """Return what is carried after the last round, and the loop."""
        carried = _Carried(self.graph, self._arrays, start)
        while True:
            scope = Scope(self._scopes[-1])
            self._scopes.append(scope)
            self._writes.append([])
            args = carried.begin(scope)
            after = body(args)
            if carried.end(after):
                break
            self._scopes.pop()
            self._writes.pop()
        go_on = condition(args)
        self._scopes.pop()
        loop = carried.loop(scope, go_on, most)
        loop.writes = self._writes.pop()
        loop.outside = list(outside(loop))
        return carried.results(loop)


class _Carried:
    """What a loop carries from round to round: expressions, and large arrays in memory.

    Args:
        graph: Where the expressions are.
        arrays: The large arrays.
        start: What is carried into the first round.
    """

    def __init__(self, graph: Graph, arrays: Arrays, start: Sequence[Nodes]) -> None:
        self._graph, self._arrays, self._start = graph, arrays, start
        # Arrays that lie in memory, and whether each entry of others, or each of these, changes.
        self._in_memory = [is_laned(each) or is_large(each.shape) for each in start]
        self._changes = [np.ones(1 if wide else each.shape, dtype=bool) for each, wide in
                         zip(start, self._in_memory, strict=True)]  # fmt: skip

    def begin(self, scope: Scope) -> list[Nodes]:
        """Return what a round begins with."""
        self._marker: Node | None = None
        self._args = [self._begin(k, scope) for k in range(len(self._start))]
        return self._args

    def _begin(self, k: int, scope: Scope) -> Nodes:
        start, changes = self._start[k], self._changes[k]
        if not self._in_memory[k]:
            result = np.empty(start.shape, dtype=object)
            for where in np.ndindex(*start.shape):
                node = start[where]
                result[where] = self._graph.carry(node.kind, scope) if changes[where] else node
            return result
        if not changes[0]:
            return start
        self._marker = self._marker or self._graph.carry("results", scope)
        memory = _memory_like(start)
        return View(Content(memory, (self._marker,)), planar(tuple(start.shape)))

    def end(self, after: list[Nodes]) -> bool:
        """Take what a round ends with; return whether it is of the kind that was supposed."""
        self._after = after
        fits = True
        for k, (arg, value) in enumerate(zip(self._args, after, strict=True)):
            if is_laned(value) and not self._in_memory[k]:
                self._in_memory[k], self._changes[k] = True, np.ones(1, dtype=bool)
                fits = False
            elif self._in_memory[k]:
                still = self._changes[k] & (not _is_same(arg, value))
                fits &= bool((still == self._changes[k]).all())
                self._changes[k] = still
            else:
                same = np.array([a is b for a, b in zip(arg.flat, value.flat, strict=True)], bool)
                still = self._changes[k] & ~same.reshape(arg.shape)
                fits &= bool((still == self._changes[k]).all())
                self._changes[k] = still
        return fits

    def _flat(self, arrays: Sequence[Nodes]) -> list[Node]:
        """Return the expressions that are carried."""
        return [
            node
            for k, array in enumerate(arrays)
            if not self._in_memory[k]
            for node, changes in zip(array.flat, self._changes[k].flat, strict=True)
            if changes
        ]

    def loop(self, scope: Scope, condition: Node, most: int | None) -> Loop:
        """Return the loop."""
        copies = []
        for k, value in enumerate(self._after):
            if self._in_memory[k] and self._changes[k][0]:
                target = self._args[k].content.memory
                start = self._arrays.own(self._start[k], target).content.written
                source = self._arrays.own(value).content
                copies.append(Copy(target, source.memory, source.written, start))
        carries, ends = self._flat(self._args), self._flat(self._after)
        if most is None:
            most = _most_rounds(condition, carries, ends, self._flat(self._start))
        return Loop(scope, carries, condition, ends, most, copies)

    def results(self, loop: Loop) -> tuple[list[Nodes], Node]:
        """Return what is carried after the last round, and the loop as an operation."""
        inits = self._flat(self._start)
        starts = [step for each in loop.copies for step in each.starts]
        args = (*inits, *starts, *loop.outside)
        kinds: list[Kind] = [each.kind for each in loop.carries]
        step = self._graph.make("loop", args, "results", loop)
        nodes = iter(
            [self._graph.make("result", (step,), kind, (k, kind)) for k, kind in enumerate(kinds)]
        )
        values: list[Nodes] = []
        for k, start in enumerate(self._start):
            if self._in_memory[k]:
                arg = self._args[k]
                changes = self._changes[k][0]
                values.append(
                    View(Content(arg.content.memory, (step,)), arg.positions) if changes else start
                )
                continue
            result = np.array(start, dtype=object)
            for where in np.ndindex(*start.shape):
                if self._changes[k][where]:
                    result[where] = next(nodes)
            values.append(result)
        return values, step


def _memory_like(value: Nodes) -> Memory:
    """Return a memory for an array in blocks of lanes."""
    lanes = [size for size in value.shape if size > SHORT]
    return Memory(kind_of(value), prod(lanes), prod(value.shape) // prod(lanes))


def _is_same(one: Nodes, other: Nodes) -> bool:
    """Return whether two arrays are the same."""
    if one is other:
        return True
    if not isinstance(one, View) or not isinstance(other, View):
        return False
    return one.content is other.content and np.array_equal(one.positions, other.positions)


def _component(array: Any, number: int, shape: Sequence[int]) -> Any:
    """Return a component of vectors, in another shape."""
    return array[..., number].reshape(shape)


def _gather(array: Any, indices: Any, numbers: Any, sizes: Sequence[int]) -> Any:
    """Return slices of an array from given indices on, which are clamped.

    Args:
        array: The array.
        indices: The indices, shape (..., k).
        numbers: Which axes they are of, and which axes the result has.
        sizes: The sizes of the slices.
    """
    lead, hidden = (
        indices.shape[:-1],
        (*numbers.collapsed_slice_dims, *numbers.operand_batching_dims),
    )
    windows = [axis for axis in range(array.ndim) if axis not in hidden]
    ndim = len(lead) + len(windows)
    batch = [axis for axis in range(ndim) if axis not in numbers.offset_dims]

    def along(values: Any, axes: Sequence[int]) -> Any:
        wide = [1] * ndim
        for axis, size in zip(axes, values.shape, strict=True):
            wide[axis] = size
        return values.reshape(wide)

    places = []
    for axis in range(array.ndim):
        place = np.zeros([1] * ndim, dtype=int)
        if axis in numbers.start_index_map:
            start = indices[..., numbers.start_index_map.index(axis)]
            place = along(np.clip(start, 0, array.shape[axis] - sizes[axis]), batch)
        elif axis in numbers.operand_batching_dims:
            which = numbers.operand_batching_dims.index(axis)
            at = numbers.start_indices_batching_dims[which]
            place = along(np.arange(lead[at]), [batch[at]])
        if axis in windows:
            offset = numbers.offset_dims[windows.index(axis)]
            place = place + along(np.arange(sizes[axis]), [offset])
        places.append(place)
    shape = dict(zip(batch, lead, strict=True))
    shape |= dict(zip(numbers.offset_dims, (sizes[axis] for axis in windows), strict=True))
    return np.broadcast_to(array[tuple(places)], [shape[axis] for axis in range(ndim)])


def _short_axis(shape: Sequence[int], axis: int) -> int:
    """Return the number of an axis among those that are unrolled."""
    return sum(size <= SHORT for size in shape[:axis])


def _has_long_matrix(operands: Sequence[Nodes]) -> bool:
    return any(size > SHORT for each in operands for size in each.shape[-2:])


def _chunk(shape: Sequence[int], axes: Sequence[int]) -> int | None:
    """Return how many entries of an axis are folded first, if that is quicker."""
    lanes = lane_axes(tuple(shape))
    if list(axes) != lanes[-1:] or prod(shape) // prod(shape[k] for k in lanes) > 3:
        return None
    counts = [count for count in range(4, SHORT + 1) if shape[axes[0]] // count > SHORT]
    even = [count for count in counts if shape[axes[0]] % count == 0]
    return max(even or counts, default=None)


def _start(op: str, kind: Kind) -> Any:
    """Return what a sum, a product, or the like, begins with."""
    if op in ("and", "or"):
        return op == "and"
    if op in ("max", "min"):
        bound = 2147483647 if kind == "int" else inf
        return -bound if op == "max" else bound
    number = 0 if op == "add" else 1
    return number if kind == "int" else float(number)


def _line(equation: Any) -> str:
    """Return the line of a user's that an equation comes from; empty if JAX does not tell."""
    try:
        util = import_module("jax._src.source_info_util")
        frame = util.user_frame(equation.source_info.traceback)
    except Exception:  # These are parts of JAX that are not public.
        return ""
    return "" if frame is None else f"{PurePath(frame.file_name).name} line {frame.start_line}"


def _map(function: Callable[..., Node], *arrays: Any) -> Nodes:
    """Return an array of what a function makes of the entries of arrays."""
    shapes = [np.shape(each) for each in arrays]
    shape = shapes[0]
    if any(each != shape for each in shapes):
        shape = np.broadcast_shapes(*shapes)
        arrays = tuple(np.broadcast_to(each, shape) for each in arrays)
    result = np.empty(shape, dtype=object)
    wide = [np.ravel(each) for each in arrays]
    flat = result.ravel()
    for k, nodes in enumerate(zip(*wide, strict=True)):
        flat[k] = function(*nodes)
    return flat.reshape(shape)


def _stack(rows: Sequence[Sequence[Node]]) -> Nodes:
    result = np.empty((len(rows), len(rows[0])), dtype=object)
    for k, row in enumerate(rows):
        result[k] = row
    return result


def _values(nodes: Nodes) -> Any:
    """Return the numbers of constants; None if one is no constant."""
    if any(node.op != "constant" for node in nodes.flat):
        return None
    values = [node.detail for node in nodes.flat]
    return np.array(values, dtype=int).reshape(nodes.shape)


def _arrange(
    array: Nodes, batch: Sequence[int], sum_axes: Sequence[int]
) -> tuple[Nodes, tuple[int, ...], tuple[int, ...]]:
    """Return an array of shape (batch, rows, summed), and the shapes of the first two."""
    rest = [axis for axis in range(array.ndim) if axis not in (*batch, *sum_axes)]
    lead = tuple(array.shape[axis] for axis in batch)
    rows = tuple(array.shape[axis] for axis in rest)
    view = array.transpose(*batch, *rest, *sum_axes)
    return view.reshape(prod(lead), prod(rows), -1), lead, rows


def _rows_of(outside: Sequence[Any], inside: Sequence[Any]) -> int:
    """Return how many variables of a scan, its last ones, are rows of arrays inside."""
    pairs = zip(outside, inside, strict=True)
    return sum(len(out.aval.shape) > len(one.aval.shape) for out, one in pairs)


def _most_rounds(
    condition: Node, carries: Sequence[Node], ends: Sequence[Node], start: Sequence[Node]
) -> int | None:
    """Return the largest number of rounds of a loop that counts them up to a constant."""
    if condition.op == "and":
        counts = [_most_rounds(each, carries, ends, start) for each in condition.args]
        return min((each for each in counts if each is not None), default=None)
    if condition.op != "lt" or condition.args[1].op != "constant":
        return None
    counter, limit = condition.args
    for carry, end, begin in zip(carries, ends, start, strict=True):
        if carry is counter and begin.op == "constant" and end.op == "add":
            one = [arg for arg in end.args if arg is not counter]
            if len(one) == 1 and one[0].op == "constant" and one[0].detail == 1:
                return max(0, int(limit.detail) - int(begin.detail))
    return None


_ELEMENTWISE = {
    **{"add": "add", "sub": "sub", "mul": "mul", "div": "div", "neg": "neg", "max": "max"},
    **{"min": "min", "abs": "abs", "sqrt": "sqrt", "sin": "sin", "cos": "cos", "floor": "floor"},
    **{"ceil": "ceil", "lt": "lt", "le": "le", "gt": "gt", "ge": "ge", "eq": "eq", "ne": "ne"},
    **{"and": "and", "or": "or", "not": "not", "is_finite": "is_finite", "exp": "exp"},
    **{"log": "log", "tanh": "tanh", "cbrt": "cbrt", "nextafter": "nextafter", "pow": "pow"},
    **{"atan2": "atan2", "acos": "acos", "asin": "asin", "atan": "atan", "tan": "tan"},
    **{
        "rem": "rem",
        "exp2": "exp2",
        "log1p": "log1p",
        "expm1": "expm1",
        "sinh": "sinh",
        "cosh": "cosh",
        "add_any": "add",
        "lt_to": "lt",
        "le_to": "le",
    },
}


def _broadcast(params: Mapping[str, Any], x: Nodes, *_: Any) -> Nodes:
    shape = [1] * len(params["shape"])
    for axis, size in zip(params["broadcast_dimensions"], x.shape, strict=True):
        shape[axis] = size
    return np.broadcast_to(x.reshape(shape), params["shape"])


def _parts(params: Mapping[str, Any], x: Nodes) -> list[Nodes]:
    return list(np.split(x, np.cumsum(params["sizes"])[:-1], axis=params["axis"]))


def _rows(params: Mapping[str, Any], x: Nodes) -> list[Nodes]:
    return list(np.moveaxis(x, params["axis"], 0))


def _piece(params: Mapping[str, Any], x: Nodes) -> Nodes:
    steps = params["strides"] or (1,) * x.ndim
    ranges = zip(params["start_indices"], params["limit_indices"], steps, strict=True)
    return x[tuple(slice(*each) for each in ranges)]


_MOVES: dict[str, Callable[..., Any]] = {
    "broadcast_in_dim": _broadcast,
    "reshape": lambda params, x: x.reshape(params["new_sizes"]),
    "squeeze": lambda params, x: x.squeeze(tuple(params["dimensions"])),
    "expand_dims": lambda params, x: np.expand_dims(x, tuple(params["dimensions"])),
    "transpose": lambda params, x: x.transpose(params["permutation"]),
    "concatenate": lambda params, *x: np.concatenate(x, axis=params["dimension"]),
    "stack": lambda params, *x: np.stack(x, axis=params.get("axis", 0)),
    "split": _parts,
    "unstack": _rows,
    "slice": _piece,
    "rev": lambda params, x: np.flip(x, params["dimensions"]),
    "copy": lambda params, x: x,
    "copy_p": lambda params, x: x,
    "stop_gradient": lambda params, x: x,
    "optimization_barrier": lambda params, *x: list(x),
}

_CALLS = frozenset(
    ("jit", "pjit", "closed_call", "core_call", "custom_jvp_call", "custom_vjp_call", "remat")
)

_RULES: dict[str, Callable[[Tracer, Any, list[Nodes]], Sequence[Nodes]]] = {
    "reduce_sum": lambda tracer, *each: tracer._reduce("add", *each),
    "reduce_max": lambda tracer, *each: tracer._reduce("max", *each),
    "reduce_min": lambda tracer, *each: tracer._reduce("min", *each),
    "reduce_and": lambda tracer, *each: tracer._reduce("and", *each),
    "reduce_or": lambda tracer, *each: tracer._reduce("or", *each),
    "reduce_prod": lambda tracer, *each: tracer._reduce("mul", *each),
    "argmax": Tracer._largest_at,
    "argmin": Tracer._largest_at,
    "dot_general": Tracer._product,
    "integer_pow": Tracer._power,
    "square": lambda tracer, _, operands: [tracer._each("mul", operands[0], operands[0])],
    "sign": Tracer._sign,
    "rsqrt": lambda tracer, _, operands: [
        tracer._each("div", tracer._constants(1.0), tracer._each("sqrt", operands[0]))
    ],
    "logistic": Tracer._logistic,
    "select_n": Tracer._select,
    "clamp": Tracer._clamp,
    "convert_element_type": Tracer._convert,
    "bitcast_convert_type": Tracer._bits,
    "shift_right_arithmetic": Tracer._sign_bit,
    "iota": Tracer._iota,
    "gather": Tracer._take,
    "dynamic_slice": Tracer._take,
    "scatter": Tracer._replace,
    "scatter-add": Tracer._replace,
    "dynamic_update_slice": Tracer._replace,
    "pad": Tracer._replace,
    "cumsum": Tracer._accumulate,
    "cumprod": Tracer._accumulate,
    "cummax": Tracer._accumulate,
    "cummin": Tracer._accumulate,
    "round": Tracer._round,
    "xor": Tracer._either,
    "lu": Tracer._factors,
    "triangular_solve": Tracer._substitute,
    "custom_linear_solve": Tracer._solve,
    "eigh": Tracer._eigen,
    "sort": Tracer._sort,
    "top_k": Tracer._best,
    "while": Tracer._while,
    "scan": Tracer._scan,
    "cond": Tracer._branch,
    "call_hi_primitive": Tracer._expanded,
}


_JOINS = frozenset(("concatenate", "stack", "pad"))
_CUMULATIVE = {"cumsum": "add", "cumprod": "mul", "cummax": "max", "cummin": "min"}
_KINDS: dict[str, Kind] = {"b": "truth", "i": "int", "u": "int", "f": "double"}

# Rules that take large arrays as they are.
_WHOLE = frozenset(
    (
        *("while", "scan", "cond", "custom_linear_solve", "sort", "top_k", "iota"),
        "call_hi_primitive",
    )
)

# Rules that leave lanes as they are.
_BY_ENTRY = frozenset(
    (
        *("integer_pow", "square", "sign", "rsqrt", "logistic", "select_n", "clamp"),
        *("convert_element_type", "bitcast_convert_type", "shift_right_arithmetic", "round"),
        "xor",
        *("lu", "triangular_solve", "eigh"),
    )
)
_CALLED = frozenset(
    (
        *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "exp2", "log", "log1p"),
        *("expm1", "sinh", "cosh", "tanh", "cbrt", "pow", "nextafter", "rem", "logistic"),
    )
)
_OF_MATRICES = frozenset(("lu", "triangular_solve", "eigh"))


def _concatenate(tracer: Tracer, equation: Any, operands: list[Nodes]) -> list[Nodes]:
    shape = tuple(equation.outvars[0].aval.shape)
    return [tracer._arrays.concatenate(operands, equation.params["dimension"], shape)]


def _stacked(tracer: Tracer, equation: Any, operands: list[Nodes]) -> list[Nodes]:
    axis = equation.params.get("axis", 0)
    rows = [tracer._move(each, lambda array: np.expand_dims(array, axis)) for each in operands]
    return [tracer._arrays.concatenate(rows, axis, tuple(equation.outvars[0].aval.shape))]


def _split(tracer: Tracer, equation: Any, operands: list[Nodes]) -> list[Nodes]:
    ends = np.cumsum([0, *equation.params["sizes"]])
    axis = equation.params["axis"]
    return [
        tracer._move(operands[0], partial(np.take, indices=range(*pair), axis=axis))
        for pair in pairwise(ends)
    ]


def _unstacked(tracer: Tracer, equation: Any, operands: list[Nodes]) -> list[Nodes]:
    axis = equation.params["axis"]
    return [
        tracer._move(operands[0], partial(np.take, indices=k, axis=axis))
        for k in range(operands[0].shape[axis])
    ]


# Rules for large arrays.
_WIDE: dict[str, Callable[[Tracer, Any, list[Nodes]], Sequence[Nodes]]] = {
    "reduce_sum": lambda tracer, *each: tracer._reduce_wide("add", *each),
    "reduce_max": lambda tracer, *each: tracer._reduce_wide("max", *each),
    "reduce_min": lambda tracer, *each: tracer._reduce_wide("min", *each),
    "reduce_and": lambda tracer, *each: tracer._reduce_wide("and", *each),
    "reduce_or": lambda tracer, *each: tracer._reduce_wide("or", *each),
    "reduce_prod": lambda tracer, *each: tracer._reduce_wide("mul", *each),
    "argmax": Tracer._largest_at_wide,
    "argmin": Tracer._largest_at_wide,
    "dot_general": Tracer._product_wide,
    "gather": Tracer._take_wide,
    "dynamic_slice": Tracer._take_wide,
    "scatter": Tracer._replace,
    "scatter-add": Tracer._replace,
    "dynamic_update_slice": Tracer._replace,
    "pad": Tracer._replace,
    "cumsum": Tracer._accumulate_wide,
    "cumprod": Tracer._accumulate_wide,
    "cummax": Tracer._accumulate_wide,
    "cummin": Tracer._accumulate_wide,
    "concatenate": _concatenate,
    "stack": _stacked,
    "split": _split,
    "unstack": _unstacked,
    "copy": lambda tracer, equation, operands: operands,
    "copy_p": lambda tracer, equation, operands: operands,
    "stop_gradient": lambda tracer, equation, operands: operands,
    "optimization_barrier": lambda tracer, equation, operands: operands,
}
