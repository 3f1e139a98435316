"""Navigation of a lunar orbit by sightings of landmarks (Culver 1969, sections 8.3 and 8.4).

  d2x/dt2 = -mu x/r^3,  d2y/dt2 = -mu y/r^3                                                (8.17)-(8.18), printed
  phi = atan2(R sin theta_l - y, R cos theta_l - x) + noise                                (8.28), in a form without
                                                                                           ambiguous quadrants
Planar motion in feet and seconds, angles in radians. It is in the benchmark because it is the thesis's real application
and because sightings are rare: moments have to be carried over whole orbits, and filters diverge.

                             100-mile                        500-mile
  initial radius, speed      6.228e6, 5175 (printed)         8.34e6 (inferred: 5.7e6 + 500 5280; 8.54e6 is printed),
                                                             4470 (printed)
  variances at the start     1e6, 1e6, 1, 1 (printed)        2.5e7, 2.5e7, 4, 4 (printed)
  variance of a sighting     1.6e-5 (printed)                2.5e-5 (printed)
  sightings of a landmark    -8, 0, 9 degrees (inferred)     -15, 15 degrees (chosen)
  integration step           50 (inferred)                   30 (printed)
mu = 1.66935e14 and the radius 5.7e6 of the moon are inferred (mu fits table 8.1; the true 1.7314e14 does not), and so
are the landmarks' central angles, 89 and 269 degrees from the start. Sightings are made on every other orbit, the first
included (printed): at the first step at which the filter's own central angle, followed round and round, has reached
theta_l and the offset (`trigger: filter`), or that of the undisturbed orbit has (`trigger: nominal`). The noise of a
sighting belongs to its number, whenever it is made.

`coordinates: polar` is the filter's state (r, r0 theta, dr/dt, r0 dtheta/dt) of (8.15)-(8.16). The truth is always
drawn and integrated in Cartesian coordinates. A polar filter starts from the same variances, taken in its own
coordinates (`initial_cov: diagonal`, inferred from table 8.4), or from the Cartesian ones carried over (`transformed`).
Errors are Cartesian, resolved in the local vertical of the true state (`errors: local-vertical`), or in the axes of the
Cartesian or of the polar state, as the tables of moments are; estimates are carried over to first order.
Diverged (chosen): a position error above the diameter of the nominal orbit at a report time, from then on; or, where
landmarks are sighted, a root mean square of it over the last 12,000 s above 50,000 ft, judged at the end.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from nlbench.systems.exact import InitialPosterior
from nlbench.systems.system import Coordinate, LateError, Sets, Sightings, System

if TYPE_CHECKING:
    from nlbench.systems.lunar_geometry import Geometry

SUMMARY = "navigation of a lunar orbit by landmarks (Culver 1969, sections 8.3 and 8.4)"

MU = 1.66935e14  # ft^3/s^2
MOON = 5.70e6  # ft
LANDMARKS = (89.0, 269.0)  # degrees
PERIOD = 4 * math.pi  # of the sightings: every other orbit
LATE_WINDOW, LATE_BOUND = 12_000.0, 50_000.0  # s, ft
COORDINATES = {
    "local-vertical": ("altitude", "range", "altitude_rate", "range_rate"),
    "cartesian": ("x", "y", "x_rate", "y_rate"),
    "polar": ("radius", "arc", "radius_rate", "arc_rate"),
}


class Case(NamedTuple):
    """The numbers in which the thesis's two orbits differ; variances of position and speed, offsets in degrees."""

    radius: float
    speed: float
    position_variance: float
    speed_variance: float
    measurement_variance: float
    offsets: tuple[float, ...]
    step: float
    clip: tuple[float, float]  # of position and of speed


CASES = {
    "100-mile": Case(6.228e6, 5175.0, 1e6, 1.0, 1.6e-5, (-8.0, 0.0, 9.0), 50.0, (1e4, 10.0)),
    "500-mile": Case(8.34e6, 4470.0, 2.5e7, 4.0, 2.5e-5, (-15.0, 15.0), 30.0, (5e4, 50.0)),
}


