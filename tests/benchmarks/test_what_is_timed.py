"""What the benchmarks time computes the right numbers: compared with NumPy oracles, never timed here."""

from __future__ import annotations

import shutil
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import harness, native, ours, peers, plain, rows, workloads
from tests.benchmarks import scalar_oracle

SMALL = workloads.SCALAR._replace(blocks=2, times=6)
SMALL_OSCILLATOR = workloads.OSCILLATOR._replace(blocks=1, times=6)
R = SMALL.noise_cov[0, 0]

needs_compiler = pytest.mark.skipif(not (shutil.which("gcc") or shutil.which("cc")), reason="no C compiler")


@pytest.fixture(scope="module", params=[1, 2, 4])
def kernel(request):
    return native.build(request.param)


def oracle_history(y):
    return scalar_oracle.filtered(y[:, :, 0].T, R)


def ekf_oracle(workload, y):
    """Means after the last update; the covariance follows the tangent of each RK4 step."""

    def step(x):
        return workloads.rk4(lambda x: workload.drift(np, x), x, workload.step)

    means = []
    for run in y:
        m, P = workload.mean, workload.cov
        for y_k in run:
            F = np.stack([(step(m + 1e-30j * unit)).imag / 1e-30 for unit in np.eye(len(m))], axis=-1)
            H = np.eye(2, 3)
            m, P = step(m), F @ P @ F.T
            K = np.linalg.solve(H @ P @ H.T + workload.noise_cov, H @ P).T
            m, P = m + K @ (y_k - H @ m), P - K @ H @ P
        means.append(m)
    return np.array(means)


@needs_compiler
def test_the_c_filter_equals_bayes_rule_and_the_moment_equations(kernel):
    y = workloads.measurements(SMALL)
    blocks = native.aligned((SMALL.blocks, SMALL.times, native.BLOCK))
    blocks[:] = workloads.by_blocks(y)[:, :, 0]
    out = native.outputs(blocks)
    native.run_filter(kernel, blocks, R, out)
    history = out.transpose(1, 2, 0, 3).reshape(SMALL.times, 3, -1)
    np.testing.assert_allclose(history, oracle_history(y), rtol=1e-12, atol=1e-12)


@needs_compiler
def test_the_c_experiment_equals_its_oracle_for_trajectories_beyond_32_bits(kernel):
    first = 2**33 + 17
    out = native.aligned((2, 5, 3, native.BLOCK))
    native.run_experiment(kernel, R, 1969, first, out)
    expected = scalar_oracle.experiment(1969, np.uint64(first) + np.arange(128, dtype=np.uint64), 5, R)
    np.testing.assert_allclose(out.transpose(1, 2, 0, 3).reshape(5, 3, -1), expected, rtol=1e-12, atol=1e-12)


def test_the_random_bits_are_those_published_for_threefry():
    zero = np.zeros(1, np.uint64)
    with np.errstate(over="ignore"):
        bits = scalar_oracle.threefry((zero[0], zero[0]), (zero, zero))
    assert [int(b[0]) for b in bits] == [0xC2B6E3A8C2C69865, 0x6F81ED42F350084D]


def test_the_plain_third_order_filter_equals_bayes_rule_and_the_moment_equations():
    y = workloads.measurements(SMALL)
    mean, cov, third = (np.asarray(a).reshape(len(y), -1) for a in plain.third_order(SMALL)(y))
    history = oracle_history(y)
    for i, actual in enumerate((mean, cov, third)):
        np.testing.assert_allclose(actual, history[:, i].T, rtol=1e-12, atol=1e-12)


def test_every_ekf_row_follows_the_same_filter():
    y = workloads.measurements(SMALL_OSCILLATOR)[:8]
    expected = ekf_oracle(SMALL_OSCILLATOR, y)
    means = np.asarray(plain.ekf(SMALL_OSCILLATOR)(y)[0][:, -1])
    # RK4 of the covariance's equation and the tangent of an RK4 step differ by the method's error.
    np.testing.assert_allclose(means, expected, rtol=0, atol=1e-5)


def test_nlbench_rows_equal_the_oracles():
    y = workloads.measurements(SMALL)
    row = ours.third_order(SMALL, y)
    np.testing.assert_allclose(row.means[:, 0], oracle_history(y)[-1, 0], rtol=1e-12, atol=1e-12)
    y = workloads.measurements(SMALL_OSCILLATOR)
    np.testing.assert_allclose(
        ours.ekf(SMALL_OSCILLATOR, y).means,
        np.asarray(plain.ekf(SMALL_OSCILLATOR)(y)[0][:, -1]),
        rtol=1e-11,
        atol=1e-11,
    )


def test_the_engine_row_runs_every_trajectory_it_is_credited_with(tmp_path, monkeypatch):
    monkeypatch.setenv("NLBENCH_CACHE", str(tmp_path))
    row = ours.engine(SMALL, workloads.measurements(SMALL))
    sums = row.call()
    assert row.work == SMALL.blocks * 64 * SMALL.times * SMALL.steps
    assert {len(value) for value in sums.values()} == {SMALL.blocks}


@pytest.mark.parametrize("peer", [peers.dynamax, peers.filterpy])
def test_peers_equal_the_oracle(peer):
    y = workloads.measurements(SMALL_OSCILLATOR)
    try:
        row = peer(SMALL_OSCILLATOR, y)
    except rows.Unavailable as reason:
        pytest.skip(str(reason))
    means = row.means[:4]
    np.testing.assert_allclose(means, ekf_oracle(SMALL_OSCILLATOR, y[:4]), rtol=0, atol=1e-10)


def test_timings_are_ratios_to_the_first_row_and_end_with_it_again(monkeypatch):
    clock = SimpleNamespace(now=0.0, perf_counter=lambda: 2 * clock.now, process_time=lambda: clock.now)
    monkeypatch.setattr(harness, "time", clock)

    def taking(seconds):
        def call():
            clock.now += seconds

        return call

    timed = [rows.Row("one", taking(1e-3), 1, 0.0), rows.Row("ten", taking(1e-2), 2, 0.0)]
    first, second, again = harness.interleave(timed, rounds=5)
    assert (first.name, second.name, again.name) == ("one", "ten", "A/A: one again")
    np.testing.assert_allclose([first.ratio, second.ratio, again.ratio], [1, 5, 1])
    np.testing.assert_allclose([first.nanoseconds, first.share, second.rounds], [1e6, 0.5, 5])


def test_a_missing_compiler_is_a_reason_not_an_error(monkeypatch):
    monkeypatch.setenv("CC", "/nowhere/cc")
    with pytest.raises(native.CompilerMissing, match="/nowhere/cc"):
        native.build(1)
