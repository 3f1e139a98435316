"""A user's times and measurements as arrays of numbers, or what is wrong with them, and where a filter starts."""

from __future__ import annotations

import datetime
import math
from decimal import Decimal
from numbers import Real
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nlbench.errors import ConfigError
from nlbench.schedule import MOST_STEPS
from nlbench.systems.discrete import DiscreteSystem

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter

FAR = 10  # times the usual spacing before the first row that make a start early
UNITS = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}
NUMBERS = {"i": "integers", "u": "integers", "f": "numbers"}
KINDS = {"b": "truth values", "M": "dates", "m": "durations", "c": "complex numbers"}
EPOCH = 1e11  # as seconds since 1970, in the year 5138


class Samples(NamedTuple):
    """times: (T,), whole numbers where time is discrete. y: (T, m), NaN where not measured. start: before all times."""

    times: Any
    y: Any
    start: Any


class Pace(NamedTuple):
    """How fast a filter goes through time.

    step: the longest; None means a tenth of each way. interval: between the system's measurements. discrete: whether
    times are step numbers.
    """

    step: float | None
    interval: float | None
    discrete: bool


class Ways(NamedTuple):
    """How a user says when filters start, with the time in place of {}, and how that steps are to be longer."""

    start: str
    step: str


IN_PYTHON = Ways("t0={}", "a longer step= of nb.filters.build")


def find_pace(f: Filter) -> Pace:
    """Find how fast a filter goes through time."""
    return Pace(f.step, f.system.interval, isinstance(f.system, DiscreteSystem))


def read_samples(f: Filter, times: Any, y: Any, t0: Any) -> Samples:
    """Convert what `filter_data` is given. Raises `ConfigError` where it cannot be meant, saying what to do."""
    pace, m = find_pace(f), f.system.measurements
    moments, start = _read_times(times, t0, pace.discrete)
    values = _read_values(y)
    values = values[:, None] if values.ndim == 1 and m == 1 else values
    if values.shape != (len(moments), m):
        many = f"({len(moments)}, {m}): {len(moments)} times, {m} measured"
        raise ConfigError(f"y: got shape {values.shape}, expected {many}")
    if np.isinf(values).any():
        row, column = np.argwhere(np.isinf(values))[0]
        raise ConfigError(f"y: {values[row, column]} in row {row}, column {column}; NaN means not measured")
    _check_order(moments, start)
    refused = refuse_length(moments, start, pace, IN_PYTHON)
    if refused:
        raise ConfigError(f"times: {refused}")
    return (
        Samples(moments.astype(int), values, round(start))
        if pace.discrete
        else Samples(moments, values, start)
    )


def refuse_length(times: Any, start: float, pace: Pace, ways: Ways) -> str:
    """Say that more steps lead from the start to the last row than can be computed; else say nothing."""
    step = pace.step
    if step is None or (times[-1] - start) / step <= MOST_STEPS:
        return ""
    said = [
        f"{(times[-1] - start) / step:.2g} steps of {step:g} from the start, {_shown(start)}, to the last row, more "
        f"than {MOST_STEPS:,}",
        _doubt_unit(times, pace, far=True),
    ]
    if (times[-1] - times[0]) / step <= MOST_STEPS:
        said.append(f"{ways.start.format(_shown(times[0]))} starts at the first row")
    if not pace.discrete:
        said.append(f"{ways.step} makes fewer")
    return "; ".join(filter(None, said))


def doubt_times(times: Any, start: float, pace: Pace, ways: Ways) -> str:
    """Say that the first row lies far after the start, or that times seem to be in another unit; else say nothing."""
    lead, step, first = times[0] - start, pace.step, _shown(times[0])
    usual = max(_spacing(times) or pace.interval or FAR * (step or math.inf), step or 0.0)
    said = []
    if lead > FAR * usual:
        count = f"{math.ceil(lead / step - 1e-9):,} steps of {step:g}" if step else f"{lead:g}"
        said.append(
            f"predicted from {_shown(start)} over {count} before the first row, at {first}; "
            f"{ways.start.format(first)} starts there"
        )
    return "; ".join(filter(None, [*said, _doubt_unit(times, pace, far=bool(said))]))


def _doubt_unit(times: Any, pace: Pace, far: bool) -> str:
    """Ask whether times are in another unit than the system's, as spacing suggests, or size if the start is far."""
    spacing = _spacing(times)
    for unit, factor in () if pace.discrete else UNITS.items():
        if pace.interval and factor / 3 < spacing / pace.interval < 3 * factor:
            apart = f"rows are {spacing:g} apart and the system is measured every {pace.interval:g}"
            return f"{apart}: are times in {unit}? Then divide them by {factor:g}"
        if far and EPOCH * factor < abs(times[0]) * 1e3 < EPOCH * factor * 1e3:
            return f"{_shown(times[0])} looks like {unit} since 1970: then divide times by {factor:g}"
    return ""


def _spacing(times: Any) -> float:
    """The median time from one row to another one; 0 where all rows are of one time."""
    apart = np.diff(np.asarray(times, float))
    return float(np.median(apart[apart > 0])) if (apart > 0).any() else 0.0


def _shown(time: float) -> str:
    """A time to the last digit."""
    return repr(float(time)).removesuffix(".0")


def _check_order(times: Any, start: float) -> None:
    """Raises `ConfigError` for a time before the one before it, and where doubles do not tell two apart."""
    back = np.diff(np.concatenate([[start], times])) < 0
    if back.any():
        row = int(np.argmax(back))
        raise ConfigError(f"times: {times[row]} in row {row} comes after {times[row - 1] if row else start}")


