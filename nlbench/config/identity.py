"""The written form of a resolved experiment, and its hash."""

from __future__ import annotations

import hashlib
import io
import json
from typing import Any


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
