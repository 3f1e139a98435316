"""End, step and output spacing: those that a file leaves out are chosen so that they fit what it writes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import reduce
from typing import Any, NamedTuple, TypeGuard

from nlbench.config.explain import LARGEST, SMALLEST, Finding
from nlbench.config.places import Path
from nlbench.config.schema import TimeSpec
from nlbench.schedule import MOST_STEPS

MOST_OUTPUTS = 100_000
USUAL = 20  # output times, or measurements, of a run
FINER = 10  # steps from one to the next
FINEST = 1000  # times shorter than usual a spacing may be that nobody wrote
ROUNDER = "take a rounder time"
CLOSE = 1e-9  # relative difference at which a time still is a multiple of another


class Time(NamedTuple):
    """A time that the file writes, at a path, or that the system has by itself, without one."""

    value: float
    name: str
    path: Path = ()


class Given(NamedTuple):
    """What decides the times of a run; None for what the file does not write, or writes wrongly.

    steps: those of filters. interval: between the measurements that are made. usual: the interval of the system, even
    where nothing is measured at it. discrete: whether all times are numbers of steps. continuous: whether there is a
    measurement at each step.
    """

    end: Time | None = None
    step: Time | None = None
    output: Time | None = None
    reports: Sequence[Time] = ()
    steps: Sequence[Time] = ()
    interval: Time | None = None
    usual: float | None = None
    discrete: bool = False
    continuous: bool = False

    @property
    def units(self) -> list[Time]:
        """Times of which outputs are multiples."""
        one = Time(1.0, "a step") if self.discrete else self.step
        return [each for each in (one, *self.steps) if each]

    @property
    def wholes(self) -> list[Time]:
        """Times that are multiples of the output spacing."""
        return [each for each in (*self.reports, self.end) if each]


def is_time(value: Any) -> TypeGuard[float]:
    """Whether a value can be computed with as a time."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and SMALLEST <= value <= LARGEST


def settle(given: Given) -> tuple[TimeSpec | None, list[Finding]]:
    """The times of a run; or None and everything that is wrong with those that the file writes.

    A finding names only what the file writes, and what of the system it cannot fit.
    """
    findings = [*_out_of_order(given), *_not_multiples(given), *_too_many(given, given.end)]
    if findings:
        return None, findings
    time = _chosen(given)
    findings = [*_too_many(given, Time(time.end, "the end")), *_too_fine(given, time)]
    return (None, findings) if findings else (time, [])


def _out_of_order(given: Given) -> Iterator[Finding]:
    """Report times after the end or repeated, and an end before the first measurement."""
    end, interval = given.end, given.interval
    for number, each in enumerate(given.reports):
        if end and each.value > end.value * (1 + CLOSE):
            yield Finding(each.path, f"{each.name} {each.value:g} is after time.end = {end.value:g}")
        elif any(math.isclose(each.value, other.value, rel_tol=CLOSE) for other in given.reports[:number]):
            yield Finding(each.path, f"{each.name} {each.value:g} is repeated")
    if end and interval and interval.value > end.value * (1 + CLOSE):
        longer = f"{interval.value:g} is longer than time.end = {end.value:g}"
        shorter = f"{end.value:g} is shorter than {interval.name}, {interval.value:g}"
        message = f"{longer if interval.path else shorter}, so nothing would be measured; take a longer run"
        yield Finding(interval.path or end.path, message)


def _not_multiples(given: Given) -> Iterator[Finding]:
    """One finding for each time that is not a multiple of another one that it must be a multiple of."""
    end, output = given.end, given.output
    late = [each for each in given.reports if end and each.value > end.value * (1 + CLOSE)]
    wrong = [misfit for unit in given.units if output and (misfit := _misfit(output, unit))]
    yield from wrong[:1]
    units = [output, *given.units] if output and not wrong else given.units
    pairs = [(each, unit) for each in given.wholes if each not in late for unit in units]
    if given.interval and (given.discrete or given.step):
        pairs.append((given.interval, given.units[0]))
    found = [each for each in (_misfit(*pair) for pair in pairs) if each]
    yield from {each.path: each for each in reversed(found)}.values()
    if given.continuous and given.steps:
        first, *others = [given.step, *given.steps] if given.step else given.steps
        for each in others:
            if not math.isclose(each.value, first.value, rel_tol=CLOSE):
                message = f"{each.value:g} is not {first.name} = {first.value:g}"
                yield Finding(
                    each.path, f"{message}; where measurements are continuous all steps are the same"
                )


def _misfit(whole: Time, unit: Time) -> Finding | None:
    """Why a time is not a multiple of another, if it is not."""
    ratio = whole.value / unit.value
    if ratio > 0.5 and abs(ratio - round(ratio)) <= CLOSE * max(1.0, ratio):
        return None
    count = math.floor(ratio)
    if unit.path and not whole.path:
        near = [whole.value / each for each in (count + 1, count) if each]
        message = f"{unit.value:g} does not divide {whole.name}, {whole.value:g}"
        return Finding(unit.path, f"{message}; nearest: {' or '.join(f'{each:.10g}' for each in near)}")
    near = [unit.value * each for each in (count, count + 1) if each]
    what = f"a multiple of {unit.name} = {unit.value:g}" if unit.path else "a whole number of steps"
    message = f"{whole.value:g} is not {what}; nearest: {' or '.join(f'{each:.10g}' for each in near)}"
    return Finding(whole.path or ("system",), message)


