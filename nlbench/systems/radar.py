"""What a radar measures of a position relative to it, and how two such measurements differ."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from nlbench.orbit import wrapped


def range_azimuth_elevation(position: Any) -> Any:
    """sqrt(x^2 + y^2 + z^2), atan2(y, x) and atan2(z, sqrt(x^2 + y^2)) of a position (3,), as (3,)."""
    x, y, z = position
    level = x * x + y * y
    return jnp.stack([jnp.sqrt(level + z * z), jnp.arctan2(y, x), jnp.arctan2(z, jnp.sqrt(level))])


def residual(y: Any, h: Any) -> Any:
    """y - h (3 r,) of r radars, each with range, azimuth and elevation; the azimuths' are in [-pi, pi]."""
    difference = y - h
    return difference.at[1::3].set(wrapped(difference[1::3]))
