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

A source may have a clock of its own. It then says with each message what that clock shows. Of the
messages of the last 10 s, the one that was fastest on its way tells by how much the clocks differ;
so a clock that drifts is followed, and one that is set back counts as such after 10 s.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array, real_array
from ..inputs.messages import is_number, short
from ..paths.recordings import Kind as Kind
from ..paths.recordings import RecordedCall

#: How many numbers a target of a kind has, None for one per joint; and what it is called.
WIDTHS: dict[Kind, int | None] = {"positions": None, "velocities": None, "poses": 7, "twists": 6}
NAMES: dict[Kind, str] = {"positions": "q", "velocities": "v", "poses": "X_WE", "twists": "V_WE"}

#: Rules for the overlap of chunks.
Switch = Literal["blend", "now", "ensemble"]

# Weight of a chunk by its age rank, exp(-m k); chunks that are remembered for it.
_DECAY, _MEMORY = 0.1, 16
# Pieces of a blend.
_PIECES = 8
# Targets that are further apart, or nearer, must be in another unit than seconds [s].
_LONGEST_GAP, _LEAST_GAP = 5.0, 1e-4
# A time beyond this is one since 1970, and one far below it is not [s].
_EPOCH = 1e9


# Times between two targets below which they are the same [s].
_LEAST_SPAN = 1e-12


class Chunk(NamedTuple):
    """Targets with times.

    Attributes:
        times: Increasing times, shape (k,) [s].
        values: Targets at these times, shape (k, n).
    """

    times: Array
    values: Array

    def at(self, t: Array) -> Array:
        """Return the targets at times, shape (..., n); before the first and after the last those.

        Args:
            t: The times, shape (...) [s].
        """
        times, values = self.times, self.values
        if len(times) == 1:
            shape = np.shape(t)
            return np.broadcast_to(values[0], (*shape, values.shape[1])) if shape else values[0]
        k = times[1:-1].searchsorted(t, side="right")
        begin = times[k]
        # Of a way that waits, times may come to be the same.
        span = np.maximum(times[k + 1] - begin, _LEAST_SPAN)
        share = ((t - begin) / span).clip(0.0, 1.0)[..., None]
        return np.asarray((1.0 - share) * values[k] + share * values[k + 1])


