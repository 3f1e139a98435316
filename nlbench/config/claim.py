"""A claim of an experiment file: what is said of the filters, by whom, and which comparison decides it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from nlbench.config.fields import Finite, Label, Line, Positive, PrintedMoment, Section, Statistic

FORMS = ("less", "equal", "of")
# What makes a claim about single filters, and the keys that may go with each form.
SINGLE = ("below", "above", "agrees_with", "less_than", "printed")
WITH = {
    "less": {"factor", "agrees_with"},
    "equal": {"within"},
    "below": {"above"},
    "above": {"below"},
    "agrees_with": {"within"},
    "less_than": {"factor"},
    "printed": set(),
}
APART = {"id", "says", "whose", "where", "figures", "coordinate", "at"}  # what a form does not depend on
COMPARING = ("factor", "within", *SINGLE)
Moments = Annotated[dict[str, Finite], Field(min_length=1)]


class Claim(Section):
    """Exactly one of `less`, `equal` and `of` says which filters are compared, or with what each of them is."""

    id: Label = Field(description="what tables and reports call it")
    says: Line = Field(description="the claim in words, best those of the source")
    where: Line | None = Field(default=None, description="section and page of the source")
    whose: Literal["source", "ours"] = Field(
        default="source", description="only the source's claims decide whether its figures are reproduced"
    )
    figures: list[str] | None = Field(
        default=None,
        min_length=1,
        description="which of the source's figures and tables it is about; default: all",
    )
    statistic: Statistic | PrintedMoment = Field(description="which statistic is compared")
    coordinate: str | None = Field(default=None, description="default: the first; of `diverged`: all")
    at: list[Positive] = Field(default_factory=list, description="report times; default: all")
    less: list[str] | None = Field(
        default=None, min_length=2, description="each label's value is less than the next one's"
    )
    equal: list[str] | None = Field(
        default=None, min_length=2, description="each label's value is, within a fraction, the next one's"
    )
    of: list[str] | None = Field(default=None, min_length=1, description="each of these labels by itself")
    factor: Positive | None = Field(default=None, description="even this many times the value is less")
    within: Positive | None = Field(default=None, description="the largest relative difference")
    below: Finite | None = Field(default=None, description="the statistic is less than this")
    above: Finite | None = Field(default=None, description="the statistic is more than this")
    agrees_with: Statistic | None = Field(default=None, description="a statistic of the same filter")
    less_than: Statistic | None = Field(default=None, description="a statistic of the same filter")
    printed: Moments | None = Field(
        default=None, description="numbers that the source prints, by the `indices` of the table of moments"
    )

    @property
    def labels(self) -> list[str]:
        """The filters that it is about."""
        return self.less or self.equal or self.of or []

    @property
    def form(self) -> str:
        """What decides it: less, equal, below, above, agrees_with, less_than or printed."""
        if self.of is None:
            return "less" if self.less else "equal"
        return next(key for key in SINGLE if getattr(self, key) is not None)

    @model_validator(mode="after")
    def _one_form(self) -> Claim:
        if wrong := self.misfit():
            raise ValueError(wrong)
        return self

    def misfit(self) -> str:
        """Say what of the keys that compare cannot be combined; nothing where all can."""
        given = [key for key in FORMS if getattr(self, key) is not None]
        if len(given) != 1:
            told = " and ".join(given) or "none"
            return f"expected exactly one of less, equal and of, found {told}"
        if self.of is not None and all(getattr(self, key) is None for key in SINGLE):
            return f"'of' needs one of {', '.join(SINGLE)}"
        beside = {key for key in COMPARING if getattr(self, key) is not None} - {self.form}
        if unfit := sorted(beside - WITH[self.form]):
            return f"'{unfit[0]}' does not go with '{self.form}'"
        if self.form in ("equal", "agrees_with") and self.within is None:
            return f"'{self.form}' needs 'within', the largest relative difference"
        if self.below is not None and self.above is not None and self.above >= self.below:
            return "'above' must be less than 'below'"
        if self.statistic.startswith("moment_") != (self.printed is not None):
            return "'printed' goes with the statistics moment_estimated and moment_actual, only"
        return ""
