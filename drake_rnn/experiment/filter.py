"""The delays that an experiment's filter causes for its law and its path."""

from __future__ import annotations

from typing import NamedTuple, get_args

from ..errors import InvalidInputError
from ..systems.moving_average import Kept, averaging_delay, averaging_windows
from .guarantees import command_guarantee
from .sections import Sections


class FilterDelay(NamedTuple):
    """Delays caused by a filter.

    Attributes:
        path: Delay with which the arm follows the path [s].
        loop: Delay between the law's command and its inputs [s].
    """

    path: float = 0.0
    loop: float = 0.0


def filter_delay(parts: Sections) -> tuple[FilterDelay, list[str]]:
    """Return the delays that the experiment's filter causes, zero without one, and warnings.

    Args:
        parts: What the sections of the experiment's document describe.

    Raises:
        InvalidInputError: If the filter does not fit law or duration; or if a gain of the law is
            too high for the delays of filter and sensing.
    """
    delay = _delay(parts)
    return delay, _loop_doubts(parts, delay.loop)


def _delay(parts: Sections) -> FilterDelay:
    document, feedback, law = parts.document, parts.feedback, parts.law
    settings = document.filter
    if settings is None or document.period is None:
        return FilterDelay()
    _require_kept(settings.above, command_guarantee(law, parts.safety).limits)
    windows = averaging_windows(parts.arm.limits, document.period, settings.above)
    delay = averaging_delay(windows, document.period)
    if delay >= document.duration:
        raise InvalidInputError(
            f"filter: with these limits its delay is {delay:.4g} s; the duration must be longer "
            f"than that, not {document.duration:g}"
        )
    if feedback == "unfiltered":
        return FilterDelay(path=delay)
    return FilterDelay(path=delay * settings.delay_desired, loop=delay)


def _require_kept(above: Kept, keeps: tuple[str, ...]) -> None:
    """Raise an InvalidInputError if a filter relies on a limit that the command does not keep."""
    able = [name for name in get_args(Kept) if name == "velocity" or name in keeps]
    if above not in able:
        raise InvalidInputError(
            f"filter.above: the command of this law keeps no limit of the {above}; it may "
            f"be {', '.join(able)}"
        )


def _loop_doubts(parts: Sections, delay: float) -> list[str]:
    """Return a warning about the filter's delay [s] in the law's loop; refuse gains too high."""
    document, law = parts.document, parts.law
    sensed = 0.0 if document.sensing is None else document.sensing.delay
    late = delay + sensed
    if late == 0.0:
        return []
    whose = " and ".join(name for name, part in (("filter", delay), ("sensing", sensed)) if part)
    remedy = "" if sensed else "; or give feedback: unfiltered"
    for name, gain in law.loop_gains.items():
        if gain * late >= 1.0:
            raise InvalidInputError(
                f"law.{name}: must be below {1.0 / late:.4g} /s with the {whose}'s delay of "
                f"{late:.4g} s in its loop, not {gain:g}{remedy}"
            )
    if law.loop_gains or delay == 0.0:
        return []
    return [
        f"filter: delays the law's loop by {delay:.4g} s; whether {document.law['kind']} stays "
        "stable with this delay is not known; consider feedback: unfiltered"
    ]
