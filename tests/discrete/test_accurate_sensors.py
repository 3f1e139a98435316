"""Claim: on a linear system every Gaussian filter is Kalman's, however wide the prior, however accurate the sensors, in
whatever order they are taken and however long the steps; and nothing is lost where something is known exactly."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.discrete import roots
from nlbench.filters.catalogue import options as options_of
from tests.discrete.ratios import GAUSSIAN, OF_MOMENTS, RATIOS, errors
from tests.oracle_extended import filtered, identity, transition

SYSTEM = "stable, three of one"  # three sensors of one state, the worst first, the best last
CARRIED = [name for name in GAUSSIAN if "propagation" in options_of(name).model_fields]
LIMITS = {1.0: 1e-11, 1e3: 1e-10, 1e6: 1e-6, 1e10: 1e-4}


@pytest.mark.parametrize("name", GAUSSIAN)
def test_equals_the_kalman_filter_at_any_ratio_in_discrete_time(name):
    for (ratio, _), found in errors(SYSTEM, name, True).items():
        assert max(found) < LIMITS[ratio], (ratio, found)


def test_a_root_keeps_the_digits_that_a_covariance_loses():
    assert max(errors(SYSTEM, "ukf", True)[1e10, 1]) < 1e-8


@pytest.mark.parametrize("name", [name for name in CARRIED if name != "linearised-kalman"])
def test_equals_the_kalman_filter_at_any_step_in_continuous_time(name):
    """What is left is the truncation of the transition, of the fourth order: it falls by 10^4 with ten times the steps,
    and its share does not grow with the ratio. Errors of means are in standard deviations after the measurement, of a
    mean that has moved by that of the prior."""
    found = errors(SYSTEM, name, False, propagation="transition")
    assert np.isfinite(list(found.values())).all()
    for ratio in RATIOS:
        of_mean, of_variance = found[ratio, 100]
        assert of_variance < 1e-5
        assert of_mean < 1e-9 * np.sqrt(ratio) + 1e-4 * (ratio > 1e9)
    assert found[1e6, 10][1] < 2e-3 * found[1e6, 1][1] + 1e-9
    assert found[1e6, 100][1] < 2e-3 * found[1e6, 10][1] + 1e-9


@pytest.mark.parametrize("name", ["ukf", "statistical-linearisation", "gaussian-sum", "kalman"])
def test_constant_acceleration_is_exact_in_a_single_step(name):
    """Phi is a polynomial of degree two, and the noise of the step one of degree four: Runge's and Kutta's and Gauss's
    rules are exact."""
    for (ratio, _), found in errors("constant acceleration", name, False, propagation="transition").items():
        assert max(found) < LIMITS[ratio] * 1e-2 + 1e-12 * ratio**0.5


@pytest.mark.parametrize("name", ["ukf", "statistical-linearisation", "sof-gaussian", *OF_MOMENTS])
def test_integrated_moments_stay_finite_and_converge(name):
    options = {"propagation": "moments"} if "propagation" in options_of(name, False).model_fields else {}
    found = errors(SYSTEM, name, False, **options)
    assert np.isfinite(list(found.values())).all()
    assert max(found[1.0, 100]) < 1e-6
    assert max(found[1.0, 100]) < 1e-3 * max(found[1.0, 10])


def test_the_order_of_sensors_does_not_matter():
    """Two sensors of the position of a car, one a million times as accurate as the other, after a wide prior."""
    means = []
    for order in ([0, 1], [1, 0]):
        H, R, y = (
            np.array([[1.0, 0.0], [1.0, 0.0]]),
            np.diag([1e-6, 1.0])[np.ix_(order, order)],
            np.array([3.0, 3.5]),
        )
        for name in ("ukf", "ekf", "sof", "iekf", "ensemble"):
            system = nb.DiscreteSystem(
                lambda k, x, w: x + w, lambda k, x, v, H=H: jnp.asarray(H) @ x + v, np.eye(2), R,
                nb.Moments(np.zeros(2), 1e6 * np.eye(2)),
            )  # fmt: skip
            f = nb.filters.build(name, system)
            state, info = f.update(f.init(system.initial), 1, y[order])
            known, _ = filtered(
                identity(2), 0 * identity(2), H, np.diag(R), np.zeros(2), 1e6 * np.eye(2), y[order][None]
            )
            assert np.isfinite(info.log_likelihood)
            if name != "ensemble":
                np.testing.assert_allclose(f.moments(state).mean, known[0].astype(float), atol=1e-7)
                means.append(np.asarray(f.moments(state).mean))
    np.testing.assert_allclose(means[:4], means[4:], atol=1e-7)


def car(R=0.01, start=(100.0, 400.0), F=((0.0, 1.0), (0.0, 0.0))):
    return nb.System(
        drift=lambda t, x: jnp.asarray(F) @ x,
        observe=lambda t, x: x[:1],
        measurement_cov=np.array([[R]]),
        initial=nb.Moments(np.zeros(2), np.diag(start)),
        diffusion=lambda t, x: jnp.array([[0.0], [0.5]]),
        interval=1.0,
        step=0.1,
    )


def driven(name, system, R, start, count=40, **options):
    """Means and covariances along `count` measurements of a car, and those of the oracle, its log-likelihoods."""
    F, D = np.eye(2, k=1), np.diag([0.0, 0.25])
    Phi, Q = transition(F, D, 1.0)
    g = np.random.default_rng(3)
    x, y = np.array([0.0, 15.0]), []
    for _ in range(count):
        x = np.asarray(Phi, float) @ x + np.linalg.cholesky(np.asarray(Q, float)) @ g.normal(size=2)
        y.append(x[:1] + np.sqrt(R) * g.normal(size=1))
    f = nb.filters.build(name, system, **options)

    @jax.jit
    def along(state, y):
        def one(state, given):
            k, y = given
            t = k * 1.0 if isinstance(system, nb.System) else k
            state, info = f.update(f.predict(state, t, t + 1), t + 1, y)
            return state, (*f.moments(state)[:2], info.log_likelihood)

        return jax.lax.scan(one, state, (jnp.arange(count), y))[1]

    found = along(f.init(system.initial), jnp.array(y))
    known = filtered(Phi, Q, np.eye(2)[:1], np.array([R]), np.zeros(2), np.diag(start), np.array(y))
    return tuple(map(np.asarray, found)), tuple(each.astype(float) for each in known)


POINTS = [
    "ukf",
    "ckf",
    "ghkf",
    "statistical-linearisation",
    "sof",
    "iekf",
    "ekf",
    "linearised-kalman",
    "second-order",
]


@pytest.mark.parametrize("name", POINTS)
def test_exact_measurements_are_taken_as_they_are(name):
    """R = 0 for forty measurements: the position is known, the speed has a variance; after a measurement that was
    certain beforehand nothing changes."""
    (means, covs, log_likelihood), (known_means, known_covs) = driven(name, car(R=0.0), 0.0, (100.0, 400.0))
    np.testing.assert_allclose(means, known_means, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(covs, known_covs, atol=1e-9)
    assert np.isfinite(log_likelihood).all()


@pytest.mark.parametrize("name", POINTS)
def test_a_start_that_is_known_exactly_is_kept(name):
    """Position variance 0, speed unknown: the speed makes the position uncertain from the first step on."""
    (means, covs, _), (known_means, known_covs) = driven(
        name, car(start=(0.0, 400.0)), 0.01, (0.0, 400.0), count=8
    )
    np.testing.assert_allclose(means, known_means, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(covs, known_covs, rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("propagation", ["transition", "moments"])
@pytest.mark.parametrize("name", ["ekf", "ukf", "statistical-linearisation"])
def test_a_car_with_a_wide_prior_and_an_accurate_sensor_is_followed(name, propagation):
    """With constant velocity a Runge-Kutta step is exact for moments too, whose stages are no covariances here."""
    (means, covs, _), (known_means, known_covs) = driven(
        name, car(), 0.01, (100.0, 400.0), count=8, propagation=propagation
    )
    np.testing.assert_allclose(means, known_means, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(covs, known_covs, rtol=1e-7, atol=1e-10)


def test_a_transition_makes_steps_of_its_own():
    with pytest.raises(nb.errors.ConfigError, match="transition makes steps of rk4: leave integrator out"):
        nb.filters.build("ekf", car(), propagation="transition", integrator={"solver": "Tsit5"})


@pytest.mark.parametrize(
    "name", ["ekf", "ukf", "sof", "iekf", "truncated", "statistical-linearisation", "gaussian-sum"]
)
@pytest.mark.parametrize("time", ["discrete", "continuous"])
def test_what_was_certain_has_no_density_but_is_probable_or_impossible(name, time):
    """A state known exactly, measured exactly: log 1 = 0 where the measurement agrees, -inf where it does not. An entry
    beside it that varies counts as ever."""
    start, R = nb.Moments(np.array([1.0, 2.0]), np.diag([0.0, 0.5])), np.diag([0.0, 0.5])
    if time == "discrete":
        system = nb.DiscreteSystem(lambda k, x, w: x, lambda k, x, v: x + v, np.zeros((1, 1)), R, start)
    else:
        system = nb.System(lambda t, x: 0.0 * x, lambda t, x: x, R, start, interval=1.0)
    f = nb.filters.build(name, system)
    density = -0.5 * (1.0 + np.log(2 * np.pi))  # of 3 under N(2, 1)
    for y, expected in (([1.0, 3.0], density), ([1.5, 3.0], -np.inf), ([np.nan, 3.0], density)):
        state, info = f.update(f.init(start), 1, np.array(y))
        np.testing.assert_allclose(info.log_likelihood, expected, rtol=1e-12)
        np.testing.assert_allclose(f.moments(state).mean, [1.0, 2.5], rtol=1e-12)
        np.testing.assert_allclose(f.moments(state).cov, np.diag([0.0, 0.25]), atol=1e-15)


@pytest.mark.parametrize(
    "name", ["bootstrap", "integration-update", "series-3", "two-step-2", "direct-2", "quadrature-3"]
)
def test_a_filter_that_divides_by_the_noise_refuses_exact_measurements(name):
    with pytest.raises(nb.errors.ConfigError, match=r"eigenvalue 0 \(entry \[0, 0\]\)"):
        nb.filters.build(name, car(R=0.0))


def test_negative_weights_that_take_off_too_much_are_not_a_number():
    """The points of a `ukf` with a negative central weight give x^2 a negative variance: that is said, not repaired."""
    system = nb.DiscreteSystem(
        lambda k, x, w: x**2 + w,
        lambda k, x, v: x + v,
        np.eye(1) * 1e-6,
        np.eye(1),
        nb.Moments(np.zeros(1), np.eye(1)),
    )
    f = nb.filters.build("ukf", system, kappa=-0.9)
    assert np.isnan(f.moments(f.predict(f.init(system.initial), 0, 1)).cov).all()


def test_roots_of_singular_and_of_indefinite_matrices():
    g = np.random.default_rng(0)
    columns = g.normal(size=(4, 7))
    columns[2] = columns[0] - 3 * columns[1]  # a direction without variance
    L = np.asarray(roots.triangular(jnp.asarray(columns)))
    np.testing.assert_allclose(L @ L.T, columns @ columns.T, atol=1e-13)
    assert L[2, 2] == 0.0
    assert (np.triu(L, 1) == 0).all()
    np.testing.assert_allclose(np.asarray(roots.square_root(jnp.asarray(columns @ columns.T)))[2, 2], 0.0)
    P = np.array([[0.0, 2.0], [2.0, 5.0]])  # eigenvalues of both signs, a zero first on the diagonal
    left = np.asarray(roots.nonnegative_root(jnp.asarray(P)))
    np.testing.assert_allclose(left @ left.T, [[0.8, 2.0], [2.0, 5.0]], atol=1e-15)
    assert np.isnan(np.asarray(roots.square_root(jnp.array([[1.0, 2.0], [2.0, 1.0]])))).any()


def test_the_transition_of_a_nonlinear_system_converges_with_the_second_order():
    """With noise that depends on the state, `ukf` by steps of h against steps of h / 16: the noise within a step enters
    the points to that order."""
    system = nb.System(
        drift=lambda t, x: jnp.stack([x[1], -jnp.sin(x[0]) - 0.2 * x[1] ** 3]),
        observe=lambda t, x: x[:1],
        measurement_cov=np.eye(1),
        initial=nb.Moments(np.array([1.0, 0.3]), np.array([[0.3, 0.05], [0.05, 0.2]])),
        diffusion=lambda t, x: jnp.stack([jnp.zeros(1), 0.8 + 0.3 * x[:1]]),
    )
    f = nb.filters.build("ukf", system)
    start = f.init(system.initial)
    integrate = jax.jit(lambda h, count: f.moments(f.integrate(start, 0.0, h, count)))
    best = integrate(1 / 256, 256)
    errors = [
        max(np.abs(a - b).max() for a, b in zip(integrate(1 / k, k)[:2], best[:2], strict=True))
        for k in (8, 16, 32)
    ]
    assert errors[0] < 5e-3
    assert 3.2 < errors[0] / errors[1] < 6.0
    assert 3.2 < errors[1] / errors[2] < 6.0
