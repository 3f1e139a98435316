"""The written form of a resolved experiment, its hash, and the folder of its name."""

from __future__ import annotations

import hashlib
import io
import json
from pathlib import Path
from typing import Any

from nlbench.errors import ConfigError, Problem


def canonical_hash(plain: dict[str, Any]) -> str:
    """Twelve hexadecimal digits of the SHA-256 of canonical JSON: keys sorted, no spaces."""
    text = json.dumps(plain, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def to_yaml(plain: dict[str, Any], question: str) -> str:
    """The mapping as YAML, keys in their order, after the question as a comment."""
    from ruamel.yaml import YAML

    yaml = YAML(typ="rt", pure=True)
    yaml.width = 100
    stream = io.StringIO()
    yaml.dump(plain, stream)
    return (f"# {question}\n" if question else "") + stream.getvalue()


def named_folder(out: Path, name: str) -> Path:
    """Return the folder of a name's results.

    Raises `ConfigError` where there are results of a name that differs in capitals only: on some disks both are one.
    """
    path = out
    for part in name.split("/"):
        there = [each.name for each in path.iterdir()] if path.is_dir() else []
        if part not in there and (other := next((each for each in there if _same(each, part)), None)):
            message = f"'{name}' differs in capitals only from the name of other results, {path / other}"
            raise ConfigError(
                [Problem(f"{message}; choose another, or another folder with --out", "experiment")]
            )
        path /= part
    return path


def _same(a: str, b: str) -> bool:
    return a.casefold() == b.casefold()
