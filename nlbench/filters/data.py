"""A filter along a user's own recorded data: estimates, innovations, how surprising they were, and their likelihood."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nlbench.errors import ConfigError
from nlbench.systems.discrete import DiscreteSystem

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.filters.filter import Filter


def filter_data(f: Filter, times: Any, y: Any, t0: Any = 0, key: Any = None) -> pd.DataFrame:
    """The filter `f` from its system's initial moments at t0 along measurements y at `times`: one row for each.

    times: (T,), not descending, none before t0; step numbers where time is discrete. y: (T, m), or (T,) for m = 1; NaN
        means not measured, and a row without measurements is a prediction.
    key: of filters that draw random numbers; None means seed 0.
    Columns: `time`; `<name>_mean` and `<name>_variance` of each state after the measurement; `<name>_innovation` of
    each measurement, what was measured minus what was foretold, NaN where nothing was; `nis`, the innovation squared
    over its covariance, chi-square distributed with as many degrees as entries were measured if the model is right,
    NaN where none was; `log_likelihood` of the measurement, 0 where there was none: its sum is that of the data.
    Raises `ConfigError` where times or shapes do not fit, and for continuous measurements.
    """
    import jax
    import jax.numpy as jnp
    import numpy as np
    import pandas as pd

    times, y = _checked(f, np.asarray(times), np.asarray(y, float), t0)
    key = jax.random.key(0) if key is None else key
    first, *keys = jax.random.split(key, 2 * len(times) + 1)

    def one(carry: tuple[Any, Any], given: tuple[Any, ...]) -> tuple[tuple[Any, Any], tuple[Any, ...]]:
        (state, before), (t, values, predicting, updating) = carry, given
        state = f.predict(state, before, t, predicting)
        state, info = f.update(state, t, values, updating)
        moments, z = f.moments(state), info.innovation
        nis = z @ jnp.linalg.solve(info.innovation_cov, z)
        return (state, t), (moments.mean, jnp.diagonal(moments.cov), z, nis, info.log_likelihood)

    @jax.jit
    def along(state: Any, given: tuple[Any, ...]) -> Any:
        return jax.lax.scan(one, (state, jnp.asarray(t0, times.dtype)), given)[1]

    start = f.init(f.system.initial, first)
    given = (jnp.asarray(times), jnp.asarray(y), jnp.stack(keys[::2]), jnp.stack(keys[1::2]))
    mean, variance, innovation, nis, log_likelihood = (np.asarray(part) for part in along(start, given))
    there = ~np.isnan(y)
    columns: dict[str, Any] = {"time": times}
    for i, name in enumerate(_state_names(f)):
        columns |= {f"{name}_mean": mean[:, i], f"{name}_variance": variance[:, i]}
    for r, name in enumerate(_numbered("y", y.shape[1])):
        columns[f"{name}_innovation"] = np.where(there[:, r], innovation[:, r], np.nan)
    columns["nis"] = np.where(there.any(1), nis, np.nan)
    columns["log_likelihood"] = np.where(there.any(1), log_likelihood, 0.0)
    return pd.DataFrame(columns)


def _checked(f: Filter, times: Any, y: Any, t0: Any) -> tuple[Any, Any]:
    """Times (T,), whole numbers where time is discrete, and measurements (T, m)."""
    import numpy as np

    system: Any = f.system
    m = system.measurements
    if getattr(system, "measurement", "discrete") == "continuous":
        raise ConfigError(
            f"{f.name}: filter_data takes measurements at discrete times, the system's are continuous"
        )
    if y.ndim == 1 and m == 1:
        y = y[:, None]
    if times.ndim != 1 or not len(times):
        raise ConfigError(f"times: got shape {times.shape}, expected (T,) with T at least 1")
    if y.shape != (len(times), m):
        raise ConfigError(
            f"y: got shape {y.shape}, expected ({len(times)}, {m}): {len(times)} times, {m} measured"
        )
    if not np.isfinite(times.astype(float)).all():
        raise ConfigError("times: must be finite")
    steps = np.diff(np.concatenate([[t0], times]))
    if (steps < 0).any():
        row = int(np.argmax(steps < 0))
        raise ConfigError(f"times: {times[row]} in row {row} comes after {times[row - 1] if row else t0}")
    if not isinstance(system, DiscreteSystem):
        return times.astype(float), y
    if (times != np.round(times)).any() or t0 != round(t0):
        raise ConfigError("times: must be step numbers, since the system's time is discrete")
    return times.astype(int), y


def _state_names(f: Filter) -> list[str]:
    """The system's names of its coordinates where these are its states, else x1 ... xn (x for one state)."""
    coordinates, n = f.system.coordinates, f.system.states
    if coordinates and f.system.error is None and len(coordinates) == n:
        return [coordinate.name for coordinate in coordinates]
    return _numbered("x", n)


def _numbered(letter: str, count: int) -> list[str]:
    return [letter] if count == 1 else [f"{letter}{i + 1}" for i in range(count)]
