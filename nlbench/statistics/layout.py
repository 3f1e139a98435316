"""The names and sizes that statistics need to know about an experiment (free of jax and numpy)."""

import itertools
import math
from typing import NamedTuple

GROUPS = 64  # block b belongs to group b mod 64; the groups are what the jackknife deletes


class Layout(NamedTuple):
    """What the axes of the sums mean.

    `times` includes t = 0; `reports` are indices into `times`. `clip` is the value at which |error| is
    capped in clipped statistics (infinite = never; a diverged run then counts as infinite). `norms` names
    Euclidean norms over some coordinates; coordinates and norms together are the *magnitudes*. `scores`:
    whether filters are scored by how they foretold the measurements.
    """

    filters: tuple[str, ...]
    times: tuple[float, ...]
    reports: tuple[int, ...]
    coordinates: tuple[str, ...]
    units: tuple[str, ...]
    clip: tuple[float, ...]
    norms: dict[str, tuple[int, ...]]
    keep_runs: int
    scores: bool = True

    @property
    def report_times(self) -> tuple[float, ...]:
        return tuple(self.times[r] for r in self.reports)

    @property
    def magnitudes(self) -> tuple[str, ...]:
        return self.coordinates + tuple(self.norms)

    @property
    def magnitude_clip(self) -> tuple[float, ...]:
        """The clip of every magnitude; that of a norm is the norm of its coordinates' clips."""
        return self.clip + tuple(
            math.hypot(*(self.clip[i] for i in members)) for members in self.norms.values()
        )

    @property
    def scale(self) -> tuple[float, ...]:
        """The unit in which every magnitude is summed, so that sixth powers neither over- nor underflow."""
        return tuple(c if math.isfinite(c) and c > 0 else 1.0 for c in self.magnitude_clip)

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """All pairs of filters a < b, in file order."""
        return tuple(itertools.combinations(range(len(self.filters)), 2))

    @property
    def magnitude_units(self) -> dict[str, str]:
        """The unit of every magnitude; a norm over different units has none."""
        norms = {
            name: self.units[members[0]] if len({self.units[i] for i in members}) == 1 else ""
            for name, members in self.norms.items()
        }
        return {**dict(zip(self.coordinates, self.units, strict=True)), **norms}

    def components(self, order: int) -> tuple[tuple[int, ...], ...]:
        """The unique components of a symmetric tensor over the coordinates, as sorted indices."""
        return tuple(itertools.combinations_with_replacement(range(len(self.coordinates)), order))
