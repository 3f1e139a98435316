"""Claim: falling-body is Gelb's body with its radar, below or aside, and second order removes the EKF's bias."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import nlbench as nb
from nlbench.errors import ConfigError

MEAN = np.array([1e5, -6000.0, 2500.0])


def build(**parameters):
    return nb.systems.build("falling-body", **parameters)


def slope(t, x):
    """The printed equations."""
    return [x[1], 3.4e-3 * np.exp(-x[0] / 22000) * x[1] ** 2 / (2 * x[2]) - 32.2, 0.0]


def test_the_body_falls_as_the_differential_equations_say():
    """The EKF's mean without data, in RK4 steps of .01 s, against DOP853."""
    system = build()
    f = nb.filters.build("ekf", system)
    state = jax.jit(lambda state: f.predict(state, 0.0, 16.0))(f.init(system.initial))
    solution = solve_ivp(slope, (0, 16), MEAN, method="DOP853", rtol=1e-12, atol=1e-9).y[:, -1]
    np.testing.assert_allclose(f.moments(state).mean, solution, rtol=1e-9)


def test_a_heavy_body_falls_freely_and_a_light_one_loses_energy():
    """Without drag x2' = -g; with it the energy x2^2/2 + g x1 falls by the drag times the speed."""
    drift = build().drift
    _, acceleration, _ = drift(0.0, jnp.array([5e4, -6000.0, 1e15]))
    assert float(acceleration) == pytest.approx(-32.2, rel=1e-12)
    for altitude in (1e5, 3e4, 0.0):
        velocity, acceleration, change = (
            float(part) for part in drift(0.0, jnp.array([altitude, -6000.0, 2500.0]))
        )
        drag = 3.4e-3 * np.exp(-altitude / 22000) * 6000**2 / 5000
        assert change == 0.0
        assert velocity * acceleration + 32.2 * velocity == pytest.approx(-6000 * drag, rel=1e-12)


def test_the_radar_sees_the_distance():
    x = jnp.array([5e4, -6000.0, 2500.0])
    np.testing.assert_allclose(build().observe(0.0, x), [abs(1000 + 49900j)], rtol=1e-14)
    np.testing.assert_array_equal(build(example="6.1-2").observe(0.0, x), [5e4])


def test_published_values_are_the_defaults():
    system = build()
    np.testing.assert_array_equal(system.initial.mean, MEAN)
    np.testing.assert_array_equal(system.initial.cov, np.diag([500.0, 2e4, 2.5e5]))
    np.testing.assert_array_equal(system.measurement_cov, [[100.0]])
    np.testing.assert_array_equal(system.sample(jax.random.key(2)), MEAN + [100.0, 350.0, 500.0])
    assert (system.interval, system.step, system.diffusion, system.truth) == (0.01, 0.01, None, None)
    assert [(each.name, each.unit) for each in system.coordinates] == [
        ("altitude", "ft"), ("velocity", "ft/s"), ("ballistic", "lb/ft^2"),
    ]  # fmt: skip


def test_parameters_reach_the_system():
    system = build(initial_error="gaussian", interval=0.5, measurement_variance=25.0)
    np.testing.assert_array_equal(system.measurement_cov, [[25.0]])
    assert (system.sample, system.interval) == (None, 0.5)


def test_diverged_is_an_error_above_ten_thousand_feet():
    diverged = build().diverged
    assert not bool(diverged(jnp.array([-9999.0, 1e9, 1e9])))
    assert bool(diverged(jnp.array([-10001.0, 0.0, 0.0])))


@pytest.mark.parametrize(
    "bad",
    [
        {"example": "6.1-1"},
        {"initial_error": "none"},
        {"interval": 0.0},
        {"measurement_variance": -100.0},
        {"altitude": 1e5},
    ],
)
def test_parameters_out_of_range_or_unknown_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))):
        build(**bad)


@pytest.mark.long
def test_second_order_removes_the_bias_where_the_drag_is_greatest(tmp_path):
    """The source's message. At 16 s, of the ballistic parameter: the EKF's mean error is beyond 4 standard errors, that
    of second order within 4, and, run by run, the smaller."""
    runs = 96
    results = nb.run(
        {
            "experiment": "falling-body",
            "system": "falling-body",
            "filters": ["ekf", "second-order"],
            "time": {"end": 16.0, "step": 0.01, "output": 1.0},
            "report_times": [16.0],
            "monte_carlo": {"runs": runs, "seed": 6},
            "engine": {"cost": False},
        },
        tmp_path,
    )
    kept = results.table("runs").set_index(["filter", "run"]).ballistic
    ekf, second = kept["ekf"].to_numpy(), kept["second-order"].to_numpy()
    assert len(ekf) == runs

    def z(errors):
        return errors.mean() / (errors.std(ddof=1) / np.sqrt(runs))

    assert z(ekf) > 4
    assert abs(z(second)) < 4
    assert z(ekf - second) > 10
