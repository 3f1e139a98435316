"""Claim: lunar-orbit has the thesis's numbers; one truth, whatever the filter's coordinates and the axes of errors."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench import orbit
from nlbench.errors import ConfigError
from tests.small_runs import experiment

R0, V0 = 6.228e6, 5175.0
TRUE = np.array([4.1e6, 4.7e6, -3900.0, 3400.0])


def build(**parameters):
    return nb.systems.build("lunar-orbit", **parameters)


def run(tmp_path, **changes):
    stated = {
        "experiment": "orbit",
        "system": {"name": "lunar-orbit"},
        "filters": ["linearised-kalman"],
        "reference": None,
        "time": {"end": 4000.0, "step": 50.0, "output": 500.0},
        "report_times": [2000.0, 4000.0],
        "monte_carlo": {"runs": 150, "seed": 3},
    }
    return nb.run(experiment(**{**stated, **changes}), tmp_path)


@pytest.mark.parametrize(
    "bad",
    [{"length_unit": 1e200}, {"length_unit": 1e-200}, {"time_unit": 1e200}, {"measurement_variance": np.inf}],
)
def test_parameters_out_of_range_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))):
        nb.systems.build("lunar-orbit", **bad)


def test_published_values_are_the_defaults():
    system = build()
    np.testing.assert_array_equal(system.initial.mean, [R0, 0, 0, V0])
    np.testing.assert_array_equal(system.initial.cov, np.diag([1e6, 1e6, 1.0, 1.0]))
    assert (system.measurement_cov, system.step, system.interval) == ([[1.6e-5]], 50.0, None)
    degrees = np.degrees(system.sightings.angles)
    np.testing.assert_allclose(degrees, [81, 89, 98, 261, 269, 278], rtol=1e-12)
    np.testing.assert_allclose(np.degrees(system.sightings.due(7)), 720 + 89, rtol=1e-12)
    other = build(case="500-mile")
    np.testing.assert_array_equal(other.initial.mean, [8.34e6, 0, 0, 4470])
    np.testing.assert_array_equal(other.initial.cov, np.diag([2.5e7, 2.5e7, 4.0, 4.0]))
    assert (other.measurement_cov, other.step) == ([[2.5e-5]], 30.0)
    np.testing.assert_allclose(np.degrees(other.sightings.angles), [74, 104, 254, 284], rtol=1e-12)
    assert build(sightings=False).sightings is None


@pytest.mark.parametrize("initial_cov", ["diagonal", "transformed"])
def test_a_polar_filter_starts_from_its_own_variances_or_from_the_cartesian_ones_carried_over(initial_cov):
    initial = build(coordinates="polar", initial_cov=initial_cov).initial
    np.testing.assert_array_equal(initial.mean, orbit.polar(np.array([R0, 0, 0, V0]), R0))
    J = jax.jacfwd(lambda x: orbit.polar(x, R0))(jnp.array([R0, 0, 0, V0]))
    expected = np.diag([1e6, 1e6, 1.0, 1.0])
    if initial_cov == "transformed":
        expected = J @ expected @ J.T
    np.testing.assert_allclose(initial.cov, expected, rtol=1e-12, atol=1e-9)


def test_a_polar_system_observes_what_the_cartesian_one_does():
    cartesian, polar = build(), build(coordinates="polar")
    p = orbit.polar(TRUE, R0)
    for number in range(8):
        mark = cartesian.sightings.mark(number)
        one = cartesian.sightings.observe(mark, TRUE)
        np.testing.assert_allclose(polar.sightings.observe(mark, p), one, rtol=1e-12)
        np.testing.assert_allclose(cartesian.sighted(number).observe(0.0, TRUE), one, rtol=1e-15)
    np.testing.assert_allclose(polar.sightings.angle(p), cartesian.sightings.angle(TRUE), rtol=1e-12)


def test_without_a_number_the_nearest_landmark_is_observed():
    system = build()
    for x, landmark in ((TRUE, 89.0), (-TRUE, 269.0)):
        expected = orbit.landmark_angle(x, np.radians(landmark), 5.7e6)
        np.testing.assert_allclose(system.observe(0.0, x), [expected], rtol=1e-14)


def test_a_residual_is_the_smallest_of_its_equals():
    residual = build().residual(jnp.array([3.1]), jnp.array([-3.1]))
    np.testing.assert_allclose(residual, [6.2 - 2 * np.pi], rtol=1e-13)


@pytest.mark.parametrize("coordinates", ["cartesian", "polar"])
def test_errors_are_those_of_the_converted_estimate_in_every_axes(coordinates):
    estimate = TRUE + np.array([900.0, -700.0, 0.6, 1.1])
    m = orbit.polar(estimate, R0) if coordinates == "polar" else estimate
    error = {
        axes: build(coordinates=coordinates, errors=axes).error(TRUE, m)
        for axes in ("cartesian", "polar", "local-vertical")
    }
    np.testing.assert_allclose(error["cartesian"], TRUE - estimate, rtol=1e-6)
    np.testing.assert_allclose(error["polar"], orbit.polar(TRUE, R0) - orbit.polar(estimate, R0), rtol=1e-6)
    expected = orbit.local_vertical_error(TRUE - estimate, TRUE)
    np.testing.assert_allclose(error["local-vertical"], expected, rtol=1e-6)


def test_an_arc_error_does_not_count_whole_turns():
    p = np.array(orbit.polar(TRUE, R0))
    turns = p + np.array([0.0, 3 * 2 * np.pi * R0 - 500.0, 0.0, 0.0])
    error = build(coordinates="polar", errors="polar").error(TRUE, turns)
    np.testing.assert_allclose(error, [0, 500, 0, 0], atol=1e-6)


def test_fixed_errors_go_through_the_sixteen_patterns_of_signs():
    states = build(initial_error={"sigma": 2}).sample.transform(None)
    unit = (states - np.array([R0, 0, 0, V0])) / np.array([1000.0, 1000.0, 1.0, 1.0])
    assert build(initial_error={"sigma": 2}).sample.size == 16
    assert {tuple(row) for row in np.round(unit, 9)} == {
        (a, b, c, d) for a in (-2, 2) for b in (-2, 2) for c in (-2, 2) for d in (-2, 2)
    }
    one = build(initial_error={"sigma": 1, "pattern": "+--+"}).sample
    np.testing.assert_allclose(one.transform(None), [[R0 + 1000, -1000, -1, V0 + 1]])
    with pytest.raises(ConfigError, match="pattern"):
        build(initial_error={"sigma": 1, "pattern": "+-"})


@pytest.mark.long
def test_patterns_are_spread_evenly_over_the_runs(tmp_path):
    results = run(tmp_path, system={"name": "lunar-orbit", "initial_error": {"sigma": 1}, "sightings": False})
    kept = results.table("runs")
    early = kept[kept.time == 2000.0]
    counts = early.groupby(early.altitude.round(6)).size()  # without sightings runs of one pattern are equal
    assert len(counts) == 16
    assert set(counts) == {9, 10}  # of 150


def test_cartesian_and_polar_filters_see_the_same_runs(tmp_path):
    """Without sightings an estimate is the nominal orbit in either coordinates, so errors agree run by run."""
    polar = {"name": "linearised-kalman", "label": "polar", "model": {"coordinates": "polar"}}
    both = run(
        tmp_path,
        system={"name": "lunar-orbit", "sightings": False},
        filters=["linearised-kalman", polar],
    )
    kept = both.table("runs").set_index(["filter", "run", "time"]).sort_index()
    for name in ("altitude", "range", "altitude_rate", "range_rate"):
        one, other = kept.loc["linearised-kalman"][name], kept.loc["polar"][name]
        np.testing.assert_allclose(one, other, atol=1e-4 * one.abs().max())
    assert kept.loc["polar"].range.std() > 1000.0


@pytest.mark.long
@pytest.mark.parametrize(
    "changes", [{"coordinates": "polar"}, pytest.param({"sightings": False}, marks=pytest.mark.long)]
)
def test_the_reference_is_there_whatever_the_filters_coordinates_and_without_sightings(tmp_path, changes):
    results = run(tmp_path, system={"name": "lunar-orbit", **changes}, reference="exact")
    rms = results.table("statistics").query(
        "statistic == 'rms' and coordinate == 'position' and time == '4000.0'"
    )
    assert rms.set_index("filter").value["exact"] > 100.0
    assert results.table("divergence").diverged.sum() == 0


@pytest.mark.long
def test_feet_and_nondimensional_units_give_the_same_statistics(tmp_path):
    """Lengths in initial radii, times in initial radii by initial speed; third-order filter, sightings."""
    filters = [
        {"name": "third-order", "limiter": 1.5, "limiter_scope": "nonlinear"},
        {"name": "third-order", "label": "polar", "model": {"coordinates": "polar"}},
    ]
    L, T = 6.228e6, 6.228e6 / 5175.0
    times = {"end": 8000.0, "step": 50.0, "output": 1000.0}
    feet = run(tmp_path / "feet", filters=filters, time=times, report_times=[4000.0, 8000.0])
    units = run(
        tmp_path / "units",
        system={"name": "lunar-orbit", "length_unit": L, "time_unit": T},
        filters=filters,
        time={name: t / T for name, t in times.items()},
        report_times=[4000.0 / T, 8000.0 / T],
    )
    columns = ["filter", "coordinate", "statistic", "value"]
    one, other = (results.table("statistics") for results in (feet, units))
    assert (one[columns[:3]] == other[columns[:3]]).all().all()
    scale = {"altitude": L, "range": L, "altitude_rate": L / T, "range_rate": L / T}
    scale |= {"position": L, "velocity": L / T}
    power = one.statistic.map(lambda name: 2 if "variance" in name else 3 if "third" in name else 1)
    power = power.where(~one.statistic.isin(["nees", "coverage_95"]), 0)
    converted = other.value * one.coordinate.map(scale).fillna(1.0) ** power
    magnitude = one.groupby(["filter", "coordinate", "statistic"]).value.transform(lambda v: v.abs().max())
    assert ((one.value - converted).abs() <= 1e-6 * magnitude).all()
    assert len(one) > 200
