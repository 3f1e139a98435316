"""Numbers as a reader of the report wants them."""

from __future__ import annotations

import math
from collections.abc import Sequence

LARGEST = 1e6  # beyond it, and below its inverse, numbers are written with a power of ten
POWERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def uncertain(value: float, stderr: float) -> str:
    """`0.2418 ± 0.0042`: to two digits of the standard error."""
    if not math.isfinite(value):
        return "failed" if math.isnan(value) else "infinite"
    if not math.isfinite(stderr) or stderr <= 0:
        return plain(value)
    places = 1 - math.floor(math.log10(stderr))
    exponent = math.floor(math.log10(max(abs(value), stderr)))
    if 1 / LARGEST < max(abs(value), stderr) < LARGEST:
        places = max(0, places)
        return f"{value:,.{places}f} ± {stderr:,.{places}f}".replace("-", "−")
    places = max(0, places + exponent)
    scaled = f"({value / 10.0**exponent:.{places}f} ± {stderr / 10.0**exponent:.{places}f})".replace("-", "−")
    return f"{scaled} × 10{str(exponent).translate(POWERS)}"


def scientific(value: float, digits: int = 5) -> str:
    """`2.8723 × 10⁶`: always one digit before the point, so that the entries of a table are alike."""
    if not math.isfinite(value):
        return "–" if math.isnan(value) else "infinite"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    power = f" × 10{str(int(exponent)).translate(POWERS)}" if int(exponent) else ""
    return f"{mantissa}{power}".replace("-", "−")


def plain(value: float, digits: int = 4) -> str:
    """A number to some digits; a whole number to all."""
    if not math.isfinite(value):
        return "–" if math.isnan(value) else "infinite"
    if value == int(value) and abs(value) < LARGEST:
        return f"{int(value):,}".replace("-", "−")
    text = f"{value:.{digits}g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        text = f"{mantissa} × 10{str(int(exponent)).translate(POWERS)}"
    return text.replace("-", "−")


def measured(number: str, unit: str) -> str:
    """A number with its unit, on one line."""
    return f"{number}\u00a0{unit}" if unit else number


def percent(fraction: float) -> str:
    """A fraction in percent, to two digits; the unit is left to the caller."""
    value = float(f"{100 * fraction:.1e}")
    if not math.isfinite(value):
        return "–"
    return f"{value:.{max(0, 1 - math.floor(math.log10(abs(value))))}f}" if value else "0"


def share(fraction: float, low: float, high: float) -> str:
    """`93 % [88, 96]`: a fraction in percent with its interval."""
    return f"{percent(fraction)}\u00a0% [{percent(low)}, {percent(high)}]"


def ranged(value: float, low: float, high: float) -> str:
    """`−0.01 [−0.02, 0.005]`: a number with its interval."""
    return f"{plain(value, 3)} [{plain(low, 3)}, {plain(high, 3)}]"


def duration(seconds: float) -> str:
    """`12.3 s`, `4.5 min` or `2.1 h`."""
    for unit, size in (("h", 3600), ("min", 60)):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.1f} s"


def listed(names: Sequence[str]) -> str:
    """`a, b and c`."""
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))
