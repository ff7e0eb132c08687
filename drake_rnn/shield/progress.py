r"""How much of its speed a tool may want, so that an arm rests where it gets no further.

The law that leads the tool does not know what stands in its way; what is safe of its velocities is
chosen behind it. Where a pose or a twist leads into a table, the nearest velocities that are safe
slide aside, the law leads back, and the arm would swing there for ever.

Progress is the work of what is wanted, :math:`\int b \cdot V \, dt`, of the task velocity b that
is wanted and that of the tool, V. To a pose at rest b is the gradient of a function of the error,
and along a constant twist it is constant: so a motion to and fro adds nothing beyond the largest
value so far. While that does not grow by a tenth of what b alone would make of it, the speed falls,
after a while in which the arm may just be starting or turning round, to a three-hundredth. With
that the arm feels its way, and is as fast as before half a second after the way is free. A tool
that was on its way elsewhere has lost some of that work as it turns round: once it has gone well
along b for a while, progress counts from there. What asks for something else has all of the speed.
"""

from __future__ import annotations

from math import exp

import numpy as np

from ..inputs.fields import Array

# Share of the work of what is wanted that is progress.
_LEAST_GAIN = 0.1
# Time over which progress is a mean, in which the speed falls and grows by a factor of e [s]; the
# least share of it.
_MEAN, _FALL, _GROWTH, _LEAST = 0.1, 0.15, 0.08, 3e-3
# Share of the work with which a tool goes well along what is wanted, and for how long it must [s].
_WELL, _LONG = 0.5, 0.3
# A tool is not led by less than this [m/s].
_NOTHING = 1e-3


class Progress:
    """What a tool gets on along what is wanted of it.

    Attributes:
        share: Share of its speed that it may want.
        blocked: Time for which it has not got on [s].
    """

    def __init__(self) -> None:
        self.share = 1.0
        self.clear()

    def clear(self) -> None:
        """Begin anew, with something else that is wanted."""
        self.share, self.blocked = 1.0, 0.0
        self._ahead, self._rate, self._since, self._well = 0.0, 0.0, 0.0, 0.0

    def note(self, wanted: Array, V_tool: Array, period: float, patience: float) -> None:
        """Take note of a sample.

        Args:
            wanted: Task velocity b that is wanted, of rows that are lengths, shape (6,) [m/s].
            V_tool: That of the tool, likewise.
            period: Time between two samples [s].
            patience: Time without progress after which the speed falls [s].
        """
        square = float(wanted @ wanted)
        if square < _NOTHING**2:
            self.clear()
            return
        # How far it is ahead of the largest value so far; negative if it has gone back.
        power = float(wanted @ V_tool)
        self._well = self._well + period if power >= _WELL * self.share * square else 0.0
        self._ahead = period * power + (self._ahead if self._well < _LONG else 0.0)
        gained, self._ahead = max(self._ahead, 0.0), min(self._ahead, 0.0)
        self._rate += (gained - period * self._rate) / (_MEAN + period)
        self.blocked = 0.0 if self._rate >= _LEAST_GAIN * square else self.blocked + period
        if self._rate >= _LEAST_GAIN * self.share * square:
            self._since, self.share = 0.0, min(1.0, self.share * exp(period / _GROWTH))
            return
        self._since += period
        if self._since > patience and not self._well:
            self.share = max(_LEAST, self.share * exp(-period / _FALL))


def is_another_twist(V: Array, V_before: Array) -> bool:
    """Return whether a twist asks for another direction than one before, shape (6,) each."""
    return float(V @ V_before) < 0.9 * float(np.linalg.norm(V) * np.linalg.norm(V_before))
