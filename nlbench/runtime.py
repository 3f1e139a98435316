"""Settings of jax that nlbench wants: float64, and XLA options that only count before the backend starts."""

from __future__ import annotations

import logging
import os
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

# Wide vectors, and loops over blocks run as one kernel. The second is undocumented, so jaxlib is pinned to a tested
# range and a test asserts its effect. Level 2 of LLVM's optimisation compiles somewhat
# faster than level 3 and runs as fast; level 1 makes random numbers slower.
XLA_OPTIONS = (
    "--xla_backend_optimization_level=2",
    "--xla_cpu_prefer_vector_width=512",
    "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=1000000000",
)
# Trajectories of a block unless an experiment says so: as many as vectors want, or as fill a GPU.
BLOCK, BLOCK_OF_A_GPU = 64, 8192
DEVICES = Path("/dev")
GPU_NODES = ("nvidia0", "kfd")  # NVIDIA's, AMD's
_chosen: dict[str, Any] = {}
log = logging.getLogger("nlbench")


def configure(precision: str = "float64", threads: int | None = None) -> None:
    """Set jax's precision and XLA's options; call it before the first computation.

    precision: "float64" or "float32". threads: of the engine; None means one for each core available.
    A second call with the same precision does nothing. Raises `ConfigError` for another precision than chosen before,
    `EnvironmentFault` elsewhere than on Linux, whose locks, signals and accounts of memory runs rely on.
    """
    from nlbench.errors import ConfigError, EnvironmentFault

    if sys.platform != "linux":
        raise EnvironmentFault(f"nlbench computes on Linux, or in a container or WSL; this is {sys.platform}")
    if precision not in ("float64", "float32"):
        raise ConfigError(f"precision '{precision}' is neither float64 nor float32")
    if _chosen.get("precision", precision) != precision:
        raise ConfigError(
            f"precision is {_chosen['precision']} in this process; start another for {precision}"
        )
    if not backend_started():
        _set_options()
    elif _missing_options() and not _chosen:
        log.warning(
            "jax has started without XLA's options for nlbench, and its filters will run about 3 times slower: "
            "call nlbench.configure() before the first computation"
        )
    import jax

    jax.config.update("jax_enable_x64", precision == "float64")
    _repair_arctan()
    _chosen["precision"] = precision
    if threads is not None:
        _chosen["threads"] = threads


def prepare() -> None:
    """Be ready for code that computes before an experiment has chosen a precision: XLA's options, and float64."""
    if not backend_started():
        _set_options()
    ensure_precision()


def ensure_precision() -> None:
    """float64, unless `configure` chose otherwise."""
    if "precision" not in _chosen:
        import jax

        jax.config.update("jax_enable_x64", True)


def threads() -> int:
    """Threads of the engine: as configured, otherwise one for each core available to this process."""
    return _chosen.get("threads") or len(os.sched_getaffinity(0))


def block() -> int:
    """Trajectories of a block, unless an experiment says how many, on what this process will compute with."""
    return BLOCK_OF_A_GPU if computes_on_a_gpu() else BLOCK


def computes_on_a_gpu() -> bool:
    """Whether jax computes on a GPU here, or will: it is not loaded for this, so that files are checked quickly.

    It will where a plug-in of jax's is installed, a device is there, and JAX_PLATFORMS does not ask for cores.
    """
    if backend_started():
        import jax

        return jax.default_backend() == "gpu"
    if os.environ.get("JAX_PLATFORMS", "").startswith("cpu") or find_spec("jax_plugins") is None:
        return False
    return any((DEVICES / each).exists() for each in GPU_NODES)


def backend_started() -> bool:
    """Whether jax has started its backend, after which XLA ignores new options."""
    if "jax" not in sys.modules:
        return False
    from jax._src import xla_bridge

    return xla_bridge.backends_are_initialized()


def _repair_arctan() -> None:
    """Have the CPU compute arctan x as atan2(2 x, 2).

    With 512-bit vectors XLA (jaxlib 0.10.2) gives wrong values of arctan, by up to 2.7, and of atan2(x, 1), which it
    rewrites to it; of the other elementary functions none.
    """
    from jax import lax
    from jax.interpreters import mlir

    def arctan(x: Any) -> Any:
        return lax.atan2(2 * x, lax.full_like(x, 2))

    mlir.register_lowering(lax.atan_p, mlir.lower_fun(arctan, multiple_results=False), platform="cpu")


def _missing_options() -> list[str]:
    """Options that the environment does not set; what the user has set stays."""
    present = os.environ.get("XLA_FLAGS", "")
    return [option for option in XLA_OPTIONS if option.split("=")[0] not in present]


def _set_options() -> None:
    flags = [os.environ.get("XLA_FLAGS", ""), *_missing_options()]
    os.environ["XLA_FLAGS"] = " ".join(flags).strip()
