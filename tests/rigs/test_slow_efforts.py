"""Levers whose effort falls slowly: a swing dies away, and grows without the ramp's bound."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tautwave import check, load_rig, simulate
from tautwave.analysis.claim import Claim
from tautwave.config import Rig
from tautwave.couplings.wave import from_keys
from tautwave.couplings.wave.claim import claim_of, claimed_joules
from tautwave.couplings.wave.messages import ramp_hints
from tautwave.couplings.wave.port import compute_effort
from tautwave.laws import port
from tautwave.laws.port import NO_RECOVERY, port_effort
from tautwave.laws.ramp import NO_RAMP, ramp_bound
from tautwave.rig import command_delays
from tautwave.rig.controller import end_constants, site_params
from tautwave.simulation.rows import Simulation

ROOT = Path(__file__).parents[2]
LEVERS = {
    "a fifth of a second": (0.0097, 0.002, 0.2, 0.08, "wall"),
    "a tenth, harder": (0.023, 0.002, 0.105, 0.118, "wall"),
    "a sixteenth": (0.0476, 0.001, 0.064, 0.16, "wall"),
    "a twentieth, weak": (0.0596, 0.002, 0.053, 0.07, "wall"),
    "free": (0.0431, 0.003, 0.13, 0.055, "free"),
    "a second": (0.075, 0.008, 0.87, 0.45, "free"),
}
"""Impedance [N m s/rad], delay [s], time to full effort [s], effort limit [N m], what it meets."""


def slow(impedance: float, delay: float, rise: float, limit: float, meets: str) -> Rig:
    """Return the bench without local walls, at efforts that take `rise` from zero to the limit."""
    changes = [f"coupling.delay_s={delay}", f"coupling.pairs.lever.wave_impedance={impedance}"]
    changes += [f"coupling.pairs.lever.wall_{side}=null" for side in ("master", "slave")]
    for side in ("master", "slave"):
        axis = f"{side}.axes.lever"
        changes += [f"{axis}.effort_limit={limit}", f"{axis}.effort_rate_limit={limit / rise}"]
        true = f"simulation.axes.{side}.lever"
        changes += [f"{true}.coulomb=0.0", f"{true}.damping=2e-3"]
    changes += [
        "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0.5, 0], [0.8, 0.1]]}",
        "duration_s=8",
    ]
    where = "{type: free}"
    if meets == "wall":
        where = "{type: wall, position: 0.08, stiffness: 5.0, damping: 0.0}"
    changes.append(f"simulation.environment.lever={where}")
    return load_rig(ROOT / "configs/bench-1dof-loopback.yaml", changes)


def swing(found: Any, share: float) -> float:
    """Return how far the slave moves in the last `share` of a run, peak to peak [rad]."""
    places = found.data[:, list(found.columns).index("slave.lever.position")]
    last = places[-round(share * len(places)) :]
    return float(last.max() - last.min())


def assert_claims_kept(rig: Rig, found: Simulation) -> None:
    """No end supplied more than it claims, from the start of the run to any time in it [J]."""
    delays = command_delays(rig)
    for side in ("master", "slave"):
        given = -float(found[f"lever.port_{side}.absorbed"].min())
        assert given <= claimed_joules(rig, f"{side}.lever", delays)


@pytest.mark.parametrize("name", LEVERS)
def test_a_certified_lever_with_slow_efforts_settles(name: str) -> None:
    """Nothing stops the run, and what the hand began dies away."""
    rig = slow(*LEVERS[name])
    assert check(rig).certificate["passed"]
    found = simulate(rig)
    assert found.error is None
    assert_claims_kept(rig, found)
    assert swing(found, 0.125) < 0.4 * swing(found, 1.0)


@pytest.mark.parametrize("name", LEVERS)
def test_without_the_bound_it_is_stopped(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The swing empties the tank, unless friction fills it: overdrawn, or a lost coupling."""
    monkeypatch.setattr(port, "ramp_params", lambda *_: NO_RAMP)
    monkeypatch.setattr(from_keys, "recovery_params", lambda *_, **__: NO_RECOVERY)
    rig = slow(*LEVERS[name])
    found = simulate(rig)
    assert found.error is not None
    assert_claims_kept(rig, found)
    assert "more energy than its port had" in str(found.error) or "lost its" in str(found.error)


def test_check_states_what_a_slow_effort_holds_and_the_rate_that_holds_all() -> None:
    """A tenth less than the stated rate still has the hint; of equal axes one is named."""
    limit = LEVERS["a second"][3]
    said = dict(check(slow(*LEVERS["a second"])).facts)["hint on master.lever"]
    assert "takes 870 ms to fall from effort_limit to zero" in said
    assert "at rest a full tank holds about 0.079 N m, 17% of effort_limit" in said
    assert said.endswith("; one more axis holds less than the limit as well")
    enough = float(said.split("with effort_rate_limit ")[1].split(" ")[0])
    for rate, hinted in ((enough, False), (0.9 * enough, True)):
        facts = dict(check(slow(0.075, 0.008, limit / rate, limit, "free")).facts)
        assert ("hint on master.lever" in facts) == hinted


