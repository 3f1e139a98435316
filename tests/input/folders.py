"""Folders of finished runs spoiled at random."""

from __future__ import annotations

import contextlib
import json
import random
import shutil
from collections.abc import Callable
from pathlib import Path

CHECKED = ("tables", "config.resolved.yaml", "manifest.json", "batches", "DONE")
MANIFESTS = ("null", "[]", "{}", "3", '"x"', "{", "NaN", '{"checksum": 1}', '{"schema": 1, "checksum": null}')
VALUES = (None, True, -1, 10**30, "x", [], {}, "\x1b[31m", "../../up", "<script>")


def contents(folder: Path) -> dict[str, bytes | None]:
    """Every file by its name, None for what cannot be read as one."""
    found = sorted(folder.rglob("*"))
    return {str(each.relative_to(folder)): each.read_bytes() if each.is_file() else None for each in found}


def lost(before: dict[str, bytes | None], after: dict[str, bytes | None]) -> list[str]:
    """What the checksums of a run cover, or the mark that it is done, and is not there as it was."""
    return [
        name
        for name, content in before.items()
        if name.startswith(CHECKED)
        and content is not None
        and _meant(name, after.get(name)) != _meant(name, content)
    ]


def _meant(name: str, content: bytes | None) -> object:
    """What counts: the mark is a number, whatever blanks stand around it, and the manifest is JSON in any layout."""
    if content is None:
        return None
    if name == "manifest.json":
        with contextlib.suppress(ValueError):
            return json.loads(content)
    return content.strip() if name == "DONE" else content


def spoil(folder: Path, number: int, seed: int = 1969) -> str:
    """Spoil a folder one to three times, the same for the same numbers. Returns what was done."""
    chance = random.Random(f"{seed}/{number}")
    return "; ".join(chance.choice(MUTATIONS)(chance, folder) for _ in range(chance.choice([1, 1, 1, 2, 3])))


def _file(chance: random.Random, folder: Path) -> Path:
    """A file of the folder; those of tables and batches as often as the others together."""
    files = sorted(each for each in folder.rglob("*") if each.is_file() and each.name != ".lock")
    inner = [each for each in files if each.parent != folder]
    return chance.choice(inner if inner and chance.random() < 0.5 else files or [folder / "DONE"])


def _bytes(chance: random.Random, folder: Path) -> str:
    """Some bytes are others."""
    file = _file(chance, folder)
    content = bytearray(file.read_bytes() if file.exists() else b"")
    for _ in range(chance.choice([1, 1, 8])):
        if content:
            content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    file.write_bytes(content)
    return f"bits of {file.name}"


def _cut(chance: random.Random, folder: Path) -> str:
    """A file is shorter, or empty."""
    file = _file(chance, folder)
    content = file.read_bytes() if file.exists() else b""
    file.write_bytes(content[: chance.choice([0, chance.randrange(len(content) + 1)])])
    return f"{file.name} cut"


def _longer(chance: random.Random, folder: Path) -> str:
    """A file goes on with something else."""
    file = _file(chance, folder)
    with file.open("ab") as open_file:
        open_file.write(chance.choice([b"\n", b"\0", b"x,y\n", bytes(range(256)), b"\xff\xfe"]))
    return f"{file.name} goes on"


def _gone(chance: random.Random, folder: Path) -> str:
    """A file is no longer there."""
    file = _file(chance, folder)
    file.unlink(missing_ok=True)
    return f"{file.name} removed"


def _other_kind(chance: random.Random, folder: Path) -> str:
    """A folder, or a link that leads nowhere or to itself, in the place of a file."""
    file = _file(chance, folder)
    file.unlink(missing_ok=True)
    kind = chance.choice(["folder", "link to nothing", "link to itself"])
    if kind == "folder":
        file.mkdir()
    else:
        file.symlink_to("nothing" if kind == "link to nothing" else file.name)
    return f"{file.name} a {kind}"


def _exchanged(chance: random.Random, folder: Path) -> str:
    """Two files have each other's content."""
    one, other = _file(chance, folder), _file(chance, folder)
    if not one.exists() or not other.exists():
        return "nothing"
    first, second = one.read_bytes(), other.read_bytes()
    one.write_bytes(second)
    other.write_bytes(first)
    return f"{one.name} and {other.name} exchanged"


def _manifest(chance: random.Random, folder: Path) -> str:
    """The manifest is edited, and still JSON, or something else altogether."""
    file = folder / "manifest.json"
    try:
        content = json.loads(file.read_bytes())
        key = chance.choice(sorted(content))
    except (OSError, ValueError, TypeError, IndexError):
        content = None
    if not isinstance(content, dict) or chance.random() < 0.2:
        said = chance.choice(MANIFESTS)
        if not file.is_dir():
            file.unlink(missing_ok=True)
            file.write_text(said)
        return f"manifest {said}"
    if chance.random() < 0.3:
        del content[key]
    else:
        content[key] = chance.choice(VALUES)
    file.write_text(json.dumps(content))
    return f"manifest's {key} edited"


def _stranger(chance: random.Random, folder: Path) -> str:
    """A file more."""
    name = chance.choice(
        ["tables/own.csv", "tables/statistics.parquet.bak", "batches/7", "notes.txt", "tables/\x1b[1m"]
    )
    file = folder / name
    file.parent.mkdir(exist_ok=True)
    if not file.is_dir():
        file.write_bytes(b"x")
    return f"{name!r} added"


def _mark(chance: random.Random, folder: Path) -> str:
    """The mark that the run is done says something else."""
    said = chance.choice(["", "x", "-1", "0", "9" * 5000, "1001", "1e3", "\xff", "1000\n1000"])
    file = folder / "DONE"
    if not file.is_dir():
        file.unlink(missing_ok=True)
        file.write_text(said, encoding="latin-1")
    return f"DONE says {said[:10]!r}"


def _folder(chance: random.Random, folder: Path) -> str:
    """A folder is no longer there, or a file."""
    inner = folder / chance.choice(["tables", "batches"])
    shutil.rmtree(inner, ignore_errors=True)
    if chance.random() < 0.5 and not inner.exists():
        inner.write_bytes(b"")
        return f"{inner.name} a file"
    return f"{inner.name} removed"


MUTATIONS: tuple[Callable[[random.Random, Path], str], ...] = (
    _bytes,
    _cut,
    _longer,
    _gone,
    _other_kind,
    _exchanged,
    _manifest,
    _manifest,
    _stranger,
    _mark,
    _folder,
)
