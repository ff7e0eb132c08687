"""The command line."""

from .starting import main as main
