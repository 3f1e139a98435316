"""Claim: the rates of the filters of continuous measurements are the golden ones, corrected and as printed."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from tests.oracle import fourth_moment
from tests.problems import assert_golden, golden, quadratic


def cases(*groups):
    """One test parameter for each case of each (group, filter name, options)."""
    return [
        pytest.param(name, options, inputs, outputs, id=f"{group}-{name}-{case_id}")
        for group, name, options in groups
        for case_id, inputs, outputs in golden(group)
    ]


def continuous(initial, drift, observe, gamma, **more):
    return nb.System(
        drift=drift,
        observe=observe,
        measurement_cov=gamma,
        initial=initial,
        measurement="continuous",
        step=0.01,
        **more,
    )


def rates_of(name, system, y, **options):
    f = nb.filters.build(name, system, **options)
    return f.rates(f.init(system.initial), 0.0, y)


def assert_rates(rates, outputs):
    named = {"dm": rates.mean, "dP": rates.cov, "dS": rates.third, "dmu4": rates.fourth}
    assert {name for name in named if named[name] is not None} == set(outputs)
    for name, expected in outputs.items():
        assert_golden(named[name], expected, name)


PRINTED = {"equations": "printed"}
KUSHNER = (
    ("culver.continuous2/corrected", "kushner-2", {}),
    ("culver.continuous2/corrected", "kushner-2", PRINTED),
    ("culver.continuous3/corrected", "kushner-3", {}),
    ("culver.continuous3/printed", "kushner-3", PRINTED),
    ("culver.continuous4/corrected", "kushner-4", {}),
    ("culver.continuous4/printed", "kushner-4", PRINTED),
)


@pytest.mark.parametrize(("name", "options", "inputs", "outputs"), cases(*KUSHNER))
def test_culver_filters_have_the_golden_rates(name, options, inputs, outputs):
    mean, cov = inputs["m"], inputs["P"]
    fourth = fourth_moment(cov, inputs["k4"]) if "k4" in inputs else None
    system = continuous(
        nb.Moments(mean, cov, inputs.get("S"), fourth),
        quadratic(mean, inputs["f"], inputs["F"], inputs["A"]),
        quadratic(mean, inputs["h"], inputs["H"], inputs["M"]),
        inputs["Gamma"],
        diffusion=lambda t, x: jnp.eye(len(mean)),
        diffusion_cov=inputs["V"],
    )
    assert_rates(rates_of(name, system, inputs["y"], **options), outputs)


CHAPTER_7 = {"equations": "printed-scalar"}
SCALAR = (
    ("culver.scalar7_second/(7.4)", "kushner-2", CHAPTER_7),
    ("culver.scalar7_second/(7.4)", "kushner-2", {}),
    ("culver.scalar7_third/(7.5)", "kushner-3", CHAPTER_7),
    ("culver.scalar7_third/(7.5)", "kushner-3", {}),
    ("culver.scalar7_fourth/printed", "kushner-4", CHAPTER_7),
    ("culver.scalar7_fourth/corrected", "kushner-4", {}),
)


@pytest.mark.parametrize(("name", "options", "inputs", "outputs"), cases(*SCALAR))
def test_chapter_7_has_the_golden_rates(name, options, inputs, outputs):
    """(7.5) needs no correction, (7.6) does."""
    moments = [inputs[key].reshape((1,) * order) for order, key in enumerate(("m", "mu2", "mu3", "mu4"), 1)]
    system = continuous(nb.Moments(*moments), lambda t, x: -2 * x + 0.7 * x**2, lambda t, x: x, [[0.16]])
    names = {"dm": "dm", "dmu2": "dP", "dmu3": "dS", "dmu4": "dmu4"}
    outputs = {
        names[key]: value.reshape((1,) * (key == "dm" or int(key[-1]))) for key, value in outputs.items()
    }
    assert_rates(rates_of(name, system, inputs["y"].reshape(1), **options), outputs)


SECOND_ORDER = (
    ("second_order.continuous/henriksen", "truncated", {}),
    ("second_order.continuous/henriksen", "schwartz-4", {}),
    ("second_order.continuous/truncated", "truncated-jazwinski", {}),
    ("second_order.continuous/truncated", "schwartz-3", {}),
    ("second_order.continuous/gaussian", "kushner-2", {}),
    ("second_order.continuous/gaussian", "schwartz-2", {}),
)


@pytest.mark.parametrize(("name", "options", "inputs", "outputs"), cases(*SECOND_ORDER))
def test_second_order_filters_with_curved_diffusion_have_the_golden_rates(name, options, inputs, outputs):
    G, Gx, Gxx = inputs["G"], inputs["Gx"], inputs["Gxx"]
    mean = np.linspace(-0.7, 0.9, len(inputs["P"]))

    def diffusion(t, x):
        e = x - mean
        return G + jnp.einsum("ijp,p->ij", Gx, e) + 0.5 * jnp.einsum("ijpq,p,q->ij", Gxx, e, e)

    system = continuous(
        nb.Moments(mean, inputs["P"]),
        quadratic(mean, inputs["f"], inputs["F"], inputs["fxx"] / 2),
        quadratic(mean, inputs["h"], inputs["H"], inputs["hxx"] / 2),
        inputs["W"],
        diffusion=diffusion,
        diffusion_cov=inputs["V"],
    )
    rates = rates_of(name, system, inputs["y"], **options)
    assert_rates(rates, {"dm": outputs["dx"], "dP": outputs["dP"]})


@pytest.mark.parametrize(
    ("name", "options", "inputs", "outputs"),
    cases(("linearised_nominal.continuous/kalman_bucy", "schwartz-1", {})),
)
def test_the_filter_about_a_nominal_has_the_golden_rates(name, options, inputs, outputs):
    nominal, n = np.linspace(0.4, -1.1, len(inputs["P"])), len(inputs["P"])
    system = continuous(
        nb.Moments(nominal + inputs["delta"], inputs["P"]),
        quadratic(nominal, np.full(n, 0.3), inputs["Fn"], np.ones((n, n, n))),
        quadratic(nominal, inputs["hn"], inputs["Hn"], np.ones((len(inputs["hn"]), n, n))),
        inputs["W"],
        diffusion=lambda t, x: jnp.eye(n),
        diffusion_cov=inputs["V"],
    )
    rates = rates_of(name, system, inputs["y"], nominal=nominal.tolist())
    assert_rates(rates, {"dm": outputs["ddelta"] + 0.3, "dP": outputs["dP"]})


EIGHT = [(f"schwartz.filter{i}/corrected", f"schwartz-{i}", {}) for i in range(2, 9)]
EIGHT += [(f"schwartz.filter{i}/printed", f"schwartz-{i}", PRINTED) for i in range(3, 8)]
EIGHT += [(f"schwartz.filter{i}/corrected", f"schwartz-{i}", PRINTED) for i in (2, 8)]
SAME = [("schwartz.filter6/corrected", name, {}) for name in ("ekf", "linearised-kalman")]


def schwartz_system(inputs, start):
    return nb.systems.build(
        "schwartz",
        dynamics=f"D{int(inputs['D'])}",
        measurement=f"M{int(inputs['M'])}",
        process_psd=float(inputs["sv2"]),
        measurement_psd=float(inputs["sw2"]),
    ), nb.Moments([float(start)], [[float(inputs["p"])]])


@pytest.mark.parametrize(("name", "options", "inputs", "outputs"), cases(*EIGHT, *SAME))
def test_schwartz_filters_have_the_golden_rates(name, options, inputs, outputs):
    system, start = schwartz_system(inputs, inputs["x"])
    f = nb.filters.build(name, system, **options)
    rates = f.rates(f.init(start), 0.0, inputs["y"].reshape(1))
    assert_rates(rates, {"dm": outputs["dx"].reshape(1), "dP": outputs["dp"].reshape(1, 1)})


@pytest.mark.parametrize(
    ("name", "options", "inputs", "outputs"), cases(("schwartz.filter1/corrected", "schwartz-1", {}))
)
def test_the_linear_schwartz_filter_has_the_golden_rates(name, options, inputs, outputs):
    """(80) is in deviations from the nominal: the estimate moves with f, the measurement is less h, at the nominal."""
    system, start = schwartz_system(inputs, inputs["x"] + inputs["delta"])
    f = nb.filters.build(name, system, nominal=float(inputs["x"]))
    rates = f.rates(f.init(start), 0.0, (inputs["y"] + inputs["h"]).reshape(1))
    assert_rates(rates, {"dm": (outputs["dx"] + inputs["f"]).reshape(1), "dP": outputs["dp"].reshape(1, 1)})


@pytest.mark.parametrize(
    ("name", "options", "inputs", "outputs"), cases(("schwartz.modified_k/corrected", "schwartz-k", {}))
)
def test_the_weighted_filter_has_the_golden_rates(name, options, inputs, outputs):
    g, g1 = inputs["g"], inputs["g1"]
    mean = np.linspace(-0.2, 0.5, len(inputs["P"]))
    system = continuous(
        nb.Moments(mean, inputs["P"]),
        quadratic(mean, inputs["f"], inputs["f1"], inputs["f2"] / 2),
        quadratic(mean, inputs["h"], inputs["h1"], inputs["h2"] / 2),
        inputs["W"],
        diffusion=lambda t, x: g + jnp.einsum("ijp,p->ij", g1, x - mean),
    )
    rates = rates_of(name, system, inputs["y"], k=float(inputs["k"]))
    assert_rates(rates, {"dm": outputs["dx"], "dP": outputs["dP"]})
