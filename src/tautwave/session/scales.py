"""The scales that a person may choose in an operated rig: certified each, claimed together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tautwave.config import Rig
from tautwave.rig.scales import scaled


def scales_of(rig: Rig) -> list[Rig]:
    """Return the rig with each of its other scales."""
    return [] if rig.operate is None else [scaled(rig, factor) for factor in rig.operate.scales]


def greatest(claims: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the greatest claim of each side [J] among those of a rig with several scales."""
    sides = claims[0].get("claim_j", {})
    by_side = {side: max(one["claim_j"][side] for one in claims) for side in sides}
    return {"claim_j": by_side} if by_side else {}


def times(claims: dict[str, Any], count: int) -> dict[str, Any]:
    """Return what ports claim [J] of a run with `count` engagements, from that for one."""
    return {
        key: {side: count * joules for side, joules in sides.items()}
        for key, sides in claims.items()
    }
