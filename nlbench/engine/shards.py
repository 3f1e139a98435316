"""Shards: a run in parts that know nothing of each other, and the run made of them, bit for bit that of one machine.

Shard i of n computes the blocks of its groups (`statistics.share`) and keeps their totals in a folder of its own inside
the run's, DIR/<experiment>/<hash>/shards/i-of-n. Merging makes the run's checkpoint of them; the rest, a last partial
block included, is what `run` does with a checkpoint.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from nlbench import runtime
from nlbench.engine import driver
from nlbench.engine.compiled import CAPACITY, Compiled, compile_chunks
from nlbench.engine.interruption import stop_requests
from nlbench.engine.memory import memory_faults
from nlbench.engine.problem import make
from nlbench.engine.resume import loaded, resumed, save
from nlbench.engine.workers import Threads
from nlbench.errors import ConfigError, EnvironmentFault
from nlbench.results.folder import CHECKPOINT, RunFolder
from nlbench.statistics.joined import joined
from nlbench.statistics.layout import GROUPS
from nlbench.statistics.share import Share
from nlbench.statistics.totals import Totals

if TYPE_CHECKING:
    from nlbench.config import Experiment
    from nlbench.results.results import Results

SHARDS = "shards"


class Done(NamedTuple):
    """Which share a shard is, its folder, and how many runs it has of how many that the experiment asks for in all."""

    share: Share
    folder: Path
    runs: int
    total: int


def run_shard(
    experiment: Experiment,
    number: int,
    of: int,
    out: str | Path,
    progress: Callable[[int, int], None] | None = None,
    check: driver.Check | None = None,
) -> Done:
    """Compute what is missing of shard `number` (from 1) and keep its totals. Raises what `run` raises.

    check: may raise before anything is computed.
    """
    share = Share(number - 1, of)
    runs, block = experiment.monte_carlo.runs, experiment.engine.block
    with stop_requests() as stopped, memory_faults():
        compiled = compile_chunks(make(experiment), experiment.monte_carlo.seed)
        folder = RunFolder(experiment.folder(out) / _name(share))
        with folder.locked():
            totals = resumed(folder, compiled)
            threads = experiment.engine.threads or runtime.threads()
            mine = max(totals.blocks, share.count(runs // block)) * block
            if check is not None:
                check(compiled, totals, mine, threads, folder.path)
            folder.write_experiment(experiment.resolved_yaml())
            if totals.blocks == 0:
                totals = _begun(compiled, share, runs)
                save(folder, compiled, totals)
            dealt = compiled._replace(share=share)
            with Threads(dealt, runs=_end(share, mine // block) * block, threads=threads) as workers:
                totals = driver.compute(
                    dealt,
                    folder,
                    totals,
                    mine,
                    workers,
                    experiment.engine.chunk or CAPACITY,
                    progress or (lambda done, total: None),
                    stopped,
                )
    return Done(share, folder.path, totals.runs, runs)


def _begun(compiled: Compiled, share: Share, runs: int) -> Totals:
    """Totals of nothing, about the pivot of all shares, for which each computes block 0."""
    block = compiled.problem.block
    totals = Totals(compiled.problem.layout, share, block)
    if runs >= block:
        totals.centre(compiled.sums(0, 1, block))
    return totals


def merge(
    experiment: Experiment,
    sources: Sequence[str | Path],
    out: str | Path,
    progress: Callable[[int, int], None] | None = None,
) -> Results:
    """The run that all shards make, finished as `run` does. sources: the `out` of the shards.

    Raises `ConfigError` where a shard is missing, incomplete or there twice, `DamagedResults` where one is damaged, and
    `EnvironmentFault` where one was computed with other software or hardware.
    """
    with memory_faults():
        _join(experiment, sources, out)
    return driver.run(experiment, None, out, progress)


def _join(experiment: Experiment, sources: Sequence[str | Path], out: str | Path) -> None:
    """Make the checkpoint of the run from those of all shards."""
    block = experiment.engine.block
    found = _found(experiment, sources)
    compiled = compile_chunks(make(experiment), experiment.monte_carlo.seed)
    parts = {share: _loaded(path, compiled) for share, path in found.items()}
    whole = max(
        experiment.monte_carlo.runs // block, *(_end(share, part.blocks) for share, part in parts.items())
    )
    short = [
        f"{found[share]}: {part.runs:,} of {share.count(whole) * block:,} runs"
        for share, part in parts.items()
        if part.blocks < share.count(whole)
    ]
    if short:
        raise ConfigError(
            "\n".join([*short, "merge needs complete shards: give the commands of these again first"])
        )
    try:
        totals = joined(compiled.problem.layout, list(parts.values()), block)
    except ValueError as fault:
        raise EnvironmentFault(f"{', '.join(map(str, found.values()))}: {fault}") from fault
    folder = RunFolder(experiment.folder(out))
    with folder.locked():
        if resumed(folder, compiled).blocks < totals.blocks:
            folder.reopen()
            save(folder, compiled, totals)


def _loaded(path: Path, compiled: Compiled) -> Totals:
    """Totals of a shard that fit the program here."""
    totals = loaded(
        RunFolder(path),
        compiled,
        "merge where all is as it was there, and compute all shards on machines of one kind",
    )
    if totals is None:
        raise ConfigError(f"{path}: the shard's checkpoint was removed; give its command again")
    return totals


def _found(experiment: Experiment, sources: Sequence[str | Path]) -> dict[Share, Path]:
    """The folder of each shard of one division. Raises `ConfigError` naming those that are missing or there twice."""
    places: dict[Share, list[Path]] = {}
    homes = dict.fromkeys(experiment.folder(source).resolve() for source in sources)
    for home in homes:
        for path in sorted((home / SHARDS).glob(f"*/{CHECKPOINT}")):
            if share := _share(path.parents[1].name):
                places.setdefault(share, []).append(path.parents[1])
    if not places:
        raise ConfigError(
            f"no shards of this experiment in {', '.join(str(home / SHARDS) for home in homes)}: give the --out "
            "of the shards with --from, and the same --seed and --set"
        )
    divisions = sorted({share.of for share in places})
    if len(divisions) > 1:
        raise ConfigError(
            f"shards of several divisions (of {', of '.join(map(str, divisions))}): leave those of one"
        )
    missing = [str(number + 1) for number in range(divisions[0]) if Share(number, divisions[0]) not in places]
    twice = [f"there twice: {' and '.join(map(str, at))}" for at in places.values() if len(at) > 1]
    if missing:
        twice.insert(0, f"missing: shard {', '.join(missing)} of {divisions[0]}")
    if twice:
        raise ConfigError("\n".join(twice))
    return {share: places[share][0] for share in sorted(places)}


def _name(share: Share) -> str:
    return f"{SHARDS}/{share.number + 1}-of-{share.of}"


def _share(name: str) -> Share | None:
    """The share whose folder has this name; None for another folder."""
    given = re.fullmatch(r"([0-9]{1,2})-of-([0-9]{1,2})", name)
    if given is None or not 1 <= int(given[1]) <= int(given[2]) <= GROUPS:
        return None
    return Share(int(given[1]) - 1, int(given[2]))


def _end(share: Share, count: int) -> int:
    """How many blocks of the run there must be for the share to have `count`."""
    return int(share.blocks(count - 1, 1)[0]) + 1 if count else 0
