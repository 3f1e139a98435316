"""What `nlbench compare` prints: a table of changes, how sure they are, and the verdict; as text, Markdown or JSON."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

from nlbench.cli import output
from nlbench.cli.changes import HEAD, SHORT, cells, percent
from nlbench.errors import printable
from nlbench.report.markdown import plain

if TYPE_CHECKING:
    from nlbench.comparison.compared import Compared

MOST = 30  # comparisons without a significant change that are shown
STYLES = {"FAILED": "red", "worse": "red", "changed": "red", "slight": "yellow", "better": "green"}
QUIET = ("~", "few", "=")
LEGEND = {
    "FAILED": "no number in B",
    "worse": "by more than the margin",
    "changed": "by more than the margin",
    "slight": "significant, but not shown to exceed the margin",
    "better": "by more than the margin",
    "recovered": "no number in A",
    "~": "not significant",
    "few": "too few runs",
    "=": "the same in both",
}


def facts(found: Compared, exit_code: int) -> dict[str, Any]:
    """What `--json` prints."""
    sides = {
        name: {
            "folder": str(side.path),
            "experiment": side.experiment.experiment,
            "hash": side.manifest["hash"],
            "runs": side.runs,
            "seed": side.seed,
        }
        for name, side in (("a", found.a), ("b", found.b))
    }
    return {
        **sides,
        "margin": found.asked.margin,
        "alpha": found.asked.alpha,
        "identical": found.identical,
        "tests": found.tests,
        "differences": list(found.notes),
        "comparisons": found.table.to_dict(orient="records"),
        "exit_code": exit_code,
    }


def verdict(found: Compared, two_sided: bool) -> str:
    """The result in one line."""
    failing = found.failing(two_sided)["verdict"].value_counts()
    margin = percent(found.asked.margin)
    if len(failing):
        counts = ", ".join(f"{count} {word}" for word, count in failing.items())
        return f"{counts} of {len(found.table)} comparisons (margin {margin})"
    if found.identical:
        count = len(found.table)
        return f"equal: all {count} comparisons, to the last bit" if count else "equal: the same run"
    if (found.table["verdict"] == "=").all():
        return f"equal: all {len(found.table)} comparisons, but for rounding"
    other = found.table["verdict"].value_counts()
    parts = [f"{other[word]} {word}" for word in ("better", "recovered", "slight") if word in other]
    return f"not worse by more than {margin}" + (f" ({', '.join(parts)})" if parts else "")


def show(found: Compared, two_sided: bool) -> None:
    """Print it within 80 columns."""
    for name, side in (("A", found.a), ("B", found.b)):
        print(f"{output.styled(name, 'bold')}  {side.path}\n   {_described(side)}")
    for line in found.notes:
        print(textwrap.fill(printable(line), output.WIDTH, initial_indent="   ", subsequent_indent="     "))
    print(f"\n{_how(found)}")
    if not (found.table["verdict"] == "=").all():
        _table(found)
    failed = len(found.failing(two_sided)) > 0
    print(f"\n{output.styled(verdict(found, two_sided), 'red' if failed else 'green')}")
    if line := _sensitivity(found):
        print(line)
    output.next_step(*_next(found, failed))


def _table(found: Compared) -> None:
    """The changes, by filter, and what the words beside them mean."""
    chosen, left = _chosen(found)
    groups: dict[str, list[list[str]]] = {}
    for row in chosen:
        groups.setdefault(row["filter"], []).append(cells(row, len(found.a.units) > 1))
    lines = [list(HEAD), *(each for group in groups.values() for each in group)]
    widths = [max(len(each[column]) for each in lines) for column in range(len(HEAD))]
    widths[0] = min(widths[0], output.WIDTH - 2 - sum(widths[1:]) - 2 * (len(HEAD) - 1))
    print(f"\n{_line(lines[0], widths)}")
    for label, group in groups.items():
        print(_cut(label, output.WIDTH))
        for each in group:
            print(_line(each, widths))
    if left:
        print(f"... and {left} more without a significant change (--json has them)")
    print()
    short = [
        (SHORT[name], f"{name}, which counts diverged runs") for name in SHORT if _shortened(found, name)
    ]
    words = dict.fromkeys(row["verdict"] for row in chosen)
    output.definitions([*short, *((word, LEGEND[word]) for word in words)])


def markdown(found: Compared, two_sided: bool) -> None:
    """Print it as GitHub shows it."""
    print(f"### nlbench compare: {verdict(found, two_sided)}\n")
    for name, side in (("A", found.a), ("B", found.b)):
        print(f"- {name}: {plain(f'{side.path}, {_described(side)}')}")
    for line in found.notes:
        print(f"- {plain(line)}")
    chosen, left = _chosen(found)
    print(
        f"\n{_how(found)}\n\n| filter | statistic | t | A | B | B/A | p | |\n|---|---|---|---|---|---|---|---|"
    )
    for row in chosen:
        shown = [row["filter"], *cells(row, len(found.a.units) > 1)]
        print(f"| {' | '.join(map(plain, shown))} |")
    if left:
        print(f"\n... and {left} more without a significant change")
    if line := _sensitivity(found):
        print(f"\n{line}")


def _described(side: Any) -> str:
    return f"{side.experiment.experiment}, {side.runs:,} runs, seed {side.seed}"


def _how(found: Compared) -> str:
    paired = found.table["paired"].sum()
    if paired == 0:
        how = "as independent runs" + (
            " (one seed, but no runs kept)" if found.a.seed == found.b.seed else ""
        )
    else:
        how = "run by run" if paired == len(found.table) else f"{paired} of them run by run"
    level = percent(found.asked.alpha)
    text = f"{len(found.table)} comparisons, {how}; {found.tests} tests, Holm at {level}. "
    text += f"Intervals: {percent(1 - found.asked.alpha)}, each by itself."
    return textwrap.fill(text, output.WIDTH)


def _chosen(found: Compared) -> tuple[list[dict[str, Any]], int]:
    """All with something to say, some of the others; and how many are left out."""
    rows = found.table.to_dict(orient="records")
    loud = [row for row in rows if row["verdict"] not in QUIET]
    quiet = [row for row in rows if row["verdict"] in QUIET]
    fit = max(MOST - len(loud), 0)
    return loud + quiet[:fit], len(quiet[fit:])


def _shortened(found: Compared, statistic: str) -> bool:
    return len(found.a.units) > 1 and statistic in set(found.table["statistic"])


def _line(given: list[str], widths: list[int]) -> str:
    text = "  ".join(_cut(cell, width).ljust(width) for cell, width in zip(given, widths, strict=True))
    plain = f"  {text}".rstrip()
    word = given[-1]
    return plain.removesuffix(word) + output.styled(word, STYLES[word]) if word in STYLES else plain


def _sensitivity(found: Compared) -> str:
    """What would have been found: a gate that cannot fail is worth nothing."""
    sizes = found.table["statistic"].isin(["rms", "rms_clipped"]) & found.table["detects"].notna()
    reach = found.table.loc[sizes, "detects"]
    if reach.empty:
        return ""
    low, high = (f"{output.percent(value - 1)} %" for value in (reach.min(), reach.max()))
    text = f"A change of an RMS error by {low if low == high else f'{low} to {high}'} would be found 9 times in 10."
    return textwrap.fill(text, output.WIDTH)


def _next(found: Compared, failed: bool) -> tuple[str, str]:
    if failed:
        return f"nlbench report {found.b.path}", "draws what is now; --json here has every comparison"
    if found.identical:
        return f"nlbench report {found.b.path}", "draws it"
    return (
        f"nlbench compare {found.a.path} {found.b.path} --all",
        "compares every statistic, at the report times and over all times",
    )


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else f"{text[: width - 1]}…"
