"""Laws with their defaults, for tests that look at every law."""

from drake_rnn import LAWS
from drake_rnn.inputs.messages import (
    field_names,
    fields_of,
)


def with_defaults(limits, home, shown, *, many=False):
    """Return the shipped laws of other classes than those shown, by kind.

    Args:
        limits: Limits of the joints.
        home: Posture at the start, or to seek.
        shown: Classes of laws that a test shows with options of their own.
        many: Whether only those that take many robots are wanted.
    """
    known = {"limits": limits, "home": home, "target": home}
    return {
        kind: law(**{name: value for name, value in known.items() if name in field_names(law)})
        for kind, law in LAWS.items()
        if law not in shown and (law.takes_many or not many)
    }


def numbers_of(law):
    """Return the names of a law's own numbers."""
    return tuple(name for name, value in fields_of(law).items() if isinstance(value, float))
