"""Claim: the Zakai grid is the Fokker-Planck equation with Bayes's rule, to second order in the spacing."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.stats import norm

import nlbench as nb
from nlbench.engine.follow import over_lanes
from nlbench.errors import ConfigError
from nlbench.systems.exact import PointMass, ZakaiGrid


def scalar(drift, spectrum, observe=lambda t, x: x, R=0.5, initial=(0.3, 0.8), **more):
    return nb.System(
        drift=drift,
        observe=observe,
        measurement_cov=[[R]],
        initial=nb.Moments([initial[0]], [[initial[1]]]),
        diffusion=lambda t, x: jnp.sqrt(jnp.broadcast_to(jnp.asarray(spectrum(t, x)), (1,)))[:, None],
        **more,
    )


RATE, SPECTRUM = 0.7, 0.9
LINEAR = scalar(lambda t, x: -RATE * x, lambda t, x: SPECTRUM)


def build(system, *record):
    return nb.filters.build("exact", replace(system, exact=ZakaiGrid(*record)))


def started(f):
    return f.init(f.system.initial)


def schwartz(dynamics, **parameters):
    """As a reference sees it in an experiment with steps of .001 s."""
    system = nb.systems.build("schwartz", dynamics=dynamics, **parameters)
    return replace(system, measurement="discrete", measurement_cov=np.asarray(system.measurement_cov) / 0.001)


def linear_moments(t, mean=0.3, variance=0.8):
    decay = np.exp(-RATE * t)
    return decay * mean, decay**2 * variance + SPECTRUM * (1 - decay**2) / (2 * RATE)


def errors(system, ends, cells, moved, expected):
    """Errors of `moved(filter)` on grids with more and more cells."""
    return np.array([np.abs(moved(build(system, *ends, n)) - expected).max() for n in cells])


def test_a_linear_system_moves_with_its_moments_to_second_order_in_the_spacing():
    def moved(f):
        moments = f.moments(f.integrate(started(f), 0.0, 1.5, 1))
        return np.array([moments.mean[0], moments.cov[0, 0]])

    found = errors(LINEAR, (-7.0, 7.0), (35, 70, 140), moved, linear_moments(1.5))
    np.testing.assert_allclose(found[:-1] / found[1:], 4.0, rtol=0.1)
    assert found[-1] < 1e-3


@pytest.mark.long
def test_a_nonlinear_system_moves_with_second_order_in_the_spacing():
    """Against sixteen times as many cells as the coarsest grid, whose own error makes the last ratio 4.2."""
    cubic = scalar(lambda t, x: x - x**3, lambda t, x: 0.5 + 0.1 * jnp.sin(x), initial=(0.3, 0.3))

    def moved(f):
        moments = f.moments(f.integrate(started(f), 0.0, 0.4, 1))
        return np.array([moments.mean[0], moments.cov[0, 0], moments.third[0, 0, 0]])

    fine = moved(build(cubic, -4.5, 4.5, 720))
    found = errors(cubic, (-4.5, 4.5), (45, 90, 180), moved, fine)
    np.testing.assert_allclose(found[:-1] / found[1:], 4.1, rtol=0.06)


STATIONARY = {
    "D1": (
        schwartz("D1", process_psd=0.25, initial_variance=0.5),
        lambda x: (1 + x**2) ** -4.0,
        (-14.0, 14.0, 280),
    ),
    "D2": (schwartz("D2"), lambda x: np.exp(-(x**4) / 2), (-3.5, 3.5, 70)),
    "noise that grows with the state": (
        scalar(lambda t, x: -3 * x, lambda t, x: 1 + x**2),
        lambda x: (1 + x**2) ** -4.0,
        (-14.0, 14.0, 280),
    ),
}


@pytest.mark.parametrize("name", STATIONARY)
def test_a_stationary_density_stays(name):
    """exp(int 2 f/q)/q at the centres of the cells, whatever the spacing."""
    system, density, (lower, upper, cells) = STATIONARY[name]
    f = build(system, lower, upper, cells)
    edges = np.linspace(lower, upper, cells + 1)
    weights = density((edges[1:] + edges[:-1]) / 2)
    state = started(f)._replace(weights=jnp.asarray(weights / weights.sum()))
    after = f.integrate(state, 0.0, 0.5, 1)
    np.testing.assert_allclose(after.weights, state.weights, rtol=1e-7, atol=1e-14)


def test_probability_is_kept_and_stays_positive_over_five_thousand_steps():
    f = build(schwartz("D2"), -4.0, 4.0, 80)
    state = jax.jit(lambda s: jax.lax.fori_loop(0, 5000, lambda i, s: f.integrate(s, 0.0, 0.001, 1), s))(
        started(f)
    )
    np.testing.assert_allclose(jnp.sum(state.weights), 1.0, rtol=1e-12)
    assert (np.asarray(state.weights) >= 0).all()


def test_a_step_is_the_exponential_of_the_generator():
    """Rates of Scharfetter and Gummel and the exponential written down from scratch, over a short and a long time."""
    n, ends, f = 60, (-4.0, 4.0), build(schwartz("D2"), -4.0, 4.0, 60)
    d = (ends[1] - ends[0]) / n
    x = ends[0] + d * (np.arange(n) + 0.5)
    potential = -(x**4) / 2
    A = np.zeros((n, n))
    for i in range(n - 1):
        z = potential[i + 1] - potential[i]
        up, down = -z / np.expm1(-z) / (2 * d**2), z / np.expm1(z) / (2 * d**2)
        A[i, i] -= up
        A[i + 1, i] += up
        A[i + 1, i + 1] -= down
        A[i, i + 1] += down
    for T in (0.001, 0.3):
        found = f.integrate(started(f), 0.0, T, 1).weights
        np.testing.assert_allclose(found, expm(A * T) @ np.asarray(started(f).weights), atol=1e-12)


def test_many_steps_are_one_long_one():
    f = build(schwartz("D1"), -14.0, 14.0, 140)
    many, one = f.integrate(started(f), 0.0, 0.01, 50), f.predict(started(f), 0.0, 0.5)
    stepped = jax.lax.fori_loop(0, 50, lambda i, s: f.integrate(s, 0.01 * i, 0.01, 1), started(f))
    np.testing.assert_allclose(many.weights, stepped.weights, atol=1e-14)
    np.testing.assert_allclose(one.weights, stepped.weights, atol=1e-14)


def test_drift_and_noise_that_depend_on_time_are_taken_at_the_middle_of_a_step():
    """Second order in the step; the grid, the same for all, is compared with itself at a very small one."""
    system = scalar(lambda t, x: jnp.sin(2 * t) - x, lambda t, x: 0.6 + 0.5 * t)
    f = build(system, -6.0, 6.0, 120)
    means = [f.moments(f.integrate(started(f), 0.0, 1.0 / n, n)) for n in (5, 10, 20, 320)]
    found = np.array([[m.mean[0], m.cov[0, 0]] for m in means])
    off = np.abs(found[:3] - found[3])
    np.testing.assert_allclose(off[:-1] / off[1:], 4.0, rtol=0.05)
    exact = solve_ivp(
        lambda t, y: [np.sin(2 * t) - y[0], -2 * y[1] + 0.6 + 0.5 * t], (0, 1), [0.3, 0.8], rtol=1e-9
    )
    np.testing.assert_allclose(found[3], exact.y[:, -1], atol=2e-3)


def test_equals_the_kalman_filter_with_samples():
    """To second order in the spacing, likelihood of the data included; an entry that is missing counts for nothing."""
    times, y = (0.2, 0.5, 1.0), np.array([1.1, np.nan, -0.4])
    m, P, total, now = 0.3, 0.8, 0.0, 0.0
    for t, value in zip(times, y, strict=True):
        m, P = linear_moments(t - now, m, P)
        now = t
        if not np.isnan(value):
            total += norm(m, np.sqrt(P + 0.5)).logpdf(value)
            m, P = m + P / (P + 0.5) * (value - m), P * 0.5 / (P + 0.5)

    def ended(f):
        state, now, total = started(f), 0.0, 0.0
        for t, value in zip(times, y, strict=True):
            state, info = f.update(f.predict(state, now, t), t, jnp.array([value]))
            now, total = t, total + info.log_likelihood
        moments = f.moments(state)
        return np.array([moments.mean[0], moments.cov[0, 0], total])

    found = errors(LINEAR, (-7.0, 7.0), (70, 140), ended, [m, P, total])
    assert found[1] < 1e-3
    np.testing.assert_allclose(found[0] / found[1], 4.0, rtol=0.1)


def test_with_continuous_measurements_it_tends_to_the_kalman_bucy_filter():
    """At first order in the step: samples of sin 3t, each held over a step, with the variance psd/step."""
    psd, end = 0.2, 1.0
    exact = solve_ivp(
        lambda t, y: [
            -RATE * y[0] + y[1] / psd * (np.sin(3 * t) - y[0]),
            -2 * RATE * y[1] + SPECTRUM - y[1] ** 2 / psd,
        ],
        (0, end),
        [0.3, 0.8],
        rtol=1e-10,
        atol=1e-12,
    ).y[:, -1]

    def ended(count):
        h = end / count
        sampled = replace(LINEAR, measurement_cov=[[psd / h]])
        f = build(sampled, -6.0, 6.0, 300)

        def step(i, state):
            return f.integrate(f.update(state, i * h, jnp.sin(3 * i * h)[None])[0], i * h, h, 1)

        moments = f.moments(jax.jit(lambda s: jax.lax.fori_loop(0, count, step, s))(started(f)))
        return np.array([moments.mean[0], moments.cov[0, 0]])

    off = np.abs(np.array([ended(count) - exact for count in (25, 50, 100)]))
    np.testing.assert_allclose(off[:-1] / off[1:], 2.0, rtol=0.1)
    assert off[-1].max() < 0.01


def test_the_cubic_sensor_is_a_large_particle_filter_within_its_standard_errors():
    steps, h, filters, count = 40, 0.02, 20, 20_000
    g = np.random.default_rng(3)
    x = 1.0 + np.cumsum(np.sqrt(h) * g.normal(size=steps))
    y = x**3 + g.normal(size=steps) / np.sqrt(h)
    cubic = nb.systems.build("cubic-sensor")
    f = build(replace(cubic, measurement="discrete", measurement_cov=[[1 / h]]), -6.0, 6.0, 480)

    def step(state, given):
        return f.integrate(f.update(state, given[0], given[1][None])[0], given[0], h, 1), None

    state = jax.jit(lambda s: jax.lax.scan(step, s, (h * jnp.arange(steps), jnp.asarray(y)))[0])(started(f))
    moments = f.moments(state)

    found = []
    for _ in range(filters):
        x = g.normal(size=count)
        for value in y:
            level = -0.5 * h * (value - x**3) ** 2
            w = np.exp(level - level.max())
            x = g.choice(x, count, p=w / w.sum()) + np.sqrt(h) * g.normal(size=count)
        found.append((x.mean(), x.var()))
    found = np.array(found)
    z = (found.mean(axis=0) - [moments.mean[0], moments.cov[0, 0]]) / (
        found.std(axis=0, ddof=1) / np.sqrt(filters)
    )
    assert np.abs(z).max() < 4, z


@pytest.mark.parametrize(
    ("dynamics", "measurement", "noise", "psd"),
    [
        pytest.param("D1", "M11", 1.0, 10.0, marks=pytest.mark.long),
        pytest.param("D1", "M12", 1.0, 0.1, marks=pytest.mark.long),
        ("D1", "M11", 0.25, 10.0),
        pytest.param("D2", "M21", 1.0, 0.1, marks=pytest.mark.long),
    ],
)
def test_the_grid_of_schwartz_is_fine_enough(dynamics, measurement, noise, psd):
    """With twice as many cells the mean, after half a second of data, moves by less than a thousandth of the spread."""
    y = 1 + np.sqrt(psd / 0.001) * np.random.default_rng(7).normal(size=500)
    system = schwartz(dynamics, measurement=measurement, process_psd=noise, measurement_psd=psd)

    def ended(lower, upper, cells):
        f = build(system, lower, upper, cells)

        def step(state, value):
            return f.integrate(f.update(state, 0.0, value[None])[0], 0.0, 0.001, 1), None

        moments = f.moments(jax.jit(lambda s: jax.lax.scan(step, s, jnp.asarray(y))[0])(started(f)))
        return moments.mean[0], np.sqrt(moments.cov[0, 0])

    lower, upper, cells = system.exact
    (mean, spread), (fine, _) = ended(lower, upper, cells), ended(lower, upper, 2 * cells)
    assert abs(mean - fine) < 1e-3 * spread


def test_rates_are_the_slope_of_the_moments():
    f = build(LINEAR, -7.0, 7.0, 140)
    state, h = started(f), 1e-5
    ahead = f.moments(f.integrate(state, 0.0, h, 1))
    for rate, now, later in zip(f.rates(state, 0.0), f.moments(state), ahead, strict=True):
        np.testing.assert_allclose(rate, (later - now) / h, rtol=1e-3, atol=1e-4)


def test_rates_are_those_of_the_system_to_second_order_in_the_spacing():
    def slopes(f):
        rates = f.rates(started(f), 0.0)
        return np.array([rates.mean[0], rates.cov[0, 0]])

    found = errors(LINEAR, (-7.0, 7.0), (70, 140), slopes, [-RATE * 0.3, -2 * RATE * 0.8 + SPECTRUM])
    np.testing.assert_allclose(found[0] / found[1], 4.0, rtol=0.05)


def test_a_missing_measurement_changes_nothing():
    f = build(LINEAR, -7.0, 7.0, 140)
    after, info = f.update(started(f), 0.0, jnp.array([jnp.nan]))
    np.testing.assert_array_equal(after.weights, started(f).weights)
    assert float(info.log_likelihood) == 0.0


def test_a_block_is_its_trajectories_one_by_one():
    f = build(schwartz("D2"), -4.0, 4.0, 80)
    start, y = started(f), jnp.array([[300.0, -10.0, jnp.nan]])

    @jax.jit
    def cycle(weights, y):
        return f.integrate(f.update(start._replace(weights=weights), 0.1, y)[0], 0.1, 0.01, 1).weights

    lanes = over_lanes(cycle)(jnp.broadcast_to(start.weights[:, None], (80, 3)), y)
    for lane in range(3):
        np.testing.assert_allclose(lanes[:, lane], cycle(start.weights, y[:, lane]), rtol=1e-12)


def test_probability_at_the_ends_of_the_grid_makes_everything_not_a_number():
    walk = scalar(lambda t, x: 0.0 * x, lambda t, x: 1.0)
    f = build(walk, -6.0, 6.0, 120)
    state = f.predict(started(f), 0.0, 0.2)
    np.testing.assert_allclose(f.moments(state).cov, [[1.0]], rtol=1e-6)
    state = f.predict(state, 0.2, 6.0)
    assert np.isnan(f.moments(state).mean).all()


REFUSED = {
    "vanishes nowhere": (scalar(lambda t, x: -x, lambda t, x: x**2), (-5.0, 5.0, 101)),
    "one state with process noise": (nb.systems.build("culver-scalar"), (-5.0, 5.0, 100)),
    "the prior has a standard deviation": (
        replace(LINEAR, initial=nb.Moments([0.3], [[1e-3]])),
        (-5.0, 5.0, 100),
    ),
    "seems 372% larger than it is": (scalar(lambda t, x: 1 - x, lambda t, x: 0.02), (-5.0, 5.0, 100)),
    "100,001 points would resolve": (LINEAR, (-5.0, 5.0, 100_001)),
    "measurements are continuous": (nb.systems.build("cubic-sensor"), (-10.0, 10.0, 100)),
}


@pytest.mark.parametrize("message", REFUSED)
def test_refuses_what_it_is_not_for(message):
    system, record = REFUSED[message]
    with pytest.raises(ConfigError, match=message):
        build(system, *record)


def test_is_refused_where_time_is_discrete_and_the_other_grid_where_it_is_not():
    with pytest.raises(ConfigError, match="is for continuous time"):
        build(nb.systems.build("ungm"), -40.0, 40.0, 801)
    with pytest.raises(ConfigError, match="is for discrete time"):
        nb.filters.build("exact", replace(LINEAR, exact=PointMass((-5.0,), (5.0,), (101,))))
