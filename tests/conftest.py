"""What holds for all tests: double precision; with NLBENCH_TYPES=1, shapes and types are enforced."""

from __future__ import annotations

import os

if os.environ.get("NLBENCH_TYPES") == "1":
    from jaxtyping import install_import_hook

    # Before anything of nlbench is imported: the hook decorates every function of these packages.
    numerical = "algebra engine filters moments references simulate statistics systems updates"
    install_import_hook([f"nlbench.{package}" for package in numerical.split()], "beartype.beartype")

import jax

jax.config.update("jax_enable_x64", True)
