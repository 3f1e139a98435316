"""Files that appear whole or not at all."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path

from nlbench.errors import EnvironmentFault

_SUFFIX = ".partial"


def atomic_write(path: Path, data: bytes | memoryview) -> None:
    """Write `data` to `path`: into a file beside it, to the disk, then renamed over `path`.

    The folder is made if need be. Raises `EnvironmentFault` and leaves `path` as it was when the disk is full
    or may not be written.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}{_SUFFIX}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with beside.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
        _sync_folder(path.parent)
    except OSError as error:
        raise write_fault(path, error, len(data)) from error
    finally:
        # After a rename there is nothing to remove; on a read-only disk nothing was made.
        remove(beside)


def remove(path: Path) -> None:
    """Remove a file if it is there and may be removed."""
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        if error.errno not in {errno.EROFS, errno.EACCES, errno.EPERM, errno.ENOTDIR}:
            raise write_fault(path, error) from error


def sweep(folder: Path) -> None:
    """Remove what a killed process left half written in `folder`."""
    for left in folder.glob(f".*{_SUFFIX}"):
        remove(left)


def is_partial(path: Path) -> bool:
    """Whether a file is one that was being written, and is swept before anything else is."""
    return path.name.startswith(".") and path.suffix == _SUFFIX


def write_fault(path: Path, error: OSError, needed: int | None = None) -> EnvironmentFault:
    """The error to raise when `path` could not be written: why, what was needed, what is free."""
    parts = [f"cannot write {path}: {error.strerror or error}"]
    if needed is not None:
        parts.append(f"needed {_size(needed)}")
    free = free_disk(path)
    if free is not None:
        parts.append(f"free {_size(free)}")
    return EnvironmentFault(
        "; ".join(parts) + ". Nothing was lost: put it right and give the same command again."
    )


def free_disk(path: Path) -> int | None:
    """Bytes free on the disk where `path` is or would be made, None where that cannot be told."""
    for folder in (path, *path.absolute().parents):
        try:
            return shutil.disk_usage(folder).free
        except OSError:
            continue
    return None


def _size(count: int) -> str:
    size = float(count)
    for unit in ("B", "kB", "MB", "GB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.3g} TB"


def _sync_folder(folder: Path) -> None:
    """Make the rename itself survive a power failure."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in {errno.EINVAL, errno.ENOTSUP}:  # a file system on which folders are not synced
            raise
    finally:
        os.close(descriptor)
