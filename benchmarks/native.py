"""The C kernel of the scalar third-order filter, compiled at run time by the system's compiler."""

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

SOURCE = Path(__file__).with_name("scalar_third.c")
# -march=native: the vectors of this machine. -fno-math-errno: sqrt of a vector is one instruction. No
# -ffast-math, which would reorder sums and drop NaN; fused multiply-adds are GCC's default without it.
FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-shared", "-fPIC")
BLOCK = 64
STEPS = 5  # RK4 steps between measurements
OPERATIONS_PER_STEP = 103
OPERATIONS_PER_UPDATE = 32  # two of them divisions, each counted as one


class CompilerMissing(RuntimeError):
    """There is no C compiler, or it refused the kernel."""


class Kernel(NamedTuple):
    """The compiled functions, with the number of 8-lane vectors that one run keeps in registers."""

    library: ctypes.CDLL
    vectors: int
    compile_seconds: float


def build(vectors: int) -> Kernel:
    """Compile the kernel; a matter of a second."""
    compiler = os.environ.get("CC") or shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise CompilerMissing("no C compiler (set CC)")
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "kernel.so"
        command = [compiler, *FLAGS, f"-DVECTORS={vectors}", str(SOURCE), "-o", str(target)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        except OSError as reason:
            raise CompilerMissing(f"{compiler}: {reason.strerror}") from reason
        if done.returncode:
            raise CompilerMissing(f"{compiler} refused the kernel: {done.stderr.strip()[:200]}")
        library = ctypes.CDLL(str(target))
    size, real, pointer = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
    library.filter.argtypes = [size, size, real, pointer, pointer]
    library.experiment.argtypes = [size, size, real, ctypes.c_uint64, ctypes.c_uint64, pointer]
    library.peak.argtypes = [size, real, real]
    library.peak.restype = real
    library.filter.restype = library.experiment.restype = None
    return Kernel(library, vectors, time.perf_counter() - start)


@cache
def fastest() -> Kernel:
    """The kernel with as many vectors in registers as suit this core best."""
    y = aligned((8, 20, BLOCK))
    out = outputs(y)

    def seconds(kernel: Kernel) -> float:
        samples = []
        for _ in range(15):
            start = time.process_time()
            run_filter(kernel, y, 1.0, out)
            samples.append(time.process_time() - start)
        return float(np.median(samples))

    return min((build(vectors) for vectors in (1, 2, 4)), key=seconds)


def aligned(shape: tuple[int, ...]) -> np.ndarray:
    """Zeros at a 64-byte boundary, as the kernel's vectors want."""
    size = int(np.prod(shape))
    raw = np.zeros(size + 8)
    shift = -raw.ctypes.data // 8 % 8
    return raw[shift : shift + size].reshape(shape)


def outputs(y: np.ndarray) -> np.ndarray:
    """Room for what the kernel makes of measurements (blocks, times, 64)."""
    return aligned((y.shape[0], y.shape[1], 3, BLOCK))


def run_filter(kernel: Kernel, y: np.ndarray, variance: float, out: np.ndarray) -> None:
    """Mean, variance and third moment after each update into `out`; y is `aligned`, (blocks, times, 64)."""
    kernel.library.filter(y.shape[0], y.shape[1], variance, y.ctypes.data, out.ctypes.data)


def run_experiment(kernel: Kernel, variance: float, seed: int, first: int, out: np.ndarray) -> None:
    """Error, variance and third moment of trajectories first ... into `out`, on data of its own."""
    kernel.library.experiment(out.shape[0], out.shape[1], variance, seed, first, out.ctypes.data)


def run_peak(kernel: Kernel, rounds: int) -> int:
    """Fused multiply-adds in registers, as many at a time as the core takes; returns the operations done."""
    kernel.library.peak(rounds, 0.999, 0.001)
    return rounds * 12 * 8 * 2
