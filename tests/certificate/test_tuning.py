"""What a law needs of its devices: closed forms, and adversaries where it is not there."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tautwave.analysis.ports.clipped_spring import Spring, clipped_lack, spring_of
from tautwave.analysis.ports.sampled_loop import Device, close_loop, position_end
from tautwave.certificate import certify
from tautwave.certificate.data import Verdict
from tautwave.certificate.tuning.two_port import Tuning, tuning
from tautwave.config import Rig, load_rig
from tautwave.errors import ConfigError
from tautwave.rig import command_delays, site_params
from tautwave.rig.clips import AT_ONCE
from tests.analysis.ends import site_of
from tests.certificate.rigs import certified, element
from tests.rigs.running import rig_of, tree

T = 1e-3
CONFIGS = Path(__file__).parents[2] / "configs"


def rig(law: str, pair: dict[str, object], slots: int = 0, damping: float = 0.0) -> Rig:
    changes: dict[str, object] = {"coupling.law": law, "coupling.pairs.a": pair}
    changes["coupling.delay_s"] = slots * T
    for side in ("master", "slave"):
        changes[f"{side}.axes.a.damping"] = damping
    return rig_of(tree(changes))


def needs(law: str, pair: dict[str, object], slots: int = 0, damping: float = 0.0) -> Tuning:
    built = rig(law, pair, slots, damping)
    found = tuning(built, "a", command_delays(built))
    assert found is not None
    return found


@pytest.mark.parametrize("slots", [0, 2, 10, 40])
@pytest.mark.parametrize("damper", [0.0, 0.3, 2.0])
def test_a_spring_and_a_damper_between_two_sides(slots: int, damper: float) -> None:
    """At Nyquist K T + 2 B; towards 0 the delay's K T (1 + d) less both dampers (d even)."""
    found = needs("position", {"stiffness": 100.0, "damping": damper}, slots)
    slow = 100.0 * T * (1 + slots) - 2.0 * damper
    assert found.needed == pytest.approx(max(100.0 * T + 2.0 * damper, slow), rel=1e-2)
    assert found.needed >= max(100.0 * T + 2.0 * damper, slow) * (1.0 - 1e-12)
    assert found.short == pytest.approx(found.needed, rel=1e-9)
    closed = 100.0 * T * (1 + slots) + 2.0 * damper
    assert found.needed * (1.0 - 1e-2) <= found.clipped_needed <= closed * (1.0 + 1e-12)
    assert found.clipped_needed <= 1.1 * found.needed


def test_what_the_devices_have_is_not_short() -> None:
    keys = {"stiffness": 100.0, "damping": 0.3}
    bare = needs("position", keys, 4)
    have = needs("position", keys, 4, damping=0.4)
    assert have.needed == pytest.approx(bare.needed)
    assert have.short == pytest.approx(bare.needed - 0.4)


def test_damping_to_ground_covers_slow_motion_and_costs_its_own_size_at_nyquist() -> None:
    """Nuno's B > K (tau + T / 2) holds for 1 N s/m, and is not enough for held samples."""
    keys = {"stiffness": 20.0, "damping": 0.0, "injection": 1.0}
    found = needs("pd_damping", keys, 40)
    assert found.at == pytest.approx(0.5 / T)
    assert found.needed == pytest.approx(1.0 + 20.0 * T, rel=1e-3)
    little = needs("pd_damping", {**keys, "injection": 0.1}, 40)
    assert little.at < 1.0
    assert little.needed == pytest.approx(20.0 * T * 41 - 0.1, rel=1e-2)


def test_a_reflected_command_without_a_delay_needs_a_pair_of_unlike_efforts() -> None:
    """Master g times the slave's effort a period late: no symmetric spring, but no integrator."""
    found = needs("position_force", {"stiffness": 20.0, "damping": 0.1, "effort": "commanded"})
    assert math.isfinite(found.needed)
    assert found.needed > 20.0 * T / 2.0


