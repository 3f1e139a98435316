"""From a validated experiment to what is computed: the true system, the bound filters, the schedule, the layout."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nlbench import filters, schedule, systems
from nlbench.errors import ConfigError
from nlbench.moments.moments import Moments
from nlbench.simulate import path
from nlbench.statistics.layout import Layout
from nlbench.systems.system import Coordinate, InitialPosterior, Sets, System

if TYPE_CHECKING:
    from nlbench.config import Experiment, FilterSpec
    from nlbench.filters.filter import Filter
    from nlbench.schedule import Schedule


class Runner(NamedTuple):
    """A filter of the experiment: the moments it starts from, and its steps in a segment, of length `step`."""

    label: str
    filter: Filter
    initial: Moments
    step: float
    steps: int


class Problem(NamedTuple):
    """Everything that a block's computation depends on, apart from the seed.

    truth: what makes the data. judged_by: whose coordinates and rules of divergence count. nominal_steps: ends of the
    steps at which sightings are made, where the undisturbed motion decides it.
    """

    truth: System
    runners: tuple[Runner, ...]
    schedule: Schedule
    layout: Layout
    block: int
    judged_by: System
    nominal_steps: tuple[int, ...] = ()

    @property
    def set_size(self) -> int:
        """Number of trajectories whose initial states are drawn together."""
        return self.truth.sample.size if isinstance(self.truth.sample, Sets) else 1


def make(experiment: Experiment, own: System | None = None) -> Problem:
    """The problem that an experiment states, about the user's own system if one is given.

    Raises `ConfigError` where model and data do not fit each other.
    """
    stated = own or systems.build(
        experiment.system.name, **{**experiment.system.parameters, **experiment.truth}
    )
    truth = stated.truth or stated
    end, step, output = experiment.time.end, experiment.time.step, experiment.time.output
    sightings = truth.sightings.most(end) if truth.sightings else 0
    continuous = truth.measurement == "continuous"
    times = schedule.make(end, step, output, truth.interval, sightings, continuous)
    runners = [_runner(experiment, spec, own, times) for spec in experiment.filters]
    if experiment.reference is not None:
        known = replace(_sampled(truth, times), exact=_roomy(truth.exact, times))
        runners.append(_bound(experiment.reference, experiment.reference, known, {}, truth.initial, times))
    for runner in runners:
        model = runner.filter.system
        if runner.label != experiment.reference and model.measurement != truth.measurement:
            raise ConfigError(
                f"{runner.label}: its measurements are {model.measurement}, and those of the data {truth.measurement}"
            )
        if (model.states, model.measurements) != (truth.states, truth.measurements):
            raise ConfigError(
                f"{runner.label}: its model has {model.states} states and {model.measurements} measurements, "
                f"the data {truth.states} and {truth.measurements}"
            )
    layout, block = _layout(experiment, stated), experiment.engine.block
    return Problem(truth, tuple(runners), times, layout, block, stated, _nominal_steps(truth, times))


def _nominal_steps(truth: System, times: Schedule) -> tuple[int, ...]:
    """When the motion from the initial mean reaches the angle of each sighting; never is a step after the last."""
    if truth.sightings is None or not truth.sightings.nominal:
        return ()
    import jax

    mean = np.asarray(truth.initial.mean, float)
    states = jax.jit(lambda start: path(replace(truth, diffusion=None), times, None, start))(mean)
    angles = np.unwrap(np.asarray(jax.vmap(truth.sightings.angle)(states)))
    due = [float(truth.sightings.due(number)) for number in range(times.sightings)]
    return tuple(int(step) + 1 for step in np.searchsorted(np.maximum.accumulate(angles), due))


def _roomy(exact: Any, times: Schedule) -> Any:
    """A reference that remembers its measurements, with room for those of the schedule."""
    if not isinstance(exact, InitialPosterior):
        return exact
    return exact._replace(most=times.sightings or times.measurements or 1)


def _sampled(truth: System, times: Schedule) -> System:
    """The truth as a reference sees it: continuous measurements are samples, one at the start of each step."""
    if not times.continuous:
        return truth
    variance = np.asarray(truth.measurement_cov, float) / times.step
    return replace(truth, measurement="discrete", measurement_cov=variance)


def _runner(experiment: Experiment, spec: FilterSpec, own: System | None, times: Schedule) -> Runner:
    system = own or systems.build(experiment.system.name, **{**experiment.system.parameters, **spec.model})
    initial = _overridden(system.initial, {**experiment.initial, **spec.initial})
    options = {**spec.options, "missing": False}
    if system.measurement == "continuous":
        options = {**_stated(spec), "missing": False, "step": _only_step(spec, times)}
    return _bound(spec.label, spec.name, system, options, initial, times)


def _stated(spec: FilterSpec) -> dict[str, Any]:
    """The options that differ from their defaults, which may be others where measurements are continuous."""
    defaults = filters.options(spec.name)().model_dump(mode="json")
    return {name: value for name, value in spec.options.items() if value != defaults[name]}


def _only_step(spec: FilterSpec, times: Schedule) -> float:
    """The step of the run, at each of which there is a measurement. Raises `ConfigError` for another."""
    if spec.options.get("step") not in (None, times.step):
        raise ConfigError(
            f"{spec.label}.step: got {spec.options['step']:g}; a continuous measurement is made at each step of the "
            f"run and a filter's steps are the same, time.step = {times.step:g}"
        )
    return times.step


def _bound(label: str, name: str, system: System, options: dict, initial: Moments, times: Schedule) -> Runner:
    if name == "exact":
        options = {}
    span = times.step * times.segment_steps
    longest = options.get("step") or times.step
    steps = max(1, math.ceil(span / longest - 1e-9))
    return Runner(label, filters.build(name, system, **options), initial, span / steps, steps)


def _overridden(initial: Moments, given: dict[str, Any]) -> Moments:
    """Initial moments with those given in their place."""
    changed = Moments(
        given.get("mean", initial.mean), given.get("cov", initial.cov), initial.third, initial.fourth
    )
    n = len(initial.mean)
    if np.shape(changed.mean) != (n,) or np.shape(changed.cov) != (n, n):
        raise ConfigError(
            f"initial: mean and cov have shapes {np.shape(changed.mean)} and {np.shape(changed.cov)}, "
            f"the system needs ({n},) and ({n}, {n})"
        )
    return changed


def state_names(n: int) -> list[str]:
    """Names of the states of a system that names none."""
    return ["x"] if n == 1 else [f"x{i + 1}" for i in range(n)]


def _layout(experiment: Experiment, truth: System) -> Layout:
    coordinates = truth.coordinates or tuple(Coordinate(name) for name in state_names(truth.states))
    times, reports = experiment.layout_times()
    return Layout(
        filters=experiment.labels,
        times=times,
        reports=reports,
        coordinates=tuple(coordinate.name for coordinate in coordinates),
        units=tuple(coordinate.unit for coordinate in coordinates),
        clip=truth.clip or (math.inf,) * len(coordinates),
        norms=truth.norms,
        keep_runs=experiment.monte_carlo.keep_runs,
    )
