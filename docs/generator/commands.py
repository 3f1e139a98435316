"""The reference of the command line, from the commands themselves."""

from __future__ import annotations

import inspect
from typing import Any

from typer.main import get_command

from docs.generator.text import cell, escaped, table
from nlbench.cli.app import EPILOG, app


def page(written: str) -> str:
    """The page, after what was written by hand."""
    parts = [written.rstrip()]
    group: Any = get_command(app)
    for name, command in group.commands.items():
        parts += [
            f"## nlbench {name}",
            escaped(inspect.cleandoc(command.help or "").replace("\b", "").strip()),
        ]
        rows = [_row(each) for each in command.params if not getattr(each, "hidden", False)]
        parts.append(table(("argument or option", "means", "default"), [row for row in rows if row]))
    codes = EPILOG.replace("\b", "").strip("\n")
    return "\n\n".join([*parts, "## Exit codes", f"```text\n{codes}\n```"]) + "\n"


def _row(parameter: Any) -> tuple[str, str, str]:
    option = parameter.param_type_name == "option"
    names = ", ".join([*parameter.opts, *parameter.secondary_opts])
    metavar = parameter.metavar or (
        "" if getattr(parameter, "is_flag", False) else str(parameter.name).upper()
    )
    shown = f"{names} {metavar}".strip() if option else metavar
    said = getattr(parameter, "help", None) or ("" if option else "what to list")
    silent = parameter.default in (None, False) or not option or callable(parameter.default)
    return f"`{shown}`", cell(said), "" if silent else cell(str(parameter.default))
