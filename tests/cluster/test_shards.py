"""Claims: shards merged are the run of one machine byte for byte; what does not belong together is never merged."""

from __future__ import annotations

import shutil
import signal

import pytest
from typer.testing import CliRunner

import nlbench as nb
from nlbench.cli import budget
from nlbench.cli.app import app
from nlbench.engine.planning import space
from nlbench.engine.shards import merge, run_shard
from nlbench.errors import ConfigError, DamagedResults, EnvironmentFault, Interrupted, LockedError
from nlbench.results.folder import RunFolder
from tests.example import written
from tests.small_runs import experiment, table_bytes

RUNS = 3010  # 47 blocks and 2 runs; 2,048 are kept


def small(runs: int = RUNS, **changes):
    return experiment(monte_carlo={"runs": runs, "seed": 11, "keep_runs": 100}, **changes)


@pytest.fixture(scope="module")
def one_machine(tmp_path_factory):
    return table_bytes(nb.run(small(), tmp_path_factory.mktemp("one")).path)


@pytest.fixture(scope="module")
def sharded(tmp_path_factory):
    """Two folders: one has shards 1 and 3 of three, the other shard 2."""
    folders = [tmp_path_factory.mktemp(name) for name in "ab"]
    for number in (1, 2, 3):
        run_shard(small(), number, 3, folders[number == 2])
    return folders


@pytest.fixture
def copied(sharded, tmp_path):
    """The same, to be spoiled."""
    return [shutil.copytree(each, tmp_path / name) for each, name in zip(sharded, "ab", strict=True)]


def shard_folder(out, number):
    return next(out.rglob(f"{number}-of-3"))


def test_merged_shards_are_the_run_of_one_machine(sharded, one_machine, tmp_path):
    assert table_bytes(merge(small(), sharded, tmp_path).path) == one_machine


@pytest.mark.long
def test_a_shard_that_was_stopped_goes_on(copied, one_machine, tmp_path):
    shutil.rmtree(shard_folder(copied[1], 2))
    stops = iter([True])

    def interrupt(done, total):
        if done and next(stops, False):
            signal.raise_signal(signal.SIGINT)

    single = small(engine={"chunk": 1, "threads": 1})
    with pytest.raises(Interrupted):
        run_shard(single, 2, 3, copied[1], interrupt)
    with pytest.raises(ConfigError, match="merge needs complete shards"):
        merge(small(), copied, tmp_path / "merged")
    seen = []
    run_shard(single, 2, 3, copied[1], lambda done, total: seen.append(done))
    assert seen[0] > 0
    assert table_bytes(merge(small(), copied, tmp_path / "merged").path) == one_machine


@pytest.mark.long
def test_shards_are_topped_up(copied, tmp_path):
    more = small(4000)
    for number in (1, 2, 3):
        run_shard(more, number, 3, copied[number == 2])
    merged = merge(more, copied, tmp_path / "merged")
    assert table_bytes(merged.path) == table_bytes(nb.run(more, tmp_path / "one").path)


def test_missing_shards_are_named_and_nothing_is_written(sharded, tmp_path):
    with pytest.raises(ConfigError, match="missing: shard 2 of 3"):
        merge(small(), sharded[:1], tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_shard_given_twice_is_named(copied, tmp_path):
    shutil.copytree(shard_folder(copied[1], 2), shard_folder(copied[0], 1).parent / "2-of-3")
    with pytest.raises(ConfigError, match=r"there twice: .*2-of-3 and .*2-of-3"):
        merge(small(), copied, tmp_path / "merged")


def test_shards_of_another_division_are_refused(copied, tmp_path):
    shutil.copytree(shard_folder(copied[1], 2), shard_folder(copied[0], 1).parent / "2-of-4")
    with pytest.raises(ConfigError, match="several divisions"):
        merge(small(), copied, tmp_path / "merged")


def test_folders_with_other_names_are_no_shards(copied, one_machine, tmp_path):
    first = shard_folder(copied[0], 1)
    for name in ("1-of-3-old", "9-of-3", "0-of-3", "1-of-65", "copy"):
        shutil.copytree(first, first.parent / name)
    assert table_bytes(merge(small(), copied, tmp_path / "merged").path) == one_machine


def test_a_shard_of_another_schema_is_refused(copied, tmp_path):
    folder = RunFolder(shard_folder(copied[1], 2))
    arrays, facts = folder.load_checkpoint()
    folder.save_checkpoint(arrays, **{**facts, "schema": 1})
    with pytest.raises(EnvironmentFault, match=r"2-of-3.*schema 1, this version"):
        merge(small(), copied, tmp_path / "merged")


def test_a_shard_keeps_to_the_budget_and_to_what_is_free(tmp_path, monkeypatch):
    monkeypatch.setattr(space.atomic, "free_disk", lambda folder: 1000)
    file = written(tmp_path, small().resolved_yaml())  # compiled by the tests above
    words = ["run", str(file), "--shard", "1/3", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 5
    assert "not begun, disk of" in done.stderr
    assert not list(tmp_path.rglob("checkpoint.npz"))
    monkeypatch.undo()
    monkeypatch.setattr(budget, "SETTLED", 0.0)
    done = CliRunner().invoke(app, [*words, "--runs", "1e12", "--budget", "1s"])
    assert done.exit_code == 2
    assert "the budget is 1.0 s" in done.stderr


def test_shards_of_another_experiment_are_not_taken(sharded, tmp_path):
    other = experiment(monte_carlo={"runs": RUNS, "seed": 12, "keep_runs": 100})
    with pytest.raises(ConfigError, match="no shards of this experiment"):
        merge(other, sharded, tmp_path)


def test_a_damaged_shard_is_named(copied, tmp_path):
    file = shard_folder(copied[1], 2) / "batches/checkpoint.npz"
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    with pytest.raises(DamagedResults, match="2-of-3"):
        merge(small(), copied, tmp_path / "merged")


def test_a_shard_of_other_software_is_refused(copied, tmp_path):
    folder = RunFolder(shard_folder(copied[1], 2))
    arrays, facts = folder.load_checkpoint()
    facts["fingerprint"]["jaxlib"] = "0.0.1"
    folder.save_checkpoint(arrays, **facts)
    with pytest.raises(EnvironmentFault, match=r"2-of-3 .*jaxlib: 0\.0\.1"):
        merge(small(), copied, tmp_path / "merged")


def test_a_shard_in_use_is_refused_and_another_is_not(copied):
    with RunFolder(shard_folder(copied[0], 1)).locked():
        with pytest.raises(LockedError):
            run_shard(small(), 1, 3, copied[0])
        assert run_shard(small(), 3, 3, copied[0]).total == RUNS


@pytest.mark.parametrize("shard", ["0/3", "4/3", "1/65", "1", "a/b", "1/0"])
def test_a_wrong_division_is_a_mistake_of_usage(shard):
    done = CliRunner().invoke(app, ["run", "configs/quickstart.yaml", "--shard", shard])
    assert done.exit_code == 2
    assert f"got '{shard}'; expected i/n" in done.output
