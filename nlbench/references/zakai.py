"""Bayes's rule on a fixed grid, for a scalar system in continuous time with process noise.

For dx = f dt + noise of spectrum q, in Ito's sense, the density obeys dp/dt = -(f p)' + (q p)''/2. On cells of width d
whose ends keep probability in, the flow from cell i to i + 1 is that of Scharfetter and Gummel,
  (1) z = int 2 f/q dx - log(q_(i+1)/q_i), from centre to centre,  B(z) = z/(e^z - 1)
  (2) u_i w_i - l_(i+1) w_(i+1),  u = q B(-z)/(2 d^2),  l = q B(z)/(2 d^2),  q halfway
so that dw/dt = A w with a tridiagonal A, and, with a rate r that is above all -A_ii,
  (3) exp(A T) w = e^(-rT) sum_k ((rT)^k/k!) (1 + A/r)^k w,  cut where nothing is left to add
Probability is kept and stays positive, as there are no differences in (3), and u w = l w where p q = exp(int 2 f/q) is
stationary. Where f or q depend on t, A is that of the middle of a step. A continuous measurement comes as samples of
variance PSD/dt, one at the start of a step, so its factor exp(-(y - h)^2 dt/(2 PSD)) is that of Bayes's rule, in
`masses`, and alternating with (3) solves Zakai's equation to first order in dt.
Error: d^2. In (1) noise seems larger than it is, by the share (z/2) coth(z/2) - 1, z^2/12 where |f| d < q; where that
is more than .05 on average over the prior, the grid is refused, but it should be far less: halve d to see it.
Cost for p cells: 3 p multiplications for each power in (3): 12 of them for rT = .4, 31 for 4 and 8 rT beyond.
Source: Scharfetter and Gummel 1969; Chang and Cooper 1970, J. Comput. Phys. 6, 1-16; (3): Jensen 1953.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.discrete.problem import spectrum, stacked
from nlbench.discrete.time import Clock
from nlbench.errors import ConfigError
from nlbench.references import masses
from nlbench.references.dependence import depends
from nlbench.references.masses import Grid, Masses
from nlbench.systems.system import System

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.exact import ZakaiGrid

LONGEST = 4.0  # rT of one sum (3)
NOTHING = 1e-17  # a share of the whole sum
MOST_AT_ENDS = 1e-5  # in the outermost cells, so that less than some 1e-4 belongs beyond them
MOST_ARTIFICIAL = 0.05
MOST_POINTS = 100_000  # 51 MB of a block
NODES, SHARES = np.polynomial.legendre.leggauss(3)


class Generator(NamedTuple):
    """r, and 1 + A/r: what stays in a cell (p,), and what goes up and down over the inner faces (p - 1,)."""

    rate: Any
    stays: Any
    up: Any
    down: Any


def build(system: System | DiscreteSystem, record: ZakaiGrid) -> Filter:
    """The posterior as a filter. Raises `ConfigError` where the method does not apply."""
    if not isinstance(system, System) or system.states != 1 or system.diffusion is None:
        raise ConfigError("exact: a Zakai grid is for continuous time and one state with process noise")
    if record.points > MOST_POINTS:
        raise ConfigError(
            f"exact: a grid of {record.points:,} points would resolve this system's noise; at most {MOST_POINTS:,}"
        )
    spacing = (record.upper - record.lower) / record.points
    centres = record.lower + spacing * (np.arange(record.points) + 0.5)
    with jax.ensure_compile_time_eval():
        if not jnp.all(_spectrum(system, 0.0, centres) > 0):
            raise ConfigError("exact: a Zakai grid is for process noise that vanishes nowhere")
        varies = depends(lambda t: _generator(system, centres, t), 0.0)
        lasting = None if varies else jax.tree.map(np.asarray, _generator(system, centres, 0.0))
        _refuse_coarse(system, centres)

    def integrate(state: Masses, t: Any, h: Any, count: Any) -> Masses:
        if lasting is not None:
            return held(lasting, state, h * count)
        middle = lambda i: _generator(system, centres, t + (i + 0.5) * h)  # noqa: E731
        return jax.lax.fori_loop(0, count, lambda i, state: held(middle(i), state, h), state)

    def held(generator: Generator, state: Masses, T: Any) -> Masses:
        weights = carried(generator, T, state.weights)
        return masses.kept(weights, weights[0] + weights[-1], MOST_AT_ENDS)

    def slope(t: Any, weights: Any) -> Any:
        generator = _generator(system, centres, t) if lasting is None else lasting
        return generator.rate * (_mixed(generator, weights) - weights)

    clock = Clock.of_integrals(integrate, system.default_step)
    return masses.bind(system, Grid(centres[:, None], np.array([spacing])), clock, slope)


def _refuse_coarse(system: System, centres: np.ndarray) -> None:
    """Raises `ConfigError` where probability drifts so fast that the cells' width acts as noise."""
    _, _, up, down = jax.tree.map(np.asarray, _generator(system, centres, 0.0))
    with np.errstate(divide="ignore"):
        half = np.clip(np.log(up / down) / 2, -300, 300) + 1e-9
    faces, (mean,), ((variance,),) = (centres[1:] + centres[:-1]) / 2, *system.initial[:2]
    prior = np.exp(-((faces - mean) ** 2) / (2 * variance))
    share = prior @ (half / np.tanh(half) - 1) / np.sum(prior)
    if share > MOST_ARTIFICIAL:
        raise ConfigError(
            f"exact: the cells of the grid are so wide that the process noise seems {share:.0%} larger than it is, on "
            f"average over the prior, and at most {MOST_ARTIFICIAL:.0%} are allowed: take more points"
        )


