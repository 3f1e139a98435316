"""Claim: times that a file leaves out fit those that it writes, and no message names a key that it does not write."""

from __future__ import annotations

import itertools
import re
from fractions import Fraction

import pytest

from nlbench import config, plugins
from nlbench.config import times
from nlbench.errors import ConfigError
from nlbench.filters import catalogue

SYSTEMS = {
    "default interval": {"name": "culver-scalar"},
    "interval": {"name": "culver-scalar", "interval": 0.3},
    "unmeasured": {"name": "oscillator", "measurement": "none"},
    "all the time": {"name": "culver-scalar", "measurement": "continuous"},
    "sightings": {"name": "lunar-orbit"},
    "steps": {"name": "ungm"},
    "three steps": {"name": "ungm", "interval": 3},
    "own": {"name": "own", "interval": 0.25},
    "own steps, unmeasured": {"name": "own", "time": "discrete"},
}
MEASURED = {
    "default interval": "0.1", "interval": "0.3", "steps": "1", "three steps": "3", "own": "0.25",
}  # fmt: skip
DISCRETE = ("steps", "three steps", "own steps, unmeasured")
KEY = re.compile(r"(?:time|system|truth|filters|report_times|claims)\.[\w.]*\w")
CHOICES = {
    "time.end": (None, 2, 9900, 0.7),
    "time.step": (None, 0.02, 0.03, 30),
    "time.output": (None, 0.25, 0.2, 6),
    "report_times": (None, [0.5], [0.3, 1.2], [2, 6]),
    "filters.0.step": (None, 0.05),
}


def stated(system, written):
    """An experiment with these keys, as plain data."""
    step = written.get("filters.0.step")
    plain = {
        "experiment": "times",
        "system": SYSTEMS[system],
        "filters": [{"name": "ekf"} if step is None else {"name": "ekf", "step": step}],
        "time": {key.split(".")[1]: value for key, value in written.items() if key.startswith("time.")},
    }
    return plain | ({"report_times": written["report_times"]} if "report_times" in written else {})


def settled(plain):
    """The experiment or None, and what is wrong with it."""
    try:
        return config.from_dict(plain), []
    except ConfigError as error:
        return None, error.problems


def divides(unit, whole):
    return whole % unit == 0


def conflict(system, written):
    """Whether what is written cannot fit together, in exact arithmetic."""
    exact = {key: Fraction(str(value)) for key, value in written.items() if key != "report_times"}
    reports = [Fraction(str(each)) for each in written.get("report_times", [])]
    end, step, own = (exact.get(key) for key in ("time.end", "time.step", "filters.0.step"))
    interval = Fraction(MEASURED[system]) if system in MEASURED else None
    if system in DISCRETE:
        if own or step not in (None, 1):
            return True
        step = Fraction(1)
    outputs = [exact["time.output"]] if "time.output" in exact else []
    units = [each for each in (step, own) if each]
    wholes = [*reports, end] if end else reports
    return (
        any(each > end for each in (*reports, interval or 0) if end)
        or not all(divides(unit, whole) for unit in units for whole in (*outputs, *wholes))
        or not all(divides(unit, whole) for unit in outputs for whole in wholes)
        or bool(interval and step and not divides(step, interval))
        or bool(system == "all the time" and step and own and step != own)
    )


def misfits(experiment, system, written):
    """What does not fit of the times of an experiment, in exact arithmetic."""
    end, step, output = (
        Fraction(getattr(experiment.time, key)).limit_denominator(10**6) for key in ("end", "step", "output")
    )
    reports = [Fraction(each).limit_denominator(10**6) for each in experiment.report_times]
    interval = Fraction(MEASURED[system]) if system in MEASURED else None
    own = Fraction(str(written["filters.0.step"])) if "filters.0.step" in written else step
    holds = {
        "output is steps": divides(step, output) and divides(own, output),
        "end is outputs": divides(output, end),
        "reports are outputs": all(divides(output, each) for each in reports),
        "reports are in time": max(reports) <= end,
        "the interval is steps": interval is None or divides(step, interval),
        "something is measured": interval is None or interval <= end,
        "a step is one": system not in DISCRETE or step == 1,
        "steps are the same": system != "all the time" or own == step,
        "not too many": end / output <= times.MOST_OUTPUTS and end / step <= times.MOST_STEPS,
        "as written": all(
            getattr(experiment.time, key) == written.get(f"time.{key}", getattr(experiment.time, key))
            for key in ("end", "step", "output")
        ),
    }
    return [name for name, held in holds.items() if not held]


