"""The closest known name for a word that is not known."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

ALIASES = {
    "n": "runs",
    "n_runs": "runs",
    "nruns": "runs",
    "trials": "runs",
    "trajectories": "runs",
    "samples": "runs",
    "random_seed": "seed",
    "rng": "seed",
    "mc": "monte_carlo",
    "dt": "step",
    "duration": "end",
    "t_end": "end",
    "stop": "end",
    "title": "experiment",
    "id": "experiment",
    "problem": "system",
    "estimators": "filters",
    "measurement_noise": "measurement_variance",
    "measurement_cov": "measurement_variance",
    "r": "measurement_variance",
    "covariance": "cov",
    "var": "variance",
    "dtype": "precision",
    "batch": "chunk",
    "workers": "threads",
    "cores": "threads",
    "kf": "linearised-kalman",
    "kalman": "linearised-kalman",
    "extended-kalman": "ekf",
    "unscented": "ukf",
    "cubature": "ckf",
    "particle": "bootstrap",
    "particle-filter": "bootstrap",
    "enkf": "ensemble",
    "optimal": "exact",
}


def closest(word: str, known: Iterable[str]) -> str | None:
    """The known name that `word` most likely stands for: an alias, else the nearest spelling."""
    known = list(known)
    plain = {_plain(name): name for name in known}
    alias = ALIASES.get(word.lower(), ALIASES.get(word.lower().replace("_", "-"), ""))
    if alias in known:
        return alias
    near = get_close_matches(_plain(word), plain, n=1, cutoff=0.6)
    return plain[near[0]] if near else None


def suggestion(word: str, known: Iterable[str]) -> str:
    """`; did you mean 'x'?` when a known name is near, otherwise `; known: ...`."""
    known = list(known)
    near = closest(word, known)
    if near:
        return f"; did you mean '{near}'?"
    return f"; known: {', '.join(known)}" if known else ""


def _plain(name: str) -> str:
    """Spelling without case and separators; American endings count as the British ones used here."""
    return name.lower().replace("_", "-").replace(" ", "-").replace("ized", "ised")
