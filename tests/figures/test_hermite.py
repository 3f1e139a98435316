"""Claim: a series has the moments that it is made from, and an average of densities is that of every run's own."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nlbench.figures import hermite, style
from nlbench.figures.hermite_densities import hermite_densities


def moments(z, density, order):
    """Raw moments by the trapezoidal rule, which is exact to rounding for what vanishes at both ends."""
    return [float((density * z**k).sum() * (z[1] - z[0])) for k in range(order + 1)]


def test_a_series_matches_the_first_seven_central_moments_of_the_errors():
    errors = 0.3 * np.random.default_rng(2).gamma(5.0, size=400) - 1.0
    at = np.linspace(-12, 12, 8001)
    mean = errors.mean()
    series = hermite.matched(errors, at + mean, order=7)
    expected = [((errors - mean) ** k).mean() for k in range(8)]
    np.testing.assert_allclose(moments(at, series, 7), expected, rtol=1e-9, atol=1e-12)


def test_it_does_not_match_the_eighth():
    errors = np.random.default_rng(2).gamma(5.0, size=400)
    at = np.linspace(-40, 40, 8001)
    series = hermite.matched(errors, at + errors.mean(), order=7)
    assert moments(at, series, 8)[8] != pytest.approx(((errors - errors.mean()) ** 8).mean(), rel=1e-3)


def test_the_third_order_is_the_hermite_density_of_the_thesis():
    z = np.linspace(-4, 4, 17)
    expected = np.exp(-(z**2) / 2) / math.sqrt(2 * math.pi) * (1 + 0.7 / 6 * (z**3 - 3 * z))
    np.testing.assert_allclose(hermite.density(z, np.array([1, 0, 0, 0.7 / 6])), expected, rtol=1e-13)


def test_an_average_is_that_of_the_densities_of_the_single_runs():
    generator = np.random.default_rng(3)
    variance = generator.uniform(0.5, 2.0, 300)
    third = generator.normal(0.3, 0.4, 300)
    edges = np.linspace(-3, 3, 13)
    fine = np.linspace(-3, 3, 12 * 400 + 1)
    z = fine / np.sqrt(variance)[:, None]
    each = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi * variance)[:, None]
    each *= 1 + (third / variance**1.5)[:, None] / 6 * (z**3 - 3 * z)
    mean = each.mean(0)
    expected = [np.trapezoid(mean[i : i + 401], fine[i : i + 401]) / 0.5 for i in range(0, 4800, 400)]
    # Variances that differ by WIDTH are taken as one, which is felt in the second order.
    np.testing.assert_allclose(hermite.average(variance, third, edges), expected, atol=hermite.WIDTH**2)


def test_the_narrowest_density_has_its_whole_weight():
    edges = np.linspace(-1, 1, 100)
    cells = hermite.average(np.array([1e-20, 1e-20]), np.array([0.0, 0.0]), edges)
    assert cells.sum() * (edges[1] - edges[0]) == pytest.approx(1.0, abs=1e-12)


def test_the_thesis_figure_shows_a_gaussian_and_two_skewed_densities_of_the_same_variance():
    with style.context("hermite_densities"):
        picture = hermite_densities()
    curves = [line for line in picture.figure.axes[0].lines if len(line.get_xdata()) > 2]
    found = [moments(line.get_xdata(), line.get_ydata(), 3) for line in curves]
    expected = [[1, 0, 1, 0], [1, 0, 1, 0.5], [1, 0, 1, 1.5]]
    # Beyond 4.5 lie, of the third moment, 2 (1.5/6) times the integral of z^3 He_3 phi: 0.0157.
    np.testing.assert_allclose(found, expected, atol=0.016)
    assert "Gaussian: highest at 0;" in picture.description
    assert "down to -0.02 at -2.65" in picture.description
