"""Claim: shapes, names and numbers of a system that do not fit are said before anything is computed, all at once."""

from __future__ import annotations

import copy

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench import filters, systems
from nlbench.errors import ConfigError
from nlbench.systems.system import LateError, Sets

TIMED = nb.System(
    drift=lambda t, x: -x,
    observe=lambda t, x: x[:1],
    measurement_cov=np.eye(1),
    initial=nb.Moments(mean=np.zeros(2), cov=np.eye(2)),
    diffusion=lambda t, x: jnp.eye(2),
    interval=0.1,
)
STEPPED = nb.DiscreteSystem(
    transition=lambda k, x, w: x + w,
    observe=lambda k, x, v: x[:1] + v,
    process_cov=np.eye(2),
    measurement_cov=np.eye(1),
    initial=nb.Moments(mean=np.zeros(2), cov=np.eye(2)),
)
BOTH = {
    "coordinates": (
        {"coordinates": (nb.Coordinate("a"),)},
        "coordinates: got 1, expected 2, one for each state",
    ),
    "no coordinate": (
        {"coordinates": ("a", "b")},
        "coordinates: got 'a', expected nlbench.Coordinate(name, unit)",
    ),
    "error": ({"error": lambda x, m: x[:1] - m[:1]}, "error(x, m): got shape (1,), expected (2,)"),
    "error raises": ({"error": lambda x, m: x @ m[:1]}, "error(x, m): raises TypeError"),
    "diverged": ({"diverged": lambda e: e > 1}, "diverged(error): got shape (2,), expected ()"),
    "clip": ({"clip": (1.0,)}, "clip: got 1 bounds, expected 2"),
    "norms": (
        {"norms": {"both": (0, 2)}},
        "norms['both']: got members (0, 2), expected numbers of coordinates, 0 to 1",
    ),
    "an empty norm": (
        {"norms": {"position": ()}},
        "norms['position']: got members (), expected numbers of coordinates, 0 to 1",
    ),
    "late": ({"diverged_late": LateError(1.0, 1.0, (3,))}, "diverged_late: got members (3,)"),
    "residual": ({"residual": lambda y, h: jnp.sum(y - h)}, "residual(y, h): got shape (), expected (1,)"),
    "sample": (
        {"sample": lambda key: jax.random.normal(key, (3,))},
        "sample(key): got shape (3,), expected (2,)",
    ),
    "interval": ({"interval": -1}, "interval: got -1, expected a number above 0, or None"),
    "not symmetric": (
        {"initial": nb.Moments(np.zeros(2), np.array([[1.0, 1.0], [0.0, 1.0]]))},
        "initial.cov: is not symmetric",
    ),
}
# Names of two errors and of a norm, and the unit of the first; and what is wrong with them.
NAMES = {
    "a column": (("time", "b", "n", ""), "coordinates: the name 'time' has another meaning in tables"),
    "what is lost": (("a", "diverged", "n", ""), "coordinates: the name 'diverged' has another meaning"),
    "the row of all": (("a", "b", "all", ""), "norms: the name 'all' has another meaning in tables"),
    "twice": (("a", "a", "n", ""), "coordinates: the name 'a' stands twice"),
    "an error and a norm": (("a", "b", "a", ""), "norms: the name 'a' stands twice"),
    "a variance": (("a_variance", "a", "n", ""), "coordinates: the name 'a_variance' is that of a column"),
    "a third moment": (("a", "b", "b_third", ""), "norms: the name 'b_third' is that of a column beside 'b'"),
    "a file": (("a_b", "a/b", "n", ""), "coordinates: the name 'a/b' gives figures the same files as 'a_b'"),
    "nothing": (("", "b", "n", ""), "coordinates: got the name '', expected 1 to 60 printable characters"),
    "no text": ((1, "b", "n", ""), "coordinates: got the name 1, expected"),
    "two lines": (("a\nb", "b", "n", ""), "coordinates: got the name 'a\\nb', expected"),
    "long": (("a", "b", "n" * 61, ""), "norms: got the name 'nnn"),
    "a unit of two lines": (
        ("a", "b", "n", "m\ns"),
        "coordinates: got the unit 'm\\ns', expected at most 60",
    ),
    "no unit": (("a", "b", "n", None), "coordinates: got the unit None, expected at most 60"),
}
OF_TIMED = {
    "diffusion_cov": ({"diffusion_cov": np.ones((2, 3))}, "diffusion_cov: got shape (2, 3), expected (2, 2)"),
    "diffusion": ({"diffusion_cov": np.eye(3)}, "diffusion(t, x): got shape (2, 2), expected (2, 3)"),
    "sets": (
        {"sample": Sets(4, lambda z: z[:, 0])},
        "sample.transform(normals): got shape (4,), expected (4, 2)",
    ),
}


@pytest.mark.parametrize("system", [TIMED, STEPPED], ids=["continuous time", "discrete time"])
@pytest.mark.parametrize("case", BOTH)
def test_what_does_not_fit_is_said(system, case):
    changes, message = BOTH[case]
    said = complaints(altered(system, **changes))
    assert len(said) == 1
    assert said[0].startswith(message)


@pytest.mark.parametrize("case", NAMES)
def test_a_name_that_is_no_column_row_or_file_of_its_own_is_said(case):
    (first, second, norm, unit), message = NAMES[case]
    coordinates = (nb.Coordinate(first, unit), nb.Coordinate(second))
    (said,) = complaints(altered(TIMED, coordinates=coordinates, norms={norm: (0, 1)}))
    assert said.startswith(message)


def test_letters_of_any_script_make_names():
    filters.check(altered(TIMED, coordinates=(nb.Coordinate("θ", "°"), nb.Coordinate("φ", "µm")), norms={}))


def test_errors_without_names_have_those_of_the_states():
    assert complaints(altered(TIMED, norms={"x2": (0, 1)})) == [
        "norms: the name 'x2' stands twice; choose another"
    ]


def test_names_of_errors_are_checked_where_another_system_makes_the_data():
    coordinates = (nb.Coordinate("time"), nb.Coordinate("b"))
    own = altered(TIMED, coordinates=coordinates, truth=TIMED)
    with pytest.raises(ConfigError, match="'time' has another meaning in tables"):
        nb.run({"experiment": "x", "system": own, "filters": ["ekf"]})


@pytest.mark.parametrize("case", OF_TIMED)
def test_what_does_not_fit_in_continuous_time_is_said(case):
    changes, message = OF_TIMED[case]
    assert complaints(altered(TIMED, **changes)) == [message]


def test_everything_is_said_at_once():
    assert (
        len(
            complaints(
                altered(TIMED, **{k: v for case in ("clip", "residual") for k, v in BOTH[case][0].items()})
            )
        )
        == 2
    )


@pytest.mark.parametrize("name", systems.available())
def test_every_built_in_system_fits(name):
    filters.check(systems.build(name))


def altered(system, **changes):
    """A copy with other fields, past the checks of types that only tests have."""
    changed = copy.copy(system)
    for name, value in changes.items():
        object.__setattr__(changed, name, value)
    return changed


def complaints(system) -> list[str]:
    with pytest.raises(ConfigError) as raised:
        filters.check(system)
    return [problem.message for problem in raised.value.problems]
