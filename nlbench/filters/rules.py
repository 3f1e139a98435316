"""What a system says of its errors, residuals and samples, checked by shapes before anything is compiled."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.errors import ConfigError, Problem
from nlbench.systems.system import Coordinate, Sets

if TYPE_CHECKING:
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System


def check_rules(system: System | DiscreteSystem) -> None:
    """Raises `ConfigError` with a line for each shape, name or number that does not fit, got and expected."""
    found = [*_errors(system), *_measured(system), *_sampled(system)]
    if system.interval is not None and not system.interval > 0:
        found.append(f"interval: got {system.interval!r}, expected a number above 0, or None")
    if found:
        raise ConfigError([Problem(each) for each in found])


def _errors(system: System | DiscreteSystem) -> Iterator[str]:
    """Coordinates, errors, and what is made of them."""
    n = system.states
    if system.coordinates is not None:
        odd = [each for each in system.coordinates if not isinstance(each, Coordinate)]
        if odd:
            yield f"coordinates: got {odd[0]!r}, expected nlbench.Coordinate(name, unit)"
            return
    c = n if system.coordinates is None else len(system.coordinates)
    if system.error is None:
        if c != n:
            yield f"coordinates: got {c}, expected {n}, one for each state, where `error` is not given"
            return
    else:
        truth = system.states if system.truth is None else system.truth.states
        yield from returned("error(x, m)", system.error, (truth, n), (c,))
    if system.diverged is not None:
        yield from returned("diverged(error)", system.diverged, (c,), ())
    if system.clip is not None and len(system.clip) != c:
        yield f"clip: got {len(system.clip)} bounds, expected {c}, one for each coordinate"
    members = [(f"norms[{name!r}]", chosen) for name, chosen in system.norms.items()]
    if system.diverged_late is not None:
        members.append(("diverged_late", system.diverged_late.members))
    for name, chosen in members:
        if not all(0 <= member < c for member in chosen):
            yield f"{name}: got members {tuple(chosen)}, expected numbers of coordinates, 0 to {c - 1}"


def _measured(system: System | DiscreteSystem) -> Iterator[str]:
    if system.residual is not None:
        m = system.measurements
        yield from returned("residual(y, h)", system.residual, (m, m), (m,))
    for name in ("initial.cov", "measurement_cov", "process_cov", "diffusion_cov"):
        owner = system.initial if name.startswith("initial") else system
        matrix = getattr(owner, name.split(".")[-1], None)
        if matrix is None or isinstance(
            matrix, jax.core.Tracer
        ):  # a system made while jax traces has no numbers yet
            continue
        if not np.allclose(matrix, np.transpose(matrix)):
            yield f"{name}: is not symmetric"


def _sampled(system: System | DiscreteSystem) -> Iterator[str]:
    n = system.states
    if isinstance(system.sample, Sets):
        size = system.sample.size
        yield from returned("sample.transform(normals)", system.sample.transform, ((size, n),), (size, n))
    elif system.sample is not None:
        yield from _of_shape("sample(key)", lambda: jax.eval_shape(system.sample, jax.random.key(0)), (n,))


def returned(
    name: str, function: Callable, takes: tuple[Any, ...], expected: tuple[int, ...]
) -> Iterator[str]:
    """What is wrong with the shape that function returns for arrays of the shapes `takes` (a number: a vector)."""
    arrays = [jnp.zeros(each) for each in takes]
    yield from _of_shape(name, lambda: jax.eval_shape(lambda *x: _array(function(*x)), *arrays), expected)


def _of_shape(name: str, shaped: Callable[[], Any], expected: tuple[int, ...]) -> Iterator[str]:
    try:
        shape = shaped().shape
    except Exception as error:
        said = str(error).splitlines()[0] if str(error) else ""
        yield f"{name}: raises {type(error).__name__}: {said}"
        return
    if shape != expected:
        yield f"{name}: got shape {shape}, expected {expected}"


def _array(value: Any) -> Any:
    return (
        jnp.stack([jnp.asarray(part) for part in value])
        if isinstance(value, (tuple, list))
        else jnp.asarray(value)
    )
