"""The C kernels, compiled at run time by the system's compiler, and their arrays."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
import time
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.kernels import text
from benchmarks.kernels.text import Text
from benchmarks.workloads import LANES, Workload, by_blocks

SOURCE = Path(__file__).with_name("kernels") / "moments.c"
# -march=native: the vectors of this machine. -fno-math-errno: sqrt of a vector is one instruction. No
# -ffast-math, which would reorder sums and drop NaN; fused multiply-adds are GCC's default without it.
FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-shared", "-fPIC")
VECTORS = (1, 2, 4)  # of 8 lanes, that take turns in a kernel


class CompilerMissing(RuntimeError):
    """There is no C compiler, or it refused the kernel."""


class Kernel(NamedTuple):
    """The compiled functions of a filter with `components` unique moments, `vectors` of 8 lanes at a time."""

    library: ctypes.CDLL
    components: int
    measurements: int
    text: Text
    vectors: int
    compile_seconds: float


def build(workload: Workload, order: int, vectors: int) -> Kernel:
    """Compile the filter of second or third order; a matter of a second."""
    return _build(text.write(workload, order), vectors)


def fastest(workload: Workload, order: int) -> Kernel:
    """The kernel with as many vectors at a time as suit this core best."""
    return _fastest(text.write(workload, order))


def measured(y: np.ndarray) -> np.ndarray:
    """Measurements (trajectories, times, m) as a kernel reads them, (blocks, times, m, 64)."""
    blocks = by_blocks(y)
    to = aligned(blocks.shape)
    to[:] = blocks
    return to


def moments(kernel: Kernel, blocks: int, times: int) -> np.ndarray:
    """Room for what a kernel computes: mean, covariance and third moment, each in lexicographic order."""
    return aligned((blocks, times, kernel.components, LANES))


def run_filter(kernel: Kernel, y: np.ndarray, out: np.ndarray) -> None:
    """Moments after each update into `out`."""
    kernel.library.filter(out.shape[0], out.shape[1], y.ctypes.data, out.ctypes.data)


def run_experiment(kernel: Kernel, seed: int, first: int, out: np.ndarray) -> None:
    """On data of its own, for trajectories first ...: the mean's error, and the other moments, into `out`."""
    kernel.library.experiment(out.shape[0], out.shape[1], seed, first, out.ctypes.data)


def run_peak(kernel: Kernel, rounds: int) -> int:
    """Fused multiply-adds in registers, as many at a time as the core takes; returns the operations done."""
    kernel.library.peak(rounds, 0.999, 0.001)
    return rounds * 12 * 8 * 2


def aligned(shape: tuple[int, ...]) -> np.ndarray:
    """Zeros at a 64-byte boundary, as the kernels' vectors want."""
    size = int(np.prod(shape))
    raw = np.zeros(size + 8)
    shift = -raw.ctypes.data // 8 % 8
    return raw[shift : shift + size].reshape(shape)


@cache
def _build(written: Text, vectors: int) -> Kernel:
    compiler = os.environ.get("CC") or shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise CompilerMissing("no C compiler (set CC)")
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        for name, lines in written.files:
            Path(folder, name).write_text(lines)
        target = Path(folder, "kernel.so")
        command = [compiler, *FLAGS, f"-DVECTORS={vectors}", f"-I{folder}", str(SOURCE), "-o", str(target)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        except OSError as reason:
            raise CompilerMissing(f"{compiler}: {reason.strerror}") from reason
        if done.returncode:
            raise CompilerMissing(f"{compiler} refused the kernel: {done.stderr.strip()[:200]}")
        library = ctypes.CDLL(str(target))
    size, real, pointer = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
    library.filter.argtypes = [size, size, pointer, pointer]
    library.experiment.argtypes = [size, size, ctypes.c_uint64, ctypes.c_uint64, pointer]
    library.peak.argtypes = [size, real, real]
    library.peak.restype = real
    library.filter.restype = library.experiment.restype = None
    sizes = library.components(), library.measurements()
    return Kernel(library, *sizes, written, vectors, time.perf_counter() - start)


@cache
def _fastest(written: Text) -> Kernel:
    def seconds(kernel: Kernel) -> float:
        y, out = aligned((4, 10, kernel.measurements, LANES)), moments(kernel, 4, 10)
        samples = []
        for _ in range(15):
            start = time.process_time()
            run_filter(kernel, y, out)
            run_experiment(kernel, 0, 0, out)
            samples.append(time.process_time() - start)
        return float(np.median(samples))

    return min((_build(written, vectors) for vectors in VECTORS), key=seconds)
