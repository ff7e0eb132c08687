"""Functions of arrays that JAX traces, as functions in C."""

import ctypes

import numpy as np

from drake_rnn import require_jax
from drake_rnn.compiled.c_text import body_of
from drake_rnn.compiled.graph import Graph
from drake_rnn.compiled.library import built
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
        nodes[:] = [graph.leaf(f"g{count + k}") for k in range(zero.size)]
        args.append(nodes.reshape(zero.shape))
        count += zero.size
    (found,) = Tracer(graph, "function").evaluated(jaxpr, args)
    roots = list(found.ravel())
    texts = {f"g{k}": f"given[{k}]" for k in range(count)}
    body = body_of(texts, [(f"found[{k}]", graph.apply("double", r)) for k, r in enumerate(roots)])
    source = SOURCE.format(helpers=body.helpers, body="\n".join(body.lines))
    step = ctypes.CDLL(str(built(source))).f
    step.argtypes = (ctypes.c_void_p,) * 2

    def call(*arrays):
        given = np.concatenate([np.ravel(each).astype(float) for each in arrays] + [np.zeros(1)])
        out = np.zeros(len(roots))
        step(given.ctypes.data, out.ctypes.data)
        return out.reshape(found.shape)

    return call, source
