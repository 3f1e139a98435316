"""Claim: numbers and integers in a system are taken as they are meant; what cannot be is said at the user's line, with
the remedy, before anything runs."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from math import sin
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench import filters, systems
from nlbench.errors import ConfigError
from nlbench.filters.catalogue import row
from nlbench.systems.system import Sets

HERE = Path(__file__).name


def one(**changes):
    given = {
        "drift": lambda t, x: -x,
        "observe": lambda t, x: x,
        "measurement_cov": 0.1,
        "initial": nb.Moments(1.0, 2.0),
        "interval": 1.0,
    }
    return nb.System(**{**given, **changes})


def two(**changes):
    return one(**{"initial": nb.Moments([1.0, 2.0], np.eye(2)), "observe": lambda t, x: x[0], **changes})


def steps(**changes):
    given = {
        "transition": lambda k, x, w: x + w,
        "observe": lambda k, x, v: x[:1] + v,
        "process_cov": np.eye(2),
        "measurement_cov": 1,
        "initial": nb.Moments([1.0, 2.0], np.eye(2)),
    }
    return nb.DiscreteSystem(**{**given, **changes})


def complaints(system):
    try:
        filters.check(system)
    except ConfigError as error:
        return error.problems
    return []


def followed(name, system, **options):
    """Moments of a filter after a prediction and an update, by a program."""
    f = filters.build(name, system, **options)
    t = 1 if isinstance(system, nb.DiscreteSystem) else 1.0

    @jax.jit
    def along(state):
        return f.moments(f.update(f.predict(state, 0 * t, t), t, jnp.zeros(system.measurements))[0])

    return along(f.init(system.initial))


def equal(a, b):
    return all((x == y).all() and x.dtype == y.dtype for x, y in zip(a[:2], b[:2], strict=True))


NUMBERS = (
    one(
        drift=lambda t, x: -x[0], observe=lambda t, x: x[0] ** 2, diffusion=lambda t, x: 0.5, diffusion_cov=3
    ),
    nb.DiscreteSystem(lambda k, x, w: x[0] + w[0], lambda k, x, v: x[0] + v[0], 2, 3, nb.Moments(1, 4)),
)
ARRAYS = (
    one(
        drift=lambda t, x: -x,
        observe=lambda t, x: x**2,
        measurement_cov=np.array([[0.1]]),
        initial=nb.Moments(np.array([1.0]), np.array([[2.0]])),
        diffusion=lambda t, x: jnp.array([[0.5]]),
        diffusion_cov=np.array([[3.0]]),
    ),
    nb.DiscreteSystem(
        lambda k, x, w: x + w,
        lambda k, x, v: x + v,
        np.array([[2.0]]),
        np.array([[3.0]]),
        nb.Moments(np.array([1.0]), np.array([[4.0]])),
    ),
)


@pytest.mark.parametrize("name", ["ekf", "ukf", "second-order"])
def test_a_number_is_a_matrix_of_one_entry(name):
    for numbers, arrays in zip(NUMBERS, ARRAYS, strict=True):
        if row(name).family != "moment" or isinstance(numbers, nb.System):
            assert equal(followed(name, numbers), followed(name, arrays))


@pytest.mark.parametrize("name", ["ekf", "ukf", "third-order", "bootstrap"])
def test_a_filter_starts_from_numbers_too(name):
    f = filters.build(name, one())
    key = jax.random.key(0)
    numbers, arrays = f.init(nb.Moments(1, 4), key), f.init(nb.Moments(np.ones(1), np.full((1, 1), 4.0)), key)
    assert all((a == b).all() for a, b in zip(*map(jax.tree.leaves, (numbers, arrays)), strict=True))


def test_one_noise_may_come_as_a_vector():
    column = two(diffusion=lambda t, x: jnp.array([[0.0], [1.0]]))
    assert equal(followed("ekf", two(diffusion=lambda t, x: jnp.array([0.0, 1.0]))), followed("ekf", column))


@pytest.mark.parametrize(
    ("integers", "floats"),
    [
        ({"drift": lambda t, x: jnp.array([1, 0])}, {"drift": lambda t, x: jnp.array([1.0, 0.0])}),
        ({"drift": lambda t, x: (1, 0)}, {"drift": lambda t, x: jnp.array([1.0, 0.0])}),
        ({"drift": lambda t, x: [x[1], 2]}, {"drift": lambda t, x: jnp.stack([x[1], 2.0])}),
        (
            {"observe": lambda t, x: jnp.round(x[:1]).astype(int)},
            {"observe": lambda t, x: jnp.round(x[:1])},
        ),
        ({"observe": lambda t, x: x[:1] > 0}, {"observe": lambda t, x: jnp.where(x[:1] > 0, 1.0, 0.0)}),
        ({"diffusion": lambda t, x: np.eye(2, dtype=int)}, {"diffusion": lambda t, x: np.eye(2)}),
        (
            {"residual": lambda y, h: jnp.round(y - h).astype(int)},
            {"residual": lambda y, h: jnp.round(y - h)},
        ),
    ],
    ids=["array", "tuple", "list", "counting sensor", "switch", "diffusion", "residual"],
)
@pytest.mark.parametrize("name", ["ekf", "ukf"])
def test_integers_are_floats(name, integers, floats):
    assert equal(followed(name, two(**integers)), followed(name, two(**floats)))


def test_a_transition_may_return_integers():
    integers = steps(transition=lambda k, x, w: jnp.array([1, 2]))
    assert equal(
        followed("ukf", integers), followed("ukf", steps(transition=lambda k, x, w: jnp.array([1.0, 2.0])))
    )


def test_a_function_of_floats_is_the_same_program_and_a_system_can_be_made_of_another():
    def drift(t, x):
        return jnp.sin(t) * x[::-1]

    system = two(drift=drift, error=lambda x, m: x - m)
    again = replace(replace(system, interval=2.0), step=0.1)
    assert again.drift is system.drift
    assert again.error is system.error
    given = 0.0, jnp.zeros(2)
    assert str(jax.make_jaxpr(again.drift)(*given)) == str(jax.make_jaxpr(drift)(*given))


INDEFINITE = {
    "measurement_cov": (one(measurement_cov=-0.3), "-0.3", "[0, 0]"),
    "process_cov": (steps(process_cov=[[1, 0], [0, -2]]), "-2", "[1, 1]"),
    "diffusion_cov": (two(diffusion=lambda t, x: jnp.eye(2), diffusion_cov=[[1, 2], [2, 1]]), "-1", "[0, 0]"),
    "initial.cov": (two(initial=nb.Moments([0, 0], [[4, 0], [0, -1e-3]])), "-0.001", "[1, 1]"),
}


@pytest.mark.parametrize("name", INDEFINITE)
def test_what_is_no_covariance_is_refused_with_its_eigenvalue_and_entry(name):
    system, eigenvalue, entry = INDEFINITE[name]
    (problem,) = complaints(system)
    assert problem.message.startswith(f"{name}: is not a covariance")
    assert f"eigenvalue {eigenvalue} " in problem.message
    assert entry in problem.message


def test_numbers_that_are_not_finite_are_refused():
    assert "[0, 0] is inf" in complaints(one(measurement_cov=np.inf))[0].message
    assert "initial.mean" in complaints(two(initial=nb.Moments([0.0, np.nan], np.eye(2))))[0].message


def test_exact_sensors_known_states_and_rounding_are_no_mistakes():
    almost = [[1.0, 1.0], [1.0, 1.0 - 1e-12]]
    assert np.linalg.eigvalsh(almost)[0] < 0
    for system in (
        one(measurement_cov=0.0),
        two(initial=nb.Moments([0, 0], np.zeros((2, 2)))),
        two(initial=nb.Moments([1.0, 2.0], almost)),
    ):
        assert complaints(system) == []


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (
            two(observe=lambda t, x: x, measurement_cov=[1.0, 2.0]),
            "measurement_cov: got shape (2,), expected a square matrix; np.diag makes one of variances",
        ),
        (one(measurement_cov="0.1"), "measurement_cov: got '0.1', expected a number or an array of real numbers"),
        (one(measurement_cov=None), "measurement_cov: got None, expected a number or an array of real numbers"),
        (one(measurement_cov=[[1], [1, 2]]), "measurement_cov: got [[1], [1, 2]], expected a number or"),
        (one(measurement_cov=1j), "measurement_cov: got 1j, expected a number or an array of real numbers"),
        (two(initial=nb.Moments([0, 0], [1, 1])), "initial.cov: got shape (2,), expected (2, 2)"),
        (one(initial=(1.0, 2.0)), "initial: got tuple, expected nlbench.Moments(mean, cov)"),
        (two(observe=lambda t, x: x), "observe(t, x): got shape (2,), expected (1,)"),
        (two(drift=lambda t, x: x * 1j), "drift(t, x): returns complex numbers, expected real ones"),
        (two(drift=lambda t, x: None), "drift(t, x): returns None; a `return` is missing"),
        (two(drift=lambda t, x, u: x), "drift(t, x): takes (t, x, u), and is called with (t, x)"),
        (
            two(drift=lambda t, x: x, inputs=lambda t: 1.0),
            "drift(t, x): takes (t, x), and is called with (t, x, u)",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_one_line(system, message):
    (problem,) = complaints(system)
    assert problem.message.startswith(message)


def in_place(t, x):
    x[0] = 1.0
    return x


def into_numpy(t, x):
    y = np.zeros(2)
    y[0] = x[1]
    return y


def counted(t, x):
    return sum(x for _ in range(x[0]))


def on_lines(t, x):
    return jnp.stack([
        x[1],
        np.sin(
            x[0]),
    ])  # fmt: skip


def helper(x):
    return np.linalg.norm(x) * x


REMEDIES = {
    "numpy": (lambda t, x: np.sin(x), 0, "calls np.sin with a traced number: write jnp.sin"),
    "numpy's choice": (lambda t, x: np.where(x > 0, x, 0), 0, "calls np.where with a traced number: write jnp.where"),
    "math": (lambda t, x: (math.sin(x[0]), x[1]), 0, "calls math.sin with a traced number: write jnp.sin"),
    "imported alone": (lambda t, x: (sin(x[0]), x[1]), 0, "calls sin with a traced number: write jnp.sin"),
    "on lines": (on_lines, 3, "calls np.sin with a traced number: write jnp.sin"),
    "partial": (functools.partial(lambda a, t, x: np.cos(x), 1), 0, "calls np.cos with a traced number: write jnp.cos"),
    "jitted": (jax.jit(lambda t, x: np.cos(x)), 0, "calls np.cos with a traced number: write jnp.cos"),
    "if": (lambda t, x: x if x[0] > 0 else -x, 0, "write jnp.where(condition, a, b)"),
    "if of the time": (lambda t, x: x if t > 1 else -x, 0, "write jnp.where(condition, a, b)"),
    "max": (lambda t, x: (max(x[0], 0.0), x[1]), 0, "write jnp.where(condition, a, b)"),
    "in place": (in_place, 1, "write x = x.at[i].set(value)"),
    "into an array of numpy": (into_numpy, 2, "x = x.at[i].set(value)"),
    "range": (counted, 1, "needs the value of a traced number"),
    "float": (lambda t, x: (float(x[0]), x[1]), 0, "needs the value of a traced number"),
}  # fmt: skip


@pytest.mark.parametrize("case", REMEDIES)
def test_an_error_names_the_users_line_and_the_remedy(case):
    function, below, remedy = REMEDIES[case]
    bare = getattr(function, "func", None) or getattr(function, "__wrapped__", None) or function
    (problem,) = complaints(two(drift=function))
    assert (Path(problem.file).name, problem.line) == (HERE, bare.__code__.co_firstlineno + below)
    assert problem.message.startswith("drift(t, x): ")
    assert problem.message.endswith(remedy) or remedy in problem.message


def test_an_error_in_a_function_that_a_function_calls_is_at_its_line():
    (problem,) = complaints(two(drift=lambda t, x: helper(x)))
    assert problem.line == helper.__code__.co_firstlineno + 1
    assert problem.message.endswith("write jnp.linalg.norm")


def test_what_no_line_of_the_users_raises_is_where_the_function_begins():
    function = lambda t, x: {"position": x}  # noqa: E731
    (problem,) = complaints(two(drift=function))
    assert (Path(problem.file).name, problem.line) == (HERE, function.__code__.co_firstlineno)


@pytest.mark.parametrize(
    ("system", "name"),
    [
        (two(observe=lambda t, x: np.sin(x[0])), "observe(t, x)"),
        (two(diffusion=lambda t, x: np.diag(np.sin(x))), "diffusion(t, x)"),
        (two(residual=lambda y, h: np.sin(y - h)), "residual(y, h)"),
        (two(error=lambda x, m: np.sin(x - m)), "error(x, m)"),
        (two(sample=lambda key: np.sin(jax.random.normal(key, (2,)))), "sample(key)"),
        (two(diverged=lambda e: bool(np.sin(e[0]) > 0)), "diverged(error)"),
        (two(drift=lambda t, x, u: x * u, inputs=lambda t: np.sin(t)), "inputs(t)"),
        (steps(transition=lambda k, x, w: np.sin(x) + w), "transition(k, x, w)"),
        (steps(observe=lambda k, x, v: np.sin(x[:1]) + v), "observe(k, x, v)"),
    ],
)
def test_every_function_of_a_system_is_looked_at(system, name):
    (problem,) = complaints(system)
    assert problem.message == f"{name}: calls np.sin with a traced number: write jnp.sin"
    assert Path(problem.file).name == HERE


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (two(drift=lambda x, t: -x), "drift(t, x): takes its arguments as (x, t); they come as (t, x)"),
        (one(drift=lambda x, t: -x), "drift(t, x): takes its arguments as (x, t); they come as (t, x)"),
        (
            one(observe=lambda s, tau: s**2),
            "observe(t, x): takes its arguments as (x, t); they come as (t, x)",
        ),
        (two(drift=lambda s, tau: jnp.stack([s[1], -s[0]])), "drift(t, x): takes its arguments as (x, t)"),
        (steps(transition=lambda x, k, w: x + w), "transition(k, x, w): takes its arguments as (x, k, w)"),
        (steps(transition=lambda x, w, k: x + w), "transition(k, x, w): takes its arguments as (x, w, k)"),
        (two(error=lambda m, x: x - m), "error(x, m): takes its arguments as (m, x); they come as (x, m)"),
    ],
)
def test_arguments_in_another_order_are_found(system, message):
    (problem,) = complaints(system)
    assert problem.message.startswith(message)
    assert Path(problem.file).name == HERE


def test_another_order_is_not_blamed_for_another_mistake():
    for function in (lambda t, x: np.sin(x), lambda s, z: np.sin(z), lambda t, x: -x if x > 0 else x):
        (problem,) = complaints(one(drift=function))
        assert "takes its arguments" not in problem.message
    (problem,) = complaints(two(drift=lambda t, x: jnp.stack([t[1], -t[0]])))
    assert "takes its arguments" not in problem.message
    assert complaints(one(drift=lambda t, x: jnp.sin(t))) == []  # of the time alone, as a number


SINGLE = jnp.asarray(np.array([500123.456, 4600789.123], np.float32))
EXACT = jnp.asarray(np.array([0.5, -3.0], np.float32))
ROUNDED = {
    "drift": two(drift=lambda t, x: x - SINGLE),
    "observe": two(observe=lambda t, x: jnp.linalg.norm(x - SINGLE)),
    "observe within a program": two(observe=jax.jit(lambda t, x: jnp.linalg.norm(x - SINGLE))),
    "drift in a loop": two(drift=lambda t, x: jax.lax.fori_loop(0, 2, lambda i, z: z * SINGLE[0], x)),
    "diffusion": two(diffusion=lambda t, x: jnp.diag(SINGLE)),
    "inputs": two(drift=lambda t, x, u: x + u, inputs=lambda t: SINGLE * t),
    "sample": two(sample=lambda key: SINGLE + jax.random.normal(key, (2,))),
    "sample.transform": two(sample=Sets(2, lambda z: z + SINGLE)),
    "residual": two(residual=lambda y, h: y - h + SINGLE[:1]),
    "error": two(error=lambda x, m: x - m + 0 * SINGLE),
    "transition": steps(transition=lambda k, x, w: x + w + SINGLE),
    "observe of steps": steps(observe=lambda k, x, v: x[:1] + SINGLE[:1] + v),
}


@pytest.mark.parametrize("case", ROUNDED)
def test_a_constant_of_single_precision_is_refused_with_the_remedy(case):
    (problem,) = complaints(ROUNDED[case])
    assert problem.message.startswith(f"{case.split()[0]}: uses a constant of single precision, ")
    assert problem.message.endswith("numpy, or call nlbench.configure() before jax.numpy makes it")
    assert Path(problem.file).name == HERE


@pytest.mark.parametrize("name", ["initial.mean", "initial.cov", "measurement_cov"])
def test_a_matrix_of_single_precision_is_refused(name):
    tenth = jnp.asarray(np.array([[0.1]], np.float32))
    given = {
        "initial.mean": {"initial": nb.Moments(tenth[0], 1.0)},
        "initial.cov": {"initial": nb.Moments(0.0, tenth)},
        "measurement_cov": {"measurement_cov": tenth},
    }
    (problem,) = complaints(one(**given[name]))
    assert problem.message.startswith(f"{name}: is of single precision, ")


def test_a_conversion_to_single_precision_is_refused():
    (problem,) = complaints(two(observe=lambda t, x: x[:1].astype(jnp.float32)))
    assert problem.message.startswith("observe: makes numbers of single precision")


def test_what_loses_nothing_by_single_precision_is_let_through():
    assert complaints(two(drift=lambda t, x: x * EXACT, initial=nb.Moments(EXACT, np.eye(2)))) == []


def test_single_precision_is_right_where_it_was_chosen():
    system = two(drift=lambda t, x: x - SINGLE)
    with jax.enable_x64(False):
        assert complaints(system) == []


@pytest.mark.parametrize("name", [name for name in systems.MODULES if name != systems.OWN])
def test_every_system_of_the_package_is_right(name):
    assert complaints(systems.build(name)) == []
