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
        {"norms": {"all": (0, 2)}},
        "norms['all']: got members (0, 2), expected numbers of coordinates, 0 to 1",
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
