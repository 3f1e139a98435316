"""One file that holds named arrays and a few facts, and notices when it is damaged."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from nlbench.errors import DamagedResults, EnvironmentFault
from nlbench.results.atomic import atomic_write
from nlbench.results.checksum import of_arrays

_FACTS, _CHECKSUM = "_facts", "_sha256"


def save_checkpoint(path: Path, arrays: Mapping[str, np.ndarray], facts: Mapping[str, Any]) -> None:
    """Replace the checkpoint at `path`; `facts` are plain values (JSON)."""
    content = {**arrays, _FACTS: np.frombuffer(json.dumps(facts, sort_keys=True).encode(), np.uint8)}
    content = {name: np.ascontiguousarray(array).reshape(np.shape(array)) for name, array in content.items()}
    content[_CHECKSUM] = np.frombuffer(of_arrays(content).encode(), np.uint8)
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **content)
    atomic_write(path, buffer.getbuffer())


def load_checkpoint(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The arrays and facts saved at `path`. Raises `DamagedResults` unless they are exactly those saved, and
    `EnvironmentFault` where the file cannot be read, which is no reason to begin again."""
    try:
        with np.load(path, allow_pickle=False) as file:
            content = {name: file[name] for name in file.files}
        checksum = content.pop(_CHECKSUM).tobytes().decode()
    except OSError as error:
        if error.errno is None:  # raised by NumPy about the content
            raise DamagedResults(f"{path}: not a checkpoint that can be read ({error})") from error
        raise EnvironmentFault(f"{path}: cannot be read ({error.strerror})") from error
    except MemoryError:
        raise
    except Exception as error:  # each part of an archive that can be wrong has an error of its own
        raise DamagedResults(f"{path}: not a checkpoint that can be read ({error})") from error
    if checksum != of_arrays(content):
        raise DamagedResults(f"{path}: the checksum does not match the content; the file is damaged")
    facts = json.loads(content.pop(_FACTS).tobytes())
    return content, facts
