"""What a system says of its errors, residuals and samples, checked by shapes before anything is compiled."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from nlbench.errors import ConfigError, Problem
from nlbench.filters.called import returned
from nlbench.filters.constants import find_single
from nlbench.names import of_file
from nlbench.shapes import refuse_indefinite
from nlbench.systems.system import Coordinate, Sets, state_names

if TYPE_CHECKING:
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System

LONGEST = 60  # characters of a name or unit
# Other columns of the table of runs, and the row of all errors together.
TAKEN = ("all", "diverged", "filter", "run", "time")
BESIDE = ("_variance", "_third")  # what columns beside that of an error end with


def check_rules(system: System | DiscreteSystem) -> None:
    """Raises `ConfigError` with a line for each shape, name or number that does not fit, got and expected."""
    found = [*_errors(system), *_named(system), *_measured(system), *_sampled(system)]
    if system.interval is not None and not system.interval > 0:
        found.append(f"interval: got {system.interval!r}, expected a number above 0, or None")
    found = found or list(find_single(system))
    if found:
        raise ConfigError([Problem(each) if isinstance(each, str) else each for each in found])


def _errors(system: System | DiscreteSystem) -> Iterator[str | Problem]:
    """Coordinates, errors, and what is made of them."""
    n = system.states
    odd = _odd(system)
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
        yield from returned("error(x, m)", system.error, ((truth,), (n,)), (c,))
    if system.diverged is not None:
        yield from returned("diverged(error)", system.diverged, ((c,),), ())
    if system.clip is not None and len(system.clip) != c:
        yield f"clip: got {len(system.clip)} bounds, expected {c}, one for each coordinate"
    members = [(f"norms[{name!r}]", chosen) for name, chosen in system.norms.items()]
    if system.diverged_late is not None:
        members.append(("diverged_late", system.diverged_late.members))
    for name, chosen in members:
        if not chosen or not all(member in range(c) for member in chosen):
            yield f"{name}: got members {tuple(chosen)}, expected numbers of coordinates, 0 to {c - 1}"


def _odd(system: System | DiscreteSystem) -> list[Any]:
    return [each for each in system.coordinates or () if not isinstance(each, Coordinate)]


def _named(system: System | DiscreteSystem) -> Iterator[str]:
    """Errors and norms are columns, rows and files by their names, each its own."""
    if _odd(system):
        return
    coordinates = system.coordinates or tuple(Coordinate(name) for name in state_names(system.states))
    given = [
        *(("coordinates", each.name) for each in coordinates),
        *(("norms", name) for name in system.norms),
    ]
    for of, text in given:
        if not _in_a_line(text) or not text:
            yield f"{of}: got the name {text!r}, expected 1 to {LONGEST} printable characters, no space around them"
    for each in coordinates:
        if not _in_a_line(each.unit):
            yield f"coordinates: got the unit {each.unit!r}, expected at most {LONGEST} printable characters"
    named = [(of, text) for of, text in given if _in_a_line(text) and text]
    for place, (of, name) in enumerate(named):
        clash = _clash(name, [other for _, other in named], [other for _, other in named[:place]])
        if clash:
            yield f"{of}: the name '{name}' {clash}; choose another"


def _in_a_line(text: Any) -> bool:
    return isinstance(text, str) and text.isprintable() and text == text.strip() and len(text) <= LONGEST


def _clash(name: str, names: Sequence[str], before: Sequence[str]) -> str:
    """What a name is already that of; nothing if it is free. before: those of `names` that come first."""
    if name in TAKEN:
        return "has another meaning in tables"
    if name in before:
        return "stands twice"
    beside = [other for other in names for end in BESIDE if name == f"{other}{end}"]
    if beside:
        return f"is that of a column beside '{beside[0]}'"
    same = [other for other in before if of_file(other) == of_file(name)]
    return f"gives figures the same files as '{same[0]}' (letters, digits and _ . - count)" if same else ""


def _measured(system: System | DiscreteSystem) -> Iterator[str | Problem]:
    if system.residual is not None:
        m = system.measurements
        yield from returned("residual(y, h)", system.residual, ((m,), (m,)), (m,))
    for name in ("initial.cov", "measurement_cov", "process_cov", "diffusion_cov"):
        owner = system.initial if name.startswith("initial") else system
        matrix = getattr(owner, name.split(".")[-1], None)
        if matrix is not None:
            yield from refuse_indefinite(name, matrix)
    mean = system.initial.mean
    if not isinstance(mean, jax.core.Tracer) and not np.isfinite(np.asarray(mean, float)).all():
        yield f"initial.mean: got {np.asarray(mean)}, expected finite numbers"


def _sampled(system: System | DiscreteSystem) -> Iterator[str | Problem]:
    n = system.states
    if isinstance(system.sample, Sets):
        size = system.sample.size
        yield from returned("sample.transform(normals)", system.sample.transform, ((size, n),), (size, n))
    elif system.sample is not None:
        yield from returned("sample(key)", system.sample, (jax.random.key(0),), (n,))
