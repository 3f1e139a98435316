"""A continuous measurement as the filters see it: y = dz/dt = h + noise of spectral density Gamma, expanded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from nlbench.algebra import Tensor, einsum, expand, inverse
from nlbench.algebra.scalars import Scalar

if TYPE_CHECKING:
    from nlbench.systems.system import System


class Sensed(NamedTuple):
    """y = h + H_r e + M_r:ee + noise about a point, for each measurement r.

    z: y - h (m,). H: slopes, each (n,). M: half Hessians, each (n, n), none for an expansion of order 1.
    gamma: spectral density (m, m), and W its inverse. taken: number of entries of y that are not missing.
    """

    z: Tensor
    H: tuple[Tensor, ...]
    M: tuple[Tensor, ...]
    gamma: Tensor
    W: Tensor
    taken: Any


def sense(
    system: System, t: Scalar, point: Sequence[Scalar], y: Any, missing: bool, order: int = 2
) -> Sensed:
    """The measurement `y` (m,) expanded at a point up to `order` (1 or 2).

    missing: whether entries of y may be NaN; such an entry is taken out by a zero slope and curvature, a zero residual
        and a unit spectral density, which leaves the others exactly as they are.
    """
    m = system.measurements
    h = expand(system.observe, t, point, order)
    y = jnp.asarray(y)
    z = Tensor.from_array(jnp.asarray(system.innovation(y, h.value.to_array())))
    gamma = Tensor.from_array(np.asarray(system.measurement_cov, float), ((0, 1),))
    H = tuple(_slice(h.first, r) for r in range(m))
    M = tuple(_slice(h.second, r) for r in range(m)) if h.second is not None else ()
    if not missing:
        return Sensed(z, H, M, gamma, inverse(gamma), m)
    there = [~jnp.isnan(y[r]) for r in range(m)]

    def kept(tensors: tuple[Tensor, ...]) -> tuple[Tensor, ...]:
        return tuple(
            tensor.map(lambda entry, r=r: jnp.where(there[r], entry, 0.0)) for r, tensor in enumerate(tensors)
        )

    z = Tensor.symmetric(m, 1, lambda r: jnp.where(there[r[0]], z[r], 0.0))
    gamma = Tensor.symmetric(
        m, 2, lambda rs: jnp.where(there[rs[0]] & there[rs[1]], gamma[rs], 1.0 if rs[0] == rs[1] else 0.0)
    )
    return Sensed(z, kept(H), kept(M), gamma, inverse(gamma), sum(entry.astype(int) for entry in there))


def curved_residual(sensed: Sensed, P: Tensor) -> Tensor:
    """z_r - M_r:P, the measurement less what is expected of it to second order: (m,)."""
    bias = {(r,): einsum("pq,pq->", M, P)[()] for r, M in enumerate(sensed.M)}
    return sensed.z - Tensor(sensed.z.shape, ((0,),), bias)


def weighted(W: Tensor, vectors: Sequence[Tensor]) -> list[Tensor]:
    """sum_s W_rs v_s for each r, of one vector (n,) for each measurement."""
    return [total([W[r, s] * v for s, v in enumerate(vectors)]) for r in range(len(vectors))]


def total(tensors: Sequence[Tensor]) -> Tensor:
    """Their sum."""
    first, *others = tensors
    for other in others:
        first = first + other
    return first


def _slice(tensor: Tensor, r: int) -> Tensor:
    """The r-th of a stack of symmetric tensors."""
    rest = tensor.shape[1:]
    entries = {index[1:]: entry for index, entry in tensor.entries.items() if index[0] == r}
    return Tensor(rest, (tuple(range(len(rest))),), entries)
