"""Whole runs that several tests look at: each is made once, by whichever process asks first.

Those that `make docs` has made for the gallery, with the same code and versions, are taken from it.
"""

import os
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import make_gallery

from drake_rnn import Result
from drake_rnn.claims import RunSource
from drake_rnn.jobs import simulate_each
from drake_rnn.runs.series import RunOptions

#: Names the folder of the runs; set for the time of the tests.
FOLDER = "DRAKE_RNN_SHARED_RUNS"


def shared_run(name, changes=None, *, compiled=False):
    """Return the result of a shipped experiment with changes by dotted key."""
    if not compiled:
        return SharedRuns().run(name, changes)
    request = SharedRuns().request(name, changes)
    options = RunOptions(compiled=True)
    return made_once(replace(request, key=f"{request.key}_compiled", options=options))


def made_once(request):
    """Return the result of a request, whichever process makes it first."""
    folder = Path(os.environ[FOLDER])
    place = folder / request.key
    if not place.is_dir():
        with TemporaryDirectory(dir=folder) as scratch:
            run = Path(scratch) / "run"
            (record,) = simulate_each([replace(request, folder=run)])
            record.require_complete()
            try:
                os.rename(run, place)
            except OSError:
                # Another process may have been as quick: its run has the same bits.
                if not place.is_dir():
                    raise
    return Result.load(place)


class SharedRuns(RunSource):
    """These runs, for judging claims."""

    def run(self, name, changes=None, /):
        """Return the result of an experiment with changes by dotted key."""
        if not changes and make_gallery.is_kept(name):
            return Result.load(make_gallery.RUNS / name)
        return made_once(self.request(name, changes))
