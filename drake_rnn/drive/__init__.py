"""Robots behind messages: what drives them, what stops them, and one to try it on."""

from ..inputs.packages import lent_names

__all__, __getattr__, __dir__ = lent_names(__name__, __file__)
