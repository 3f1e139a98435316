"""Claim: the limiter clips what its scope says, the guard fires when it should, missing entries drop out."""

from __future__ import annotations

import jax
import numpy as np
import pytest

import nlbench as nb
from nlbench.filters.catalogue import FILTERS
from tests.oracle import bayes, fourth_moment, kalman_update, random_cov, rng, symmetrise
from tests.problems import dense, linear_measurement, updated

GUARDED = {"third-order-guarded": "third-order", "fourth-order-guarded": "fourth-order"}


def scalar(skewness, u, p=1.0, noise=0.5, k4=None):
    """A scalar prior of variance p measured directly, with a residual of u predicted standard deviations."""
    third = [[[skewness * p**1.5]]]
    fourth = None if k4 is None else [[[[3 * p * p + k4]]]]
    y = np.array([u * np.sqrt(p + noise)])
    return linear_measurement([0.0], [[p]], np.eye(1), [[noise]], third, fourth), y


def one_plus_nu(skewness, u, p=1.0, noise=0.5):
    """1 + s_z (u^3 - 3u) / 6 with s_z the skewness of the predicted measurement (equations sheet, 6.2)."""
    return 1 + skewness * (p / (p + noise)) ** 1.5 / 6 * (u**3 - 3 * u)


def sub1_with_unit_kappa(system, y):
    """Kalman mean and covariance; the third moment carried by G = I - K H on each index."""
    m, p, s = (np.asarray(a) for a in (system.initial.mean, system.initial.cov, system.initial.third))
    h, noise = np.asarray(system.observe(0.0, np.eye(len(m)))), np.asarray(system.measurement_cov)
    gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + noise)
    g = np.eye(len(m)) - gain @ h
    return m + gain @ (y - h @ m), g @ p, np.einsum("abc,ia,jb,kc->ijk", s, g, g, g)


@pytest.mark.parametrize("u", [-3.2, -2.6, -2.0, -1.0, 0.0, 1.5, 2.5, 4.0])
@pytest.mark.parametrize("skewness", [-1.4, -0.6, 0.3, 0.9, 1.8])
def test_guard_fires_when_the_density_or_the_covariance_is_not_safe_scalar(skewness, u):
    system, y = scalar(skewness, u)
    _assert_guard(system, y)


@pytest.mark.parametrize("seed", range(12))
def test_guard_fires_when_the_density_or_the_covariance_is_not_safe_two_states(seed):
    g = rng(seed)
    cov, h, noise = random_cov(g, 2), g.normal(size=(1, 2)), np.array([[0.3]])
    root = np.linalg.cholesky(cov)
    third = np.einsum("abc,ia,jb,kc->ijk", symmetrise(g.normal(size=(2, 2, 2))), root, root, root)
    system = linear_measurement(np.zeros(2), cov, h, noise, third)
    _assert_guard(system, g.choice([-2.5, 2.5, 1.0], size=1) * np.sqrt((h @ cov @ h.T + noise)[0]))


def _assert_guard(system, y):
    """By quadrature: fires if evidence / Gaussian evidence < .25 or the formal covariance is not positive."""
    moments, info = updated("third-order-guarded", system, y)
    initial, h = system.initial, np.asarray(system.observe(0.0, np.eye(len(system.initial.mean))))
    prior = (np.asarray(initial.mean), np.asarray(initial.cov))
    noise = np.asarray(system.measurement_cov)
    exact = bayes(*prior, np.asarray(initial.third), None, lambda x: h @ x, noise, y)
    gaussian = bayes(*prior, None, None, lambda x: h @ x, noise, y)
    ratio, smallest = exact.evidence / gaussian.evidence, np.linalg.eigvalsh(exact.cov).min()
    assert min(abs(ratio - 0.25), abs(smallest)) > 1e-6, "the case sits on the threshold"
    fires = ratio < 0.25 or smallest <= 0
    assert bool(info.guarded) == fires
    expected = sub1_with_unit_kappa(system, y) if fires else exact[:3]
    for mine, theirs in zip(dense(moments), expected, strict=False):
        np.testing.assert_allclose(mine, theirs, rtol=1e-8, atol=1e-9)


