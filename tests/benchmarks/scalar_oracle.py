"""Oracles of the benchmark kernels in plain NumPy: moment equations, Bayes's rule, Threefry-2x64, Box-Muller.

The update is not Table 5.1: it integrates the Hermite prior times the likelihood by Gauss-Hermite quadrature.
"""

from __future__ import annotations

import numpy as np

MEAN, VARIANCE, STEP, STEPS = 2.0, 0.16, 0.02, 5
START, NOISE = 1, 2


def filtered(y, noise_variance):
    """Mean, variance and third moment after each measurement, (times, 3, ...) for y (times, ...)."""
    moments = np.stack([np.full(y.shape[1:], MEAN), np.full(y.shape[1:], VARIANCE), np.zeros(y.shape[1:])])
    history = []
    for y_k in y:
        for _ in range(STEPS):
            moments = rk4(rates, moments)
        moments = posterior(moments, y_k, noise_variance)
        history.append(moments)
    return np.array(history)


def rates(moments):
    """E[f], 2E[ef] and 3E[e^2 (f - E[f])] for f = -2x + .7x^2 expanded about the mean, with E[e^4] = 3p^2."""
    m, p, s = moments
    fourth = 3 * p**2
    value, slope, half = -2 * m + 0.7 * m**2, -2 + 1.4 * m, 0.7
    mean_drift = value + half * p
    return np.stack(
        [
            mean_drift,
            2 * (slope * p + half * s),
            3 * (value * p + slope * s + half * fourth - p * mean_drift),
        ]
    )


def rk4(rate, x):
    k1 = rate(x)
    k2 = rate(x + STEP / 2 * k1)
    k3 = rate(x + STEP / 2 * k2)
    k4 = rate(x + STEP * k3)
    return x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def posterior(moments, y, noise_variance):
    """Moments of N(x; m, p) {1 + s He3 / 6} N(y; x, R), a Gaussian times a cubic: eight nodes are exact."""
    m, p, s = moments
    nodes, weights = np.polynomial.hermite_e.hermegauss(8)
    spread = p * noise_variance / (p + noise_variance)
    centre = m + spread / noise_variance * (y - m)
    x = centre + np.sqrt(spread) * nodes.reshape(-1, *[1] * np.ndim(m))
    e = x - m
    w = weights.reshape(-1, *[1] * np.ndim(m)) * (1 + s / 6 * (e**3 - 3 * p * e) / p**3)
    w = w / w.sum(0)
    mean = (w * x).sum(0)
    return np.stack([mean, *((w * (x - mean) ** order).sum(0) for order in (2, 3))])


def threefry(key, counter):
    """Threefry-2x64 with 20 rounds (Salmon, Moraes, Dror and Shaw 2011), from its definition."""
    schedule = [*key, key[0] ^ key[1] ^ np.uint64(0x1BD11BDAA9FC1A22)]
    x, y = counter[0] + schedule[0], counter[1] + schedule[1]
    for r, turn in enumerate([16, 42, 12, 31, 16, 32, 24, 21] * 2 + [16, 42, 12, 31], start=1):
        x = x + y
        y = (y << np.uint64(turn) | y >> np.uint64(64 - turn)) ^ x
        if r % 4 == 0:
            x = x + schedule[r // 4 % 3]
            y = y + schedule[(r // 4 + 1) % 3] + np.uint64(r // 4)
    return x, y


def normals(seed, purpose, trajectories, index):
    """Two standard normals of each trajectory."""
    with np.errstate(over="ignore"):
        bits = threefry(
            (np.uint64(seed), np.uint64(purpose)), (trajectories, np.full_like(trajectories, index))
        )
    first, second = ((b >> np.uint64(12)) * 2.0**-52 for b in bits)
    radius = np.sqrt(-2 * np.log(1 - first))
    return radius * np.cos(2 * np.pi * second), radius * np.sin(2 * np.pi * second)


def initial_states(seed, trajectories):
    """2 + d with the first of a trajectory's normals that keeps |d| <= .84."""
    states = []
    for trajectory in trajectories:
        one, index = np.array([trajectory]), 0
        while True:
            pair = 0.5003729518 * np.array(normals(seed, START, one, index))
            inside = pair[np.abs(pair) <= 0.84]
            if len(inside):
                states.append(2 + inside[0])
                break
            index += 1
    return np.array(states)


def experiment(seed, trajectories, times, noise_variance):
    """Error, variance and third moment after each update, (times, 3, trajectories)."""
    x = initial_states(seed, trajectories)
    draws = np.concatenate([normals(seed, NOISE, trajectories, k) for k in range((times + 1) // 2)])
    truth, y = [], []
    for k in range(times):
        for _ in range(STEPS):
            x = rk4(lambda x: -2 * x + 0.7 * x**2, x)
        truth.append(x)
        y.append(x + np.sqrt(noise_variance) * draws[k])
    history = filtered(np.array(y), noise_variance)
    history[:, 0] = np.array(truth) - history[:, 0]
    return history
