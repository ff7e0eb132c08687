"""Results in the formats of other tools."""

from .export import (
    FORMATS as FORMATS,
    Format as Format,
    export as export,
    exported_file as exported_file,
)
