"""Claims: importing nlbench changes nothing; settings are made once, before jax starts; too late is said."""

from __future__ import annotations

import re
import sys

import jax
import numpy as np
import pytest

import nlbench as nb
from nlbench import runtime
from nlbench.errors import ConfigError, EnvironmentFault
from tests.small_runs import python


def output(program, **options):
    done = python(program, **{"xla_flags": "", **options})
    assert done.returncode == 0, done.stderr
    return done


def test_import_loads_neither_jax_nor_pandas_and_sets_nothing():
    program = "import os, sys, nlbench; print('jax' in sys.modules, 'pandas' in sys.modules, os.environ['XLA_FLAGS'])"
    assert output(program).stdout.split() == ["False", "False"]


def test_configure_sets_double_precision_and_the_options_and_keeps_the_users_own():
    program = (
        "import os, nlbench; nlbench.configure(); nlbench.configure(); import jax\n"
        "print(jax.numpy.zeros(1).dtype, os.environ['XLA_FLAGS'])"
    )
    dtype, *flags = output(program, xla_flags="--xla_cpu_prefer_vector_width=256").stdout.split()
    assert dtype == "float64"
    assert flags[0] == "--xla_cpu_prefer_vector_width=256"
    assert len(flags) == 3
    assert flags[1].startswith("--xla_backend_optimization_level=")
    assert flags[2].startswith("--xla_backend_extra_options=")


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_elementary_functions_are_right_with_the_options(precision):
    """Of numbers and of vectors longer than one register; XLA's own arctan is not."""
    program = (
        f"import nlbench; nlbench.configure(precision={precision!r}); import jax, numpy as np\n"
        f"x = np.linspace(-20, 20, 1501).astype({precision!r})\n"
        "for name in 'arctan sin cos tan tanh exp expm1 arcsinh cbrt square'.split():\n"
        "    expected = getattr(np, name)(x); found = jax.jit(getattr(jax.numpy, name))(x)\n"
        "    error = np.abs(found - expected) / np.maximum(np.abs(expected), 1)\n"
        "    print(float(error.max() / np.finfo(x.dtype).eps))"
    )
    errors = [float(line) for line in output(program).stdout.split()]
    assert len(errors) == 10
    assert max(errors) < 100, errors


def test_too_late_is_said_once():
    program = (
        "import jax; jax.numpy.zeros(1).block_until_ready(); import nlbench" + 2 * "; nlbench.configure()"
    )
    assert output(program).stderr.count("call nlbench.configure() before") == 1


def test_single_precision_when_asked_and_no_other_afterwards():
    program = (
        "import nlbench; nlbench.configure(precision='float32'); import jax; print(jax.numpy.zeros(1).dtype)\n"
        "try: nlbench.configure()\nexcept nlbench.errors.ConfigError as error: print(error)"
    )
    lines = output(
        program.replace("import nlbench;", "import nlbench, nlbench.errors;", 1)
    ).stdout.splitlines()
    assert lines[0] == "float32"
    assert "float32 in this process" in lines[1]


def test_an_unknown_precision_is_refused():
    with pytest.raises(ConfigError, match="float16"):
        nb.configure(precision="float16")


def test_a_moment_filter_refuses_continuous_measurements():
    system = nb.System(
        drift=lambda t, x: x,
        observe=lambda t, x: x,
        measurement_cov=np.eye(1),
        initial=nb.Moments(np.zeros(1), np.eye(1)),
        measurement="continuous",
    )
    with pytest.raises(ConfigError, match="discrete times"):
        nb.filters.build("third-order", system)


def test_every_wrong_shape_is_named_with_what_was_expected():
    system = nb.System(
        drift=lambda t, x: x[:1],
        observe=lambda t, x: x,
        measurement_cov=np.eye(1),
        initial=nb.Moments(np.zeros(2), np.eye(3)),
        diffusion=lambda t, x: np.ones((3, 1)),
    )
    with pytest.raises(ConfigError) as caught:
        nb.filters.build("ekf", system)
    here = "tests/runtime/test_configure.py:"
    assert [re.sub(rf"^.*{here}\d+: ", "", line) for line in str(caught.value).splitlines()] == [
        "initial.cov: got shape (3, 3), expected (2, 2)",
        "drift(t, x): got shape (1,), expected (2,)",
        "observe(t, x): got shape (2,), expected (1,)",
        "diffusion(t, x): got shape (3, 1), expected (2, any)",
    ]


@pytest.mark.parametrize(
    ("plug_in", "node", "platforms", "block"),
    [
        (True, True, "", 8192),
        (True, True, "cuda,cpu", 8192),
        (True, True, "cpu", 64),
        (True, False, "", 64),
        (False, True, "", 64),
    ],
)
def test_blocks_are_larger_where_jax_will_compute_on_a_gpu(
    monkeypatch, tmp_path, plug_in, node, platforms, block
):
    monkeypatch.setattr(runtime, "backend_started", lambda: False)
    monkeypatch.setattr(runtime, "find_spec", lambda name: object() if plug_in else None)
    monkeypatch.setattr(runtime, "DEVICES", tmp_path)
    monkeypatch.setenv("JAX_PLATFORMS", platforms)
    if node:
        (tmp_path / "nvidia0").touch()
    assert runtime.block() == block


def test_blocks_are_of_64_where_cores_compute():
    jax.devices()
    assert runtime.block() == 64


def test_elsewhere_than_on_linux_that_is_said_at_once(monkeypatch):
    monkeypatch.setattr(sys, "platform", "darwin")
    with pytest.raises(EnvironmentFault, match=r"computes on Linux, .*; this is darwin"):
        runtime.configure()
