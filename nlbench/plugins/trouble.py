"""An error of a plug-in's code, in one line with the place in its file."""

from __future__ import annotations

import traceback

from nlbench.errors import Problem


def located(error: BaseException, path: str, step: str) -> Problem:
    """The error with the last line of the plug-in's own that led to it.

    path: as it was compiled. step: what failed, such as "importing it failed".
    """
    if isinstance(error, SyntaxError) and error.filename == path:
        line = (error.text or "").rstrip("\n")
        return Problem(
            f"{step}: {type(error).__name__}: {error.msg}", "", path, error.lineno, error.offset or 1, line
        )
    own = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == path]
    said = " ".join(str(error).split())
    message = f"{step}: {type(error).__name__}{said and ': '}{said[:200]}"
    return Problem(message, "", path, own[-1].lineno) if own else Problem(message, "", path)
