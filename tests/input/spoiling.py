"""Ways to spoil a text or its bytes at random, whatever it says."""

from __future__ import annotations

import random
import re
from collections.abc import Callable

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


def token(chance: random.Random, text: str) -> str:
    """Another value in the place of some word or number."""
    places = list(TOKEN.finditer(text))
    if not places:
        return text
    place = chance.choice(places)
    return text[: place.start()] + chance.choice(SCALARS) + text[place.end() :]


def misspelt(chance: random.Random, text: str) -> str:
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


def lines(chance: random.Random, text: str) -> str:
    """A line lost, doubled, moved, indented or joined with the next."""
    parts = text.split("\n")
    at = chance.randrange(len(parts))
    line = parts.pop(at)
    kind = chance.randrange(5)
    if kind == 1:
        parts[at:at] = [line, line]
    elif kind == 2:
        parts.insert(chance.randrange(len(parts) + 1), line)
    elif kind == 3:
        parts.insert(at, chance.choice([" ", "   ", "\t", "- ", "#", "? "]) + line)
    elif kind == 4:
        parts.insert(at, line.strip())
    return "\n".join(parts)


def character(chance: random.Random, text: str) -> str:
    """A character put in, or in the place of another."""
    at = chance.randrange(len(text) + 1)
    return text[:at] + chance.choice(CHARACTERS) + text[at + chance.randrange(2) :]


def cut(chance: random.Random, text: str) -> str:
    """A part lost, or the rest of the file."""
    at = chance.randrange(len(text) + 1)
    return text[:at] + chance.choice([text[at + chance.randrange(200) :], ""])


TEXTS: tuple[Callable[[random.Random, str], str], ...] = (
    token,
    token,
    token,
    misspelt,
    lines,
    character,
    cut,
)
ENCODINGS: tuple[Callable[[random.Random, bytes], bytes], ...] = (
    lambda chance, content: content.replace(b"\n", b"\r\n"),
    lambda chance, content: b"\xef\xbb\xbf" + content,
    lambda chance, content: content.decode("utf-8", "replace").encode("utf-16"),
    lambda chance, content: bytes(chance.randrange(256) for _ in range(chance.randrange(2000))),
    lambda chance, content: content[: chance.randrange(len(content) + 1)] + b"\xff\xfe" + content[-100:],
    lambda chance, content: content * (1 + 300_000 // max(len(content), 1)),
)


def spoiled(chance: random.Random, text: str, ways: tuple[Callable[[random.Random, str], str], ...]) -> bytes:
    """The text spoiled one to four times in some of these ways, and one in ten as another kind of bytes."""
    for _ in range(chance.choice([1, 1, 1, 2, 2, 3, 4])):
        text = chance.choice(ways)(chance, text)
    content = text.encode("utf-8", "surrogatepass")
    return chance.choice(ENCODINGS)(chance, content) if chance.random() < 0.1 else content
