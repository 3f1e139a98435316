"""What a problem in discrete time is: transition and measurement with noise that need not be additive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from nlbench.systems.system import ErrorRules

if TYPE_CHECKING:
    from nlbench.moments.moments import Moments

Function = Callable[..., Any]


def step_index(k: Any) -> Any:
    """k as an integer, by which a system may look things up, also where a caller has it as a float."""
    if isinstance(k, (int, float)):
        return round(k)
    import jax.numpy as jnp

    return k if jnp.issubdtype(k.dtype, jnp.integer) else jnp.round(k).astype(int)


@dataclass(frozen=True)
class DiscreteSystem(ErrorRules):
    """A system x(k+1) = f(k, x(k), w), y(k) = h(k, x(k), v), with w ~ N(0, Q) and v ~ N(0, R) independent.

    Time is the step index k, an integer: `predict` from k to k + 1 applies the transition once. Additive noise, x + w,
    and state-dependent noise, G(x) w, are special cases. Shapes are those of one trajectory: n states, m measurements,
    s process noises, q measurement noises.

    transition: (k, x, w) -> (n,). observe: (k, x, v) -> (m,). A number stands for a vector or a matrix of one entry.
    process_cov: (s, s), the covariance Q of w. measurement_cov: (q, q), the covariance R of v.
    initial: moments at step 0 that the filters start from, and that `sample` defaults to (normal).
    truth: another system that makes the data, when truth and filter model differ.
    sample: key -> (n,) draws an initial state.
    residual: (y, h) -> (m,), y - h unless given (to wrap an angle, say).
    inputs: k -> known inputs u(k), then transition takes (k, x, w, u).
    interval: steps between measurements, the first at step `interval`; None means that nothing is measured.
    exact: what the exact reference is made of, where there is one.

    How its errors are named and judged: `ErrorRules`, by keyword.
    """

    transition: Function
    observe: Function
    process_cov: Any
    measurement_cov: Any
    initial: Moments
    truth: DiscreteSystem | None = None
    sample: Function | None = None
    residual: Function | None = None
    inputs: Function | None = None
    interval: int | None = 1
    exact: Any = None

    def __post_init__(self) -> None:
        functions = {"transition": 1, "observe": 1, "residual": 1, "error": 1, "sample": 1}
        self._accept(functions, ("process_cov", "measurement_cov"))

    @property
    def states(self) -> int:
        """Number of states n."""
        return len(self.initial.mean)

    @property
    def noises(self) -> int:
        """Number of process noises s."""
        return len(self.process_cov)

    @property
    def measurements(self) -> int:
        """Number of measurements m taken at one time; it may differ from the number of noises q."""
        import jax
        import jax.numpy as jnp

        x, v = jnp.zeros(self.states), jnp.zeros(len(self.measurement_cov))
        return len(jax.eval_shape(lambda x, v: jnp.asarray(self.observe(0, x, v)), x, v))

    def transition_with_inputs(self, k: Any, x: Any, w: Any) -> Any:
        """f(k, x, w), the known inputs u(k) put in: (n,)."""
        k = step_index(k)
        return self.transition(k, x, w) if self.inputs is None else self.transition(k, x, w, self.inputs(k))

    def observe_with_noise(self, k: Any, x: Any, v: Any) -> Any:
        """h(k, x, v): (m,), or a tuple of m scalars."""
        return self.observe(step_index(k), x, v)

    def innovation(self, y: Any, h: Any) -> Any:
        """y - h, or what the system puts in its place: (m,)."""
        return y - h if self.residual is None else self.residual(y, h)
