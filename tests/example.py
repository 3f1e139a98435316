"""A valid experiment file, which tests of configuration and command line spoil one thing at a time."""

from __future__ import annotations

from pathlib import Path

VALID = """\
# Does carrying the third moment pay when measurements arrive?
experiment: culver/hermite-01
system: {name: culver-scalar, ensemble: matched, measurement: linear, interval: 0.1}
filters:
  - linearised-kalman
  - {name: third-order, limiter: 3, label: third 3 sigma}
  - third-order-guarded
reference: exact
time: {end: 2.0, step: 0.02, output: 0.1}
report_times: [0.5, 1.0, 1.5, 2.0]
monte_carlo: {runs: 20_000, seed: 1969}
source: {document: culver-1969, figures: ["7.18", "7.19"], runs: 80}
claims:
  - id: C1
    says: the optimal third order surpasses the others
    statistic: rms_clipped
    less: [third-order-guarded, linearised-kalman]
    at: [1.0, 2.0]
"""


def spoiled(old: str, new: str) -> str:
    """The valid file with one piece replaced, which must be there exactly once."""
    assert VALID.count(old) == 1, old
    return VALID.replace(old, new)


def written(folder: Path, text: str | bytes, name: str = "fig.yaml") -> Path:
    """The text in a file of the folder."""
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path