def keys_of(plain):
    """The keys that plain data write, as messages name them."""
    system = {f"system.{key}" for key in plain["system"]} if isinstance(plain["system"], dict) else set()
    steps = {f"filters.{i}.step" for i, each in enumerate(plain["filters"]) if "step" in each}
    listed = {key for key in ("report_times", "claims") if key in plain}
    return system | steps | listed | {f"time.{key}" for key in plain.get("time", {})}


def unwritten(plain, problems):
    """Keys that the problems name and the data do not write."""
    known = keys_of(plain)
    named = {name for each in problems for name in KEY.findall(f"{each.path} {each.message}")}
    return {name for name in named if name not in known and name.split(".")[0] not in known}


@pytest.mark.parametrize("system", SYSTEMS)
def test_whatever_is_left_out_fits_or_what_is_written_does_not(system):
    for values in itertools.product(*CHOICES.values()):
        written = {key: value for key, value in zip(CHOICES, values, strict=True) if value is not None}
        plain = stated(system, written)
        experiment, problems = settled(plain)
        if experiment is None:
            assert conflict(system, written), (written, problems)
            assert unwritten(plain, problems) == set(), (written, problems)
        else:
            assert not conflict(system, written), written
            assert misfits(experiment, system, written) == [], (written, experiment.time)
            assert config.from_dict(experiment.resolved()) == experiment


@pytest.mark.parametrize(
    ("system", "time", "expected"),
    [
        ("lunar-orbit", {"end": 9900, "step": 30}, (9900, 30, 450)),
        ("culver-scalar", {}, (2, 0.01, 0.1)),
        ("culver-scalar", {"end": 3}, (3, 0.01, 0.1)),
        ("schwartz", {"end": 40}, (40, 0.2, 2)),
        ("schwartz", {"end": 0.997, "step": 0.001}, (0.997, 0.001, 0.001)),
        ("lunar-orbit", {"step": 30}, (6000, 30, 300)),
        ("ungm", {"end": 10**6}, (10**6, 1, 50_000)),
    ],
)
def test_a_spacing_left_out_is_the_interval_or_near_a_twentieth(system, time, expected):
    found = config.from_dict(
        {"experiment": "x", "system": system, "filters": ["no-filter"], "time": time}
    ).time
    assert (found.end, found.step, found.output) == pytest.approx(expected, rel=1e-12)


def test_report_times_between_the_usual_outputs_are_outputs():
    plain = {"experiment": "x", "system": SYSTEMS["unmeasured"], "filters": ["ekf"]}
    time = config.from_dict({**plain, "report_times": [0.5, 1.3]}).time
    assert (time.end, time.output) == (4.0, pytest.approx(0.1))
    assert config.from_dict({**plain, "report_times": [7.0]}).time.end == pytest.approx(7.0)


def test_times_that_claims_name_are_report_times_where_the_file_lists_none():
    claim = {"id": "C1", "says": "x", "statistic": "rms", "of": ["ekf"], "below": 1, "at": [0.3, 1]}
    plain = {"experiment": "x", "system": "culver-scalar", "filters": ["ekf"], "claims": [claim]}
    experiment = config.from_dict(plain)
    assert experiment.report_times == [0.3, 1.0, 2.0]
    assert experiment.time.output == pytest.approx(0.1)
    with pytest.raises(ConfigError, match=r"^claims\.0\.at\.1: the time 1 is after time\.end = 0\.9$"):
        config.from_dict({**plain, "time": {"end": 0.9}})


