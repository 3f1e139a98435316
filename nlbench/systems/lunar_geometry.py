"""The functions of `lunar-orbit`, for a filter in Cartesian or in polar coordinates; the truth is Cartesian."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from nlbench import orbit
from nlbench.moments.moments import Moments


class Geometry(NamedTuple):
    """An orbit in the units of the experiment, and the coordinates of the filter's state.

    mu: of the moon. moon: its radius. r0, v0: radius and speed of the nominal orbit at the start.
    variances: (4,), of the Cartesian state at the start. landmarks: central angles. axes: those of the errors.
    """

    mu: float
    moon: float
    r0: float
    v0: float
    variances: tuple[float, ...]
    landmarks: tuple[float, ...]
    polar: bool
    axes: str

    def drift(self, t: Any, x: Any) -> Any:
        """dx/dt (4,)."""
        return orbit.polar_drift(x, self.mu, self.r0) if self.polar else orbit.cartesian_drift(x, self.mu)

    def cartesian(self, x: Any) -> Any:
        """The Cartesian state (4,) of a filter's."""
        return orbit.cartesian(x, self.r0) if self.polar else x

    def central_angle(self, x: Any) -> Any:
        """Of a filter's state."""
        return x[1] / self.r0 if self.polar else jnp.arctan2(x[1], x[0])

    def observe(self, landmark: Any, x: Any) -> Any:
        """phi (1,) of a landmark, by its central angle."""
        return jnp.stack([orbit.landmark_angle(self.cartesian(x), landmark, self.moon)])

    def observe_nearest(self, t: Any, x: Any) -> Any:
        """phi (1,) of the landmark nearest to the state: where it is not said which was sighted."""
        angles = jnp.array(self.landmarks)
        nearest = jnp.argmax(jnp.cos(self.central_angle(x) - angles))
        return self.observe(angles[nearest], x)

    def error(self, x: Any, m: Any) -> Any:
        """Errors (4,) of an estimate m against the Cartesian true state x, in `axes`."""
        if self.axes == "polar":
            estimate = m if self.polar else orbit.polar(m, self.r0)
            r, arc, rate, arc_rate = orbit.polar(x, self.r0) - estimate
            return jnp.stack([r, self.r0 * orbit.wrapped(arc / self.r0), rate, arc_rate])
        error = x - self.cartesian(m)
        return error if self.axes == "cartesian" else orbit.local_vertical_error(error, x)

    def lost(self, error: Any) -> Any:
        """Whether an estimate is farther from the truth than two points of the nominal orbit can be."""
        return error[0] ** 2 + error[1] ** 2 > (2.0 * self.r0) ** 2

    def start(self, transformed: bool) -> Moments:
        """What a filter starts from. r = x and s = y there, so the means are the same numbers in both coordinates.

        transformed: of a polar filter, whether its covariance is the Cartesian one carried over.
        """
        cov = np.diag(self.variances)
        if self.polar and transformed:
            J = np.eye(4)
            J[2, 1], J[3, 0] = self.v0 / self.r0, -self.v0 / self.r0
            cov = J @ cov @ J.T
        return Moments(mean=np.array([self.r0, 0.0, 0.0, self.v0]), cov=cov)

    def at_pattern(self, sigma: float, pattern: str) -> Any:
        """Cartesian states (k, 4) `sigma` standard deviations from the mean: with the given signs (k = 1), such as
        "++-+", or with all of the 16 patterns."""
        every = [[1.0 - 2.0 * (number >> place & 1) for place in (3, 2, 1, 0)] for number in range(16)]
        one = [1.0 if sign == "+" else -1.0 for sign in pattern]
        signs = np.array(every if pattern == "all" else [one])
        return np.array([self.r0, 0.0, 0.0, self.v0]) + sigma * signs * np.sqrt(self.variances)


def wrapped_residual(y: Any, h: Any) -> Any:
    """y - h (m,) for angles."""
    return orbit.wrapped(y - h)