def test_scales_turn_and_weigh_the_slave() -> None:
    keys = {"stiffness": 100.0, "damping": 0.3}
    plain = needs("position", keys, 4)
    turned = needs("position", {**keys, "sign": -1}, 4)
    assert turned.needed == pytest.approx(plain.needed)
    assert turned.short_apart == pytest.approx(plain.short_apart)
    scaled = rig("position", {**keys, "position_scale": 2.0, "force_scale": 3.0}, 4, 0.4)
    found = tuning(scaled, "a", command_delays(scaled))
    assert found is not None
    # F_s = 3 F_m at x_s = 2 x_m: in the pair's units a spring is what it was
    assert found.needed == pytest.approx(plain.needed)
    assert found.clipped_needed == pytest.approx(plain.clipped_needed)
    assert found.clipped_short == pytest.approx(
        clipped_lack(delayed_spring(100.0, 0.3, 4), (0.4, 0.4 * 2 / 3)), rel=2e-3
    )


def delayed_spring(stiffness: float, damper: float, slots: int) -> Spring:
    """A spring and a damper with a line."""
    answers = np.zeros((slots + 2, 2, 2))
    for end in (0, 1):
        for late, of, sign in ((0, end, 1.0), (slots, 1 - end, -1.0)):
            answers[late, end, of] += sign * (stiffness + damper / T)
            answers[late + 1, end, of] -= sign * damper / T
    found = spring_of(answers, T)
    assert found is not None
    return found


def loops(slots: int, stiffness: float, damper: float, damping: float) -> Iterator[float]:
    """Spectral radii with springs and masses at both sides, slow to fast, alike in half of them."""
    draw = np.random.default_rng(3)
    site = site_of(T, 0.4)
    law = {"stiffness": stiffness, "damping": damper}
    sent = {"sent_stiffness": stiffness, "sent_damping": damper}
    for at in range(200):
        devices: list[Device] = []
        for _ in range(2):
            mass = 0.4 * 10.0 ** draw.uniform(0.0, 4.0)
            swing = 10.0 ** draw.uniform(-2.0, math.log10(math.pi)) / T
            devices.append(Device(mass, damping, max(0.0, mass * swing**2 - 2.0 * stiffness)))
        if at % 2:
            devices[1] = devices[0]
        ends = [position_end(device, site, **law, **sent) for device in devices]
        yield float(np.max(np.abs(np.linalg.eigvals(close_loop(*ends, slots)))))


@pytest.mark.parametrize("slots", [0, 4])
def test_adversaries_shake_what_is_short_and_nothing_that_is_not(slots: int) -> None:
    """Springs and masses that do not touch each other; 1.3 times beyond the limit some diverge."""
    needed = needs("position", {"stiffness": 100.0, "damping": 0.0}, slots).short_apart
    assert max(loops(slots, 100.0, 0.0, 1.001 * needed)) <= 1.0 + 1e-9
    assert max(loops(slots, 100.0, 0.0, needed / 1.3)) > 1.0 + 1e-9


def taken(slots: int, damping: float, turns: int, size: float, lag: float) -> float:
    """Share of |work| that dampers and a spring of 100 N/m take from one who moves both ends."""
    angle = 2.0 * math.pi * turns / 4000 * np.arange(slots + 4001)
    one, other = np.cos(angle), size * np.cos(angle - lag)
    work, path = 0.0, 0.0
    for own, far in ((one, other), (other, one)):
        held = 100.0 * (own[slots:] - far[: len(far) - slots])
        moved = np.diff(own[slots:])
        work += float(np.sum(held[:-1] * moved + damping * moved * moved / T))
        path += float(np.sum(np.abs(held[:-1] * moved)))
    return work / path


@pytest.mark.parametrize("slots", [0, 4, 40])
def test_one_who_holds_both_ends_gets_energy_out_of_what_is_short(slots: int) -> None:
    """By the definition of work, without a transform; 1.3 times beyond the limit pays."""
    needed = needs("position", {"stiffness": 100.0, "damping": 0.0}, slots).needed
    draw = np.random.default_rng(4)
    tries = [
        (round(2000 ** draw.uniform(0.0, 1.0)), draw.uniform(0.0, 1.5), draw.uniform(0.0, 7.0))
        for _ in range(300)
    ]
    tries += [(turns, 1.0, math.pi) for turns in (1, 2, 5, 1999, 2000)]
    assert min(taken(slots, 1.001 * needed, *each) for each in tries) > -1e-9
    assert min(taken(slots, needed / 1.3, *each) for each in tries) < -1e-3


