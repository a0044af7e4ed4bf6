"""Plants integrated in tiny steps, with nothing clever: the judge of the located events."""

from __future__ import annotations

from tautwave.models.plant import PlantParams


def brute_step(
    p: PlantParams,
    x: float,
    v: float,
    effort: float,
    reference: float,
    reference_rate: float,
    h: float,
    pieces: int,
) -> tuple[float, float]:
    """Velocity Verlet with friction that may stop the mass; error of order h / pieces."""
    dt = h / pieces
    for i in range(pieces):
        ref = reference + reference_rate * dt * (i + 0.5)
        middle = x + 0.5 * dt * v
        force = effort + p.grip_stiffness * (ref - middle)
        force -= p.spring_stiffness * (middle - p.spring_position)
        force += p.grip_damping * (reference_rate - v) - p.viscous * v
        depth = p.wall_side * (middle - p.wall_position)
        if depth > 0.0:
            push = p.wall_stiffness * depth + p.wall_damping * p.wall_side * v
            if push > 0.0:
                force -= p.wall_side * push
        if p.coulomb > 0.0:
            free = v + dt * force / p.mass
            slowed = dt * p.coulomb / p.mass
            if free > slowed:
                after = free - slowed
            elif free < -slowed:
                after = free + slowed
            else:
                after = 0.0
        else:
            after = v + dt * force / p.mass
        x = middle + 0.5 * dt * after
        v = after
    return x, v
