"""Counts of a compiled program, which have no noise: operations, bytes, instructions."""

from __future__ import annotations

import re
from typing import Any

BUDGET = 0.05
COUNTS = ("compilations", "traces", "flops", "bytes", "instructions")
_INSTRUCTION = re.compile(r"^\s+(ROOT )?%?[\w.-]+ = ", re.MULTILINE)


def counted(program: Any, compilations: int, traces: int) -> dict[str, float]:
    """Counts of a compiled program; those that the device does not tell are left out.

    flops and bytes as XLA counts them: the body of a loop once.
    """
    costs = program.cost_analysis() or {}
    costs = costs[0] if isinstance(costs, list) else costs
    found = {"compilations": compilations, "traces": traces, "flops": costs.get("flops")}
    found |= {
        "bytes": costs.get("bytes accessed"),
        "instructions": len(_INSTRUCTION.findall(program.as_text())),
    }
    return {name: float(value) for name, value in found.items() if value is not None and value > 0}


def risen(now: dict[str, float], before: dict[str, float], budget: float = BUDGET) -> dict[str, float]:
    """Counts that rose beyond the budget, each as a factor."""
    shared = [name for name in COUNTS if name in now and before.get(name, 0) > 0]
    return {name: now[name] / before[name] for name in shared if now[name] > before[name] * (1 + budget)}
