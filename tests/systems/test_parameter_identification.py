"""Claim: parameter-identification is Athans's first-order system with unknown coefficient, in two ensembles."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm, truncnorm

import nlbench as nb
from nlbench.errors import ConfigError
from tests.systems.following import followed, simulated

nb.configure()
BOUND = 0.84 / 0.5003729518
MATCHED = truncnorm(-BOUND, BOUND, loc=0.5, scale=0.575 * 0.5003729518)


def build(**parameters):
    return nb.systems.build("parameter-identification", **parameters)


def test_chosen_values_are_the_defaults():
    system = build()
    np.testing.assert_array_equal(system.initial.mean, [0.0, 0.5])
    np.testing.assert_allclose(system.initial.cov, np.diag([4 / 3, 0.0529]), rtol=1e-15)
    assert (system.process_cov, system.measurement_cov) == ([[1.0]], [[1.0]])
    assert [each.name for each in system.coordinates] == ["state", "coefficient"]


def test_the_coefficient_is_constant_and_multiplies_the_state():
    system, x = build(), jnp.array([3.0, -0.5])
    np.testing.assert_allclose(system.transition(7, x, jnp.array([0.25])), [-1.25, -0.5])
    np.testing.assert_allclose(system.observe(7, x, jnp.array([0.25])), [3.25])


def test_the_coefficient_of_the_default_ensemble_is_bounded_below_one_with_the_moments_of_the_filters():
    x = np.asarray(jax.jit(jax.vmap(build().sample))(jax.random.split(jax.random.key(3), 200_000)))
    assert MATCHED.std() == pytest.approx(0.23, rel=2e-9)
    assert MATCHED.support()[0] <= x[:, 1].min()
    assert x[:, 1].max() <= MATCHED.support()[1] < 1.0
    for values, law in ((x[:, 0], norm(0.0, np.sqrt(4 / 3))), (x[:, 1], MATCHED)):
        for power in (1, 2, 3, 4):
            powers = (values - law.mean()) ** power
            expected = law.expect(lambda v, law=law, k=power: (v - law.mean()) ** k)
            assert abs(powers.mean() - expected) < 4 * powers.std() / np.sqrt(len(powers))
    product = x[:, 0] * (x[:, 1] - 0.5)
    assert abs(product.mean()) < 4 * product.std() / np.sqrt(len(product))


def test_the_normal_ensemble_is_that_of_the_filters():
    assert build(ensemble="normal").sample is None


@pytest.mark.parametrize(("ensemble", "law"), [("matched", MATCHED), ("normal", norm(0.5, 0.23))])
def test_nodes_of_the_reference_are_the_ensemble(ensemble, law):
    """First four moments; beyond the six standard deviations covered a normal one has 7e-8 of its fourth."""
    bank = build(ensemble=ensemble).exact
    assert bank.weights.sum() == pytest.approx(1.0, abs=1e-12)
    for power in (1, 2, 3, 4):
        expected = law.expect(lambda v, k=power: (v - 0.5) ** k)
        assert bank.weights @ (bank.nodes - 0.5) ** power == pytest.approx(expected, abs=1e-8)
    assert (bank.mean, bank.cov) == ([0.0], [[4 / 3]])


@pytest.mark.parametrize("name", ["ekf", "sof-gaussian", "ukf"])
def test_filters_follow_it_and_learn_the_coefficient(name):
    """After 200 steps its error is less than at the start, .23, in the mean over 64 runs."""
    system = build()
    states, seen = simulated(system, 200, 64, seed=1)
    means, covs = followed(name, system, seen)
    error = states - means
    assert np.isfinite(covs).all()
    assert not np.any(jax.vmap(system.diverged)(jnp.asarray(error.reshape(-1, 2))))
    assert np.sqrt((error[:, -1, 1] ** 2).mean()) < 0.12
    assert system.diverged(jnp.array([0.0, -3.1]))
    assert system.diverged(jnp.array([101.0, 0.0]))


@pytest.mark.parametrize(
    "bad",
    [
        {"ensemble": "uniform"},
        {"coefficient_deviation": 0.0},
        {"process_variance": 0.0},
        {"measurement_variance": -1.0},
        {"interval": 0},
        {"order": 2},
    ],
)
def test_parameters_out_of_range_or_unknown_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))) as caught:
        build(**bad)
    assert len(caught.value.problems) == 1
