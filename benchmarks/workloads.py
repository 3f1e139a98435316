"""The two workloads: a problem, its filter's start, and measurements of it, in plain NumPy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

LANES = 64


class Workload(NamedTuple):
    """A problem with `times` measurements of each of `blocks` x 64 trajectories, `steps` RK4 steps apart.

    drift and observe: array functions of x (n,), in a module of arrays (numpy or jax.numpy) that comes first.
    noise_cov: (m, m). mean (n,), cov (n, n): what the filters start from.
    draw: (generator, count) -> (count, n), initial states.
    """

    name: str
    says: str
    drift: Callable[[Any, Any], Any]
    observe: Callable[[Any, Any], Any]
    noise_cov: np.ndarray
    mean: np.ndarray
    cov: np.ndarray
    draw: Callable[[np.random.Generator, int], np.ndarray]
    step: float
    steps: int
    times: int
    blocks: int

    @property
    def trajectories(self) -> int:
        """How many trajectories one call filters."""
        return self.blocks * LANES

    @property
    def work(self) -> int:
        """Trajectory x RK4 steps of one call."""
        return self.trajectories * self.times * self.steps


SCALAR = Workload(
    name="scalar third order",
    says="dx/dt = -2x + .7x^2, y = x + N(0, 1.6) every 5 RK4 steps; third-order filter",
    drift=lambda xp, x: xp.stack([x[0] * (0.7 * x[0] - 2.0)]),
    observe=lambda xp, x: x,
    noise_cov=np.array([[1.6]]),
    mean=np.array([2.0]),
    cov=np.array([[0.16]]),
    draw=lambda generator, count: 2.0 + np.clip(0.4 * generator.standard_normal((count, 1)), -0.84, 0.84),
    step=0.02,
    steps=5,
    times=20,
    blocks=32,
)
OSCILLATOR = Workload(
    name="oscillator EKF",
    says="x1' = x2, x2' = -x1 - 2 x2 x3, x3' = 0, x1 and x2 measured after each RK4 step; EKF",
    drift=lambda xp, x: xp.stack([x[1], -x[0] - 2.0 * x[1] * x[2], 0.0 * x[2]]),
    observe=lambda xp, x: x[:2],
    noise_cov=50.0 * np.eye(2),
    mean=np.array([10.0, 0.0, 0.5]),
    cov=np.diag([9.0, 9.0, 0.16]),
    draw=lambda generator, count: (
        np.array([10.0, 0.0, 0.5]) + np.array([3.0, 3.0, 0.2]) * generator.standard_normal((count, 3))
    ),
    step=0.05,
    steps=1,
    times=100,
    blocks=16,
)


def measurements(workload: Workload, seed: int = 1969) -> np.ndarray:
    """Measurements (trajectories, times, m) of simulated trajectories."""
    generator = np.random.default_rng(seed)
    x = workload.draw(generator, workload.trajectories).T
    root = np.linalg.cholesky(workload.noise_cov)
    y = []
    for _ in range(workload.times):
        for _ in range(workload.steps):
            x = rk4(lambda x: workload.drift(np, x), x, workload.step)
        h = workload.observe(np, x)
        y.append(h + root @ generator.standard_normal(h.shape))
    return np.ascontiguousarray(np.array(y).transpose(2, 0, 1))


def rk4(rate: Callable[[Any], Any], x: Any, h: float) -> Any:
    """One step of the classical Runge-Kutta method."""
    k1 = rate(x)
    k2 = rate(x + h / 2 * k1)
    k3 = rate(x + h / 2 * k2)
    k4 = rate(x + h * k3)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def by_blocks(y: np.ndarray) -> np.ndarray:
    """(trajectories, times, m) -> (blocks, times, m, 64): blocks of trajectories, lanes last."""
    n, times, m = y.shape
    return np.ascontiguousarray(y.reshape(n // LANES, LANES, times, m).transpose(0, 2, 3, 1))
