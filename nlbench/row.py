"""A row of the table of named filters, and what the options of all of them have in common."""

from __future__ import annotations

from typing import Literal, NamedTuple

from pydantic import BaseModel, ConfigDict


class StrictOptions(BaseModel):
    """Options that refuse names they do not know and numbers that are not finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Row(NamedTuple):
    """One named filter.

    says, source: one line on what it is, and where it comes from.
    order: of the moments that it carries. update: the name of its update within the family.
    options: the model of its options.
    family: the package that builds it.
    """

    says: str
    source: str
    order: int
    update: str
    options: type[BaseModel]
    family: Literal["moment", "continuous", "discrete", "baseline", "reference", "plugin"] = "moment"
