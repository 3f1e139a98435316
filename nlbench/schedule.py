"""When things happen: integration steps grouped into segments, at whose ends measurements and outputs fall."""

from __future__ import annotations

import math
from typing import NamedTuple

MOST_STEPS = 10**9  # of a run, or along recorded data


class Schedule(NamedTuple):
    """A segment is the longest stretch of steps without a measurement or an output inside.

    step: integration step; in discrete time 1, an integer, as then all times are: the numbers of the steps.
    segment_steps: steps in a segment. segments: number of segments.
    measured_every: segments between measurements (0: none). output_every: segments between outputs.
    sightings: how many measurements can be made that wait for an angle, at the end of any segment (0: none).
    continuous: whether measurements are continuous: every step is a segment, and has one at its start.
    """

    step: float
    segment_steps: int
    segments: int
    measured_every: int
    output_every: int
    sightings: int = 0
    continuous: bool = False

    @property
    def measurements(self) -> int:
        """Number of measurements at fixed times; the first comes one interval after the start, or at once."""
        return self.segments // self.measured_every if self.measured_every else 0

    @property
    def outputs(self) -> int:
        """Number of outputs after the one at the start."""
        return self.segments // self.output_every

    @property
    def segment_times(self) -> tuple[float, ...]:
        """Ends of the segments, the start first."""
        return tuple(self.step * self.segment_steps * i for i in range(self.segments + 1))

    @property
    def measurement_times(self) -> tuple[float, ...]:
        """Times of the measurements."""
        if self.continuous:
            return self.segment_times[:-1]
        return self.segment_times[self.measured_every :: self.measured_every] if self.measured_every else ()


def make(
    end: float,
    step: float,
    output: float,
    interval: float | None,
    sightings: int = 0,
    continuous: bool = False,
) -> Schedule:
    """The schedule of a run; `interval` None means no measurements at fixed times.

    With sightings every step is a segment, so that one can be made after each; so it is with continuous measurements,
    which have no interval.

    end and output are multiples of step and end one of output, as validated experiments are; an interval longer than
    the run means that none is taken.
    """
    output_steps = round(output / step)
    interval_steps = round(interval / step) if interval is not None else 0
    segment = 1 if sightings else math.gcd(output_steps, interval_steps)
    total = round(end / output) * output_steps
    if continuous:
        return Schedule(step, 1, total, 1, output_steps, continuous=True)
    if interval_steps > total:
        interval_steps, segment = 0, output_steps
    return Schedule(
        step, segment, total // segment, interval_steps // segment, output_steps // segment, sightings
    )
