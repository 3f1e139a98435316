"""Claim: `filter_data` takes times with a unit and gaps in any form, and refuses in a line what cannot be meant."""

from __future__ import annotations

import datetime as dt
import math
import warnings
from decimal import Decimal
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import nlbench as nb
from nlbench.errors import ConfigError
from nlbench.samples import read_samples

SECONDS = [0.5, 1.0, 2.25]
Y = [[1.0], [0.5], [0.25]]
EAST = dt.timezone(dt.timedelta(hours=1))
STAMP = np.datetime64("2026-03-01T12:00:00.000000000")
STAMPS = STAMP + (1e9 * np.array(SECONDS)).astype("timedelta64[ns]")


def made(discrete=False, m=1, step=0.1, interval=0.5):
    """What is looked at of a filter: the size and the pace of its system."""
    cov, start = np.eye(m), nb.Moments(np.zeros(m), np.eye(m))
    if discrete:
        system = nb.DiscreteSystem(lambda k, x, w: x + w, lambda k, x, v: x + v, cov, cov, start)
    else:
        system = nb.System(lambda t, x: -x, lambda t, x: x, cov, start, interval=interval)
    return SimpleNamespace(name="ekf", system=system, step=1.0 if discrete else step)


def read(times, y=None, t0=0, **f):
    y = [[1.0]] * len(times) if y is None else y
    return read_samples(made(**f), times, y, t0)


@pytest.mark.parametrize(
    "times",
    [
        np.array([500, 1000, 2250], "timedelta64[ms]"),
        np.array([500_000_000, 1_000_000_000, 2_250_000_000], "timedelta64[ns]"),
        pd.to_timedelta(SECONDS, unit="s"),
        pd.Series(pd.to_timedelta(SECONDS, unit="s"), index=[7, 8, 9]),
        [dt.timedelta(seconds=each) for each in SECONDS],
        [pd.Timedelta(each, "s") for each in SECONDS],
        [Decimal("0.5"), 1, np.float32(2.25)],
        pd.array(SECONDS, dtype="Float64"),
        np.ma.masked_array(SECONDS, [False] * 3),
    ],
    ids=lambda times: type(times).__name__,
)
def test_times_with_a_unit_are_seconds(times):
    np.testing.assert_array_equal(read(times).times, SECONDS)
    np.testing.assert_array_equal(read(times, t0=dt.timedelta(milliseconds=250)).start, 0.25)


@pytest.mark.parametrize(
    ("times", "t0"),
    [
        (STAMPS, STAMP),
        (STAMPS, pd.Timestamp(STAMP)),
        (STAMPS.astype("datetime64[ms]"), dt.datetime(2026, 3, 1, 12)),
        (pd.Series(STAMPS, index=[3, 2, 1]), STAMP),
        ([pd.Timestamp(each) for each in STAMPS], STAMP),
        (pd.DatetimeIndex(STAMPS, tz="UTC").tz_convert("Asia/Tokyo"), pd.Timestamp(STAMP, tz="UTC")),
        (list(pd.DatetimeIndex(STAMPS, tz="UTC")), dt.datetime(2026, 3, 1, 13, tzinfo=EAST)),
    ],
)  # fmt: skip
def test_dates_are_seconds_from_the_start(times, t0):
    found = read(times, t0=t0)
    np.testing.assert_allclose(found.times, SECONDS, rtol=1e-15)
    assert found.start == 0.0


def test_a_start_at_the_first_date_is_at_once():
    np.testing.assert_array_equal(read(STAMPS, t0=STAMPS[0]).times, np.array(SECONDS) - SECONDS[0])


