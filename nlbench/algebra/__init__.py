"""Component tensors: unique, structurally sparse components, contracted in index notation while jax traces."""

from nlbench.algebra.addresses import compact_address, compact_indices
from nlbench.algebra.contract import einsum, placements
from nlbench.algebra.derivatives import Taylor, expand
from nlbench.algebra.kinks import breaks
from nlbench.algebra.sharing import shared
from nlbench.algebra.solve import inverse, ldl, log_determinant, positive_definite, squared_distance
from nlbench.algebra.tensor import Tensor, identity, zeros

__all__ = [
    "Taylor",
    "Tensor",
    "breaks",
    "compact_address",
    "compact_indices",
    "einsum",
    "expand",
    "identity",
    "inverse",
    "ldl",
    "log_determinant",
    "placements",
    "positive_definite",
    "shared",
    "squared_distance",
    "zeros",
]
