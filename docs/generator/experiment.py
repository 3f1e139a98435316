"""The reference of experiment files, from the models that validate them."""

from __future__ import annotations

from docs.generator import fields, text
from nlbench.config.assemble import SECTIONS, Named
from nlbench.config.claim import Claim
from nlbench.config.schema import Head, Initial, TimeSpec

SAID = {
    "time": (TimeSpec, "What is left out follows from the system's interval between measurements."),
    "monte_carlo": (SECTIONS["monte_carlo"], ""),
    "initial": (Initial, "Moments that all filters start from, instead of the system's."),
    "source": (SECTIONS["source"], ""),
    "engine": (SECTIONS["engine"], ""),
    "limits": (SECTIONS["limits"], ""),
}
TOP = (
    ("system", "a system's name, or a mapping of `name` and [parameters](systems/index.md); required"),
    ("truth", "parameters of the system that makes the data, where it differs from what filters believe"),
    ("filters", "a list of [filters](filters/index.md): names, or mappings; required"),
    ("claims", "a list of [claims](#claims)"),
    ("plugins", "the plug-ins that a run used: written by the run, and no permission"),
    *((name, f"a section: [{name}](#{name})") for name in SAID),
)


def page(written: str) -> str:
    """The page, after what was written by hand."""
    parts = [written.rstrip(), "## Keys at the top level", fields.of(Head)]
    parts.append(text.table(("key", "is"), [(f"`{name}`", said) for name, said in TOP]))
    parts += [
        "## An entry of `filters` {#filters}",
        "Beside these, the options of the filter, which its [page](filters/index.md) lists.",
        fields.of(Named),
    ]
    for name, (model, said) in SAID.items():
        parts += [
            f"## `{name}` {{#{name}}}",
            text.escaped(f"{model.__doc__} {said}".strip()),
            fields.of(model),
        ]
    parts += ["## `claims` {#claims}", text.escaped(str(Claim.__doc__)), fields.of(Claim)]
    return "\n\n".join(parts) + "\n"
