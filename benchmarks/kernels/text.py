"""Writes the C text of one workload's moment filter of second or third order, to be included by `moments.c`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from benchmarks.kernels import rates, update
from benchmarks.kernels.models import MODELS, Model
from benchmarks.kernels.tensors import Measured, Tensor, unique
from benchmarks.kernels.trace import Number, Trace, Value, written
from benchmarks.workloads import Workload

COMBINATIONS = 13  # operations by which RK4 combines the four rates of one component
WRAP_OPERATIONS = 5  # of `wrapped` in normals.h

Index = tuple[int, ...]


class Text(NamedTuple):
    """Files, as names and contents; the operations of a Runge-Kutta step and of an update, a lane."""

    files: tuple[tuple[str, str], ...]
    operations_per_step: int
    operations_per_update: int


class Components(NamedTuple):
    """The moments as C sees them: places in one array, those first that change between measurements.

    slots: the place of each index, in the order mean, covariance, third moment. moving: how many change.
    """

    slots: dict[Index, int]
    moving: int

    def variables(self, trace: Trace, array: str) -> tuple[list[Value], Tensor, Tensor]:
        """Mean, covariance and third moment: read from `array` where they change, from x where they rest."""
        named = {
            index: trace.variable(f"{array if slot < self.moving else 'x'}[{slot}]")
            for index, slot in self.slots.items()
        }
        mean = [value for index, value in named.items() if len(index) == 1]
        cov, third = ({i: value for i, value in named.items() if len(i) == order} for order in (2, 3))
        return mean, cov, third


def write(workload: Workload, order: int) -> Text:
    """The text for moments up to `order`, 2 or 3."""
    model, n = MODELS[workload.system], len(workload.mean)
    indices = [index for degree in range(1, order + 1) for index in unique(n, degree)]
    everything = Components({index: slot for slot, index in enumerate(indices)}, len(indices))
    found = moment_rates(Trace(), model, everything)
    indices.sort(key=lambda index: found[index] == 0.0)  # stable: otherwise in order
    slots = {index: indices.index(index) for index in found}
    components = Components(slots, sum(rate != 0.0 for rate in found.values()))
    trace = Trace()
    moment_rates(trace, model, components)
    updated = updates(workload, model, components)
    files = {
        "rates.h": trace,
        "update.h": updated,
        "drift.h": drift(model, n),
        "observe.h": observation(model, n),
    }
    lines = [(name, "\n".join([*each.lines, ""])) for name, each in files.items()]
    return Text(
        (*lines, ("model.h", constants(workload, components))),
        4 * trace.operations + COMBINATIONS * components.moving,
        updated.operations,
    )


def moment_rates(trace: Trace, model: Model, components: Components) -> dict[Index, Number]:
    """RATE(slot, value) for each moment that changes; all the rates."""
    m, P, S = components.variables(trace, "at")
    f = model.expand(trace, m)
    found: dict[Index, Number] = {}
    for index, slot in components.slots.items():
        if len(index) == 1:
            found[index] = rates.mean_rate(f, P, *index)
        elif len(index) == 2:
            found[index] = rates.cov_rate(f, P, S, *index)
        else:
            found[index] = rates.third_rate(f, P, S, *index)
        if found[index] != 0.0:
            trace.write(f"RATE({slot}, {written(found[index])});")
    return found


def updates(workload: Workload, model: Model, components: Components) -> Trace:
    """x[] and y[] to x[]."""
    trace = Trace()
    m, P, S = components.variables(trace, "x")
    variances = np.diag(workload.noise_cov).tolist()
    z = [trace.variable(f"y[{r}]") - h for r, h in enumerate(model.observe(trace, m))]
    if workload.wrapped:
        z = [trace.call("wrapped", z_r, operations=WRAP_OPERATIONS) for z_r in z]
    seen = Measured(z, model.slope(trace, m), variances)
    after = update.hermite(trace, seen, m, P, S) if S else update.kalman(trace, seen, m, P)[1]
    values = {**{(i,): value for i, value in enumerate(after.mean)}, **after.cov, **after.third}
    for index, slot in components.slots.items():
        trace.write(f"x[{slot}] = {written(values[index])};")
    return trace


def drift(model: Model, n: int) -> Trace:
    """RATE(i, value) for each true state."""
    trace = Trace()
    x = [trace.variable(f"at[{i}]") for i in range(n)]
    for i, rate in enumerate(model.expand(trace, x).value):
        trace.write(f"RATE({i}, {written(rate)});")
    return trace


def observation(model: Model, n: int) -> Trace:
    """h[] of a true state x[]."""
    trace = Trace()
    for r, h in enumerate(model.observe(trace, [trace.variable(f"x[{i}]") for i in range(n)])):
        trace.write(f"h[{r}] = {written(h)};")
    return trace


def constants(workload: Workload, components: Components) -> str:
    """Sizes, steps, the start and the noise."""
    n, m = len(workload.mean), len(workload.noise_cov)
    start = dict.fromkeys(components.slots, 0.0)
    start |= {(i,): value for i, value in enumerate(workload.mean.tolist())}
    start |= {(i, j): float(workload.cov[i, j]) for i, j in unique(n, 2)}
    by_slot = sorted(components.slots, key=components.slots.__getitem__)
    return "\n".join(
        [
            f"enum {{ STATES = {n}, MEASURED = {m}, STEPS = {workload.steps} }};",
            f"enum {{ COMPONENTS = {len(by_slot)}, MOVING = {components.moving} }};",
            f"static const int SLOT[COMPONENTS] = {braced(components.slots.values())};",
            f"static const int BOUNDED[STATES] = {braced(int(i in workload.bounded) for i in range(n))};",
            f"static const double STEP = {workload.step!r};",
            f"static const double START_AT[COMPONENTS] = {braced(start[index] for index in by_slot)};",
            f"static const double MEAN[STATES] = {braced(workload.mean.tolist())};",
            f"static const double DEVIATION[STATES] = {braced(np.sqrt(np.diag(workload.cov)).tolist())};",
            f"static const double NOISE[MEASURED] = {braced(np.sqrt(np.diag(workload.noise_cov)).tolist())};",
            "",
        ]
    )


def braced(values: Iterable[float]) -> str:
    """A C initialiser."""
    return "{" + ", ".join(map(repr, values)) + "}"
