"""Claims: each filter sights when its own angle says so, with the noise of the sighting's number; late errors count."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.engine.block import block_tracks, make_chunk, words
from nlbench.engine.problem import make
from nlbench.simulate import Trajectory, seed_key, simulate
from nlbench.systems.system import LateError, Sightings
from tests.small_runs import experiment, table_bytes

RATE, STEP, END, SEED = 0.9, 0.05, 16.0, 5
FILTERS = ("third-order", "linearised-kalman")


def turning(nominal=False, **changes):
    """A point on a line, of uncertain speed, that is compared with a mark on a wheel as the wheel turns: the angle is
    known only modulo 2 pi, and the measurement depends on which mark it is."""
    sightings = Sightings(
        angles=(1.0, 2.5, 5.0),
        marks=(0.3, -0.2, 0.1),
        period=2 * math.pi,
        rate=RATE,
        angle=lambda x: jnp.arctan2(jnp.sin(x[0]), jnp.cos(x[0])),
        observe=lambda mark, x: jnp.stack([x[0] * x[1] + mark * x[0]]),
        nominal=nominal,
    )
    stated = {
        "drift": lambda t, x: jnp.stack([x[1], 0.05 * jnp.sin(x[0])]),
        "observe": lambda t, x: x[:1],
        "measurement_cov": [[0.04]],
        "initial": nb.Moments([0.0, RATE], [[0.01, 0.0], [0.0, 0.02]]),
        "sightings": sightings,
    }
    return nb.System(**{**stated, **changes})


def stated(system, **changes):
    return {
        "experiment": "turning",
        "system": system,
        "filters": list(FILTERS),
        "time": {"end": END, "step": STEP, "output": 1.0},
        "report_times": [8.0, END],
        "monte_carlo": {"runs": 100, "seed": SEED},
        "engine": {"cost": False},
        **changes,
    }


class ByHand(NamedTuple):
    """Errors at the whole seconds (T, n), and the steps at which it sighted."""

    errors: np.ndarray
    steps: list[int]


def by_hand(system, name):
    """Follows a trajectory of given states and noise through the public interface, decided in Python: a `ByHand`."""
    f = nb.filters.build(name, system)
    predict = jax.jit(lambda state, t: f.predict(state, t, t + STEP))
    update = jax.jit(lambda state, t, y, number: f.update(state, t, y, sighting=number)[0])

    def follow(states, noise, nominal_steps=None):
        state, angle, made, errors = f.init(system.initial), 0.0, [], []
        for step in range(1, round(END / STEP) + 1):
            state, x = predict(state, (step - 1) * STEP), states[step]
            angle += math.remainder(float(f.moments(state).mean[0]) - angle, 2 * math.pi)
            turn, place = divmod(len(made), 3)
            due = angle >= system.sightings.angles[place] + 2 * math.pi * turn
            if step == nominal_steps[len(made)] if nominal_steps else due:
                y = x[0] * x[1] + system.sightings.marks[place] * x[0] + noise[len(made)]
                state = update(state, step * STEP, y, len(made))
                made.append(step)
            if step % round(1.0 / STEP) == 0:
                errors.append(x - np.asarray(f.moments(state).mean))
        return ByHand(np.array(errors), made)

    return follow


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    system = turning(step=STEP)
    return system, nb.run(stated(system), tmp_path_factory.mktemp("turning"))


def simulated(system):
    """The problem, and a function of a trajectory's number: its states and the noise of its sightings."""
    problem = make(experiment(**{**stated(system), "system": {"name": "own"}, "reference": None}), system)
    run = jax.jit(partial(simulate, problem.truth, problem.schedule, seed_key(*words(SEED))))

    def states_and_noise(number):
        made = run(trajectory(number))
        return np.asarray(made.states), np.asarray(made.noise)

    return problem, states_and_noise


def trajectory(number):
    return Trajectory(*words(number), *words(number), np.int32(0))


def test_each_filter_sights_at_its_own_steps_with_the_noise_of_the_number(results):
    system, done = results
    kept = done.table("runs").set_index(["filter", "run", "time"])
    _, data = simulated(system)
    schedules = set()
    for name in FILTERS:
        follow = by_hand(system, name)
        for number in range(0, 100, 25):
            expected = follow(*data(number))
            schedules.add((name, *expected.steps))
            found = kept.loc[name, number, END]
            np.testing.assert_allclose([found.x1, found.x2], expected.errors[-1], rtol=1e-9, atol=1e-11)
            assert len(expected.steps) >= 5
    assert len(schedules) > 4  # not all the same


def test_nominal_sightings_are_made_when_the_undisturbed_motion_says_so(tmp_path):
    system = turning(nominal=True, step=STEP)
    kept = nb.run(stated(system), tmp_path).table("runs").set_index(["filter", "run", "time"])
    problem, data = simulated(system)
    path = simulate(
        turning(sample=lambda key: jnp.array([0.0, RATE])),
        problem.schedule,
        seed_key(*words(1)),
        trajectory(0),
    ).states
    due = [angle + 2 * math.pi * turn for turn in range(5) for angle in (1.0, 2.5, 5.0)]
    steps = [int(np.argmax(np.asarray(path)[:, 0] >= angle)) for angle in due]
    for name in FILTERS:
        expected = by_hand(system, name)(*data(7), nominal_steps=[step or -1 for step in steps])
        found = kept.loc[name, 7, END]
        np.testing.assert_allclose([found.x1, found.x2], expected.errors[-1], rtol=1e-9, atol=1e-11)
        assert expected.steps == [step for step in steps if step]


def test_chunks_and_threads_do_not_change_one_bit(results, tmp_path):
    system, done = results
    other = nb.run(stated(system, engine={"chunk": 1, "threads": 2}), tmp_path)
    assert table_bytes(other.path) == table_bytes(done.path)


def test_updates_are_counted_as_each_lane_makes_them(results):
    system, _ = results
    problem, data = simulated(system)
    lanes = make_chunk(problem, 0, 1, 1, 64).lanes
    tracks = jax.jit(lambda lanes: block_tracks(problem, words(SEED), lanes, 0)[0])(
        jax.tree.map(lambda part: part[0], lanes)
    )
    hands = [by_hand(system, name) for name in FILTERS]
    for number in (0, 63):
        made = [len(follow(*data(number)).steps) for follow in hands]
        assert tracks.updates[:, number].tolist() == made


def test_a_late_error_is_judged_at_the_end_over_its_window(tmp_path):
    system, window = turning(step=STEP), 3.0
    _, data = simulated(system)
    follow, late = by_hand(system, "linearised-kalman"), {}
    for number in range(0, 100, 9):
        errors = follow(*data(number)).errors[:, 0]
        late[number] = np.sqrt((errors[-round(window) :] ** 2).mean())
    bound = float(np.median(list(late.values())))
    ruled = turning(step=STEP, diverged_late=LateError(window, bound, members=(0,)))
    kept = (
        nb.run(stated(ruled, filters=["linearised-kalman"]), tmp_path)
        .table("runs")
        .set_index(["run", "time"])
    )
    assert not kept.diverged.xs(8.0, level="time").any()
    assert {number: bool(kept.diverged[number, END]) for number in late} == {
        number: bool(error > bound) for number, error in late.items()
    }
