"""Results that are saved, in the formats of other tools."""

from __future__ import annotations

from contextlib import ExitStack

from rich.markup import escape

from ..exports import export, exported_file
from ..runs.folder import claimed, require_output
from ..runs.result import Result
from .asked import Export
from .changing import require_writable
from .console import errors, out, status


def export_result(asked: Export) -> None:
    """Write the series of a saved result for other tools."""
    with errors(), ExitStack() as claims:
        if asked.file is not None and not asked.file.is_dir():
            require_output(asked.file, "--to")
        exported_file(asked.file or asked.folder, asked.form)
        result = Result.load(asked.folder, modules=True)
        if asked.file is not None:
            require_writable(asked.file.parent, "--to")
        else:
            claims.enter_context(claimed(asked.folder, shared=True))
        with status("writing"):
            file = export(result, asked.file or asked.folder, asked.form, asked.series)
        out.print(escape(f"series    {file}"), soft_wrap=True)
