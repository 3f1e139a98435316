"""A system as the filters of this package see it: x+ = f(k, x, w) and y = h(t, x, v), and how the noise enters."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.algebra import breaks, expand
from nlbench.discrete.roots import square_root
from nlbench.shapes import stacked
from nlbench.systems.discrete import DiscreteSystem

if TYPE_CHECKING:
    from nlbench.systems.system import System


class Noisy(NamedTuple):
    """A function with noise, (t, x, w) -> array; the covariance of w; and whether w enters linearly, as a + G(x) w."""

    function: Callable
    cov: Any
    linear: bool


class Observation(NamedTuple):
    """What an update needs to know: y = h(t, x, v) with v of covariance `cov`; `linear` as in `Noisy`.

    innovation: (y, h) -> y - h, or what the system puts in its place. missing: whether entries of y may be NaN.
    limiter: number of standard deviations at which residuals are clipped, or None.
    """

    function: Callable
    cov: Any
    linear: bool
    innovation: Callable
    missing: bool
    limiter: float | None


def observation(system: System | DiscreteSystem, options: Any) -> Observation:
    """y = h(t, x, v); for a system in continuous time h(t, x) + v."""
    R = jnp.asarray(system.measurement_cov, float)
    if isinstance(system, DiscreteSystem):
        observe = system.observe_with_noise
        function = lambda k, x, v: stacked(observe(k, x, v))  # noqa: E731
        linear = enters_linearly(function, system.states, len(R))
    else:
        function = lambda t, x, v: stacked(system.observe(t, x)) + v  # noqa: E731
        linear = True
    limiter = getattr(options, "limiter", None)
    return Observation(function, R, linear, system.innovation, options.missing, limiter)


def transition(system: DiscreteSystem) -> Noisy:
    """x+ = f(k, x, w)."""
    function = lambda k, x, w: stacked(system.transition_with_inputs(k, x, w))  # noqa: E731
    linear = enters_linearly(function, system.states, system.noises)
    return Noisy(function, jnp.asarray(system.process_cov, float), linear)


def spectrum(system: System, t: Any, x: Any) -> Any:
    """G V G' of a system in continuous time: (n, n), zero without process noise."""
    n = system.states
    return jnp.zeros((n, n)) if system.diffusion is None else system.diffusion_spectrum(t, x)


def noise_columns(system: System, t: Any, x: Any) -> Any:
    """G V^1/2 of a system in continuous time: (n, s), None without process noise."""
    if system.diffusion is None:
        return None
    G = jnp.asarray(system.diffusion(t, x))
    return G @ density_root(system, G.shape[1])


def density_root(system: System, s: int) -> Any:
    """V^1/2 of a system with s process noises: (s, s)."""
    V = system.diffusion_cov
    return jnp.eye(s) if V is None else square_root(jnp.asarray(V, float))


def variables(noise: Noisy | Observation, n: int) -> int:
    """Over how many variables an expectation goes: the states, and the noise where it does not enter linearly."""
    return n if noise.linear else n + len(noise.cov)


def enters_linearly(function: Callable, n: int, s: int) -> bool:
    """Whether function(t, x, w) is a + G w in w by structure, for x (n,) and w (s,)."""
    return not is_bent(lambda given, w: function(given[0], given[1:], w), 1 + n, s)


def bends(system: System | DiscreteSystem, options: Any) -> str | None:
    """The name of a function of the system that is not linear by structure; None if all are.

    Sums and products with constant matrices are linear by structure; what a branch hides may not be.
    """
    n = system.states
    seen = observation(system, options)
    functions = {"observe": (seen.function, len(seen.cov))}
    if isinstance(system, DiscreteSystem):
        functions["transition"] = (transition(system).function, system.noises)
    else:
        functions["drift"] = (lambda t, x, w: stacked(system.drift_with_inputs(t, x)), 0)
        if system.diffusion is not None:
            diffusion = system.diffusion
            s = jax.eval_shape(diffusion, 0.0, jnp.zeros(n)).shape[1]
            functions["diffusion"] = (lambda t, x, w: jnp.asarray(diffusion(t, x)) @ w, s)

    def bent(f: Callable, s: int) -> bool:
        return is_bent(lambda given, z: f(given[0], z[:n], z[n:]), 1, n + s)

    return next((name for name, (f, s) in functions.items() if bent(f, s)), None)


def is_bent(function: Callable, p: int, n: int) -> bool:
    """Whether function(given, z) is not linear in z by structure, for given (p,) and z (n,), none of which is known, so
    that no zero of one time passes for all."""
    return bool(curvatures(function, p, n)) or breaks(function, p, n)


def curvatures(function: Callable, p: int, n: int) -> list[tuple[int, ...]]:
    """Indices (i, a, b) of the second derivatives of function(given, z) in z that are not zero by structure, for given
    (p,) and z (n,), none of which is known, so that no zero of one time passes for all."""
    found: list[tuple[int, ...]] = []

    def second(given: Any, z: Any) -> None:
        taylor = expand(function, list(given), list(z), 2)
        assert taylor.second is not None
        found.extend(taylor.second.entries)

    jax.eval_shape(second, jnp.zeros(p), jnp.zeros(n))
    return found
