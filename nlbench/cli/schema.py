"""`nlbench schema`: the JSON Schema of experiment files, for editors."""

from __future__ import annotations

from nlbench.cli import options, output


def schema(plugins: options.Plugin = None) -> None:
    """Print the JSON Schema of experiment files.

    By it editors complete and check them. With --plugin it knows the names of your
    own systems and filters too.
    """
    from nlbench.config.editor import json_schema

    output.as_json(json_schema())
