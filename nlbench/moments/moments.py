"""Moments of a state: as full arrays at interfaces, as unique components inside."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from nlbench.algebra import Tensor


class Moments(NamedTuple):
    """Mean and central moments of a state of n components, as full symmetric arrays.

    mean: (n,). cov: (n, n). third: (n, n, n), None where it is not carried (zero).
    fourth: (n, n, n, n), the central fourth moment; None means Gaussian, 3{P P}.
    """

    mean: Any
    cov: Any
    third: Any = None
    fourth: Any = None


class Components(NamedTuple):
    """Mean, covariance, third moment and fourth Hermite coefficient k4 = mu4 - 3{P P}, as unique components.

    Orders that a filter does not carry are None. k4 is carried, not mu4, because it stays exactly zero where the state
    stays Gaussian, whatever the integration step.
    """

    mean: Tensor
    cov: Tensor
    third: Tensor | None = None
    fourth: Tensor | None = None


def to_components(moments: Moments, order: int) -> Components:
    """The components that moment equations of `order` (1 to 4) carry, every one an array."""
    import jax.numpy as jnp

    from nlbench.algebra import Tensor, zeros
    from nlbench.moments.closures import fourth_coefficient

    def tensor(array: Any, order: int) -> Tensor:
        return Tensor.from_array(jnp.asarray(array, float), (tuple(range(order)),))

    n = len(moments.mean)
    cov = tensor(moments.cov, 2)
    third = fourth = None
    if order >= 3:
        third = zeros(n, 3) if moments.third is None else tensor(moments.third, 3)
    if order >= 4:
        fourth = zeros(n, 4) if moments.fourth is None else fourth_coefficient(tensor(moments.fourth, 4), cov)
    return dense(Components(tensor(moments.mean, 1), cov, third, fourth))


def to_full(components: Components) -> Moments:
    """Full arrays, the fourth as a central moment."""
    from nlbench.moments.closures import gaussian_fourth

    mean, cov, third, fourth = components
    if fourth is not None:
        fourth = fourth + gaussian_fourth(cov)
    return Moments(*(None if tensor is None else tensor.to_array() for tensor in (mean, cov, third, fourth)))


def dense(components: Components) -> Components:
    """Every unique component an array, so that a loop can carry them."""
    return Components(*(None if tensor is None else tensor.dense() for tensor in components))
