"""A source of two figures and a table, with experiments of few runs, for the tests of the reproduction.

`python -m tests.small_source ARGUMENTS` is the command line with this source in the place of the package's own.
"""

from __future__ import annotations

from pathlib import Path

from nlbench.reproduce import documents
from nlbench.reproduce.documents import Comparison, Error, Item, Source

EXPERIMENT = """# Does the {name} experiment work?
experiment: {name}
system: {{name: culver-scalar, interval: 0.1}}
filters: [linearised-kalman, third-order]
time: {{end: 0.4, step: 0.02, output: 0.1}}
monte_carlo: {{runs: {runs}, seed: 3}}
source: {{document: small-1970, figures: ["1", "2"], runs: 10}}
claims:
  - {{id: C1, says: they are alike, where: page 1, statistic: rms, equal: [third-order, linearised-kalman], within: 0.9,
     figures: ["1"]}}
  - {{id: C2, says: errors are small, where: page 2, statistic: rms, of: [third-order], below: {below}, figures: ["2"]}}
"""
ENTRIES = (
    Item(figure="1", caption="Right", experiments=("small-a",), pictures=("rms-x", "trace-0")),
    Item(figure="2", caption="Wrong", experiments=("small-a", "small-b"), pictures=("rms-x",)),
    Item(figure="3", caption="A diagram", reason="a diagram without data"),
    Item(table="1", caption="Storage", check="moment-storage"),
)
ERROR = Error(
    document="culver-1969",
    number="C1",
    equation="(1)",
    printed="this",
    right="that",
    consequence="a little",
    effects=(
        Comparison(
            experiment="small-a", printed="linearised-kalman", corrected="third-order", statistic="rms"
        ),
    ),
)


def write(folder: Path, runs: int = 300, below: float = 0.01) -> Path:
    """The experiment files, in a new folder. C2 is right if `below` is large."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("small-a", "small-b"):
        text = EXPERIMENT.format(name=name, runs=runs, below=below)
        (folder / f"{name}.yaml").write_text(text)
    return folder


SOURCE = Source(name="small-1970", title="Small things", citation="A. Author, 1970", entries=ENTRIES)


def install() -> None:
    """Put the source in the place of the package's own."""
    documents.NAMES = ("small-1970",)
    documents.source = lambda name: SOURCE
    documents.errors = lambda: (ERROR.model_copy(update={"document": "small-1970"}),)


if __name__ == "__main__":
    from nlbench.cli import main

    install()
    main()
