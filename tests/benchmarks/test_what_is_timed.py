"""What the benchmarks time computes the right numbers: compared with NumPy oracles, never timed here."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import harness, native, ours, peers, plain, rows, table, workloads
from benchmarks.kernels.trace import Trace
from tests.benchmarks import moment_oracle, random_oracle

# Few enough measurements that no trajectory has lost positiveness: the oracle's quadrature wants a true density.
SMALL = {
    "scalar": workloads.SCALAR._replace(blocks=2, times=6),
    "oscillator": workloads.OSCILLATOR_THIRD._replace(blocks=2, times=3),
    "orbit": workloads.ORBIT._replace(blocks=2, times=4),
}
SMALL_OSCILLATOR = workloads.OSCILLATOR._replace(blocks=1, times=6)

needs_compiler = pytest.mark.skipif(not (shutil.which("gcc") or shutil.which("cc")), reason="no C compiler")
every_system = pytest.mark.parametrize("name", SMALL)


def oracle_history(name, order, y):
    return moment_oracle.filtered(moment_oracle.PROBLEMS[name], order, y)


def assert_close(name, actual, expected):
    """Unique components agree to 1e-10, in powers of the initial deviations: the same algebra, rounded otherwise."""
    deviations = np.array(moment_oracle.PROBLEMS[name].deviations)
    of_order = [deviations, deviations[:, None] * deviations]
    of_order.append(of_order[1][:, :, None] * deviations)
    scale = moment_oracle.components([each[None] for each in of_order])[0]
    error = np.abs(np.asarray(actual) - expected) / scale[: expected.shape[-1]]
    assert error.max() < 1e-10


def turned(name, y):
    """Angles with whole turns added, which must not matter."""
    return y + 2 * np.pi * (np.arange(y.shape[1]) % 3 - 1)[:, None] if name == "orbit" else y


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
@pytest.mark.parametrize(
    ("name", "order", "vectors"),
    [("scalar", 3, 1), ("scalar", 3, 2), ("scalar", 3, 4), ("oscillator", 3, 2), ("orbit", 3, 2)]
    + [(name, 2, 2) for name in SMALL],
)
def test_the_c_filters_equal_bayes_rule_and_the_moment_equations(name, order, vectors):
    y = workloads.measurements(SMALL[name])
    kernel = native.build(SMALL[name], order, vectors)
    out = native.moments(kernel, SMALL[name].blocks, SMALL[name].times)
    native.run_filter(kernel, native.measured(turned(name, y)), out)
    assert_close(name, by_trajectory(out), oracle_history(name, order, y))


def by_trajectory(out):
    """(blocks, times, k, 64) -> (trajectories, times, k)."""
    return out.transpose(0, 3, 1, 2).reshape(-1, out.shape[1], out.shape[2])


@needs_compiler
@every_system
def test_the_c_experiments_equal_their_oracle_for_trajectories_beyond_32_bits(name):
    kernel, first = native.build(SMALL[name], 3, 2), 2**33 + 17
    out = native.moments(kernel, 2, 3)
    native.run_experiment(kernel, 1969, first, out)
    trajectories = np.uint64(first) + np.arange(128, dtype=np.uint64)
    expected = moment_oracle.experiment(moment_oracle.PROBLEMS[name], 1969, trajectories, 3)
    assert_close(name, by_trajectory(out), expected)


@needs_compiler
def test_the_vector_arctangent_is_right_to_rounding_in_every_direction(tmp_path):
    source, target = tmp_path / "angles.c", tmp_path / "angles.so"
    source.write_text(
        '#include "normals.h"\n'
        "void angles(long n, const real *y, const real *x, real *to)"
        " { for (long i = 0; i < n; i++) to[i] = angle(y[i], x[i]); }"
    )
    compiler = shutil.which("gcc") or shutil.which("cc")
    include = f"-I{native.SOURCE.parent}"
    subprocess.run([compiler, *native.FLAGS, include, str(source), "-o", str(target)], check=True)
    x, y, found = (native.aligned((80_000,)) for _ in range(3))
    turn = np.random.default_rng(0).uniform(-np.pi, np.pi, len(x))
    turn[:8] = np.arange(8) * np.pi / 4  # the axes and the diagonals
    x[:], y[:] = 5.7e6 * np.cos(turn), 5.7e6 * np.sin(turn)
    x[8], y[8] = -5.7e6, 0.0  # where the angle jumps
    pointers = [ctypes.c_void_p(each.ctypes.data) for each in (y, x, found)]
    ctypes.CDLL(str(target)).angles(ctypes.c_long(len(x) // 8), *pointers)
    np.testing.assert_allclose(found, np.arctan2(y, x), rtol=1e-15, atol=0)


def test_traced_arithmetic_forms_no_zero_and_nothing_twice():
    trace = Trace()
    x, y = trace.variable("x"), trace.variable("y")
    assert 0.0 * x + 1.0 * y - 0.0 == y
    (x * y, y * x, -(x * -y), x + y, y + x)
    assert trace.lines == ["const real v0 = x * y;", "const real v1 = x + y;"]
    assert trace.operations == 2


def test_the_random_bits_are_those_published_for_threefry():
    zero = np.zeros(1, np.uint64)
    with np.errstate(over="ignore"):
        bits = random_oracle.threefry((zero[0], zero[0]), (zero, zero))
    assert [int(b[0]) for b in bits] == [0xC2B6E3A8C2C69865, 0x6F81ED42F350084D]


@every_system
def test_the_plain_third_order_filter_equals_bayes_rule_and_the_moment_equations(name):
    y = workloads.measurements(SMALL[name])
    moments = plain.third_order(SMALL[name])(turned(name, y))
    flat = [np.asarray(each).reshape(-1, *each.shape[2:]) for each in moments]
    actual = moment_oracle.components(flat).reshape(*y.shape[:2], -1)
    assert_close(name, actual, oracle_history(name, 3, y))


def test_every_ekf_row_follows_the_same_filter():
    y = workloads.measurements(SMALL_OSCILLATOR)[:8]
    expected = ekf_oracle(SMALL_OSCILLATOR, y)
    means = np.asarray(plain.ekf(SMALL_OSCILLATOR)(y)[0][:, -1])
    # RK4 of the covariance's equation and the tangent of an RK4 step differ by the method's error.
    np.testing.assert_allclose(means, expected, rtol=0, atol=1e-5)


@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=pytest.mark.long if each == "orbit" else ()) for each in SMALL]
)
def test_nlbench_third_order_rows_equal_the_oracle(name):
    y = workloads.measurements(SMALL[name])
    row = ours.third_order(SMALL[name], turned(name, y))
    assert_close(name, row.means, oracle_history(name, 3, y)[:, -1, : len(SMALL[name].mean)])


def test_the_nlbench_ekf_row_equals_the_plain_one():
    y = workloads.measurements(SMALL_OSCILLATOR)
    plainly = np.asarray(plain.ekf(SMALL_OSCILLATOR)(y)[0][:, -1])
    np.testing.assert_allclose(ours.ekf(SMALL_OSCILLATOR, y).means, plainly, rtol=1e-11, atol=1e-11)


def test_the_engine_row_runs_every_trajectory_it_is_credited_with(tmp_path, monkeypatch):
    monkeypatch.setenv("NLBENCH_CACHE", str(tmp_path))
    small = SMALL["scalar"]
    row = ours.engine(small, workloads.measurements(small))
    sums = row.call()
    assert row.work == ours.BLOCKS_OF_A_CALL * 64 * small.times * small.steps
    assert {len(value) for value in sums.values()} == {ours.BLOCKS_OF_A_CALL}


@pytest.mark.parametrize("peer", [peers.dynamax, peers.cuthbert, peers.filterpy])
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
    np.testing.assert_allclose(second.over(first), 5)
    np.testing.assert_allclose([first.nanoseconds, first.share, second.rounds], [1e6, 0.5, 5])


def test_last_means_are_compared_leaving_out_the_worst_hundredth():
    base = np.zeros((200, 1))
    means = np.full((200, 1), 0.4e-9)
    means[:2] = np.nan
    assert table.deviation(means, base, workloads.SCALAR) == pytest.approx(1e-9)
    means[2] = np.nan
    assert table.deviation(means, base, workloads.SCALAR) == np.inf


def test_a_missing_compiler_is_a_reason_not_an_error(monkeypatch):
    monkeypatch.setenv("CC", "/nowhere/cc")
    with pytest.raises(native.CompilerMissing, match="/nowhere/cc"):
        native.build(SMALL["scalar"]._replace(step=0.03), 3, 1)  # one that has not been compiled yet
