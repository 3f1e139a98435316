"""Power sums, or raw moments, about another origin."""

import numpy as np


def shifted(sums: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """From the sums of d^k, k = 0, 1, ... along the first axis, those of (d + shift)^k."""
    moved = np.array(sums, np.float64)
    # Pascal's triangle, one row a pass: after pass i the sums up to order i + 1 are right.
    for i in range(len(moved) - 1):
        moved[i + 1 :] += shift * moved[i:-1]
    return moved
