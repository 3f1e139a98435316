"""Whether a finished run still is what it wrote, and whether its numbers come out again to the last bit.

Three checks, each of which needs the one before:
  (1) every file of the manifest is there and has its checksum, the marks agree, and nothing else lies among them;
  (2) one block, with all others of its group, computed again gives the sums of that group in the checkpoint and the
      errors kept of its runs, bit for bit;
  (3) the tables made again from the checkpoint, and a last partial block computed again, are those of the run.
A block b belongs to group b mod 64, and the checkpoint has sums per group, so (2) costs a 64th of the run at most.
"""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nlbench import runtime, systems
from nlbench.engine.compiled import compile_chunks
from nlbench.engine.finish import of_totals
from nlbench.engine.memory import memory_faults
from nlbench.engine.problem import make
from nlbench.engine.resume import numerics
from nlbench.errors import ConfigError
from nlbench.results.fingerprint import differences
from nlbench.results.folder import RunFolder
from nlbench.results.manifest import versions
from nlbench.results.tables import parquet_bytes, read_parquet
from nlbench.statistics.kept import Reported
from nlbench.statistics.layout import GROUPS
from nlbench.statistics.totals import Totals

if TYPE_CHECKING:
    from nlbench.engine.compiled import Compiled
    from nlbench.results.results import Results

KEPT = tuple(f"kept_{name}" for name in Reported._fields)
MAKERS = ("numpy", "scipy", "pandas")  # of tables from totals; other versions may add in another order


class Verified(NamedTuple):
    """What was found: `faults` has a line for each thing that is wrong.

    files: with a checksum. block: the one chosen, None where nothing was computed. same: whether its numbers and the
    tables are the same bit for bit, None as before. recomputed: blocks. tables: made again. remarks: what explains it.
    """

    files: int
    block: int | None = None
    same: bool | None = None
    recomputed: int = 0
    tables: int = 0
    remarks: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()


def verify(results: Results, block: int | None = None) -> Verified:
    """Check a run. block: which to compute again, a random one unless said. Writes nothing.

    Raises `ConfigError` for a block that the run does not have, `EnvironmentFault` where the run was not finished.
    """
    RunFolder(results.path).check_finished()
    if faults := results.damaged():
        return Verified(0, faults=tuple(faults))
    faults = results.unknown()
    files = len(results.manifest["checksums"])
    runs, size = results.manifest["runs"], results.manifest["block"]
    blocks = -(-runs // size)
    if block is not None and not 0 <= block < blocks:
        raise ConfigError(f"--block: got {block}; the run has blocks 0 to {blocks - 1}")
    saved = RunFolder(results.path).load_checkpoint()
    if results.experiment.system.name == systems.OWN:
        remark = "its system exists in Python only, so nothing could be computed again"
        return Verified(files, remarks=(remark,), faults=tuple(faults))
    if saved is None:  # fewer runs than a block
        block = 0
    elif block is None:
        block = random.randrange(runs // size)
    with memory_faults():
        return _recomputed(results, saved, block, files, faults)


def _recomputed(
    results: Results,
    saved: tuple[dict[str, np.ndarray], dict[str, Any]] | None,
    block: int,
    files: int,
    faults: list[str],
) -> Verified:
    """Checks (2) and (3), where the files are sound."""
    experiment, runs = results.experiment, results.manifest["runs"]
    runtime.configure(precision=experiment.engine.precision, threads=experiment.engine.threads)
    problem = make(experiment)
    compiled = compile_chunks(problem, experiment.monte_carlo.seed)
    totals = Totals(problem.layout)
    if saved is not None:
        totals = Totals.from_state(problem.layout, saved[0])
    if totals.blocks != runs // problem.block:
        faults.append(f"{results.path}: the checkpoint has {totals.runs:,} of {runs:,} runs")
        return Verified(files, faults=tuple(faults))
    other = _other_software(compiled, results)
    found: list[str] = []
    recomputed = 0
    if block < totals.blocks:
        found, recomputed = _block_differences(compiled, totals, block, runs)
    if runs > totals.runs:
        totals.add(totals.blocks, compiled.sums(totals.blocks, 1, runs))
        recomputed += 1
    made = of_totals(problem, totals)
    found += [
        f"table {name}: made again from the sums, it is another one"
        for name, table in made.items()
        if parquet_bytes(read_parquet(parquet_bytes(table))) != parquet_bytes(results.table(name))
    ]
    if other:
        why = f"digits may differ, since this is other software or hardware: {'; '.join(other)}"
        remarks = (why, *found)
    else:
        remarks = ()
        faults += [f"{results.path}: {each}" for each in found]
    return Verified(files, block, not found, recomputed, len(made), remarks, tuple(faults))


def _other_software(compiled: Compiled, results: Results) -> list[str]:
    """What decides digits and is not as it was when the run was made, a line each."""
    now, then = (
        {name: made.get(name, "") for name in MAKERS} for made in (versions(), results.manifest["versions"])
    )
    return differences(numerics(compiled), results.manifest["fingerprint"]) + differences(now, then)


def _block_differences(compiled: Compiled, totals: Totals, block: int, runs: int) -> tuple[list[str], int]:
    """What of the block's group is not in the totals bit for bit, and how many blocks were computed for it."""
    size, group = compiled.problem.block, block % GROUPS
    state = totals.state()
    state |= {"counters": np.zeros(3, np.int64)} | {name: state[name][..., :0] for name in KEPT}
    again = Totals.from_state(totals.layout, state)
    again.groups = {}
    numbers = range(group, totals.blocks, GROUPS)
    kept = {name: getattr(totals.kept.runs, name) for name in Reported._fields}
    found = []
    for number in numbers:
        sums = compiled.sums(number, 1, runs)
        there = np.arange(number * size, min((number + 1) * size, totals.kept.count))
        for name, values in kept.items():
            mine = sums[f"report_{name}"][0][..., : len(there)]
            if mine.astype(values.dtype).tobytes() != values[..., there].tobytes():
                found.append(f"block {number}: {name} of its runs, computed again, is not what was kept")
        again.blocks = number
        again.add(number, sums)
    for name, values in totals.groups.items():
        if again.groups[name][group].tobytes() != values[group].tobytes():
            found.append(f"block {block}: {name} of its group, computed again, is not what was added up")
    return found, len(numbers)
