"""Claim: the thesis's series, integration and two-step updates reproduce the golden posteriors and rates, printed and
corrected."""

from __future__ import annotations

import numpy as np
import pytest

import nlbench as nb
from tests.oracle import fourth_moment
from tests.problems import assert_golden, golden, linear_measurement, quadratic, updated

EQUATIONS = ("printed", "corrected")


def cases(group):
    """One test parameter for each case of <group>/printed and <group>/corrected."""
    return [
        pytest.param(equations, inputs, outputs, id=f"{group}-{equations}-{case_id}")
        for equations in EQUATIONS
        for case_id, inputs, outputs in golden(f"{group}/{equations}")
    ]


def assert_moments(moments, outputs):
    for name, array in zip(("m", "P", "S", "mu4"), moments, strict=True):
        if name in outputs:
            assert_golden(array, outputs[name], name)


def normaliser(inputs, nu):
    """The source's K: (1 + nu) e^theta/alpha, the second factor being N(z; 0, S_z)/N(z; 0, R) for an invertible R."""
    h, noise, z = inputs["H"], inputs["R"], inputs["z"]
    s = h @ inputs["P"] @ h.T + noise
    distance = z @ (np.linalg.inv(noise) - np.linalg.inv(s)) @ z
    return (1 + nu) * np.exp(distance / 2) * np.sqrt(np.linalg.det(noise) / np.linalg.det(s))


def scalar_series(inputs):
    """The inputs of a scalar case under the names and shapes of a vector one."""
    names = {"m": "m", "P": "mu2", "S": "mu3", "mu4": "mu4", "H": "H", "R": "R", "z": "z"}
    ranks = {"m": 1, "z": 1, "P": 2, "H": 2, "R": 2, "S": 3, "mu4": 4}
    return {name: inputs[theirs].reshape((1,) * ranks[name]) for name, theirs in names.items()}


@pytest.mark.parametrize(("equations", "inputs", "outputs"), cases("culver.series_vector"))
def test_fourth_order_series_is_appendix_f(equations, inputs, outputs):
    system = linear_measurement(*(inputs[name] for name in ("m", "P", "H", "R", "S", "mu4")))
    y = inputs["H"] @ inputs["m"] + inputs["z"]
    moments, info = updated("series-4", system, y, equations=equations)
    assert_moments(moments, outputs)
    assert_golden(normaliser(inputs, float(info.nu)), outputs["K"], "K")


@pytest.mark.parametrize(("equations", "inputs", "outputs"), cases("culver.series_scalar"))
def test_fourth_order_series_is_appendix_f_for_a_scalar(equations, inputs, outputs):
    inputs = scalar_series(inputs)
    system = linear_measurement(*(inputs[name] for name in ("m", "P", "H", "R", "S", "mu4")))
    y = inputs["H"] @ inputs["m"] + inputs["z"]
    moments, info = updated("series-4", system, y, equations=equations)
    for array, name in zip(moments, ("m", "mu2", "mu3", "mu4"), strict=True):
        assert_golden(np.ravel(array)[0], outputs[name], name)
    assert_golden(normaliser(inputs, float(info.nu)), outputs["K"], "K")


@pytest.mark.parametrize(("equations", "inputs", "outputs"), cases("culver.series_vector"))
def test_third_order_series_is_the_fourth_without_a_fourth_cumulant(equations, inputs, outputs):
    """(F.37)-(F.40) with E4 = 0."""
    gaussian = fourth_moment(inputs["P"])
    system = linear_measurement(*(inputs[name] for name in ("m", "P", "H", "R", "S")), gaussian)
    y = inputs["H"] @ inputs["m"] + inputs["z"]
    third, _ = updated("series-3", system, y, equations=equations)
    fourth, _ = updated("series-4", system, y, equations=equations)
    for mine, theirs in zip(third[:3], fourth[:3], strict=True):
        assert_golden(mine, np.asarray(theirs), "moment")


def state(inputs, order=3):
    fourth = fourth_moment(inputs["P"], inputs["k4"]) if order == 4 else None
    return nb.Moments(inputs["m"], inputs["P"], inputs["S"], fourth)


def tempered(inputs, order=3, **options):
    moments = state(inputs, order)
    z = inputs["y"] - inputs["h0"]
    return nb.updates.tempering_rates(moments, inputs["m0"], z, inputs["H"], inputs["R"], **options)


@pytest.mark.parametrize(("equations", "inputs", "outputs"), cases("culver.integration_rhs"))
def test_integration_rates_are_appendix_g(equations, inputs, outputs):
    assert_moments(tempered(inputs, equations=equations), rates_only(outputs))


