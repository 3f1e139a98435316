"""From a validated experiment to what is computed: the true system, the bound filters, the schedule, the layout."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nlbench import filters, plugins, schedule, systems
from nlbench.config.schema import PARTICLES
from nlbench.engine import single_precision
from nlbench.engine.claims import check_claims
from nlbench.errors import ConfigError, Problems
from nlbench.errors import Problem as Wrong
from nlbench.moments.moments import Moments
from nlbench.simulate import path
from nlbench.statistics.layout import Layout
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.exact import InitialPosterior
from nlbench.systems.system import Coordinate, Sets, System, kind, state_names

if TYPE_CHECKING:
    from nlbench.config import Experiment, FilterSpec
    from nlbench.filters.filter import Filter
    from nlbench.schedule import Schedule


class Runner(NamedTuple):
    """A filter of the experiment: the moments it starts from, and its steps in a segment, of length `step`; in discrete
    time, where t is a number of steps, that is the integer 1."""

    label: str
    filter: Filter
    initial: Moments
    step: float
    steps: int


class Problem(NamedTuple):
    """Everything that a block's computation depends on, apart from the seed.

    truth: what makes the data. judged_by: whose coordinates and rules of divergence count. nominal_steps: ends of the
    steps at which sightings are made, where the undisturbed motion decides it. same: problems for which this is equal
    are computed by the same program; None where no name holds all that decides it.
    """

    truth: System | DiscreteSystem
    runners: tuple[Runner, ...]
    schedule: Schedule
    layout: Layout
    block: int
    judged_by: System | DiscreteSystem
    nominal_steps: tuple[int, ...] = ()
    same: str | None = None

    @property
    def set_size(self) -> int:
        """Number of trajectories whose initial states are drawn together."""
        return self.truth.sample.size if isinstance(self.truth.sample, Sets) else 1


def make(experiment: Experiment, own: System | DiscreteSystem | None = None) -> Problem:
    """The problem that an experiment states, about the user's own system if one is given.

    Raises `ConfigError`, with all that was found, where a filter does not apply, where model and data do not fit, where
    a claim is about what is not there, and where derivatives do not survive float32.
    """
    plugins.restore(experiment.plugins)
    problems = Problems()
    with problems.of("system"):
        stated = own or systems.build(
            experiment.system.name, **{**experiment.system.parameters, **experiment.truth}
        )
        truth = stated.truth or stated
        for each in (truth,) if stated is truth else (truth, stated):
            filters.check(each)
        times = _schedule(experiment, truth)
    problems.refuse()
    models = _models(experiment, own)
    runners = []
    for number, spec in enumerate(experiment.filters):
        with problems.of(f"filters.{number}"):
            runners.append(_fitting(experiment, spec, models, truth, times, f"filters.{number}"))
    if experiment.reference is not None:
        with problems.of("reference"):
            runners.append(_reference(experiment.reference, experiment.labels[-1], truth, times))
    layout = _layout(experiment, stated)
    with problems.of("claims"):
        check_claims(experiment.claims, layout)
    problems.refuse()
    if experiment.engine.precision == "float32":
        single_precision.check(tuple(runners), times, () if own else _units(experiment.system.name))
    steps = _nominal_steps(truth, times)
    # Of a plug-in the hash holds the source, but not what that imports or reads.
    same = None if own is not None or experiment.plugins else experiment.of_seed(0).hash12()
    return Problem(truth, tuple(runners), times, layout, experiment.engine.block, stated, steps, same)


def _units(system: str) -> tuple[str, ...]:
    """The parameters by which a system's units are chosen."""
    names = systems.parameters(system).model_fields
    return tuple(f"system.{name}" for name in names if name.endswith("_unit"))


def _schedule(experiment: Experiment, truth: System | DiscreteSystem) -> Schedule:
    """When things happen. Raises `ConfigError` where time is discrete and the interval is not whole."""
    end, step, output = experiment.time.end, experiment.time.step, experiment.time.output
    if isinstance(truth, System):
        sightings = truth.sightings.most(end) if truth.sightings else 0
        return schedule.make(
            end, step, output, truth.interval, sightings, continuous=truth.measurement == "continuous"
        )
    if truth.interval is not None and truth.interval != round(truth.interval):
        holder = "truth" if "interval" in experiment.truth else "system"
        message = f"got {truth.interval:g}; where time is discrete it is a number of steps"
        raise ConfigError([Wrong(message, f"{holder}.interval")])
    return schedule.make(round(end), 1, round(output), truth.interval)


def _nominal_steps(truth: System | DiscreteSystem, times: Schedule) -> tuple[int, ...]:
    """When the motion from the initial mean reaches the angle of each sighting; never is a step after the last."""
    if isinstance(truth, DiscreteSystem) or truth.sightings is None or not truth.sightings.nominal:
        return ()
    import jax

    mean = np.asarray(truth.initial.mean, float)
    states = jax.jit(lambda start: path(replace(truth, diffusion=None), times, None, start))(mean)
    angles = np.unwrap(np.asarray(jax.vmap(truth.sightings.angle)(states)))
    due = [float(truth.sightings.due(number)) for number in range(times.sightings)]
    return tuple(int(step) + 1 for step in np.searchsorted(np.maximum.accumulate(angles), due))


