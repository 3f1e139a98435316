"""What float32 costs in accuracy: the same filters along the same measurements in both precisions.

    python -m benchmarks.precision

The measurements are made in float64. Each precision has a process of its own, since jax has one for all of a process.
A row says how far the means in float32 are from those in float64, in standard deviations that the filter states in
float64: half of the trajectories, 99 % and all of them stay below. Lost are those that are finite in float64 only.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import ours, workloads
from benchmarks.workloads import Workload

# In feet the orbit's derivatives would leave the range of float32; its radius and the time of a radian are near one.
LENGTH = float(workloads.ORBIT.mean[0])
TIME = LENGTH / float(workloads.ORBIT.mean[3])
SCALE = np.array([LENGTH, LENGTH, LENGTH / TIME, LENGTH / TIME])
ORBIT = workloads.ORBIT._replace(
    drift=lambda xp, x: workloads.attraction(xp, x, workloads.MU * TIME**2 / LENGTH**3),
    observe=lambda xp, x: workloads.ORBIT.observe(xp, x * LENGTH),
    mean=workloads.ORBIT.mean / SCALE,
    cov=workloads.ORBIT.cov / np.outer(SCALE, SCALE),
    step=workloads.ORBIT.step / TIME,
)
WORKLOADS = (workloads.SCALAR, workloads.OSCILLATOR_THIRD, ORBIT)
FILTERS = ("ekf", "second-order", "third-order", "third-order-guarded")
PRECISIONS = ("float64", "float32")
BLOCKS = 64


def main() -> None:
    """Print a row for each workload and filter."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--precision", choices=PRECISIONS, help=argparse.SUPPRESS)
    parser.add_argument("--out", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.precision is not None:
        np.savez(given.out, **_estimates(given.precision))
        return
    with tempfile.TemporaryDirectory() as folder:
        double, single = (_computed(precision, Path(folder)) for precision in PRECISIONS)
    print("|mean in float32 - mean in float64| / standard deviation: half, 99 %, all; lost")
    for workload in WORKLOADS:
        for name in FILTERS:
            print(f"{workload.system}, {name}: {_row(double, single, f'{workload.system}/{name}')}")


def _computed(precision: str, folder: Path) -> dict[str, np.ndarray]:
    out = folder / f"{precision}.npz"
    program = [sys.executable, "-m", "benchmarks.precision", "--precision", precision, "--out", str(out)]
    subprocess.run(program, check=True)
    return dict(np.load(out))


def _row(double: dict[str, np.ndarray], single: dict[str, np.ndarray], name: str) -> str:
    exact, variance = double[f"{name}/mean"], double[f"{name}/variance"]
    deviation = np.sqrt(np.where(variance > 0, variance, np.nan))
    apart = (np.abs(single[f"{name}/mean"] - exact) / deviation).max((1, 2))
    sound = np.isfinite(exact).all((1, 2)) & np.isfinite(deviation).all((1, 2))
    lost = int((sound & ~np.isfinite(apart)).sum())
    half, most, all_ = np.quantile(apart[sound & np.isfinite(apart)], [0.5, 0.99, 1.0])
    return f"{half:.1e}, {most:.1e}, {all_:.1e}; {lost} of {sound.sum():,}"


def _estimates(precision: str) -> dict[str, np.ndarray]:
    """Means and variances (trajectories, times, n) of every filter on every workload."""
    import jax

    import nlbench as nb

    nb.configure(precision)
    found = {}
    for workload in WORKLOADS:
        large = workload._replace(blocks=BLOCKS)
        y = workloads.measurements(large)
        for name in FILTERS:
            f = nb.filters.build(name, ours.system(large))
            mean, variance = jax.jit(jax.vmap(lambda y, f=f, large=large: _along(f, large, y)))(y)
            found[f"{workload.system}/{name}/mean"] = np.asarray(mean, float)
            found[f"{workload.system}/{name}/variance"] = np.asarray(variance, float)
    return found


def _along(f: Any, workload: Workload, y: Any) -> Any:
    """Means and variances (times, n) of a filter along measurements y (times, m)."""
    import jax
    import jax.numpy as jnp

    interval = workload.step * workload.steps

    def one(state: Any, given: tuple[Any, Any]) -> Any:
        number, values = given
        state = f.predict(state, number * interval, (number + 1) * interval)
        state, _ = f.update(state, (number + 1) * interval, values)
        moments = f.moments(state)
        return state, (moments.mean, jnp.diagonal(moments.cov))

    return jax.lax.scan(one, f.init(f.system.initial), (jnp.arange(workload.times), y))[1]


if __name__ == "__main__":
    main()
