"""The extended Kalman filters of other libraries, one RK4 step of the drift to a measurement."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.rows import Row, Unavailable, jax_row
from benchmarks.workloads import Workload, rk4


def dynamax(workload: Workload, y: np.ndarray) -> Row:
    """dynamax's EKF, vmapped over trajectories; it also forms a log-likelihood."""
    import jax
    import jax.numpy as jnp

    try:
        from dynamax.nonlinear_gaussian_ssm import ParamsNLGSSM, extended_kalman_filter
    except ImportError as reason:
        raise Unavailable(f"dynamax: {reason}") from reason
    jax.config.update("jax_enable_x64", True)  # in case importing it changed the setting

    def transition(x: Any) -> Any:
        return rk4(lambda x: workload.drift(jnp, x), x, workload.step)

    n = len(workload.mean)
    mean, slope = jnp.asarray(workload.mean), jax.jacfwd(transition)(jnp.asarray(workload.mean))
    parameters = ParamsNLGSSM(
        initial_mean=transition(mean),  # dynamax measures before it predicts
        initial_covariance=slope @ workload.cov @ slope.T,
        dynamics_function=transition,
        dynamics_covariance=jnp.zeros((n, n)),
        emission_function=lambda x: workload.observe(jnp, x),
        emission_covariance=jnp.asarray(workload.noise_cov),
    )
    fields = ["filtered_means", "filtered_covariances"]
    function = jax.jit(jax.vmap(lambda y: extended_kalman_filter(parameters, y, output_fields=fields)))
    return jax_row("dynamax", workload, function, y, lambda posterior: posterior.filtered_means[:, -1])


def cuthbert(workload: Workload, y: np.ndarray) -> Row:
    """cuthbert's EKF (its `moments` filter), vmapped over trajectories; it carries square roots of covariances, by QR,
    and also forms a log-likelihood."""
    import jax
    import jax.numpy as jnp

    try:
        from cuthbert import filter as filtered
        from cuthbert.gaussian import moments
    except ImportError as reason:
        raise Unavailable(f"cuthbert: {reason}") from reason

    n = len(workload.mean)
    no_noise, noise = jnp.zeros((n, n)), jnp.asarray(np.linalg.cholesky(workload.noise_cov))

    def transition(x: Any) -> Any:
        return rk4(lambda x: workload.drift(jnp, x), x, workload.step), no_noise

    def observe(x: Any) -> Any:
        return workload.observe(jnp, x), noise

    ekf = moments.build_filter(
        m0=jnp.asarray(workload.mean),
        chol_P0=jnp.asarray(np.linalg.cholesky(workload.cov)),
        get_dynamics_params=lambda state, y: (transition, state.mean),
        get_observation_params=lambda state, y: (observe, state.mean, y),
    )

    def kept(y: Any) -> Any:
        states = filtered(ekf, y, ekf.init_prepare())
        return states.mean, states.chol_cov, states.log_normalizing_constant

    return jax_row("cuthbert", workload, jax.jit(jax.vmap(kept)), y, lambda kept: kept[0][:, -1])


def filterpy(workload: Workload, y: np.ndarray) -> Row:
    """filterpy's EKF, a loop over measurements and trajectories; four trajectories stand for all."""
    try:
        from filterpy.kalman import ExtendedKalmanFilter
    except ImportError as reason:
        raise Unavailable(f"filterpy: {reason}") from reason

    few, n = y[:4], len(workload.mean)
    H = _slope(lambda x: workload.observe(np, x), workload.mean)

    def transition(x: np.ndarray) -> np.ndarray:
        return rk4(lambda x: workload.drift(np, x), x, workload.step)

    class Filter(ExtendedKalmanFilter):
        """filterpy asks for the nonlinear transition in this method."""

        x: Any

        def predict_x(self, u: Any = 0) -> None:
            self.x = transition(self.x)

    def filtered(y: np.ndarray) -> np.ndarray:
        ekf = Filter(dim_x=n, dim_z=y.shape[1])
        ekf.x, ekf.P, ekf.R, ekf.Q = (
            workload.mean.copy(),
            workload.cov.copy(),
            workload.noise_cov,
            np.zeros((n, n)),
        )
        for y_k in y:
            ekf.F = _slope(transition, ekf.x)
            ekf.predict()
            ekf.update(y_k, lambda x: H, lambda x: workload.observe(np, x))
        return ekf.x

    def call() -> np.ndarray:
        return np.array([filtered(y_i) for y_i in few])

    return Row("filterpy", call, workload.work * len(few) // len(y), 0.0, call())


def _slope(function: Any, x: np.ndarray) -> np.ndarray:
    """The Jacobian by the complex step: n evaluations, exact to rounding."""
    tiny = 1e-30
    columns = [function(x + 1j * tiny * unit).imag / tiny for unit in np.eye(len(x))]
    return np.stack(columns, axis=-1)
