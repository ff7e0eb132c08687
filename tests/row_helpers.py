"""Many small cases in one test: each as a test of its own would cost more than what it checks."""

from functools import wraps
from inspect import signature

import pytest


def assert_each(check, rows):
    """Carry out a check of every row, and name all those that fail, with what is wrong.

    Args:
        check: A function of the entries of a row.
        rows: Rows by the names that they have in the message, a mapping.
    """
    faults = []
    for name, row in rows.items():
        try:
            check(*row)
        except (Exception, pytest.fail.Exception) as fault:
            faults.append(f"{name}: {type(fault).__name__}: {fault}")
    assert not faults, "\n".join(faults)


def each(names, rows, ids=None):
    """In the place of `pytest.mark.parametrize`: all rows in one test, which names those that fail.

    It is for checks of some milliseconds that leave nothing behind: fixtures are those of all rows.
    """
    names = tuple(name.strip() for name in names.split(",")) if isinstance(names, str) else names
    rows = [row if len(names) > 1 else (row,) for row in rows]
    keys = map(ids, (row[0] for row in rows)) if callable(ids) else ids or rows
    numbered = enumerate(zip(keys, rows, strict=True))
    named = {f"{k}, {str(key)[:200]}": row for k, (key, row) in numbered}

    def decorate(check):
        @wraps(check)
        def test(*args, **fixtures):
            def check_row(*row):
                check(*args, **dict(zip(names, row, strict=True)), **fixtures)

            assert_each(check_row, named)

        given = signature(check)
        others = [given.parameters[name] for name in given.parameters if name not in names]
        test.__signature__ = given.replace(parameters=others)
        return test

    return decorate
