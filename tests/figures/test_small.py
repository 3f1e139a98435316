"""Claim: a small SVG says the same and looks the same to a tenth of a point, in fewer bytes."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from nlbench import figures
from nlbench.figures.outline import needed, number, shortened
from nlbench.figures.small import small
from tests import synthetic_run

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    run = synthetic_run.results(tmp_path_factory.mktemp("run"), diverged={"third-order": 37})
    kinds = ["rms", "variance", "divergence"]
    return [path.read_bytes() for path in figures.draw(run, kinds) if path.suffix == ".svg"]


def absolute(outline):
    """The corners of an outline of relative commands, by the rules of SVG: a list for each stretch."""
    stretches, here, letter = [], np.zeros(2), ""
    tokens = re.findall(r"[a-z]|-?(?:\d+\.?\d*|\.\d+)", outline)
    while tokens:
        if tokens[0].isalpha():
            letter = tokens.pop(0)
        if letter == "z":
            here = stretches[-1][0]
            continue
        if letter in "hv":
            step = float(tokens.pop(0))
            steps = [np.array([step, 0.0] if letter == "h" else [0.0, step])]
        else:
            count = {"m": 1, "l": 1, "q": 2, "c": 3}[letter]
            steps = [np.array([float(tokens.pop(0)), float(tokens.pop(0))]) for _ in range(count)]
        if letter == "m":
            stretches.append([])
            letter = "l"
        stretches[-1] += [here + step for step in steps]
        here = stretches[-1][-1]
    return [np.array(points) for points in stretches]


def distance(point, line):
    """From a point to a broken line."""
    a, b = line[:-1], line[1:]
    along = b - a
    share = np.clip(((point - a) * along).sum(1) / np.maximum((along**2).sum(1), 1e-30), 0, 1)
    return np.hypot(*(a + share[:, None] * along - point).T).min()


def parsed(svg):
    root = ET.fromstring(svg)
    words = [root.find(f"{SVG}{name}").text for name in ("title", "desc")]
    ids = [element.get("id") for element in root.iter() if element.get("id")]
    named = root.get("aria-labelledby").split()
    for element in root.iter():
        for key, value in element.attrib.items():
            named += [value[1:]] if key.rpartition("}")[2] == "href" else re.findall(r"url\(#(.*?)\)", value)
    return root, words, ids, named


def dashed(svg):
    """Outlines of the curves of one filter."""
    paths = parsed(svg)[0].iter(f"{SVG}path")
    return [path.get("d") for path in paths if path.get("clip-path") and "dasharray" in path.get("style", "")]


def test_it_is_less_than_half_as_large_and_says_the_same(drawn):
    for svg in drawn:
        less = small(svg)
        assert len(less) < 0.45 * len(svg)
        assert parsed(less)[1] == parsed(svg)[1]
        assert {key: parsed(less)[0].get(key) for key in ("role", "viewBox", "style")} == {
            key: parsed(svg)[0].get(key) for key in ("role", "viewBox", "style")
        }


def test_every_identifier_is_used_and_no_two_pictures_share_one(drawn):
    seen = set()
    for svg in drawn:
        _, _, ids, named = parsed(small(svg))
        assert len(ids) == len(set(ids))
        assert set(ids) == set(named)
        assert not seen & set(ids)
        seen |= set(ids)


def test_letters_and_marks_stay_where_they_are(drawn):
    """As many as before, each to a hundredth; the order of drawing is that of the file."""
    for svg in drawn:
        before, after = (list(parsed(each)[0].iter(f"{SVG}use")) for each in (svg, small(svg)))
        assert len(before) == len(after)
        for old, new in zip(before, after, strict=True):
            x, y = old.get("x", "0"), old.get("y", "0")
            if old.get("transform"):
                x, y = re.fullmatch(r"translate\((\S+) (\S+)\)", old.get("transform")).groups()
            assert float(new.get("x", "0")) == pytest.approx(float(x), abs=0.00501)
            assert float(new.get("y", "0")) == pytest.approx(float(y), abs=0.00501)


def test_curves_pass_within_two_tenths_of_every_point_of_theirs(drawn):
    for svg in drawn:
        curves, less = dashed(svg), [absolute(outline) for outline in dashed(small(svg))]
        assert len(curves) == len(less)
        for old, new in zip(curves, less, strict=True):
            points = np.array(re.findall(r"-?[\d.]+", old), float).reshape(-1, 2)
            line = np.concatenate(new)
            if len(line) > 1:
                assert max(distance(point, line) for point in points) < 0.1 + 0.05 * 2**0.5 + 1e-9


def test_the_same_picture_gives_the_same_bytes_and_another_does_not(drawn):
    assert small(drawn[0]) == small(drawn[0])
    assert small(drawn[0]) != small(drawn[1])


def test_any_label_survives(tmp_path):
    labels = ["$\\frac{$", "<script>&\"'", "url(#here) #there", "100 % />"]
    run = synthetic_run.results(tmp_path, dict.fromkeys(labels, 1.2))
    for path in figures.draw(run, ["rms"]):
        if path.suffix == ".svg":
            words = ET.fromstring(small(path.read_bytes())).find(f"{SVG}desc").text
            assert all(label in words for label in labels)


@pytest.mark.parametrize(
    ("outline", "expected"),
    [
        ("M 1 2 \nL 4 2 \nL 4 7 \nL 1 2 \nz", "m1 2h3v5l-3-5z"),
        ("M 0.5 -0.25 \nL 1.25 -0.5", "m.5-.25 .75-.25"),
        ("M 1 1 \nL 2 2 \nM 5 5 \nL 6 5", "m1 1 1 1m3 3h1"),
        ("M 0 0 \nQ 1 2 3 4 \nQ 5 5 6 6 \nz \nM 1 1 \nL 2 3", "m0 0q1 2 3 4 2 1 3 2zm1 1 1 2"),
        ("M 0 0 \nC 1 0 2 1 2 2 \nL 2 2.001", "m0 0c1 0 2 1 2 2"),
    ],
)
def test_an_outline_is_written_in_steps(outline, expected):
    assert shortened(outline, 1, 2, 0.0) == expected


def test_rounding_errors_do_not_add_up():
    points = np.c_[0.0333 * np.arange(400), 0.0777 * np.arange(400) % 1]
    outline = "M " + " L ".join(f"{x} {y}" for x, y in points)
    (line,) = absolute(shortened(outline, 1, 1, 0.0))
    np.testing.assert_allclose(line[-1], points[-1], atol=0.051)


def test_points_on_a_straight_line_are_left_out_and_a_corner_is_not():
    points = np.array([[0, 0], [1, 0.01], [2, -0.01], [3, 0], [3, 4], [3, 2]], float)
    np.testing.assert_array_equal(needed(points, 0.02), [True, False, False, True, True, True])
    np.testing.assert_array_equal(needed(points, 0.005), [True] * 6)


@pytest.mark.parametrize(
    ("value", "decimals", "expected"),
    [
        (0.5, 2, ".5"),
        (-0.25, 2, "-.25"),
        (10.0, 2, "10"),
        (100.0, 0, "100"),
        (-0.001, 2, "0"),
        (1.005, 1, "1"),
    ],
)
def test_numbers_are_written_short(value, decimals, expected):
    assert number(value, decimals) == expected
