"""Policies: how actions lead a virtual hand, and what happens when they stop coming."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tautwave.certificate.buses import policy_elements
from tautwave.config import Policy, load_rig, resolved_yaml
from tautwave.errors import ConfigError
from tautwave.laws.lead import LeadParams, lead_step
from tautwave.rig.led import led_by_policy
from tautwave.runtime.operate.commands import Order, Script
from tautwave.runtime.operate.lead import Lead, Leading, Leads
from tests.runtime.operating import BARE, FREE, Operated, bench, operate

ROOT = Path(__file__).parents[2]
T, FRAME = 1e-3, 0.03
WIDE = LeadParams(FRAME, 10.0, 10.0, -10.0, 10.0)
HAND = (
    "simulation.hand.lever.reference={type: policy, fps: 50, velocity_limit: 2, effort_limit: 0.3}"
)


def path(lead: Lead, slots: int, place: float | None = None) -> list[float]:
    """Return the references of some slots, for a device that is there or at a fixed place."""
    found = [0.0]
    for _ in range(slots):
        found.append(lead.aim(found[-1] if place is None else place)[0])
    return found[1:]


def test_an_action_is_reached_in_a_straight_line_over_its_frame() -> None:
    lead = Lead(WIDE, 0.0, T)
    assert path(lead, 5) == [0.0] * 5, "before the first action it stands"
    lead.want(0.15)
    found = np.array(path(lead, 60))
    line = 0.15 * np.minimum(np.arange(60) * T / FRAME, 1.0)
    np.testing.assert_allclose(found, line, atol=1e-12)
    lead.want(0.0)
    path(lead, 15)
    lead.want(0.3)  # in the middle of a frame: from where it is
    found = np.array(path(lead, 31))
    np.testing.assert_allclose(np.diff(found), (0.3 - found[0]) / 30, rtol=1e-9)


def test_it_is_no_faster_than_its_limit_and_goes_on_after_its_frame() -> None:
    lead = Lead(WIDE._replace(velocity=1.0), 0.0, T)
    lead.want(0.1)
    found = np.array(path(lead, 120))
    assert np.diff(found).max() == pytest.approx(1.0 * T)
    assert found[-1] == pytest.approx(0.1)
    assert found[30] == pytest.approx(0.03)


def test_it_stays_within_reach_of_the_device_and_in_its_range() -> None:
    lead = Lead(WIDE._replace(reach=0.02, high=0.5), 0.0, T)
    lead.want(5.0)
    assert max(path(lead, 100, place=0.1)) == pytest.approx(0.12)
    assert max(path(lead, 300, place=0.495)) == 0.5
    assert lead_step(WIDE._replace(low=-0.1), 0.0, -5.0, 0.0, 0.0, 1.0) == -0.1


def test_three_frames_without_an_action_let_go_and_one_takes_hold_again() -> None:
    lead = Lead(WIDE, 0.0, T)
    leads = Leads({"wrist": lead})
    path(lead, 1000)
    assert leads.held(), "no policy has come yet"
    lead.want(0.1)
    path(lead, 90)
    assert leads.held()
    path(lead, 1)
    assert not leads.held()
    assert leads.obey("wrist=0.1")
    assert leads.held()


def test_actions_are_taken_whole_or_passed_on_as_they_are() -> None:
    one, other = Lead(WIDE, 0.0, T), Lead(WIDE, 0.0, T)
    leads = Leads({"wrist": one, "slide": other})
    wrong = ["", "wrist", "wrist=x", "wrist=nan", "wrist=0.1 gripper=1"]
    orders = [Order("lead", text) for text in wrong] + [Order("hold")]
    source = Leading(Script([(0, order) for order in orders]), leads)
    assert [order.argument for order in source.take(0)] == [*wrong, ""]
    path(one, 200)
    assert leads.held(), "nothing of them was taken"
    assert not Leading(Script([(0, Order("lead", "wrist=0.1 slide=0"))]), leads).take(0)
    assert path(one, 40)[-1] == pytest.approx(0.1)


def led(script: str, *changes: str) -> Operated:
    return operate(bench(HAND, *BARE, FREE, "operate={start: engaged}", *changes), script, 0.95)


def actions(begin: float, end: float) -> str:
    times = np.arange(begin, end, 0.02)
    return "\n".join(f"{t:.3f} lead lever={0.15 * (t - begin):.5f}" for t in times)


def test_a_policy_moves_both_ends_and_its_silence_holds_the_rig() -> None:
    run = led(actions(0.3, 0.8))
    time, master = run.columns["time_s"], run.columns["master.lever.position"]
    slave = run.columns["slave.lever.position"]
    moving = (time > 0.6) & (time < 0.78)
    reference = run.columns["true.master.lever.reference"]
    # An action says where to be a frame later; its hand and the line are as soft as ever.
    np.testing.assert_allclose(reference[moving], 0.15 * (time[moving] - 0.32), atol=1e-3)
    assert abs(reference - master)[moving].max() < 0.02
    assert abs(reference - slave)[moving].max() < 0.03
    words = run.words()
    assert words[-1] == ("released", "holding")
    released = run.control.journal.entries[-1]
    assert released.at_s == pytest.approx(0.78 + 3 * 0.02, abs=0.006)
    assert "policy" in released.text
    assert abs(run.residual()).max() < 1e-12
    assert abs(run.columns["true.master.lever.hand_effort"]).max() < 0.31


def test_a_wrong_action_is_in_the_journal_and_moves_nothing() -> None:
    run = led("0.5 lead elbow=1.0\n0.6 lead lever=fast")
    refused = [entry.text for entry in run.control.journal.entries if entry.word == "lead"]
    assert len(refused) == 2
    assert all("PAIR=POSITION" in text for text in refused)
    assert abs(run.columns["slave.lever.position"]).max() < 1e-3


def test_without_an_operate_block_nobody_could_send_actions() -> None:
    with pytest.raises(ConfigError, match="add operate"):
        load_rig(ROOT / "configs" / "bench-1dof-loopback.yaml", [HAND])


def test_any_rig_gets_virtual_masters_and_what_they_may_do_is_stated(tmp_path: Path) -> None:
    whole = load_rig(ROOT / "configs" / "xl330-pair.yaml")
    rig = led_by_policy(whole, 25.0)
    saved = tmp_path / "led.yaml"
    saved.write_text(resolved_yaml(rig))
    again = load_rig(saved)  # what a run gets
    axis, believed = again.master.axes["horn"], whole.master.axes["horn"]
    assert again.buses[axis.bus].driver == "loopback"
    assert axis.inertia == believed.inertia
    assert axis.encoder_quantum == 0.0
    assert again.slave.axes == rig.slave.axes
    assert again.simulation is not None
    reference = again.simulation.hand["horn"].reference  # type: ignore[union-attr]
    assert isinstance(reference, Policy)
    assert reference.fps == 25.0
    assert led_by_policy(again).simulation == again.simulation, "twice is once"
    (found,) = policy_elements(again, {})
    held = again.simulation.hand["horn"]
    damping = held.damping * 0.075**2
    speed, effort = 0.25 * 15.0, believed.effort_limit
    assert found.numbers["power_w"] == pytest.approx((effort + damping * speed) * speed)
    assert "the policy's intent is not" in found.passive.reason
    assert found.passive.state == "conditional"
    assert list(policy_elements(whole, {})) == []


def test_masters_that_take_velocity_are_not_led() -> None:
    with pytest.raises(ConfigError, match="has no master"):
        led_by_policy(load_rig(ROOT / "configs" / "scene-string.yaml"))
