"""What an update gives, and the contraction that the Hermite updates share."""

from __future__ import annotations

from typing import Any, NamedTuple

from nlbench.algebra import Tensor, einsum
from nlbench.moments.moments import Components


class Posterior(NamedTuple):
    """Moments after the update, and nu: 1 + nu times the Gaussian is the predictive density of a Hermite prior."""

    moments: Components
    nu: Any


def through_gain(G: Tensor, X: Tensor) -> Tensor:
    """G_ia G_jb ... X_ab..., one index at a time, for a symmetric tensor of order 1 to 4."""
    order = len(X.shape)
    out, old = "ijkl"[:order], "abcd"[:order]
    for done in range(order):
        before = out[:done] + old[done:]
        after = out[: done + 1] + old[done + 1 :]
        alike = [word for word in (out[: done + 1], old[done + 1 :]) if len(word) > 1]
        X = einsum(f"{out[done]}{old[done]},{before}->{after}", G, X, sym=",".join(alike))
    return X
