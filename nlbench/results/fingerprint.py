"""What decides the last bits of a number: jaxlib, the processor's features, the device, XLA's flags, and the kernels of
OpenBLAS where the environment chooses them."""

from __future__ import annotations

import hashlib
import os
import platform
from importlib.metadata import version
from pathlib import Path

# Flags that share work out but do not change how a block is computed.
_HARMLESS = ("--xla_force_host_platform_device_count", "--xla_dump")
# Decompositions go through OpenBLAS, whose kernels for several processors round differently.
_KERNELS = ("OPENBLAS_CORETYPE",)


def fingerprint(device: str = "cpu", cpuinfo: Path = Path("/proc/cpuinfo")) -> dict[str, str]:
    """Facts that must be equal for two runs to agree to the last bit; call it when the XLA flags are set."""
    flags = [flag for flag in os.environ.get("XLA_FLAGS", "").split() if not flag.startswith(_HARMLESS)]
    kernels = [f"{name}={os.environ[name]}" for name in _KERNELS if os.environ.get(name)]
    return {
        "jaxlib": version("jaxlib"),
        "cpu_features": _cpu_features(cpuinfo),
        "device": device,
        "xla_flags": " ".join(sorted(flags)),
        **({"blas": " ".join(kernels)} if kernels else {}),
    }


def differences(mine: dict[str, str], theirs: dict[str, str]) -> list[str]:
    """One line for each fact that differs."""
    names = sorted({*mine, *theirs})
    return [f"{n}: {theirs.get(n)} then, {mine.get(n)} now" for n in names if mine.get(n) != theirs.get(n)]


def _cpu_features(cpuinfo: Path) -> str:
    """The architecture and a short hash of the features that the kernel lists."""
    try:
        lines = cpuinfo.read_text().splitlines()
    except OSError:
        lines = []
    listed = next((line for line in lines if line.lower().startswith(("flags", "features"))), "")
    features = " ".join(sorted(listed.partition(":")[2].split()))
    return f"{platform.machine()}-{hashlib.sha256(features.encode()).hexdigest()[:12]}"