@pytest.mark.parametrize(
    ("plain", "path", "says"),
    [
        ({"time": {"step": 0.03}}, "time.step", "0.03 does not divide the time between measurements, 0.1"),
        ({"time": {"end": 0.05}}, "time.end", "0.05 is shorter than the time between measurements, 0.1"),
        (
            {"time": {"end": 0.05}, "system": {"name": "culver-scalar", "interval": 0.2}},
            "system.interval", "0.2 is longer than time.end = 0.05",
        ),
        ({"time": {"end": 3.14159265358979}}, "time.end", "with the time between measurements, 0.1, needs steps of"),
        ({"report_times": [0.5, 0.123456789]}, "report_times.1", "needs outputs every 1"),
        ({"report_times": [0.5, 0.5]}, "report_times.1", "the report time 0.5 is repeated"),
        ({"report_times": [2, 1.55], "time": {"output": 0.1}}, "report_times.1", "1.55 is not a multiple of"),
        ({"system": "ungm", "time": {"output": 1.5}}, "time.output", "not a whole number of steps; nearest: 1 or 2"),
        ({"system": "ungm", "time": {"end": 1e12}}, "time.end", "more than 1,000,000,000 steps of 1"),
        ({"time": {"end": 1e9}}, "time.end", "more than 1,000,000,000 steps of 0.1"),
    ],
)  # fmt: skip
def test_what_cannot_fit_is_said_of_what_is_written(plain, path, says):
    plain = {"experiment": "x", "system": "culver-scalar", "filters": ["ekf"], **plain}
    with pytest.raises(ConfigError) as caught:
        config.from_dict(plain)
    (problem,) = caught.value.problems
    assert problem.path == path
    assert says in problem.message


@pytest.mark.parametrize("value", [1e-100, 1e-50, 1e50, 1e100])
@pytest.mark.parametrize("key", ["end", "step", "output", "interval", "report"])
def test_no_number_however_large_makes_a_default_that_is_refused(key, value):
    plain = {"experiment": "x", "system": {"name": "culver-scalar"}, "filters": ["ekf"]}
    plain |= {"system": {"name": "culver-scalar", "interval": value}} if key == "interval" else {}
    plain |= {"report_times": [value]} if key == "report" else {}
    plain |= {"time": {key: value}} if key in ("end", "step", "output") else {}
    experiment, problems = settled(plain)
    assert unwritten(plain, problems) == set(), problems
    assert experiment is None or config.from_dict(experiment.resolved()) == experiment


@pytest.mark.parametrize("changes", [{}, {"measurement": "continuous"}])
def test_a_filters_step_is_that_of_the_run_where_measurements_are_continuous(changes):
    filters = [{"name": "ekf", "step": 0.005}, {"name": "kushner-2", "step": 0.005}]
    filters = filters if changes else filters[:1]
    plain = {"experiment": "x", "system": {"name": "culver-scalar", **changes}, "filters": filters}
    assert config.from_dict(plain).time.step == (0.005 if changes else 0.01)
    if changes:
        filters[1]["step"] = 0.01
        with pytest.raises(ConfigError, match=r"^filters\.1\.step: 0\.01 is not filters\.0\.step = 0\.005"):
            config.from_dict(plain)


PLUGIN = """
import numpy as np
import nlbench as nb

def tank(leak: float = 0.1) -> nb.System:
    return nb.System(
        drift=lambda t, x: -leak * x, observe=lambda t, x: x, measurement_cov=np.eye(1),
        initial=nb.Moments(mean=np.ones(1), cov=np.eye(1)), interval=1 / 3,
    )

SYSTEMS = {"tank": tank}
"""


def test_the_interval_of_a_plug_in_that_has_no_such_parameter_counts_too(tmp_path):
    """Else the engine would measure at the nearest number of steps, at other times than the system says."""
    path = tmp_path / "tank.py"
    path.write_text(PLUGIN)
    plugins.forget()
    try:
        config.allow(path)
        plain = {"experiment": "x", "system": "tank", "filters": ["ekf"]}
        time = config.from_dict(plain).time
        assert (time.end, time.step, time.output) == pytest.approx((20 / 3, 1 / 30, 1 / 3))
        with pytest.raises(ConfigError, match=r"^time\.step: 0\.02 does not divide the time between meas"):
            config.from_dict({**plain, "time": {"step": 0.02, "end": 2}})
    finally:
        plugins.forget()


def test_every_kind_of_system_is_among_those_tried():
    from nlbench import systems

    tried = {systems.kind(each["name"], each) for each in SYSTEMS.values()}
    assert tried == set(catalogue.KINDS)
