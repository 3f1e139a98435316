"""A checkpoint gives back exactly what was saved, or says that it is damaged."""

from __future__ import annotations

import numpy as np
import pytest

from nlbench.errors import DamagedResults, EnvironmentFault
from nlbench.results.checkpoint import load_checkpoint, save_checkpoint

ARRAYS = {
    "sums": np.random.default_rng(1).normal(size=(64, 3, 2)),
    "counts": np.arange(5),
    "empty": np.zeros((2, 0)),
    "scalar": np.array(7),
    "flags": np.array([True, False]),
    "view": np.arange(12.0).reshape(3, 4).T,
}
FACTS = {"seed": 2**62, "fingerprint": {"jaxlib": "0.10.2"}, "commit": None}


@pytest.fixture
def path(tmp_path):
    save_checkpoint(tmp_path / "checkpoint.npz", ARRAYS, FACTS)
    return tmp_path / "checkpoint.npz"


def test_gives_back_what_was_saved(path):
    arrays, facts = load_checkpoint(path)
    assert facts == FACTS
    assert arrays.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        assert arrays[name].dtype == array.dtype
        np.testing.assert_array_equal(arrays[name], array, strict=True)


def test_two_checkpoints_of_the_same_content_are_byte_identical(path):
    before = path.read_bytes()
    save_checkpoint(path, ARRAYS, FACTS)
    assert path.read_bytes() == before


def test_one_flipped_bit_anywhere_in_the_content_is_noticed(path):
    data = path.read_bytes()
    saved, _ = load_checkpoint(path)
    noticed = 0
    positions = range(0, len(data), 97)
    for position in positions:
        path.write_bytes(data[:position] + bytes([data[position] ^ 1]) + data[position + 1 :])
        try:
            arrays, facts = load_checkpoint(path)
        except DamagedResults:
            noticed += 1
        else:  # a field of the container that nobody reads, such as a date
            assert facts == FACTS
            for name, array in saved.items():
                np.testing.assert_array_equal(arrays[name], array, strict=True)
    assert noticed > 0.8 * len(positions)


@pytest.mark.parametrize("bit", range(8))
def test_a_flipped_bit_in_the_table_of_contents_is_damage_or_nothing(path, bit):
    data = path.read_bytes()
    start = data.index(b"PK\x01\x02")
    for position in range(
        start, start + 46
    ):  # flags, which may say that it is encrypted; method; sizes; checksums
        path.write_bytes(data[:position] + bytes([data[position] ^ 1 << bit]) + data[position + 1 :])
        try:
            _, facts = load_checkpoint(path)
        except DamagedResults:
            continue
        assert facts == FACTS


@pytest.mark.parametrize("keep", [0, 10, 0.5, 0.99])
def test_a_truncated_file_is_damaged(path, keep):
    data = path.read_bytes()
    path.write_bytes(data[: int(keep * len(data)) if keep < 1 else keep])
    with pytest.raises(DamagedResults, match=r"checkpoint\.npz"):
        load_checkpoint(path)


def test_an_array_edited_consistently_in_the_container_is_damaged(path):
    with np.load(path) as file:
        content = dict(file)
    content["counts"][2] += 1
    np.savez(path, **content)
    with pytest.raises(DamagedResults, match="checksum") as caught:
        load_checkpoint(path)
    assert str(path) in str(caught.value)
    assert caught.value.exit_code == 5


def test_pickled_objects_are_never_loaded(path):
    np.savez(path, sums=np.array([{"a": 1}], object))
    with pytest.raises(DamagedResults):
        load_checkpoint(path)


def test_a_full_disk_leaves_the_previous_checkpoint(path, monkeypatch):
    import os

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(EnvironmentFault, match="No space left"):
        save_checkpoint(path, {"other": np.zeros(3)}, {})
    assert load_checkpoint(path)[1] == FACTS