def test_the_certificate_says_by_what_a_law_holds() -> None:
    """By tuning where the devices have it, by account where there is one; else it names both."""
    line = "coupling.delay_s=0.002"
    soft = "coupling.pairs.lever={stiffness: 0.2, damping: 0}"
    found = element(certified(line, soft, name="bench-position-coupling"), "coupling of lever")
    assert found.passive.passed
    assert "by tuning" in found.passive.reason
    assert found.numbers["holds"] == "by tuning"
    assert found.numbers["damping"] == [2e-3, 2e-3]
    assert [said.partition(" and ")[0] for said in found.passive.conditions] == [
        "no sample of master.lever is lost",
        "no sample of slave.lever is lost",
        "the ends of lever are not moved apart while it engages; with velocity limits",
    ]
    slow = [f"{side}.axes.lever.velocity_limit=20" for side in ("master", "slave")]
    prompt = "loop.overrun_limit=4"
    limited = element(
        certified(line, soft, *slow, prompt, name="bench-position-coupling"), "coupling of lever"
    )
    assert not limited.passive.conditions
    assert "stalls of the host may supply up to" in limited.passive.reason
    assert "Each engagement may supply up to" in limited.passive.reason
    rated = certified(
        line, soft, "slave.axes.lever.effort_rate_limit=1000", name="bench-position-coupling"
    )
    said = "the effort_rate_limit of slave.lever is not reached in the coupling"
    assert said in element(rated, "coupling of lever").passive.conditions
    hard = certified(line, name="bench-position-coupling")
    assert "coupling.account" in element(hard, "coupling of lever").passive.reason
    limits = [
        f"{side}.axes.lever.{key}"
        for side in ("master", "slave")
        for key in ("velocity_limit=20", "effort_rate_limit=1000", "velocity_filter_s=0.0005")
    ]
    kept = certified(line, *limits, "coupling.account={}", name="bench-position-coupling")
    ours = element(kept, "account of master.lever")
    assert "by account" in ours.passive.reason
    assert ours.numbers["seen_j"] < ours.numbers["true_j"] < math.inf
    assert "bare: not passive" in element(kept, "law of lever").sentences[0]
    assert kept.verdicts["passive"].passed


@pytest.mark.parametrize("law", ["position_force", "pd_damping"])
def test_a_spring_that_is_chosen_suits_the_lighter_side(law: str) -> None:
    def gains(master: float, slave: float) -> dict[str, float]:
        masses = (
            f"{side}.axes.lever.inertia={{value: {value}, lower: {value}, source: scales}}"
            for side, value in (("master", master), ("slave", slave))
        )
        rig = load_rig(
            CONFIGS / "bench-1dof-loopback.yaml",
            [f"coupling={{law: {law}, pairs: {{lever: {{}}}}}}", *masses],
        )
        pair = rig.coupling.pairs["lever"].model_dump()
        return {key: pair[key] for key in ("stiffness", "damping")}

    light = gains(1e-3, 1e-3)
    assert gains(1e-3, 4e-3) == gains(4e-3, 1e-3) == light
    assert gains(4e-3, 4e-3)["stiffness"] == pytest.approx(4.0 * light["stiffness"], rel=1e-3)


SOFT = {"stiffness": 20.0, "damping": 0.0}
LAWS = {"position": SOFT, "pd_damping": {**SOFT, "injection": 0.02}}


def rig_with(law: str, *changes: dict[str, object], slots: int = 0, **pair: object) -> Rig:
    """Levers with 10 N m of motor and 2 N m s/rad of damping."""
    keys = {"law": law, "delay_s": slots * T, "pairs": {"a": {**LAWS[law], **pair}}}
    levers = {
        f"{side}.axes.a.{key}": value
        for side in ("master", "slave")
        for key, value in {"kind": "rotary", "effort_limit": 10.0, "damping": 2.0}.items()
    }
    return rig_of(tree(levers, {"coupling": keys}, *changes))


def coupled(law: str, *changes: dict[str, object], slots: int = 0, **pair: object) -> Verdict:
    rig = rig_with(law, *changes, slots=slots, **pair)
    return element(certify(rig), "coupling of a").passive


