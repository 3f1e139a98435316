"""Oracle of the benchmarks' moment filters in plain NumPy, with full tensors and every number written again.

Derivatives of a drift come from its series along straight lines. The update is not table 5.1: it integrates the prior,
a normal density times a Hermite series, times the likelihood by Gauss-Hermite quadrature, exact for such polynomials.
Batches come first: means (N, n), covariances (N, n, n), third moments (N, n, n, n).
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations_with_replacement, product
from typing import Any, NamedTuple

import numpy as np

from tests.benchmarks import random_oracle

MU = 1.66935e14
LANDMARK = 5.7e6 * np.exp(0.25j * np.pi)  # x + iy


class Problem(NamedTuple):
    """line: (x, v) -> coefficients of 1, s and s^2 in f(x + s v). observe: x -> h (N, m) and H (N, m, n).

    bounded: the state whose true values are drawn within a bound, or None.
    """

    line: Callable[[Any, Any], tuple[Any, Any, Any]]
    observe: Callable[[Any], tuple[Any, Any]]
    variances: list[float]
    mean: list[float]
    deviations: list[float]
    bounded: int | None
    step: float
    steps: int


def scalar_line(x, v):
    return -2 * x + 0.7 * x**2, -2 * v + 1.4 * x * v, 0.7 * v**2


def oscillator_line(x, v):
    zero = 0 * x[..., 0]
    value = [x[..., 1], -x[..., 0] - 2 * x[..., 1] * x[..., 2], zero]
    first = [v[..., 1], -v[..., 0] - 2 * (x[..., 1] * v[..., 2] + v[..., 1] * x[..., 2]), zero]
    second = [zero, -2 * v[..., 1] * v[..., 2], zero]
    return tuple(np.stack(each, axis=-1) for each in (value, first, second))


def orbit_line(x, v):
    """1/r^3 is the power -3/2 of q = q0 + q1 s + q2 s^2, by the binomial series."""
    r, along = x[..., :2], v[..., :2]
    q0, q1, q2 = ((each).sum(-1, keepdims=True) for each in (r * r, 2 * r * along, along * along))
    p0 = q0**-1.5
    p1, p2 = -1.5 * p0 * q1 / q0, p0 * (-1.5 * q2 / q0 + 1.875 * (q1 / q0) ** 2)
    value, first, second = -MU * r * p0, -MU * (r * p1 + along * p0), -MU * (r * p2 + along * p1)
    return (
        np.concatenate([x[..., 2:], value], axis=-1),
        np.concatenate([v[..., 2:], first], axis=-1),
        np.concatenate([0 * v[..., 2:], second], axis=-1),
    )


def first_states(m):
    """Observes as many states as there are measurements, m."""

    def observe(x):
        return x[:, :m], np.broadcast_to(np.eye(m, x.shape[1]), (len(x), m, x.shape[1]))

    return observe


def landmark(x):
    """The imaginary part of the logarithm of the direction, and of its derivatives."""
    direction = LANDMARK - (x[:, 0] + 1j * x[:, 1])
    slope = np.stack([-1 / direction, -1j / direction, 0 * direction, 0 * direction], axis=-1)
    return np.angle(direction)[:, None], slope.imag[:, None, :]


PROBLEMS = {
    "scalar": Problem(scalar_line, first_states(1), [1.6], [2.0], [0.4], 0, 0.02, 5),
    "oscillator": Problem(
        oscillator_line, first_states(2), [50.0, 50.0], [10.0, 0.0, 0.5], [3.0, 3.0, 0.4], 2, 0.05, 4
    ),
    "orbit": Problem(
        orbit_line, landmark, [2.5e-5], [8.34e6, 0.0, 0.0, 4470.0], [5e3, 5e3, 2.0, 2.0], None, 30.0, 20
    ),
}


def filtered(problem, order, y):
    """Unique components of the moments after each measurement, (N, times, k), for y (N, times, m)."""
    n = len(problem.mean)
    start = (np.array(problem.mean), np.diag(problem.deviations) ** 2, np.zeros((n, n, n)))
    moments = tuple(np.broadcast_to(each, (len(y), *each.shape)) for each in start)
    history = []
    for k in range(y.shape[1]):
        for _ in range(problem.steps):
            moments = rk4(lambda moments: rates(problem, order, *moments), problem.step, moments)
        moments = posterior(problem, *moments, y[:, k])
        if order == 2:
            moments = (*moments[:2], 0 * moments[2])
        history.append(components(moments[:order]))
    return np.stack(history, axis=1)


def components(moments):
    """Mean, covariance and third moment, each in lexicographic order of nondecreasing indices."""
    n = moments[0].shape[-1]
    unique = [
        moment[(slice(None), *index)]
        for order, moment in enumerate(moments, start=1)
        for index in combinations_with_replacement(range(n), order)
    ]
    return np.stack(unique, axis=-1)


def rates(problem, order, m, P, S):
    """(4.64)-(4.66) of Culver (1969) without measurements, mu4 = 3{P P}."""
    f, F, A = expansion(problem.line, m)
    mu4 = sum(np.einsum(f"zab,zcd->z{to}", P, P) for to in ("abcd", "acbd", "acdb"))
    G = np.einsum("zie,zje->zij", F, P) + np.einsum("zief,zjef->zij", A, S)
    T = np.einsum("zie,zejk->zijk", F, S) + np.einsum(
        "zief,zjkef->zijk", A, mu4 - np.einsum("zjk,zef->zjkef", P, P)
    )
    dS = T + T.transpose(0, 2, 1, 3) + T.transpose(0, 3, 2, 1) if order == 3 else 0 * S
    return f + np.einsum("zief,zef->zi", A, P), G + G.transpose(0, 2, 1), dS


def expansion(line, m):
    """f, F and A from lines along the axes and between them."""
    n = m.shape[-1]
    axes = np.eye(n)
    f = line(m, np.zeros_like(m))[0]
    F = np.stack([line(m, np.broadcast_to(a, m.shape))[1] for a in axes], axis=-1)
    bend = lambda v: line(m, np.broadcast_to(v, m.shape))[2]  # noqa: E731
    A = np.stack(
        [np.stack([(bend(a + b) - bend(a) - bend(b)) / 2 for b in axes], axis=-1) for a in axes], axis=-1
    )
    return f, F, A


def rk4(rate, h, x):
    moved = lambda k, h: tuple(a + h * b for a, b in zip(x, k, strict=True))  # noqa: E731
    k1 = rate(x)
    k2 = rate(moved(k1, h / 2))
    k3 = rate(moved(k2, h / 2))
    k4 = rate(moved(k3, h))
    slopes = tuple((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4, strict=True))
    return moved(slopes, h)


def posterior(problem, m, P, S, y):
    """Moments of N(e; 0, P) {1 + S:He3/6} N(z - H e; 0, R): a normal density times a cubic, so four nodes are exact."""
    h, H = problem.observe(m)
    z = y - h
    if problem.observe is landmark:
        z = np.angle(np.exp(1j * z))
    scale = np.sqrt(np.einsum("zii->zi", P))  # all in units of the prior deviations
    P, H = P / scale[:, :, None] / scale[:, None, :], H * scale[:, None, :]
    S = S / np.einsum("zi,zj,zk->zijk", scale, scale, scale)
    inverse, precision = np.linalg.inv(P), np.diag(1 / np.array(problem.variances))
    spread = np.linalg.inv(inverse + np.einsum("zri,rs,zsj->zij", H, precision, H))
    centre = np.einsum("zij,zrj,rs,zs->zi", spread, H, precision, z)
    nodes, weights = np.polynomial.hermite_e.hermegauss(4)
    grid = np.array(list(product(nodes, repeat=m.shape[-1])))
    e = centre[:, None] + np.einsum("zij,qj->zqi", np.linalg.cholesky(spread), grid)
    p = np.einsum("zij,zqj->zqi", inverse, e)
    cubic = np.einsum("zabc,zqa,zqb,zqc->zq", S, p, p, p) - 3 * np.einsum("zabc,zab,zqc->zq", S, inverse, p)
    w = np.array([np.prod(each) for each in product(weights, repeat=m.shape[-1])]) * (1 + cubic / 6)
    w = w / w.sum(1, keepdims=True)
    moved = np.einsum("zq,zqi->zi", w, e)
    d = e - moved[:, None]
    cov = np.einsum("zq,zqi,zqj->zij", w, d, d) * np.einsum("zi,zj->zij", scale, scale)
    third = np.einsum("zq,zqi,zqj,zqk->zijk", w, d, d, d) * np.einsum("zi,zj,zk->zijk", scale, scale, scale)
    return m + scale * moved, cov, third


def experiment(problem, seed, trajectories, times):
    """Unique components after each update, with the error in place of the mean, (N, times, k)."""
    draws = [random_oracle.normals(seed, random_oracle.START, trajectories, index) for index in range(2)]
    d = np.concatenate(draws)[: len(problem.mean)].T.copy()
    if problem.bounded is not None:
        d[:, problem.bounded] = random_oracle.bounded(seed, trajectories)
    x, m = np.array(problem.mean) + np.array(problem.deviations) * d, len(problem.variances)
    pairs = [random_oracle.normals(seed, random_oracle.NOISE, trajectories, k) for k in range(times * m)]
    noise = np.concatenate(pairs)[: times * m].T.reshape(-1, times, m)
    truth, y = [], []
    for k in range(times):
        for _ in range(problem.steps):
            (x,) = rk4(lambda x: (problem.line(x[0], 0 * x[0])[0],), problem.step, (x,))
        truth.append(x)
        y.append(problem.observe(x)[0] + np.sqrt(problem.variances) * noise[:, k])
    history = filtered(problem, 3, np.stack(y, axis=1))
    n = len(problem.mean)
    history[:, :, :n] = np.stack(truth, axis=1) - history[:, :, :n]
    return history
