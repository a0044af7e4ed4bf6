"""Coulomb friction of coupled joints over a step: set-valued, stuck where it can be; SI units."""

from __future__ import annotations

import math


def speeds_under_friction(
    matrix: list[float], right: list[float], coulomb: list[float], signs: list[float]
) -> list[float]:
    """Return the speeds w [rad/s or m/s] of matrix w = right - coulomb sign(w), by joint.

    `coulomb` and `right` are impulses [N m s or N s]; `signs` begins and ends as those of w.

    A joint that would reverse within the step is stuck, one that is stuck starts where the others
    push it beyond its friction. Should that go in circles, the last state stands.
    """
    count = len(right)
    for _ in range(4 * count):
        moving = [i for i in range(count) if coulomb[i] == 0.0 or signs[i] != 0.0]
        speeds = _solve(matrix, [right[i] - coulomb[i] * signs[i] for i in range(count)], moving)
        again = False
        for i in range(count):
            if coulomb[i] == 0.0:
                continue
            if signs[i] != 0.0:
                if speeds[i] * signs[i] < 0.0:
                    signs[i] = 0.0
                    again = True
            else:
                pull = right[i]
                for j in moving:
                    pull -= matrix[i * count + j] * speeds[j]
                if abs(pull) > coulomb[i]:
                    signs[i] = math.copysign(1.0, pull)
                    again = True
        if not again:
            break
    return speeds


def _solve(matrix: list[float], right: list[float], moving: list[int]) -> list[float]:
    """Return the solution of a definite system in the joints that move, 0 for all others."""
    count = len(right)
    rows = [[matrix[i * count + j] for j in moving] + [right[i]] for i in moving]
    size = len(moving)
    for k in range(size):
        top = rows[k]
        for i in range(k + 1, size):
            row = rows[i]
            factor = row[k] / top[k]
            for j in range(k + 1, size + 1):
                row[j] -= factor * top[j]
    solution = [0.0] * count
    for k in range(size - 1, -1, -1):
        row = rows[k]
        value = row[size]
        for j in range(k + 1, size):
            value -= row[j] * solution[moving[j]]
        solution[moving[k]] = value / row[k]
    return solution
