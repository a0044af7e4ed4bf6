"""What the hand feels of a follower with a sliding joint: its slope grows with the way out."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.config import load_rig
from tautwave.rig.arms import load_stiffnesses

AXES = Path(__file__).parents[2] / "configs" / "bench-2axis-loopback.yaml"
MASS = 0.01
ARM = (
    f"slave.arm={{dh: [{{alpha: 1.5707963267948966}}, {{kind: prismatic, mass: {MASS}}}], "
    "gravity: [0, -9.81, 0], reflect_load: true}"
)


@pytest.mark.parametrize(
    ("operate", "out"),
    [
        ([], 0.15),
        # The slide moves twice as far at the follower; a free leader goes on by its whole range.
        (["operate={}"], 0.15 + 2.0 * 0.16),
    ],
)
def test_the_slope_counts_how_far_out_the_slide_may_be(operate: list[str], out: float) -> None:
    """Of V = m g s sin q: its second derivatives are m g s and m g, whose sum bounds the row."""
    keys = [ARM, *operate]
    for name in ("wrist", "slide"):
        keys += [f"coupling.pairs.{name}.{key}" for key in ("offset=0.0", "engage_tolerance=0.2")]
    rig = load_rig(AXES, keys)
    own = load_stiffnesses(rig, "slave")
    assert own["slave.wrist"] == pytest.approx(MASS * 9.81 * (0.15 + 1.0))
    felt = load_stiffnesses(rig, "master")
    assert felt["master.wrist"] == pytest.approx(2.0 * MASS * 9.81 * (out + 1.0))
    assert felt["master.slide"] == pytest.approx(2.0 / 0.5 * MASS * 9.81)
