"""Claim: samples are held with the noise of a longer step, or count as pulses, and no more is known than they tell."""

from __future__ import annotations

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench import config
from nlbench.errors import ConfigError

H, EVERY, STEPS, PSD = 0.01, 4, 22, 0.2
Y = np.cos(1.7 * np.arange(STEPS)) * 3.0


@cache
def ended(name, mode, period=EVERY * H, psd=PSD):
    """Moments after the measurements `Y`, and the sum of the log-likelihoods."""
    sampling = {"mode": mode, "period": period} if mode else None
    system = nb.systems.build("schwartz", measurement_psd=psd, sampling=sampling)
    f = nb.filters.build(name, system, step=H)
    assert f.system is system
    return along(f, Y)


def along(f, y):
    step, state, told = jax.jit(f.update), f.init(f.system.initial), 0.0
    for k, value in enumerate(y):
        state, info = step(state, jnp.asarray(k * H), jnp.asarray([value]))
        told += float(info.log_likelihood)
    moments = f.moments(state)
    return np.array([moments.mean[0], moments.cov[0, 0]]), told


@pytest.mark.parametrize("name", ["schwartz-2", "schwartz-1", "kushner-3"])
def test_pulses_are_measurements_with_nothing_between(name):
    missing = np.where(np.arange(STEPS) % EVERY == 0, Y, np.nan)
    plain = nb.filters.build(name, nb.systems.build("schwartz", measurement_psd=PSD), step=H)
    moments, told = along(plain, missing)
    np.testing.assert_allclose(ended(name, "pulse")[0], moments, rtol=1e-13)
    np.testing.assert_allclose(ended(name, "pulse")[1], told, rtol=1e-12)


@pytest.mark.parametrize("name", ["schwartz-2", "schwartz-1", "kushner-3"])
def test_a_sample_is_held_with_the_spectral_density_of_its_variance_over_the_period(name):
    held = Y[np.arange(STEPS) // EVERY * EVERY]
    plain = nb.filters.build(name, nb.systems.build("schwartz", measurement_psd=EVERY * PSD), step=H)
    np.testing.assert_allclose(ended(name, "hold")[0], along(plain, held)[0], rtol=1e-13)


def test_what_a_held_sample_tells_counts_once():
    """One sample in all, at the start."""
    one = [ended("schwartz-2", mode, period=STEPS * H)[1] for mode in ("hold", "pulse")]
    np.testing.assert_allclose(one[0], one[1], rtol=1e-12)
    np.testing.assert_allclose(one[0], -0.5 * (Y[0] ** 2 * H / PSD + np.log(2 * np.pi * PSD / H)), rtol=1e-12)


@pytest.mark.parametrize("mode", ["hold", "pulse"])
def test_a_period_of_one_step_is_no_sampling(mode):
    np.testing.assert_allclose(
        ended("schwartz-2", mode, period=H)[0], ended("schwartz-2", None)[0], rtol=1e-13
    )


def test_both_know_the_same_share_of_the_data():
    """In a linear system the covariance is that of a density T/h as large: held exactly, pulsed to first order in T."""
    system = nb.systems.build("schwartz", dynamics="D1", measurement="M12", measurement_psd=10 * PSD)
    expected = along(nb.filters.build("schwartz-1", system, step=1e-4, nominal=0.0), np.zeros(4000))[0][1]
    for mode, tolerance in (("hold", 1e-12), ("pulse", 0.02)):
        given = {"dynamics": "D1", "measurement": "M12", "measurement_psd": PSD}
        system = nb.systems.build("schwartz", **given, sampling={"mode": mode, "period": 1e-3})
        f = nb.filters.build("schwartz-1", system, step=1e-4, nominal=0.0)
        state, update = f.init(system.initial), jax.jit(f.update)
        for k in range(4000):
            state, _ = update(state, jnp.asarray(k * 1e-4), jnp.zeros(1))
        np.testing.assert_allclose(f.moments(state).cov[0, 0], expected, rtol=tolerance)


def test_a_period_that_is_no_whole_number_of_steps_is_refused():
    system = nb.systems.build("schwartz", sampling={"mode": "hold", "period": 0.015})
    with pytest.raises(ConfigError, match=r"schwartz-2: .*period 0.015 .*step 0.01"):
        nb.filters.build("schwartz-2", system, step=H)


def test_filters_of_a_run_may_see_samples_or_all_of_the_same_measurements(tmp_path):
    """By the entry's model; each as the filter called step by step, and the truth is one."""
    entries = [
        "schwartz-2",
        {"name": "schwartz-2", "model": {"sampling": {"mode": "hold", "period": 0.04}}, "label": "held"},
        {"name": "schwartz-2", "model": {"sampling": {"mode": "pulse", "period": 0.04}}, "label": "pulses"},
        {"name": "no-filter", "label": "no filter"},
    ]
    results = nb.run(
        config.from_dict(
            {
                "experiment": "sampled",
                "system": {"name": "schwartz", "measurement_psd": PSD},
                "filters": entries,
                "time": {"end": 0.2, "step": H, "output": 0.1},
                "monte_carlo": {"runs": 2, "seed": 3},
                "engine": {"cost": False},
            }
        ),
        tmp_path,
    )
    runs = results.table("runs").set_index(["filter", "run"])["x"]
    errors = [runs[label].to_numpy() for label in ("schwartz-2", "held", "pulses", "no filter")]
    assert all((a != b).all() for i, a in enumerate(errors) for b in errors[:i])
    own = nb.run(
        config.from_dict(
            {
                "experiment": "sampled",
                "system": {
                    "name": "schwartz",
                    "measurement_psd": PSD,
                    "sampling": {"mode": "hold", "period": 0.04},
                },
                "filters": ["schwartz-2"],
                "time": {"end": 0.2, "step": H, "output": 0.1},
                "monte_carlo": {"runs": 2, "seed": 3},
                "engine": {"cost": False},
            }
        ),
        tmp_path,
    )
    # Two programs, which XLA may round differently.
    np.testing.assert_allclose(own.table("runs")["x"], errors[1], rtol=1e-12)
