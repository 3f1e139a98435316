"""What is timed: a row does one workload's work per call. A function builds one, or says why it cannot."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from benchmarks import native
from benchmarks.workloads import Workload

SEED = 1969
THIRD_IN_C, SECOND_IN_C = "C, filter alone", "C, second-order filter"
THIRD_BY_US, SECOND_BY_US = "nlbench, filter alone", "nlbench, second-order filter"
SIMULATED_IN_C, SIMULATED_BY_US = "C, with random numbers and truth", "nlbench, with random numbers and truth"
PLAIN = "plain jax arrays"


class Row(NamedTuple):
    """Something that can be timed.

    call: does `work` trajectory x RK4 steps and returns when they are done.
    means: (trajectories, n), the last means, to compare rows by; None where the data are the row's own.
    """

    name: str
    call: Callable[[], Any]
    work: float
    compile_seconds: float
    means: np.ndarray | None = None


class Unavailable(Exception):
    """A row that cannot be timed here; the message says why."""


def c_filter(workload: Workload, y: np.ndarray) -> Row:
    """The limit: C, given measurements."""
    return _c_filter(THIRD_IN_C, 3, workload, y)


def c_second(workload: Workload, y: np.ndarray) -> Row:
    """The second-order filter in C."""
    return _c_filter(SECOND_IN_C, 2, workload, y)._replace(means=None)


def c_peak(workload: Workload, y: np.ndarray) -> Row:
    """The filter's operations at the core's peak: its ratio is the fraction of the peak that is reached."""
    kernel = _kernel(workload, 3)
    operations = kernel.text.operations_per_step + kernel.text.operations_per_update / workload.steps

    def call() -> int:
        return native.run_peak(kernel, rounds=40_000)

    return Row(f"its {operations:.0f} operations a step at the core's peak", call, call() / operations, 0.0)


def c_experiment(workload: Workload, y: np.ndarray) -> Row:
    """The filter in C with random numbers and truth of its own."""
    kernel = _kernel(workload, 3)
    out = native.moments(kernel, workload.blocks, workload.times)

    def call() -> None:
        native.run_experiment(kernel, SEED, 0, out)

    return Row(SIMULATED_IN_C, call, workload.work, kernel.compile_seconds)


def plain_third_order(workload: Workload, y: np.ndarray) -> Row:
    """Arrays, jacfwd and hessian, einsum, scan, vmap."""
    from benchmarks import plain

    return jax_row(PLAIN, workload, plain.third_order(workload), y, lambda moments: moments[0][:, -1])


def plain_ekf(workload: Workload, y: np.ndarray) -> Row:
    """The same for the EKF."""
    from benchmarks import plain

    return jax_row(PLAIN, workload, plain.ekf(workload), y, lambda moments: moments[0][:, -1])


def jax_row(name: str, workload: Workload, function: Any, y: Any, last_means: Callable[[Any], Any]) -> Row:
    """A row of a jitted function of measurements."""
    import jax

    y = jax.device_put(y)
    start = time.perf_counter()
    compiled = function.lower(y).compile()
    seconds = time.perf_counter() - start
    means = np.asarray(last_means(compiled(y)))
    return Row(name, lambda: jax.block_until_ready(compiled(y)), workload.work, seconds, means)


def _c_filter(name: str, order: int, workload: Workload, y: np.ndarray) -> Row:
    kernel = _kernel(workload, order)
    blocks = native.measured(y)
    out = native.moments(kernel, workload.blocks, workload.times)

    def call() -> None:
        native.run_filter(kernel, blocks, out)

    call()
    n = len(workload.mean)
    means = np.moveaxis(out[:, -1, :n], 1, -1).reshape(-1, n)
    return Row(name, call, workload.work, kernel.compile_seconds, means)


def _kernel(workload: Workload, order: int) -> native.Kernel:
    try:
        return native.fastest(workload, order)
    except native.CompilerMissing as reason:
        raise Unavailable(str(reason)) from reason