class Piece(NamedTuple):
    """A straight piece of a way.

    Attributes:
        ends: Targets before and after it, shape (2, n); of a way of one target that, shape (1, n).
        begin: Time of the first [s].
        length: Time between the two [s]; infinite for a way of one target.
        span: From when until when the way is on it, before it or after it [s].
    """

    ends: Array
    begin: float
    length: float
    span: tuple[float, float]


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
        early: Chunks that begin so much later than they came that a clock may be wrong; they are
            followed when it is time.
        lost: Chunks that a process of its own did not come to see, because others came at once.
        refused: Chunks of other programs that such a process had to refuse.
        jumped: Poses too far from the last one; this and the following are of a filter, see
            `drake_rnn.shield.pose_filter.PoseFilter`.
        unconfirmed: Poses after tracking was lost, until they agreed for long enough.
        frozen: Poses that were the same for too long.
        not_unit: Poses whose quaternion is not of length 1.
        far: Poses that are no place of the tool.
        losses: How often tracking was lost.
    """

    chunks: int = 0
    overtaken: int = 0
    expired: int = 0
    empty: int = 0
    invalid_rows: int = 0
    late_rows: int = 0
    early: int = 0
    lost: int = 0
    refused: int = 0
    jumped: int = 0
    unconfirmed: int = 0
    frozen: int = 0
    not_unit: int = 0
    far: int = 0
    losses: int = 0


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
    # Targets, and the least and the largest of each of them and those after it.
    _ranged: tuple[Array | None, Array, Array] = (None, *(np.zeros((0, 0)),) * 2)
    # Times of the targets, as an array and as a list.
    _listed: tuple[Array | None, list[float]] = (None, [])

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
        counts.early += int(first > now + self.stale)
        chunk = Chunk(chunk.times[rows], chunk.values[rows])
        if not chunk.times.size:
            counts.empty += 1
        # One that begins much later than it came overtakes nothing: its clock may be wrong.
        elif first < self._newest <= now + self.stale:
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
        return -np.inf if self._path is None else self._path.times[-1].item()

    def at(self, t: float | Array) -> Array | None:
        """Return the target at a time, shape (n,); after the end the last; None before a chunk.

        Of k times, shape (k, n).
        """
        return None if self._path is None else self._path.at(np.array(t))

    @property
    def path(self) -> Chunk | None:
        """The way; None before the first chunk. If anything in it changes it is another object."""
        return self._path

    def piece(self, t: float) -> Piece:
        """Return the piece of the way at a time; there must be a chunk."""
        assert self._path is not None
        times, values = self._knots, self._path.values
        if len(times) == 1:
            return Piece(values, times[0], np.inf, (-np.inf, np.inf))
        last = len(times) - 2
        k = bisect_right(times, t, 1, last + 1) - 1
        begin, end = times[k : k + 2]
        span = begin if k else -np.inf, end if k < last else np.inf
        return Piece(values[k : k + 2], begin, max(end - begin, _LEAST_SPAN), span)

    @property
    def _knots(self) -> list[float]:
        """Times of the targets, which are asked for at each command."""
        assert self._path is not None
        if self._listed[0] is not self._path.times:
            self._listed = self._path.times, self._path.times.tolist()
        return self._listed[1]

    @property
    def _ranges(self) -> tuple[Array | None, Array, Array]:
        """Targets, with the least and the largest of each of them and those after it."""
        assert self._path is not None
        if self._ranged[0] is not self._path.values:
            backwards = self._path.values[::-1]
            lower, upper = np.minimum.accumulate(backwards), np.maximum.accumulate(backwards)
            self._ranged = self._path.values, lower[::-1], upper[::-1]
        return self._ranged

    def range_after(self, t: float) -> tuple[Array, Array, tuple[float, float]]:
        """Return the least and the largest targets after a time, or the last, shape (n,) each.

        And from when until when these are the same [s].
        """
        times, (_, lower, upper) = self._knots, self._ranges
        last = len(times) - 1
        k = min(bisect_left(times, t), last)
        span = times[k - 1] if k else -np.inf, times[k] if k < last else np.inf
        return lower[k], upper[k], span

    def ahead(self, t: float) -> Chunk:
        """Return what is left of the way from a time on, the target at that time first."""
        assert self._path is not None
        times = np.concatenate(((t,), self._path.times[self._path.times > t]))
        return Chunk(times, self._path.at(times))

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
        window: Array = begin + self.overlap / _PIECES * np.arange(_PIECES + 1, dtype=np.float64)
        end = max(float(chunk.times[-1]), window[-1].item())
        # A way that follows a stick has hundreds of targets: it is looked up only between them.
        new = np.concatenate(((now,), chunk.times, window, old.times[-1:])).clip(now, None)
        new = new[new <= end]
        kept = slice(*old.times[:-1].searchsorted((now, end), side="right"))
        times = np.concatenate((new, old.times[kept]))
        values = np.concatenate((old.at(new), old.values[kept]))
        order = times.argsort(kind="stable")
        # Of those that a way that waits has at the same time, the last one counts.
        order = order[np.append(np.diff(times[order]) > 0.0, True)]
        times, values = times[order], values[order]
        weight = ((times - begin) / self.overlap).clip(0.0, 1.0)[:, None]
        chunk_values = chunk.values if len(chunk.times) == 1 else chunk.at(times)
        return Chunk(times, (1.0 - weight) * values + weight * chunk_values)

    def _ensemble(self, chunk: Chunk, now: float) -> Chunk:
        """Return the weighted mean of the chunks that have a target from now on."""
        going = [each for each in (*self._recent, chunk) if each.times[-1] >= now]
        if not going:
            # All are over: the last target of the newest is held.
            return chunk
        times = _instants(now, *(each.times for each in going))
        total, weights = np.zeros((times.size, chunk.values.shape[1])), np.zeros((times.size, 1))
        for k, each in enumerate(going):
            covers = (times >= each.times[0]) & (times <= each.times[-1])
            weight = np.exp(-_DECAY * k) * covers[:, None]
            total, weights = total + weight * each.at(times), weights + weight
        some = weights[:, 0] > 0.0
        return Chunk(times[some], total[some] / weights[some])


def _instants(now: float, *times: Array) -> Array:
    """Return the times from now on, which comes first, in order and each once."""
    every = np.sort(np.concatenate(((now,), *times)).clip(now, None))
    # What `numpy.unique` does, in a fifth of its time.
    is_new = np.ones(every.size, dtype=bool)
    np.not_equal(every[1:], every[:-1], out=is_new[1:])
    return np.asarray(every[is_new])


def _trapezoid(values: Array, times: Array) -> Array:
    """Return the integral of straight pieces, shape (n,)."""
    return np.asarray(0.5 * np.diff(times) @ (values[1:] + values[:-1]))


# How long the way behind is remembered [s], and what is looked at first; what counts as rest [rad].
_PAST, _FEW, _REST = 2.0, 20, 1e-9


class WayBehind:
    """Where the joints were wanted of late.

    Args:
        joints: How many there are.

    Attributes:
        step: Time between two of these [s].
        newest: Time of the newest one [s]; minus infinity before one.
    """

    step = 0.01

    def __init__(self, joints: int) -> None:
        rows = round(_PAST / self.step)
        # The newest first.
        self._times, self._targets, self._size = np.zeros(rows), np.zeros((rows, joints)), 0
        self.newest = -np.inf

    def add(self, t: float, target: Array) -> None:
        """Remember where the joints are wanted at a time [s], shape (n,) [rad]."""
        for rows, row in ((self._times, t), (self._targets, target)):
            rows[1:] = rows[:-1]
            rows[0] = row
        self._size, self.newest = min(self._size + 1, len(self._times)), t

    def clear(self) -> None:
        """Forget all."""
        self._size, self.newest = 0, -np.inf

    def nearest(self, q: Array, t: float) -> tuple[float, float]:
        """Return how far joints are off the way [rad], and how much later than wanted [s].

        Args:
            q: Where they are, shape (n,) [rad].
            t: Time now [s].
        """
        if not self._size:
            return 0.0, 0.0
        # Back from now as long as the way comes nearer: it may pass here again earlier.
        for rows in (min(self._size, _FEW), self._size):
            away = np.abs(self._targets[:rows] - q).max(axis=1)
            goes_away = away[1:] > away[:-1]
            k = int(goes_away.argmax()) if goes_away.any() else rows - 1
            if k < rows - 1:
                break
        # Where the way rests it is as near as it was later.
        k = int((away[: k + 1] < away[k] + _REST).argmax())
        return float(away[k]), t - float(self._times[k])


class RecordedSource:
    """A source that was recorded, and gives again what it gave, when it gave it.

    Args:
        calls: What it gave, in the order in which it did.
        file: Where that is from, for messages.
    """

    def __init__(self, calls: Sequence[RecordedCall], file: str = "") -> None:
        self._calls, self._file = calls, file
        self.rewind()

    def rewind(self) -> None:
        """Begin again with the first call."""
        self._next = 0

    def send(self, follow: Callable[..., int], t: float) -> int:
        """Give all that came until a time [s], and return how many calls that were.

        Args:
            follow: What takes it, such as `drake_rnn.Shield.follow`.
            t: The time.

        Raises:
            InvalidInputError: If targets cannot be meant as they stand.
        """
        begin = self._next
        while self._next < len(self._calls) and self._calls[self._next].time <= t + _INSTANT:
            call = self._calls[self._next]
            self._next += 1
            several = len(call.times) > 1
            when: Any = {"times": call.times} if several else {"start": float(call.times[0])}
            try:
                follow(call.kind, call.values, t=t, **when)
            except InvalidInputError as error:
                text = f"targets: file {self._file}: at {call.time:g} s: {error}"
                raise InvalidInputError(text) from None
        return self._next - begin


# Rounding of times that are sums of periods [s].
_INSTANT = 1e-9


class Timing(NamedTuple):
    """When targets are to be reached, as a source says; see `read_chunk`.

    Attributes:
        now: Time now, on the clock of the commands [s].
        rate: Targets a second; None if ``times`` are given, or of a single target.
        start: Time of the first, on the source's clock [s]; None for now.
        times: Times of all, on the source's clock, shape (k,) [s], in place of both.
        sent: What the source's clock shows now [s]; None if it is that of the commands.
    """

    now: float
    rate: object = None
    start: object = None
    times: object = None
    sent: object = None


class SourceClock:
    """By how much the clock of the commands is ahead of a source's."""

    def __init__(self) -> None:
        self._offsets: deque[tuple[float, float]] = deque()

    def offset(self, sent: object, now: float) -> float:
        """Return the offset [s], the least of the last 10 s.

        Args:
            sent: What the source's clock showed when a message was sent [s].
            now: What the other one shows as it comes [s].

        Raises:
            InvalidInputError: If it is no time, or in another unit.
        """
        if not is_number(sent):
            raise InvalidInputError(f"sent: must be a time [s], not {short(sent)}")
        here, offsets = now - float(sent), self._offsets  # type: ignore[arg-type]
        if offsets and (passed := now - offsets[0][0]) > 0.5:
            ratio = (passed - (here - offsets[0][1])) / passed
            if abs(ratio) > 10.0 and abs(ratio) * passed > _FAR:
                offsets.clear()
                raise InvalidInputError(
                    f"sent: has changed by {abs(ratio) * passed:.3g} s in {passed:.3g} s; must be "
                    "in seconds, on one clock"
                )
        while offsets and now - offsets[0][0] > _REMEMBERED:
            offsets.popleft()
        offsets.append((now, here))
        return min(offset for _, offset in offsets)


