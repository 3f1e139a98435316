"""How a filter's state is carried from one time to another: by steps of one, or by integration over equal parts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.errors import ConfigError
from nlbench.moments.integrate import steps_between


class Clock(NamedTuple):
    """integrate: (state, t, h, count) -> state after `count` steps of h from t. predict: (state, t0, t1) -> state.
    discrete: whether time is a step index."""

    integrate: Callable
    predict: Callable
    discrete: bool

    @classmethod
    def of_steps(cls, step: Callable) -> Clock:
        """step: (state, k) -> the state at k + 1."""

        def integrate(state: Any, k: Any, h: Any, count: Any) -> Any:
            if isinstance(count, int) and count == 1:
                return step(state, k)
            return jax.lax.fori_loop(0, count, lambda i, state: step(state, k + i), state)

        def predict(state: Any, k0: Any, k1: Any) -> Any:
            span = k1 - k0
            count = round(span) if isinstance(span, (int, float)) else jnp.round(span).astype(int)
            return integrate(state, k0, 1, count)

        return cls(integrate, predict, True)

    @classmethod
    def of_integrals(cls, integrate: Callable, longest: float | None) -> Clock:
        """integrate: (state, t, h, count) -> state. longest: bound on h; None means a tenth of the way."""

        def predict(state: Any, t0: Any, t1: Any) -> Any:
            return integrate(state, t0, *steps_between(t0, t1, longest))

        return cls(integrate, predict, False)

    def rates(self, name: str, slope: Callable[[], Any]) -> Any:
        """slope(). Raises `ConfigError` where time is discrete."""
        if self.discrete:
            raise ConfigError(f"{name}: moments have no time derivatives where time is discrete")
        return slope()
