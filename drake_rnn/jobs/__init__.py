"""Jobs: requests of runs, their records, where they are stored and who carries them out.

Campaigns and sweeps, of which all other commands that run experiments share the parts. The names
are listed in ``__init__.pyi``; each is imported when it is first asked for.
"""

from ..inputs.packages import lent_names

__all__, __getattr__, __dir__ = lent_names(__name__, __file__)
