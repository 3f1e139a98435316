"""What an experiment consists of. Every key, its range and its default stand here."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from nlbench import runtime
from nlbench.config.claim import Claim
from nlbench.config.fields import (
    Bound,
    Finite,
    Fraction,
    Label,
    Name,
    NotNegative,
    Positive,
    RunNumber,
    Section,
)
from nlbench.config.identity import canonical_hash, named_folder, to_yaml

LARGEST = 2**63 - 1
# Sections that say how results are read and shown, not what is computed.
READ = ("claims", "source", "figures", "traces")
DECIDING = ("block", "precision")  # of the engine: what decides digits
Figure = Literal[
    "rms",
    "rms_clipped",
    "mean_error",
    "variance",
    "third_moment",
    "nees",
    "divergence",
    "trace",
    "density",
    "response",
    "cost",
    "final",
]

# What a reference is called in tables: what it is made of, so that nobody takes samples for the exact posterior.
PARTICLES = 10_000
REFERENCES = {"exact": "exact", "particles": f"particles {PARTICLES:,}"}


class Head(Section):
    """The keys at the top level that are not sections."""

    experiment: Name = Field(description="name, also the folder of the results")
    reference: Literal["exact", "particles"] | None = Field(
        default=None,
        description=f"beside the filters: the exact posterior, or a filter of {PARTICLES:,} particles",
    )
    report_times: list[Positive] | None = Field(
        default=None,
        min_length=1,
        description="where claims, medians and kept runs are taken; default: the end, and the times that claims name",
    )
    figures: list[Figure] | None = Field(
        default=None,
        description="kinds of figures to draw; default: all that apply but density, response and final",
    )
    traces: list[RunNumber] = Field(
        default_factory=list,
        max_length=32,
        description="numbers of runs, from 0, whose errors are saved at all output times and drawn",
    )
    bounds: list[Bound] = Field(
        default_factory=list, max_length=1, description="bounds on the errors of any filter to compute"
    )
    scores: bool = Field(
        default=True,
        description="whether filters are scored by how they foretold the measurements: nis and log_likelihood",
    )


class SystemSpec(Section):
    """A system by name, with all its parameters."""

    name: str
    parameters: dict[str, Any] = Field(default_factory=dict)


class FilterSpec(Section):
    """A filter by name, with all its options, and the parameters and initial moments that it believes in."""

    name: str
    label: Label
    options: dict[str, Any] = Field(default_factory=dict)
    model: dict[str, Any] = Field(default_factory=dict)
    initial: dict[str, Any] = Field(default_factory=dict)


class PluginSystem(Section):
    """The kind of a system that a plug-in brought."""

    discrete: bool
    continuous: bool


class PluginSpec(Section):
    """A plug-in that the experiment uses, filled in when its names are found; what the user allowed is carried along,
    so that another process can have it, and is not written down."""

    file: str
    digest: str
    systems: dict[str, PluginSystem] = Field(default_factory=dict)
    filters: list[str] = Field(default_factory=list)
    path: str = Field(default="", exclude=True)
    source: str = Field(default="", exclude=True, repr=False)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PluginSpec) and self.model_dump() == other.model_dump()

    def __hash__(self) -> int:
        return hash(self.digest)


class Initial(Section):
    """Initial moments; a variance is short for a diagonal covariance."""

    mean: Finite | list[Finite] | None = Field(default=None, description="of the state")
    cov: Finite | list[list[Finite]] | None = Field(
        default=None, description="covariance, symmetric, as rows; a number for one state"
    )
    variance: NotNegative | list[NotNegative] | None = Field(
        default=None, description="the diagonal of the covariance, instead of it"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Initial:
        if self.cov is not None and self.variance is not None:
            raise ValueError("cov and variance exclude each other")
        moments = self.moments()
        cov, mean = moments.get("cov"), moments.get("mean")
        if cov is None:
            return self
        size = len(cov)
        if any(len(row) != size for row in cov):
            raise ValueError("cov must be square")
        if mean is not None and len(mean) != size:
            raise ValueError(f"mean has {len(mean)} entries but the covariance {size}")
        pairs = [(i, j) for i in range(size) for j in range(i + 1)]
        if any(cov[i][j] != cov[j][i] for i, j in pairs):
            raise ValueError("cov must be symmetric")
        if any(row[i] < 0 for i, row in enumerate(cov)) or any(
            abs(cov[i][j]) > math.sqrt(cov[i][i]) * math.sqrt(cov[j][j]) * (1 + 1e-9) for i, j in pairs
        ):
            raise ValueError("cov must be positive semidefinite")
        return self

    def moments(self) -> dict[str, Any]:
        """`mean` (list) and `cov` (list of rows), as far as they were given."""
        moments: dict[str, Any] = {}
        if self.mean is not None:
            moments["mean"] = self.mean if isinstance(self.mean, list) else [self.mean]
        if self.cov is not None:
            moments["cov"] = self.cov if isinstance(self.cov, list) else [[self.cov]]
        elif self.variance is not None:
            diagonal = self.variance if isinstance(self.variance, list) else [self.variance]
            moments["cov"] = [
                [each if i == j else 0.0 for j in range(len(diagonal))] for i, each in enumerate(diagonal)
            ]
        return moments


class TimeSpec(Section):
    """The span of a run: end, integration step, and grid of the curves."""

    end: Positive = Field(description="duration of a run")
    step: Positive = Field(description="integration step")
    output: Positive = Field(description="spacing of the times at which statistics are taken")


class MonteCarlo(Section):
    """How many runs, from which seed, and how many of them to keep one by one."""

    runs: int = Field(default=1000, ge=1, le=LARGEST, description="number of trajectories")
    seed: int = Field(default=1969, ge=0, le=LARGEST, description="seed of truth and noise")
    keep_runs: int = Field(
        default=20_000, ge=0, le=10_000_000, description="runs whose errors are kept one by one"
    )


class Source(Section):
    """The publication that the experiment reproduces."""

    document: str | None = Field(default=None, description="the publication, such as culver-1969")
    figures: list[str] = Field(default_factory=list, description="numbers of its figures, such as '7.18'")
    tables: list[str] = Field(default_factory=list, description="numbers of its tables")
    runs: int | None = Field(default=None, ge=1, le=LARGEST, description="the source's number of runs")


class EngineSpec(Section):
    """How the runs are computed. Only block and precision can change a digit of the results."""

    chunk: int | None = Field(
        default=None, ge=1, le=1_000_000, description="blocks in each call; 64 at most are"
    )
    threads: int | None = Field(default=None, ge=1, le=4096, description="default: one for each core")
    block: int = Field(
        default_factory=runtime.block,
        ge=1,
        le=65536,
        description=f"trajectories in a block; default: {runtime.BLOCK}, on a GPU {runtime.BLOCK_OF_A_GPU}",
    )
    precision: Literal["float64", "float32"] = Field(default="float64", description="of all that is computed")
    cost: bool = Field(default=True, description="measure what each filter costs, compiled by itself")


class Limits(Section):
    """What makes `nlbench run` exit with 4."""

    diverged: Fraction = Field(default=1.0, description="largest fraction of diverged runs of a filter")


class Experiment(Section):
    """A validated experiment: names are known, every parameter is filled in, times fit each other."""

    experiment: Name
    question: str = ""
    system: SystemSpec
    filters: list[FilterSpec]
    reference: Literal["exact", "particles"] | None = None
    time: TimeSpec
    report_times: list[Positive]
    monte_carlo: MonteCarlo = MonteCarlo()
    truth: dict[str, Any] = Field(default_factory=dict)
    initial: dict[str, Any] = Field(default_factory=dict)
    source: Source = Source()
    claims: list[Claim] = Field(default_factory=list)
    engine: EngineSpec = Field(default_factory=EngineSpec)
    limits: Limits = Limits()
    figures: list[Figure] | None = None
    traces: list[RunNumber] = Field(default_factory=list)
    bounds: list[Bound] = Field(default_factory=list)
    scores: bool = True
    plugins: list[PluginSpec] = Field(default_factory=list)

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the filters in the order of the file; the reference, if any, is the last."""
        own = tuple(each.label for each in self.filters)
        return own if self.reference_label is None else (*own, self.reference_label)

    @property
    def reference_label(self) -> str | None:
        """What the reference is called; None without one."""
        return REFERENCES[self.reference] if self.reference else None

    def layout_times(self) -> tuple[tuple[float, ...], tuple[int, ...]]:
        """The output times, 0 included, and the positions of the report times among them."""
        count = round(self.time.end / self.time.output)
        times = tuple(round(index * self.time.output, 12) for index in range(count + 1))
        return times, tuple(round(time / self.time.output) for time in self.report_times)

    def resolved(self) -> dict[str, Any]:
        """The experiment as a file would state it with every default written out; `load` takes it back."""
        plain = self.model_dump(mode="json", exclude={"question"})
        plain["system"] = {"name": self.system.name, **plain["system"]["parameters"]}
        for each in plain["filters"]:
            beliefs = {key: value for key in ("model", "initial") if (value := each.pop(key))}
            each.update(each.pop("options"), **beliefs)
        plain["claims"] = [claim.model_dump(mode="json", exclude_none=True) for claim in self.claims]
        if not self.plugins:
            del plain["plugins"]
        return plain

    def resolved_yaml(self) -> str:
        """`resolved()` as a YAML file, headed by the question."""
        return to_yaml(self.resolved(), self.question)

    def hash12(self) -> str:
        """Identifies results that may be mixed: all counts but how many runs, how they are computed, and how read."""
        plain = self.resolved()
        del plain["monte_carlo"]["runs"]
        plain["engine"] = {name: plain["engine"][name] for name in DECIDING}
        return canonical_hash({key: value for key, value in plain.items() if key not in READ})

    def folder(self, out: str | Path) -> Path:
        """Return where its results lie below `out`.

        Raises `ConfigError` where those of another experiment do, whose name differs in capitals only.
        """
        return named_folder(Path(out), self.experiment) / self.hash12()

    def of_runs(self, runs: int) -> Experiment:
        """The same with so many runs."""
        return self._drawing(runs=runs)

    def of_seed(self, seed: int) -> Experiment:
        """The same with another seed."""
        return self._drawing(seed=seed)

    def _drawing(self, **numbers: int) -> Experiment:
        return self.model_copy(update={"monte_carlo": self.monte_carlo.model_copy(update=numbers)})
