"""What `check` states of each axis: numbers, or why there is none."""

from __future__ import annotations

import itertools
import re
from typing import Any

import pytest

from tautwave import Stepper
from tautwave.config import Rig, load_rig
from tautwave.rig import command_delays
from tautwave.session import check
from tautwave.session.claims import claims_of
from tests.certificate.rigs import CONFIGS

SIDES = ("master", "slave")
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


def damped(ramp_s: float, stiffness: float, *changes: str) -> Rig:
    """A position coupling that its devices' damping carries up to 15 rad/s and 5 N m/rad."""
    keys = [f"{side}.axes.lever.{key}" for side in ("master", "slave") for key in DAMPED]
    keys += [*LIMITS, "require=passive", "loop.missing_limit=1", "loop.overrun_limit=2"]
    keys += [f"coupling.engage_ramp_s={ramp_s}", f"coupling.pairs.lever.stiffness={stiffness}"]
    keys += [f"simulation.axes.{side}.lever.damping=0.02" for side in SIDES]
    keys += ["coupling.pairs.lever.damping=0", *changes]
    return load_rig(CONFIGS / "bench-position-coupling.yaml", keys)


DAMPED = (
    "damping={value: 0.02, lower: 0.02, source: identified}",
    "effort_limit=1",
    "effort_rate_limit=6000",
)

JUDGED = {(0.02, 1.2): "passed", (0.2, 0.3): "conditional", (0.2, 1.2): "conditional"}


@pytest.mark.parametrize(("ramp_s", "stiffness"), JUDGED)
def test_what_an_engagement_may_supply_is_judged_as_of_other_laws(
    ramp_s: float, stiffness: float
) -> None:
    """Up to twice the kinetic energy without a condition, up to ten times it with one in words."""
    found = check(damped(ramp_s, stiffness))
    assert found.exit_code == 0
    said = str(found.certificate)
    for one in found.as_dict()["claims"].values():
        assert one["judged"] == JUDGED[ramp_s, stiffness]
        assert (one["prompt_j"] > 2.0 * one["kinetic_j"]) is (one["judged"] == "conditional")
        assert one["prompt_j"] <= 10.0 * one["kinetic_j"]
    assert ("in one engagement, " in said) is (JUDGED[ramp_s, stiffness] == "conditional")


def test_an_engagement_that_may_supply_too_much_is_refused_with_a_ramp_that_does() -> None:
    found = check(damped(2.0, 5.0))
    assert found.exit_code == 3
    assert "may supply 1.93 J at once while the host is prompt, 11 times" in found.failures[0]
    [ramp] = re.findall(r"engage_ramp_s of (\S+) s or less would do", found.failures[0])
    assert check(damped(float(ramp), 5.0), brief=True).exit_code == 0
    assert check(damped(1.5 * float(ramp), 5.0), brief=True).exit_code == 3


def test_an_end_is_judged_by_its_own_share_of_an_engagement() -> None:
    """With force_scale 4 the slave gives four times what the master does."""
    claims = stated(damped(0.2, 0.1, "coupling.pairs.lever.force_scale=4"))
    assert claims["slave.lever"]["prompt_j"] == pytest.approx(
        4.0 * claims["master.lever"]["prompt_j"]
    )
    assert [claims[f"{side}.lever"]["judged"] for side in SIDES] == ["passed", "conditional"]


@pytest.mark.parametrize("width", [0.1, 0.5])
def test_ranges_bound_how_far_ends_are_moved_as_they_engage(width: float) -> None:
    """Both go from one end to the other, and on for a period and the 3 ms that a command takes."""
    ranges = [f"{side}.axes.lever.position_range=[-{width}, {width}]" for side in SIDES]
    quiet = ["simulation.hand={}", "simulation.environment={}"]
    found = stated(damped(2.0, 0.1, *ranges, *quiet))["master.lever"]
    [late] = {delay.periods for delay in command_delays(damped(2.0, 0.1)).values()}
    stretch = 2.0 * (2.0 * width + 15.0 * 1e-3 * (1 + late))
    assert found["prompt_j"] == pytest.approx(0.5 * 0.1 * stretch**2)


def test_no_engagement_supplies_more_than_is_stated_and_a_rough_one_comes_near() -> None:
    """From end to end as the coupling fades in, and back when it has all of its effort."""
    rig = damped(1.0, 1.2, "simulation.hand={}", "simulation.environment={}")
    period, reach = rig.period_s, 0.48
    out, back = round(0.25 / period), round(1.5 / period)
    shape = [-reach + 2.0 * reach * smooth(k / out) for k in range(out)]
    shape += [reach] * round(0.8 / period)
    shape += [reach - 2.0 * reach * smooth(k / back) for k in range(back + 1)]
    given = 0.0
    with Stepper(rig, outside=SIDES, duration_s=(len(shape) + 5) * period) as run:
        for here, there in itertools.pairwise(shape):
            efforts = run.step({"master.lever": here, "slave.lever": -here})
            step = there - here
            given += (efforts["master.lever"] - efforts["slave.lever"]) * step
            given -= 2.0 * 0.02 * step * step / period
    most = stated(rig)["master.lever"]["prompt_j"]
    assert 0.6 * most < given <= most


def smooth(part: float) -> float:
    """Minimum jerk from 0 to 1."""
    return part**3 * (10.0 - 15.0 * part + 6.0 * part * part)


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
