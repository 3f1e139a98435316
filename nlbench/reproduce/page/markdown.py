"""The page's twin in Markdown, for a code forge: the same words, pictures by their files, no HTML.

It links only to what lies beside it and to the files of the experiments: folders of runs are not kept in a repository.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from nlbench.report.markdown import plain
from nlbench.report.tables import Table
from nlbench.reproduce.page.contents import Contents
from nlbench.reproduce.page.links import Link
from nlbench.reproduce.page.overview import Corrected
from nlbench.reproduce.page.sections import Chapter, Ran, Section, Tested


def markdown(contents: Contents) -> str:
    """The whole file."""
    return "\n".join(_lines(contents)).rstrip() + "\n"


def anchor(heading: str) -> str:
    """The address that forges give to a heading."""
    return "#" + re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def _lines(contents: Contents) -> Iterator[str]:
    yield from (f"# {plain(contents.title)}", "")
    yield from _table(
        ["verdict", "how many", "which means"],
        (
            [plain(f"{each.mark} {each.verdict}"), f"{each.entries}", plain(each.meaning)]
            for each in contents.counts
        ),
    )
    yield from _facts(contents.summary_facts)
    yield from (f"Made by {_code(contents.command)}.", "")
    for paragraph in contents.reading:
        yield from (plain(paragraph), "")
    if contents.files:
        yield from (f"All verdicts and claims as tables: {_links(contents.files)}.", "")
    for chapter in contents.chapters:
        yield from _chapter(chapter)
    if contents.errata:
        yield from ("## Errata", "")
        for erratum in contents.errata:
            yield from _erratum(erratum)
    yield from ("## Assumptions", "")
    yield from _grid(contents.assumptions)
    yield from ("## Environment", "")
    yield from _facts(contents.environment)


def _chapter(chapter: Chapter) -> Iterator[str]:
    yield from (f"## {plain(chapter.name)}: {plain(chapter.title)}", "", plain(chapter.citation), "")
    headings = [
        f"{chapter.name}, {section.name[:1].lower()}{section.name[1:]}" for section in chapter.sections
    ]
    yield from _table(
        ["figure or table", "verdict", "what it shows", "because"],
        (
            [
                f"[{plain(section.name)}]({anchor(heading)})",
                *map(plain, (f"{section.mark} {section.verdict}", section.caption, section.because)),
            ]
            for heading, section in zip(headings, chapter.sections, strict=True)
        ),
    )
    for heading, section in zip(headings, chapter.sections, strict=True):
        yield from (f"### {plain(heading)}", "", plain(section.caption), "")
        yield from _section(section)


def _section(section: Section) -> Iterator[str]:
    verdict = plain(f"{section.mark} {section.verdict}")
    yield from (f"**{verdict}.** {plain(section.because)}", "")
    if section.change:
        yield from (f"What would change it: {plain(section.change)}", "")
    for picture in section.pictures:
        yield from (f"![{plain(picture.name)}]({picture.file})", "")
    if section.claims:
        yield from (*map(_claim, section.claims), "")
    if section.experiments:
        yield from (*map(_experiment, section.experiments), "")


def _claim(claim: Tested) -> str:
    facts = "; ".join(plain(f"{key}: {value}") for key, value in claim.facts)
    test = f" {plain(claim.test)};" if claim.test else ""
    return (
        f"- “{plain(claim.says)}” ({plain(claim.name)}, {plain(claim.origin)}):"
        f" **{plain(claim.outcome)}.**{test} {facts}."
    )


def _experiment(ran: Ran) -> str:
    return f"- [{plain(ran.name)}]({ran.file.address}): {plain(ran.question)} {plain(ran.state)}."


def _erratum(erratum: Corrected) -> Iterator[str]:
    yield from (f"### {plain(erratum.title)}", "")
    yield from (f"- {plain(word)}: {plain(said)}" for word, said in erratum.rows if said)
    yield ""
    if erratum.effects:
        yield from _grid(erratum.effects)
    if erratum.why_not:
        yield from (plain(erratum.why_not), "")


def _facts(pairs: Iterable[tuple[str, str]]) -> Iterator[str]:
    yield from (f"- {plain(key)}: {plain(value)}" for key, value in pairs)
    yield ""


def _grid(table: Table) -> Iterator[str]:
    yield from (plain(table.caption) + ":", "")
    yield from _table(table.columns, ([plain(cell.text) for cell in row] for row in table.rows))


def _table(columns: Iterable[str], rows: Iterable[list[str]]) -> Iterator[str]:
    """Cells of rows are Markdown already."""
    heads = [plain(column) for column in columns]
    yield _row(heads)
    yield _row(["---"] * len(heads))
    yield from map(_row, rows)
    yield ""


def _row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _links(links: Iterable[Link]) -> str:
    return ", ".join(f"[{plain(link.text)}]({link.address})" for link in links)


def _code(text: str) -> str:
    """Code in a fence that is longer than any within."""
    fence = "`" * (1 + max(map(len, re.findall("`+", text)), default=0))
    return f"{fence} {text} {fence}" if "`" in text else f"{fence}{text}{fence}"