def _too_many(given: Given, end: Time | None) -> Iterator[Finding]:
    """Written spacings of which more make the run than can be computed."""
    if end is None:
        return
    if given.output and end.value / given.output.value > MOST_OUTPUTS:
        yield Finding(given.output.path, f"more than {MOST_OUTPUTS:,} output times; take a longer spacing")
    for each in (given.step, *given.steps):
        if each and end.value / each.value > MOST_STEPS:
            yield Finding(each.path, f"more than {MOST_STEPS:,} steps; take a longer step")


def _too_fine(given: Given, time: TimeSpec) -> Iterator[Finding]:
    """What is written so that only spacings much shorter than usual fit all of it, if any do."""
    interval, wholes = given.interval, [each.value for each in given.wholes]
    if not given.output and given.reports and time.end > MOST_OUTPUTS * reduce(_common, wholes):
        fine = (each for each in given.reports if time.end > MOST_OUTPUTS * _common(each.value, time.end))
        message = (
            f"with the other times of the run, needs outputs every {reduce(_common, wholes):.6g}; {ROUNDER}"
        )
        yield Finding(next(fine, given.reports[-1]).path, message)
        return
    if given.step or (given.continuous and given.steps):
        return
    own = [given.output] if given.output else [*given.reports, given.end, *given.steps]
    written = [each for each in [*own, given.end, interval] if each and each.path]
    apart = min(interval.value, time.output) if interval and not given.discrete else 0.0
    if interval and time.step * FINEST * FINER < apart:
        shorter = (each for each in written if _common(each.value, interval.value) <= time.step * (1 + CLOSE))
        blamed = next(shorter, written[0])
        message = f"with {interval.name}, {interval.value:g}, needs steps of {time.step:.6g}; {ROUNDER}"
        yield Finding(blamed.path, message)
    elif time.end > MOST_STEPS * time.step:
        yield Finding((given.end or written[0]).path, f"more than {MOST_STEPS:,} steps of {time.step:.6g}")


def _chosen(given: Given) -> TimeSpec:
    """The times, where what is written fits together.

    Twenty measurements, a statistic at each and ten steps between, as far as that fits.
    """
    output = given.output.value if given.output else _output(given)
    end = given.end.value if given.end else _end(given, output)
    if given.discrete:
        return TimeSpec(end=end, output=output, step=1.0)
    if given.step or (given.continuous and given.steps):
        return TimeSpec(end=end, output=output, step=(given.step or given.steps[0]).value)
    longest = _common(output, given.interval.value) if given.interval else output
    parts = math.ceil(longest / (given.usual or output) * FINER * (1 - CLOSE))
    parts = max(1, min(parts, math.floor(MOST_STEPS * longest / end), math.floor(longest / SMALLEST)))
    return TimeSpec(end=end, output=output, step=longest / parts)


def _output(given: Given) -> float:
    """A spacing that all written times fit, as near as may be to the interval or to a twentieth of the run."""
    unit = reduce(_multiple, [each.value for each in given.units]) if given.units else None
    wholes = [each.value for each in given.wholes]
    end = given.end.value if given.end else max(wholes, default=0.0)
    wanted = given.usual or (1.0 if given.discrete else end / USUAL if end else FINER * (unit or 0.005))
    if end / wanted > MOST_OUTPUTS:
        wanted = end / USUAL
    if not wholes:
        return wanted if unit is None else unit * max(1, round(wanted / unit))
    longest = reduce(_common, wholes)
    most = round(longest / (unit or _common(longest, wanted)))
    allowed = max(1, math.floor(min(MOST_OUTPUTS * longest / end * (1 + CLOSE), longest / SMALLEST, most)))
    parts = (each for each in range(1, allowed + 1) if most % each == 0)
    output = min((longest / each for each in parts), key=lambda each: _unlike(each / wanted))
    return wanted if math.isclose(output, wanted, rel_tol=CLOSE) else output


def _unlike(ratio: float) -> float:
    """How far a spacing is from the one wanted; one that is too long counts twice."""
    return ratio * ratio if ratio > 1 else 1 / ratio


def _end(given: Given, output: float) -> float:
    """The multiple of the output spacing that has twenty measurements or outputs, and every report time."""
    needed = [each.value for each in (*given.reports, given.interval) if each]
    most = min(MOST_OUTPUTS * output, LARGEST, *(MOST_STEPS * each.value for each in given.units))
    wanted = USUAL * (given.usual or output)
    least = max(needed, default=output)
    count = min(_count(wanted, output), math.floor(most / output))
    return output * max(count, _count(least, output))


def _count(span: float, output: float) -> int:
    """How many outputs reach so far."""
    return math.ceil(span / output * (1 - CLOSE))


def _common(a: float, b: float) -> float:
    """The longest time of which both are multiples, as far as doubles can tell."""
    return b / _ratio(a, b).denominator


def _multiple(a: float, b: float) -> float:
    """The shortest time that is a multiple of both."""
    return b * _ratio(a, b).numerator


def _ratio(a: float, b: float) -> Fraction:
    """a/b as the simplest fraction that rounding allows."""
    if a < b:
        return 1 / _ratio(b, a)
    exact = Fraction(a) / Fraction(b)
    tries = (exact.limit_denominator(10**digits) for digits in range(14))
    return next(each for each in tries if abs(each - exact) <= exact * Fraction(1e-12))
