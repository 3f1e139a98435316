"""What this machine offers, and whether it is as nlbench wants it."""

from __future__ import annotations

import os
import sys

from nlbench.runtime import XLA_OPTIONS


def doctor() -> list[tuple[str, bool, str]]:
    """(what, whether it is as wanted, a word on it) for each finding; measures the effect of XLA's options."""
    from importlib.metadata import version

    import jax

    from nlbench.engine.effect import speedup_by_options

    flags = os.environ.get("XLA_FLAGS", "")
    present = all(option.split("=")[0] in flags for option in XLA_OPTIONS)
    device = jax.devices()[0]
    precision = jax.numpy.result_type(float).name
    findings = [
        ("python", sys.version_info >= (3, 11), sys.version.split()[0]),
        *((name, True, version(name)) for name in ("jax", "jaxlib", "equinox", "diffrax")),
        ("device", True, f"{len(jax.devices())} x {device.device_kind}"),
        ("cores", True, f"{len(os.sched_getaffinity(0))} available to this process"),
        ("precision", precision == "float64", precision),
        (
            "xla options",
            present,
            "set" if present else f"missing; jax started before nlbench: {flags or 'none set'}",
        ),
    ]
    gain = speedup_by_options()
    return [
        *findings,
        ("effect of xla options", gain >= 2.0, f"third-order filter {gain:.1f} times faster with them"),
    ]
