"""The application: its commands, and how an error becomes a line on stderr and an exit code."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from nlbench.cli import (
    compare,
    filter,
    listing,
    merge,
    new,
    output,
    perf,
    preview,
    reproduce,
    run,
    saved,
    schema,
    verify,
)
from nlbench.cli.signals import INTERRUPTED
from nlbench.engine import memory
from nlbench.errors import EnvironmentFault, Interrupted, NlbenchError

HELP = """Monte Carlo benchmarks of nonlinear filters.

An experiment is a YAML file: a system, filters, and claims about them.
Check it, see what it costs, run it:

\b
  nlbench validate configs/quickstart.yaml
  nlbench plan     configs/quickstart.yaml
  nlbench run      configs/quickstart.yaml
"""
EPILOG = """\b
Exit codes:
    0  ok                       5  disk, permission, memory or device
    1  internal error           6  another run holds the folder
    2  usage or configuration   7  nothing was compared
    3  a gate failed          130  interrupted; the same command goes on
    4  a filter failed, or diverged beyond the limit that the file sets
"""

# Errors of files that are nobody's mistake in the program: disk and quota full, no permission, read-only, too many, ...
OF_THE_MACHINE = frozenset(
    getattr(errno, name)
    for name in "ENOSPC EDQUOT EACCES EPERM EROFS EIO ENAMETOOLONG EMFILE ENFILE ESTALE".split()
)


class Commands(TyperGroup):
    """A group whose commands end with the exit code of the error they raise, in plain words."""

    def invoke(self, context: Any) -> Any:
        json = "--json" in context.args  # before the command takes them
        try:
            result = super().invoke(context)
            output.flush()
            return result
        except (typer.Exit, typer.Abort, BrokenPipeError):
            raise
        except (Exception, KeyboardInterrupt) as error:
            raise typer.Exit(_ended(error, json)) from None


def _ended(error: BaseException, json: bool) -> int:
    """The exit code of an error, after saying it in plain words; on stdout too, for a program that reads JSON there."""
    if isinstance(error, KeyboardInterrupt):
        error = Interrupted(INTERRUPTED)
    if memory.ran_out(error):
        error = memory.fault(error)
    if isinstance(error, OSError) and error.errno in OF_THE_MACHINE:
        where = f"{error.filename}: " if error.filename else "cannot write: "
        error = EnvironmentFault(f"{where}{error.strerror}")
    if of_usage := type(error).__module__.startswith(("typer", "click")):
        code, said = getattr(error, "exit_code", 2), _of_usage(error)
    elif isinstance(error, NlbenchError):
        code, said = error.exit_code, str(error)
    elif os.environ.get("NLBENCH_DEBUG"):
        raise error
    else:
        code, said = NlbenchError.exit_code, internal(error)
    if json and not getattr(error, "told", False):
        with suppress(OSError):
            output.as_json({"exit_code": code, "error": said})
    if of_usage:  # which typer shows with the usage
        raise error
    output.complain(said)
    return code


def _of_usage(error: Any) -> str:
    """What typer says of a command line that it does not understand."""
    return str(error.format_message() if hasattr(error, "format_message") else error)


def internal(error: BaseException) -> str:
    """One line on an error that is not the user's, after its traceback was put aside."""
    import tempfile
    import traceback

    said = " ".join(str(error).split())[:200]
    text = f"internal error: {type(error).__name__}: {said}\n"
    try:
        with tempfile.NamedTemporaryFile("w", prefix="nlbench-", suffix=".txt", delete=False) as file:
            file.write("".join(traceback.format_exception(error)))
        return f"{text}the traceback is in {file.name}; nlbench --debug shows it at once"
    except OSError:
        return f"{text}nlbench --debug shows the traceback"


app = typer.Typer(
    cls=Commands,
    help=HELP,
    epilog=EPILOG,
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 80},
)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import PackageNotFoundError, version

        try:
            print(f"nlbench {version('nlbench')}")
        except PackageNotFoundError:
            print("nlbench, not installed: run from its source")
        raise typer.Exit


@app.callback()
def common(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an internal error.")] = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    if debug:
        os.environ["NLBENCH_DEBUG"] = "1"


app.command("run")(run.run)
app.command("merge")(merge.merge)
app.command("validate")(preview.validate)
app.command("plan")(preview.plan)
app.command("list")(listing.show)
app.command("report")(saved.report)
app.command("replay")(saved.replay)
app.command("verify")(verify.verify)
app.command("reproduce")(reproduce.reproduce)
app.command("compare")(compare.compare)
app.command("filter")(filter.filter_recorded)
app.command("perf")(perf.perf)
app.command("new")(new.new)
app.command("schema")(schema.schema)
app.command("doctor")(preview.doctor)
