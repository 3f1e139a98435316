"""Errors in code of the user's own: the line that led to one, and the remedy for what is often met under jax."""

from __future__ import annotations

import linecache
import re
import sys
import sysconfig
import traceback
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from nlbench.errors import Problem, said

OURS = str(Path(__file__).parent)
STANDARD = sysconfig.get_path("stdlib")
LIBRARIES = re.compile(
    r"site-packages[/\\](jax|jaxlib|numpy|scipy|equinox|diffrax|jaxtyping|beartype|pydantic)[/\\]"
)
CALL = re.compile(r"([A-Za-z_][\w.]*)\s*\(")
NOT_TRACEABLE = ("cmath", "math", "numpy", "scipy")
TRACED = ("TracerArrayConversionError", "ConcretizationTypeError", "TracerIntegerConversionError")
# What a TypeError says where a number was wanted and a traced array was given.
WANTED_NUMBER = re.compile(r"[Tt]race|scalar (arrays|index)|size-1|length-1")


class Line(NamedTuple):
    """A line of the user's that led to an error: where, the part that was being evaluated, and the names it knew."""

    file: str
    number: int | None
    evaluated: str
    names: Mapping[str, Any]


def find_line(error: BaseException, file: str = "") -> Line | None:
    """Find the innermost line that led to an error and is neither of this package nor of a library; None if none is.

    file: take lines of this file only.
    """
    walked = traceback.walk_tb(error.__traceback__)
    summaries = traceback.extract_tb(error.__traceback__)
    for (frame, _), summary in reversed(list(zip(walked, summaries, strict=True))):
        if summary.filename == file or (not file and _is_users(summary.filename)):
            names = {**frame.f_globals, **frame.f_locals}
            return Line(summary.filename, summary.lineno, _evaluated(summary), names)
    return None


def _is_users(file: str) -> bool:
    library = file.startswith(STANDARD) and "site-packages" not in file
    return not (library or file.startswith((OURS, "<")) or LIBRARIES.search(file))


def _evaluated(summary: traceback.FrameSummary) -> str:
    if summary.lineno is None:
        return ""
    end = summary.end_colno if summary.end_lineno == summary.lineno else None
    return linecache.getline(summary.filename, summary.lineno)[summary.colno : end]


def explain(
    error: BaseException, what: str, function: Callable[..., Any] | None = None, given: str = ""
) -> Problem:
    """Make a problem of an error that calling `what` of the user's raised, with the remedy if known.

    It is placed at the line that raised, or else where the function begins. given: what it was called with, after
    "for", for an error without a remedy.
    """
    line = find_line(error)
    raises = f"raises {type(error).__name__}{given and f' for {given}'}{said(error)}"
    says = f"{what}: {find_remedy(error, line) or raises}"
    if line is None:
        return Problem(says) if function is None else locate(function, says)
    return Problem(says, file=_shown(line.file), line=line.number)


def locate_step(error: BaseException, path: str, step: str) -> Problem:
    """Make a problem of an error of a plug-in's code, at the last line of its own that led to it.

    path: as it was compiled. step: what failed, such as "importing it failed".
    """
    if isinstance(error, SyntaxError) and error.filename == path:
        text = (error.text or "").rstrip("\n")
        says = f"{step}: {type(error).__name__}: {error.msg}"
        return Problem(says, "", path, error.lineno, error.offset or 1, text)
    line, text = find_line(error, path), " ".join(str(error).split())
    says = find_remedy(error, line) or f"{type(error).__name__}{text and ': '}{text[:200]}"
    return Problem(f"{step}: {says}", "", path, line.number if line else None)


def find_remedy(error: BaseException, line: Line | None) -> str:
    """Say what is wrong and what to write instead, for an error that a line led to; empty if that is not known."""
    kind, text = type(error).__name__, str(error)
    if kind == "TypeError" and ("does not support item assignment" in text or "immutable" in text):
        return (
            "assigns to an entry of an array, and arrays of jax do not change: write x = x.at[i].set(value)"
        )
    if "setting an array element" in text and "inhomogeneous" not in text:
        return (
            "puts a traced number into an array of NumPy: make the array with jnp.stack, or with jnp.zeros and "
            "x = x.at[i].set(value)"
        )
    if kind == "TracerBoolConversionError":
        return "decides by a traced number (if, while, and, or, min, max): write jnp.where(condition, a, b)"
    if kind not in TRACED and not (kind == "TypeError" and WANTED_NUMBER.search(text)):
        return ""
    for called, remedy in _find_calls(line):
        return f"calls {called} with a traced number: {remedy}"
    if kind == "TracerArrayConversionError":
        return "makes a NumPy array of a traced one: use jax.numpy throughout"
    return "needs the value of a traced number (int, float, range, an index): write it with jax.numpy"


def _find_calls(line: Line | None) -> Iterator[tuple[str, str]]:
    """Functions that a line calls and jax cannot trace, as the line names them, each with what to write instead."""
    for called in CALL.findall(line.evaluated) if line else ():
        first, *rest = called.split(".")
        function = line.names.get(first) if line else None
        for part in rest:
            function = getattr(function, part, None)
        ufunc = type(function).__name__ == "ufunc"
        module = getattr(function, "__module__", None) or ("numpy" if ufunc else "")
        if callable(function) and module.split(".")[0] in NOT_TRACEABLE:
            name = ".".join([*module.split(".")[1:], getattr(function, "__name__", called)])
            known: Any = sys.modules.get("jax.numpy")
            for part in name.split("."):
                known = getattr(known, part, None)
            yield called, f"write jnp.{name}" if known else "take its like in jax.numpy or jax.scipy"


def locate(function: Callable[..., Any], message: str) -> Problem:
    """Make a problem of what is wrong with the result of a function, at the line where the user wrote it."""
    while inner := next(
        filter(None, (getattr(function, name, None) for name in ("function", "func", "__wrapped__"))), None
    ):
        function = inner
    code = getattr(function, "__code__", None) or getattr(type(function).__call__, "__code__", None)
    if code is None or not _is_users(code.co_filename):
        return Problem(message)
    return Problem(message, file=_shown(code.co_filename), line=code.co_firstlineno)


def _shown(file: str) -> str:
    """The file as seen from here."""
    path, here = Path(file), Path.cwd()
    return str(path.relative_to(here)) if path.is_absolute() and path.is_relative_to(here) else file