def stalling(missed: int, *changes: dict[str, object]) -> Verdict:
    """Two levers of 100 and 10 N m, 25 J at their velocity limit, whose host may stall."""
    levers = {
        f"{side}.axes.a.{key}": value
        for side in ("master", "slave")
        for key, value in {"velocity_limit": 10.0, "effort_rate_limit": 1e5}.items()
    }
    loop = {"loop": {"missing_limit": missed, "overrun_limit": 2}}
    return coupled("position", levers, loop, {"master.axes.a.effort_limit": 100.0}, *changes)


@pytest.mark.parametrize(
    ("missed", "said"),
    [(3, []), (30, ["no gap between samples of master.a is longer than 19 ms"])],
)
def test_a_stall_that_gives_more_than_the_device_has_is_a_condition(
    missed: int, said: list[str]
) -> None:
    found = stalling(missed)
    assert found.passed
    of_master = [one for one in found.conditions if "master.a" in one]
    assert [one.partition(" (")[0] for one in of_master] == said
    assert all("times the 25 J that it has at its velocity limit" in one for one in of_master)


def test_a_stall_of_a_hundred_times_what_the_device_has_is_refused() -> None:
    """With the value that would do, which then is a condition; end stops do as well."""
    found = stalling(3000)
    assert not found.passed
    assert "at master.a, in one stall of 3" in found.reason
    wanted = int(found.reason.rpartition("lower loop.missing_limit to ")[2].split(",")[0])
    assert stalling(wanted).passed
    assert found.reason.endswith("or give mechanical_range, its end stops")
    assert stalling(3000, {"master.axes.a.mechanical_range": [-1.0, 1.0]}).passed
    unlimited = {f"{side}.axes.a.velocity_limit": None for side in ("master", "slave")}
    assert "the host does not stall" in "".join(stalling(3000, unlimited).conditions)


def clip_of(*changes: dict[str, object], **pair: object) -> tuple[float, float]:
    """What the certificate says both ends are clipped at, and what they are."""
    rig = rig_with("position", *changes, **pair)
    stated = element(certify(rig), "coupling of a").numbers["clip"]
    names = ("master.a", "slave.a")
    own = [site_params(rig, name, AT_ONCE).clip for name in names]
    assert own[0] == stated
    return own[0], own[1]


def test_both_ends_are_clipped_at_the_weaker_ones_certain_share() -> None:
    """Less its load, less its wall's share, in the pair's units."""
    limit = "slave.axes.a.effort_limit"
    assert clip_of() == (10.0, 10.0)
    assert clip_of({limit: 9.0}) == (9.0, 9.0)
    assert clip_of(force_scale=2.0) == (5.0, 10.0)
    assert clip_of({"slave.axes.a.load": {"constant": 1.0}}) == pytest.approx((8.9, 8.9))
    wall = {"position": 0.1, "stiffness": 20.0}
    assert clip_of(wall_master=wall) == (5.0, 5.0)
    lifted = {"compensation": {"inertia": 0.3}, "effort_rate_limit": 1e5}
    lifted = {f"master.axes.a.{key}": value for key, value in lifted.items()}
    assert clip_of(lifted) == (7.0, 7.0)
    assert clip_of({limit: 6.0}, wall_master={**wall, "effort_limit": 3.0}) == (6.0, 6.0)
    assert clip_of({limit: 8.0}, wall_master={**wall, "effort_limit": 3.0}) == (7.0, 7.0)
    with pytest.raises(ConfigError, match=r"lower coupling\.pairs\.a\.wall_master\.effort_limit"):
        clip_of(wall_master={**wall, "effort_limit": 10.0})


@pytest.mark.parametrize("slots", [0, 3])
@pytest.mark.parametrize("law", sorted(LAWS))
def test_what_is_clipped_alike_is_passive_whatever_the_motors(law: str, slots: int) -> None:
    wall = {"position": 0.1, "stiffness": 20.0}
    assert coupled(law, {"slave.axes.a.effort_limit": 1.0}, slots=slots, wall_master=wall).passed


