"""Laws that end badly, for runs that do."""

from __future__ import annotations

import os
import time

from drake_rnn import Pseudoinverse, validated


@validated
class Fatal(Pseudoinverse):
    """The pseudoinverse, until its time comes.

    Args:
        fate: What happens 10 ms after the start: ``live``, ``kill`` its process, ``fail``,
            ``once``, kill it unless the file ``mark`` is there, or ``wait`` while
            ``mark.wait`` is there, which is no file of the document.
        mark: A file.
    """

    fate: str = "live"
    mark: str = ""

    def step(self, t, x, u, period):
        if t > 0.01 and self.fate == "kill":
            os._exit(7)
        if t > 0.01 and self.fate == "once" and not os.path.exists(self.mark):
            with open(self.mark, "w"):
                os._exit(7)
        while t > 0.01 and self.fate == "wait" and os.path.exists(f"{self.mark}.wait"):
            time.sleep(0.02)
        if t > 0.01 and self.fate == "fail":
            raise ValueError("its time has come")
        return super().step(t, x, u, period)
