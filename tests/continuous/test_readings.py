"""Claim: the filters' relations that the sources state hold, and each integrator converges to what its option says."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.errors import ConfigError

SCHWARTZ = [f"schwartz-{i}" for i in range(2, 9)]


def rates(name, system, y=1.7, start=None, **options):
    f = nb.filters.build(name, system, **options)
    moments = f.rates(f.init(start or system.initial), 0.0, np.array([y]))
    return np.array([moments.mean[0], moments.cov[0, 0]])


def system(dynamics, measurement):
    found = nb.systems.build("schwartz", dynamics=dynamics, measurement=measurement, measurement_psd=0.5)
    return found, nb.Moments([0.8], [[0.4]])


@pytest.mark.parametrize(("dynamics", "measurement"), [("D1", "M12"), ("D2", "M22")])
def test_linear_measurements_leave_three_filters(dynamics, measurement):
    """Schwartz 5.2: {2, 3, 4, 7, 8} and {5, 6} coincide; the linear one is the third."""
    given, start = system(dynamics, measurement)
    found = {name: rates(name, given, start=start) for name in SCHWARTZ}
    for name in ("schwartz-3", "schwartz-4", "schwartz-7", "schwartz-8"):
        np.testing.assert_allclose(found[name], found["schwartz-2"], rtol=1e-13)
    np.testing.assert_allclose(found["schwartz-5"], found["schwartz-6"], rtol=1e-13)
    linear = rates("schwartz-1", given, start=start, nominal=0.0)
    assert len({tuple(np.round(r, 9)) for r in (found["schwartz-2"], found["schwartz-5"], linear)}) == 3


def test_nonlinear_measurements_leave_seven():
    given, start = system("D2", "M21")
    assert len({tuple(np.round(rates(name, given, start=start), 9)) for name in SCHWARTZ}) == 7


def test_a_weight_of_zero_is_the_gaussian_filter_and_a_growing_one_turns_the_measurement_off():
    given, start = system("D2", "M21")
    np.testing.assert_allclose(
        rates("schwartz-k", given, start=start), rates("schwartz-2", given, start=start), rtol=1e-12
    )
    far = rates("schwartz-k", given, start=start, k=1e8)
    np.testing.assert_allclose(far, [-(0.8**3), 1.0], atol=1e-6)


def test_the_nominal_moves_with_the_drift():
    """x_n' = f(x_n) from 1.5 under D2: 1.5/sqrt(1 + 4.5 t); far from it nothing but the linear terms acts."""
    given, start = system("D2", "M22")
    f = nb.filters.build("schwartz-1", given, nominal=1.5, step=1e-3)
    step = jax.jit(lambda state, k: f.update(state, k * 1e-3, jnp.array([jnp.nan])))
    state = f.init(start)
    for k in range(500):
        state, _ = step(state, k)
    nominal = 1.5 / np.sqrt(1 + 4.5 * 0.5)
    # d' = -3 x_n^2 d has the solution d0 (x_n/1.5)^3
    np.testing.assert_allclose(f.moments(state).mean, nominal + (0.8 - 1.5) * (nominal / 1.5) ** 3, atol=2e-3)


def at_rest(h):
    """A state that does not move, seen through y = 2 x + noise of density .5, with a third moment."""
    return nb.System(
        drift=lambda t, x: jnp.zeros(1),
        observe=lambda t, x: 2.0 * x,
        measurement_cov=[[0.5]],
        initial=nb.Moments([0.3], [[0.4]], [[[0.1]]]),
        measurement="continuous",
        step=h,
    )


def mean_drift(h, **options):
    """Mean of (m(h) - m(0))/h over measurements whose noise is +- sqrt(Gamma/h), as its variance wants."""
    f = nb.filters.build("kushner-3", at_rest(h), **options)
    start = f.init(f.system.initial)
    ends = [f.moments(f.update(start, 0.0, np.array([0.6 + s * np.sqrt(0.5 / h)]))[0]).mean for s in (1, -1)]
    return (np.mean(ends) - 0.3) / h


