"""The workloads: a problem, its filter's start, and measurements of it, in plain NumPy."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

LANES = 64
BOUND = 2.1  # of the `bounded` draws, in standard deviations
BEFORE = 1.2509323795  # the deviation of a normal variable that has variance one after it is cut at BOUND
MU = 1.66935e14  # ft^3/s^2, the moon's attraction
MOON = 5.70e6  # ft, its radius
LANDMARK = (MOON * math.cos(math.radians(45.0)), MOON * math.sin(math.radians(45.0)))


class Workload(NamedTuple):
    """A problem with `times` measurements of each of `blocks` x 64 trajectories, `steps` RK4 steps apart.

    So few blocks that what the C kernels write stays in a core's cache of 1 MB: they would otherwise wait for memory.

    system: key of `models.MODELS`, from which the C kernels are written.
    drift and observe: array functions of x (n,), in a module of arrays (numpy or jax.numpy) that comes first.
    noise_cov: (m, m), diagonal. mean (n,), cov (n, n), diagonal: what the filters start from, and true states too.
    bounded: states whose normal draws are cut at 2.1 deviations, the variance staying `cov`; a filter then follows all.
    wrapped: whether what is measured is an angle.
    """

    name: str
    system: str
    says: str
    drift: Callable[[Any, Any], Any]
    observe: Callable[[Any, Any], Any]
    noise_cov: np.ndarray
    mean: np.ndarray
    cov: np.ndarray
    bounded: tuple[int, ...]
    step: float
    steps: int
    times: int
    blocks: int
    wrapped: bool = False

    @property
    def trajectories(self) -> int:
        """How many trajectories one call filters."""
        return self.blocks * LANES

    @property
    def work(self) -> int:
        """Trajectory x RK4 steps of one call."""
        return self.trajectories * self.times * self.steps


def attraction(xp: Any, x: Any, mu: float = MU) -> Any:
    """Planar two-body motion, (x, y, their rates)."""
    square = x[0] * x[0] + x[1] * x[1]
    pull = -mu / (square * xp.sqrt(square))
    return xp.stack([x[2], x[3], pull * x[0], pull * x[1]])


SCALAR = Workload(
    name="scalar third order",
    system="scalar",
    says="dx/dt = -2x + .7x^2, y = x + N(0, 1.6) every 5 RK4 steps; third-order filter",
    drift=lambda xp, x: xp.stack([x[0] * (0.7 * x[0] - 2.0)]),
    observe=lambda xp, x: x,
    noise_cov=np.array([[1.6]]),
    mean=np.array([2.0]),
    cov=np.array([[0.16]]),
    bounded=(0,),
    step=0.02,
    steps=5,
    times=20,
    blocks=16,
)
OSCILLATOR = Workload(
    name="oscillator EKF",
    system="oscillator",
    says="x1' = x2, x2' = -x1 - 2 x2 x3, x3' = 0, x1 and x2 measured after each RK4 step; EKF",
    drift=lambda xp, x: xp.stack([x[1], -x[0] - 2.0 * x[1] * x[2], 0.0 * x[2]]),
    observe=lambda xp, x: x[:2],
    noise_cov=50.0 * np.eye(2),
    mean=np.array([10.0, 0.0, 0.5]),
    cov=np.diag([9.0, 9.0, 0.16]),
    bounded=(2,),
    step=0.05,
    steps=1,
    times=100,
    blocks=16,
)
OSCILLATOR_THIRD = OSCILLATOR._replace(
    name="oscillator third order",
    says="x1' = x2, x2' = -x1 - 2 x2 x3, x3' = 0, x1 and x2 measured every 4 RK4 steps; third-order filter",
    steps=4,
    times=25,
    blocks=4,
)
ORBIT = Workload(
    name="orbit third order",
    system="orbit",
    says="planar two-body motion, a landmark's direction measured every 20 RK4 steps; third-order filter",
    drift=attraction,
    observe=lambda xp, x: xp.stack([xp.arctan2(LANDMARK[1] - x[1], LANDMARK[0] - x[0])]),
    noise_cov=np.array([[2.5e-5]]),
    mean=np.array([8.34e6, 0.0, 0.0, 4470.0]),
    cov=np.diag([2.5e7, 2.5e7, 4.0, 4.0]),
    bounded=(),
    step=30.0,
    steps=20,
    times=10,
    blocks=4,
    wrapped=True,
)


def measurements(workload: Workload, seed: int = 1969) -> np.ndarray:
    """Measurements (trajectories, times, m) of simulated trajectories."""
    generator = np.random.default_rng(seed)
    x = initial_states(workload, generator).T
    root = np.linalg.cholesky(workload.noise_cov)
    y = []
    for _ in range(workload.times):
        for _ in range(workload.steps):
            x = rk4(lambda x: workload.drift(np, x), x, workload.step)
        h = workload.observe(np, x)
        y.append(h + root @ generator.standard_normal(h.shape))
    return np.ascontiguousarray(np.array(y).transpose(2, 0, 1))


def initial_states(workload: Workload, generator: np.random.Generator) -> np.ndarray:
    """True states (trajectories, n) at the start."""
    draws = generator.standard_normal((workload.trajectories, len(workload.mean)))
    for state in workload.bounded:
        draws[:, state] *= BEFORE
        while (outside := np.abs(draws[:, state]) > BOUND).any():
            draws[outside, state] = BEFORE * generator.standard_normal(outside.sum())
    return workload.mean + np.sqrt(np.diag(workload.cov)) * draws


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
