"""Claim: a real browser shows the page of a reproduction to all readers: keyboard, screen reader, phone and paper."""

from __future__ import annotations

import pytest

from nlbench.reproduce import page
from nlbench.reproduce.verdicts import VERDICTS
from tests import synthetic_summary
from tests.browser import ABSENT, EXECUTABLE, Browser, Tab

pytestmark = pytest.mark.skipif(not EXECUTABLE, reason=ABSENT)

ENTRIES = 7  # of each source
LONG = ("order three beats order two", "W" * 300)
ROWS = "[...document.querySelectorAll('#all tbody tr')]"
SHOWN = f"{ROWS}.filter(row => row.checkVisibility()).length"
FOCUSED = "document.activeElement"


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page") / "results" / "reproduction"
    folder.mkdir(parents=True)
    return page.write(synthetic_summary.summary(folder, LONG, ENTRIES), folder)


@pytest.fixture(scope="module")
def browser():
    with Browser() as started:
        yield started


@pytest.fixture
def tab(browser, path):
    opened = Tab(browser, path)
    yield opened
    opened.close()


def test_nothing_stands_in_the_console_and_nothing_is_asked_for(tab, path):
    assert tab.run("[...document.images].every(each => each.complete && each.naturalWidth > 0)")
    assert not tab.complaints
    assert {address for address in tab.requests if not address.startswith("data:")} == {path.as_uri()}


def test_every_link_within_the_page_leads_to_what_can_be_seen(tab):
    links = "[...document.querySelectorAll('a[href^=\"#\"]')].map(each => each.getAttribute('href'))"
    for address in set(tab.run(links)):
        tab.run(f"location.hash = '{address}'")
        top = tab.run(f"document.querySelector('{address}').getBoundingClientRect().top")
        at_end = tab.run("innerHeight + scrollY >= document.documentElement.scrollHeight - 1")
        assert abs(top) < 2 or at_end, address


def test_the_first_key_skips_to_the_table(tab):
    tab.press("Tab")
    assert tab.run(f"{FOCUSED}.textContent") == "Skip to the table of all figures"
    assert tab.run(f"getComputedStyle({FOCUSED}).outlineStyle") == "solid"
    assert tab.run(f"{FOCUSED}.getBoundingClientRect().left") >= 0
    tab.press("Enter")
    assert tab.run("location.hash") == "#all"


def test_tables_are_sorted_with_the_keyboard_alone(tab):
    _tab_to(tab, f"{FOCUSED}.matches('#all th button') && {FOCUSED}.textContent == 'verdict'")
    verdicts = f"{ROWS}.map(row => row.cells[1].textContent.slice(2))"
    order = [VERDICTS.index(each) for each in tab.run(verdicts)]
    assert order != sorted(order)
    tab.press("Enter")
    assert [VERDICTS.index(each) for each in tab.run(verdicts)] == sorted(order)
    assert tab.run(f"{FOCUSED}.parentElement.getAttribute('aria-sort')") == "ascending"
    tab.press("Enter")
    assert [VERDICTS.index(each) for each in tab.run(verdicts)] == sorted(order, reverse=True)


def test_rows_are_chosen_by_verdict_and_source_with_the_keyboard_alone(tab):
    assert tab.run(SHOWN) == 2 * ENTRIES
    _tab_to(tab, f"{FOCUSED}.name == 'verdict'")
    for chosen in (4, 4, 2):  # of seven, the first two of five verdicts come twice
        tab.press("ArrowRight")
        assert tab.run(SHOWN) == chosen
    _tab_to(tab, f"{FOCUSED}.name == 'source'")
    tab.press("ArrowRight")
    assert tab.run(SHOWN) == 1


def test_a_figure_opens_from_the_table_with_one_key(tab):
    _tab_to(tab, f"{FOCUSED}.matches('#all tbody a')")
    tab.press("Enter")
    assert tab.run("location.hash") == "#culver-1969-figure-7-1"


def test_a_screen_reader_hears_the_verdict_of_every_picture(tab):
    names = tab.names("image")
    tested = [verdict for place in range(ENTRIES) if (verdict := VERDICTS[place % 5]) != "NOT TESTABLE"]
    assert len(names) == 2 * len(tested)
    for name, verdict in zip(names, 2 * tested, strict=True):
        assert f", {verdict}, claimed: " in name


def test_a_screen_reader_finds_landmarks_and_names(tab):
    assert tab.names("navigation") == [
        "Parts of the page",
        "Figures and tables of Culver 1969",
        "Figures and tables of Schwartz 1967",
    ]
    assert len(tab.names("main")) == len(tab.names("banner")) == 1
    for role in ("table", "region", "link", "button", "radio", "group"):
        names = tab.names(role)
        assert names, role
        assert role == "group" or all(names), role


@pytest.mark.parametrize("width", [320, 360, 768])
def test_nothing_is_wider_than_a_phone(browser, path, width):
    tab = Tab(browser, path, width=width, height=800)
    tab.run("document.querySelectorAll('details').forEach(each => each.open = true)")
    assert tab.run("document.documentElement.scrollWidth") <= width
    tab.close()


@pytest.mark.parametrize("dark", [False, True])
def test_text_stands_out_from_what_is_behind_it(browser, path, dark):
    """A contrast of 4.5, which the Web Content Accessibility Guidelines 2.2 (1.4.3) ask for."""
    tab = Tab(browser, path, dark=dark)
    colours = tab.run(
        "[...document.querySelectorAll('p, td, dd, dt, a, b, .note, h1, h2, h3, label')].map(each => {"
        " let behind = each; while (getComputedStyle(behind).backgroundColor == 'rgba(0, 0, 0, 0)') behind ="
        " behind.parentElement; return [getComputedStyle(each).color, getComputedStyle(behind).backgroundColor]; })"
    )
    for front, behind in {tuple(pair) for pair in colours}:
        light, shade = sorted((_luminance(front), _luminance(behind)), reverse=True)
        assert (light + 0.05) / (shade + 0.05) >= 4.5, (front, behind)
    tab.close()


def test_on_paper_details_are_open_and_each_file_is_printed_once(tab):
    file = "getComputedStyle(each.querySelector('pre')).display != 'none' && each.querySelector('pre')"
    opened = f"[...document.querySelectorAll('.entry details:has(pre)')].filter(each => {file}"
    assert tab.run(f"{opened}.checkVisibility({{contentVisibilityAuto: false}})).length") == 0
    tab.call("Emulation.setEmulatedMedia", media="print")
    assert tab.run(f"{opened}.checkVisibility()).length") == 3
    words = "[...document.querySelectorAll('figcaption details p')]"
    assert tab.run(f"{words}.every(each => each.checkVisibility())")
    assert not tab.run("[...document.querySelectorAll('nav, .filters')].some(each => each.checkVisibility())")


def _tab_to(tab, found):
    for _ in range(200):
        if tab.run(found):
            return
        tab.press("Tab")
    raise AssertionError(f"no key leads to {found}")


def _luminance(colour):
    """Relative luminance of `rgb(r, g, b)`."""
    channels = [float(each) / 255 for each in colour.removeprefix("rgb(").rstrip(")").split(",")]
    linear = [each / 12.92 if each <= 0.04045 else ((each + 0.055) / 1.055) ** 2.4 for each in channels]
    return sum(weight * each for weight, each in zip((0.2126, 0.7152, 0.0722), linear, strict=True))
