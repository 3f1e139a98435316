"""Types of the keys of an experiment file, and what all its sections have in common."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

STEM = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0, le=1)]
RunNumber = Annotated[int, Field(ge=0)]
Statistic = Literal[
    "rms",
    "rms_clipped",
    "median_error",
    "mean_error",
    "variance_estimated",
    "variance_actual",
    "third_estimated",
    "third_actual",
    "nees",
    "coverage_95",
    "nis",
    "log_likelihood",
    "diverged",
]
PrintedMoment = Literal["moment_estimated", "moment_actual"]
Bound = Literal["cramer-rao"]


def _path_like(name: str) -> str:
    """A name that is safe as a folder below the results: no way out of it, and nothing hidden in it."""
    safe = all(STEM.fullmatch(part) and not part.endswith(".") for part in name.split("/"))
    if not safe or len(name) > 100:
        allowed = "parts of A-Z a-z 0-9 - _ . with / between them"
        raise ValueError(f"expected a name such as 'culver/hermite-01' ({allowed}), found {name[:60]!r}")
    return name


def _one_line(text: str) -> str:
    if not text.isprintable() or text != text.strip():
        raise ValueError(f"expected one line of printable text without spaces around it, found {text[:60]!r}")
    return text


Name = Annotated[str, AfterValidator(_path_like)]
Label = Annotated[str, Field(min_length=1, max_length=60), AfterValidator(_one_line)]
Line = Annotated[str, Field(min_length=1, max_length=300), AfterValidator(_one_line)]


class Section(BaseModel):
    """A part of the experiment file: immutable, unknown keys refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)
