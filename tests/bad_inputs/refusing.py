"""Tables of bad inputs, and what all that is refused has in common."""

from pathlib import Path

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
    """Rows in lots that are tested together, in each the rows by what they are."""
    found = [rows[k : k + _TOGETHER] for k in range(0, len(rows), _TOGETHER)]
    return [
        pytest.param({str(row): row for row in lot}, id=f"from row {_TOGETHER * number + 1} on")
        for number, lot in enumerate(found)
    ]


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
