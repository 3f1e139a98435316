"""Planar two-body motion and the sighting of a landmark (Culver 1969, section 8.3), as functions of one state.

States are Cartesian, x = (x, y, dx/dt, dy/dt), or polar, p = (r, s, dr/dt, ds/dt) with s = r0 theta, an arc on the
nominal orbit of radius r0. Any consistent units; angles in radians. Derivatives are jax's; `numpy` arrays are accepted.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.runtime import ensure_precision


class Expansion(NamedTuple):
    """Second-order expansion of a function about x: value + first_ia e_a + second_iab e_a e_b.

    For a function to (k,): value (k,), first (k, n), second (k, n, n); without the leading axis for a scalar one.
    second is half the matrix of second derivatives, symmetric.
    """

    value: Any
    first: Any
    second: Any


def cartesian_drift(x: Any, mu: float) -> Any:
    """dx/dt (4,) under the attraction mu/r^2 (8.20)."""
    X, Y, U, V = x
    r = jnp.sqrt(X * X + Y * Y)
    g = -mu / (r * r * r)
    return jnp.stack([U, V, g * X, g * Y])


def polar_drift(p: Any, mu: float, r0: float) -> Any:
    """dp/dt (4,): (8.15)-(8.16) with s = r0 theta."""
    r, _, rate, arc_rate = p
    turning = arc_rate / r0
    return jnp.stack([rate, arc_rate, r * turning * turning - mu / (r * r), -2.0 * rate * arc_rate / r])


def landmark_angle(x: Any, landmark: Any, radius: float) -> Any:
    """The angle phi of the line from a Cartesian state x (only its position counts) to a landmark, in (-pi, pi].

    landmark: its central angle. radius: of the body that it lies on.
    (8.28) in the form atan2(R sin - y, R cos - x), equal to it modulo 2 pi on the visible side.
    """
    ensure_precision()
    return jnp.arctan2(radius * jnp.sin(landmark) - x[1], radius * jnp.cos(landmark) - x[0])


def expand_landmark_angle(x: Any, landmark: Any, radius: float) -> Expansion:
    """phi, H (4,) and M (4, 4) of (8.30)-(8.32), M symmetric."""
    return _expanded(lambda x: landmark_angle(x, landmark, radius), x)


def expand_cartesian_drift(x: Any, mu: float) -> Expansion:
    """f (4,), F (4, 4) and A (4, 4, 4) of (8.24)-(8.26), A symmetric in its last two indices."""
    return _expanded(lambda x: cartesian_drift(x, mu), x)


def local_vertical_error(error: Any, x: Any) -> Any:
    """A Cartesian error (4,) resolved at the true state x (4,): altitude, range, altitude rate, range rate."""
    ensure_precision()
    r = jnp.sqrt(x[0] * x[0] + x[1] * x[1])
    c, s = x[0] / r, x[1] / r
    return jnp.stack(
        [
            c * error[0] + s * error[1],
            c * error[1] - s * error[0],
            c * error[2] + s * error[3],
            c * error[3] - s * error[2],
        ]
    )


def polar(x: Any, r0: float) -> Any:
    """The polar state (4,) of a Cartesian one, theta in (-pi, pi]."""
    X, Y, U, V = x
    r = jnp.sqrt(X * X + Y * Y)
    turning = (X * V - Y * U) / (r * r)
    return jnp.stack([r, r0 * jnp.arctan2(Y, X), (X * U + Y * V) / r, r0 * turning])


def cartesian(p: Any, r0: float) -> Any:
    """The Cartesian state (4,) of a polar one."""
    r, arc, rate, arc_rate = p
    c, s = jnp.cos(arc / r0), jnp.sin(arc / r0)
    across = r * arc_rate / r0
    return jnp.stack([r * c, r * s, rate * c - across * s, rate * s + across * c])


def wrapped(angle: Any) -> Any:
    """The angle less the nearest multiple of 2 pi: in [-pi, pi]."""
    return angle - 2 * math.pi * jnp.round(angle / (2 * math.pi))


def _expanded(function: Any, x: Any) -> Expansion:
    ensure_precision()
    x = jnp.asarray(x, float)
    return Expansion(function(x), jax.jacfwd(function)(x), jax.hessian(function)(x) / 2)