def _reference(name: str, label: str, truth: System | DiscreteSystem, times: Schedule) -> Runner:
    """The posterior of what makes the data: exact, or a large particle filter's."""
    known = replace(_sampled(truth, times), exact=_roomy(truth.exact, times))
    if name == "particles":
        options = {"particles": PARTICLES, "missing": False}
        return _bound(label, "bootstrap", known, options, truth.initial, times)
    return _bound(label, name, known, {}, truth.initial, times)


def _roomy(exact: Any, times: Schedule) -> Any:
    """A reference that remembers its measurements, with room for those of the schedule."""
    if not isinstance(exact, InitialPosterior):
        return exact
    return exact._replace(most=times.sightings or times.measurements or 1)


def _sampled(truth: System | DiscreteSystem, times: Schedule) -> System | DiscreteSystem:
    """The truth as a reference sees it: continuous measurements are samples, one at the start of each step."""
    if isinstance(truth, DiscreteSystem) or not times.continuous:
        return truth
    variance = np.asarray(truth.measurement_cov, float) / times.step
    return replace(truth, measurement="discrete", measurement_cov=variance)


def _models(
    experiment: Experiment, own: System | DiscreteSystem | None
) -> Callable[[FilterSpec], System | DiscreteSystem]:
    """What gives the model of a filter: filters with the same parameters share one."""
    built: dict[str, System | DiscreteSystem] = {}

    def model(spec: FilterSpec) -> System | DiscreteSystem:
        if own is not None:
            return own
        parameters = {**experiment.system.parameters, **spec.model}
        key = repr(sorted(parameters.items()))
        if key not in built:
            built[key] = systems.build(experiment.system.name, **parameters)
        return built[key]

    return model


def _fitting(
    experiment: Experiment,
    spec: FilterSpec,
    models: Callable[[FilterSpec], System | DiscreteSystem],
    truth: System | DiscreteSystem,
    times: Schedule,
    at: str,
) -> Runner:
    """A filter, the one at `at`, whose model fits the data. Raises `ConfigError` with all that is wrong with it."""
    model = models(spec)
    expected, found = _described(truth), _described(model)
    if found != expected:
        raise ConfigError(f"{spec.label}: its model has {found}, the data {expected}")
    problems, initial, options = Problems(), model.initial, {**spec.options, "missing": False}
    with problems.of(at):
        initial = overridden(model.initial, experiment.initial, spec.initial, at)
    if experiment.initial or spec.initial:
        model = replace(model, initial=initial)
    if kind(model).continuous:
        with problems.of(at):
            options["step"] = _only_step(spec, times)
    with problems.of(at):
        runner = _bound(spec.label, spec.name, model, options, initial, times)
    problems.refuse()
    return runner


def _described(system: System | DiscreteSystem) -> str:
    """What of a system data and model must have in common."""
    discrete, continuous = kind(system)
    return (
        f"{'discrete' if discrete else 'continuous'} time, {system.states} states and {system.measurements} "
        f"{'continuous ' if continuous else ''}measurements"
    )


def _only_step(spec: FilterSpec, times: Schedule) -> float:
    """The step of the run, at each of which there is a measurement. Raises `ConfigError` for another."""
    if spec.options.get("step") not in (None, times.step):
        raise ConfigError(
            f"{spec.label}.step: got {spec.options['step']:g}; a continuous measurement is made at each step of the "
            f"run and a filter's steps are the same, time.step = {times.step:g}"
        )
    return times.step


def _bound(
    label: str, name: str, system: System | DiscreteSystem, options: dict, initial: Moments, times: Schedule
) -> Runner:
    if name == "exact":
        options = {}
    bound = filters.build(name, system, **options)
    if isinstance(system, DiscreteSystem):
        return Runner(label, bound, initial, times.step, times.segment_steps)
    span = times.step * times.segment_steps
    steps = max(1, math.ceil(span / (options.get("step") or times.step) - 1e-9))
    return Runner(label, bound, initial, span / steps, steps)


def overridden(initial: Moments, common: dict[str, Any], own: dict[str, Any], at: str) -> Moments:
    """Initial moments, with those in their place that the experiment gives to all filters, and to the one at `at`.

    Raises `ConfigError` where they are not of the system's size.
    """
    n, problems = len(initial.mean), []
    given = {key: (value, "initial") for key, value in common.items()}
    given |= {key: (value, f"{at}.initial") for key, value in own.items()}
    for key, shape in (("mean", (n,)), ("cov", (n, n))):
        value, holder = given.get(key, (getattr(initial, key), "initial"))
        if np.shape(value) != shape:
            problems.append(
                Wrong(f"got shape {np.shape(value)}, the system needs {shape}", f"{holder}.{key}")
            )
    if problems:
        raise ConfigError(problems)
    return initial._replace(**{key: value for key, (value, _) in given.items()})


def _layout(experiment: Experiment, truth: System | DiscreteSystem) -> Layout:
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
        scores=experiment.scores,
    )
