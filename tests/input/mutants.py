"""Experiment files spoiled at random, from all of `configs/`, and what `nlbench validate` answers to them.

`python -m tests.input.mutants [COUNT] [SEED]` tries so many and prints what came of them.
"""

# ruff: noqa: T201 - also a script, which prints what it found
from __future__ import annotations

import collections
import random
import re
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from typer.testing import CliRunner

from nlbench.cli.app import app

CONFIGS = sorted(Path("configs").rglob("*.yaml"))
SCALARS = (
    "true no ~ null .nan .inf -.inf -1 0 1e400 1e-400 -0.0 1_000 010 0x1F 12:30:00 2026-01-01 1e6 [] {} '' \"\\u202e\" "
    "&a *a *b !!python/object/apply:os.system !!binary !own << - ? | > ../../up /etc/passwd . .. con a/../../b "
    "<script>alert(1)</script> javascript:alert(1) =1+1 @x \U0001f600 \u0301 x\u0000y rms third-order exact "
    "culver-scalar"
).split(" ") + [
    "9" * 400,
    "9" * 5000,
    "x" * 3000,
    "[" * 300,
    "{a: " * 200,
    "- " * 200,
    "\t",
    "\x1b[31m",
    "\r",
    "a: b: c",
]
CHARACTERS = " \t\n\r:-?[]{},&*!|>'\"%@`#~\\0a\x00\x07\x1b\x85\u2028\ufeff\ud7ff\U0001f600"
TOKEN = re.compile(r"[^\s,:\[\]{}]+")
WORD = re.compile(r"[A-Za-z_][\w-]*")


class Answer(NamedTuple):
    """Exit code, what was printed, and the seconds that it took."""

    code: int
    said: str
    seconds: float


def mutant(number: int, seed: int = 1969) -> bytes:
    """A file spoiled one to four times; the same for the same numbers."""
    chance = random.Random(f"{seed}/{number}")
    text = chance.choice(CONFIGS).read_text()
    for _ in range(chance.choice([1, 1, 1, 2, 2, 3, 4])):
        text = chance.choice(MUTATIONS)(chance, text)
    content = text.encode("utf-8", "surrogatepass")
    return chance.choice(ENCODINGS)(chance, content) if chance.random() < 0.1 else content


def answer(path: Path) -> Answer:
    """What `nlbench validate` says of a file."""
    begun = time.perf_counter()
    result = CliRunner().invoke(app, ["validate", str(path)])
    return Answer(result.exit_code, result.output, time.perf_counter() - begun)


def faults(path: Path, given: Answer, folder: list[str]) -> list[str]:
    """What is wrong with an answer; `folder` is what lay beside the file before."""
    printable = all(each.isprintable() or each == "\n" for each in given.said)
    found = {
        f"exit code {given.code}": given.code not in (0, 2),
        "a traceback": "Traceback" in given.said or "internal error" in given.said,
        "an unprintable character": not printable,
        "no word": not given.said.strip(),
        "a line of more than 1,000 characters": max(map(len, given.said.split("\n"))) > 1000,
        "no name of the file": given.code == 2 and path.name not in given.said,
        "another file": sorted(each.name for each in path.parent.iterdir()) != folder,
    }
    return [name for name, holds in found.items() if holds]


def _token(chance: random.Random, text: str) -> str:
    """Another value in the place of some word or number."""
    places = list(TOKEN.finditer(text))
    if not places:
        return text
    place = chance.choice(places)
    return text[: place.start()] + chance.choice(SCALARS) + text[place.end() :]


def _misspelt(chance: random.Random, text: str) -> str:
    """A word with two letters exchanged, one lost or one doubled."""
    places = [place for place in WORD.finditer(text) if len(place[0]) > 2]
    if not places:
        return text
    place = chance.choice(places)
    word, at = place[0], chance.randrange(len(place[0]) - 1)
    spoiled = chance.choice(
        [word[:at] + word[at + 1] + word[at] + word[at + 2 :], word[:at] + word[at + 1 :], word + word]
    )
    return text[: place.start()] + spoiled + text[place.end() :]


def _lines(chance: random.Random, text: str) -> str:
    """A line lost, doubled, moved, indented or joined with the next."""
    lines = text.split("\n")
    at = chance.randrange(len(lines))
    line = lines.pop(at)
    kind = chance.randrange(5)
    if kind == 1:
        lines[at:at] = [line, line]
    elif kind == 2:
        lines.insert(chance.randrange(len(lines) + 1), line)
    elif kind == 3:
        lines.insert(at, chance.choice([" ", "   ", "\t", "- ", "#", "? "]) + line)
    elif kind == 4:
        lines.insert(at, line.strip())
    return "\n".join(lines)


def _character(chance: random.Random, text: str) -> str:
    """A character put in, or in the place of another."""
    at = chance.randrange(len(text) + 1)
    return text[:at] + chance.choice(CHARACTERS) + text[at + chance.randrange(2) :]


def _cut(chance: random.Random, text: str) -> str:
    """A part lost, or the rest of the file."""
    at = chance.randrange(len(text) + 1)
    return text[:at] + chance.choice([text[at + chance.randrange(200) :], ""])


def _key(chance: random.Random, text: str) -> str:
    """A key more, at the top or in front of a line; two documents; a bomb of aliases."""
    bomb = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"{after}: &{after} [{', '.join([f'*{before}'] * 9)}]\n"
        for before, after in zip("abcdefgh", "bcdefghi", strict=True)
    )
    keys = [
        "seed: 1",
        "runs: 5",
        "plugins: [x.py]",
        "a: &a [*a]",
        "<<: *a",
        "<<: {a: 1}",
        "---",
        "...",
        "%YAML 1.1",
        bomb,
    ]
    more = f"{chance.choice(keys)}\n"
    return more + text if chance.random() < 0.5 else f"{text}\n{more}"


MUTATIONS: tuple[Callable[[random.Random, str], str], ...] = (
    _token,
    _token,
    _token,
    _misspelt,
    _lines,
    _character,
    _cut,
    _key,
)
ENCODINGS: tuple[Callable[[random.Random, bytes], bytes], ...] = (
    lambda chance, content: content.replace(b"\n", b"\r\n"),
    lambda chance, content: b"\xef\xbb\xbf" + content,
    lambda chance, content: content.decode("utf-8", "replace").encode("utf-16"),
    lambda chance, content: bytes(chance.randrange(256) for _ in range(chance.randrange(2000))),
    lambda chance, content: content[: chance.randrange(len(content) + 1)] + b"\xff\xfe" + content[-100:],
    lambda chance, content: content * (1 + 300_000 // max(len(content), 1)),
)


def main(count: int, seed: int) -> int:
    """Try so many; print how many were valid, refused and answered wrongly, the slowest and the longest answer."""
    codes: collections.Counter[int] = collections.Counter()
    wrong = 0
    slowest, longest = 0.0, 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mutant.yaml"
        for number in range(count):
            path.write_bytes(mutant(number, seed))
            given = answer(path)
            codes[given.code] += 1
            slowest, longest = max(slowest, given.seconds), max(longest, len(given.said))
            if found := faults(path, given, [path.name]):
                wrong += 1
                print(f"mutant {number}: {', '.join(found)}: {given.said[-300:]!r}")
    print(
        f"{count:,} mutants of {len(CONFIGS)} files: {codes[0]:,} valid, {codes[2]:,} refused, {wrong:,} wrong"
    )
    print(f"slowest answer {slowest:.2f} s, longest {longest:,} characters")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(*(int(each) for each in (*sys.argv[1:], *("10000", "1969")[len(sys.argv) - 1 :]))))