# How long the differences of clocks are remembered [s].
_REMEMBERED = 10.0


def read_chunk(name: str, values: object, width: int, timing: Timing, clock: SourceClock) -> Chunk:
    """Return targets as a chunk on the clock of the commands, checked.

    A single target is a chunk of one row.

    Args:
        name: What it is called in messages.
        values: The targets, shape (width,) or (k, width).
        width: How many numbers a target has.
        timing: When they are to be reached.
        clock: What is known of the source's clock.

    Raises:
        InvalidInputError: If something cannot be meant as it stands; the message names the likely
            mistake.
    """
    array: Array = np.asarray(real_array(name, values), dtype=np.float64)
    rows = np.atleast_2d(array)
    if rows.ndim != 2 or rows.shape[1] != width or not len(rows):
        raise InvalidInputError(
            f"{name}: must be one target of {width} numbers or rows of them, not an array of shape "
            f"{array.shape}{_shape_hint(name, array.shape, width)}"
        )
    now, offset = timing.now, 0.0
    if timing.sent is not None:
        offset = clock.offset(timing.sent, now)
        # What the source's clock showed as the message was sent.
        now = float(timing.sent)  # type: ignore[arg-type]
    if timing.times is not None:
        return Chunk(offset + _times(timing, len(rows), now), rows)
    begin = now if timing.start is None else _start("start", timing.start, now)
    if timing.rate is None and len(rows) > 1:
        raise InvalidInputError(f"{name}: of {len(rows)} targets the rate, or times, must be given")
    interval = 0.0 if timing.rate is None else 1.0 / _rate(timing.rate)
    return Chunk(offset + begin + interval * np.arange(len(rows), dtype=np.float64), rows)


