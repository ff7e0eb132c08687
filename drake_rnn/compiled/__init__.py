"""Laws compiled to C: a trace of their array code as an expression graph, printed as C99."""
