"""A measurement as the updates see it: linearised at the prior mean, its entries taken in turn, with its gain."""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.algebra import Tensor, einsum, expand, identity
from nlbench.algebra.scalars import Scalar, add, multiply

if TYPE_CHECKING:
    from nlbench.moments.moments import Components
    from nlbench.systems.system import System

AGREES = 1e-8  # as a share of a measurement, by how much one that was certain may be off by rounding
NIL = 1e-28  # as a share of the variance of an entry, what those before it leave of it if they determine it


class Measurement(NamedTuple):
    """y = h + H e + v at the prior mean: residual z (m,), H (m, n), covariance R (m, m), number of entries taken.

    slack: (m,), by how much an entry that was certain may be off; None where R is positive definite, so that none is.
    """

    z: Tensor
    H: Tensor
    R: Tensor
    taken: Any
    slack: Tensor | None = None


class Gain(NamedTuple):
    """What every update needs, in measurement space, the entries of y taken in turn.

    S is the covariance of the innovation z. Instead of z the updates have T z, each entry without what those before it
    tell, and H, R and `variance` are those of T z: so several accurate sensors of the same thing lose no digits.
      (1) T S T' = diag(variance),  T unit lower triangular;  H = T H,  R = T R T',  W = diag(variance)^-1
      (2) K = P H' W,  G = I - K H,  Omega = G P
    An entry that is certain, given those before it, has W = 0; certain: whether it is, None where none can be.
    """

    S: Tensor
    T: Tensor
    H: Tensor
    R: Tensor
    variance: Tensor
    W: Tensor
    K: Tensor
    G: Tensor
    omega: Tensor
    certain: tuple[Any, ...] | None

    def turned(self, z: Tensor) -> Tensor:
        """T z."""
        return z if z.shape[0] == 1 else einsum("rs,s->r", self.T, z)


def linearise(system: System, t: Scalar, prior: Components, y: Any, missing: bool) -> Measurement:
    """The measurement `y` (m,) linearised at the prior mean.

    missing: whether entries of y may be NaN; such an entry is taken out by a zero row of H, a zero residual and a unit
        variance, which leaves the others exactly as they are.
    """
    m = system.measurements
    h = expand(system.observe, t, list(prior.mean), 1)
    y = jnp.asarray(y)
    predicted = h.value.to_array()
    z = Tensor.from_array(jnp.asarray(system.innovation(y, predicted)))
    R = Tensor.from_array(np.asarray(system.measurement_cov, float), ((0, 1),))
    slack = None
    if not _positive_definite(system.measurement_cov):
        slack = Tensor.symmetric(m, 1, lambda r: AGREES * (jnp.abs(y[r[0]]) + jnp.abs(z[r])))
    if not missing:
        return Measurement(z, h.first, R, m, slack)
    there = [~jnp.isnan(y[r]) for r in range(m)]
    H = Tensor(
        h.first.shape,
        h.first.symmetry,
        {(r, i): jnp.where(there[r], entry, 0.0) for (r, i), entry in h.first.entries.items()},
    )
    z = Tensor.symmetric(m, 1, lambda r: jnp.where(there[r[0]], z[r], 0.0))
    R = Tensor.symmetric(
        m, 2, lambda rs: jnp.where(there[rs[0]] & there[rs[1]], R[rs], 1.0 if rs[0] == rs[1] else 0.0)
    )
    return Measurement(z, H, R, sum(entry.astype(int) for entry in there), slack)


def _positive_definite(R: Any) -> bool:
    """Whether R (m, m) is known to be positive definite."""
    return isinstance(R, jax.core.Tracer) or bool(np.linalg.eigvalsh(np.asarray(R, float)).min() > 0)


def gain(P: Tensor, measurement: Measurement) -> Gain:
    """(1)-(2)."""
    m, sure = measurement.H.shape[0], measurement.slack is not None
    S = einsum("ra,as->rs", measurement.H, einsum("ia,ra->ir", P, measurement.H), sym="rs") + measurement.R
    T, H, variances = identity(m), measurement.H, [S[0, 0]]
    certain = [_nil(S[0, 0], S[0, 0])]
    if m > 1:
        T, H, variances, certain = _in_turn(P, S, measurement)
    inverses = [1.0 / variance for variance in variances]
    if sure:
        inverses = [
            jnp.where(nil, 0.0, 1.0 / jnp.where(nil, 1.0, v))
            for nil, v in zip(certain, variances, strict=True)
        ]
        variances = [jnp.where(nil, 1.0, v) for nil, v in zip(certain, variances, strict=True)]
    W = _diagonal(inverses)
    PH = einsum("ia,ra->ir", P, H)
    K = einsum("is,sr->ir", PH, W)
    G = identity(P.shape[0]) - einsum("ir,ra->ia", K, H)
    omega = einsum("ia,aj->ij", G, P, sym="ij")
    R = measurement.R if m == 1 else einsum("rs,st,ut->ru", T, measurement.R, T, sym="ru")
    return Gain(S, T, H, R, _diagonal(variances), W, K, G, omega, tuple(certain) if sure else None)


def _in_turn(
    P: Tensor, S: Tensor, measurement: Measurement
) -> tuple[Tensor, Tensor, list[Scalar], list[Any]]:
    """T, T H, the variances of (1), and which of them are nil."""
    m, n = measurement.H.shape
    T: list[list[Scalar]] = []
    H: list[list[Scalar]] = []
    variances: list[Scalar] = []
    certain: list[Any] = []
    for r in range(m):
        own, noise = [measurement.H[r, a] for a in range(n)], [measurement.R[r, t] for t in range(m)]
        turn, row = [float(r == s) for s in range(m)], own
        for s in range(r):
            PH = [_dot([P[i, a] for a in range(n)], H[s]) for i in range(n)]
            shared = add(_dot(own, PH), _dot(noise, T[s]))
            slope = shared / variances[s]
            if measurement.slack is not None:
                slope = jnp.where(certain[s], 0.0, shared / jnp.where(certain[s], 1.0, variances[s]))
            turn, row = _less(turn, slope, T[s]), _less(row, slope, H[s])
        spread = _dot(row, [_dot([P[i, a] for a in range(n)], row) for i in range(n)])
        left = _dot(turn, [_dot([measurement.R[s, t] for t in range(m)], turn) for s in range(m)])
        T.append(turn)
        H.append(row)
        variances.append(add(spread, left))
        certain.append(_nil(variances[r], S[r, r]))
    return _matrix(T), _matrix(H), variances, certain


def _dot(a: list[Scalar], b: list[Scalar]) -> Scalar:
    return reduce(add, map(multiply, a, b), 0.0)


def _less(a: list[Scalar], factor: Scalar, b: list[Scalar]) -> list[Scalar]:
    return [add(x, multiply(-1.0, multiply(factor, y))) for x, y in zip(a, b, strict=True)]


def _nil(variance: Scalar, of: Scalar) -> Any:
    """Whether those before an entry determine it, which alone has the variance `of`."""
    return jnp.abs(variance) <= NIL * jnp.abs(of)


def _matrix(rows: list[list[Scalar]]) -> Tensor:
    entries = {(i, j): entry for i, row in enumerate(rows) for j, entry in enumerate(row)}
    return Tensor((len(rows), len(rows[0])), ((0,), (1,)), entries)


def _diagonal(entries: list[Scalar]) -> Tensor:
    return Tensor((len(entries), len(entries)), ((0, 1),), {(r, r): entry for r, entry in enumerate(entries)})
