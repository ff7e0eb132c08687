"""Tables: built once, rounded once, and written as Markdown, LaTeX or CSV."""

from .markdown import markdown_rows as markdown_rows
from .sheet import (
    Cell as Cell,
    Column as Column,
    Heading as Heading,
    Sheet as Sheet,
    metric_heading as metric_heading,
)
from .written import (
    FORMATS as FORMATS,
    require_format as require_format,
    write_sheet as write_sheet,
)