def test_euler_is_in_itos_sense_and_runge_kutta_in_stratonovichs():
    """A mean driven by c(P) dnu with P driven by H S dnu: the readings differ by the drift H^2 S/(2 Gamma) = .4."""
    np.testing.assert_allclose(mean_drift(1e-4), 0.0, atol=1e-9)
    np.testing.assert_allclose(mean_drift(1e-5, integrator={"solver": "rk4"}), 0.4, rtol=1e-3)
    np.testing.assert_allclose(mean_drift(1e-5, integrator={"solver": "Tsit5"}), 0.4, rtol=1e-3)


def test_runge_kutta_follows_a_held_measurement_to_fourth_order():
    """Halved steps have a sixteenth of the error, against steps a tenth as long."""
    ends = {}
    for h, count in ((0.02, 5), (0.01, 10), (0.001, 100)):
        f = nb.filters.build("kushner-3", at_rest(h), integrator={"solver": "rk4"})
        state = f.init(f.system.initial)
        for k in range(count):
            state, _ = f.update(state, k * h, np.array([2.0]))
        ends[h] = float(f.moments(state).cov[0, 0])
    ratio = (ends[0.02] - ends[0.001]) / (ends[0.01] - ends[0.001])
    assert 15 < ratio < 17.5, ratio


@pytest.mark.parametrize("options", [{"equations": "printed"}, {"equations": "printed-scalar"}])
def test_printed_forms_are_not_gaussian_filters_any_more(options):
    """C1, C3: on a Gaussian start and a linear measurement the printed fourth-order rates make a third moment."""
    given = at_rest(0.01)
    f = nb.filters.build("kushner-4", given, **options)
    start = f.init(nb.Moments([0.3], [[0.4]]))
    found = f.rates(start, 0.0, np.array([1.6]))
    np.testing.assert_allclose(found.third, 3 * 0.4**2 * 2 * (1.6 - 0.6) / 0.5, rtol=1e-12)
    right = nb.filters.build("kushner-4", given).rates(start, 0.0, np.array([1.6]))
    np.testing.assert_allclose(right.third, 0.0, atol=1e-14)


@pytest.mark.parametrize("options", [{"equations": "printed"}, {"equations": "printed-scalar"}])
def test_printed_forms_step_the_fourth_moment_by_the_rectangular_rule(options):
    h, start = 0.01, nb.Moments([0.3], [[0.4]], [[[0.1]]], np.full((1,) * 4, 0.6))
    f = nb.filters.build("kushner-4", at_rest(h), **options)
    state, y = f.init(start), np.array([4.0])
    rates, after = f.rates(state, 0.0, y), f.moments(f.update(state, 0.0, y)[0])
    for mine, before, rate in zip(after, start, rates, strict=True):
        np.testing.assert_allclose(mine, before + h * np.asarray(rate), rtol=1e-12)


TWO = {
    "drift": lambda t, x: -x,
    "measurement_cov": [[1.0]],
    "initial": nb.Moments([0.0, 0.0], np.eye(2)),
    "measurement": "continuous",
    "step": 0.1,
}


@pytest.mark.parametrize("name", [f"schwartz-{i}" for i in range(3, 8)])
def test_misprinted_scalar_filters_refuse_vectors(name):
    given = nb.System(observe=lambda t, x: x[:1], **TWO)
    assert nb.filters.build(name, given)
    with pytest.raises(ConfigError, match=f"{name}: .*one state"):
        nb.filters.build(name, given, equations="printed")


def test_equations_of_chapter_7_refuse_vectors_and_curved_measurements():
    with pytest.raises(ConfigError, match="one state"):
        nb.filters.build(
            "kushner-4", nb.System(observe=lambda t, x: x[:1], **TWO), equations="printed-scalar"
        )
    curved, _ = system("D1", "M11")
    with pytest.raises(ConfigError, match="linear measurement"):
        nb.filters.build("kushner-4", curved, equations="printed-scalar")


def test_a_nominal_of_the_wrong_length_is_refused():
    with pytest.raises(ConfigError, match="nominal"):
        nb.filters.build("schwartz-1", nb.System(observe=lambda t, x: x[:1], **TWO), nominal=[1.0, 2.0, 3.0])


@pytest.mark.parametrize("bad", [{"k": -1.0}, {"nominal": 0.0}, {"limiter": 3.0}])
def test_options_that_do_not_exist_or_fit_are_refused(bad):
    given, _ = system("D1", "M11")
    with pytest.raises(ConfigError, match=next(iter(bad))):
        nb.filters.build("schwartz-k", given, **bad)
