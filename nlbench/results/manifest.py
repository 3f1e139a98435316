"""The manifest of a run: where its numbers come from, and the checksum of every file that holds them."""

from __future__ import annotations

import json
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from nlbench.errors import DamagedResults
from nlbench.results.atomic import atomic_write
from nlbench.results.checksum import of_json

SCHEMA = 2
_PACKAGES = ("nlbench", "jax", "jaxlib", "numpy", "scipy", "equinox", "diffrax", "pandas", "pyarrow")


def write_manifest(path: Path, facts: dict[str, Any]) -> None:
    """Write `facts` (plain values), with the schema's version and a checksum of the manifest itself."""
    content = {"schema": SCHEMA, **facts}
    content["checksum"] = of_json(content)
    atomic_write(path, (json.dumps(content, indent=2, sort_keys=True, ensure_ascii=False) + "\n").encode())


def read_manifest(path: Path) -> dict[str, Any]:
    """What was written. Raises `DamagedResults` if it is missing, edited or of another version."""
    try:
        content = json.loads(path.read_bytes())
        checksum = content.pop("checksum")
        schema = content["schema"]
        found = of_json(content)
    except FileNotFoundError as error:
        raise DamagedResults(
            f"{path} is missing: the run was not finished, or this is not a run's folder"
        ) from error
    except (OSError, ValueError, KeyError, AttributeError, TypeError) as error:
        raise DamagedResults(f"{path}: not a manifest that can be read ({error})") from error
    if checksum != found:
        raise DamagedResults(
            f"{path}: the checksum does not match the content; the file is damaged or edited"
        )
    if schema != SCHEMA:
        raise DamagedResults(f"{path}: schema {schema}, this version of nlbench reads schema {SCHEMA}")
    return content


def versions() -> dict[str, str]:
    """Versions of the packages that make the numbers; those that are not installed are left out."""
    found = {}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def commit() -> str | None:
    """The git commit that nlbench runs from, `-dirty` when its files were changed; None if not from git."""
    folder = Path(__file__).resolve().parent.parent

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(folder), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()

    try:
        # A package installed inside somebody else's repository is not of that repository.
        git("ls-files", "--error-unmatch", "errors.py")
        return git("rev-parse", "HEAD") + ("-dirty" if git("status", "--porcelain", "--", ".") else "")
    except (OSError, subprocess.SubprocessError):
        return None
