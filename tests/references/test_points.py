"""Claim: the weighted points integrate polynomials of the fifth degree, and those of the radius of a far higher one."""

from __future__ import annotations

import math
from itertools import combinations_with_replacement

import jax
import numpy as np
import pytest

from nlbench.references.points import normal_points


def normal_moment(powers):
    """E of a product of powers of independent standard normal numbers."""
    return math.prod(0 if k % 2 else math.prod(range(1, k, 2)) for k in powers)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
def test_moments_to_the_fifth_are_those_of_the_normal_law(n):
    u, log_weights = normal_points(jax.random.key(2), n, 3, 2)
    assert u.shape == (n, 3 * 2 * (2 * n + 2**n))
    w, u = np.exp(log_weights), np.asarray(u)
    for degree in range(6):
        for index in combinations_with_replacement(range(n), degree):
            powers = np.bincount(np.array(index, int), minlength=n)
            mine = w @ np.prod(u ** powers[:, None], axis=0)
            np.testing.assert_allclose(mine, normal_moment(powers), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("n", [1, 4])
def test_powers_of_the_radius_are_exact_to_twice_the_number_of_radii(n):
    """E r^(2 k) = n (n + 2) ... (n + 2 k - 2), for k < 2 x 5."""
    u, log_weights = normal_points(jax.random.key(2), n, 5, 1)
    square = np.square(u).sum(axis=0)
    for k in range(10):
        np.testing.assert_allclose(
            np.exp(log_weights) @ square**k, math.prod(n + 2 * i for i in range(k)), rtol=1e-11
        )


def test_rotations_differ_between_radii_and_keys():
    one, other = (np.asarray(normal_points(jax.random.key(k), 4, 2, 1).u) for k in (2, 3))
    inner, outer = one.reshape(4, 24, 2)[..., 0], one.reshape(4, 24, 2)[..., 1]
    assert not np.allclose(inner / np.linalg.norm(inner, axis=0), outer / np.linalg.norm(outer, axis=0))
    assert not np.allclose(one, other)
