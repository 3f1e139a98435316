"""What the commands print: tables of text, numbers with their uncertainty, errors, the next step."""

from __future__ import annotations

import json
import math
import os
import sys
import textwrap
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TextIO

from nlbench.errors import printable

if TYPE_CHECKING:
    from nlbench.errors import NlbenchError

WIDTH = 80
STYLES = {"bold": "1", "dim": "2", "red": "31", "green": "32", "yellow": "33"}


def styled(text: str, style: str, stream: TextIO | None = None) -> str:
    """The text in a colour, if the stream is a terminal and the user has not switched colours off."""
    stream = stream or sys.stdout
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or not stream.isatty()
    return text if plain else f"\033[{STYLES[style]}m{text}\033[0m"


def complain(message: str) -> None:
    """An error, on stderr; names of files may hold characters that command a terminal."""
    with suppress(OSError):
        flush()
    print(printable(message), file=sys.stderr)


def flush() -> None:
    """Have what was printed reach its reader. Where it cannot it is dropped, so that Python can end as it should."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise


def next_step(command: str, why: str) -> None:
    """What the user will most likely want to do now."""
    print(f"\n{styled('next', 'bold')}: {command}\n      {why}")


def as_json(value: Any, *faults: NlbenchError) -> None:
    """One JSON document; what is not finite becomes null. faults: what the command raises next, which it tells."""
    for each in faults:
        each.told = True
    print(json.dumps(_finite(value), indent=2, ensure_ascii=False))
    flush()


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, (str, int, float, bool, type(None))) else str(value)


def rows(table: Iterable[Sequence[str]], indent: int = 2, gap: int = 2) -> None:
    """Columns aligned to the left."""
    table = [list(row) for row in table]
    widths = [max(len(row[column]) for row in table) for column in range(max(map(len, table), default=0))]
    for row in table:
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=False)]
        print((" " * indent + (" " * gap).join(cells)).rstrip())


def definitions(pairs: Iterable[tuple[str, str]], indent: int = 2) -> None:
    """Names with their meaning, wrapped beside them within 80 columns."""
    pairs = list(pairs)
    width = min(28, max((len(name) for name, _ in pairs), default=0))
    for name, text in pairs:
        head = " " * indent + name.ljust(width) + "  "
        under = " " * (indent + width + 2)
        if len(name) > width:
            print(head.rstrip())
            head = under
        print(
            textwrap.fill(text, WIDTH, initial_indent=head, subsequent_indent=under)
            if text
            else head.rstrip()
        )


def uncertain(value: float, stderr: float) -> str:
    """A number with the standard error of its last digits in brackets: 0.1234(12) is 0.1234 +- 0.0012."""
    if not math.isfinite(value):
        return "FAILED" if math.isnan(value) else "infinite"
    if not math.isfinite(stderr) or stderr <= 0:
        return f"{value:.4g}"
    decimals = 1 - math.floor(math.log10(stderr))
    error = round(stderr * 10**decimals)
    if error == 100:
        decimals, error = decimals - 1, 10
    if decimals >= 0 and abs(value) < 1e6 and decimals <= 8:
        return f"{value:.{decimals}f}({error})"
    exponent = math.floor(math.log10(max(abs(value), stderr)))
    digits = max(0, exponent + decimals)
    return f"{value / 10**exponent:.{digits}f}({error})e{exponent:+d}"


def percent(fraction: float) -> str:
    """A percentage to two digits, or to a tenth from ten on."""
    value = 100 * fraction
    if not math.isfinite(value):
        return "?"
    if value == 0 or value >= 10:
        return f"{value:.1f}".removesuffix(".0")
    return f"{value:.{max(0, 1 - math.floor(math.log10(value)))}f}"


def duration(seconds: float) -> str:
    """A time as a person says it."""
    for unit, size in (("days", 86400), ("h", 3600), ("min", 60)):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.1f} s" if seconds >= 0.1 else f"{1000 * seconds:.0f} ms"


def size(count: float) -> str:
    """A number of bytes as a person says it."""
    for unit, scale in (("TiB", 2**40), ("GiB", 2**30), ("MiB", 2**20), ("KiB", 2**10)):
        if count >= scale:
            return f"{count / scale:.1f} {unit}"
    return f"{count:.0f} bytes"
