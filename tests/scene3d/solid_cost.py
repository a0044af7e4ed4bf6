"""What a look at a solid costs, by triangles and place: `python -m tests.scene3d.solid_cost`.

CPU time of plain Python, as ratios to a look just below the surface of the smallest ball. Places
are drawn; as in a run each look begins with the triangle that was nearest a moment ago. The least
of some rounds counts.
"""

from __future__ import annotations

import math
import random
import time

from tautwave_scenes.models.solid import laid_out
from tautwave_scenes.models.surface import surface_of
from tests.scene3d.solids import ball, made

RADIUS = 0.02
RINGS = (8, 20, 40)
PLACES = {"1 mm below the surface": 0.95, "half-way to the middle": 0.5, "in the middle": 0.0}
"""Distance from the middle, as a share of the radius."""
LOOKS, ROUNDS = 40, 7


def look_s(rings: int, share: float) -> float:
    """Return the CPU time of a look at a ball [s]."""
    solid = made(ball(RADIUS, rings))
    laid, draw = laid_out(solid), random.Random(0)
    end = len(laid.tree) // 2
    least = math.inf
    for _ in range(ROUNDS):
        looks = []
        for _ in range(LOOKS):
            way = [draw.gauss(0.0, 1.0) for _ in range(3)]
            long = math.hypot(*way)
            x, y, z = (share * RADIUS * part / long for part in way)
            looks.append(((x, y, z), surface_of(*laid, 0, end, 0, x, y, z)[4]))
        begun = time.process_time()
        for (x, y, z), guess in looks:
            surface_of(*laid, 0, end, guess, x, y, z)
        least = min(least, (time.process_time() - begun) / LOOKS)
    return least


def main() -> None:
    """Print the table of the docs."""
    counts = [len(made(ball(RADIUS, rings)).triangles) for rings in RINGS]
    one = look_s(RINGS[0], PLACES["1 mm below the surface"])
    print("| where | " + " | ".join(f"{count:,}" for count in counts) + " |")
    print("|---" * (1 + len(counts)) + "|")
    for where, share in PLACES.items():
        ratios = [look_s(rings, share) / one for rings in RINGS]
        cells = [f"{float(f'{ratio:.2g}'):,g}" for ratio in ratios]
        print(f"| {where} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
