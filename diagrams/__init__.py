"""Closed loops of a controller and an arm as diagrams, and the shipped experiments."""

from pathlib import Path

from ..inputs.packages import lent_names

#: Folder of the shipped campaigns, one YAML file each.
CAMPAIGNS = Path(__file__).parent / "campaigns"
#: Folder of the shipped experiments: one folder per kind of law, one YAML file per experiment.
EXPERIMENTS = Path(__file__).parent / "experiments"
#: Folder of the JSON schemas of experiments, campaigns and files of claims.
SCHEMAS = Path(__file__).parent / "schemas"

__all__, __getattr__, __dir__ = lent_names(__name__, __file__)
