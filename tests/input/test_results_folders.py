"""Claim: whatever is done to a folder of results, no command believes it, writes into it or fails in other words.

`run` alone repairs it: to the bytes that nothing had disturbed.
"""

from __future__ import annotations

import shutil

import pytest

import nlbench as nb
from nlbench.engine import driver, verification
from nlbench.engine.compiled import compile_chunks
from nlbench.engine.problem import make
from nlbench.errors import EnvironmentFault
from nlbench.results.results import Results
from tests.input.answers import answer, faults
from tests.input.folders import contents, lost, spoil
from tests.small_runs import experiment, table_bytes

SOUND, DAMAGED, NO_RUN = 0, 5, 2


def small(**changes):
    return experiment(
        reference=None, engine={"chunk": 1, "threads": 2}, monte_carlo={"runs": 200, "seed": 11} | changes
    )


@pytest.fixture(scope="module")
def program():
    nb.configure()
    return compile_chunks(make(small()), 11)


@pytest.fixture(autouse=True)
def quick(program, monkeypatch):
    """Every command takes the program that is compiled."""
    for module in (driver, verification):
        monkeypatch.setattr(module, "make", lambda *given: program.problem)
        monkeypatch.setattr(module, "compile_chunks", lambda *given: program)


@pytest.fixture(scope="module")
def undisturbed(program, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(driver, "make", lambda *given: program.problem)
        patch.setattr(driver, "compile_chunks", lambda *given: program)
        return nb.run(small(), tmp_path_factory.mktemp("undisturbed")).path


def spoiled(undisturbed, tmp_path, number):
    """A spoiled copy, in the place where `run` would look for it, and what was done."""
    folder = tmp_path / "out" / "small" / undisturbed.name
    shutil.copytree(undisturbed, folder, symlinks=True)
    return folder, spoil(folder, number)


def misread(undisturbed, tmp_path, number):
    """What is wrong with the answers of the commands that read, and with the folder after them."""
    folder, done = spoiled(undisturbed, tmp_path, number)
    before = contents(folder)
    damaged = lost(contents(undisturbed), before)
    wrong = []
    for command in (["verify", folder], ["compare", undisturbed, folder], ["report", folder]):
        if command[0] == "report" and not damaged:
            continue  # it would draw every figure
        given = answer(*command)
        # A table that nobody wrote harms no reader; `verify` alone names it.
        allowed = (DAMAGED, NO_RUN) if damaged else (SOUND, DAMAGED) if command[0] == "verify" else (SOUND,)
        found = faults(given, allowed, str(folder)) + ["a change"] * (contents(folder) != before)
        wrong += [f"{done}: {command[0]}: {each}: {given.said[-500:]!r}" for each in found]
    return wrong


def unrepaired(undisturbed, tmp_path, number):
    """What is wrong with the folder after the command that made it is given again."""
    folder, done = spoiled(undisturbed, tmp_path, number)
    try:
        path = nb.run(small(), tmp_path / "out").path
    except EnvironmentFault as fault:
        # What lies in the way is named, and removed by who put it there.
        named = any(str(each) in str(fault) for each in (folder, *folder.iterdir()))
        in_the_way = [each for each in folder.rglob("*") if not each.is_file() or each.is_symlink()]
        in_the_way += [each for each in (folder / "tables", folder / "batches") if each.is_file()]
        return [] if named and in_the_way else [f"{done}: {fault}"]
    same = table_bytes(path) == table_bytes(undisturbed)
    return [f"{done}: {each}" for each in [*Results(path).damaged(), *([] if same else ["other tables"])]]


@pytest.mark.parametrize("number", range(25))
def test_readers_neither_believe_nor_change_a_spoiled_folder(undisturbed, tmp_path, number):
    assert misread(undisturbed, tmp_path, number) == []


@pytest.mark.parametrize("number", range(25))
def test_the_same_command_repairs_it(undisturbed, tmp_path, number):
    assert unrepaired(undisturbed, tmp_path, number) == []


@pytest.mark.long
@pytest.mark.parametrize("check", [misread, unrepaired])
def test_a_thousand_spoiled_folders(undisturbed, tmp_path, check):
    wrong = []
    for number in range(1000, 2000):
        wrong += check(undisturbed, tmp_path / str(number), number)
        shutil.rmtree(tmp_path / str(number), ignore_errors=True)
    assert wrong == []