def test_guard_cases_cover_both_reasons_and_neither():
    """The scalar grid above holds cases of each kind, so that the claim is not empty."""
    kinds = set()
    for skewness in (-1.4, -0.6, 0.3, 0.9, 1.8):
        for u in (-3.2, -2.6, -2.0, -1.0, 0.0, 1.5, 2.5, 4.0):
            system, y = scalar(skewness, u)
            moments, _ = updated("third-order", system, y)
            kinds.add((one_plus_nu(skewness, u) < 0.25, float(moments.cov[0, 0]) <= 0))
    assert {(True, True), (False, True), (False, False)} <= kinds


@pytest.mark.parametrize("name", GUARDED)
@pytest.mark.parametrize(("offset", "fires"), [(-1e-7, True), (1e-7, False)])
def test_guard_threshold_is_a_quarter(name, offset, fires):
    """Close to 1 + nu = .25 with a positive covariance, the sign of the difference decides.

    At u = 1 the skewness 3 (.75 - offset) (1 + R)^1.5 brings 1 + nu to .25 + offset.
    """
    u, noise = 1.0, 0.02
    skewness = (0.75 - offset) * 3 * (1 + noise) ** 1.5
    assert one_plus_nu(skewness, u, noise=noise) == pytest.approx(0.25 + offset, abs=1e-12)
    system, y = scalar(skewness, u, noise=noise)
    plain, info = updated(GUARDED[name], system, y)
    assert float(info.nu) == pytest.approx(offset - 0.75, abs=1e-12)
    positive = float(plain.cov[0, 0]) > 0
    _, info = updated(name, system, y)
    assert positive
    assert bool(info.guarded) == fires


@pytest.mark.parametrize("name", GUARDED)
def test_a_guard_that_fires_takes_the_kalman_mean_and_covariance(name):
    system, y = scalar(2.5, 1.0, noise=0.02, k4=0.1)
    moments, info = updated(name, system, y)
    mean, cov = kalman_update(np.zeros(1), np.eye(1), np.eye(1), 0.02 * np.eye(1), y)
    assert bool(info.guarded)
    np.testing.assert_allclose(moments.mean, mean, rtol=1e-13)
    np.testing.assert_allclose(moments.cov, cov, rtol=1e-13)


@pytest.mark.parametrize("guarded", GUARDED)
def test_guarded_filters_are_the_plain_ones_with_the_option(guarded):
    for u in (1.0, -2.0, 0.3):
        system, y = scalar(2.5, u, noise=0.02)
        plain, option = updated(guarded, system, y)[0], updated(GUARDED[guarded], system, y, guard="sub1")[0]
        for mine, theirs in zip(dense(plain), dense(option), strict=True):
            if theirs is not None:
                np.testing.assert_array_equal(mine, theirs)


def test_without_a_guard_nothing_is_counted():
    system, y = scalar(2.5, 1.0, noise=0.02)
    assert not bool(updated("third-order", system, y)[1].guarded)
    assert bool(updated("third-order", system, y, guard="sub1")[1].guarded)


@pytest.mark.parametrize("name", GUARDED)
def test_a_state_that_is_lost_already_is_not_counted_as_guarded(name):
    system = linear_measurement([0.0], np.eye(1), np.eye(1), np.eye(1), [[[0.1]]])
    f = nb.filters.build(name, system)
    lost = f.init(system.initial._replace(mean=np.array([np.nan])))
    assert not bool(f.update(lost, 0.0, np.ones(1))[1].guarded)


def two_measurements(seed=0):
    g = rng(seed)
    cov = random_cov(g, 2)
    third = 0.2 * symmetrise(g.normal(size=(2, 2, 2)))
    h, noise = g.normal(size=(2, 2)), random_cov(g, 2)
    return linear_measurement(g.normal(size=2), cov, h, noise, third), h, noise


def limited(z, h, cov, noise, sigmas):
    bound = sigmas * np.sqrt(np.diag(h @ cov @ h.T + noise))
    return np.clip(z, -bound, bound)


