"""The command line: each command parses, calls one function of the package and prints."""

import io
import os
import sys

__all__ = ["main"]


def main() -> None:
    """The command `nlbench`; Ctrl-C or SIGTERM at any moment ends it with exit code 130."""
    from nlbench.cli.signals import INTERRUPTED, heeded

    # Matrices here are small, and threads that share their cores with another process wait for each other: Gaussian
    # nodes took a second instead of 8 ms.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # names of files need not be text
            stream.reconfigure(errors="backslashreplace")
    with heeded():
        try:
            from nlbench.cli.app import app

            app(prog_name="nlbench")
        except KeyboardInterrupt:
            print(INTERRUPTED, file=sys.stderr)
            sys.exit(130)