def _read_times(times: Any, t0: Any, discrete: bool) -> tuple[Any, float]:
    """Times and start as numbers: durations in seconds, dates in seconds from t0."""
    given = _array("times", times)
    if given.ndim != 1 or not len(given):
        raise ConfigError(f"times: got shape {given.shape}, expected (T,) with T at least 1")
    if np.ma.getmaskarray(given).any():
        row = int(np.argmax(np.ma.getmaskarray(given)))
        raise ConfigError(f"times: row {row} is masked; leave out rows without a time")
    raw = np.ma.getdata(given)
    given = _dated(raw)
    kind = given.dtype.kind
    if discrete and kind in "mM":
        message = f"times: must be step numbers, since the system's time is discrete; found {KINDS[kind]}"
        raise ConfigError(message)
    if kind == "M":
        numbers, start = _since(given, t0, _is_zoned(raw)), 0.0
    else:
        numbers, start = _seconds("times", given), float(_seconds("t0", _dated(np.asarray([t0])))[0])
    for name, each in (("times", numbers), ("t0", np.array([start]))):
        if not np.isfinite(each).all():
            row = int(np.argmin(np.isfinite(each)))
            where = f" in row {row}" if name == "times" else ""
            raise ConfigError(f"{name}: must be finite, found {each[row]}{where}")
    if kind in "iu" and (np.diff(given) != 0)[np.diff(numbers) == 0].any():
        raise ConfigError("times: two are one number in double precision; subtract a start from all")
    if discrete and ((numbers != np.round(numbers)).any() or start != round(start)):
        raise ConfigError("times: must be step numbers, since the system's time is discrete")
    return numbers, start


def _since(dates: Any, t0: Any, zoned: bool) -> Any:
    """Dates in seconds from t0, which is one too. zoned: whether they are of a time zone."""
    given = np.asarray([t0])
    start = _dated(given)
    if start.dtype.kind != "M":
        found = "nothing" if isinstance(t0, int) and t0 == 0 else repr(t0)
        raise ConfigError(
            f"t0: times are dates, so that the start must be one, found {found}; t0=times[0] starts at the first row"
        )
    if zoned != _is_zoned(given):
        found = "has no time zone, times have one" if zoned else "has a time zone, times have none"
        raise ConfigError(f"t0: {found}; give both one, or neither")
    return (dates - start[0]) / np.timedelta64(1, "s")


def _is_zoned(given: Any) -> bool:
    """Whether there are dates of a time zone, which NumPy holds as objects."""
    return given.dtype.kind == "O" and any(getattr(each, "tzinfo", None) is not None for each in given)


def _seconds(name: str, given: Any) -> Any:
    """Numbers as they are, and durations in seconds."""
    if given.dtype.kind == "m":
        if np.datetime_data(given.dtype)[0] in ("generic", "Y", "M"):
            raise ConfigError(f"{name}: {given.dtype} has no length in seconds")
        return given / np.timedelta64(1, "s")
    return _numbers(name, given)


def _dated(given: Any) -> Any:
    """Objects that all are dates, or durations, as NumPy has these; times of a zone in UTC; all else as it is."""
    if given.dtype.kind != "O":
        return given
    import pandas as pd

    if all(isinstance(each, (datetime.timedelta, np.timedelta64)) for each in given):
        return pd.to_timedelta(list(given)).to_numpy()
    if all(isinstance(each, (datetime.datetime, np.datetime64)) for each in given):
        zoned = [getattr(each, "tzinfo", None) is not None for each in given]
        if all(zoned):
            return pd.to_datetime(list(given), utc=True).tz_localize(None).to_numpy()
        if not any(zoned):
            return pd.to_datetime(list(given)).to_numpy()
    return given


def _read_values(y: Any) -> Any:
    """Measurements as floats, NaN where masked or missing."""
    given = _array("y", y)
    values = _numbers("y", np.ma.getdata(given), np.ma.getmaskarray(given))
    return np.where(np.ma.getmaskarray(given), np.nan, values)


def _array(name: str, given: Any) -> Any:
    """An array, masked where the given one is. Raises `ConfigError` for lists of several lengths."""
    try:
        return given if isinstance(given, np.ma.MaskedArray) else np.asarray(given)
    except ValueError as error:
        raise ConfigError(f"{name}: expected an array of numbers; {str(error)[:200]}") from None


def _numbers(name: str, given: Any, masked: Any = False) -> Any:
    """Floats, NaN for what is missing. Raises `ConfigError` for what are no numbers."""
    kind = given.dtype.kind
    if kind in NUMBERS:
        return given.astype(float)
    if kind != "O":
        what = KINDS.get(kind, "text" if kind in "UST" else str(given.dtype))
        hint = "; astype(float) makes 0 and 1 of them" if kind == "b" else ""
        raise ConfigError(f"{name}: expected numbers, found {what}{hint}")
    floats = np.full(given.shape, np.nan)
    skipped = np.broadcast_to(masked, given.shape)
    for place in np.ndindex(given.shape):
        if not skipped[place] and not _is_missing(given[place]):
            floats[place] = _number(name, given[place], place)
    return floats


def _number(name: str, value: Any, place: tuple[int, ...]) -> float:
    """A number of any type. Raises `ConfigError` for anything else."""
    if isinstance(value, (Real, Decimal, np.number)) and not isinstance(value, (bool, np.bool_)):
        return float(value)
    where = ", column ".join(map(str, place))
    raise ConfigError(f"{name}: expected a number, found {str(value)[:60]!r} in row {where}")


def _is_missing(value: Any) -> bool:
    """Whether an object says that there is no number."""
    return value is None or value is np.ma.masked or type(value).__name__ in ("NAType", "NaTType")
