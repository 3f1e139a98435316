"""How far every Gaussian filter is from the Kalman filter in extended precision where a prior is wide and sensors are
accurate: `python -m tests.discrete.ratios` prints the table of docs/decisions/025-square-roots.md."""

from __future__ import annotations

import sys
from functools import cache
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import nlbench as nb
from nlbench.discrete.catalogue import ROWS
from nlbench.filters.catalogue import MOMENT
from nlbench.filters.catalogue import options as options_of
from tests.oracle_extended import extended, filtered, transition

RATIOS = (1.0, 1e3, 1e6, 1e10)
STEPS = (1, 10, 100)  # of an interval
R = 0.01
COUNT = 6


class Linear(NamedTuple):
    """dx = F x dt + G dw, measured every second by independent sensors: y = H x, of variances R times `noise`."""

    F: np.ndarray
    G: np.ndarray
    H: np.ndarray
    noise: tuple[float, ...]


COUPLED = np.array([[0.0, 1.0, 0.0], [-1.0, -0.4, 0.5], [0.2, 0.0, -0.3]])
SYSTEMS = {
    "constant velocity": Linear(np.eye(2, k=1), np.array([[0.0], [0.5]]), np.array([[1.0, 0.0]]), (1.0,)),
    "constant acceleration": Linear(np.eye(3, k=1), np.array([[0.0], [0.0], [0.5]]), np.eye(3)[:1], (1.0,)),
    "stable, two sensors": Linear(COUPLED, 0.3 * np.eye(3)[:, 1:], np.eye(3)[:2], (1.0, 1.0)),
    "unstable, two sensors": Linear(
        COUPLED + 0.6 * np.eye(3), 0.3 * np.eye(3)[:, 1:], np.eye(3)[:2], (1.0, 1.0)
    ),
    "stable, three of one": Linear(
        COUPLED, 0.3 * np.eye(3)[:, 1:], np.array([[1.0, 0, 0], [1, 0, 0], [1, 0.5, 0]]), (1.0, 100.0, 0.01)
    ),
}
SIGMA_POINTS = ("statistical-linearisation", "ukf", "ckf", "ghkf")
GAUSSIAN = tuple(name for name in ROWS if name not in ("ensemble", "bootstrap"))
OF_MOMENTS = ("ekf", "second-order", "third-order", "fourth-order", "two-step-2", "quadrature-2")


def data(system, ratio):
    """Start, and measurements of a truth that is one standard deviation of the start away."""
    n = len(system.F)
    g = np.random.default_rng(7)
    x = np.sqrt(R * ratio) * np.where(np.arange(n) % 2, -1.0, 1.0)
    Phi = np.asarray(transition(system.F, np.zeros((n, n)), 1.0)[0], float)
    y = []
    for _ in range(COUNT):
        x = Phi @ x + 0.1 * g.normal(size=n)
        y.append(system.H @ x + np.sqrt(R * np.array(system.noise)) * g.normal(size=len(system.H)))
    return np.zeros(n), R * ratio * np.eye(n), np.array(y)


@cache
def exact(name, ratio):
    """Means and covariances by the oracle."""
    system = SYSTEMS[name]
    Phi, Q = transition(system.F, system.G @ system.G.T, 1.0)
    return filtered(Phi, Q, system.H, R * np.array(system.noise), *data(system, ratio))


def worst(name, means, covs, ratio):
    """The largest error of a mean in standard deviations, and the largest relative error of a variance."""
    known_means, known_covs = exact(name, ratio)
    variances = np.array([np.diag(cov) for cov in known_covs])
    deviations = np.sqrt(variances.astype(float))
    if not (np.isfinite(means).all() and np.isfinite(covs).all()):
        return np.nan, np.nan
    of_mean = np.abs((extended(means) - known_means).astype(float)) / deviations
    found = extended(np.diagonal(covs, axis1=1, axis2=2))
    of_variance = np.abs(((found - variances) / variances).astype(float))
    return of_mean.max(), of_variance.max()


def errors(name, filter_name, discrete, **options):
    """`worst` for every ratio (and number of steps, in continuous time): {(ratio, steps): (of mean, of variance)}."""
    system = SYSTEMS[name]
    n = system.G.shape[0]
    start = nb.Moments(np.zeros(n), np.eye(n))
    noise = R * np.diag(system.noise)
    if discrete:
        Phi, Q = (np.asarray(each, float) for each in transition(system.F, system.G @ system.G.T, 1.0))
        model = nb.DiscreteSystem(
            lambda k, x, w: jnp.asarray(Phi) @ x + w,
            lambda k, x, v: jnp.asarray(system.H) @ x + v,
            Q,
            noise,
            start,
        )
    else:
        model = nb.System(
            lambda t, x: jnp.asarray(system.F) @ x, lambda t, x: jnp.asarray(system.H) @ x, noise, start,
            diffusion=lambda t, x: jnp.asarray(system.G),
        )  # fmt: skip
    f = nb.filters.build(filter_name, model, **options)

    @jax.jit
    def along(cov, y, count):
        def one(state, given):
            t, y = given
            if discrete:
                state = f.predict(state, t, t + 1)
            else:
                state = f.integrate(state, t, 1.0 / count, count)
            state, _ = f.update(state, t + 1, y)
            return state, f.moments(state)[:2]

        times = jnp.arange(COUNT) if discrete else jnp.arange(COUNT, dtype=float)
        return jax.lax.scan(one, f.init(nb.Moments(np.zeros(n), cov)), (times, y))[1]

    found = {}
    for ratio in RATIOS:
        _, cov, y = data(system, ratio)
        for steps in (1,) if discrete else STEPS:
            means, covs = (np.asarray(each) for each in along(cov, y, steps))
            found[ratio, steps] = worst(name, means, covs, ratio)
    return found


def cases():
    """(filter, discrete, options) of the table."""
    for name in GAUSSIAN:
        yield name, True, {}
    yield "ukf", True, {"alpha": 1e-3, "beta": 2.0}
    for name in dict.fromkeys((*GAUSSIAN, *MOMENT)):
        if name in ("direct-2", "direct-3", "integration-update") or name.startswith("series"):
            continue  # exact in the limit of many points, steps or much noise only
        choices = ("transition", "moments") if "propagation" in options_of(name).model_fields else (None,)
        for propagation in choices:
            options = {"propagation": propagation} if propagation else {}
            if name.startswith("quadrature"):
                options["points"] = 5
            yield name, False, options


def main():
    """Print a line a filter: for each ratio the worst of mean / variance over systems, by steps."""
    chosen = sys.argv[1:]
    for name, discrete, options in cases():
        if chosen and name not in chosen:
            continue
        tables = [errors(system, name, discrete, **options) for system in SYSTEMS]
        for steps in (1,) if discrete else STEPS:
            cells = [np.max([table[ratio, steps] for table in tables], 0) for ratio in RATIOS]
            time = "discrete" if discrete else f"1/{steps}"
            said = ", ".join(f"{key} {value}" for key, value in options.items())
            line = f"| {name} | {said} | {time} | " + " | ".join(
                f"{mean:.0e} / {variance:.0e}" for mean, variance in cells
            )
            sys.stdout.write(f"{line} |\n")
            sys.stdout.flush()


if __name__ == "__main__":
    nb.configure()
    main()
