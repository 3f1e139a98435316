"""Claim: the closed-form inverse, determinant and definiteness of small symmetric matrices are NumPy's."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from nlbench.algebra import Tensor, inverse, ldl, log_determinant, positive_definite, squared_distance
from tests.oracle import random_cov, rng

SIZES = pytest.mark.parametrize("m", [1, 2, 3, 4])


def symmetric(array, known=False):
    array = np.asarray(array, dtype=float)
    return Tensor.from_array(array if known else jnp.asarray(array), ((0, 1),))


def hilbert(m):
    return np.array([[1 / (i + j + 1) for j in range(m)] for i in range(m)])


@SIZES
@pytest.mark.parametrize("known", [True, False])
def test_inverse_equals_numpy(m, known):
    for seed in range(5):
        matrix = random_cov(rng(seed), m)
        expected = np.linalg.inv(matrix)
        actual = np.asarray(inverse(symmetric(matrix, known)).to_array())
        np.testing.assert_allclose(actual, expected, rtol=1e-10, atol=1e-12 * np.abs(expected).max())


@SIZES
def test_inverse_of_an_ill_conditioned_matrix_loses_no_more_than_its_condition(m):
    """Hilbert matrices (condition 1.6e4 at m = 4): the residual stays within condition times rounding."""
    matrix = hilbert(m)
    residual = np.asarray(inverse(symmetric(matrix)).to_array()) @ matrix - np.eye(m)
    assert np.abs(residual).max() < 20 * np.linalg.cond(matrix) * np.finfo(float).eps


@SIZES
def test_inverse_of_an_indefinite_matrix_equals_numpy(m):
    """The guard looks at covariances that are no longer positive; their inverse must still be right."""
    matrix = random_cov(rng(3), m) - 0.3 * np.eye(m)
    np.testing.assert_allclose(
        np.asarray(inverse(symmetric(matrix)).to_array()) @ matrix, np.eye(m), atol=1e-9
    )


@SIZES
def test_log_determinant_equals_numpy(m):
    for seed in range(5):
        matrix = random_cov(rng(seed), m)
        np.testing.assert_allclose(
            log_determinant(symmetric(matrix)), np.linalg.slogdet(matrix)[1], rtol=1e-11
        )


@SIZES
@pytest.mark.parametrize("units", [1.0, 1e5])
def test_squared_distance_equals_numpy_whatever_the_units_of_the_coordinates(m, units):
    scale = np.diag(units ** np.arange(m))
    for seed in range(5):
        matrix, vector = random_cov(rng(seed), m), rng(seed + 50).normal(size=m)
        expected = vector @ np.linalg.solve(matrix, vector)
        given = Tensor.from_array(jnp.asarray(scale @ vector), ((0,),))
        found = squared_distance(symmetric(scale @ matrix @ scale), given)
        np.testing.assert_allclose(found, expected, rtol=1e-10)


@SIZES
def test_ldl_rebuilds_the_matrix(m):
    matrix = random_cov(rng(7), m)
    lower, pivots = ldl(symmetric(matrix))
    low = np.asarray(lower.to_array())
    np.testing.assert_allclose(low @ np.diag(np.array(pivots, dtype=float)) @ low.T, matrix, atol=1e-13)
    np.testing.assert_array_equal(np.triu(low, 1), 0)


@SIZES
def test_positive_definite_is_what_the_eigenvalues_say(m):
    verdicts = []
    for seed in range(30):
        matrix = random_cov(rng(seed), m) - 0.25 * rng(seed).uniform() * np.eye(m)
        smallest = np.linalg.eigvalsh(matrix).min()
        verdicts.append(smallest > 0)
        assert bool(positive_definite(symmetric(matrix))) == (smallest > 0), smallest
    assert True in verdicts
    assert m == 1 or False in verdicts


@pytest.mark.parametrize("diagonal", [(1.0, 0.0), (1.0, -1.0), (0.0, 1.0), (1.0, np.nan), (np.nan, 1.0)])
def test_singular_indefinite_and_nan_matrices_are_not_positive_definite(diagonal):
    assert not bool(positive_definite(symmetric(np.diag(diagonal))))
    assert not bool(jax.jit(lambda d: positive_definite(symmetric_diagonal(d)))(jnp.array(diagonal)))


def symmetric_diagonal(d):
    return Tensor((2, 2), ((0, 1),), {(0, 0): d[0], (1, 1): d[1]})


def test_a_diagonal_matrix_inverts_without_filling_in():
    assert set(inverse(symmetric(np.diag([2.0, 4.0, 5.0]), known=True)).entries) == {(0, 0), (1, 1), (2, 2)}
