"""Mathematics between dollar signs as MathML, which browsers draw themselves: a Python-Markdown extension."""

from __future__ import annotations

import re
from typing import Any
from xml.etree.ElementTree import Element

from latex2mathml.converter import convert
from markdown import Markdown
from markdown.extensions import Extension
from markdown.inlinepatterns import InlineProcessor
from markdown.preprocessors import Preprocessor

DISPLAY = re.compile(r"^\$\$\n(.*?)\n\$\$$", re.DOTALL | re.MULTILINE)


class Displayed(Preprocessor):
    """$$ on a line of its own, the formula, and $$ again."""

    def run(self, lines: list[str]) -> list[str]:
        def stashed(found: re.Match[str]) -> str:
            formula = convert(found.group(1), display="block")
            held = self.md.htmlStash.store(f'<div class="formula">{formula}</div>')
            return f"\n{held}\n"

        return DISPLAY.sub(stashed, "\n".join(lines)).split("\n")


class Inline(InlineProcessor):
    """$...$ within a line; one before a space opens no formula and one after a space closes none."""

    def handleMatch(self, m: re.Match[str], data: str) -> tuple[str | Element, int, int]:
        return self.md.htmlStash.store(convert(m.group(1))), m.start(0), m.end(0)


class MathML(Extension):
    """The extension."""

    def extendMarkdown(self, md: Markdown) -> None:
        # After fenced code was put aside (25) and before HTML is (20); inline after code spans (190).
        md.preprocessors.register(Displayed(md), "mathml-display", 22)
        md.inlinePatterns.register(Inline(r"\$(?!\s)([^$\n]+?)(?<!\s)\$", md), "mathml", 185)


def makeExtension(**options: Any) -> MathML:
    """Called by Python-Markdown."""
    return MathML(**options)
