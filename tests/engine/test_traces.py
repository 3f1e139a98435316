"""Claims: a trace is the run that the tables hold, in full; asking for one changes nothing else and costs no rerun."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench import engine
from nlbench.engine import trace
from tests.small_runs import experiment, table_bytes

TRACED = [77, 0]


def traced(**changes):
    return experiment(system={"name": "culver-scalar"}, traces=TRACED, **changes)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    return nb.run(traced(), tmp_path_factory.mktemp("traced"))


def test_every_run_filter_time_and_coordinate_has_a_row(done):
    table = done.table("traces")
    assert list(table.columns) == [
        *("trajectory", "filter", "time", "coordinate", "error", "deviation", "diverged"),
    ]
    keys = ["trajectory", "filter", "time", "coordinate"]
    assert not table.duplicated(keys).any()
    expected = [(run, label) for run in TRACED for label in ("third-order", "third-order-guarded", "exact")]
    assert list(dict.fromkeys(zip(table["trajectory"], table["filter"], strict=True))) == expected
    assert len(table) == len(expected) * 7
    assert sorted(set(table["time"])) == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6]


def test_errors_are_those_of_the_kept_runs_to_the_last_bit(done):
    keys = ["trajectory", "filter", "time"]
    kept = done.table("runs").rename(columns={"run": "trajectory"}).set_index(keys)
    table = done.table("traces").set_index(keys)
    table = table[table.index.get_level_values("time").isin([0.2, 0.6])]
    assert len(table) == 2 * 3 * 2
    for key, row in table.iterrows():
        assert row["error"] == kept.loc[key, "x"]
        assert row["diverged"] == kept.loc[key, "diverged"]


def test_at_the_start_a_filter_states_the_initial_deviation(done):
    table = done.table("traces")
    start = table[(table["time"] == 0.0) & (table["filter"] != "exact")]
    initial = nb.systems.build("culver-scalar").initial
    np.testing.assert_allclose(start["deviation"], np.sqrt(initial.cov[0][0]), rtol=1e-12)


def test_replay_shows_the_same_errors_and_deviations(done):
    table = done.table("traces")
    for label in ("third-order", "exact"):
        shown = engine.replay(done.experiment, label, 77)
        rows = table[(table["trajectory"] == 77) & (table["filter"] == label)]
        for column in ("error", "deviation"):
            np.testing.assert_array_equal(shown[f"x_{column}"], rows[column])
        np.testing.assert_array_equal(shown["x_deviation"], np.sqrt(shown["x_variance"]))
        np.testing.assert_array_equal(shown["x_error"], shown["x_truth"] - shown["x_mean"])


def test_other_tables_do_not_change_by_a_byte(done, tmp_path):
    plain = nb.run(experiment(system={"name": "culver-scalar"}), tmp_path)
    assert table_bytes(plain.path) == table_bytes(done.path)
    assert "traces" not in plain.tables


def test_threads_do_not_change_a_byte_of_the_traces(done, tmp_path):
    other = nb.run(traced(engine={"threads": 1, "chunk": 1}), tmp_path)
    for name in ("traces.csv", "traces.parquet", "responses.parquet"):
        assert (other.path / "tables" / name).read_bytes() == (done.path / "tables" / name).read_bytes()


def test_a_finished_run_gains_costs_without_being_computed_again(tmp_path):
    uncosted = experiment(system={"name": "culver-scalar"})
    before = nb.run(uncosted, tmp_path)
    assert "cost" not in before.tables
    counts = []
    costed = experiment(system={"name": "culver-scalar"}, engine={"cost": True})
    after = nb.run(costed, tmp_path, progress=lambda runs, total: counts.append(runs))
    assert after.path == before.path
    assert counts[0] == 960  # the 15 whole blocks of the checkpoint
    assert "cost" in after.tables
    assert "cost" in nb.run(uncosted, tmp_path).tables  # not asked for, and there


def test_a_finished_run_gains_and_loses_traces_without_being_computed_again(done, tmp_path):
    plain = experiment(system={"name": "culver-scalar"})
    before = nb.run(plain, tmp_path)
    counts = []
    after = nb.run(traced(), tmp_path, progress=lambda runs, total: counts.append(runs))
    assert after.path == before.path
    assert counts[0] == 960  # the 15 whole blocks of the checkpoint
    assert after.experiment.traces == TRACED
    assert not after.damaged()
    assert table_bytes(after.path) == table_bytes(done.path)
    assert after.table("traces").equals(done.table("traces"))
    assert after.table("responses").equals(done.table("responses"))
    again = nb.run(plain, tmp_path)
    assert "traces" not in again.tables
    assert not [*(again.path / "tables").glob("traces*"), *(again.path / "tables").glob("responses*")]


def test_a_negative_variance_has_no_deviation():
    np.testing.assert_array_equal(trace.deviation(np.array([4.0, -1.0, 0.0])), [2.0, np.nan, 0.0])


def test_errors_are_the_systems_own_and_deviations_go_through_its_jacobian(tmp_path):
    """error = ((x1^2 - m1^2), (m2 - x2)/3): standard deviations 2 |m1| sqrt(P11) and sqrt(P22)/3."""
    system = nb.System(
        drift=lambda t, x: jnp.stack([x[1], -x[0]]),
        observe=lambda t, x: x[:1],
        measurement_cov=np.array([[0.1]]),
        initial=nb.Moments(mean=np.array([2.0, 0.0]), cov=0.1 * np.eye(2)),
        coordinates=(nb.Coordinate("energy", "J"), nb.Coordinate("lag")),
        error=lambda x, m: jnp.stack([x[0] ** 2 - m[0] ** 2, (m[1] - x[1]) / 3.0]),
        diverged=lambda error: abs(error[0]) > 0.3,
        interval=0.2,
    )
    stated = {
        "experiment": "own",
        "system": system,
        "filters": ["ekf"],
        "time": {"end": 1.0, "step": 0.05, "output": 0.1},
        "monte_carlo": {"runs": 70, "seed": 3},
        "traces": [69],
    }
    results = nb.run(stated, tmp_path)
    assert (
        "responses" not in results.tables
    )  # of states that have no names, and may be others in another filter
    table = results.table("traces")
    shown = engine.replay(stated, "ekf", 69)
    np.testing.assert_allclose(
        shown["energy_error"], shown["x1_truth"] ** 2 - shown["x1_mean"] ** 2, rtol=1e-12
    )
    np.testing.assert_allclose(shown["lag_error"], (shown["x2_mean"] - shown["x2_truth"]) / 3, rtol=1e-12)
    energy = 2 * abs(shown["x1_mean"]) * np.sqrt(shown["x1_variance"])
    np.testing.assert_allclose(shown["energy_deviation"], energy, rtol=1e-10)
    np.testing.assert_allclose(shown["lag_deviation"], np.sqrt(shown["x2_variance"]) / 3, rtol=1e-10)
    for name in ("energy", "lag"):
        rows = table[table["coordinate"] == name]
        for column in ("error", "deviation"):
            np.testing.assert_array_equal(rows[column], shown[f"{name}_{column}"])
        np.testing.assert_array_equal(rows["diverged"], abs(shown["energy_error"]) > 0.3)
    assert set(table["diverged"]) == {False, True}


def test_replay_names_states_after_the_errors_where_these_are_differences():
    stated = experiment(
        system="oscillator", filters=["third-order"], reference=None, time={"end": 0.4, "step": 0.05, "output": 0.2},
        report_times=[0.4],
    )  # fmt: skip
    names = ("position", "velocity", "damping")
    columns = engine.replay(stated, "third-order", 3).columns
    expected = [f"{name}_{part}" for name in names for part in ("error", "deviation")]
    expected += [f"{name}_truth" for name in names]
    expected += [f"{name}_{part}" for name in names for part in ("mean", "variance", "third")]
    assert list(columns) == ["time", *expected, "y1", "y2", "diverged"]


def series(done, run, kind, label="", name="x"):
    """Times and values of one curve of the responses."""
    table = done.table("responses")
    keys = {"trajectory": run, "kind": kind, "filter": label, "name": name}
    rows = table[np.logical_and.reduce([table[column] == key for column, key in keys.items()])]
    return rows["time"].to_numpy(), rows["value"].to_numpy()


def test_responses_are_truth_and_estimates_whose_difference_is_the_error(done):
    table = done.table("traces")
    assert list(done.table("responses").columns) == ["trajectory", "kind", "filter", "name", "time", "value"]
    for run in TRACED:
        times, truth = series(done, run, "truth")
        for label in ("third-order", "third-order-guarded", "exact"):
            rows = table[(table["trajectory"] == run) & (table["filter"] == label)]
            np.testing.assert_array_equal(times, rows["time"])
            np.testing.assert_array_equal(truth - series(done, run, "estimate", label)[1], rows["error"])


def test_responses_have_every_measurement_made_at_fixed_times(done):
    times, values = series(done, 77, "measurement", name="y1")
    interval = nb.systems.build("culver-scalar").interval
    np.testing.assert_allclose(times, interval * np.arange(1, len(times) + 1))
    assert times[-1] == pytest.approx(0.6)
    shown = engine.replay(done.experiment, "exact", 77).set_index("time")["y1"].dropna()
    np.testing.assert_array_equal(values[np.isin(np.round(times, 9), shown.index)], shown)


def test_responses_without_measurements_are_truth_and_estimates(tmp_path):
    system = {"name": "culver-scalar", "measurement": "none"}
    table = nb.run(traced().model_copy(update={"system": experiment(system=system).system}), tmp_path)
    assert set(table.table("responses")["kind"]) == {"truth", "estimate"}


def test_of_a_continuous_measurement_a_part_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(trace, "MOST_MEASUREMENTS", 12)
    stated = experiment(
        system={"name": "culver-scalar", "measurement": "continuous"},
        filters=["kushner-2"], reference=None, report_times=[0.6], traces=[3], monte_carlo={"runs": 64, "seed": 1},
    )  # fmt: skip
    times, values = series(nb.run(stated, tmp_path), 3, "measurement", name="y1")
    np.testing.assert_allclose(times, 0.06 * np.arange(10))  # of 30 steps of .02, every third
    assert np.isfinite(values).all()
