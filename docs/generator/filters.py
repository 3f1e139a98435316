"""A page for each filter of the catalogue, and the table of all."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from ruamel.yaml import YAML

from docs.generator import fields, text
from nlbench.filters import catalogue
from nlbench.row import Row

NOTES = Path(__file__).parent.parent / "filters" / "notes.yaml"
TITLES = {
    "moment.md": "Moment filters",
    "continuous.md": "Filters for continuous measurements",
    "discrete.md": "Filters for discrete time",
}
CARRIED = {
    0: "a density (points, particles or an exact form)",
    1: "mean and covariance, linearised",
    2: "mean and covariance",
    3: "mean, covariance, third central moments",
    4: "mean, covariance, third central moments, fourth coefficients (cumulants)",
}
# Where the equations of a row stand, by family and update; of the discrete family the update is the module.
MOMENT = {
    "kalman": ["updates.kalman"],
    "sub1": ["updates.hermite3"],
    "sub2": ["updates.hermite3"],
    "hermite3": ["updates.hermite3"],
    "hermite4": ["updates.hermite4"],
    "series": ["updates.series"],
    "tempering": ["updates.tempering", "updates.pseudo_time"],
    "two-step": ["updates.two_step", "updates.pseudo_time"],
    "direct": ["updates.quadrature"],
    "quadrature": ["updates.quadrature"],
}
CONTINUOUS = {
    "kushner": ["continuous.kushner", "continuous.kushner_printed"],
    "nominal": ["continuous.nominal"],
    "weighted": ["continuous.weighted"],
}
BELOW = {
    "kalman": ["discrete.linearised"],
    "sof": ["discrete.second_order"],
    "sigma_point": ["discrete.points"],
    "gaussian_sum": ["discrete.mixture"],
}
REFERENCES = [
    f"references.{name}"
    for name in ("initial_grid", "point_mass", "zakai", "kalman_bank", "parameter_bank", "initial_posterior")
]


class Note(NamedTuple):
    """What was written by hand about a filter: where its equations are derived, and what is known of it."""

    see: str
    known: list[str]


def notes() -> dict[str, Note]:
    """Notes by the filter's name."""
    found = YAML(typ="safe").load(NOTES.read_text(encoding="utf-8"))
    return {name: Note(each["see"], each.get("known", [])) for name, each in found.items()}


def modules(row: Row) -> list[str]:
    """The modules whose docstrings hold the equations of a filter."""
    if row.family == "moment":
        guard = ["updates.guard"] if row.options().model_dump().get("guard") == "sub1" else []
        found = ["moments.equations", *MOMENT[row.update], *guard]
    elif row.family == "continuous":
        found = CONTINUOUS.get(row.update, ["continuous.second_order"])
    elif row.family == "discrete":
        last = [] if row.update in ("gaussian_sum", "ensemble", "bootstrap") else ["discrete.correction"]
        found = [f"discrete.{row.update}", *BELOW.get(row.update, []), *last]
    else:
        found = REFERENCES if row.family == "reference" else ["filters.unfiltered"]
    return [f"nlbench.{name}" for name in found]


def page(name: str, note: Note) -> str:
    """The page of a filter; a name that means another filter for another kind of system has a section for each."""
    rows: dict[Row, list[str]] = {}
    for kind in catalogue.takes(name):
        rows.setdefault(catalogue.row(name, *kind), []).append(catalogue.KINDS[kind])
    parts = [f"# {name}", text.escaped(f"{catalogue.summary(name)}.")]
    parts.append(f"Derivation, and the filters beside it: [{TITLES[note.see.split('#')[0]]}]({note.see}).")
    if note.known:
        parts += ["## What is known of it", "\n".join(f"- {each}" for each in note.known)]
    for row, kinds in rows.items():
        parts += [f"## For {' and '.join(kinds)}", *_section(row)]
    return "\n\n".join(parts) + "\n"


def _section(row: Row) -> list[str]:
    docs = {module: text.docstring(module) for module in modules(row)}
    facts = [
        ("source", row.source),
        ("carries", CARRIED[row.order]),
        *((word.lower(), " ".join(said)) for word in ("Cost", "Fails") if (said := _said(docs, word))),
    ]
    if row.family == "moment":
        facts.append(("cost of propagation", f"O(n^{row.order + 1}) a stage of integration"))
    parts = [text.table(("is", text.cell(row.says)), [(word, text.cell(said)) for word, said in facts])]
    parts += ["### Options", fields.of(row.options), "### Equations, as the code numbers them"]
    for module, said in docs.items():
        parts += [f"`{module}`", text.markdown(said)]
    return parts


def _said(docs: dict[str, str], word: str) -> list[str]:
    return [sentence for said in docs.values() for sentence in text.sentences(said, word)]


def overview() -> str:
    """The table of all filters, by the systems that they take."""
    parts = []
    for kind, words in catalogue.KINDS.items():
        names = [name for name in catalogue.available() if kind in catalogue.takes(name)]
        rows = [
            (f"[{name}]({name}.md)", text.cell(found.says), text.cell(found.source))
            for name in names
            for found in [catalogue.row(name, *kind)]
        ]
        parts += [f"## For {words}", text.table(("filter", "is", "source"), rows)]
    return "\n\n".join(parts) + "\n"
