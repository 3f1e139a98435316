"""Claim: where values or derivatives do not survive float32, now or later in a run, that is said before any is made."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench import schedule
from nlbench.engine import single_precision
from nlbench.engine.problem import Runner
from nlbench.errors import ConfigError
from tests.small_runs import python

MU, RADIUS, SPEED = 1.66935e14, 6.228e6, 5175.0  # the moon's attraction and an orbit, in feet and seconds


def orbit(length, time):
    """Planar two-body motion in such units."""
    mu = MU * time**2 / length**3

    def drift(t, x):
        square = x[0] ** 2 + x[1] ** 2
        return jnp.stack([x[2], x[3], *(-mu * x[:2] / (square * jnp.sqrt(square)))])

    speed = length / time
    return nb.System(
        drift=drift,
        observe=lambda t, x: x[:1] * length / RADIUS,
        measurement_cov=np.eye(1),
        initial=nb.Moments(
            np.array([RADIUS / length, 0.0, 0.0, SPEED / speed]),
            np.diag([1e6 / length**2] * 2 + [1.0 / speed**2] * 2),
        ),
        interval=50.0 / time,
    )


def checked(system, *names, intervals=4, step=None):
    """What is said of the filters of a system in a run of some intervals."""
    filters = [nb.filters.build(name, system) for name in names or ("ekf",)]
    times = schedule.make(
        intervals * system.interval, step or system.interval, system.interval, system.interval
    )
    single_precision.check(tuple(Runner(f.name, f, system.initial, 1.0, 1) for f in filters), times)


def test_derivatives_that_leave_the_range_are_named_once():
    with pytest.raises(ConfigError) as caught:
        checked(orbit(1.0, 1.0), "ekf", "second-order")
    said, advice = str(caught.value).split("\n")
    assert said.startswith(
        "engine.precision: drift: first derivatives in float32 are off by 1"
    )  # not the second
    assert "float64" in advice


def test_in_units_in_which_numbers_are_near_one_they_survive():
    checked(orbit(RADIUS, RADIUS / SPEED), "ekf", "second-order")


def test_a_derivative_that_vanishes_at_the_mean_is_none_that_was_lost():
    swing = nb.System(
        drift=lambda t, x: jnp.sin(x),
        observe=lambda t, x: jnp.cos(x),
        measurement_cov=np.eye(1),
        initial=nb.Moments(np.array([np.pi / 2]), np.array([[0.01]])),
        interval=50.0,
    )
    checked(swing)


def test_what_float64_has_not_either_is_not_lost_and_what_it_has_is():
    """A bearing from the origin has no derivative there; e^100 is 2.7e43."""

    def seen(observe):
        mean = nb.Moments(np.zeros(2), np.diag([0.0, 1.0]))
        return nb.System(
            drift=lambda t, x: -x, observe=observe, measurement_cov=np.eye(1), initial=mean, interval=1.0
        )

    checked(seen(lambda t, x: jnp.arctan2(x[:1], 0 * x[1:])), "ukf")
    with pytest.raises(ConfigError, match="observe: values in float32 are lost"):
        checked(seen(lambda t, x: jnp.exp(100 + x[:1])))


def test_in_discrete_time_too():
    far = nb.DiscreteSystem(
        transition=lambda k, x, w: 1e-30 * x**5 + w,
        observe=lambda k, x, v: x + v,
        process_cov=np.eye(1),
        measurement_cov=np.eye(1),
        initial=nb.Moments(np.array([1e10]), np.array([[1e6]])),
        interval=1,
    )
    with pytest.raises(ConfigError, match="transition: values in float32"):
        checked(far)


def growing(observe, cov=0.01, rate=1.0):
    """A state that grows e-fold in a time of 1 / rate, measured every second."""
    return nb.System(
        drift=lambda t, x: rate * x,
        observe=observe,
        measurement_cov=np.eye(1),
        initial=nb.Moments(np.array([1.0]), np.array([[cov]])),
        interval=1.0,
    )


def test_what_leaves_the_range_later_is_found():
    """(e^10 1e35)^2 is beyond 3e38, 1e35 is not."""
    system = growing(lambda t, x: 1e35 * x)
    checked(system, intervals=5, step=0.01)
    with pytest.raises(ConfigError, match="observe: values in float32 are lost"):
        checked(system, intervals=10, step=0.01)


def test_a_function_of_time_that_loses_its_digits_is_found():
    """At time zero it is zero; float32 knows 1e9 t to 64, 10 t to its millionth part."""
    checked(growing(lambda t, x: jnp.sin(10 * t) * x, rate=-1.3), step=0.1)
    with pytest.raises(ConfigError, match="observe: values in float32 are off by"):
        checked(growing(lambda t, x: jnp.sin(1234567891.0 * t) * x, rate=-1.3), step=0.1)


def test_a_derivative_in_a_state_that_is_known_at_first_and_moved_by_noise_is_looked_at():
    """Half, and its derivative in the second state, which takes 1e-50 to form."""
    system = nb.System(
        drift=lambda t, x: jnp.stack([-x[0], -x[1]]),
        observe=lambda t, x: 1e25 * (x[:1] / (1e25 * (2 + x[1:]))),
        measurement_cov=np.eye(1),
        initial=nb.Moments(np.array([1.0, 0.0]), np.diag([0.01, 0.0])),
        diffusion=lambda t, x: jnp.array([[0.0], [0.1]]),
        interval=1.0,
    )
    with pytest.raises(ConfigError, match="observe: first derivatives in float32 are off by"):
        checked(system, step=0.1)


def test_a_run_in_float32_is_refused_and_writes_nothing(tmp_path):
    file = tmp_path / "orbit.yaml"
    file.write_text(
        "experiment: orbit\nsystem: {name: lunar-orbit, sightings: false}\nfilters: [ekf]\n"
        "time: {end: 1000, step: 50, output: 500}\nengine: {precision: float32}\n"
    )
    done = python(
        "import sys; from nlbench.cli import main; main()", "run", str(file), "--out", str(tmp_path / "out")
    )
    assert done.returncode == 2, done.stderr
    assert "drift: first derivatives in float32" in done.stderr
    assert "nearer to one (by system.length_unit and system.time_unit), or" in done.stderr
    assert not (tmp_path / "out").exists()
