"""Claim: in a run every trajectory of a filter that draws random numbers draws its own, whatever the block."""

from __future__ import annotations

import numpy as np
import pytest

import nlbench as nb


@pytest.mark.parametrize("name", [pytest.param("ensemble", marks=pytest.mark.long), "bootstrap"])
def test_errors_of_sampling_are_independent_from_run_to_run(name, tmp_path):
    """Against the Kalman filter on the same linear data; with common draws the differences would be nearly equal."""
    system = {"name": "culver-scalar", "dynamics": "linear", "decay": 0.5}
    results = nb.run(
        {
            "experiment": "sampled",
            "system": system,
            "filters": [{"name": name, "particles": 50}, "linearised-kalman"],
            "time": {"end": 0.4, "step": 0.02, "output": 0.1},
            "monte_carlo": {"runs": 200, "seed": 4},
            "engine": {"cost": False},
        },
        tmp_path,
    )
    kept = results.table("runs").set_index(["filter", "run"]).x
    apart = (kept[name] - kept["linearised-kalman"]).to_numpy()
    spread, together = apart.std(), abs(apart.mean())
    assert spread > 0.01
    assert together < 4 * spread / np.sqrt(len(apart)) + 0.2 * spread
    assert abs(np.corrcoef(apart[:-1], apart[1:])[0, 1]) < 4 / np.sqrt(len(apart))
