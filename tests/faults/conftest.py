"""What the tests of faults share: a program, a run that nothing disturbed, and a place where runs are quick."""

from __future__ import annotations

import pytest

import nlbench as nb
from tests.faults.quick import compiled, made_quick, small


@pytest.fixture(scope="session")
def program():
    nb.configure()
    return compiled()


@pytest.fixture
def quick(program, monkeypatch):
    made_quick(monkeypatch, program)


@pytest.fixture(scope="session")
def undisturbed(program, tmp_path_factory):
    """The folder of a run; leave it as it is."""
    with pytest.MonkeyPatch.context() as patch:
        made_quick(patch, program)
        return nb.run(small(), tmp_path_factory.mktemp("undisturbed")).path
