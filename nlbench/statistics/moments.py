"""Second and third cross moments of the errors at the report times, actual and estimated."""

import numpy as np
import pandas as pd

from nlbench.statistics.ieee import ieee
from nlbench.statistics.layout import Layout
from nlbench.statistics.totals import Totals
from nlbench.statistics.uncertainty import JACKKNIFE_GROUPS, Sums, enough_groups, jackknife


@ieee
def moments_table(totals: Totals) -> pd.DataFrame:
    """`filter, time, indices, estimated, actual, stderr, n, names, estimated_stderr`.

    indices: of the coordinates, from 1 (`1,2`); names: what these are called. stderr is that of `actual`;
    estimated_stderr is known from 32 filled groups on.
    """
    layout, groups = totals.layout, totals.groups
    pairs, triples = layout.components(2), layout.components(3)
    reports = list(layout.reports)
    alive = groups["alive"][:, :, reports, None]
    sums = {
        "n": alive,
        "first": groups["power"][:, 0][:, :, reports],
        "second": groups["cross_second"],
        "third": groups["cross_third"],
    }
    scale = np.array(layout.scale[: len(layout.coordinates)])
    unit = np.array([scale[list(component)].prod() for component in pairs + triples])

    def actual_of(part: Sums) -> np.ndarray:
        first, second, third = (part[name] / part["n"] for name in ("first", "second", "third"))
        return _central(first, second, third, layout)

    total = {name: value.sum(0) for name, value in sums.items()}
    actual = actual_of(total)
    stated = np.concatenate([groups["estimated_second"], groups["estimated_third"]], axis=-1)
    weight = np.broadcast_to(alive, stated.shape)
    estimated = _mean({"stated": stated.sum(0), "n": total["n"]})
    estimated_stderr = np.where(
        enough_groups(weight), jackknife(_mean, {"stated": stated, "n": alive}, weight), np.nan
    )
    if totals.filled_groups >= JACKKNIFE_GROUPS or not totals.all_kept:
        stderr = unit * jackknife(actual_of, sums, np.broadcast_to(alive, (*alive.shape[:-1], len(unit))))
    else:
        stderr = _influence_stderr(totals)
    numbered = [",".join(str(i + 1) for i in component) for component in pairs + triples]
    named = [" · ".join(layout.coordinates[i] for i in component) for component in pairs + triples]
    shape = actual.shape
    filters, times, indices = np.indices(shape).reshape(3, -1)
    return pd.DataFrame(
        {
            "filter": np.array(layout.filters, object)[filters],
            "time": np.array(layout.report_times)[times],
            "indices": np.array(numbered, object)[indices],
            "estimated": estimated.ravel(),
            "actual": (unit * actual).ravel(),
            "stderr": stderr.ravel(),
            "n": np.broadcast_to(total["n"], shape).astype(np.int64).ravel(),
            "names": np.array(named, object)[indices],
            "estimated_stderr": estimated_stderr.ravel(),
        }
    )


def _mean(part: Sums) -> np.ndarray:
    """Of what the filters state."""
    return part["stated"] / part["n"]


def _central(first: np.ndarray, second: np.ndarray, third: np.ndarray, layout: Layout) -> np.ndarray:
    """Central second and third moments, side by side, from raw ones about any origin."""
    pairs, triples = layout.components(2), layout.components(3)
    at = {pair: index for index, pair in enumerate(pairs)}
    covariances = [second[..., at[i, j]] - first[..., i] * first[..., j] for i, j in pairs]
    thirds = []
    for index, (i, j, k) in enumerate(triples):
        mixed = sum(first[..., a] * second[..., at[b, c]] for a, b, c in ((i, j, k), (j, i, k), (k, i, j)))
        thirds.append(third[..., index] - mixed + 2 * first[..., i] * first[..., j] * first[..., k])
    return np.stack(covariances + thirds, axis=-1)


def _influence_stderr(totals: Totals) -> np.ndarray:
    """Delta method: standard deviation of each run's influence on the moment, over sqrt(n - 1).

    With x the deviations from the mean, the influence on S_ijk is x_i x_j x_k - P_ij x_k - P_ik x_j - P_jk
    x_i.
    """
    layout, kept = totals.layout, totals.kept
    components = layout.components(2) + layout.components(3)
    stderr = np.full((len(layout.filters), len(layout.reports), len(components)), np.nan)
    for f, r in np.ndindex(*stderr.shape[:2]):
        x = kept.error[f, r][:, ~kept.lost[f, r]]
        n = x.shape[-1]
        if n < 2:
            continue
        x = x - x.mean(-1, keepdims=True)
        cov = x @ x.T / n
        for index, component in enumerate(components):
            influence = x[list(component)].prod(0)
            if len(component) == 3:
                i, j, k = component
                influence = influence - cov[i, j] * x[k] - cov[i, k] * x[j] - cov[j, k] * x[i]
            stderr[f, r, index] = influence.std() / np.sqrt(n - 1)
    return stderr