def _shape_hint(name: str, shape: tuple[int, ...], width: int) -> str:
    """Return the likely mistake of a shape."""
    if len(shape) == 2 and shape[0] == width:
        return "; it looks transposed"
    if len(shape) > 2 and shape[-1] == width:
        return "; it has an axis too many, such as that of a batch"
    if name == "X_WE" and shape[-2:] == (4, 4):
        return "; a pose is a position and a quaternion, not a matrix"
    if name == "X_WE" and shape[-1:] == (6,):
        return "; a pose has a quaternion, not angles"
    if name == "X_WE" and shape[-1:] == (3,):
        return "; a pose has a quaternion too, after the position, w first"
    if name == "V_WE" and shape[-1:] == (3,):
        return "; a twist has an angular velocity too, first"
    if name in ("q", "v") and shape and shape[-1] in (width + 1, width + 2):
        return "; what the gripper is to do is no target of the arm"
    return ""


def _rate(rate: object) -> float:
    if not is_number(rate) or not 0.0 < float(rate) < np.inf:  # type: ignore[arg-type]
        hint = _HINT_OF_TIMES if np.ndim(rate) == 1 else ""  # type: ignore[arg-type]
        raise InvalidInputError(
            f"rate: must be a number of targets a second, not {short(rate)}{hint}"
        )
    value = float(rate)  # type: ignore[arg-type]
    if value < 1.0 / _LONGEST_GAP:
        raise InvalidInputError(
            f"rate: {value:g} targets a second are {1.0 / value:g} s apart; must be a rate in Hz, "
            "not a time between two"
        )
    if value > 1.0 / _LEAST_GAP:
        raise InvalidInputError(
            f"rate: {value:g} targets a second are {1.0 / value:g} s apart; must be a rate in Hz"
        )
    return value


