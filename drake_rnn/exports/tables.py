"""Series as tables: CSV, whose numbers are read back to the last bit, and Parquet."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ..inputs.extras import needed
from ..runs.result import Result


def write_csv(result: Result, file: Path, series: Iterable[str] | None) -> None:
    """Write columns as CSV, with the shortest decimals that tell each number."""
    columns = result.columns(series)
    with file.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow(columns)
        table.writerows(np.column_stack(list(columns.values())).tolist())


def write_parquet(result: Result, file: Path, series: Iterable[str] | None) -> None:
    """Write columns as Parquet; the document of the run is among the file's own data."""
    columns = result.columns(series)
    pyarrow, parquet = needed("parquet", "parquet", "pyarrow", "pyarrow.parquet")
    told = {"experiment": result.experiment.document.to_yaml()}
    table = pyarrow.table({name: np.ascontiguousarray(x) for name, x in columns.items()})
    parquet.write_table(table.replace_schema_metadata(told), file)