def carried(generator: Generator, T: Any, weights: Any) -> Any:
    """(3), in as many equal times as keep rT below `LONGEST`; weights (p,)."""
    whole = generator.rate * T
    known = isinstance(whole, (int, float, np.generic, np.ndarray))
    if known:
        parts: Any = max(1, math.ceil(whole / LONGEST))
        powers = _powers(float(whole) / parts)
    else:
        parts = jnp.maximum(1, jnp.ceil(whole / LONGEST)).astype(int)
        powers = _powers(LONGEST)
    share = whole / parts

    def power(k: Any, sums: tuple[Any, Any]) -> tuple[Any, Any]:
        term, total = sums
        term = _mixed(generator, term) * (share / k)
        return term, total + term

    def part(_: Any, weights: Any) -> Any:
        first = weights * jnp.exp(-share)
        return jax.lax.fori_loop(1, powers + 1, power, (first, first))[1]  # unrolled, XLA repeats work

    return jax.lax.fori_loop(0, parts, part, weights)


def _powers(share: float) -> int:
    """How many powers (3) needs for rT = `share`."""
    k, term = 0, math.exp(-share)
    while k < share or term > NOTHING:
        k += 1
        term *= share / k
    return k


def _mixed(generator: Generator, weights: Any) -> Any:
    """(1 + A/r) w."""
    above, below = generator.up * weights[:-1], generator.down * weights[1:]
    return generator.stays * weights + jnp.pad(above, (1, 0)) + jnp.pad(below, (0, 1))


def _generator(system: System, centres: Any, t: Any) -> Generator:
    """(1) and (2)."""
    d = centres[1] - centres[0]
    faces = (centres[1:] + centres[:-1]) / 2
    nodes = faces[:, None] + d / 2 * NODES  # Gauss's, from centre to centre
    pull = 2 * _drift(system, t, nodes.ravel()) / _spectrum(system, t, nodes.ravel())
    z = d / 2 * pull.reshape(nodes.shape) @ SHARES - jnp.diff(jnp.log(_spectrum(system, t, centres)))
    scale = _spectrum(system, t, faces) / (2 * d**2)
    up, down = scale * _bernoulli(-z), scale * _bernoulli(z)
    out = jnp.pad(up, (0, 1)) + jnp.pad(down, (1, 0))
    rate = jnp.max(out)
    return Generator(rate, 1.0 - out / rate, up / rate, down / rate)


def _bernoulli(z: Any) -> Any:
    """B(z) = z/(e^z - 1), to rounding."""
    small = jnp.abs(z) < 1e-3
    safe = jnp.where(small, 1.0, z)
    return jnp.where(small, 1 - z / 2 + z**2 / 12, safe / jnp.expm1(safe))


def _drift(system: System, t: Any, x: Any) -> Any:
    """f at points (p,)."""
    f = lambda x: stacked(system.drift_with_inputs(t, x))  # noqa: E731
    return jax.vmap(f)(jnp.asarray(x)[:, None])[:, 0]


def _spectrum(system: System, t: Any, x: Any) -> Any:
    """q at points (p,)."""
    return jax.vmap(lambda x: spectrum(system, t, x))(jnp.asarray(x)[:, None])[:, 0, 0]
