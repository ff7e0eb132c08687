"""Time-varying quadratic programs that redundancy resolution schemes solve: cost, rows, bounds."""
