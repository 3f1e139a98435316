"""A picture's SVG in few bytes, for keeping under version control: it looks the same, and says the same in words.

Letters stay outlines, which look the same on every machine. Numbers are rounded to what can be seen, points that no eye
misses on a straight line are left out, and so is whatever repeats or means nothing.
"""

from __future__ import annotations

import hashlib
import re
import xml.etree.ElementTree as ET
from collections import Counter
from itertools import count

from nlbench.figures.outline import extent, number, shortened

SVG = "http://www.w3.org/2000/svg"
DECIMALS = 2  # of a position in points
LARGE = 20.0  # points; a larger outline is a curve or an area, with one decimal less and points left out
TOLERANCE = 0.1  # points: a thirteenth of the width of a curve
GLYPH = "scale(0.015625)"  # of the outline of a letter, which matplotlib gives in 64ths
GLYPH_CELL = 16  # 64ths, to which the outline of a letter is rounded: .02 points in letters of 8
LETTERS = "abcdefghijklmnopqrstuvwxyz0123456789"
NUMBER = re.compile(r"-?\d+\.\d+")
REFERENCE = re.compile(r"url\(#([^)]+)\)")


def small(svg: bytes) -> bytes:
    """The same picture. Identifiers are its own, whatever page it is put into; title and description stay."""
    root = ET.fromstring(svg)
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
        element.attrib = {key.rpartition("}")[2]: value for key, value in element.attrib.items()}
        element.text, element.tail = (element.text or "").strip(), ""
    for group in root.iter("g"):
        if "matplotlib.axis" in group.get("id", ""):
            _join_lines(group)
    _rename(root, "".join(LETTERS[byte % 26] for byte in hashlib.sha256(svg).digest()[:5]))
    for element in root.iter():
        _round(element)
    _inherit(root)
    _flatten(root)
    root.attrib.pop("version", None)
    root.attrib = {"xmlns": SVG, **root.attrib}
    return (ET.tostring(root, encoding="unicode").replace(" />", "/>") + "\n").encode()


def _join_lines(axis: ET.Element) -> None:
    """The lines of the grid of an axis as one outline; nothing else of an axis lies under them."""
    alike: dict[tuple[str, str], ET.Element] = {}
    for tick in axis.iter("g"):
        for line in [child for child in tick if child.tag == "path" and "clip-path" in child.attrib]:
            first = alike.setdefault((line.attrib["clip-path"], line.get("style", "")), line)
            if first is not line:
                first.set("d", f"{first.attrib['d']} {line.attrib['d']}")
                tick.remove(line)


def _references(element: ET.Element) -> list[str]:
    """Identifiers that the element names."""
    found = element.get("aria-labelledby", "").split()
    if element.get("href"):
        found.append(element.attrib["href"][1:])
    return found + [name for value in element.attrib.values() for name in REFERENCE.findall(value)]


def _rename(root: ET.Element, prefix: str) -> None:
    """Short identifiers, and none where nothing refers to it; the most used are the shortest."""
    used = Counter(name for element in root.iter() for name in _references(element))
    names = {old: f"{prefix}{place}" for (old, _), place in zip(used.most_common(), count())}
    for element in root.iter():
        if "id" in element.attrib:
            old = element.attrib.pop("id")
            element.attrib |= {"id": names[old]} if old in names else {}
        for key, value in element.attrib.items():
            if key == "href":
                element.set(key, "#" + names[value[1:]])
            elif key == "aria-labelledby":
                element.set(key, " ".join(names[name] for name in value.split()))
            else:
                element.set(key, REFERENCE.sub(lambda found: f"url(#{names[found[1]]})", value))


def _round(element: ET.Element) -> None:
    """Numbers and styles of an element."""
    if "d" in element.attrib:
        letter = element.get("transform") == GLYPH
        large = not letter and extent(element.attrib["d"]) > LARGE
        cell, decimals = (GLYPH_CELL, 0) if letter else (1, DECIMALS - large)
        element.set("d", shortened(element.attrib["d"], cell, decimals, TOLERANCE if large else 0.0))
        if letter:
            element.set("transform", f"scale({number(GLYPH_CELL / 64, 5)})")
    if element.tag == "use" and element.get("transform", "").startswith("translate("):
        x, y = element.attrib.pop("transform")[10:-1].split()
        element.attrib |= {"x": x, "y": y}
    for key in ("x", "y", "width", "height", "transform"):
        if key in element.attrib:
            element.set(key, _rounded(element.attrib[key]))
        if element.tag == "use" and element.get(key) == "0":
            del element.attrib[key]
    if "style" in element.attrib:
        style = re.sub(r"\s*([:;])\s*", r"\1", element.attrib["style"]).rstrip(";")
        element.set("style", re.sub(r"#([0-9a-f])\1([0-9a-f])\2([0-9a-f])\3", r"#\1\2\3", _rounded(style)))


def _rounded(text: str) -> str:
    """Numbers below 1, which may be scales, keep more of their digits."""
    return NUMBER.sub(lambda n: number(float(n[0]), DECIMALS if abs(float(n[0])) >= 1 else 5), text)


def _inherit(root: ET.Element) -> None:
    """Without styles that the element referred to sets itself, or that all children of a group have in common."""
    parts = {element.get("id"): _style(element) for element in root.iter() if element.get("id")}
    for element in root.iter("use"):
        own = parts.get(element.get("href", "")[1:], {})
        _restyle(element, {key: value for key, value in _style(element).items() if key not in own})
    for group in root.iter("g"):
        styles = {child.get("style") for child in group}
        if len(group) > 1 and len(styles) == 1 and "style" not in group.attrib:
            (style,) = styles
            if style and "opacity" not in _style(group[0]):
                group.set("style", style)
                for child in group:
                    del child.attrib["style"]


def _style(element: ET.Element) -> dict[str, str]:
    pairs = (part.partition(":") for part in element.get("style", "").split(";") if part)
    return {key: value for key, _, value in pairs}


def _restyle(element: ET.Element, style: dict[str, str]) -> None:
    element.attrib.pop("style", None)
    if style:
        element.set("style", ";".join(f"{key}:{value}" for key, value in style.items()))


def _flatten(element: ET.Element) -> None:
    """Without groups that say nothing and definitions of nothing."""
    children: list[ET.Element] = []
    for child in element:
        _flatten(child)
        if child.tag == "g" and not child.attrib:
            children.extend(child)
        elif len(child) or child.attrib or child.text:
            children.append(child)
    element[:] = children
