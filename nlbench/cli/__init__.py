"""The command line: each command parses, calls one function of the package and prints."""

from nlbench.cli.app import main

__all__ = ["main"]
