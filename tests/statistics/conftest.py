"""Invented runs that several tests of statistics share."""

from __future__ import annotations

import pytest

from tests.statistics import made_runs

FEW, MANY = 500, 2700  # fewer and more blocks than the jackknife needs; both end in a padded block


@pytest.fixture(scope="session", params=[FEW, MANY], ids=["delta", "jackknife"])
def sample(request):
    """Layout, runs and totals."""
    layout = made_runs.layout()
    runs = made_runs.make(layout, request.param, seed=request.param)
    return layout, runs, made_runs.total(runs, layout)