@pytest.mark.parametrize("name", ["linearised-kalman", "second-order", "third-order", "fourth-order"])
def test_limiter_over_all_uses_equals_a_clipped_measurement(name):
    system, h, noise = two_measurements()
    cov, mean = np.asarray(system.initial.cov), np.asarray(system.initial.mean)
    z = np.array([3.0, -0.2])
    clipped = limited(z, h, cov, noise, 0.7)
    assert clipped[0] != z[0]
    assert clipped[1] == z[1]
    actual, _ = updated(name, system, h @ mean + z, limiter=0.7)
    expected, _ = updated(name, system, h @ mean + clipped)
    for mine, theirs in zip(dense(actual), dense(expected), strict=True):
        if theirs is not None:
            np.testing.assert_allclose(mine, theirs, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", ["third-order", "third-order-sub1", "third-order-sub2", "fourth-order"])
def test_limiter_of_the_nonlinear_part_leaves_the_kalman_correction(name):
    """The mean is as clipped but with the Kalman correction of the full residual; the rest is as clipped."""
    system, h, noise = two_measurements()
    cov, mean = np.asarray(system.initial.cov), np.asarray(system.initial.mean)
    z = np.array([3.0, -0.2])
    clipped = limited(z, h, cov, noise, 0.7)
    actual, _ = updated(name, system, h @ mean + z, limiter=0.7, limiter_scope="nonlinear")
    as_clipped, _ = updated(name, system, h @ mean + clipped)
    shift = kalman_update(mean, cov, h, noise, z)[0] - kalman_update(mean, cov, h, noise, clipped)[0]
    np.testing.assert_allclose(actual.mean, np.asarray(as_clipped.mean) + shift, rtol=1e-11, atol=1e-12)
    for mine, theirs in zip(dense(actual)[1:], dense(as_clipped)[1:], strict=True):
        if theirs is not None:
            np.testing.assert_allclose(mine, theirs, rtol=1e-11, atol=1e-12)


def test_a_residual_within_the_limit_is_untouched():
    system, h, _ = two_measurements()
    y = h @ np.asarray(system.initial.mean) + np.array([0.1, -0.1])
    for scope in ("all", "nonlinear"):
        limited_, _ = updated("third-order", system, y, limiter=3.0, limiter_scope=scope)
        free, _ = updated("third-order", system, y)
        for mine, theirs in zip(dense(limited_), dense(free), strict=True):
            if theirs is not None:
                np.testing.assert_array_equal(mine, theirs)


NAMES = [name for name, row in FILTERS.items() if row.family == "moment"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("missing", [0, 1])
def test_a_missing_entry_is_as_if_its_row_were_not_there(name, missing):
    system, h, noise = two_measurements(1)
    kept = 1 - missing
    initial = system.initial
    fewer = linear_measurement(
        initial.mean, initial.cov, h[[kept]], noise[[kept]][:, [kept]], initial.third, initial.fourth
    )
    y = np.array([0.8, -1.1])
    actual, info = updated(name, system, np.where(np.arange(2) == missing, np.nan, y))
    expected, reference = updated(name, fewer, y[[kept]])
    for mine, theirs in zip(dense(actual), dense(expected), strict=True):
        if theirs is not None:
            np.testing.assert_allclose(mine, theirs, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(info.log_likelihood, reference.log_likelihood, rtol=1e-12)
    np.testing.assert_allclose(info.nu, reference.nu, rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("name", NAMES)
def test_a_measurement_that_is_all_missing_changes_nothing(name):
    system, _, _ = two_measurements(2)
    f = nb.filters.build(name, system)
    before = f.init(system.initial)
    after, info = f.update(before, 0.0, np.full(2, np.nan))
    for mine, theirs in zip(dense(f.moments(after)), dense(f.moments(before)), strict=True):
        if theirs is not None:
            np.testing.assert_array_equal(mine, theirs)
    assert not bool(info.guarded)
    assert float(info.log_likelihood) == 0.0


@pytest.mark.parametrize("name", ["third-order-guarded", "fourth-order-guarded"])
def test_the_guard_works_beside_a_missing_entry(name):
    """A missing entry must not trip the guard, nor hide that it should fire."""
    fourth = fourth_moment(np.eye(1))
    third = [[[2.5]]]
    two = linear_measurement([0.0], np.eye(1), np.ones((2, 1)), 0.02 * np.eye(2), third, fourth)
    one = linear_measurement([0.0], np.eye(1), np.ones((1, 1)), 0.02 * np.eye(1), third, fourth)
    for u in (1.0, -0.3):
        _, info = updated(name, two, np.array([np.nan, u]))
        _, reference = updated(name, one, np.array([u]))
        assert bool(info.guarded) == bool(reference.guarded)
    assert bool(updated(name, one, np.array([1.0]))[1].guarded)
    assert not bool(updated(name, one, np.array([-0.3]))[1].guarded)


@pytest.mark.parametrize("name", GUARDED)
def test_a_guarded_update_reports_a_finite_likelihood(name):
    """Where 1 + nu < 0 its logarithm does not exist; the guarded density is the Gaussian one."""
    system, y = scalar(1.8, -3.2)
    _, info = updated(name, system, y)
    assert bool(info.guarded)
    assert float(info.nu) < -1
    gaussian = -0.5 * (y[0] ** 2 / 1.5 + np.log(2 * np.pi * 1.5))
    np.testing.assert_allclose(info.log_likelihood, gaussian, rtol=1e-12)


def test_a_negative_predicted_variance_leaves_nothing_of_the_residual():
    from nlbench.algebra import Tensor
    from nlbench.updates.limiter import limited

    S_z = Tensor.from_array(np.array([[-1.0, 0.0], [0.0, 4.0]]), ((0, 1),))
    clipped = limited(Tensor.from_array(np.array([3.0, 9.0])), S_z, 2.0)
    np.testing.assert_array_equal(np.asarray(clipped.to_array()), [0.0, 4.0])


def letting_in(ratios, **options):
    """Means and covariances of the integration update for priors so many times diag(1, 4) correlated, seen by three
    sensors of variance .2 at once; and Kalman's."""
    h, noise, prior = (
        np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]),
        0.2 * np.eye(3),
        [[1.0, 1.2], [1.2, 4.0]],
    )
    f = nb.filters.build(
        "integration-update", linear_measurement(np.zeros(2), np.eye(2), h, noise), **options
    )
    covs = np.multiply.outer(ratios, np.array(prior))
    y = np.sqrt(ratios)[:, None] * [1.0, 2.0, 2.5]

    def one(cov, y):
        state, _ = f.update(f.init(nb.Moments(np.zeros(2), cov)), 0.0, y)
        moments = f.moments(state)
        return moments.mean, moments.cov

    found = jax.jit(jax.vmap(one))(covs, y)
    exact = [
        kalman_update(np.zeros(2), *each)
        for each in ((cov, h, noise, z) for cov, z in zip(covs, y, strict=True))
    ]
    return [np.asarray(part) for part in found], [np.stack(part) for part in zip(*exact, strict=True)]


def relative_errors(found, exact):
    """Of means in deviations, and of covariances in the largest ratio of variances in any direction less one."""
    roots = np.linalg.inv(np.linalg.cholesky(exact[1]))
    means = np.abs(np.einsum("kij,kj->ki", roots, found[0] - exact[0])).max(1)
    covs = np.einsum("kia,kab,kjb->kij", roots, found[1] - exact[1], roots)
    return means, np.abs(np.linalg.eigvalsh(covs)).max(1)


def test_the_integration_update_is_kalmans_however_much_is_let_in():
    """A linear measurement at the default steps: to 1e-5 up to an information of a million, and failed beyond it."""
    information = 12.4 * 5.0  # tr(H P H' R^-1) of the prior once
    ratios = np.array([1e-4, 1e-2, 0.1, 0.25, 1.0, 10.0, 1e3, 0.99e6 / information, 1.01e6 / information])
    found, exact = letting_in(ratios)
    means, covs = relative_errors([part[:-1] for part in found], [part[:-1] for part in exact])
    assert means.max() < 1e-5
    assert covs.max() < 1e-5
    assert np.isnan(found[0][-1]).all()
    assert np.isnan(found[1][-1]).all()


@pytest.mark.parametrize("steps", [1, 5, 20])
def test_equal_steps_that_are_too_long_fail_and_the_others_are_right_to_one_percent(steps):
    found, exact = letting_in(np.geomspace(1e-3, 1e3, 61), steps=steps)
    failed = np.isnan(found[1]).all((1, 2))
    _, covs = relative_errors([part[~failed] for part in found], [part[~failed] for part in exact])
    assert covs.max() < 0.01
    assert 5 < failed.sum() < 61 - 5
    assert np.isfinite(found[0][~failed]).all()


def test_a_bend_that_is_too_strong_for_its_steps_fails():
    """The two-step update of y = x + bend (x - 2)^2, which for a straight sensor is Kalman's in any number of steps."""

    def variance(bend, steps):
        system = nb.System(
            lambda t, x: 0 * x,
            lambda t, x: x + bend * (x - 2.0) ** 2,
            np.array([[0.01]]),
            nb.Moments([2.0], [[1.0]]),
        )
        return float(updated("two-step-2", system, np.array([1.0]), steps=steps)[0].cov[0, 0])

    assert variance(0.0, 1) == pytest.approx(0.01 / 1.01, rel=1e-12)
    assert variance(0.2, 10) == pytest.approx(variance(0.2, 400), rel=0.01)
    assert np.isnan(variance(3.0, 1))