def _times(timing: Timing, rows: int, now: float) -> Array:
    """Return the times of rows, on the source's clock, shape (k,) [s]."""
    if timing.rate is not None or timing.start is not None:
        raise InvalidInputError("times: must be given in place of rate and start, not with them")
    times: Array = np.asarray(real_array("times", timing.times), dtype=np.float64)
    if times.shape != (rows,):
        raise InvalidInputError(
            f"times: must be of shape ({rows},), one for each target, not {times.shape}"
        )
    if not np.isfinite(times).all():
        raise InvalidInputError("times: must be finite")
    gaps = np.diff(times)
    if (gaps <= 0.0).any():
        k = int((gaps <= 0.0).argmax())
        raise InvalidInputError(
            f"times: must increase; {times[k]:.9g} s is followed by {times[k + 1]:.9g} s"
        )
    _start("times", float(times[0]), now)
    if gaps.size and float(gaps.mean()) > _LONGEST_GAP:
        raise InvalidInputError(
            f"times: are {gaps.mean():.3g} s apart; must be in seconds, not milliseconds"
        )
    return times


def _start(name: str, start: object, now: float) -> float:
    if not is_number(start):
        hint = _HINT_OF_TIMES if np.ndim(start) == 1 else ""  # type: ignore[arg-type]
        raise InvalidInputError(f"{name}: must be a time [s], not {short(start)}{hint}")
    begin = float(start)  # type: ignore[arg-type]
    if abs(begin - now) <= _FAR:
        return begin
    raise InvalidInputError(
        f"{name}: {begin:.9g} s is {abs(begin - now):.3g} s from the time now, {now:.9g} s; must "
        f"be on the same clock{_clock_hint(begin, now)}. A source with a clock of its own gives "
        "sent, what that shows"
    )


def _clock_hint(begin: float, now: float) -> str:
    """Return the likely mistake of a time that is far from now."""
    if begin > 1e2 * _EPOCH:
        return "; it looks like milli- or nanoseconds since 1970"
    untold = "before the first command, t tells the time now"
    if _EPOCH < begin < 3.0 * _EPOCH or now > _EPOCH:
        since = "; one of them is in seconds since 1970"
        return since if now else f"{since}; {untold}"
    for unit, name in ((1e-3, "milliseconds"), (1e-9, "nanoseconds")):
        if abs(begin * unit - now) <= _FAR and begin * unit > _LEAST_HINT:
            return f"; it looks like {name}" + ("" if now else f", or else {untold}")
    if not now:
        return f"; {untold}"
    return "; it looks like a time since the begin of something" if 0.0 <= begin < _FAR else ""


# A time that would be shorter in another unit is not taken for one in it [s].
_LEAST_HINT = 0.01
_HINT_OF_TIMES = "; times of all targets are given as times"
# A chunk begins at most this far from now [s].
_FAR = 60.0
