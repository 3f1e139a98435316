"""Truth of a system in discrete time and filters along it, for the tests of the systems."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

import nlbench as nb


def simulated(system, steps, runs, seed):
    """States (runs, steps, n) and measurements (runs, steps, m) at steps 1 to `steps`, by NumPy's random numbers."""
    random = np.random.default_rng(seed)

    def drawn(cov, *shape):
        cov = np.asarray(cov, float)
        return random.multivariate_normal(np.zeros(len(cov)), cov, shape)

    x = np.asarray(system.initial.mean) + drawn(system.initial.cov, runs)
    w, v = drawn(system.process_cov, steps, runs), drawn(system.measurement_cov, steps, runs)
    move = jax.jit(jax.vmap(system.transition_with_inputs, (None, 0, 0)))
    see = jax.jit(jax.vmap(system.observe, (None, 0, 0)))
    states, seen = [], []
    for k in range(steps):
        x = move(k, x, w[k])
        states.append(np.asarray(x))
        seen.append(np.asarray(see(k + 1, x, v[k])))
    return np.stack(states, 1), np.stack(seen, 1)


def followed(name, system, seen, **options):
    """Means (runs, steps, n) and covariances (runs, steps, n, n) of a filter after each measurement."""
    f = nb.filters.build(name, system, **options)

    def run(seen):
        def cycle(state, given):
            k, y = given
            state, _ = f.update(f.predict(state, k, k + 1), k + 1, y)
            return state, tuple(f.moments(state)[:2])

        return jax.lax.scan(cycle, f.init(system.initial), (jnp.arange(len(seen)), seen))[1]

    means, covs = jax.jit(jax.vmap(run))(jnp.asarray(seen))
    return np.asarray(means), np.asarray(covs)
