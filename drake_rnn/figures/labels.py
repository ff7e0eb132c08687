"""Labels of axes: names of metrics and of keys, with their units."""

from __future__ import annotations

from textwrap import wrap

from ..measures import METRICS, raised

_METRICS = {metric.name: metric for metric in METRICS}
#: Width of a line of a label beside a small panel [characters].
_WIDTH = 26


def metric_label(name: str) -> str:
    """Return the name of a metric in words, with its unit; as it is if it is no known metric.

    The unit at the end of its name, as in ``joint_jerk_max_rad_s3``, is left out.
    """
    metric = _METRICS.get(name)
    if metric is None:
        return name
    shown = "-" if metric.unit == "1" else raised(metric.unit)
    return "\n".join(wrap(f"{metric.words} [{shown}]", _WIDTH))


def key_label(key: str, unit: str) -> str:
    """Return a key of a document with its unit; without, if none is known."""
    return f"{key} [{raised(unit)}]" if unit else key
