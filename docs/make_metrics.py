"""Print the page of metrics: python docs/make_metrics.py > docs/metrics.md."""

import re

from drake_rnn import METRICS

#: Powers of units, as pages write them.
_POWERS = str.maketrans("2345", "²³⁴⁵")
_HEAD = """\
# Metrics

<!-- Made by `python docs/make_metrics.py > docs/metrics.md`; a test compares the two. -->

Every run writes its metrics to `metrics.json`, and `drake-rnn run` prints them next to the bounds
of `accept`. Metrics are computed over every simulated step, never over the stored samples. A metric
that does not apply to a run, or whose event did not occur, is absent.

The last column says over which steps a metric is computed: those in the experiment's `window`, or
those of the whole `run`. A unit of 1 means a dimensionless number. The run time of a run is in
`run.json`, not in its metrics.

In Python the same list is `drake_rnn.METRICS`.

| name | unit | meaning | over |
|---|---|---|---|
"""


def page() -> str:
    """Return the text of the page."""
    rows = [(m.name, _typeset(m.unit), m.meaning, m.over) for m in METRICS]
    return _HEAD + "".join(map(_row, rows))


def _typeset(unit: str) -> str:
    return re.sub(r"\^(\d)", lambda power: power[1].translate(_POWERS), unit)


def _row(cells: tuple[str, ...]) -> str:
    name, *others = (cell.replace("``", "`").replace("|", "\\|") for cell in cells)
    return f"| `{name}` | {' | '.join(others)} |\n"


if __name__ == "__main__":
    print(page(), end="")
