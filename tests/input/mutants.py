"""Experiment files spoiled at random, from all of `configs/`, and what `nlbench validate` answers to them.

`python -m tests.input.mutants [COUNT] [SEED]` tries so many and prints what came of them.
"""

# ruff: noqa: T201 - also a script, which prints what it found
from __future__ import annotations

import collections
import random
import sys
import tempfile
from pathlib import Path

from tests.input.answers import Answer, answer, faults
from tests.input.spoiling import TEXTS, spoiled

CONFIGS = sorted(Path("configs").rglob("*.yaml"))


def mutant(number: int, seed: int = 1969) -> bytes:
    """A file spoiled one to four times; the same for the same numbers."""
    chance = random.Random(f"{seed}/{number}")
    return spoiled(chance, chance.choice(CONFIGS).read_text(), (*TEXTS, _key))


def wrong(path: Path, given: Answer, folder: list[str]) -> list[str]:
    """What is wrong with the answer of `validate`; `folder` is what lay beside the file before."""
    written = sorted(each.name for each in path.parent.iterdir()) != folder
    return faults(given, (0, 2), path.name) + ["another file"] * written


def _key(chance: random.Random, text: str) -> str:
    """A key more, at the top or in front of a line; two documents; a bomb of aliases."""
    bomb = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"{after}: &{after} [{', '.join([f'*{before}'] * 9)}]\n"
        for before, after in zip("abcdefgh", "bcdefghi", strict=True)
    )
    keys = [
        "seed: 1",
        "runs: 5",
        "plugins: [x.py]",
        "a: &a [*a]",
        "<<: *a",
        "<<: {a: 1}",
        "---",
        "...",
        "%YAML 1.1",
        bomb,
    ]
    more = f"{chance.choice(keys)}\n"
    return more + text if chance.random() < 0.5 else f"{text}\n{more}"


def main(count: int, seed: int) -> int:
    """Try so many; print how many were valid, refused and answered wrongly, the slowest and the longest answer."""
    codes: collections.Counter[int] = collections.Counter()
    count_wrong = 0
    slowest, longest = 0.0, 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mutant.yaml"
        for number in range(count):
            path.write_bytes(mutant(number, seed))
            given = answer("validate", path)
            codes[given.code] += 1
            slowest, longest = max(slowest, given.seconds), max(longest, len(given.said))
            if found := wrong(path, given, [path.name]):
                count_wrong += 1
                print(f"mutant {number}: {', '.join(found)}: {given.said[-300:]!r}")
    print(
        f"{count:,} mutants of {len(CONFIGS)} files: {codes[0]:,} valid, {codes[2]:,} refused, {count_wrong:,} wrong"
    )
    print(f"slowest answer {slowest:.2f} s, longest {longest:,} characters")
    return 1 if count_wrong else 0


if __name__ == "__main__":
    sys.exit(main(*(int(each) for each in (*sys.argv[1:], *("10000", "1969")[len(sys.argv) - 1 :]))))
