"""What the bound for stalls leaves an axis that carries a load, and what `check` says of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.config import load_rig
from tautwave.rig import build_rig
from tautwave.rig.claim_verdict import NOTHING_LEFT, bound_hints
from tautwave.session.checking import check
from tautwave.wording import Hint

ARMS = Path(__file__).parents[2] / "configs" / "arms"
LOADED = ("slave.axes.j2.stall_energy_j=auto",)


def hints(*overrides: str) -> list[Hint]:
    rig = load_rig(ARMS / "six-mit.yaml", overrides)
    return list(bound_hints(rig, build_rig(rig, clock="fake").delays))


@pytest.mark.parametrize(
    ("limit", "left"),
    [("0.6", "0 of 9.42 N m beside the 6.58 N m of its load: it does not follow"), ("4", None)],
)
def test_a_joint_that_only_carries_its_load_is_named_with_what_helps(
    limit: str, left: str | None
) -> None:
    """Its load was counted as left: 6.58 N m, 41% of effort_limit, of which the pair had none."""
    given = (*LOADED, f"slave.axes.j2.velocity_limit={limit}")
    (hint,) = hints(*given)
    if left is None:
        assert hint[0] == "hint on slave.j2"
        assert "of what its load leaves of effort_limit" in hint[1]
        return
    assert hint[0] == f"{NOTHING_LEFT} slave.j2"
    assert hint[1].startswith(f"stall_energy_j leaves it {left}")
    assert hint.change.startswith("slave.axes.j2.stall_energy_j=")
    assert not hints(*given, hint.change)  # what it says helps


@pytest.mark.slow
def test_the_first_screen_says_it_before_anything_else() -> None:
    rig = load_rig(ARMS / "six-mit.yaml", (*LOADED, "slave.axes.j2.velocity_limit=0.6"))
    best = check(rig).improvement
    assert best is not None
    assert best[0] == f"{NOTHING_LEFT} slave.j2"
