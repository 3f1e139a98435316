"""The rows of the table of named filters that this family builds. Loads no numerical library."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from nlbench.row import Row, StrictOptions

Propagation = Literal["transition", "moments"]


class Options(StrictOptions):
    """What all filters of the family take."""

    step: PositiveFloat | None = Field(
        default=None, description="integration step, in continuous time; default: the experiment's"
    )
    missing: bool = Field(default=True, description="whether measurements may be NaN, meaning not taken")


class GaussianOptions(Options):
    """Options of a filter that carries mean and covariance."""

    limiter: PositiveFloat | None = Field(default=None, description="clip residuals at this many sigmas")


class PropagatedOptions(GaussianOptions):
    """Options of a filter whose covariance can be carried as a root."""

    propagation: Propagation = Field(
        default="transition",
        description="in continuous time: carry the covariance through the transition of each step, or integrate its "
        "moment equations",
    )


class IteratedOptions(PropagatedOptions):
    """Options of the iterated filter."""

    iterations: PositiveInt = Field(default=5, le=10_000, description="Gauss-Newton iterations of an update")


class UnscentedOptions(PropagatedOptions):
    """Options of the unscented filter."""

    alpha: PositiveFloat = Field(default=1.0, description="spread of the sigma points")
    beta: float = Field(default=0.0, description="extra weight of the central point in covariances")
    kappa: float | None = Field(
        default=None, description="weight of the central point; default: 3 - d for d <= 3 dimensions, else 0"
    )


class QuadratureOptions(PropagatedOptions):
    """Options of a filter that integrates by Gauss-Hermite quadrature."""

    points: PositiveInt = Field(default=3, ge=2, le=1000, description="nodes per dimension")


class MixtureOptions(PropagatedOptions):
    """Options of the Gaussian sum."""

    components: PositiveInt = Field(
        default=3, le=1000, description="Gaussians per dimension that the prior is laid out as"
    )
    bank: Literal["ekf", "sof-gaussian"] = Field(default="ekf", description="filter of each Gaussian")
    spread: float = Field(
        default=0.5,
        gt=0.0,
        lt=1.0,
        description="share of the prior's variance that lies between the Gaussians",
    )
    merge: NonNegativeFloat = Field(
        default=1e-4, description="Gaussians are joined while that costs less than this (Kullback-Leibler)"
    )
    renew: float = Field(
        default=0.9,
        gt=0.0,
        le=1.0,
        description="lay the sum out anew when one Gaussian has more weight than this",
    )


class EnsembleOptions(Options):
    """Options of the ensemble Kalman filter."""

    particles: PositiveInt = Field(default=100, ge=2, le=10_000_000, description="members of the ensemble")


class ParticleOptions(Options):
    """Options of the particle filter."""

    particles: PositiveInt = Field(default=1000, ge=2, le=10_000_000, description="number of particles")
    threshold: float = Field(
        default=0.5, ge=0.0, le=1.0, description="resample when fewer than this share of particles count"
    )


KALMAN = "Kalman 1960"
ATHANS = "Athans 2001"
HENRIKSEN = "Henriksen 1980"
JAZWINSKI = "Jazwinski 1970, as corrected by Henriksen 1980"


def _row(says: str, source: str, order: int, update: str, options: type[Options] = PropagatedOptions) -> Row:
    return Row(says, source, order, update, options, "discrete")


ROWS: dict[str, Row] = {
    "kalman": _row("the Kalman filter, for linear systems only", KALMAN, 1, "kalman"),
    "ekf": _row("Kalman filter linearised at its own estimate", f"{ATHANS}, 48-52", 1, "kalman"),
    "linearised-kalman": _row("another name of ekf", f"{ATHANS}, 48-52", 1, "kalman"),
    "iekf": _row(
        "EKF whose update iterates to the most probable state", "Bell and Cathey 1993", 1, "iterated",
        IteratedOptions,
    ),
    "sof": _row("second-order mean, EKF covariance, with noise Hessians", f"{ATHANS}, 53-59", 2, "sof"),
    "sof-gaussian": _row(
        "second order with the covariance of a Gaussian, cross Hessians included",
        "Athans, Wishner and Bertolini 1968", 2, "sof",
    ),
    "truncated": _row(
        "truncated second order, corrected, with state-dependent noise", f"{HENRIKSEN}, 18-22", 2, "truncated",
        GaussianOptions,
    ),
    "truncated-jazwinski": _row(
        "truncated second order with the erroneous terms and random forcing",
        f"{HENRIKSEN}, 11, 16-17", 2, "truncated", GaussianOptions,
    ),
    "modified-jazwinski": _row(
        "truncated second order with the erroneous terms, no random forcing",
        f"{HENRIKSEN}, 11, 22", 2, "truncated", GaussianOptions,
    ),
    "statistical-linearisation": _row(
        "quasi-linear: the best straight line for a Gaussian prior", "Gelb 1974, 6.2", 2, "statistical",
        QuadratureOptions,
    ),
    "ukf": _row(
        "unscented Kalman filter", "Julier and Uhlmann 1997", 2, "sigma_point", UnscentedOptions
    ),
    "ckf": _row("cubature Kalman filter", "Arasaratnam and Haykin 2009", 2, "sigma_point"),
    "ghkf": _row(
        "Gauss-Hermite Kalman filter", "Ito and Xiong 2000", 2, "sigma_point", QuadratureOptions
    ),
    "gaussian-sum": _row(
        "bank of EKFs or second-order filters, near ones merged", "Alspach and Sorenson 1972", 2, "gaussian_sum",
        MixtureOptions,
    ),
    "ensemble": _row(
        "ensemble Kalman filter with perturbed measurements", "Evensen 1994; Burgers et al. 1998", 2,
        "ensemble", EnsembleOptions,
    ),
    "bootstrap": _row(
        "bootstrap particle filter, systematic resampling", "Gordon, Salmond and Smith 1993", 0, "bootstrap",
        ParticleOptions,
    ),
}  # fmt: skip
