"""What an experiment file says of its own parameters: which the source only implies, and which are chosen here.

The files say so in comments, in two ways: as clauses with a heading ("Inferred: ... Chosen: ..."), or in passing ("end
printed; steps chosen"). What cannot be told apart is left to the file itself, which the page shows as it is.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

WORDS = ("inferred", "chosen")
HEADING = re.compile(r"\b(printed|inferred|chosen)\s*:\s+", re.IGNORECASE)
PARTS = re.compile(r"(?<=[\w)\]%\"])[.;,]\s+")
COMMENT = re.compile(r"(?:^|\s)#\s*(.*)$")
KEY = re.compile(r"\s*-?\s*([\w-]+)\s*:")
FIRST_KEY = "experiment"  # what stands above it speaks of the whole file
LAST_KEY = "claims"  # what stands below it explains single tests, not parameters


class Standing(NamedTuple):
    """Parameters inferred from the source, and parameters chosen here, each with its reason if there is one."""

    inferred: tuple[str, ...]
    chosen: tuple[str, ...]


def standing(text: str) -> Standing:
    """From the comments of an experiment file."""
    found: dict[str, list[str]] = {word: [] for word in WORDS}
    for subject, comment in _comments(text):
        for word, clause in _clauses(comment):
            clause = _balanced(clause)
            said = f"{subject}: {clause}" if subject and clause else subject or clause
            if said not in found[word]:
                found[word].append(said)
    return Standing(*(tuple(found[word]) for word in WORDS))


def _comments(text: str) -> Iterator[tuple[str, str]]:
    """What each comment is about, and what it says: of a line its code, of lines of comment the next key."""
    block: list[str] = []
    for line in text.splitlines():
        code = COMMENT.sub("", line).strip()
        comment = COMMENT.search(line)
        key = KEY.match(line)
        if comment and not code:
            block.append(comment[1])
            continue
        if key and block:
            yield "" if key[1] == FIRST_KEY else key[1], " ".join(block)
        block = block if not code else []
        if key and key[1] == LAST_KEY and not line[0].isspace():
            return
        if comment:
            yield code.removeprefix("- "), comment[1]


def _clauses(comment: str) -> Iterator[tuple[str, str]]:
    """Each standing with what has it."""
    passing, *headed = HEADING.split(comment)
    for word, clause in zip(headed[::2], headed[1::2], strict=True):
        if word.lower() in WORDS:
            yield word.lower(), clause.strip().rstrip(".;,")
    for part in PARTS.split(passing):
        for word in WORDS:
            if re.search(rf"\b{word}\b", part):
                yield word, "" if part.strip(" .") == word else part.strip(" .")


def _balanced(clause: str) -> str:
    """The clause without parentheses that open or close outside it."""
    kept, opened = list(clause), []
    for place, letter in enumerate(clause):
        if letter == "(":
            opened.append(place)
        elif letter == ")" and opened:
            opened.pop()
        elif letter == ")":
            kept[place] = ""
    for place in opened:
        kept[place] = ""
    return "".join(kept)
