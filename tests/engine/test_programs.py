"""Claims: a process compiles an experiment once, whatever it does with it, and never takes one for another."""

from __future__ import annotations

import numpy as np
import pytest

import nlbench as nb
from nlbench import engine
from nlbench.engine import compiled
from nlbench.engine.problem import make
from tests.small_runs import experiment


@pytest.fixture
def made(monkeypatch):
    """The problems that were compiled since the test began, when no program was kept."""
    problems, compile_anew = [], compiled.compile_anew

    def noted(problem, seed):
        problems.append(problem)
        return compile_anew(problem, seed)

    monkeypatch.setattr(compiled, "compile_anew", noted)
    compiled.forget_programs()
    yield problems
    compiled.forget_programs()


@pytest.fixture
def unmade(monkeypatch):
    """Programs are named, and not made."""
    monkeypatch.setattr(
        compiled,
        "compile_anew",
        lambda problem, seed: compiled.Compiled((), problem, (seed, seed), 3.0, problem.same),
    )
    compiled.forget_programs()
    yield
    compiled.forget_programs()


def brief(**changes):
    plain = {
        "filters": ["ekf"],
        "reference": None,
        "time": {"end": 0.2, "step": 0.1, "output": 0.1},
        "report_times": [0.2],
        "monte_carlo": {"runs": 64, "seed": 11},
    }
    return experiment(**{**plain, **changes})


def test_running_topping_up_replaying_and_verifying_compile_once(made, tmp_path):
    nb.run(brief(), tmp_path)
    more = brief(monte_carlo={"runs": 130, "seed": 11}, engine={"chunk": 1}, traces=[3], claims=[])
    results = nb.run(more, tmp_path)
    engine.replay(more, "ekf", 3)
    assert not engine.verify(results).faults
    assert len(made) == 1
    assert results.manifest["compile_seconds"] < 0.5


def test_another_seed_takes_the_same_program_and_draws_other_numbers(made):
    first, other = (
        engine.replay(brief(monte_carlo={"runs": 64, "seed": seed}), "ekf", 0).x_truth for seed in (11, 12)
    )
    compiled.forget_programs()
    anew = engine.replay(brief(monte_carlo={"runs": 64, "seed": 12}), "ekf", 0).x_truth
    assert len(made) == 2
    assert not np.allclose(first, other)
    np.testing.assert_array_equal(other, anew)


@pytest.mark.parametrize(
    "changes",
    [
        {"filters": ["third-order"]},
        {"filters": [{"name": "ekf", "label": "other"}]},
        {"filters": [{"name": "ekf", "initial": {"variance": 2.0}}]},
        {"system": {"name": "culver-scalar"}},
        {"system": {"name": "culver-scalar", "ensemble": "normal", "measurement_variance": 2.0}},
        {"truth": {"measurement_variance": 2.0}},
        {"reference": "exact"},
        {"time": {"end": 0.2, "step": 0.05, "output": 0.1}},
        {"report_times": [0.1]},
        {"engine": {"block": 32}},
    ],
    ids=str,
)
def test_what_changes_the_program_or_its_rows_changes_the_name(changes):
    assert make(brief(**changes)).same != make(brief()).same


def test_few_are_kept_and_the_one_unused_for_longest_goes(unmade):
    problem = make(brief())
    names = [f"program {number}" for number in range(compiled.PROGRAMS + 1)]
    made = {name: compiled.compile_chunks(problem._replace(same=name), 1) for name in names[:-1]}
    again = compiled.compile_chunks(problem._replace(same=names[0]), 1)
    assert again.problem is made[names[0]].problem
    assert again.seconds < made[names[0]].seconds
    compiled.compile_chunks(problem._replace(same=names[-1]), 1)
    kept = {
        name: compiled.compile_chunks(problem._replace(same=name), 1).seconds < 3.0
        for name in (names[0], names[-1], *names[2:-1])
    }
    assert all(kept.values())
    assert compiled.compile_chunks(problem._replace(same=names[1]), 1).seconds == 3.0


def test_a_system_of_ones_own_is_compiled_each_time(made):
    """What its functions refer to may have changed meanwhile."""
    rate = [1.0]
    system = nb.System(
        drift=lambda t, x: -rate[0] * x,
        observe=lambda t, x: x,
        measurement_cov=np.eye(1),
        initial=nb.Moments(mean=np.ones(1), cov=np.eye(1)),
        interval=0.1,
    )
    stated = {"system": system, "filters": ["ekf"], "time": {"end": 0.2, "step": 0.1, "output": 0.1}}
    first = engine.replay({"experiment": "own", **stated, "monte_carlo": {"runs": 64}}, "ekf", 0)
    rate[0] = 2.0
    second = engine.replay({"experiment": "own", **stated, "monte_carlo": {"runs": 64}}, "ekf", 0)
    assert len(made) == 2
    assert not np.allclose(first.x_truth, second.x_truth)