class InitialError(BaseModel):
    """A true initial state at a fixed distance from the mean."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    sigma: float = Field(gt=0.0, description="error of each state, in standard deviations")
    pattern: str = Field(
        default="all",
        pattern="^(all|[+-]{4})$",
        description="signs of the error, truth less mean, such as ++-+; all: the 16 patterns in turn",
    )


class Parameters(BaseModel):
    """Parameters of `lunar-orbit`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    case: Literal["100-mile", "500-mile"] = Field(
        default="100-mile", description="which orbit, with its variances, sightings and step"
    )
    coordinates: Literal["cartesian", "polar"] = Field(default="cartesian", description="state of the filter")
    initial_cov: Literal["diagonal", "transformed"] = Field(
        default="diagonal", description="of a polar filter: its own, or that of the Cartesian one"
    )
    sightings: bool = Field(default=True, description="whether landmarks are sighted")
    trigger: Literal["filter", "nominal"] = Field(
        default="filter", description="whose central angle a sighting waits for"
    )
    initial_error: Literal["gaussian"] | InitialError = Field(
        default="gaussian", description="draws, or errors of fixed size in a pattern of signs"
    )
    errors: Literal["local-vertical", "cartesian", "polar"] = Field(
        default="local-vertical", description="axes of the errors"
    )
    measurement_variance: float | None = Field(
        default=None, gt=0.0, description="variance of a sighting, rad^2; default: that of the case"
    )
    length_unit: float = Field(
        default=1.0, ge=1e-12, le=1e12, description="unit of length of states and errors, ft"
    )
    time_unit: float = Field(
        default=1.0, ge=1e-12, le=1e12, description="unit of time of the whole experiment, s"
    )


def build(parameters: Parameters) -> System:
    """The system with the given parameters; where it is polar, `truth` is the Cartesian one that makes the data."""
    from nlbench.systems import kepler

    polar = _model(parameters.model_copy(update={"coordinates": "polar", "initial_cov": "transformed"}))
    mu = MU * parameters.time_unit**2 / parameters.length_unit**3
    exact = InitialPosterior(partial(kepler.flow, mu=mu), companion=polar)
    cartesian = replace(_model(parameters.model_copy(update={"coordinates": "cartesian"})), exact=exact)
    if parameters.coordinates == "cartesian":
        return cartesian
    return replace(_model(parameters), truth=cartesian)


def _model(parameters: Parameters) -> System:
    """What a filter in the coordinates of the parameters believes."""
    from nlbench.systems.lunar_geometry import Geometry, wrapped_residual

    case, polar = CASES[parameters.case], parameters.coordinates == "polar"
    L, T = parameters.length_unit, parameters.time_unit
    geometry = Geometry(
        mu=MU * T**2 / L**3,
        moon=MOON / L,
        r0=case.radius / L,
        v0=case.speed * T / L,
        variances=(case.position_variance / L**2,) * 2 + (case.speed_variance * T**2 / L**2,) * 2,
        landmarks=tuple(map(math.radians, LANDMARKS)),
        polar=polar,
        axes=parameters.errors,
    )
    return System(
        drift=geometry.drift,
        observe=geometry.observe_nearest,
        measurement_cov=[[parameters.measurement_variance or case.measurement_variance]],
        initial=geometry.start(parameters.initial_cov == "transformed"),
        sample=_sampler(geometry, parameters.initial_error),
        residual=wrapped_residual,
        coordinates=_coordinates(parameters),
        error=geometry.error,
        diverged=geometry.lost,
        diverged_stays=True,
        diverged_late=LateError(LATE_WINDOW / T, LATE_BOUND / L, (0, 1)) if parameters.sightings else None,
        clip=(case.clip[0] / L,) * 2 + (case.clip[1] * T / L,) * 2,
        step=case.step / T,
        sightings=_sightings(geometry, case, parameters.trigger) if parameters.sightings else None,
        norms={"position": (0, 1), "velocity": (2, 3)},
    )


def _sightings(geometry: Geometry, case: Case, trigger: str) -> Sightings:
    pairs = [(landmark + offset, landmark) for landmark in LANDMARKS for offset in case.offsets]
    return Sightings(
        angles=tuple(math.radians(angle) for angle, _ in pairs),
        marks=tuple(math.radians(landmark) for _, landmark in pairs),
        period=PERIOD,
        rate=geometry.v0 / geometry.r0,
        angle=geometry.central_angle,
        observe=geometry.observe,
        nominal=trigger == "nominal",
    )


def _coordinates(parameters: Parameters) -> tuple[Coordinate, ...]:
    names = COORDINATES[parameters.errors]
    feet = parameters.length_unit == 1.0 and parameters.time_unit == 1.0
    return tuple(map(Coordinate, names, ("ft", "ft", "ft/s", "ft/s") if feet else ("",) * 4))


def _sampler(geometry: Geometry, initial_error: Literal["gaussian"] | InitialError) -> Sets | None:
    """How the true initial state is drawn: normal (None), or from each pattern of signs in turn."""
    if isinstance(initial_error, str):
        return None
    states = geometry.at_pattern(initial_error.sigma, initial_error.pattern)
    return Sets(len(states), lambda normals: states)
