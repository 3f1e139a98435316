"""The persistent cache of compiled programs, whose entries appear whole and are checked before they are believed.

jax writes an entry in place: a kill or a full disk in that moment leaves a part of it under its final name, which is
neither read nor written again. So entries are written like results, with a checksum, and one that fails it is removed.
"""

from __future__ import annotations

import hashlib
import logging
import os
from pathlib import Path

import jax
from jax._src.lru_cache import LRUCache
from jax.experimental.compilation_cache import compilation_cache

from nlbench.errors import EnvironmentFault
from nlbench.results.atomic import atomic_write, remove

SUFFIX = ".program"
DIGEST = hashlib.sha256().digest_size
log = logging.getLogger("nlbench")


def use_cache() -> None:
    """Keep compiled programs on disk, in $NLBENCH_CACHE or the user's cache folder."""
    LRUCache.put, LRUCache.get = _put, _get  # type: ignore[assignment, method-assign]
    folder = _folder()
    if folder is None:
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        log.warning("%s: compiled programs are not kept (%s)", folder, error.strerror)
        return
    if jax.config.jax_compilation_cache_dir != str(folder):  # type: ignore[attr-defined]
        jax.config.update("jax_compilation_cache_dir", str(folder))
        compilation_cache.reset_cache()  # jax stays with the folder of its first compilation
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)


def _folder() -> Path | None:
    """Where programs are kept; None for a user without a home."""
    if given := os.environ.get("NLBENCH_CACHE"):
        return Path(given)
    try:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:
        log.warning("no folder for compiled programs: set NLBENCH_CACHE, or each run compiles anew")
        return None
    return base / "nlbench" / "xla"


def _put(cache: LRUCache, key: str, value: bytes) -> None:
    """Keep a program under its key; a disk that is full or read-only costs a compilation next time, and no more."""
    try:
        atomic_write(_path(cache, key), hashlib.sha256(value).digest() + value)
    except EnvironmentFault as fault:
        log.debug("a compiled program could not be kept: %s", fault)


def _get(cache: LRUCache, key: str) -> bytes | None:
    """The program of a key; None if there is none that is whole."""
    path = _path(cache, key)
    try:
        data = path.read_bytes()
    except OSError:
        return None
    digest, value = data[:DIGEST], data[DIGEST:]
    if hashlib.sha256(value).digest() == digest:
        return value
    log.warning("%s: a compiled program that is damaged; it is compiled anew", path)
    remove(path)
    return None


def _path(cache: LRUCache, key: str) -> Path:
    return Path(str(cache.path)) / f"{key}{SUFFIX}"
