"""A finished run, read from its folder; every file is checked against the manifest before it is believed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nlbench.errors import DamagedResults
from nlbench.results import checksum
from nlbench.results.atomic import is_partial
from nlbench.results.folder import BATCHES, DONE, EXPERIMENT, MANIFEST, TABLES, RunFolder

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.config import Experiment


class Results:
    """`results.table("statistics")`, `results.manifest`, `results.experiment`, `results.path`."""

    def __init__(self, path: str | Path):
        self.path = Path(path)

    def __repr__(self) -> str:
        return f"Results({str(self.path)!r})"

    @cached_property
    def manifest(self) -> dict[str, Any]:
        """Versions, seed, times, units and checksums."""
        from nlbench.results.manifest import read_manifest

        return read_manifest(self.path / MANIFEST)

    @cached_property
    def experiment(self) -> Experiment:
        """The experiment with all its defaults filled in."""
        from nlbench.config import load

        self._checked(EXPERIMENT)
        return load(self.path / EXPERIMENT, recorded=True)

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of the tables that there are."""
        files = (Path(name) for name in self.manifest["checksums"])
        return tuple(file.stem for file in files if str(file.parent) == TABLES and file.suffix == ".parquet")

    def table(self, name: str) -> pd.DataFrame:
        """A table by name. Raises `DamagedResults` if its file is not the one that the run wrote."""
        from nlbench.results.tables import read_parquet

        if name not in self.tables:
            raise KeyError(f"{self.path} has no table '{name}'; it has {', '.join(self.tables)}")
        return read_parquet(self._checked(f"{TABLES}/{name}.parquet"))

    def damaged(self) -> list[str]:
        """What is wrong with each file that is missing or was changed since the run wrote it."""
        found = []
        try:
            names = list(self.manifest["checksums"])
        except DamagedResults as error:
            return [str(error)]
        checks: list[Callable[[], object]] = [self.check_done]
        checks += [partial(self._checked, name) for name in names]
        for check in checks:
            try:
                check()
            except DamagedResults as error:
                found.append(str(error))
        return found

    def unknown(self) -> list[str]:
        """Files among the tables and batches that the run did not write."""
        found = sorted(path for folder in (BATCHES, TABLES) for path in (self.path / folder).rglob("*"))
        names = {str(path.relative_to(self.path)): path for path in found if path.is_file()}
        known = self.manifest["checksums"]
        return [
            f"{path}: the run did not write this file; remove it"
            for name, path in names.items()
            if name not in known and not is_partial(path)
        ]

    def check_done(self) -> None:
        """Raise `DamagedResults` where the mark that the run is done does not say what a sound manifest says."""
        done = RunFolder(self.path).done_runs()
        try:
            runs = self.manifest["runs"]
        except DamagedResults:
            return
        if done is not None and done != runs:
            raise DamagedResults(
                f"{self.path / DONE}: says {done:,} runs, the manifest {runs:,}; it was edited"
            )

    def _checked(self, name: str) -> bytes:
        path = self.path / name
        try:
            data = path.read_bytes()
        except OSError as error:
            raise DamagedResults(f"{path}: cannot be read ({error.strerror})") from error
        if checksum.of_bytes(data) != self.manifest["checksums"].get(name):
            raise DamagedResults(
                f"{path}: the checksum is not that of the manifest; the file is damaged or edited"
            )
        return data
