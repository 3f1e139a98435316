"""Claims are about coordinates and moments that the system has."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from nlbench.errors import ConfigError, Problem
from nlbench.statistics.layout import Layout
from nlbench.suggestions import suggestion

if TYPE_CHECKING:
    from nlbench.config import Claim


def check_claims(claims: Iterable[Claim], layout: Layout) -> None:
    """Raises `ConfigError` for every claim about a coordinate or a moment that the system does not have."""
    coordinates = (*layout.magnitudes, "all")
    moments = [
        ",".join(str(index + 1) for index in component)
        for order in (2, 3)
        for component in layout.components(order)
    ]
    problems = [
        Problem(
            f"'{claim.id}' is about the {what} '{name}', which the system does not have{suggestion(name, names)}",
            f"claims.{number}.{key}",
        )
        for number, claim in enumerate(claims)
        for what, key, names, given in (
            ("coordinate", "coordinate", coordinates, [claim.coordinate] if claim.coordinate else []),
            ("moment", "printed", moments, claim.printed or []),
        )
        for name in given
        if name not in names
    ]
    if problems:
        raise ConfigError(problems)
