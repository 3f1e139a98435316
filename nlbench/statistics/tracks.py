"""What the filters did on one block of trajectories: the input of the statistics."""

from typing import NamedTuple

from jaxtyping import Array, Bool, Float, Int


class Scores(NamedTuple):
    """How well each filter foretold the measurements; axes as below.

    A sample is a measurement of which the filter foretold mean and covariance. Left out are those whose residual a
    limiter clipped and those whose update the guard replaced; invalid those foretold without a finite mean and a
    positive definite covariance: what remains is a selection, smaller than a right filter's.
    """

    nis: Float[
        Array, "F T L"
    ]  # sum of the normalised innovations squared of the samples since the output before
    samples: Int[Array, "F T L"]  # how many those are
    left_out: Int[Array, "F T L"]  # how many were limited or guarded
    log_likelihood: Float[Array, "F T L"]  # sum over all measurements so far
    invalid: Int[Array, "F T L"]  # how many were foretold without a valid mean and covariance


class Tracks(NamedTuple):
    """Axes: F filters, T output times (t = 0 first), R report times, C coordinates, L lanes (trajectories).

    A filter that does not carry third moments gives zeros. The unique components of `cov` and `cross_third`
    are in the order of `Layout.components`.
    """

    error: Float[Array, "F T C L"]  # truth minus estimate
    variance: Float[Array, "F T C L"]  # estimated, per coordinate
    third: Float[Array, "F T C L"]  # estimated third central moment, per coordinate
    nees: Float[Array, "F T L"]  # joint e' P^-1 e; NaN where P is not positive definite
    cov: Float[Array, "F R C2 L"]  # estimated covariance
    cross_third: Float[Array, "F R C3 L"]  # estimated third central moments
    diverged: Bool[Array, "F T L"]  # by the system's rule
    guarded: Int[Array, "F L"]  # updates in which the guard fired
    updates: Int[Array, "F L"]  # updates made
    scores: Scores | None = None  # None where nothing is measured, or nobody asked
