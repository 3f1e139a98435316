"""A filter is refused, and told why, where a function or a derivative that it takes is not finite at its start."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from nlbench import filters, systems
from nlbench.algebra.singular import may_be_singular
from nlbench.engine.problem import make
from nlbench.errors import ConfigError
from nlbench.filters import catalogue, derivatives
from nlbench.moments.moments import Moments
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.own import recorded
from nlbench.systems.system import System, kind
from tests.small_runs import experiment

PLANE = Moments(np.zeros(3), np.eye(3))
LINE = Moments(np.zeros(1), np.eye(1))


def bend(x):
    return jnp.abs(x) ** 1.5


def in_time(observe, initial=PLANE, drift=lambda t, x: -x, **fields):
    m = len(observe(0.0, jnp.ones(len(initial.mean))))
    return System(drift, observe, np.eye(m), initial, **{"interval": 0.2, "step": 0.1, **fields})


def in_steps(observe=lambda k, x, v: x + v, transition=lambda k, x, w: x / 2 + w):
    return DiscreteSystem(transition, observe, np.eye(1), np.eye(1), LINE)


def complaints(name, system, **options):
    try:
        filters.build(name, system, **options)
    except ConfigError as error:
        return [each.message for each in error.problems]
    return []


@pytest.mark.parametrize(
    ("observe", "by"),
    [
        (lambda t, x: jnp.sqrt(jnp.abs(x[:2])), "x1 and x2"),
        (lambda t, x: jnp.linalg.norm(x[:2])[None], "x1 and x2"),
        (lambda t, x: jnp.arctan2(x[1], x[0])[None], "x1 and x2"),
        (lambda t, x: (jnp.linalg.norm(x), x[0]), "x1, x2 and x3"),
    ],
    ids=["root", "norm", "angle", "tuple"],
)
def test_says_which_derivative_of_which_function_is_not_finite_where(observe, by):
    system = in_time(observe)
    for name in ("ekf", "second-order"):
        (line,) = complaints(name, system)
        assert line.startswith(
            f"observe: its derivative by {by} is not finite at the initial mean (0, 0, 0), where {name} starts; "
        )
        assert line.endswith("or take ukf, ckf or ghkf, which need none")
    assert not complaints("ukf", system)


def test_refuses_for_a_second_derivative_those_alone_that_take_it():
    bent_measurement = in_steps(observe=lambda k, x, v: bend(x) + v)
    bent_motion = in_time(lambda t, x: x, LINE, drift=lambda t, x: bend(x))
    for name, system in (("sof", bent_measurement), ("second-order", bent_motion)):
        (line,) = complaints(name, system)
        assert "its second derivative by x is not finite" in line
        assert line.endswith("or take ekf, which needs first derivatives only")
        assert not complaints("ekf", system)
    # A moment filter of second order linearises the measurement.
    curved = in_time(lambda t, x: bend(x), LINE)
    assert not complaints("second-order", curved)
    assert complaints("two-step-2", curved)
    assert complaints("integration-update", curved, measurement="quadratic")


def runs(name, system):
    """Whether mean and covariance are finite after one measurement, the filter bound without a check."""
    made = filters.build(name, system)
    start, end = (0, 1) if isinstance(system, DiscreteSystem) else (0.0, 0.2)

    def followed():
        state = made.init(system.initial)
        if not kind(system).continuous:
            state = made.predict(state, start, end)
        state, _ = made.update(state, end, jnp.array([0.7]))
        return made.moments(state)[:2]

    return all(np.isfinite(part).all() for part in jax.jit(followed)())


@pytest.mark.parametrize("name", ["ekf", "sof-gaussian", "ukf"])
@pytest.mark.parametrize("function", [lambda x: jnp.sqrt(jnp.abs(x)), bend], ids=["root", "bent"])
def test_refuses_what_would_fail_and_nothing_else(name, function, monkeypatch):
    for system in (
        in_steps(observe=lambda k, x, v: function(x) + v),
        in_steps(transition=lambda k, x, w: function(x) + w),
    ):
        refused = bool(complaints(name, system))
        with monkeypatch.context() as patched:
            patched.setattr(derivatives, "refuse_singular", lambda *_: None)
            assert runs(name, system) != refused


@pytest.mark.parametrize(
    ("name", "refused"), [("schwartz-6", False), ("kushner-2", True), ("schwartz-5", True), ("ekf", False)]
)
def test_takes_continuous_measurements_at_the_start(name, refused):
    system = in_time(lambda t, x: bend(x), LINE, measurement="continuous", drift=lambda t, x: 1 + x)
    assert bool(complaints(name, system)) == refused
    assert all("ukf" not in line for line in complaints(name, in_time(
        lambda t, x: jnp.sqrt(jnp.abs(x)), LINE, measurement="continuous"
    )))  # fmt: skip


def test_lets_a_filter_through_whose_mean_has_left_the_point_before_it_measures():
    root = lambda t, x: jnp.sqrt(jnp.abs(x[:1]))  # noqa: E731
    assert complaints("ekf", in_time(root))
    assert not complaints("ekf", in_time(root, drift=lambda t, x: 1 - x))
    (line,) = complaints("ekf", in_time(root, drift=lambda t, x: jnp.array([0.0, 0.0, 5.0])))
    assert "at (0, 0, 1), the mean of ekf at its first measurement" in line


def test_gives_a_line_for_each_function():
    system = in_time(
        lambda t, x: jnp.sqrt(jnp.abs(x)),
        LINE,
        drift=lambda t, x: jnp.cbrt(x),
        diffusion=lambda t, x: 1 / x[:, None],
    )
    lines = complaints("ekf", system)
    assert [line.split(":")[0] for line in lines] == ["drift", "diffusion", "observe"]
    assert "is not finite at the initial mean (0), where ekf starts; move the start" in lines[1]


def test_refuses_sigma_points_too_where_the_measurement_itself_is_not_finite():
    system = in_time(lambda t, x: jnp.log(x), LINE)
    for name in ("ekf", "ukf", "ckf", "quadrature-2", "no-filter"):
        (line,) = complaints(name, system)
        assert line.startswith(f"observe: is not finite at the initial mean (0), where {name} starts")


def test_looks_at_residuals_inputs_sightings_and_noise():
    odd = in_time(lambda t, x: x, LINE, residual=lambda y, h: (y - h) / (y - h))
    assert complaints("ukf", odd)[0].startswith("residual: is not finite")
    driven = in_time(
        lambda t, x: x, LINE, drift=lambda t, x, u: jnp.sqrt(x + u), inputs=lambda t: jnp.ones(1)
    )
    assert not complaints("ekf", driven)
    undriven = in_time(
        lambda t, x: x, LINE, drift=lambda t, x, u: jnp.sqrt(x + u), inputs=lambda t: jnp.zeros(1)
    )
    assert complaints("ekf", undriven)[0].startswith("drift: its derivative by x ")
    noisy = in_steps(observe=lambda k, x, v: x + jnp.cbrt(v))
    assert complaints("ekf", noisy)[0].startswith("observe: its derivative by v ")
    orbit = systems.build("lunar-orbit")
    assert not derivatives.find_singular(orbit)


def test_every_registered_system_is_fine_where_its_filters_start():
    for name in systems.available():
        assert derivatives.find_singular(systems.build(name)) == {}


def test_knows_of_every_filter_of_the_catalogue_what_it_takes():
    for name in filters.available():
        for of in catalogue.takes(name):
            row = catalogue.row(name, *of)
            known = derivatives.find_orders(name, row, row.options())
            assert (known is None) == (row.update in ("bayes", "ensemble", "bootstrap"))


def test_looks_where_the_experiment_starts():
    system = in_time(lambda t, x: jnp.sqrt(jnp.abs(x)), Moments(np.full(1, 2.0), np.eye(1)))
    stated = {"system": {"name": "own", **recorded(system)}, "reference": None, "filters": ["ukf", "ekf"]}
    assert make(experiment(**stated), system).runners[1].initial.mean == 2.0
    with pytest.raises(ConfigError) as caught:
        make(experiment(**stated, initial={"mean": [0.0]}), system)
    (problem,) = caught.value.problems
    assert problem.path == "filters.1"
    assert problem.message.startswith(
        "observe: its derivative by x is not finite at the initial mean (0), where ekf"
    )
    moved = {"name": "ekf", "initial": {"mean": [3.0]}}
    runner = make(experiment(**{**stated, "filters": [moved]}, initial={"mean": [0.0]}), system).runners[0]
    assert runner.initial.mean == runner.filter.system.initial.mean == [3.0]


def test_takes_no_derivative_and_compiles_nothing_where_no_operation_is_at_risk(monkeypatch):
    monkeypatch.setattr(jax, "jit", None)
    assert not may_be_singular(lambda x: [jnp.sin(x) * x**2 / 3.0], np.zeros(2))


def test_lets_a_filter_through_that_is_bound_while_jax_traces():
    def value(x):
        system = in_time(lambda t, x: jnp.sqrt(jnp.abs(x)), Moments(x, np.eye(1)))
        return filters.build("ekf", system).init(system.initial).mean.to_array()

    with jax.ensure_compile_time_eval():
        size = in_time(lambda t, x: x, LINE).measurements
    assert size == 1
    assert jax.eval_shape(value, jnp.zeros(1)).shape == (1,)