@pytest.mark.parametrize("law", ["position_force", "four_channel", "mediated"])
def test_what_is_no_spring_is_not_certified_by_tuning(law: str) -> None:
    rig = rig_of(tree({"coupling": {"law": law, "pairs": {"a": {}}}}))
    found = element(certify(rig), "coupling of a").passive
    assert not found.passed
    assert "not certified: law" in found.reason or "not passive; a model" in found.reason


def test_a_long_delay_is_no_longer_cut_by_a_grid() -> None:
    """A second at 2 kHz: K T (n + 1), where a grid of 4096 angles saw a hundredth of it."""
    rate = 2000.0
    rig = rig_of(
        tree(
            {
                "rate_hz": rate,
                "coupling.law": "position",
                "coupling.delay_s": 1.0,
                "coupling.pairs.a": {"stiffness": 100.0, "damping": 0.0},
            }
        )
    )
    found = tuning(rig, "a", command_delays(rig))
    assert found is not None
    assert found.clipped_needed == pytest.approx(100.0 / rate * 2001.0, rel=1e-9)
    assert found.clipped_needed <= found.needed <= 1.01 * found.clipped_needed


def test_a_damper_on_filtered_velocities_is_covered_while_nothing_else_is_sent() -> None:
    """They are predicted from the efforts that were sent: a wall's, too."""
    filtered: dict[str, object] = {
        f"{side}.axes.a.velocity_filter_s": 0.002 for side in ("master", "slave")
    }
    bare = rig_with("position", filtered, damping=0.05)
    found = tuning(bare, "a", command_delays(bare))
    assert found is not None
    assert found.hears
    assert found.clipped_needed == math.inf
    passed = coupled("position", filtered, damping=0.05)
    assert passed.passed
    assert "asks for no more than 10 N m at the master and 10 at the slave" in passed.conditions[0]
    wall = {"position": 0.1, "stiffness": 20.0}
    walled = coupled("position", filtered, damping=0.05, wall_slave=wall)
    assert not walled.passed
    assert "the wall of slave.a would enter its spring" in walled.reason
    help_: dict[str, object] = {"master.axes.a.compensation": {"viscous": 0.1}}
    helped = coupled("position", filtered, help_, damping=0.05)
    assert not helped.passed
    assert "the compensation of master.a would enter" in helped.reason
    assert coupled("position", filtered, damping=0.0, wall_slave=wall).passed


def test_a_belief_that_the_simulation_contradicts_is_no_proof() -> None:
    found = coupled("position", {"simulation.axes": {"slave.a": {"damping": 1.0}}})
    assert not found.passed
    assert "slave.a, the device's simulated damping 1 is below damping.lower 2" in found.reason


def test_effort_steps_rest_on_friction() -> None:
    steps = {"master.axes.a.effort_quantum": 0.01}
    said = "the effort steps of master.a (0.01) are not above its Coulomb friction"
    assert any(one.startswith(said) for one in coupled("position", dict(steps)).conditions)
    enough: dict[str, object] = {**steps, "master.axes.a.coulomb": 0.02}
    assert not any("steps" in one for one in coupled("position", enough).conditions)
    spent = {**enough, "master.axes.a.compensation": {"coulomb": 0.6}}
    assert any(one.startswith(said) for one in coupled("position", spent).conditions)


def test_the_rate_that_suffices_is_stated_and_suffices() -> None:
    """K (v + v) for a spring without a damper, 20 N m/rad at 20 rad/s each."""
    rate: dict[str, object] = {"master.axes.a.effort_rate_limit": 500.0}
    [said] = coupled("position", rate).conditions
    assert said.endswith("; 800 would suffice at all velocities within its limits")
    assert not coupled("position", {"master.axes.a.effort_rate_limit": 801.0}).conditions


@pytest.mark.parametrize("slots", [0, 1])
def test_a_load_and_the_coupling_count_damping_once(slots: int) -> None:
    """A load of slope h takes h T; the spring, of the same stiffness, needs as much or more."""
    sides = ("master", "slave")
    have = {f"{side}.axes.a.{key}": value for side in sides for key, value in
            {"damping": 0.06, "effort_limit": 300.0}.items()}  # fmt: skip
    loads = {f"{side}.axes.a.load": {"sine": 50.0} for side in sides}
    assert coupled("position", have, slots=slots).passed
    assert not coupled("position", have, loads, slots=slots).passed
