"""Claim: the built site has no broken link or anchor, no formula that failed, and asks nothing of the network.

Needs the packages of the documentation (`make docs` installs them); the test is left out without them.
"""

from __future__ import annotations

import os
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from docs.generator import site
from tests import browser

pytest.importorskip("mkdocs")
pytest.importorskip("material")
pytest.importorskip("latex2mathml")
LOOKED_AT = ("index.html", "filters/moment.html", "filters/third-order.html", "experiment.html", "api.html")


class Page(HTMLParser):
    """Names of anchors, addresses of what is linked to, and of what is loaded."""

    def __init__(self, path: Path):
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.anchors |= {found[key] for key in ("id", "name") if found.get(key)}
        if tag == "a" and found.get("href"):
            self.links.append(found["href"])
        if tag == "link" and found.get("rel") not in ("canonical", "prev", "next"):
            self.loaded.append(found["href"])
        if found.get("src"):
            self.loaded.append(found["src"])


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("built")
    configuration = site.gather(folder)
    command = ["-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(folder / "site")]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(
        [sys.executable, *command, "--config-file", str(configuration)],
        cwd=site.ROOT, env=environment, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr + done.stdout
    return folder / "site"


@pytest.fixture(scope="module")
def parsed(built) -> dict[Path, Page]:
    return {path: Page(path) for path in built.rglob("*.html") if path.name != "404.html"}


def test_every_link_and_anchor_is_there(built, parsed):
    broken, seen = [], 0
    for path, page in parsed.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme:
                continue
            aim = Path(os.path.normpath(path.parent / unquote(parts.path))) if parts.path else path
            seen += 1
            if not aim.exists() or (
                parts.fragment and aim in parsed and parts.fragment not in parsed[aim].anchors
            ):
                broken.append(f"{path.relative_to(built)}: {link}")
    assert broken == []
    assert seen > 5000


def test_links_out_are_addresses(parsed):
    out = {link for page in parsed.values() for link in page.links if urlsplit(link).scheme}
    assert [
        link for link in out if urlsplit(link).scheme != "https" or "." not in urlsplit(link).netloc
    ] == []


def test_nothing_is_loaded_from_elsewhere(parsed):
    assert [each for page in parsed.values() for each in page.loaded if urlsplit(each).netloc] == []


def test_formulas_are_mathml_and_none_is_left_as_it_was_written(built):
    for name in (
        "filters/moment.html",
        "filters/continuous.html",
        "filters/discrete.html",
        "statistics.html",
    ):
        text = (built / name).read_text()
        assert text.count("<math") > 10
        assert "$" not in text.split("<article", 1)[1].split("</article>")[0]
        assert "\\" not in "".join(part.split("</math>")[0] for part in text.split("<math")[1:])


@pytest.mark.skipif(not browser.EXECUTABLE, reason=browser.ABSENT)
@pytest.mark.parametrize("width", [1200, 360])
def test_pages_opened_from_a_folder_ask_nothing_and_fit_the_window(built, width):
    with browser.Browser() as opened:
        for name in LOOKED_AT:
            tab = browser.Tab(opened, built / name, width=width)
            assert [each for each in tab.requests if not each.startswith(("file:", "data:", "blob:"))] == []
            assert tab.complaints == []
            assert tab.run("document.documentElement.scrollWidth <= innerWidth")
            tab.close()


@pytest.mark.skipif(not browser.EXECUTABLE, reason=browser.ABSENT)
def test_the_search_works_from_a_folder(built):
    found = """new Promise((done) => {
        const field = document.querySelector('.md-search__input');
        field.focus(); field.value = 'cubature'; field.dispatchEvent(new KeyboardEvent('keyup', {bubbles: true}));
        field.dispatchEvent(new InputEvent('input', {bubbles: true}));
        const look = (left) => {
            const link = document.querySelector('.md-search-result__link');
            link || !left ? done(link ? link.href : '') : setTimeout(look, 100, left - 1);
        };
        look(100);
    })"""
    with browser.Browser() as opened:
        assert "ckf" in browser.Tab(opened, built / "index.html", width=1400).run(found)
