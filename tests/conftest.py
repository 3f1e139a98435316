"""What holds for all tests: shapes and types are enforced, and numbers are double precision."""

from __future__ import annotations

from jaxtyping import install_import_hook

# Before anything of nlbench is imported: the hook decorates every function of these packages.
NUMERICAL = (
    "algebra continuous discrete engine filters moments references simulate statistics systems updates"
)
install_import_hook([f"nlbench.{package}" for package in NUMERICAL.split()], "beartype.beartype")

import jax  # noqa: E402 - the hook comes first

jax.config.update("jax_enable_x64", True)
