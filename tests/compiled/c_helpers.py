"""Functions of arrays that JAX traces, as functions in C."""

import ctypes

import numpy as np

from drake_rnn import require_jax
from drake_rnn.compiled.c_text import body_of
from drake_rnn.compiled.graph import Graph
from drake_rnn.compiled.library import build_library
from drake_rnn.compiled.tracing import Tracer

SOURCE = """\
#include <math.h>
{helpers}
int f(const double *given, double *found);
int f(const double *given, double *found)
{{
(void)given;
{body}
return 0;
}}
"""


def in_c(function, *shapes):
    """Return a function of arrays of these shapes, and its text, as C computes it."""
    jax, graph = require_jax(), Graph()
    zeros = [jax.numpy.zeros(shape) for shape in shapes]
    jaxpr = jax.make_jaxpr(function)(*zeros)
    count, args = 0, []
    for zero in zeros:
        nodes = np.empty(zero.size, dtype=object)
        nodes[:] = graph.array([f"g{count + k}" for k in range(zero.size)])
        args.append(nodes.reshape(zero.shape))
        count += zero.size
    tracer = Tracer(graph, "function")
    (result,) = map(tracer.entries, tracer.evaluate(jaxpr, args))
    roots = list(result.ravel())
    texts = {f"g{k}": f"given[{k}]" for k in range(count)}
    body = body_of(texts, [(f"found[{k}]", graph.apply("double", r)) for k, r in enumerate(roots)])
    source = SOURCE.format(helpers=body.helpers, body="\n".join(body.lines))
    step = ctypes.CDLL(str(build_library(source, has_loops=body.memory > 0))).f
    step.argtypes = (ctypes.c_void_p,) * 2

    def call(*arrays):
        values = np.concatenate([np.ravel(each).astype(float) for each in arrays] + [np.zeros(1)])
        out = np.zeros(len(roots))
        step(values.ctypes.data, out.ctypes.data)
        return out.reshape(result.shape)

    return call, source
