r"""Targets that a policy or a planner sends in chunks, and what of them is to be reached when.

A *chunk* is a row of targets with times. It replaces what is left of the chunk before it. Where the
two disagree, a rule says what is followed from the time of the switch on:

- ``blend``: during ``overlap`` seconds from one to the other, with weights that change linearly;
- ``now``: the new one at once;
- ``ensemble``: the mean of all chunks that have a target for that time, the oldest with the weight
  1, the next with exp(-m), as in Zhao et al., "Learning fine-grained bimanual manipulation with
  low-cost hardware", RSS 2023, with m = 0.1.

Between two targets the way is straight. Rows with an entry that is no number are left out, and the
way goes straight over them. A chunk that begins earlier than one that has come already was
overtaken on its way, and is not followed; nor is one whose end is long past.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array, real_array
from ..inputs.messages import is_number, short

#: Rules for the overlap of chunks.
Switch = Literal["blend", "now", "ensemble"]

# Weight of a chunk by its age rank, exp(-m k); chunks that are remembered for it.
_DECAY, _MEMORY = 0.1, 16
# Pieces of a blend.
_PIECES = 8
# Times that are further apart must be in another unit than seconds [s].
_LONGEST_GAP = 10.0
# A time beyond this is one since 1970, and one far below it is not [s].
_EPOCH = 1e9


class Chunk(NamedTuple):
    """Targets with times.

    Attributes:
        times: Increasing times, shape (k,) [s].
        values: Targets at these times, shape (k, n).
    """

    times: Array
    values: Array

    def at(self, t: Array) -> Array:
        """Return the targets at times, shape (k, n); before the first and after the last those."""
        columns = [np.interp(t, self.times, column) for column in self.values.T]
        return np.stack(columns, axis=-1)


@dataclass
class Counts:
    """What of the chunks that came was not followed, and why.

    Attributes:
        chunks: Chunks that came.
        overtaken: Chunks that began earlier than one that had come before.
        expired: Chunks that were stale.
        empty: Chunks without a row of numbers.
        invalid_rows: Rows that had an entry that is no number.
        late_rows: Rows whose time had passed when they came.
    """

    chunks: int = 0
    overtaken: int = 0
    expired: int = 0
    empty: int = 0
    invalid_rows: int = 0
    late_rows: int = 0


@dataclass
class ChunkPath:
    """The way through the chunks that have come.

    Attributes:
        switch: Rule for the overlap.
        overlap: Length of a blend [s].
        stale: Time since its last target after which a chunk that comes is not followed [s].
        counts: What was not followed.
    """

    switch: Switch = "blend"
    overlap: float = 0.1
    stale: float = 1.0
    counts: Counts = field(default_factory=Counts)
    _path: Chunk | None = None
    _recent: deque[Chunk] = field(default_factory=lambda: deque(maxlen=_MEMORY))
    _newest: float = -np.inf

    def put(self, chunk: Chunk, now: float) -> bool:
        """Take a chunk, and return whether it is followed.

        Args:
            chunk: The chunk; rows may have entries that are no numbers.
            now: Time at which it comes, on the clock of its times [s].
        """
        counts = self.counts
        counts.chunks += 1
        rows = np.isfinite(chunk.values).all(axis=1)
        counts.invalid_rows += int((~rows).sum())
        counts.late_rows += int((chunk.times < now).sum())
        first = float(chunk.times[0])
        chunk = Chunk(chunk.times[rows], chunk.values[rows])
        if not chunk.times.size:
            counts.empty += 1
        elif first < self._newest:
            counts.overtaken += 1
        elif chunk.times[-1] < now - self.stale:
            counts.expired += 1
        else:
            self._newest = first
            self._path = self._joined(chunk, now)
            self._recent.append(chunk)
            return True
        return False

    @property
    def end(self) -> float:
        """Time of the last target [s]; minus infinity before the first chunk."""
        return -np.inf if self._path is None else float(self._path.times[-1])

    def at(self, t: float) -> Array | None:
        """Return the target at a time, shape (n,); after the end the last; None before a chunk."""
        return None if self._path is None else self._path.at(np.array(t))

    def put_off(self, delay: float) -> None:
        """Have what is left of the way come later by a time [s]."""
        if self._path is not None and delay:
            self._path = self._path._replace(times=self._path.times + delay)

    def mean(self, begin: float, end: float) -> Array:
        """Return the mean of the targets between two times, shape (n,); there must be a chunk."""
        assert self._path is not None
        inner = self._path.times[(self._path.times > begin) & (self._path.times < end)]
        times = np.concatenate(((begin,), inner, (end,)))
        values = self._path.at(times)
        return np.asarray(_trapezoid(values, times) / (end - begin))

    def _joined(self, chunk: Chunk, now: float) -> Chunk:
        """Return the way from now on."""
        old = self._path
        if old is None or self.switch == "now":
            return chunk
        if self.switch == "ensemble":
            return self._ensemble(chunk, now)
        # Until the chunk begins, the way is that of the one before.
        begin = max(now, float(chunk.times[0]))
        window = begin + self.overlap / _PIECES * np.arange(_PIECES + 1)
        times = np.unique(np.concatenate(((now,), old.times, chunk.times, window)).clip(now, None))
        times = times[times <= max(float(chunk.times[-1]), window[-1])]
        weight = np.clip((times - begin) / self.overlap, 0.0, 1.0)[:, None]
        return Chunk(times, (1.0 - weight) * old.at(times) + weight * chunk.at(times))

    def _ensemble(self, chunk: Chunk, now: float) -> Chunk:
        """Return the weighted mean of the chunks that have a target from now on."""
        going = [each for each in (*self._recent, chunk) if each.times[-1] >= now]
        if not going:
            # All are over: the last target of the newest is held.
            return chunk
        times = np.unique(np.concatenate([(now,), *(each.times for each in going)]).clip(now, None))
        total, weights = np.zeros((times.size, chunk.values.shape[1])), np.zeros((times.size, 1))
        for k, each in enumerate(going):
            covers = (times >= each.times[0]) & (times <= each.times[-1])
            weight = np.exp(-_DECAY * k) * covers[:, None]
            total, weights = total + weight * each.at(times), weights + weight
        some = weights[:, 0] > 0.0
        return Chunk(times[some], total[some] / weights[some])


def _trapezoid(values: Array, times: Array) -> Array:
    """Return the integral of straight pieces, shape (n,)."""
    return np.asarray(0.5 * np.diff(times) @ (values[1:] + values[:-1]))


def read_chunk(
    name: str, values: object, width: int, now: float, rate: object = None, start: object = None
) -> Chunk:
    """Return targets as a chunk, checked; a single target is a chunk of one row.

    Args:
        name: What it is called in messages.
        values: The targets, shape (width,) or (k, width).
        width: How many numbers a target has.
        now: Time now [s].
        rate: Targets a second; may be left out for a single one.
        start: Time of the first [s]; None for now.

    Raises:
        InvalidInputError: If something cannot be meant as it stands; the message names the likely
            mistake.
    """
    array: Array = np.asarray(real_array(name, values), dtype=np.float64)
    rows = np.atleast_2d(array)
    if rows.ndim != 2 or rows.shape[1] != width or not len(rows):
        raise InvalidInputError(
            f"{name}: must be one target of {width} numbers or rows of them, not an array of shape "
            f"{array.shape}"
        )
    begin = now if start is None else _start(start, now)
    if rate is None and len(rows) > 1:
        raise InvalidInputError(f"{name}: of {len(rows)} targets the rate must be given")
    interval = 0.0 if rate is None else 1.0 / _rate(rate)
    return Chunk(begin + interval * np.arange(len(rows), dtype=np.float64), rows)


def _rate(rate: object) -> float:
    if not is_number(rate) or not 0.0 < float(rate) < np.inf:  # type: ignore[arg-type]
        raise InvalidInputError(f"rate: must be a number of targets a second, not {short(rate)}")
    value = float(rate)  # type: ignore[arg-type]
    if value < 1.0 / _LONGEST_GAP:
        raise InvalidInputError(
            f"rate: {value:g} targets a second are {1.0 / value:g} s apart; must be a rate in Hz, "
            "not a time between two"
        )
    return value


def _start(start: object, now: float) -> float:
    if not is_number(start):
        raise InvalidInputError(f"start: must be a time [s], not {short(start)}")
    begin = float(start)  # type: ignore[arg-type]
    if abs(begin - now) <= _FAR:
        return begin
    hint = ""
    if (begin > _EPOCH) != (now > _EPOCH):
        hint = "; one of them is in seconds since 1970"
    elif abs(begin * 1e-3 - now) <= _FAR:
        hint = "; it looks like milliseconds"
    elif abs(begin * 1e-9 - now) <= _FAR:
        hint = "; it looks like nanoseconds"
    raise InvalidInputError(
        f"start: {begin:.9g} s is {abs(begin - now):.3g} s from the time now, {now:.9g} s; must be "
        f"on the same clock{hint}"
    )


# A chunk begins at most this far from now [s].
_FAR = 60.0
