"""Tables of bad inputs, and what all that is refused has in common."""

from pathlib import Path

import numpy as np
import pytest

from drake_rnn import InvalidInputError
from process_helpers import within

#: Time of the processor within which a bad input must be refused [s].
AT_ONCE = 20

_BETWEEN = "  =>  "
#: Rows that one test goes through: a test for each would cost a tenth to a half more.
_TOGETHER = 40


def table(name):
    """The rows of a table beside this file, as pairs of what is given and what is said of it.

    Lines that begin with # and empty ones are left out.
    """
    lines = (Path(__file__).parent / name).read_text(encoding="utf-8").splitlines()
    rows = [line for line in lines if line and not line.startswith("#")]
    return [tuple(row.split(_BETWEEN)) if _BETWEEN in row else (row, "") for row in rows]


def lots(rows):
    """Rows in lots that are tested together, each with its first and last row's number."""
    found = [rows[k : k + _TOGETHER] for k in range(0, len(rows), _TOGETHER)]
    ends = np.cumsum([len(lot) for lot in found])
    return [
        pytest.param(lot, id=f"rows {end - len(lot) + 1} to {end}")
        for lot, end in zip(found, ends.tolist(), strict=True)
    ]


def assert_each(check, rows):
    """Carry out a check of every row, and name all those that fail, with what is wrong."""
    faults = []
    for row in rows:
        try:
            check(*row)
        except (Exception, pytest.fail.Exception) as fault:
            faults.append(f"{row}: {type(fault).__name__}: {fault}")
    assert not faults, "\n".join(faults)


def at_once():
    """Fail if what is done within still has not been refused."""
    return within(AT_ONCE, f"it still has not been refused after {AT_ONCE} s")


def refusal(call):
    """What is said of a call, in one line of our own words, and at once."""
    with at_once(), pytest.raises(InvalidInputError) as caught:
        call()
    message = str(caught.value)
    assert not [foreign for foreign in ("\n", "pydantic") if foreign in message]
    return message
