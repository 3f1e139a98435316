"""A filter along a user's own recorded data: estimates, innovations, how surprising they were, and their likelihood."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from nlbench.errors import ConfigError
from nlbench.systems.discrete import DiscreteSystem

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.filters.filter import Filter, UpdateInfo


class Followed(NamedTuple):
    """What a filter said along T rows of data, as NumPy arrays.

    times: (T,). mean, variance: (T, n), after the measurement. innovation: (T, m), NaN where nothing was measured.
    nis: (T,), NaN where none was measured. log_likelihood: (T,), 0 there.
    taken: (T,), the number of entries measured. altered: (T,), whether the limiter clipped an entry of the residual,
    the guard replaced the update, or the innovation's covariance was not positive definite: then NIS is no fair sample.
    """

    times: Any
    mean: Any
    variance: Any
    innovation: Any
    nis: Any
    log_likelihood: Any
    taken: Any
    altered: Any


def filter_data(
    f: Filter, times: Any, y: Any, t0: Any = 0, key: Any = None, measurements: Sequence[str] | None = None
) -> pd.DataFrame:
    """The filter `f` from its system's initial moments at t0 along measurements y at `times`: one row for each.

    times: (T,), not descending, none before t0; step numbers where time is discrete. y: (T, m), or (T,) for m = 1; NaN
        means not measured, and a row without measurements is a prediction.
    key: of filters that draw random numbers; None means seed 0.
    measurements: names of what y holds; default y1 ... ym (y for one).
    Columns: `time`; `<name>_mean` and `<name>_variance` of each state after the measurement; `<measurement>_innovation`
    of each measurement, what was measured minus what was foretold, NaN where nothing was; `nis`, the innovation squared
    over its covariance, chi-square distributed with as many degrees as entries were measured if the model is right,
    NaN where none was; `log_likelihood` of the measurement, 0 where there was none: its sum is that of the data.
    Raises `ConfigError` where times or shapes do not fit, and for continuous measurements.
    """
    return table(f, follow(f, times, y, t0, key), measurements)


def follow(f: Filter, times: Any, y: Any, t0: Any = 0, key: Any = None) -> Followed:
    """What `filter_data` makes its table of, and what of it is no fair sample of NIS."""
    import jax
    import jax.numpy as jnp
    import numpy as np

    times, y = _checked(f, np.asarray(times), np.asarray(y, float), t0)
    first, *pairs = _keys(key, len(times))

    def one(carry: tuple[Any, Any], given: tuple[Any, ...]) -> tuple[tuple[Any, Any], tuple[Any, ...]]:
        (state, before), (t, values, predicting, updating) = carry, given
        state = f.predict(state, before, t, predicting)
        state, info = f.update(state, t, values, updating)
        moments, z = f.moments(state), info.innovation
        nis = z @ jnp.linalg.solve(info.innovation_cov, z)
        said = (moments.mean, jnp.diagonal(moments.cov), z, nis, info.log_likelihood, _altered(f, info))
        return (state, t), said

    @jax.jit
    def along(state: Any, given: tuple[Any, ...]) -> Any:
        return jax.lax.scan(one, (state, jnp.asarray(t0, times.dtype)), given)[1]

    start = f.init(f.system.initial, first)
    said = along(start, (jnp.asarray(times), jnp.asarray(y), *pairs))
    mean, variance, innovation, nis, log_likelihood, altered = (np.asarray(part) for part in said)
    there = ~np.isnan(y)
    some = there.any(1)
    return Followed(
        times=times,
        mean=mean,
        variance=variance,
        innovation=np.where(there, innovation, np.nan),
        nis=np.where(some, nis, np.nan),
        log_likelihood=np.where(some, log_likelihood, 0.0),
        taken=there.sum(1),
        altered=altered & some,
    )


def table(f: Filter, followed: Followed, measurements: Sequence[str] | None = None) -> pd.DataFrame:
    """The columns of `filter_data`."""
    import pandas as pd

    m = followed.innovation.shape[1]
    names = list(measurements or _numbered("y", m))
    if len(names) != m or len(set(names)) != m:
        raise ConfigError(f"measurements: expected {m} different names, got {', '.join(map(str, names))}")
    columns: dict[str, Any] = {"time": followed.times}
    for i, name in enumerate(_state_names(f)):
        columns |= {f"{name}_mean": followed.mean[:, i], f"{name}_variance": followed.variance[:, i]}
    columns |= {f"{name}_innovation": followed.innovation[:, r] for r, name in enumerate(names)}
    return pd.DataFrame(columns | {"nis": followed.nis, "log_likelihood": followed.log_likelihood})


def _keys(key: Any, count: int) -> tuple[Any, Any, Any]:
    """The key of the start, and those of the predictions and of the updates: (T,) each."""
    import jax

    keys = jax.random.split(jax.random.key(0) if key is None else key, 2 * count + 1)
    return keys[0], keys[1::2], keys[2::2]


def _altered(f: Filter, info: UpdateInfo) -> Any:
    """Whether an entry was clipped, the guard replaced the update, or the innovation's covariance is none."""
    import jax.numpy as jnp

    z, S = info.innovation, info.innovation_cov
    altered = info.guarded | jnp.isnan(jnp.linalg.cholesky(S)).any()
    return altered if f.limiter is None else altered | jnp.any(z * z > f.limiter**2 * jnp.diagonal(S))


def _checked(f: Filter, times: Any, y: Any, t0: Any) -> tuple[Any, Any]:
    """Times (T,), whole numbers where time is discrete, and measurements (T, m)."""
    import numpy as np

    system: Any = f.system
    m = system.measurements
    if getattr(system, "measurement", "discrete") == "continuous":
        raise ConfigError(
            f"{f.name}: filter_data takes measurements at discrete times, the system's are continuous"
        )
    if f.history is not None:
        raise ConfigError(f"{f.name}: does not say what it expects of a measurement before it comes")
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
