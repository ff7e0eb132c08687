"""What a shell offers when a name is begun."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import drake_rnn

from ..diagrams import CAMPAIGNS, EXPERIMENTS
from ..models import MODELS


def _completer(names: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """Return a function that returns those of the names that begin as is written so far."""

    def complete(incomplete: str) -> list[str]:
        return sorted(name for name in names() if name.startswith(incomplete))

    return complete


def _stems(files: Iterable[Path]) -> list[str]:
    return [file.stem for file in files]


# By the names of files: a shell is not kept waiting for the rooms that read them.
complete_experiments = _completer(lambda: _stems(EXPERIMENTS.glob("*/*.yaml")))
complete_campaigns = _completer(lambda: _stems(CAMPAIGNS.glob("*.yaml")))
complete_arms = _completer(lambda: (file.parent.name for file in MODELS.glob("*/arm.yaml")))
# Their rooms are imported when they are asked for.
complete_laws = _completer(lambda: drake_rnn.LAWS)
complete_paths = _completer(lambda: drake_rnn.PATHS)
complete_levels = _completer(lambda: drake_rnn.BODIES)
