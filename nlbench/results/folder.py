"""The folder of one run while it is made: lock, checkpoint, tables, manifest and the mark that it is done."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nlbench.errors import DamagedResults, EnvironmentFault
from nlbench.results import lock
from nlbench.results.atomic import atomic_write, remove, sweep
from nlbench.results.checksum import of_bytes

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

BATCHES = "batches"
CHECKPOINT = f"{BATCHES}/checkpoint.npz"
EXPERIMENT = "config.resolved.yaml"
MANIFEST = "manifest.json"
TABLES = "tables"
DONE = "DONE"
LOCK = ".lock"
log = logging.getLogger("nlbench")


class RunFolder:
    """Everything is written atomically. Write only while `locked()` is held."""

    def __init__(self, path: str | Path):
        self.path = Path(path)
        self._holding = contextlib.ExitStack()
        self._held: lock.Held | None = None
        self._experiment: str | None = None
        self._written: dict[str, str] = {}

    @contextlib.contextmanager
    def locked(self) -> Iterator[RunFolder]:
        """Hold the folder alone and sweep what a dead process left; `LockedError` if a live one holds it."""
        with self._holding:
            self._hold()
            yield self

    def _hold(self) -> None:
        self._held = self._holding.enter_context(lock.exclusive(self.path / LOCK))
        for folder in (self.path, *(self.path / name for name in (BATCHES, TABLES, "figures"))):
            sweep(folder)

    def _removed(self) -> bool:
        """Whether somebody removed or replaced the folder that is held."""
        return self._held is not None and not self._held.in_place()

    def save_checkpoint(self, arrays: Mapping[str, np.ndarray], **facts: Any) -> None:
        """Replace the checkpoint; in a new folder if somebody removed the one that was held."""
        from nlbench.results.checkpoint import save_checkpoint

        if self._removed():
            log.warning("%s was removed while the run was using it; it is made anew", self.path)
            self._holding.close()
            self._hold()
            self.reopen()
            if self._experiment is not None:
                self.write_experiment(self._experiment)
        save_checkpoint(self.path / CHECKPOINT, arrays, facts)

    def load_checkpoint(self) -> tuple[dict[str, np.ndarray], dict[str, Any]] | None:
        """Arrays and facts of the checkpoint, None if there is none. Raises `DamagedResults`."""
        from nlbench.results.checkpoint import load_checkpoint

        path = self.path / CHECKPOINT
        return load_checkpoint(path) if path.exists() else None

    def write_experiment(self, text: str) -> None:
        """Write the resolved experiment."""
        self._experiment = text
        atomic_write(self.path / EXPERIMENT, text.encode())

    def write_tables(self, tables: Mapping[str, pd.DataFrame]) -> None:
        """Write tables, each as CSV and Parquet."""
        from nlbench.results.tables import write_table

        self._check()
        for name, table in tables.items():
            written = write_table(self.path / TABLES, name, table)
            self._written |= {f"{TABLES}/{file}": checksum for file, checksum in written.items()}

    def finish(self, runs: int, tables: Iterable[str] = (), **facts: Any) -> None:
        """Write the manifest, with checksums of the run's files, and the mark that `runs` are done.

        tables: files of tables that were there before and stay, as the manifest names them. Raises `EnvironmentFault`
        where a table is not as it was written a moment ago.
        """
        from nlbench.results.manifest import write_manifest

        self._check()
        names = [EXPERIMENT, CHECKPOINT, *sorted({*self._written, *tables})]
        try:
            there = [name for name in names if (self.path / name).exists()]
            checksums = {name: of_bytes((self.path / name).read_bytes()) for name in there}
        except OSError as error:
            raise EnvironmentFault(f"{error.filename}: cannot be read ({error.strerror})") from error
        for name, checksum in self._written.items():
            if checksums.get(name) != checksum:
                raise EnvironmentFault(
                    f"{self.path / name} was removed or changed while the run was writing: give the same command again"
                )
        write_manifest(self.path / MANIFEST, {**facts, "runs": runs, "checksums": checksums})
        atomic_write(self.path / DONE, f"{runs}\n".encode())

    def check_finished(self) -> None:
        """Raise `EnvironmentFault` where a run was begun here and not finished."""
        if self.done_runs() is None and (self.path / BATCHES).is_dir():
            raise EnvironmentFault(
                f"{self.path}: the run is not finished; the command that began it goes on with it"
            )

    def _check(self) -> None:
        """Raise `EnvironmentFault` where the folder is no longer the one that is held."""
        if self._removed():
            raise EnvironmentFault(
                f"{self.path} was removed or replaced while the run was writing its tables: give the same command again"
            )

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