@pytest.mark.parametrize(
    ("y", "expected"),
    [
        (np.ma.masked_array([[1.0], [99.0], [3.0]], [[0], [1], [0]]), [1, np.nan, 3]),
        (np.ma.masked_array([1, 99, 3], [0, 1, 0]), [1, np.nan, 3]),
        (np.ma.masked_array(np.array([1, "x", 3], object), [0, 1, 0]), [1, np.nan, 3]),
        (np.ma.masked_array([1.0, np.inf, 3.0], [0, 1, 0]), [1, np.nan, 3]),
        (np.ma.masked_equal([1.0, -999.0, 3.0], -999.0), [1, np.nan, 3]),
        ([1, None, 3], [1, np.nan, 3]),
        (pd.Series([1, None, 3], dtype="Int64"), [1, np.nan, 3]),
        (pd.DataFrame({"y": [1.0, np.nan, 3.0]}), [1, np.nan, 3]),
        ([Decimal(1), np.nan, 3], [1, np.nan, 3]),
        (np.array([1, 2, 3], np.uint8), [1, 2, 3]),
    ],
)
def test_masked_none_and_nan_are_not_measured(y, expected):
    np.testing.assert_array_equal(read(SECONDS, y).y[:, 0], expected)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"times": np.ma.masked_array([0.5, 1.0, 2.0], [0, 1, 0])}, "times: row 1 is masked; leave out rows"),
        ({"times": [0.5, np.nan, 2.0]}, "times: must be finite, found nan in row 1"),
        ({"times": [0.5, None, 2.0]}, "times: must be finite, found nan in row 1"),
        ({"times": np.array([500, "NaT", 900], "timedelta64[ms]")}, "times: must be finite, found nan in row 1"),
        ({"times": np.array([1, 2, 3], "timedelta64[M]")}, r"times: timedelta64\[M\] has no length in seconds"),
        ({"times": STAMPS}, r"t0: times are dates, .* found nothing; t0=times\[0\] starts at the first row"),
        ({"times": STAMPS, "t0": 5.0}, r"t0: times are dates, .* found 5\.0"),
        ({"times": SECONDS, "t0": STAMP}, "t0: expected numbers, found dates"),
        ({"times": SECONDS, "t0": math.nan}, "t0: must be finite, found nan$"),
        ({"times": ["0.5", "1", "2"]}, "times: expected numbers, found text"),
        ({"times": [True, True, True]}, "times: expected numbers, found truth values"),
        ({"times": [0.5, "1", dt.date(2026, 3, 1)]}, "times: expected numbers, found text|found '1' in row 1"),
        ({"times": [1j, 2, 3]}, "times: expected numbers, found complex numbers"),
        ({"times": np.array([2**60, 2**60 + 1, 2**60 + 2]), "t0": 2**60}, "one number in double precision"),
        ({"times": SECONDS, "y": [[1.0], [-np.inf], [2.0]]}, "y: -inf in row 1, column 0; NaN means not measured"),
        ({"times": SECONDS, "y": [True, False, True]}, r"y: expected numbers, found truth values; astype\(float\)"),
        ({"times": SECONDS, "y": ["1", "2", "3"]}, "y: expected numbers, found text"),
        ({"times": SECONDS, "y": [[1.0], ["x"], [object()]]}, "found 'x' in row 1, column 0"),
        ({"times": SECONDS, "y": [[1.0], [1.0, 2.0], [3.0]]}, "y: expected an array of numbers"),
        ({"times": SECONDS, "y": STAMPS}, "y: expected numbers, found dates"),
        ({"times": np.array([1, 2], "timedelta64[s]"), "discrete": True}, "must be step numbers, .* found durations"),
        ({"times": STAMPS, "t0": pd.Timestamp(STAMP, tz="UTC")}, "t0: has a time zone, times have none"),
        ({"times": STAMPS, "t0": STAMP, "discrete": True}, "must be step numbers, .* found dates"),
        ({"times": [1, 2, 3], "t0": 0.5, "discrete": True}, "must be step numbers"),
        ({"times": [1.5, 2, 3], "discrete": True}, "must be step numbers"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_refused_in_a_line(given, says):
    with pytest.raises(ConfigError, match=says) as caught:
        read(**given)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("times", "pace", "says"),
    [
        ([1.7e9, 1.7e9 + 1], {}, "1.7e+10 steps of 0.1 from the start, 0, to the last row, more than 1,000,000,000; "
         "t0=1700000000 starts at the first row; a longer step= of nb.filters.build makes fewer"),
        ([1.7e12, 1.7e12 + 500], {}, "rows are 500 apart and the system is measured every 0.5: are times in "
         "milliseconds? Then divide them by 1000; t0=1700000000000 starts at the first row"),
        ([1.7e12, 1.7e12 + 7], {"interval": None}, "1700000000000 looks like milliseconds since 1970"),
        ([0.0, 1e12], {}, "to the last row, more than 1,000,000,000; a longer step= of"),
        ([1_700_000_000, 1_700_000_001], {"discrete": True}, "t0=1700000000 starts at the first row"),
    ],
)  # fmt: skip
def test_more_steps_than_can_be_computed_are_refused_with_the_way_out(times, pace, says):
    with pytest.raises(ConfigError) as caught:
        read(times, **pace)
    assert says in str(caught.value)
    assert ("longer step" in str(caught.value)) == (not pace.get("discrete", False))


def estimated(times, t0=0.0, interval=0.5):
    """The number of the warnings, and what the only one says."""
    cov = np.eye(1)
    system = nb.System(
        lambda t, x: -x, lambda t, x: x, cov, nb.Moments(np.zeros(1), cov), interval=interval, step=0.25
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        nb.filter_data(nb.filters.build("ekf", system), times, np.ones(len(times)), t0=t0)
    return len(caught), "".join(str(each.message) for each in caught)


@pytest.mark.parametrize(
    ("times", "says"),
    [
        (
            [100.0, 100.5, 101.0],
            "predicted from 0 over 400 steps of 0.25 before the first row, at 100; t0=100 starts",
        ),
        ([100.0], "predicted from 0 over 400 steps of 0.25 before the first row, at 100; t0=100 starts"),
        (
            [0.0, 500.0, 1000.0],
            "rows are 500 apart and the system is measured every 0.5: are times in milliseconds?",
        ),
    ],
)
def test_a_first_row_far_after_the_start_and_another_unit_are_said(times, says):
    count, said = estimated(times)
    assert count == 1
    assert said.startswith("ekf: ")
    assert says in said


@pytest.mark.parametrize(
    ("times", "t0"),
    [([0.5, 1.0, 1.5], 0), ([5.0, 5.5, 6.0], 0), ([100.0, 100.5, 101.0], 100.0), ([10.0, 20.0, 30.0], 0.0)],
)
def test_nothing_is_said_where_rows_begin_within_ten_of_their_spacings(times, t0):
    assert estimated(times, t0) == (0, "")


def test_a_gap_in_any_form_and_a_unit_give_the_same_estimates():
    system = made(m=2).system
    f = nb.filters.build("ekf", system)
    y = np.array([[1.0, 0.4], [np.nan, 0.2], [0.3, 0.1]])
    plain = nb.filter_data(f, SECONDS, y)
    masked = np.ma.masked_array(np.where(np.isnan(y), 7.0, y), np.isnan(y))
    stamped = nb.filter_data(f, STAMPS, masked, t0=STAMP)
    pd.testing.assert_frame_equal(nb.filter_data(f, pd.to_timedelta(SECONDS, unit="s"), masked), plain)
    pd.testing.assert_frame_equal(stamped, plain)
