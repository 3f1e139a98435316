"""Claim: `filter_data` follows recorded data as step-by-step calls do, at any times, and says what it saw."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.errors import ConfigError
from nlbench.filters import data

START = nb.Moments([1.0, 0.5], [[0.5, 0.1], [0.1, 0.3]])


def pendulum(**more):
    return nb.System(
        drift=lambda t, x: jnp.stack([x[1], -jnp.sin(x[0])]),
        observe=lambda t, x: x,
        measurement_cov=np.array([[0.2, 0.05], [0.05, 0.3]]),
        initial=START,
        step=0.05,
        **more,
    )


def walk():
    return nb.DiscreteSystem(
        lambda k, x, w: 0.9 * x + w + k, lambda k, x, v: x + v, [[0.3]], [[0.2]], nb.Moments([1.0], [[2.0]])
    )


TIMES = np.array([0.0, 0.13, 0.7, 0.7, 1.5])
Y = np.array([[1.1, 0.4], [0.9, np.nan], [np.nan, np.nan], [0.8, -0.1], [0.2, -0.8]])


@pytest.mark.parametrize("name", ["third-order-guarded", "ekf", "ukf"])
def test_equals_calls_step_by_step_at_irregular_times(name):
    f = nb.filters.build(name, pendulum())
    table = nb.filter_data(f, TIMES, Y)
    state, before = f.init(START), 0.0
    for row, (t, y) in enumerate(zip(TIMES, Y, strict=True)):
        state, info = f.update(f.predict(state, before, t), t, y)
        before, there = t, ~np.isnan(y)
        moments = f.moments(state)
        seen = table.iloc[row]
        np.testing.assert_allclose([seen.x1_mean, seen.x2_mean], moments.mean, rtol=1e-12)
        np.testing.assert_allclose([seen.x1_variance, seen.x2_variance], np.diag(moments.cov), rtol=1e-12)
        innovation = np.array([seen.y1_innovation, seen.y2_innovation])
        np.testing.assert_allclose(innovation, np.where(there, info.innovation, np.nan), rtol=1e-12)
        if there.any():
            z, S = np.asarray(info.innovation)[there], np.asarray(info.innovation_cov)[np.ix_(there, there)]
            np.testing.assert_allclose(seen.nis, z @ np.linalg.solve(S, z), rtol=1e-11)
            np.testing.assert_allclose(seen.log_likelihood, info.log_likelihood, rtol=1e-11)
        else:
            assert np.isnan(seen.nis)
            assert seen.log_likelihood == 0.0


def test_columns_bear_the_names_of_the_coordinates():
    named = pendulum(coordinates=(nb.Coordinate("angle", "rad"), nb.Coordinate("rate", "rad/s")))
    table = nb.filter_data(nb.filters.build("second-order", named), TIMES, Y)
    assert list(table.columns) == [
        "time", "angle_mean", "angle_variance", "rate_mean", "rate_variance",
        "y1_innovation", "y2_innovation", "nis", "log_likelihood",
    ]  # fmt: skip
    np.testing.assert_array_equal(table.time, TIMES)


def test_steps_are_counted_from_the_start_and_may_be_skipped():
    """Kalman by hand: step 0 is the initial state, steps 1 and 2 pass unmeasured."""
    table = nb.filter_data(nb.filters.build("kalman", walk()), [0, 3], [1.5, 6.0])
    m, p, sum_ = 1.0, 2.0, []
    for k, y in enumerate([1.5, None, None, 6.0]):
        if k:
            m, p = 0.9 * m + k - 1, 0.81 * p + 0.3
        if y is not None:
            s = p + 0.2
            sum_.append([y - m, (y - m) ** 2 / s, -0.5 * ((y - m) ** 2 / s + np.log(2 * np.pi * s))])
            m, p = m + p / s * (y - m), p - p * p / s
    np.testing.assert_allclose(table[["y_innovation", "nis", "log_likelihood"]], sum_, rtol=1e-12)
    np.testing.assert_allclose(table.x_mean.iloc[1], m, rtol=1e-12)
    np.testing.assert_allclose(table.x_variance.iloc[1], p, rtol=1e-12)


def test_a_start_at_another_time_predicts_from_there():
    f = nb.filters.build("ekf", pendulum())
    late = nb.filter_data(f, TIMES + 5.0, Y, t0=5.0)
    columns = [name for name in late.columns if name != "time"]
    np.testing.assert_allclose(late[columns], nb.filter_data(f, TIMES, Y)[columns], rtol=1e-9)


def test_the_particle_filter_nears_the_kalman_filter_and_repeats_itself():
    f = nb.filters.build("bootstrap", walk(), particles=20000)
    times, y = [1, 2, 5], [1.5, 2.0, 9.0]
    table, exact = nb.filter_data(f, times, y), nb.filter_data(nb.filters.build("kalman", walk()), times, y)
    np.testing.assert_allclose(table.x_mean, exact.x_mean, atol=0.05)
    np.testing.assert_array_equal(table, nb.filter_data(f, times, y))


@pytest.mark.parametrize(
    ("times", "y", "says"),
    [
        ([0.0, 2.0, 1.0], np.ones((3, 2)), "1.0 in row 2 comes after 2.0"),
        ([-1.0], np.ones((1, 2)), "comes after 0"),
        ([0.0, 1.0], np.ones((2, 3)), r"got shape \(2, 3\), expected \(2, 2\)"),
        ([0.0, 1.0], np.ones(2), r"expected \(2, 2\)"),
        ([np.nan], np.ones((1, 2)), "finite"),
        ([], np.ones((0, 2)), "at least 1"),
    ],
)
def test_data_that_do_not_fit_are_refused(times, y, says):
    with pytest.raises(ConfigError, match=says):
        nb.filter_data(nb.filters.build("ekf", pendulum()), times, y)


def test_a_time_between_steps_is_refused():
    with pytest.raises(ConfigError, match="step numbers"):
        nb.filter_data(nb.filters.build("kalman", walk()), [0.5], [1.0])


def test_measurements_may_be_named():
    f = nb.filters.build("ekf", pendulum())
    columns = nb.filter_data(f, TIMES, Y, measurements=["angle", "rate"]).columns
    assert {"angle_innovation", "rate_innovation"} <= set(columns)
    with pytest.raises(ConfigError, match="expected 2 different names, got angle"):
        nb.filter_data(f, TIMES, Y, measurements=["angle"])
    with pytest.raises(ConfigError, match="expected 1 different names, got a, a"):
        nb.filter_data(nb.filters.build("kalman", walk()), [0], [1.0], measurements=["a", "a"])


def test_what_is_no_fair_sample_of_nis_is_marked():
    """Clipped by the limiter, judged by the predicted deviation of each entry; a row unmeasured is never altered."""
    f = nb.filters.build("second-order", pendulum(), limiter=1.0)
    followed = data.follow(f, TIMES, Y + 100 * (np.arange(5) == 3)[:, None])
    state, before, clipped = f.init(START), 0.0, []
    for t, y in zip(TIMES, Y + 100 * (np.arange(5) == 3)[:, None], strict=True):
        state, info = f.update(f.predict(state, before, t), t, y)
        bound, before = np.sqrt(np.diag(info.innovation_cov)), t
        clipped.append(bool((np.abs(info.innovation) > bound).any()))
    assert followed.altered.tolist() == clipped
    assert clipped[3]
    assert not clipped[2]
    assert followed.taken.tolist() == [2, 1, 0, 2, 2]
    assert not followed.invalid.any()
    assert not followed.wrong.any()


def test_limited_is_not_said_of_what_is_not_a_number():
    """A root that is infinitely steep where the filter starts: the first update leaves nothing finite."""
    system = nb.System(
        lambda t, x: 0 * x,
        lambda t, x: jnp.sqrt(jnp.abs(x)),
        [[0.1]],
        nb.Moments([1.0], [[1.0]]),
        interval=1.0,
    )
    f = nb.filters.build("second-order", system, limiter=1.0)  # refused at 0
    f = f._replace(system=replace(system, initial=nb.Moments([0.0], [[1.0]])))
    followed = data.follow(f, np.arange(3.0), [np.nan, 1.0, 1.0])
    assert followed.invalid.tolist() == [False, True, True]
    assert not followed.altered.any()
    assert followed.wrong[:, 1].tolist() == [[False, False], [True, True], [True, True]]  # after the update
    assert followed.wrong[:2, 0].tolist() == [[False, False], [False, False]]  # after the propagation


def test_ten_thousand_rows_take_one_compilation():
    traces = []

    def drift(t, x):
        traces.append(t)
        return -x

    f = nb.filters.build(
        "ekf", nb.System(drift, lambda t, x: x, [[1.0]], nb.Moments([1.0], [[1.0]]), step=0.1)
    )
    counts = []
    for rows in (10, 10_000):
        traces.clear()
        table = nb.filter_data(f, 0.1 * np.arange(rows), np.ones(rows))
        assert len(table) == rows
        counts.append(len(traces))
    assert counts[0] == counts[1]


def test_no_random_number_serves_twice():
    """What the start, each prediction and each update draw, of a filter that only draws."""
    f = nb.filters.build("kalman", walk())
    drawing = f._replace(
        init=lambda moments, key: jax.random.normal(key, (1,)),
        predict=lambda state, t0, t1, key: jax.random.normal(key, (1,)),
        update=lambda state, t, y, key: (
            state,
            f.update(f.init(f.system.initial), t, y)[1]._replace(innovation=jax.random.normal(key, (1,))),
        ),
        moments=lambda state: nb.Moments(state, jnp.eye(1)),
    )
    followed = data.follow(drawing, np.arange(1, 6), np.ones(5))
    drawn = np.concatenate([followed.mean[:, 0], followed.innovation[:, 0]])
    assert len(set(drawn)) == 10
