"""The folder of one run while it is made: lock, checkpoint, tables, manifest and the mark that it is done."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nlbench.errors import DamagedResults
from nlbench.results import lock
from nlbench.results.atomic import atomic_write, remove, sweep
from nlbench.results.checksum import of_bytes

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

CHECKPOINT = "batches/checkpoint.npz"
EXPERIMENT = "config.resolved.yaml"
MANIFEST = "manifest.json"
TABLES = "tables"
DONE = "DONE"


class RunFolder:
    """Everything is written atomically. Write only while `locked()` is held."""

    def __init__(self, path: str | Path):
        self.path = Path(path)

    @contextlib.contextmanager
    def locked(self) -> Iterator[RunFolder]:
        """Hold the folder alone and sweep what a dead process left; `LockedError` if a live one holds it."""
        with lock.exclusive(self.path / ".lock"):
            for folder in (self.path, *(self.path / name for name in ("batches", TABLES, "figures"))):
                sweep(folder)
            yield self

    def save_checkpoint(self, arrays: Mapping[str, np.ndarray], **facts: Any) -> None:
        """Replace the checkpoint."""
        from nlbench.results.checkpoint import save_checkpoint

        save_checkpoint(self.path / CHECKPOINT, arrays, facts)

    def load_checkpoint(self) -> tuple[dict[str, np.ndarray], dict[str, Any]] | None:
        """Arrays and facts of the checkpoint, None if there is none. Raises `DamagedResults`."""
        from nlbench.results.checkpoint import load_checkpoint

        path = self.path / CHECKPOINT
        return load_checkpoint(path) if path.exists() else None

    def write_experiment(self, text: str) -> None:
        """Write the resolved experiment."""
        atomic_write(self.path / EXPERIMENT, text.encode())

    def write_tables(self, tables: Mapping[str, pd.DataFrame]) -> None:
        """Write tables, each as CSV and Parquet."""
        from nlbench.results.tables import write_table

        for name, table in tables.items():
            write_table(self.path / TABLES, name, table)

    def finish(self, runs: int, **facts: Any) -> None:
        """Write the manifest, with checksums of what the folder holds, and the mark that `runs` are done."""
        from nlbench.results.manifest import write_manifest

        kept = [self.path / EXPERIMENT, self.path / CHECKPOINT, *sorted((self.path / TABLES).iterdir())]
        checksums = {str(p.relative_to(self.path)): of_bytes(p.read_bytes()) for p in kept if p.exists()}
        write_manifest(self.path / MANIFEST, {**facts, "runs": runs, "checksums": checksums})
        atomic_write(self.path / DONE, f"{runs}\n".encode())

    def reopen(self) -> None:
        """Take the mark away before anything is changed."""
        remove(self.path / DONE)

    def done_runs(self) -> int | None:
        """How many runs are done; None if the run is not finished. Raises `DamagedResults`."""
        try:
            return int((self.path / DONE).read_text())
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            raise DamagedResults(
                f"{self.path / DONE}: does not say how many runs are done ({error})"
            ) from error
