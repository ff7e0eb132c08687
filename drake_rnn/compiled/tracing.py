"""Programs traced by JAX as expression graphs: each primitive in scalars, loops as loops."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import import_module
from itertools import pairwise, product
from math import prod
from pathlib import PurePath
from typing import Any

import numpy as np

from ..arrays.substeps import require_jax
from ..errors import InvalidInputError
from .graph import Graph, Kind, Loop, Node, Scope

#: An array of expressions.
Nodes = Any

# Longer ones, over arrays, are not unrolled.
_UNROLL_LIMIT = 64


class Tracer:
    """Evaluates what JAX has traced with expressions for numbers.

    Args:
        graph: Where the expressions are.
        what: What is traced, for messages.
    """

    def __init__(self, graph: Graph, what: str) -> None:
        self.graph, self._what = graph, what
        self._jax = require_jax()
        # What is being evaluated, one within another.
        self._within: list[Any] = []

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
                value = np.asarray(value, dtype=object)
                values[var] = np.broadcast_to(value, var.aval.shape)
        return [read(var) for var in jaxpr.outvars]

    def _apply(self, equation: Any, operands: list[Nodes]) -> Sequence[Nodes]:
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
        return _map(lambda *nodes: self.graph.apply(op, *nodes), *operands)

    def _reduce(self, op: str, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return an array folded along axes, one entry after the other."""
        axes = equation.params["axes"]
        rest = [axis for axis in range(operands[0].ndim) if axis not in axes]
        shape = tuple(operands[0].shape[axis] for axis in rest)
        rows = operands[0].transpose(*rest, *axes).reshape(*shape, -1)
        total = rows[..., 0]
        for k in range(1, rows.shape[-1]):
            total = self._each(op, total, rows[..., k])
        return [total]

    def _largest_at(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return where the first of the largest, or of the least, entries is."""
        (axis,) = equation.params["axes"]
        better = "gt" if equation.primitive.name == "argmax" else "lt"
        rows = np.moveaxis(operands[0], axis, -1)
        best, at = rows[..., 0], self._constants(np.zeros(rows.shape[:-1], int))
        for k in range(1, rows.shape[-1]):
            higher = self._each(better, rows[..., k], best)
            best = self._each("select", higher, rows[..., k], best)
            at = self._each("select", higher, self._constants(k), at)
        return [at]

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
        return [result.reshape(*batch, *rows, *columns)]

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
        cases = [self.evaluate(branch, args) for branch in equation.params["branches"]]
        if which.item().kind == "truth":
            which = self._each("int", which)
        return [self._by_index(which, each) for each in zip(*cases, strict=True)]

    # Arrays that are moved about; positions that are known only at run time are chosen between.

    def _take(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return what an operation takes from its first argument at places given by the others."""
        operand, *places = operands
        indices = [_values(each) for each in places]
        if all(each is not None for each in indices):
            return [operand.ravel()[self._positions(equation, operand.shape, indices)]]
        if equation.primitive.name != "gather":
            return [self._slice(equation, operand, places)]
        numbers = equation.params["dimension_numbers"]
        if len(numbers.start_index_map) != 1 or numbers.operand_batching_dims:
            raise self._refusal(equation, "an index of several axes that is not known before")
        cases = [
            operand.ravel()[self._positions(equation, operand.shape, [np.full(places[0].shape, k)])]
            for k in range(operand.shape[numbers.start_index_map[0]])
        ]
        ndim = cases[0].ndim
        batch = [axis for axis in range(ndim) if axis not in numbers.offset_dims]
        which = places[0][..., 0].reshape(
            [cases[0].shape[axis] if axis in batch else 1 for axis in range(ndim)]
        )
        return [self._by_index(np.broadcast_to(which, cases[0].shape), cases)]

    def _replace(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        """Return an array of which parts, at places that are known, have been replaced."""
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
        axis = equation.params["axis"]
        op = {"cumsum": "add", "cumprod": "mul", "cummax": "max", "cummin": "min"}
        rows = np.moveaxis(operands[0], axis, 0).copy()
        order = range(len(rows))[:: -1 if equation.params["reverse"] else 1]
        for k, after in pairwise(order):
            total = self._each(op[equation.primitive.name], rows[k, ...], rows[after, ...])
            rows[after, ...] = total
        return [np.moveaxis(rows, 0, axis)]

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

    def _positions(self, equation: Any, shape: tuple[int, ...], places: list[Any]) -> Any:
        """Return where, in the flattened argument, an operation takes each entry from."""
        numbers = self._jax.numpy.arange(prod(shape)).reshape(shape)
        params = (
            {**equation.params, "fill_value": None}
            if "mode" in equation.params
            else (equation.params)
        )
        places = [self._jax.numpy.asarray(each) for each in places]
        return np.asarray(equation.primitive.bind(numbers, *places, **params))

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
        if equation.params["num_keys"] != 1:
            raise self._refusal(equation, "an order of several keys")
        axis = equation.params["dimension"]
        rows = [np.moveaxis(each, axis, -1).copy() for each in operands]
        n = rows[0].shape[-1]
        if n > _UNROLL_LIMIT:
            raise self._refusal(equation, f"an order of {n}")
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

        def condition(carry: list[Nodes]) -> Node:
            (result,) = self.evaluate(params["cond_jaxpr"], [*of_condition, *carry])
            node: Node = result.item()
            return node

        def body(carry: list[Nodes]) -> list[Nodes]:
            return self.evaluate(params["body_jaxpr"], [*of_body, *carry])

        return self._loop(operands[first + second :], condition, body, None)

    def _scan(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        params = equation.params
        consts, count = params["num_consts"], params["num_carry"]
        constants, carry = operands[:consts], operands[consts : consts + count]
        rows, length = operands[consts + count :], params["length"]
        if not rows and len(equation.outvars) == count:
            return self._loop(
                carry,
                lambda carry: self.graph.constant(True),
                lambda carry: self.evaluate(params["jaxpr"], [*constants, *carry]),
                length,
            )
        if length > _UNROLL_LIMIT:
            raise self._refusal(equation, f"a loop of {length} rounds over arrays")
        order = range(length)[:: -1 if params["reverse"] else 1]
        each: dict[int, list[Nodes]] = {}
        for k in order:
            results = self.evaluate(
                params["jaxpr"], [*constants, *carry, *(row[k] for row in rows)]
            )
            carry, each[k] = results[:count], results[count:]
        ends = [np.stack([each[k][i] for k in range(length)]) for i in range(len(each[0]))]
        return [*carry, *ends]

    def _loop(
        self,
        start: Sequence[Nodes],
        condition: Callable[[list[Nodes]], Node],
        body: Callable[[list[Nodes]], list[Nodes]],
        most: int | None,
    ) -> list[Nodes]:
        """Return what is carried after the last round; what does not change is not carried."""
        flat = [node for each in start for node in each.ravel()]
        changes = [True] * len(flat)
        while True:
            scope = Scope(max((node.scope for node in flat), key=lambda each: each.depth))
            carries = [
                self.graph.carry(node.kind, scope) if changes[k] else node
                for k, node in enumerate(flat)
            ]
            after = body(_reshape(carries, start))
            ends = [node for each in after for node in each.ravel()]
            still = [
                change and end is not carry
                for change, end, carry in zip(changes, ends, carries, strict=True)
            ]
            if still == changes:
                break
            changes = still
        which = [k for k, change in enumerate(changes) if change]
        go_on = condition(_reshape(carries, start))
        loop = Loop(
            scope,
            [carries[k] for k in which],
            go_on,
            [ends[k] for k in which],
            _most_rounds(go_on, carries, ends, flat) if most is None else most,
        )
        loop.outside = list(_outside(loop))
        kinds: list[Kind] = [carries[k].kind for k in which]
        inits = [flat[k] for k in which]
        results = self.graph.results("loop", [*inits, *loop.outside], kinds, loop)
        values = list(flat)
        for k, result in zip(which, results, strict=True):
            values[k] = result
        return _reshape(values, start)


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
    shape = np.broadcast_shapes(*(np.shape(each) for each in arrays))
    result = np.empty(shape, dtype=object)
    wide = [np.broadcast_to(each, shape).ravel() for each in arrays]
    flat = result.ravel()
    for k, nodes in enumerate(zip(*wide, strict=True)):
        flat[k] = function(*nodes)
    return flat.reshape(shape)


def _stack(rows: Sequence[Sequence[Node]]) -> Nodes:
    result = np.empty((len(rows), len(rows[0])), dtype=object)
    for k, row in enumerate(rows):
        result[k] = row
    return result


def _reshape(nodes: Sequence[Node], like: Sequence[Nodes]) -> list[Nodes]:
    """Return expressions in arrays of the shapes of others."""
    arrays, at = [], 0
    for each in like:
        array = np.empty(each.size, dtype=object)
        array[:] = nodes[at : at + each.size]
        arrays.append(array.reshape(each.shape))
        at += each.size
    return arrays


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


def _outside(loop: Loop) -> Iterator[Node]:
    """Yield the expressions of outer scopes that a round uses, once each."""
    nodes: set[Node] = set()
    stack = [loop.condition, *loop.after]
    while stack:
        node = stack.pop()
        if node in nodes or node.op == "constant":
            continue
        nodes.add(node)
        if node.scope is not loop.scope:
            yield node
        else:
            stack += node.args


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
    },
}


def _broadcast(params: Mapping[str, Any], x: Nodes, *_: Any) -> Nodes:
    shape = [1] * len(params["shape"])
    for axis, size in zip(params["broadcast_dimensions"], x.shape, strict=True):
        shape[axis] = size
    return np.broadcast_to(x.reshape(shape), params["shape"])


def _parts(params: Mapping[str, Any], x: Nodes) -> list[Nodes]:
    return list(np.split(x, np.cumsum(params["sizes"])[:-1], axis=params["axis"]))


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
    "dynamic_update_slice": Tracer._replace,
    "pad": Tracer._replace,
    "cumsum": Tracer._accumulate,
    "cumprod": Tracer._accumulate,
    "cummax": Tracer._accumulate,
    "cummin": Tracer._accumulate,
    "round": Tracer._round,
    "lu": Tracer._factors,
    "triangular_solve": Tracer._substitute,
    "custom_linear_solve": Tracer._solve,
    "eigh": Tracer._eigen,
    "sort": Tracer._sort,
    "while": Tracer._while,
    "scan": Tracer._scan,
    "cond": Tracer._branch,
}
