"""Oracle of the kernels' random numbers in plain NumPy: Threefry-2x64, Box-Muller, and normals within a bound."""

from __future__ import annotations

import numpy as np

START, NOISE, BOUNDED_START = 1, 2, 3


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


def bounded(seed, trajectories):
    """The first of a trajectory's normals, scaled to variance one, that is within 2.1."""
    draws = []
    for trajectory in trajectories:
        one, index = np.array([trajectory]), 0
        while True:
            pair = 1.2509323795 * np.array(normals(seed, BOUNDED_START, one, index))
            inside = pair[np.abs(pair) <= 2.1]
            if len(inside):
                draws.append(inside[0])
                break
            index += 1
    return np.array(draws)