@pytest.mark.parametrize(
    ("inputs", "outputs"), [pytest.param(i, o, id=c) for c, i, o in golden("homotopy4.rhs/linear_h")]
)
def test_tempering_rates_of_fourth_order(inputs, outputs):
    assert_moments(tempered(inputs, order=4), rates_only(outputs))


@pytest.mark.parametrize(
    ("inputs", "outputs"), [pytest.param(i, o, id=c) for c, i, o in golden("homotopy3.rhs/quadratic_h")]
)
def test_tempering_rates_for_a_quadratic_measurement(inputs, outputs):
    assert_moments(tempered(inputs, M=inputs["M"]), rates_only(outputs))


def rates_only(outputs):
    return {name.removeprefix("d"): value for name, value in outputs.items()}


@pytest.mark.parametrize(("equations", "inputs", "outputs"), cases("culver.twostep_rhs"))
def test_two_step_rates_are_those_of_section_5_6(equations, inputs, outputs):
    assert_moments(bent(inputs, equations=equations), rates_only(outputs))


@pytest.mark.parametrize(
    ("inputs", "outputs"),
    [pytest.param(i, o, id=c) for c, i, o in golden("culver.twostep_rhs/corrected_cumulant_closure")],
)
def test_two_step_rates_with_the_cumulant_closure(inputs, outputs):
    assert_moments(bent(inputs, closure="cumulant"), rates_only(outputs))


def bent(inputs, **options):
    measurement = (inputs[name] for name in ("m0", "z", "H", "M", "R"))
    return nb.updates.two_step_rates(inputs["s"], state(inputs), *measurement, **options)


@pytest.mark.parametrize(("equations", "inputs", "outputs"), cases("culver.twostep_scalar_rhs"))
def test_two_step_rates_are_the_scalar_equations(equations, inputs, outputs):
    """(5.87)-(5.89): d/dE at E = s M is d/ds at s = 1 over M."""
    moments = nb.Moments([inputs["m_plus"]], [[inputs["mu2"]]], [[[inputs["mu3"]]]])
    h, m, noise = [[inputs["H"]]], [[[inputs["E"]]]], [[inputs["R"]]]
    rates = nb.updates.two_step_rates(
        1.0, moments, [inputs["m0"]], [inputs["z"]], h, m, noise, equations=equations
    )
    for array, name in zip(rates, ("dm", "dmu2", "dmu3"), strict=False):
        assert_golden(np.ravel(array)[0] / inputs["E"], outputs[name], name)


@pytest.mark.parametrize(("equations", "inputs", "outputs"), cases("culver.integration_update"))
def test_integration_update(equations, inputs, outputs):
    system = linear_measurement(*(inputs[name] for name in ("m", "P", "H", "R", "S")))
    y = inputs["H"] @ inputs["m"] + inputs["y"] - inputs["h0"]
    moments, _ = updated("integration-update", system, y, equations=equations, steps=20)
    assert_moments(moments, outputs)


@pytest.mark.parametrize(("equations", "inputs", "outputs"), cases("culver.twostep_update"))
def test_two_step_update(equations, inputs, outputs):
    r = len(inputs["z"])
    system = nb.System(
        drift=lambda t, x: 0 * x,
        observe=quadratic(inputs["m"], np.zeros(r), inputs["H"], inputs["M"]),
        measurement_cov=inputs["R"],
        initial=nb.Moments(inputs["m"], inputs["P"], inputs["S"]),
    )
    moments, _ = updated("two-step-3", system, inputs["z"], equations=equations, steps=20)
    assert_moments(moments, outputs)


@pytest.mark.parametrize("name", ["quadrature-3", "direct-3"])
@pytest.mark.parametrize(
    ("inputs", "outputs"),
    [pytest.param(i, o, id=c) for c, i, o in golden("bayes.nonlinear_scalar/h=3x-0.5x^2")],
)
def test_numerical_integration_is_bayes_for_the_quadratic_measurement(name, inputs, outputs):
    """To the 1e-6 that the golden values claim."""
    system = nb.System(
        drift=lambda t, x: 0 * x,
        observe=lambda t, x: 3 * x - 0.5 * x**2,
        measurement_cov=inputs["R"].reshape(1, 1),
        initial=nb.Moments(*(inputs[k].reshape((1,) * r) for k, r in (("m", 1), ("mu2", 2), ("mu3", 3)))),
    )
    options = {"points": 15} if name.startswith("quadrature") else {}
    moments, _ = updated(name, system, inputs["y"].reshape(1), **options)
    for array, key in zip(moments, ("m", "mu2", "mu3"), strict=False):
        np.testing.assert_allclose(np.ravel(array)[0], outputs[key], rtol=1e-6, atol=1e-12)