@pytest.mark.parametrize(
    "name", ["arms-loopback", "bench-1dof-loopback", "bench-multirate-loopback"]
)
def test_a_port_knows_the_rate_that_it_has(name: str) -> None:
    """Also on a bus that is served every tenth cycle, and beside a load that takes half of it."""
    rig = load_rig(ROOT / f"configs/{name}.yaml")
    delays = command_delays(rig)
    for axis_name in rig.axes:
        ramp = end_constants(rig, axis_name, delays[axis_name]).port.ramp
        step = site_params(rig, axis_name, delays[axis_name]).limit.effort_step
        assert 2.0 * ramp.half_step == pytest.approx(step, rel=1e-12)
        claim = claim_of(rig, axis_name, delays)
        assert isinstance(claim, Claim)
        assert claim.rate * claim.period == pytest.approx(step, rel=1e-12)


@pytest.mark.parametrize("noise", [0.0, 9e-5])
@pytest.mark.parametrize("rise", [0.02, 0.1, 0.5])
def test_a_strong_press_is_held_alike_at_both_ends(rise: float, noise: float) -> None:
    """A bound that the tank paid for let the master go, while the slave pressed with all it had."""
    changes = ["duration_s=60"]
    for side in ("master", "slave"):
        axis = f"{side}.axes.lever"
        changes += [f"{axis}.effort_rate_limit={1.125 / rise}", f"{axis}.position_noise={noise}"]
    hand, met = "simulation.hand.lever.reference", "simulation.environment.lever"
    changes += [
        f"{hand}={{type: minimum_jerk, waypoints: [[0.5, 0], [1.5, 0.4]]}}",
        f"{met}={{type: wall, position: 0.05, stiffness: 250.0, damping: 0.002}}",
    ]
    rig = load_rig(ROOT / "configs/bench-1dof-2khz.yaml", changes)
    found = simulate(rig)
    assert found.error is None
    last = found.data[-len(found.data) // 8 :]
    felt, pressed = (
        abs(float(last[:, list(found.columns).index(f"{side}.lever.commanded")].mean()))
        for side in ("master", "slave")
    )
    assert felt == pytest.approx(pressed, rel=0.05)
    assert pressed > {0.02: 0.2, 0.1: 0.3, 0.5: 0.13}[rise]


def stated(name: str, *changes: str) -> dict[str, str]:
    """Return the hints of a shipped rig."""
    rig = load_rig(ROOT / f"configs/{name}.yaml", changes)
    return dict(ramp_hints(rig, command_delays(rig)))


@pytest.mark.parametrize(
    ("name", "axis", "rate"),
    [
        ("bench-1dof-loopback", "slave.axes.lever.", 110.0),
        ("arms-loopback", "slave.defaults.", 100.0),
    ],
)
def test_the_stated_rate_is_the_least(name: str, axis: str, rate: float) -> None:
    """Where a period's step counts, and beside a carried load, which has half of the rate."""
    found = stated(name, f"{axis}effort_rate_limit={rate}")
    for hinted, said in found.items():
        enough = float(said.split("with effort_rate_limit ")[1].split(" ")[0])
        at = f"{hinted.removeprefix('hint on ').replace('.', '.axes.')}.effort_rate_limit"
        assert hinted not in stated(name, f"{at}={enough}")
        assert hinted in stated(name, f"{at}={0.9 * enough}")
    assert found


def test_a_port_is_bounded_by_where_its_device_is_when_the_effort_acts() -> None:
    """Velocity, push and the efforts under way are those of the effort itself."""
    rig = load_rig(
        ROOT / "configs/bench-1dof-loopback.yaml",
        ["slave.axes.lever.effort_rate_limit=5", "buses.arm.options={command_delay_s: 0.002}"],
    )
    k = end_constants(rig, "slave.lever", command_delays(rig)["slave.lever"])
    e = SimpleNamespace(
        account=1e-4, velocity=3.0, push=40.0, under_way=1.5e-3, wave_in=-6.0, wanted=0.0, gap=0.0
    )
    found = compute_effort(SimpleNamespace(end=e, port_effort=0.0), SimpleNamespace(end=k), 0.0)  # type: ignore[arg-type]
    asked = port_effort(k.port, 1e-4, 3.0, 40.0, 1.5e-3, -6.0)
    free_velocity = 3.0 + k.port.ahead * 40.0 - 2.0 * k.port.half_mobility * 1.5e-3
    assert found == ramp_bound(k.port.ramp, 1e-4, free_velocity) < asked
    assert e.wanted == asked


@pytest.mark.slow
def test_where_the_hand_rests_emptied_tanks_repay_nothing() -> None:
    """So a run may end as a lost coupling after ten seconds: the docs say so."""
    found = simulate(slow(*LEVERS["a fifth of a second"]), duration_s=30)
    assert "owes the other end a displacement" in str(found.error)
    assert found["time_s"][-1] > 12.0


@pytest.mark.slow
@pytest.mark.parametrize("name", LEVERS)
def test_at_the_stated_rate_no_run_ends(name: str) -> None:
    """40 s of a hand that pulls once and rests; a lever without the hint keeps its own rate."""
    impedance, delay, rise, limit, meets = LEVERS[name]
    facts = dict(check(slow(*LEVERS[name])).facts)
    said = facts.get("hint on master.lever", "")
    if "with effort_rate_limit " in said:
        rise = limit / float(said.split("with effort_rate_limit ")[1].split(" ")[0])
    found = simulate(slow(impedance, delay, rise, limit, meets), duration_s=40)
    assert found.error is None
    assert swing(found, 0.1) < 0.2 * swing(found, 1.0)
