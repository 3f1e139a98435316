"""Claim: imports only go down the chain of the data, and quick modules load no numerical library."""

from __future__ import annotations

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import nlbench

ROOT = Path(nlbench.__file__).parent
MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix("__init__").rstrip("."): path
    for path in ROOT.rglob("*.py")
}
# What each layer may import besides itself. A module belongs to the longest name that its own starts with.
BASE = {"errors", "suggestions", "checks", "runtime"}
CORE = {"algebra", "moments", "updates", "schedule", "systems.system", "systems.discrete", "filters.filter"}
ALLOWED: dict[str, set[str]] = {
    "": set(),
    "errors": set(),
    "suggestions": set(),
    "checks": {"errors", "suggestions"},
    "runtime": {"errors"},
    "schedule": set(),
    "names": set(),
    "blame": {"errors"},
    "shapes": set(),
    "samples": {"errors", "schedule", "systems.discrete", "filters.filter"},
    "algebra": set(),
    "orbit": {"runtime"},
    "moments": {"algebra"},
    "updates": {"algebra", "moments"},
    "systems.system": {"shapes"},
    "systems.discrete": {"systems.system"},
    "systems.exact": set(),
    "systems": {
        "plugins",
        "systems.system",
        "systems.discrete",
        "systems.exact",
        "moments",
        "orbit",
        "errors",
        "checks",
    },
    "simulate": {"systems.system", "systems.discrete", "schedule", "algebra", "moments"},
    "filters.filter": {"algebra"},
    "row": set(),
    "solvers": {"row"},
    "plugins": {"blame", "errors", "suggestions", "runtime", "row"},
    "continuous.catalogue": {"row", "solvers"},
    "discrete.catalogue": {"row"},
    "discrete": {"errors", "checks", "shapes", *CORE},
    "filters.catalogue": {"plugins", "row", "solvers", "continuous.catalogue", "discrete.catalogue"},
    "references": {"errors", "discrete", "discrete.catalogue", "systems.exact", *CORE},
    "continuous": {"row", "continuous.catalogue", "errors", *CORE},
    "filters": {
        "plugins",
        "row",
        "filters.catalogue",
        "continuous",
        "discrete",
        "references",
        "names",
        "blame",
        "samples",
        "shapes",
        *BASE,
        *CORE,
    },
    "config": {"plugins", "systems", "filters.catalogue", "schedule", "errors", "suggestions", "runtime"},
    "statistics": set(),
    "results": {"config", "errors"},
    "engine": {
        "plugins",
        "config",
        "systems",
        "systems.exact",
        "simulate",
        "filters",
        "orbit",
        "samples",
        "statistics",
        "results",
        *BASE,
        *CORE,
    },
    "comparison": {"config", "statistics", "results", "errors", "suggestions"},
    "figures": {"results", "names", "errors"},
    "report": {"results", "figures", "errors"},
    "reproduce": {
        "config",
        "statistics",
        "results",
        "figures",
        "report",
        "filters",
        "algebra",
        "moments",
        "systems.system",
        *BASE,
    },
    "doctor": {"engine", *BASE},
    "perf": {"config", "engine", "results", *BASE},
    "notebook": {"engine", "results", "figures", "report", "errors", "suggestions"},
    "cli": {
        "plugins",
        "config",
        "systems",
        "filters.catalogue",
        "engine",
        "results",
        "comparison",
        "figures",
        "report",
        "reproduce",
        "doctor",
        "perf",
        *BASE,
    },
    "__main__": {"cli"},
}
HEAVY = ("jax", "numpy", "pandas", "matplotlib", "diffrax", "equinox", "pyarrow", "scipy")
QUICK = ("nlbench", "nlbench.errors", "nlbench.config", "nlbench.systems", "nlbench.systems.culver_scalar",
         "nlbench.filters", "nlbench.filters.catalogue", "nlbench.cli")  # fmt: skip


def layer(module):
    return max((name for name in ALLOWED if f"{module}.".startswith(f"{name}." if name else "")), key=len)


def imports(path):
    """Modules that a file imports when it runs; those under `if TYPE_CHECKING` only name types."""
    tree = ast.parse(path.read_text())
    skipped = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner.removeprefix("nlbench.") in MODULES else str(node.module)


def own(names):
    return {name.removeprefix("nlbench").lstrip(".") for name in names if name.split(".")[0] == "nlbench"}


def test_the_layers_form_no_circle():
    assert set(TopologicalSorter(ALLOWED).static_order()) >= set(ALLOWED)  # raises CycleError at a circle


def test_every_layer_exists():
    """A name that is renamed must not leave an empty rule behind."""
    assert set(ALLOWED) == {layer(module) for module in MODULES}


@pytest.mark.parametrize("module", sorted(MODULES))
def test_imports_go_down(module):
    here = layer(module)
    for name in own(imports(MODULES[module])):
        assert layer(name) == here or layer(name) in ALLOWED[here], name


def test_no_filter_imports_another_filter():
    """What two filters share lives below them."""
    shared = {"filters", "filters.catalogue", "filters.filter", "filters.called", "filters.constants"}
    filters = {name for name in MODULES if name.startswith("filters.")} - shared
    for module in filters:
        assert not own(imports(MODULES[module])) & (filters - {module})


def test_what_must_be_quick_loads_no_numerical_library():
    program = f"""
import sys, {", ".join(QUICK)}
nlbench.systems.parameters("culver-scalar")()
print(*sorted(set({HEAVY!r}) & set(sys.modules)))
"""
    python = [sys.executable, "-c", program]
    loaded = subprocess.run(python, capture_output=True, text=True, check=True, cwd=ROOT.parent).stdout
    assert loaded.split() == []
