"""`nlbench compare`: is one finished run worse than another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nlbench.cli import options, output, saved
from nlbench.errors import ConfigError, GateError


def compare(
    a: Annotated[
        Path,
        typer.Argument(
            metavar="A", help="What was: the folder of a run, or its experiment file.", show_default=False
        ),
    ],
    b: Annotated[Path, typer.Argument(metavar="B", help="What is now: likewise.", show_default=False)],
    margin: Annotated[
        str, typer.Option("--margin", metavar="M", help="Changes that do not matter: 1% or 0.01.")
    ] = "1%",
    alpha: Annotated[
        str,
        typer.Option(
            "--alpha",
            metavar="P",
            help="Probability of any false alarm, all comparisons together: 1% or .01.",
        ),
    ] = "1%",
    statistic: Annotated[
        list[str] | None,
        typer.Option(
            "--statistic",
            metavar="NAME",
            help="A statistic at the report times instead of the usual ones; repeatable.",
        ),
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Every statistic, at the report times and over all times.")
    ] = False,
    two_sided: Annotated[
        bool, typer.Option("--two-sided", help="Fail where B is better by more than the margin, too.")
    ] = False,
    settings: options.Set = None,
    plugins: options.Plugin = None,
    out: options.Out = Path("results"),
    markdown: Annotated[
        bool, typer.Option("--markdown", help="Print Markdown, for the summary of a CI job.")
    ] = False,
    json: options.Json = False,
) -> None:
    """Compare two finished runs: is B worse than A by more than a margin?

    Compared are the RMS errors (clipped, for a filter that diverged) at the report times that both have, and the
    fractions of runs that diverged. Runs with one seed saw the same truth and noise and are paired; otherwise
    they are tested as independent. All tests share Holm's correction.

    Exit code 3 if B is worse: a significant change beyond the margin, or a filter that failed in B only. 0 if not;
    changes within the margin and for the better are shown. 7 if the runs have nothing in common.
    """
    if statistic and everything:
        raise ConfigError("--statistic and --all exclude each other")
    if markdown and json:
        raise ConfigError("--markdown and --json exclude each other")
    allowed, level = options.fractions({"--margin": margin, "--alpha": alpha})
    folders = saved.found(a, settings, out), saved.found(b, settings, out)
    from nlbench.cli import compared as shown
    from nlbench.comparison.compared import Asked, compared

    found = compared(*folders, Asked(allowed, level, "all" if everything else statistic))
    failing = len(found.failing(two_sided)) > 0
    faults = [GateError(f"gate failed: {shown.verdict(found, two_sided)}")] if failing else []
    if json:
        output.as_json(shown.facts(found, GateError.exit_code if failing else 0), *faults)
    elif markdown:
        shown.markdown(found, two_sided)
    else:
        shown.show(found, two_sided)
    if faults:
        raise faults[0]
