"""Claim: schwartz is the source's two systems and four measurements, and its filters may believe otherwise."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.errors import ConfigError
from tests.small_runs import python

DRIFTS = {"D1": lambda x: -x / (1 + x * x), "D2": lambda x: -(x**3)}
MEASUREMENTS = {"M11": np.arctan, "M12": lambda x: x, "M21": lambda x: x + x**3, "M22": lambda x: x}


def build(**parameters):
    return nb.systems.build("schwartz", **parameters)


@pytest.mark.parametrize("dynamics", DRIFTS)
@pytest.mark.parametrize("measurement", MEASUREMENTS)
def test_drift_and_measurement_are_the_printed_ones(dynamics, measurement):
    system = build(dynamics=dynamics, measurement=measurement)
    for x in (-1.7, 0.0, 0.4, 2.0):
        np.testing.assert_allclose(system.drift(0.0, jnp.array([x])), [DRIFTS[dynamics](x)], rtol=1e-15)
        np.testing.assert_allclose(
            system.observe(0.0, jnp.array([x])), [MEASUREMENTS[measurement](x)], rtol=1e-15
        )


def test_the_measurement_is_right_under_the_options_that_runs_set():
    """In vectors of 512 bits, where the processor has them, XLA's own arc tangent is wrong."""
    program = """
import nlbench as nb
nb.configure()
import jax, numpy as np
x = np.linspace(-3.0, 3.0, 1501)
observe = nb.systems.build("schwartz").observe
print(np.abs(jax.jit(jax.vmap(lambda x: observe(0.0, x)))(x[:, None])[:, 0] - np.arctan(x)).max())
"""
    assert float(python(program, check=True, xla_flags="").stdout) < 1e-15


def test_published_values_are_the_defaults():
    system = build()
    assert (system.measurement, system.step, system.interval) == ("continuous", 0.001, None)
    assert (system.states, system.measurements) == (1, 1)
    np.testing.assert_array_equal(system.measurement_cov, [[10.0]])
    np.testing.assert_array_equal(system.diffusion_spectrum(0.0, jnp.zeros(1)), [[1.0]])
    np.testing.assert_array_equal(system.initial.mean, [0.0])
    np.testing.assert_array_equal(system.initial.cov, [[1.0]])
    np.testing.assert_array_equal(build(dynamics="D2").initial.cov, [[0.25]])
    assert system.truth is None
    assert (system.clip, system.coordinates[0].name) == ((5.0,), "x")


def test_diverged_is_an_error_above_twenty():
    diverged = build().diverged
    assert [bool(diverged(jnp.array([e]))) for e in (19.9, -19.9, 20.1, -20.1)] == [False, False, True, True]


def test_what_filters_assume_may_differ_from_the_truth():
    system = build(
        dynamics="D2",
        process_psd=2.0,
        measurement_psd=3.0,
        initial_variance=0.5,
        assumed_process_psd=4.0,
        assumed_measurement_psd=5.0,
        assumed_initial_variance=6.0,
    )
    for each, q, r, p in ((system, 4.0, 5.0, 6.0), (system.truth, 2.0, 3.0, 0.5)):
        np.testing.assert_array_equal(each.diffusion_cov, [[q]])
        np.testing.assert_array_equal(each.measurement_cov, [[r]])
        np.testing.assert_array_equal(each.initial.cov, [[p]])
    assert build(measurement_psd=3.0, assumed_measurement_psd=3.0).truth is None
    assert build(assumed_process_psd=0.0).diffusion is None


def test_a_fixed_initial_error_is_in_standard_deviations_of_the_truth():
    for system in (
        build(dynamics="D2", initial_error={"sigma": -2.0}),
        build(dynamics="D2", initial_error={"sigma": -2.0}, assumed_initial_variance=9.0).truth,
    ):
        np.testing.assert_array_equal(system.sample(jax.random.key(1)), [-1.0])


@pytest.mark.parametrize(("mode", "held"), [("hold", True), ("pulse", False)])
def test_filters_may_see_samples_while_the_truth_stays_what_it_was(mode, held):
    system = build(sampling={"mode": mode, "period": 0.1})
    assert tuple(system.sampling) == (0.1, held)
    np.testing.assert_array_equal(system.measurement_cov, build().measurement_cov)
    assert build().sampling is None


def test_a_filter_may_ignore_the_factor_dt():
    """It takes the variance of the numbers drawn, density over step, for the density."""
    given = {"assumed_process_psd": 1.0 / 0.001, "assumed_measurement_psd": 10.0 / 0.001}
    f = nb.filters.build("schwartz-2", build(dynamics="D2", measurement="M22", **given))
    rates = f.rates(f.init(nb.Moments([0.0], [[2.0]])), 0.0, np.array([5.0]))
    np.testing.assert_allclose(rates.mean, [2.0 / 10_000 * 5.0], rtol=1e-13)
    np.testing.assert_allclose(rates.cov, [[1000.0 - 2.0**2 / 10_000]], rtol=1e-13)


@pytest.mark.parametrize(
    "bad",
    [
        {"dynamics": "D3"},
        {"measurement": "M13"},
        {"process_psd": -1.0},
        {"measurement_psd": 0.0},
        {"assumed_measurement_psd": 0.0},
        {"initial_variance": 0.0},
        {"interval": 0.1},
        {"sampling": {"mode": "hold"}},
        {"sampling": {"mode": "hold", "period": 0.0}},
    ],
)
def test_parameters_out_of_range_or_unknown_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))):
        build(**bad)
