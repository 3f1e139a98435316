"""How initial states are drawn, and the weighted nodes that stand for them in exact references.

`matched` draws d, a symmetric truncated normal: |d| <= .84, variance exactly .16 (chosen). It has the first three
moments that filters assume for N(0, .16), and a bound, which keeps the scalar system from finite escape.
"""

from __future__ import annotations

from typing import Any

MATCHED_VARIANCE = 0.16
MATCHED_BOUND = 0.84
MATCHED_DEVIATION = 0.5003729518  # before truncation at the bound; the variance after it is MATCHED_VARIANCE


def matched(key: Any, shape: tuple[int, ...]) -> Any:
    """Independent draws of d."""
    import jax

    bound = MATCHED_BOUND / MATCHED_DEVIATION
    return MATCHED_DEVIATION * jax.random.truncated_normal(key, -bound, bound, shape)


def corrected(normals: Any) -> Any:
    """A set (size, n) whose columns have exactly zero mean and unit mean square (Culver 1969, 7.2 and 8.2)."""
    centred = normals - normals.mean(0)
    return centred / (centred**2).mean(0) ** 0.5


def normal_nodes(low: float, high: float, mean: float, deviation: float, count: int) -> tuple[Any, Any]:
    """Gauss-Legendre nodes on [low, high], with the density of N(mean, deviation^2) there as weights of sum one."""
    import numpy as np

    nodes, lengths = np.polynomial.legendre.leggauss(count)
    points = (low + high) / 2 + (high - low) / 2 * nodes
    weights = lengths * np.exp(-0.5 * ((points - mean) / deviation) ** 2)
    return points, weights / weights.sum()
