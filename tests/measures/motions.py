"""Motions to take metrics of: at rest and on their path, but for what a test changes."""

from dataclasses import fields, replace

import numpy as np

from drake_rnn import JointLimits
from drake_rnn.measures import Motion, Pressing, RunMetrics, Yardsticks, of_one_run

TOLERANCE = 1e-3
FREE = JointLimits.unlimited(2)
J = np.array([[1.0, 0.0], [0.0, 2.0]])


def motion(time, **fields):
    """A motion at rest, on its path, but for ``fields``."""
    time = np.asarray(time, dtype=float)
    k = time.size
    still = {
        name: np.zeros((k, 2))
        for name in ("position", "velocity", "p_WE", "v_WE", "p_WE_desired", "v_WE_desired")
    }
    fields = {"J": np.broadcast_to(J, (k, 2, 2)), "J_hat": None, **fields}
    fields = {"network_velocity": fields.get("velocity", still["velocity"]), **fields}
    return Motion(time=time, **{**still, **fields})


def metrics(motion, limits=FREE, window=None, observed=None):
    return metrics_of_parts([motion], limits, window, [observed or {}])


def metrics_of_parts(parts, limits=FREE, window=None, observed=None):
    taken = RunMetrics(Yardsticks.of(limits, window, TOLERANCE))
    for part, told in zip(parts, observed or [{}] * len(parts), strict=True):
        taken.add(replace(part, observed=told))
    found = of_one_run(taken.metrics())
    assert np.isfinite(list(found.values())).all()
    assert all(type(value) is float for value in found.values())
    return found


def columns(first, second=None):
    return np.column_stack([first, np.zeros_like(first) if second is None else second])


def pressed(time, force, desired=2.0, **fields):
    """A tool that presses along z."""
    time = np.asarray(time, dtype=float)
    at_rest = np.zeros((time.size, 3))
    there = {name: at_rest for name in ("p_WE", "v_WE", "p_WE_desired", "v_WE_desired")}
    J = np.broadcast_to(np.eye(3, 2), (time.size, 3, 2))
    wanted = np.broadcast_to(np.asarray(desired, dtype=float), time.shape)
    pressing = Pressing(np.array([0.0, 0.0, 1.0]), np.array(force, dtype=float), wanted, wanted[-1])
    return motion(time, **{**there, "J": J, "pressing": pressing, **fields})


def cut(whole, at):
    """The two parts of a motion, of which the second begins with the last step of the first."""

    def part(steps, **others):
        given = {field.name: vars(whole)[field.name] for field in fields(whole)}
        rows = {
            name: values[steps]
            for name, values in given.items()
            if isinstance(values, np.ndarray) and name != "target"
        }
        if (pressing := whole.pressing) is not None:
            rows["pressing"] = replace(
                pressing, force=pressing.force[steps], desired=pressing.desired[steps]
            )
        return replace(whole, **rows, **others)

    return part(slice(at + 1)), part(slice(at, None), origin=float(whole.time[0]))
