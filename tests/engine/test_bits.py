"""Claim: chunk, threads, devices and interruptions never change one byte of a table."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest
from jax.experimental.compilation_cache import compilation_cache

import nlbench as nb
from nlbench.engine.compiled import forget_programs
from nlbench.engine.program_cache import use_cache
from nlbench.results.results import Results
from tests.small_runs import experiment, python, table_bytes

RUN = """
import sys
import nlbench as nb
from tests.small_runs import experiment
nb.configure()
runs, out = int(sys.argv[1]), sys.argv[2]
nb.run(experiment(monte_carlo={"runs": runs, "seed": 11}), out)
"""


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """With a cache of its own, so that what it is compared with was compiled another time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NLBENCH_CACHE", str(tmp_path_factory.mktemp("cache")))
        compilation_cache.reset_cache()
        forget_programs()
        results = nb.run(experiment(), tmp_path_factory.mktemp("plain"))
    forget_programs()
    use_cache()
    compilation_cache.reset_cache()
    return results


@pytest.mark.parametrize("engine", [{"chunk": 1}, {"chunk": 7, "threads": 1}, {"chunk": 79, "threads": 3}])
def test_chunk_and_threads_do_not_change_one_byte(plain, tmp_path, engine):
    other = nb.run(experiment(engine=engine), tmp_path)
    assert table_bytes(other.path) == table_bytes(plain.path)


@pytest.mark.long
def test_two_devices_do_not_change_one_byte(tmp_path):
    for devices in (1, 2):
        flags = f"--xla_force_host_platform_device_count={devices}"
        done = python(RUN, "500", str(tmp_path / str(devices)), xla_flags=flags)
        assert done.returncode == 0, done.stderr
    one, two = (table_bytes(next((tmp_path / name).rglob("DONE")).parent) for name in ("1", "2"))
    assert one == two


def test_topping_up_equals_a_straight_run(plain, tmp_path):
    nb.run(experiment(monte_carlo={"runs": 333, "seed": 11}), tmp_path)
    more = nb.run(experiment(), tmp_path)
    assert more.manifest["runs"] == 1000
    assert table_bytes(more.path) == table_bytes(plain.path)


def test_fewer_runs_than_there_are_keeps_them_all(plain):
    again = nb.run(experiment(monte_carlo={"runs": 10, "seed": 11}), plain.path.parents[1])
    assert again.path == plain.path
    assert set(again.table("divergence").n) == {1000}


def test_block_and_precision_make_another_experiment():
    base = experiment().hash12()
    assert experiment(engine={"chunk": 5, "threads": 2}).hash12() == base
    assert experiment(monte_carlo={"runs": 7, "seed": 11}).hash12() == base
    assert experiment(engine={"block": 32}).hash12() != base
    assert experiment(engine={"precision": "float32"}).hash12() != base


@pytest.mark.slow
@pytest.mark.parametrize("kills", [2, pytest.param(60, marks=pytest.mark.long)])
def test_killed_at_any_moment_and_resumed_gives_the_same_bytes(tmp_path, kills):
    """Killed up to so many times, at the first checkpoint after each start or up to 0.09 s later."""
    program = RUN.replace("import sys\n", "import sys\nimport nlbench.engine.resume as resume\n", 1)
    program = program.replace("nb.configure()", "nb.configure()\nresume.SECONDS_BETWEEN_CHECKPOINTS = 0.05")
    program = program.replace("experiment(monte", "experiment(reference=None, monte")
    runs = "150000"
    assert python(program, runs, str(tmp_path / "straight"), xla_flags="").returncode == 0
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "XLA_FLAGS": ""}
    killed = 0
    for attempt in range(kills + 1):
        process = subprocess.Popen(
            [sys.executable, "-c", program, runs, str(tmp_path / "killed")], env=environment
        )
        checkpoints = lambda: sum(p.stat().st_mtime_ns for p in tmp_path.glob("killed/*/*/batches/*.npz"))  # noqa: E731
        before = checkpoints()
        while process.poll() is None and (attempt == kills or checkpoints() == before):
            time.sleep(0.005)
        time.sleep(0.03 * (attempt % 4))
        if process.poll() is not None:
            break
        process.send_signal(signal.SIGKILL)
        process.wait()
        killed += 1
    assert process.returncode == 0
    assert killed >= 2
    straight, resumed = (next((tmp_path / name).rglob("DONE")).parent for name in ("straight", "killed"))
    assert table_bytes(straight) == table_bytes(resumed)
    assert not Results(resumed).damaged()


def test_what_was_compiled_before_does_not_keep_a_run_from_its_cache(tmp_path):
    """jax stays with the folder that it had when it first compiled anything."""
    cache = tmp_path / "cache"
    first = f"import jax\njax.config.update('jax_compilation_cache_dir', {str(tmp_path / 'other')!r})\n"
    first += f"jax.jit(lambda x: x + 1)(1.0)\nimport os\nos.environ['NLBENCH_CACHE'] = {str(cache)!r}\n"
    done = python(first + RUN, "64", str(tmp_path / "out"))
    assert done.returncode == 0, done.stderr
    assert list(cache.iterdir())
