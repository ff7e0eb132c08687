"""Robot models that come with this package."""

from pathlib import Path

MODELS = Path(__file__).parent
