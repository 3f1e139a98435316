"""A page for each system, from the docstring and the parameters of its module, and the table of all."""

from __future__ import annotations

import inspect

from docs.generator import fields, text
from nlbench import systems
from nlbench.filters import catalogue


def kind(name: str) -> str:
    """The kind of system that it is with its published parameters."""
    return catalogue.KINDS[systems.kind(name, systems.parameters(name)().model_dump())]


def page(name: str) -> str:
    """What the system is, where its numbers come from, and its parameters."""
    first, _, rest = text.docstring(systems.MODULES[name]).partition("\n\n")
    shown = {each: catalogue.KINDS[each] for each in catalogue.KINDS}
    parts = [
        f"# {name}",
        text.markdown(first),
        f"By default: {kind(name)}. *Printed* numbers stand in the source, *inferred* ones follow from it, "
        "*chosen* ones are ours.",
        "## The problem",
        text.markdown(rest),
        "## Parameters",
        "In an experiment file they stand beside the name: `system: {name: "
        + name
        + ", ...}`. The defaults are the "
        "published values where there are any.",
        fields.of(systems.parameters(name)),
        "## Its exact posterior",
        reference(name),
        "## Filters for it",
        ", ".join(
            f"[{each}](../filters/{each}.md)"
            for each in catalogue.available()
            if any(shown[takes] == kind(name) for takes in catalogue.takes(each))
        ),
    ]
    return "\n\n".join(parts) + "\n"


def reference(name: str) -> str:
    """What `reference: exact` is with the published parameters, in the words of the record that it is made of."""
    made = systems.build(name).exact
    if made is None:
        return "None with these parameters. `reference: particles` runs a filter of 10,000 particles beside the others."
    said = text.markdown((inspect.getdoc(type(made)) or "").partition("\n\n")[0])
    return f"`reference: exact`, with these parameters: {said[0].lower()}{said[1:]}"


def overview() -> str:
    """The table of all systems."""
    rows = [
        (f"[{name}]({name}.md)", text.cell(systems.summary(name)), kind(name)) for name in systems.available()
    ]
    return text.table(("system", "is", "kind by default"), rows) + "\n"
