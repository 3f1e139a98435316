"""A file is there whole or as it was before; a disk that is full or may not be written is named."""

from __future__ import annotations

import errno
import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from nlbench.errors import EnvironmentFault
from nlbench.results.atomic import atomic_write, sweep


def names(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def test_writes_and_replaces_and_leaves_nothing_beside(tmp_path):
    path = tmp_path / "new" / "table.csv"
    atomic_write(path, b"first")
    atomic_write(path, b"second")
    assert path.read_bytes() == b"second"
    assert names(path.parent) == ["table.csv"]


def test_folders_that_cannot_be_synced_are_no_fault(tmp_path, monkeypatch):
    fsync = os.fsync

    def only_files(descriptor):
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, "Invalid argument")
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", only_files)
    atomic_write(tmp_path / "table.csv", b"new")
    assert (tmp_path / "table.csv").read_bytes() == b"new"


@pytest.mark.parametrize("step", ["write", "fsync", "replace"])
def test_a_failure_at_any_step_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch, step):
    path = tmp_path / "table.csv"
    atomic_write(path, b"old")
    full = OSError(errno.ENOSPC, "No space left on device")
    if step == "write":
        monkeypatch.setattr(Path, "open", _opens_a_file_that_fills_up(Path.open, full))
    else:
        owner, name = (os, "fsync") if step == "fsync" else (Path, "replace")
        monkeypatch.setattr(owner, name, _raises(full))
    with pytest.raises(EnvironmentFault, match="No space left on device"):
        atomic_write(path, b"new" * 1000)
    monkeypatch.undo()
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["table.csv"]


def _raises(error):
    def fail(*arguments, **options):
        raise error

    return fail


def _opens_a_file_that_fills_up(opener, error):
    def opened(path, *arguments, **options):
        file = opener(path, *arguments, **options)

        class Full:
            def __enter__(self):
                return self

            def __exit__(self, *exception):
                file.close()

            def write(self, data):
                file.write(data[: len(data) // 2])
                raise error

        return Full()

    return opened


def test_the_message_names_path_needed_and_free(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", _raises(OSError(errno.ENOSPC, "No space left on device")))
    with pytest.raises(EnvironmentFault) as caught:
        atomic_write(tmp_path / "a.parquet", bytes(1500))
    message = str(caught.value)
    assert str(tmp_path / "a.parquet") in message
    assert "needed 1.5 kB" in message
    assert "free " in message
    assert caught.value.exit_code == 5


def test_a_folder_that_cannot_be_made_is_an_environment_fault(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(EnvironmentFault, match="cannot write"):
        atomic_write(tmp_path / "file" / "table.csv", b"data")


def test_an_interrupt_leaves_nothing_beside(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", _raises(KeyboardInterrupt()))
    with pytest.raises(KeyboardInterrupt):
        atomic_write(tmp_path / "table.csv", b"data")
    assert names(tmp_path) == []


def test_sweeping_removes_what_a_killed_process_left_and_nothing_else(tmp_path):
    script = (
        "import os, sys; from pathlib import Path; from nlbench.results import atomic\n"
        "os.fsync = lambda _: os.kill(os.getpid(), 9)\n"
        "atomic.atomic_write(Path(sys.argv[1]) / 'table.csv', b'data')"
    )
    killed = subprocess.run([sys.executable, "-c", script, str(tmp_path)], check=False, cwd=Path.cwd())
    assert killed.returncode == -9
    (tmp_path / "other.csv").write_text("stays")
    (left,) = tmp_path.glob(".table.csv.*")
    sweep(tmp_path)
    assert not left.exists()
    assert names(tmp_path) == ["other.csv"]


@pytest.mark.parametrize(("options", "reason"), [("size=64k", "No space left"), ("size=64k,ro", "Read-only")])
def test_on_a_real_disk_that_is_full_or_read_only(tmp_path, options, reason):
    """In a mount namespace of its own, so that nothing stays mounted."""
    script = (
        "import os, sys; from pathlib import Path; from nlbench.errors import EnvironmentFault\n"
        "from nlbench.results.atomic import atomic_write\n"
        "try:\n"
        "    atomic_write(Path(sys.argv[1]) / 'table.csv', bytes(200_000))\n"
        "except EnvironmentFault as error:\n"
        "    print(error)\n"
        "print(os.listdir(sys.argv[1]))"
    )
    mount = f"mount -t tmpfs -o {options} tmpfs {tmp_path}"
    unshare = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c"]
    if (
        not shutil.which("unshare")
        or subprocess.run([*unshare, mount], capture_output=True, check=False).returncode
    ):
        pytest.skip("a private mount is not permitted here")
    command = [*unshare, f'{mount} && exec "$@"', "sh", sys.executable, "-c", script, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    message, left = done.stdout.splitlines()
    assert reason in message
    assert "needed 200 kB; free " in message
    assert left == "[]"
