"""A filter along a user's own recorded data: estimates, innovations, how surprising they were, and their likelihood."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from nlbench.errors import ConfigError
from nlbench.samples import IN_PYTHON, doubt_times, find_pace, read_samples

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.filters.filter import Filter, UpdateInfo
    from nlbench.moments.moments import Moments


class Followed(NamedTuple):
    """What a filter said along T rows of data, as NumPy arrays.

    times: (T,). mean, variance: (T, n), after the measurement. innovation: (T, m), NaN where nothing was measured.
    nis: (T,), NaN where none was measured. log_likelihood: (T,), 0 there.
    taken: (T,), the number of entries measured. altered: (T,), whether the limiter clipped an entry of the residual or
    the guard replaced the update; invalid: (T,), whether the innovation was not finite or its covariance not positive
    definite: then NIS is no fair sample. wrong: (T, 2, 2), after propagation and after the update, whether mean and
    covariance were not finite.
    """

    times: Any
    mean: Any
    variance: Any
    innovation: Any
    nis: Any
    log_likelihood: Any
    taken: Any
    altered: Any
    invalid: Any
    wrong: Any


def filter_data(
    f: Filter, times: Any, y: Any, t0: Any = 0, key: Any = None, measurements: Sequence[str] | None = None
) -> pd.DataFrame:
    """The filter `f` from its system's initial moments at t0 along measurements y at `times`: one row for each.

    times: (T,), not descending, none before t0; step numbers where time is discrete, else numbers in the system's unit,
        durations (timedelta64), which are taken in seconds, or dates (datetime64), which are taken in seconds from t0,
        then a date as well.
    y: (T, m), or (T,) for m = 1; NaN, None or masked means not measured; a row without measurements is a prediction.
    key: of filters that draw random numbers; None means seed 0.
    measurements: names of what y holds; default y1 ... ym (y for one).
    Columns: `time`; `<name>_mean` and `<name>_variance` of each state after the measurement; `<measurement>_innovation`
    of each measurement, what was measured minus what was foretold, NaN where nothing was; `nis`, the innovation squared
    over its covariance, chi-square distributed with as many degrees as entries were measured if the model is right,
    NaN where none was; `log_likelihood` of the measurement, 0 where there was none: its sum is that of the data.
    Warns where the first row lies far after t0, or where times seem to be in another unit. Raises `ConfigError` where
    times or shapes do not fit, where y is infinite or no number, for more than 1e9 steps, and for continuous
    measurements.
    """
    _check_filter(f)
    samples = read_samples(f, times, y, t0)
    doubt = doubt_times(samples.times, samples.start, find_pace(f), IN_PYTHON)
    if doubt:
        warnings.warn(f"{f.name}: {doubt}", stacklevel=2)
    return table(f, follow(f, *samples, key), measurements)


def follow(f: Filter, times: Any, y: Any, t0: Any = 0, key: Any = None) -> Followed:
    """What `filter_data` makes its table of, and what of it is no fair sample of NIS."""
    import jax
    import jax.numpy as jnp
    import numpy as np

    _check_filter(f)
    times, y, t0 = read_samples(f, times, y, t0)
    first, *pairs = _keys(key, len(times))

    def one(carry: tuple[Any, Any], given: tuple[Any, ...]) -> tuple[tuple[Any, Any], tuple[Any, ...]]:
        (state, before), (t, values, predicting, updating) = carry, given
        prior = f.predict(state, before, t, predicting)
        state, info = f.update(prior, t, values, updating)
        moments, z = f.moments(state), info.innovation
        nis = z @ jnp.linalg.solve(info.innovation_cov, z)
        wrong = jnp.stack([_wrong(f.moments(prior)), _wrong(moments)])
        unfair = _altered(f, info), _invalid(info)
        said = (moments.mean, jnp.diagonal(moments.cov), z, nis, info.log_likelihood, *unfair, wrong)
        return (state, t), said

    @jax.jit
    def along(state: Any, given: tuple[Any, ...]) -> Any:
        return jax.lax.scan(one, (state, jnp.asarray(t0, times.dtype)), given)[1]

    start = f.init(f.system.initial, first)
    said = along(start, (jnp.asarray(times), jnp.asarray(y), *pairs))
    mean, variance, innovation, nis, log_likelihood, altered, invalid, wrong = map(np.asarray, said)
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
        altered=altered & some & ~invalid,
        invalid=invalid & some,
        wrong=wrong,
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
    """Decide whether an entry was clipped or the guard replaced the update."""
    import jax.numpy as jnp

    z, S = info.innovation, info.innovation_cov
    if f.limiter is None:
        return jnp.asarray(info.guarded)
    return info.guarded | jnp.any(z * z > f.limiter**2 * jnp.diagonal(S))


def _invalid(info: UpdateInfo) -> Any:
    """Decide whether the innovation is not finite or its covariance none."""
    import jax.numpy as jnp

    root = jnp.linalg.cholesky(info.innovation_cov)
    return ~(jnp.isfinite(info.innovation).all() & jnp.isfinite(root).all())


def _wrong(moments: Moments) -> Any:
    """Decide whether the mean and the covariance are not finite: (2,)."""
    import jax.numpy as jnp

    return jnp.stack([~jnp.isfinite(part).all() for part in (moments.mean, moments.cov)])


def _check_filter(f: Filter) -> None:
    """Raises `ConfigError` for a filter that does not expect measurements one after another."""
    if getattr(f.system, "measurement", "discrete") == "continuous":
        raise ConfigError(
            f"{f.name}: filter_data takes measurements at discrete times, the system's are continuous"
        )
    if f.history is not None:
        raise ConfigError(f"{f.name}: does not say what it expects of a measurement before it comes")


def _state_names(f: Filter) -> list[str]:
    """The system's names of its coordinates where these are its states, else x1 ... xn (x for one state)."""
    coordinates, n = f.system.coordinates, f.system.states
    if coordinates and f.system.error is None and len(coordinates) == n:
        return [coordinate.name for coordinate in coordinates]
    return _numbered("x", n)


def _numbered(letter: str, count: int) -> list[str]:
    return [letter] if count == 1 else [f"{letter}{i + 1}" for i in range(count)]
