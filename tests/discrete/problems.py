"""Truth and filters along many runs of a registered problem of the literature in discrete time."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import nlbench as nb


class Problem(NamedTuple):
    """A registered system, how many steps the source makes, and how many first states it scores."""

    name: str
    steps: int
    scored: int


UNGM = Problem("ungm", 500, 1)
BEARINGS_ONLY = Problem("bearings-only", 500, 2)
REENTRY = Problem("re-entry", 2000, 2)


def simulated(system, key, steps):
    """States 1 ... `steps` of the system that makes the data, (steps, n), and measurements of them, (steps, m)."""
    system = system.truth or system
    first, motion, noise = jax.random.split(key, 3)
    # The truths of these problems have independent noises and initial states.
    P, Q, R = (
        np.sqrt(np.diag(cov)) for cov in (system.initial.cov, system.process_cov, system.measurement_cov)
    )
    if system.sample is None:
        start = jnp.asarray(system.initial.mean) + P * jax.random.normal(first, (len(P),))
    else:
        start = system.sample(first)
    k = jnp.arange(steps)
    w, v = Q * jax.random.normal(motion, (steps, len(Q))), R * jax.random.normal(noise, (steps, len(R)))

    def advance(x, given):
        x = system.transition(given[0], x, given[1])
        return x, x

    x = jax.lax.scan(advance, start, (k, w))[1]
    return x, jax.vmap(system.observe)(k + 1, x, v)


def squared_errors(problem, names, runs, seed):
    """Squared errors of each filter, (name, options), along the same runs, summed over what is scored:
    dict of (runs, steps) arrays."""
    system = nb.systems.build(problem.name)
    filters = {
        name: nb.filters.build(name.split("/")[0], system, **options) for name, options in names.items()
    }

    def run(key):
        data, own = jax.random.split(key)
        x, y = simulated(system, data, problem.steps)
        k = jnp.arange(problem.steps)
        errors = {}
        for name, f in filters.items():

            def cycle(state, given, f=f):
                k, y = given
                state, _ = f.update(f.predict(state, k, k + 1), k + 1, y)
                return state, f.moments(state).mean

            start = f.init(system.initial, own)
            means = jax.lax.scan(cycle, start, (k, y))[1]
            errors[name] = jnp.sum((x - means)[:, : problem.scored] ** 2, 1)
        return errors

    keys = jax.random.split(jax.random.key(seed), runs)
    return {name: np.asarray(error) for name, error in jax.jit(jax.vmap(run))(keys).items()}
