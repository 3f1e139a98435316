"""Tables as CSV and Parquet files whose bytes depend on their content alone."""

from __future__ import annotations

import io
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from nlbench.results.atomic import atomic_write
from nlbench.results.checksum import of_bytes

PARQUET_ONLY = frozenset({"runs"})  # too large to be of use as text


def write_table(folder: Path, name: str, table: pd.DataFrame) -> dict[str, str]:
    """Write `name.csv` and `name.parquet` into `folder`; returns the checksum of each file by its name."""
    contents = {f"{name}.parquet": parquet_bytes(table)}
    if name not in PARQUET_ONLY:
        contents[f"{name}.csv"] = csv_bytes(table)
    for file, data in contents.items():
        atomic_write(folder / file, data)
    return {file: of_bytes(data) for file, data in sorted(contents.items())}


def csv_bytes(table: pd.DataFrame) -> bytes:
    """Numbers in the shortest form that reads back the same; an empty field for not-a-number."""
    return table.to_csv(index=False, lineterminator="\n", na_rep="").encode()


def parquet_bytes(table: pd.DataFrame) -> bytes:
    """Without the pandas version and other metadata that are not content."""
    arrow = pa.Table.from_pandas(table, preserve_index=False).replace_schema_metadata(None)
    buffer = io.BytesIO()
    pq.write_table(arrow, buffer, compression="zstd", version="2.6")
    return buffer.getvalue()


def read_parquet(data: bytes) -> pd.DataFrame:
    """The table whose `parquet_bytes` are given."""
    return pq.read_table(io.BytesIO(data)).to_pandas()
