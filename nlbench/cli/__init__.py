"""The command line: each command parses, calls one function of the package and prints."""

import sys

__all__ = ["main"]


def main() -> None:
    """The command `nlbench`; Ctrl-C or SIGTERM at any moment ends it with exit code 130."""
    from nlbench.cli.signals import INTERRUPTED, heeded

    with heeded():
        try:
            from nlbench.cli.app import app

            app(prog_name="nlbench")
        except KeyboardInterrupt:
            print(INTERRUPTED, file=sys.stderr)
            sys.exit(130)
