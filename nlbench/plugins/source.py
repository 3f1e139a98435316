"""From a plug-in's file to what it brings: read, run, and everything it declares checked, each step with its error."""

from __future__ import annotations

import hashlib
import re
import sys
import types
from pathlib import Path
from typing import Any

from nlbench import runtime
from nlbench.blame import locate_step
from nlbench.errors import ConfigError, Problem
from nlbench.plugins.plugin import Entry, Kind, Plugin
from nlbench.plugins.signature import entry_of
from nlbench.suggestions import suggestion

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9-]*")
DECLARATIONS: dict[str, Kind] = {"SYSTEMS": "systems", "FILTERS": "filters"}
EXAMPLE = {
    "SYSTEMS": 'SYSTEMS = {"van-der-pol": van_der_pol}',
    "FILTERS": 'FILTERS = {"my-filter": my_filter}',
}


def of_file(path: str | Path) -> Plugin:
    """The plug-in in a file, which is run. Raises `ConfigError` saying which step failed."""
    name = str(path)
    if not name.endswith(".py"):
        raise ConfigError([Problem("a plug-in is a Python file, FILE.py", file=name)])
    try:
        text = Path(name).read_text("utf-8")
    except FileNotFoundError:
        others = [each.name for each in Path(name).parent.glob("*.py")] if Path(name).parent.is_dir() else []
        near = suggestion(Path(name).name, others)
        raise ConfigError([Problem(f"cannot read the plug-in: no such file{near}", file=name)]) from None
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not text in UTF-8"
        raise ConfigError([Problem(f"cannot read the plug-in: {reason}", file=name)]) from None
    return executed(text, name)


def executed(text: str, path: str) -> Plugin:
    """The plug-in that a source text declares when it is run. Raises `ConfigError`."""
    digest = digest_of(text)
    module = types.ModuleType(f"nlbench_plugin_{digest}")
    module.__file__ = path
    runtime.prepare()  # it may compute something at once, after which XLA ignores its options
    sys.modules[module.__name__] = module  # where the types of its annotations are looked up
    try:
        exec(compile(text, path, "exec", dont_inherit=True), module.__dict__)
    except (Exception, SystemExit) as error:
        del sys.modules[module.__name__]
        raise ConfigError([locate_step(error, path, "importing it failed")]) from None
    systems, filters = declared(module, path)
    return Plugin(Path(path).name, digest, path, text, systems, filters)


def digest_of(text: str) -> str:
    """What identifies a source text in results."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def declared(module: Any, path: str) -> tuple[dict[str, Entry], dict[str, Entry]]:
    """The systems and filters that a module declares. Raises `ConfigError` with everything that is wrong."""
    if not any(hasattr(module, name) for name in DECLARATIONS):
        near = [name for name in vars(module) if name.lower() in ("system", "filter", "systems", "filters")]
        found = f" (found '{near[0]}')" if near else ""
        message = (
            f"declares nothing{found}; expected a line such as {EXAMPLE['SYSTEMS']} or {EXAMPLE['FILTERS']}"
        )
        raise ConfigError([Problem(message, file=path)])
    entries: dict[Kind, dict[str, Entry]] = {"systems": {}, "filters": {}}
    problems = []
    for declaration, kind in DECLARATIONS.items():
        given = getattr(module, declaration, {})
        if not isinstance(given, dict):
            message = (
                f"{declaration}: expected a dict such as {EXAMPLE[declaration]}, found {type(given).__name__}"
            )
            problems.append(Problem(message, file=path))
            continue
        for name, factory in given.items():
            try:
                entries[kind][_named(name, declaration, path)] = entry_of(factory, kind, str(name), path)
            except ConfigError as error:
                problems += error.problems
    if problems:
        raise ConfigError(problems)
    return entries["systems"], entries["filters"]


def _named(name: Any, declaration: str, path: str) -> str:
    if not isinstance(name, str) or not NAME.fullmatch(name):
        message = f"{declaration}: expected a name of a-z 0-9 - or A-Z, such as 'van-der-pol', found {name!r}"
        raise ConfigError([Problem(message, file=path)])
    return name
