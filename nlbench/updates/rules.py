"""Rules of integration against the standard normal density of n dimensions: nodes and the logarithms of weights."""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np

WIDTH = 8.5  # of the even rule, in standard deviations; what lies beyond is below 1e-16


class Rule(NamedTuple):
    """E g = sum of exp(log_weights) g(nodes); nodes (q, n), log_weights (q,)."""

    nodes: np.ndarray
    log_weights: np.ndarray


@cache
def gauss_hermite(n: int, points: int) -> Rule:
    """Exact for polynomials of degree 2 points - 1 in each of the n dimensions."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(points)
    return _tensor_product(n, nodes, np.log(weights / weights.sum()))


@cache
def even(n: int, points: int) -> Rule:
    """Equal steps from -8.5 to 8.5 in each of the n dimensions; the error falls faster than any power of the step."""
    nodes = np.linspace(-WIDTH, WIDTH, points)
    return _tensor_product(n, nodes, np.log(nodes[1] - nodes[0]) - 0.5 * (nodes**2 + np.log(2 * np.pi)))


def _tensor_product(n: int, nodes: np.ndarray, log_weights: np.ndarray) -> Rule:
    return Rule(
        np.array(list(product(nodes, repeat=n))),
        np.array([sum(each) for each in product(log_weights, repeat=n)]),
    )
