"""Claim: a radar's range and angles are those of spherical coordinates, and differences of azimuths are wrapped."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.systems import radar

nb.configure()


@pytest.mark.parametrize("azimuth", [-3.1, -1.0, 0.0, 2.0, 3.1])
@pytest.mark.parametrize("elevation", [-0.4, 0.0, 1.5])
def test_measures_spherical_coordinates(azimuth, elevation):
    level = 7e4 * np.cos(elevation)
    position = [level * np.cos(azimuth), level * np.sin(azimuth), 7e4 * np.sin(elevation)]
    seen = radar.range_azimuth_elevation(jnp.array(position))
    np.testing.assert_allclose(seen, [7e4, azimuth, elevation], rtol=1e-13, atol=1e-13)


def test_only_azimuths_are_wrapped():
    """A range may differ by more than pi metres, whichever radar measured it."""
    y = jnp.array([2e4, 3.1, 0.3, 2e4, -3.1, 0.3])
    h = jnp.array([1e4, -3.1, 0.1, 1e4, 3.1, 0.1])
    short = 6.2 - 2 * np.pi
    np.testing.assert_allclose(radar.residual(y, h), [1e4, short, 0.2, 1e4, -short, 0.2], atol=1e-14)
