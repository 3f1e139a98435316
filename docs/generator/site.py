"""Gathers written and generated pages in one folder, with what they link to, and writes the navigation."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

from docs.generator import api, commands, experiment, filters, systems
from nlbench import systems as registry
from nlbench.filters import catalogue

ROOT = Path(__file__).parents[2]
WRITTEN = ROOT / "docs"
LINK = re.compile(r"(?<!`)\]\(([^)#\s:]+)(#[^)\s]*)?\)")
SKIPPED = {"generator", "__pycache__"}
# Pages that stand elsewhere in the repository.
ELSEWHERE = {
    "CONTRIBUTING.md": "extending.md",
    "results/reproduction/README.md": "results/reproduction/README.md",
}
NAVIGATION: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("Start", ("index.md", "start.md", "tutorial.md")),
    ("Concepts", ("concepts.md", "statistics.md", "findings.md")),
    ("Filters", ("filters/index.md", "filters/moment.md", "filters/continuous.md", "filters/discrete.md")),
    ("Systems", ("systems/index.md",)),
    ("Reproduction", ("reproduction.md", "results/reproduction/README.md")),
    ("Running", ("cluster.md", "performance.md")),
    ("Reference", ("experiment.md", "commands.md", "api.md")),
    ("Extending", ("extending.md",)),
)


def gather(target: Path) -> Path:
    """All pages in `target`/pages, and the path of the configuration that builds them, which holds their navigation."""
    pages = target / "pages"
    shutil.rmtree(pages, ignore_errors=True)
    _copy_written(pages)
    for source, place in ELSEWHERE.items():
        _write(pages / place, (ROOT / source).read_text(encoding="utf-8"), ROOT / source, pages)
    for place, text in generated(pages).items():
        (pages / place).parent.mkdir(parents=True, exist_ok=True)
        (pages / place).write_text(text, encoding="utf-8")
    configuration = target / "mkdocs.yml"
    back = os.path.relpath(ROOT / "mkdocs.yml", target)
    settings = {
        "INHERIT": back,
        "docs_dir": "pages",
        "site_dir": os.path.relpath(ROOT / "site", target),
        "nav": navigation(pages),
    }
    configuration.write_text(json.dumps(settings, indent=1), encoding="utf-8")  # JSON is YAML
    return configuration


def generated(pages: Path) -> dict[str, str]:
    """The pages that follow from the code, by their place; some go on from what was written."""
    notes = filters.notes()

    def continued(name: str, page: Callable[[str], str]) -> str:
        return page((pages / name).read_text(encoding="utf-8"))

    return {
        **{f"filters/{name}.md": filters.page(name, notes[name]) for name in catalogue.available()},
        "filters/index.md": continued("filters/index.md", lambda text: text + "\n" + filters.overview()),
        **{f"systems/{name}.md": systems.page(name) for name in registry.available()},
        "systems/index.md": continued("systems/index.md", lambda text: text + "\n" + systems.overview()),
        "experiment.md": continued("experiment.md", experiment.page),
        "commands.md": continued("commands.md", commands.page),
        "api.md": continued("api.md", api.page),
    }


def navigation(pages: Path) -> list[dict[str, list]]:
    """The menu; pages that are not there are left out, and decisions and each filter and system put in."""
    menu: list[dict[str, list]] = []
    for title, names in NAVIGATION:
        entries: list = [name for name in names if (pages / name).exists()]
        if title == "Filters":
            entries.append({"All filters": [f"filters/{name}.md" for name in catalogue.available()]})
        if title == "Systems":
            entries += [f"systems/{name}.md" for name in registry.available()]
        if title == "Extending":
            found = sorted(path.name for path in (pages / "decisions").glob("*.md"))
            entries.append({"Decisions": [f"decisions/{name}" for name in found]})
        if entries:
            menu.append({title: entries})
    return menu


def _copy_written(pages: Path) -> None:
    for path in sorted(WRITTEN.rglob("*")):
        place = path.relative_to(WRITTEN)
        if SKIPPED & set(place.parts) or not path.is_file() or path.suffix == ".yaml":
            continue
        if path.suffix == ".md":
            _write(pages / place, path.read_text(encoding="utf-8"), path, pages)
        else:
            _copy(path, pages / place)


def _write(place: Path, text: str, source: Path, pages: Path) -> None:
    """A page whose links out of the documentation lead to copies, at the path that they have in the repository."""

    def led(found: re.Match[str]) -> str:
        path, anchor = found.group(1), found.group(2) or ""
        aim = Path(os.path.normpath(source.parent / path))
        if not aim.exists() or not aim.is_relative_to(ROOT):
            return found.group(0)
        here = aim.relative_to(WRITTEN if aim.is_relative_to(WRITTEN) else ROOT)
        here = Path(ELSEWHERE.get(str(here), str(here)))
        if aim.is_file() and not aim.is_relative_to(WRITTEN) and str(aim.relative_to(ROOT)) not in ELSEWHERE:
            _copy(aim, pages / here)
        return f"]({os.path.relpath(pages / here, place.parent)}{anchor})"

    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text(LINK.sub(led, text), encoding="utf-8")


def _copy(path: Path, place: Path) -> None:
    place.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(path, place)
