"""The posterior of a system without process noise, as a density of the initial state, by importance sampling.

The state is a known map of x(0) = m0 + L z, L L' = P0, so with rho_j(z) the whitened residual of measurement j,
  (1) -log p(z | y_1 ... y_k) = |z|^2 / 2 + sum_(j <= k) |rho_j(z)|^2 / 2 + const
For every k, (1) is minimised from the minimum for k - 1, and points are laid around the minimum as the Gauss-Newton
information says, which in these coordinates is never near singular:
  (2) C C' = I + sum J_j' J_j,  z_i = z_min + C'^-1 u_i
  (3) log w_i = log b_i + |u_i|^2 / 2 + log p(z_i | y) + const,  u_i and b_i the points and weights of `points`
  (4) m = sum w_i x_i(t),  central moments = sum w_i (x_i(t) - m) ...
  (5) effective share = sum b_i^2 / sum w_i^2: Kish's effective number of points, as a share of a normal density's
Where flow and measurements are linear, (4) is the Kalman filter's, to rounding, and (5) is 1. Cost: k flows of the N
points for the weights of (3), and one for each output. Fails where the posterior is far from normal in x(0): (5) is
then small, but a second mode that no point comes near goes unnoticed. Not a number where the flow of any point is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.moments.moments import Moments
from nlbench.references.levenberg import least_squares
from nlbench.references.points import Points, normal_points

STEPS = 4  # of the minimisation, for each measurement


class Track(NamedTuple):
    """Moments at the output times: mean (T, n), cov (T, n, n), third (T, n, n, n); effective share of the points (T,),
    1 where the density of x(0) is normal."""

    mean: Any
    cov: Any
    third: Any
    effective: Any


class Cloud(NamedTuple):
    """Weighted points of the whitened initial state: centre (n,), C'^-1 (n, n), and logarithms of weights (N,)."""

    centre: Any
    spread: Any
    log_weights: Any


class Data(NamedTuple):
    """The measurements of a trajectory as functions of the whitened initial state.

    taken: (M,). residual: (j, z) -> (m,), whitened, 0 where there is none. start: z -> x(0).
    """

    taken: Any
    residual: Callable[[Any, Any], Any]
    start: Callable[[Any], Any]


def posterior_track(
    flow: Callable[[Any, Any], Any],
    observe: Callable[[Any, Any], Any],
    residual: Callable[[Any, Any], Any],
    prior: Moments,
    noise_cov: Any,
    output_times: Any,
    times: Any,
    measurements: Any,
    key: Any,
    radii: int = 5,
    turns: int = 2,
) -> Track:
    """Moments of x at the output times (T,), each given the measurements made until then.

    flow: (t, x0) -> x(t) (n,). observe: (number from 0, x) -> (m,). residual: (y, h) -> (m,). prior: of x(0), with a
    positive definite covariance; its mean and covariance count. times: (M,), ascending, not finite for measurements
    that were never taken. measurements: (M, m), NaN where missing. key: turns the points; radii, turns: how many there
    are, see `normal_points`.
    """
    times, output_times = jnp.asarray(times), jnp.asarray(output_times)
    data = _whitened(flow, observe, residual, prior, noise_cov, times, jnp.asarray(measurements))
    points = normal_points(key, len(prior.mean), radii, turns)
    clouds = _clouds(data, points)
    made = jnp.sum(data.taken & (times <= output_times[:, None]), axis=1)

    def output(_: None, at: tuple[Any, Any]) -> tuple[None, Track]:
        t, k = at
        cloud = jax.tree.map(lambda leaf: leaf[k], clouds)
        x = _each(lambda z: flow(t, data.start(z)))(_laid(cloud, points))
        return None, _moments(x, jnp.exp(cloud.log_weights), jnp.exp(points.log_weights))

    return jax.lax.scan(output, None, (output_times, made))[1]


def _whitened(
    flow: Any, observe: Any, residual: Any, prior: Moments, noise_cov: Any, times: Any, measurements: Any
) -> Data:
    """The data in coordinates in which prior and noise are standard normal."""
    mean, root = jnp.asarray(prior.mean, float), jnp.linalg.cholesky(jnp.asarray(prior.cov, float))
    R = jnp.asarray(noise_cov, float)
    whitening = jax.scipy.linalg.solve_triangular(jnp.linalg.cholesky(R), jnp.eye(len(R)), lower=True)
    taken = jnp.isfinite(times)
    times = jnp.where(taken, times, 0.0)
    known = taken & ~jnp.any(jnp.isnan(measurements), axis=1)

    def start(z: Any) -> Any:
        return mean + root @ z

    def whitened(j: Any, z: Any) -> Any:
        r = residual(measurements[j], observe(j, flow(times[j], start(z))))
        return jnp.where(known[j], whitening @ r, 0.0)

    return Data(taken, whitened, start)


def _clouds(data: Data, points: Points) -> Cloud:
    """Of the posteriors given the first 0 ... M measurements, (M + 1, ...)."""
    n, numbers, made = len(points.u), jnp.arange(len(data.taken)), jnp.sum(data.taken)

    def given(centre: Any, k: Any) -> tuple[Any, Cloud]:
        def residuals(z: Any) -> Any:
            each = jax.vmap(lambda j: data.residual(j, z))(numbers)
            return jnp.append(z, jnp.where(numbers[:, None] < k, each, 0.0))

        fit = least_squares(residuals, centre, STEPS)  # (1)
        C = jnp.linalg.cholesky(fit.information)
        spread = jax.scipy.linalg.solve_triangular(C, jnp.eye(n), lower=True).T  # (2)
        cloud = Cloud(fit.point, spread, points.log_weights)
        counted = jnp.where(k <= made, k, 0)  # what is given more than was made is never looked at
        return fit.point, cloud._replace(log_weights=_log_weights(data, points, cloud, counted))

    return jax.lax.scan(given, jnp.zeros(n), jnp.arange(len(numbers) + 1))[1]


def _log_weights(data: Data, points: Points, cloud: Cloud, k: Any) -> Any:
    """(3) given the first k measurements, normalised."""
    z = _laid(cloud, points)

    def less(j: Any, level: Any) -> Any:
        return level - 0.5 * jnp.square(_each(lambda z: data.residual(j, z))(z)).sum(axis=0)

    level = points.log_weights + 0.5 * (jnp.square(points.u) - jnp.square(z)).sum(axis=0)
    level = jax.lax.fori_loop(0, k, less, level)
    return level - jax.nn.logsumexp(level)


def _laid(cloud: Cloud, points: Points) -> Any:
    """z (n, N)."""
    return cloud.centre[:, None] + cloud.spread @ points.u


def _each(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """A function of one state for all points (n, N)."""
    return jax.vmap(function, in_axes=-1, out_axes=-1)


def _moments(x: Any, weights: Any, rule: Any) -> Track:
    """(4) and (5), of points (n, N) with weights w and, in `rule`, b."""
    mean = x @ weights
    d = x - mean[:, None]
    weighted = weights * d
    third = jnp.einsum("ip,jp,kp->ijk", weighted, d, d)
    return Track(mean, weighted @ d.T, third, jnp.sum(rule**2) / jnp.sum(weights**2))
