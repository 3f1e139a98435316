"""The same table gives the same bytes, and the bytes give back the same table."""

from __future__ import annotations

import io
import time

import numpy as np
import pandas as pd
import pytest

from nlbench.results.checksum import of_bytes
from nlbench.results.tables import csv_bytes, parquet_bytes, read_parquet, write_table


def table() -> pd.DataFrame:
    rng = np.random.default_rng(1)
    values = np.concatenate(
        [rng.normal(size=200) * 10.0 ** rng.integers(-300, 300, 200), [0.1, 1e22, 1 / 3, np.inf]]
    )
    return pd.DataFrame(
        {
            "filter": ["third, guarded", 'with "quotes"'] * (len(values) // 2),
            "time": ["0.5", "all"] * (len(values) // 2),
            "value": np.append(values[:-1], np.nan),
            "stderr": values[::-1],
            "n": np.arange(len(values)) * 10**12,
            "diverged": values > 0,
        }
    )


def test_two_writes_of_equal_tables_are_byte_identical(tmp_path):
    first = write_table(tmp_path / "a", "statistics", table())
    time.sleep(1.1)  # a time stamp of one second would show
    second = write_table(tmp_path / "b", "statistics", table())
    assert first == second
    assert first.keys() == {"statistics.csv", "statistics.parquet"}
    for name, checksum in first.items():
        data = (tmp_path / "a" / name).read_bytes()
        assert data == (tmp_path / "b" / name).read_bytes()
        assert of_bytes(data) == checksum


def test_one_changed_bit_changes_both_files(tmp_path):
    changed = table()
    changed.loc[0, "value"] = np.nextafter(changed.loc[0, "value"], np.inf)
    first, second = write_table(tmp_path / "a", "t", table()), write_table(tmp_path / "b", "t", changed)
    assert all(first[name] != second[name] for name in first)


def test_parquet_gives_back_the_table_exactly():
    pd.testing.assert_frame_equal(read_parquet(parquet_bytes(table())), table(), check_exact=True)


def test_csv_gives_back_the_table_exactly_and_shortest():
    text = csv_bytes(table()).decode()
    back = pd.read_csv(io.StringIO(text))
    pd.testing.assert_frame_equal(back, table(), check_exact=True)
    numbers = [line.rsplit(",", 4)[1:3] for line in text.splitlines()[1:]]
    floats = [field for pair in numbers for field in pair if field not in ("", "inf")]
    assert len(floats) == 2 * len(table()) - 2
    assert all(repr(float(field)) == field for field in floats)
    assert "\r" not in text


def test_kept_runs_are_written_as_parquet_only(tmp_path):
    assert write_table(tmp_path, "runs", table()).keys() == {"runs.parquet"}


def test_parquet_holds_no_version_of_pandas():
    assert b"pandas" not in parquet_bytes(table())


@pytest.mark.parametrize("rows", [0, 1])
def test_a_table_with_hardly_a_row_survives(rows):
    small = table().head(rows)
    assert list(read_parquet(parquet_bytes(small)).columns) == list(small.columns)
    assert len(csv_bytes(small).decode().splitlines()) == rows + 1
