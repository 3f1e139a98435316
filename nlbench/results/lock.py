"""A lock on a folder that the kernel releases when its holder dies."""

from __future__ import annotations

import contextlib
import datetime
import fcntl
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple

from nlbench.errors import LockedError
from nlbench.results.atomic import write_fault


class Held(NamedTuple):
    """A lock that is held, by the open file."""

    path: Path
    file: IO[str]

    def in_place(self) -> bool:
        """Whether the file at the path still is the one that is held: not where the folder was removed or replaced."""
        try:
            return os.path.samestat(os.fstat(self.file.fileno()), self.path.stat())
        except (OSError, ValueError):  # a file that is closed
            return False


@contextlib.contextmanager
def exclusive(path: Path) -> Iterator[Held]:
    """Hold the lock file at `path`. Raises `LockedError`, naming the holder, if a live process has it.

    The file stays when the lock is released: removing it would let two processes hold two files of one name.
    """
    with contextlib.closing(_opened(path)) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise LockedError(f"{path.parent} is in use by {_holder(file.read())}") from None
        except OSError as error:
            raise write_fault(path, error) from error
        since = datetime.datetime.now().astimezone().isoformat(timespec="seconds")
        try:
            file.truncate(0)
            file.write(json.dumps({"pid": os.getpid(), "since": since}) + "\n")
            file.flush()
        except OSError as error:
            raise write_fault(path, error) from error
        yield Held(path, file)


def _opened(path: Path) -> IO[str]:
    """The file, made if need be."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666), "r+")
    except OSError as error:
        raise write_fault(path, error) from error


def _holder(text: str) -> str:
    try:
        facts = json.loads(text)
        return (
            f"process {facts['pid']} since {facts['since']}; wait for it, or choose another folder with --out"
        )
    except (ValueError, KeyError, TypeError):
        return "another process, which has only just started"
