"""Athans's second-order filter and the Gaussian one: the equations of `second_order`. State: mean and covariance."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from nlbench.discrete import gaussian
from nlbench.discrete.second_order import local, step, update

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter
    from nlbench.row import Row
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System


def build(name: str, row: Row, system: System | DiscreteSystem, options: Any) -> Filter:
    """`sof` or `sof-gaussian`."""
    whole = name == "sof-gaussian"
    return gaussian.build(
        name, system, options, partial(step, whole), partial(local, whole), partial(update, whole)
    )
