"""What `check` states of each axis: numbers, or why there is none."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave.config import Rig, load_rig
from tautwave.rig import command_delays
from tautwave.session import check
from tautwave.session.claims import claims_of
from tests.certificate.rigs import CONFIGS

NUMBERS = {"claim_j", "prompt_j", "stall_j", "let_go_j", "dead_j", "kinetic_j", "gap_s", "ratio"}
RIGS = sorted(path.stem for path in CONFIGS.glob("*.yaml"))


def stated(rig: Rig) -> dict[str, dict[str, Any]]:
    return check(rig, brief=True).as_dict()["claims"]


def lever(*changes: str) -> dict[str, dict[str, Any]]:
    """What is stated of a position coupling that its devices' damping carries."""
    soft = ["coupling.delay_s=0", "coupling.pairs.lever.stiffness=0.1", *changes]
    soft += [f"coupling.pairs.lever.{key}" for key in ("damping=0",)]
    return stated(load_rig(CONFIGS / "bench-position-coupling.yaml", soft))


@pytest.mark.parametrize("name", RIGS)
def test_a_number_that_is_missing_says_why(name: str) -> None:
    rig = load_rig(CONFIGS / f"{name}.yaml")
    found = [one.as_dict() for one in claims_of(rig, command_delays(rig))]
    assert len(found) >= len(rig.own_axes) - len(rig.coupling.pairs) * (rig.scene is not None)
    for one in found:
        assert one.keys() >= NUMBERS | {"absent"}
        missing = {key for key in one if one[key] is None}
        assert missing == one["absent"].keys()
        assert all(one["absent"].values())
        assert all(one[key] == one[key] for key in NUMBERS)  # no NaN


LIMITS = [f"{side}.axes.lever.velocity_limit=15" for side in ("master", "slave")]
STOPS = [f"{side}.axes.lever.mechanical_range=[-1, 1]" for side in ("master", "slave")]


def test_a_certified_law_gives_nothing_while_its_host_is_prompt() -> None:
    bare = lever()["master.lever"]
    assert bare["prompt_j"] is None  # its ends may be moved apart while it engages
    assert "engage" in bare["absent"]["prompt_j"]
    assert "velocity_limit or mechanical_range" in bare["absent"]["stall_j"]
    at_once = lever("coupling.engage_ramp_s=0")["master.lever"]
    assert at_once["prompt_j"] == 0.0
    assert "each stall may supply as much again" in at_once["absent"]["claim_j"]
    limited = lever(*LIMITS)["master.lever"]
    assert limited["prompt_j"] > 0.0  # what its engagement may supply
    assert limited["stall_j"] >= limited["let_go_j"] > 0.0
    assert limited["judged"] in ("passed", "conditional")


def test_one_that_is_not_certified_says_what_its_certificate_says() -> None:
    found = stated(load_rig(CONFIGS / "bench-position-coupling.yaml"))["slave.lever"]
    assert found["prompt_j"] is None
    assert found["absent"]["prompt_j"].startswith("coupling of lever: not passive")


def test_end_stops_bound_a_stall_where_nothing_else_does() -> None:
    """An effort of 1.1 N m works over 2 rad and an encoder step at most."""
    found = lever(*STOPS)["master.lever"]
    assert found["stall_j"] == pytest.approx(1.1 * 2.0, rel=1e-4)


def test_end_stops_of_a_scene_s_axis_count() -> None:
    """Of a stall, and of what acts until a run that created too much has stopped."""
    path, stops = CONFIGS / "scene-resonator.yaml", "master.axes.stylus.mechanical_range"
    free, fast = "master.axes.stylus.velocity_limit=null", "master.axes.stylus.velocity_limit=5"
    found = {
        (limit, width): stated(load_rig(path, [limit, f"{stops}={width}"]))["master.stylus"]
        for limit in (free, fast)
        for width in ("null", "[-0.1, 0.1]", "[-0.1, 0.10001]")
    }
    assert found[free, "null"]["stall_j"] is None
    assert found[free, "null"]["prompt_j"] is None
    assert found[free, "[-0.1, 0.1]"]["stall_j"] == pytest.approx(20.0 * 0.2)
    assert found[free, "[-0.1, 0.1]"]["prompt_j"] == pytest.approx(20.0 * 0.2 + 0.01)
    assert found[fast, "[-0.1, 0.1]"]["stall_j"] < found[fast, "null"]["stall_j"]
    assert found[free, "[-0.1, 0.10001]"]["stall_j"] > found[free, "[-0.1, 0.1]"]["stall_j"]
