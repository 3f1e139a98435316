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
    "0x" + "f" * 300,
    "0x" + "f" * 4000,
    "1_000.5",
    "1e200",
    "-1e200",
    "1e-320",
    "!!seq {a: 1}",
    "!!map [a, b]",
    "!!str [a]",
    "!!float x",
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
NUMBERS = (
    "1e200",
    "-1e200",
    "1e-200",
    "1e-320",
    ".inf",
    "-.inf",
    "9" * 400,
    "0x" + "f" * 4000,
    "1e30",
    "1" + 30 * "0",
)
LINE_ENDS = ("\r", "\r\n", "\x85", "\u2028", "\u2029")
TAGS = ("!!seq", "!!map", "!!str", "!!int", "!!float", "!!null", "!!set", "!!omap", "!evil", "!")
NUMBER = re.compile(r"(?<![\w.-])[-+]?\.?\d[\w.+-]*")
VALUE = re.compile(r"(?<=[:\-,] )\S|(?<=[\[{])\S")
KEY = re.compile(r"[\w-]+:(?=\s)")
TOKEN = re.compile(r"[^\s,:\[\]{}]+")
LINE = re.compile(r"\n")
WORD = re.compile(r"[A-Za-z_][\w-]*")


def token(chance: random.Random, text: str) -> str:
    """Another value in the place of some word or number."""
    return _at_some(TOKEN, chance, text, lambda found: chance.choice(SCALARS))


def number(chance: random.Random, text: str) -> str:
    """In the place of a number one that is next to nothing, next to infinite or of hundreds of digits."""
    return _at_some(NUMBER, chance, text, lambda found: chance.choice(NUMBERS))


def tag(chance: random.Random, text: str) -> str:
    """A tag in front of a key or a value, mostly of another kind."""
    return _at_some(chance.choice([KEY, VALUE]), chance, text, lambda found: f"{chance.choice(TAGS)} {found}")


def line_ends(chance: random.Random, text: str) -> str:
    """Lines that end in another way: all of them, or one."""
    end = chance.choice(LINE_ENDS)
    return (
        text.replace("\n", end) if chance.random() < 0.5 else _at_some(LINE, chance, text, lambda found: end)
    )


def _at_some(what: re.Pattern[str], chance: random.Random, text: str, instead: Callable[[str], str]) -> str:
    """One of the places that match with something instead; the text as it is where none does."""
    places = list(what.finditer(text))
    if not places:
        return text
    place = chance.choice(places)
    return text[: place.start()] + instead(place[0]) + text[place.end() :]


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
    number,
    tag,
    line_ends,
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
