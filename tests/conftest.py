"""What holds for all tests: shapes and types are enforced, numbers are double precision, programs compile once."""

from __future__ import annotations

import gc
import os
import signal
import tempfile

from jaxtyping import install_import_hook

# Two workers compute beside each other, and XLA's threads of one would spin while those of the other work.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("PJRT_NPROC", "1")

# In the background job of a script SIGINT is ignored, which all that a test starts would inherit, and nlbench respect.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Before anything of nlbench is imported: the hook decorates every function of these packages; not of `algebra`,
# which is called thousands of times for each program that is traced, so that tests took a fifth longer, and of
# `statistics` only where shapes are stated: a function within a function is decorated anew by each call.
NUMERICAL = "continuous discrete engine filters moments references simulate systems updates"
STATISTICS = "accumulate score_sums tracks"
CHECKED = [f"nlbench.{package}" for package in NUMERICAL.split()]
CHECKED += [f"nlbench.statistics.{module}" for module in STATISTICS.split()]
install_import_hook(CHECKED, "beartype.beartype")

import jax  # noqa: E402 - the hook comes first

from nlbench import runtime  # noqa: E402

jax.config.update("jax_enable_x64", True)

QUICK = "--xla_backend_optimization_level=0 --xla_cpu_use_fusion_emitters=false"


def pytest_configure(config):
    _compile_quickly(config)
    _share_a_cache(config)
    _collect_rarely()


def _compile_quickly(config):
    """Compilation is most of what tests of the engine do, and half of that are LLVM's optimisation and the newer of
    XLA's two ways to write fused loops.

    Long tests, which measure, are compiled as users have them, and so is everything where XLA_FLAGS says so. A test in
    `tests/runtime` shows that numbers are the same, to rounding.
    """
    if config.option.markexpr == "not long":
        os.environ.setdefault("XLA_FLAGS", QUICK)
        # Workers beside each other again: threads that spin make the roots of a polynomial take 1 s instead of 8 ms.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # for the workers, which load it after this
    runtime.prepare()


def _collect_rarely():
    """Traced programs are many objects that stay."""
    gc.set_threshold(200_000, 20, 100)


def _share_a_cache(config):
    """One cache of compiled programs for all workers and every process that a test starts, empty at the beginning.

    jax decides at its first compilation whether it has a cache, so it is named before. A caller's own is used and kept.
    """
    if "NLBENCH_CACHE" not in os.environ:
        folder = tempfile.TemporaryDirectory(prefix="nlbench-tests-")
        config.add_cleanup(folder.cleanup)
        os.environ["NLBENCH_CACHE"] = folder.name
    jax.config.update("jax_compilation_cache_dir", os.environ["NLBENCH_CACHE"])
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)
