"""Statistics of kept runs, with the influence of every single run on them.

The influence of run i is n times the first-order change of a statistic when the run is counted once more. Its mean is
zero; its standard deviation over sqrt(n - 1) is the standard error, and that of the difference of two influences the
standard error of a difference on the same runs. With x the errors, m their mean, c_k their central moments:
    root mean square    (x^2 - mean x^2)/(2 rms)
    mean                x - m
    variance            (x - m)^2 - c_2
    third moment        (x - m)^3 - c_3 - 3 c_2 (x - m)
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nlbench.statistics.comparisons import Quantity
from nlbench.statistics.sets import KeptTable
from nlbench.statistics.uncertainty import NORMAL_975

ROOTS = ("rms", "rms_clipped")
SUFFIXES: dict[str, tuple[str, ...]] = {"variance_estimated": ("_variance",), "third_estimated": ("_third",)}
SUFFIXES |= {"nees": ("", "_variance"), "coverage_95": ("", "_variance")}
SUFFIXES |= dict.fromkeys(("mean_error", "variance_actual", "third_actual"), ("",))


class PerRun(NamedTuple):
    """What enters a statistic, of every kept run, and which runs count: arrays (runs,)."""

    values: np.ndarray
    counted: np.ndarray


class Influences(NamedTuple):
    """A statistic and the influence of each run, (runs,)."""

    value: float
    influence: np.ndarray


def per_run(kept: KeptTable, quantity: Quantity) -> PerRun | None:
    """None for a statistic that cannot be had from what was kept."""
    statistic, coordinate = quantity.statistic, quantity.coordinate
    members = kept.norms.get(coordinate, [coordinate])
    if statistic in ROOTS:
        names = list(members)
    elif statistic in SUFFIXES and len(members) == 1:
        names = [f"{coordinate}{suffix}" for suffix in SUFFIXES[statistic]]
    else:
        return None
    found = kept.columns(quantity.filter, float(quantity.time), [*names, "diverged"])
    if found is None:
        return None
    *columns, lost = found
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        if statistic in ROOTS:
            square = np.square(columns).sum(0)
            if statistic == "rms":
                return PerRun(square, ~lost)
            most = kept.clip.get(coordinate, math.inf) ** 2
            return PerRun(np.where(lost, most, np.minimum(square, most)), np.ones_like(~lost))
        first = columns[0].astype(float)
        if statistic == "nees":
            return PerRun(first**2 / columns[1], ~lost & (columns[1] > 0))
        if statistic == "coverage_95":
            return PerRun((first**2 <= NORMAL_975**2 * columns[1]).astype(float), ~lost)
        return PerRun(first, ~lost)


def influences(statistic: str, values: np.ndarray) -> Influences:
    """A statistic of the values of runs that count."""
    if not len(values):
        return Influences(math.nan, values)
    mean = float(values.mean())
    deviation = values - mean
    if statistic in ROOTS:
        root = math.sqrt(mean)
        return Influences(root, deviation / (2 * root) if root else deviation)
    if statistic == "variance_actual":
        square = deviation**2
        return Influences(float(square.mean()), square - square.mean())
    if statistic == "third_actual":
        cube, variance = deviation**3, (deviation**2).mean()
        return Influences(float(cube.mean()), cube - cube.mean() - 3 * variance * deviation)
    return Influences(mean, deviation)
