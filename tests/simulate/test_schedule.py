"""Claim: a schedule cuts a run into equal steps; measurements and outputs fall on the ends of segments."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from nlbench.schedule import make

STEPS = st.sampled_from([0.02, 0.05, 0.1, 1 / 3, 50.0])


@settings(max_examples=100, deadline=None, derandomize=True)
@given(STEPS, st.integers(1, 12), st.integers(1, 12), st.integers(1, 8))
def test_measurements_and_outputs_fall_on_ends_of_segments(step, output, interval, outputs):
    """output and interval in steps; the run is `outputs` outputs long, or longer to hold one measurement."""
    end = output * outputs
    schedule = make(end * step, step, output * step, interval * step)
    times = np.array(schedule.segment_times)
    assert schedule.outputs == outputs
    assert schedule.measurements == end // interval
    np.testing.assert_allclose(times[-1], end * step, rtol=1e-12)
    np.testing.assert_allclose(
        times[schedule.output_every :: schedule.output_every],
        step * output * np.arange(1, outputs + 1),
        rtol=1e-12,
    )
    np.testing.assert_allclose(
        schedule.measurement_times, step * interval * np.arange(1, end // interval + 1), rtol=1e-12
    )


def test_segments_are_as_long_as_they_can_be():
    schedule = make(2.0, 0.02, 0.1, 0.5)
    assert (schedule.segment_steps, schedule.segments) == (5, 20)
    assert (schedule.measured_every, schedule.output_every) == (5, 1)


def test_without_an_interval_nothing_is_measured():
    schedule = make(2.0, 0.02, 0.1, None)
    assert (schedule.measurements, schedule.measured_every, schedule.measurement_times) == (0, 0, ())
    assert schedule.segment_steps == 5
