"""What is timed: a row does one workload's work per call. A function builds one, or says why it cannot."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from benchmarks import native, workloads
from benchmarks.workloads import Workload

SEED = 1969


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
    """The limit: hand-written C, given measurements."""
    kernel = _kernel()
    blocks = native.aligned((workload.blocks, workload.times, native.BLOCK))
    blocks[:] = workloads.by_blocks(y)[:, :, 0]
    out = native.outputs(blocks)

    def call() -> None:
        native.run_filter(kernel, blocks, workload.noise_cov[0, 0], out)

    call()
    means = out[:, -1, 0].reshape(-1, 1).copy()
    return Row("C, filter alone", call, workload.work, kernel.compile_seconds, means)


def c_peak(workload: Workload, y: np.ndarray) -> Row:
    """The filter's operations at the core's peak: its ratio is the fraction of the peak that is reached."""
    kernel = _kernel()
    operations = native.OPERATIONS_PER_STEP + native.OPERATIONS_PER_UPDATE / workload.steps

    def call() -> int:
        return native.run_peak(kernel, rounds=40_000)

    return Row("as many operations at the core's peak", call, call() / operations, kernel.compile_seconds)


def c_experiment(workload: Workload, y: np.ndarray) -> Row:
    """The filter in C with random numbers and truth of its own."""
    kernel = _kernel()
    out = native.aligned((workload.blocks, workload.times, 3, native.BLOCK))

    def call() -> None:
        native.run_experiment(kernel, workload.noise_cov[0, 0], SEED, 0, out)

    return Row("C, with random numbers and truth", call, workload.work, kernel.compile_seconds)


def plain_third_order(workload: Workload, y: np.ndarray) -> Row:
    """Arrays, jacfwd and hessian, einsum, scan, vmap."""
    from benchmarks import plain

    return jax_row(
        "plain jax arrays", workload, plain.third_order(workload), y, lambda moments: moments[0][:, -1]
    )


def plain_ekf(workload: Workload, y: np.ndarray) -> Row:
    """The same for the EKF."""
    from benchmarks import plain

    return jax_row("plain jax arrays", workload, plain.ekf(workload), y, lambda moments: moments[0][:, -1])


def jax_row(name: str, workload: Workload, function: Any, y: Any, last_means: Callable[[Any], Any]) -> Row:
    """A row of a jitted function of measurements."""
    import jax

    y = jax.device_put(y)
    start = time.perf_counter()
    compiled = function.lower(y).compile()
    seconds = time.perf_counter() - start
    means = np.asarray(last_means(compiled(y)))
    return Row(name, lambda: jax.block_until_ready(compiled(y)), workload.work, seconds, means)


def _kernel() -> native.Kernel:
    try:
        return native.fastest()
    except native.CompilerMissing as reason:
        raise Unavailable(str(reason)) from reason
