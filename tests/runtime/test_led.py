"""Masters that a policy leads by their own motors, and a person who takes over."""

from __future__ import annotations

import functools
import math
import random
from collections import deque
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.certificate.buses import policy_elements
from tautwave.config import load_rig
from tautwave.controller.records import AxisParams, AxisState
from tautwave.errors import ConfigError
from tautwave.laws.lead import HandParams, LeadParams, hand_room
from tautwave.laws.rest.alignment import align_law
from tautwave.rig.led import led_by_policy
from tautwave.runtime.operate.led import LedAxis, LedDriver, LedMasters, MotorHand
from tautwave.types import SAFE_COMMAND, AxisCommand, CommandDelay
from tests.examples import tried
from tests.runtime.operating import BARE, BENCH, FREE, Operated, bench, operate

ROOT = Path(__file__).parents[2]
LED = "operate={start: engaged, policy: {}}"
ALONE = "simulation.hand={}"
FPS, T = 30.0, 1e-3


def actions(begin: float, end: float, height: float = 0.2) -> str:
    """Return a policy's actions: a sine of 3 rad/s."""
    times = np.arange(begin, end, 1.0 / FPS)
    return "\n".join(f"{t:.3f} lead lever={height * math.sin(3.0 * t):.5f}" for t in times)


def led(script: str, duration_s: float, *changes: str) -> Operated:
    return operate(bench(*BARE, FREE, LED, *changes), script, duration_s)


# -- a run ----------------------------------------------------------------------------------------


def test_a_person_takes_over_and_hands_back_and_nothing_jumps() -> None:
    run = led(actions(0.3, 3.9) + "\n2.0 take_over\n3.0 hand_back", 3.9, ALONE)
    c = run.columns
    time, master, slave = c["time_s"], c["master.lever.position"], c["slave.lever.position"]
    person, effort = c["operation.intervention"] > 0.0, c["policy.lever.effort"]
    assert [word for word, _ in run.words()] == ["engage", "aligned", "take_over", "hand_back"]
    assert {state for _, state in run.words()[2:]} == {"engaged"}, "no other state between"
    np.testing.assert_array_equal(person, (time > 1.9995) & (time < 2.9995))
    moving = (time > 1.2) & (time < 2.0)
    goal = 0.2 * np.sin(3.0 * (time - 1.0 / FPS))
    assert abs(master - goal)[moving].max() < 0.02
    assert abs(master - slave)[moving].max() < 0.05
    # No sample is further from the one before than a policy at full speed takes it.
    assert abs(np.diff(master)).max() < 3.75 * T
    # The grip is lost over 0.2 s, and taken where the device is.
    at = int(np.argmax(person))
    assert abs(effort[at] - effort[at - 1]) < 0.02 * 0.55
    assert abs(np.diff(effort[at : at + 250])).max() < 0.02 * 0.55
    assert not effort[at + 250 : at + 1000].any()
    back = at + 1000
    assert abs(effort[back : back + 20]).max() < 0.01
    assert c["policy.lever.reference"][back] == pytest.approx(master[back], abs=1e-4)
    # Actions 0.5 rad away are gone to gently.
    assert abs(np.diff(c["policy.lever.reference"][back : back + 300])).max() < 0.31 * T
    assert abs(run.residual()).max() < 1e-12
    assert c["policy.lever.given"].max() < 1e-4


def test_two_who_hold_the_master_share_its_motor_and_the_person_wins_after_take_over() -> None:
    reference = "{type: minimum_jerk, waypoints: [[0, 0], [1.5, 0], [2.1, 0.15], [3, 0.15]]}"
    run = led(
        actions(0.3, 2.7, 0.3) + "\n1.4 take_over",
        2.7,
        f"simulation.hand.lever.reference={reference}",
    )
    c = run.columns
    time, late = c["time_s"], c["time_s"] > 2.6
    assert abs(c["policy.lever.effort"]).max() <= 0.55
    assert abs(c["master.lever.commanded"]).max() <= 1.1
    assert abs(c["master.lever.position"][late] - 0.15).max() < 0.01
    assert abs(c["slave.lever.position"][late] - 0.15).max() < 0.04
    assert not c["policy.lever.effort"][time > 1.7].any()


def test_silence_of_a_policy_holds_the_rig_and_that_of_one_that_does_not_lead_does_not() -> None:
    run = led(actions(0.3, 0.8) + "\n0.7 take_over\n1.5 hold", 1.2, ALONE)
    assert run.words()[-1] == ("take_over", "engaged")
    run = led(actions(0.3, 0.8) + "\n1.2 engage", 1.6, ALONE)
    assert run.words()[2] == ("released", "holding")
    released = run.control.journal.entries[2]
    assert released.at_s == pytest.approx(0.8 + 3 / FPS, abs=0.04)
    assert run.words()[-1] == ("aligned", "engaged")
    assert abs(run.columns["policy.lever.effort"][1250:]).max() < 1e-3, "no action, no effort"


def test_words_are_refused_where_they_change_nothing() -> None:
    run = led("0.3 hand_back\n0.4 take_over\n0.5 take_over", 0.6, ALONE)
    texts = [entry.text for entry in run.control.journal.entries if entry.refused]
    assert texts == [
        "hand_back: the policy leads already", "take_over: the person leads already",
    ]  # fmt: skip
    run = operate(bench(), "0.1 take_over", 0.2)
    (entry,) = run.control.journal.entries
    assert entry.refused
    assert "operate.policy" in entry.text


def test_a_person_may_lead_first() -> None:
    run = operate(
        bench(*BARE, FREE, ALONE, "operate={start: engaged, policy: {leader: person}}"),
        actions(0.1, 1.2) + "\n0.6 hand_back",
        1.2,
    )
    effort = run.columns["policy.lever.effort"]
    assert not effort[:600].any()
    assert abs(effort[700:]).max() > 0.0


# -- energy ---------------------------------------------------------------------------------------


def hand_of(delay: int, late: float) -> MotorHand:
    law = align_law(
        2e-3, 0.0, 0.55, 3.75, math.inf, T, T * (delay + late), T * (1 + delay + late),
        fastest=15.0,
    )  # fmt: skip
    lead = LeadParams(1.0 / FPS, law.speed, law.effort / law.stiffness, -0.5, 0.5)
    constants = HandParams(law, 0.7, 0.0, T / 0.2, 4.0 * law.reserve)
    return MotorHand(LedAxis("lever", 0, lead, constants, 1.0, delay, late, T, 15.0))


def attack(hand: MotorHand, seed: int, slots: int) -> list[float]:
    """Move a device against a hand for all it gives; return what it has given, by our own books.

    The device moves along whatever effort acts, so that each slot takes energy, and turns with it;
    who leads changes at random. Its velocity is the bare difference of positions.
    """
    draw = random.Random(seed)
    axis = hand.axis
    params = bench_params()
    s = AxisState(valid=True)
    waiting = deque([0.0] * axis.delay)
    acted = 0.0
    leads, books, gave = True, 0.0, []
    mean = moved = seen = 0.0
    for slot in range(slots):
        if draw.random() < 0.01:
            leads = not leads
        if slot % 33 == 0:
            hand.want(draw.uniform(-0.5, 0.5))
        before = hand.reference
        hand.decide(s, params, 0, leads=leads)
        books += mean * (moved - (before - seen))
        gave.append(books)
        seen = before
        waiting.append(hand.send())
        effort = waiting.popleft()
        mean = axis.late * acted + (1.0 - axis.late) * effort
        acted = effort
        speed = draw.choice((15.0, 15.0, 2.0))
        moved = math.copysign(speed * T, mean) if mean else draw.uniform(-1.0, 1.0) * 15.0 * T
        s.position += moved
        s.velocity = moved / T
    assert hand.given == pytest.approx(gave[-1], abs=1e-9)
    return gave


@functools.cache
def bench_params() -> AxisParams:
    return operate(bench(*BARE, FREE, LED, ALONE), "", 0.01).control.params[0]


@pytest.mark.parametrize(("delay", "late"), [(0, 0.0), (1, 0.0), (2, 0.4)])
def test_no_device_and_no_switching_takes_more_than_the_allowance(delay: int, late: float) -> None:
    for seed in range(3):
        hand = hand_of(delay, late)
        allowance = hand.axis.hand.allowance
        assert max(attack(hand, seed, 3000)) <= allowance
        # The same adversary breaks the law without its account.
        loose = hand_of(delay, late)
        endless = loose.axis.hand._replace(allowance=math.inf)
        loose.axis = loose.axis._replace(hand=endless)
        assert max(attack(loose, seed, 3000)) > 2.0 * allowance


@pytest.mark.parametrize(("delay", "late"), [(0, 0.0), (1, 0.0), (2, 0.4)])
def test_what_goes_to_and_fro_between_two_samples_is_counted(delay: int, late: float) -> None:
    """A device that takes of each effort what it can, of whose way a third of the samples is lost.

    The mean effort over the whole way, as booked first, missed 0.02 of the allowance in 30 s.
    """
    for seed in range(3):
        draw, params = random.Random(seed), bench_params()
        hand, s = hand_of(delay, late), AxisState(valid=True)
        waiting, slots = deque([0.0] * delay), list[tuple[float, float]]()
        acted = worked = seen = 0.0
        leads = True
        for slot in range(3000):
            leads = leads != (draw.random() < 0.01)
            if slot % 33 == 0:
                hand.want(draw.uniform(-0.5, 0.5))
            before = hand.reference
            s.valid = draw.random() > 0.3
            hand.decide(s, params, 0, leads=leads)
            if s.valid:
                mean = sum(effort for effort, _ in slots) / max(1, len(slots))
                worked += sum(effort * moved for effort, moved in slots) - mean * (before - seen)
                seen = before
                slots.clear()
            assert worked <= hand.given + 1e-9
            waiting.append(hand.send())
            effort = waiting.popleft()
            acts, acted = late * acted + (1.0 - late) * effort, effort
            way = 15.0 * T if acts > 0.0 else -15.0 * T
            away = slots and draw.random() < 0.8 and acts < slots[0][0]  # back at less effort
            slots.append((acts, -way if away else way))
            s.position += slots[-1][1]
            s.velocity = slots[-1][1] / T
        assert hand.given <= hand.axis.hand.allowance


@pytest.mark.parametrize("lost", [0, 7])
@pytest.mark.parametrize(("delay", "late"), [(0, 0.4), (1, 0.0), (2, 0.4)])
def test_a_reference_that_lets_go_brings_nothing_while_its_last_effort_acts(
    delay: int, late: float, lost: int
) -> None:
    """Not even where the samples at its end are lost: it goes to the device at one that is seen."""
    hand, s, sent = hand_of(delay, late), AxisState(valid=True), [0.0] * (delay + 1)
    hand.axis = hand.axis._replace(hand=hand.axis.hand._replace(release=1.0))  # at once

    def decide(leads: bool) -> None:
        hand.want(0.3)
        hand.decide(s, bench_params(), 0, leads=leads)
        sent.append(hand.effort)

    for _ in range(200):
        decide(True)
    for _ in range(max(1, delay)):
        decide(False)
    assert sent[200 + delay] > 0.0 == sent[201 + delay]
    before, seen, kept = hand.given, len(sent) - delay - 2, hand.reference
    s.valid = False
    for _ in range(seen, 201 + delay + lost):
        decide(False)
        assert hand.reference == kept > 1e-3
    s.valid, s.position = True, 0.01
    decide(False)
    acts = [late * sent[n] + (1.0 - late) * sent[n + 1] for n in range(seen, 202 + delay + lost)]
    mean = sum(acts) / len(acts)
    off = sum(abs(act - mean) for act in acts) * hand.axis.fastest * T
    assert hand.given == pytest.approx(before + mean * s.position + off)
    assert hand.reference == s.position


@given(
    st.floats(0.0, 2.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0),
    st.floats(0.0, 2.0),
)  # fmt: skip
@settings(max_examples=tried(100))
def test_a_hand_never_takes_the_motor_beyond_its_limits(
    bound: float, beside: float, before: float, last: float, step: float
) -> None:
    beside, before, last = beside * bound, before * bound, last * bound
    last = max(-bound, min(bound, before + last)) - before
    constants = hand_of(0, 0.0).axis.hand._replace(step=step)
    low, high = hand_room(constants, bound, beside, before, last)
    assert low <= high
    for one in (low, high):
        assert abs(one + beside) <= bound + 1e-12
        assert abs(one + beside - before - last) <= step + 1e-12


def test_a_lost_sample_keeps_the_effort_and_a_dead_device_gets_none() -> None:
    params, hand, s = bench_params(), hand_of(0, 0.0), AxisState(valid=True)
    hand.decide(s, params, 0, leads=True)
    for _ in range(30):
        hand.want(0.3)
        hand.decide(s, params, 0, leads=True)
    kept = hand.effort
    assert kept > 0.0
    s.valid = False
    hand.decide(s, params, 0, leads=True)
    assert hand.effort == kept
    s.dead = True
    hand.decide(s, params, 0, leads=True)
    assert hand.effort == 0.0


class Written:
    """A driver that keeps what is written."""

    command_delay = CommandDelay(0, 0.0)
    enable_step = request = disable = close = None

    def __init__(self) -> None:
        self.sent: list[AxisCommand] = []

    def write(self, commands: list[AxisCommand]) -> None:
        self.sent = commands


def test_a_safe_command_stays_one_and_an_effort_is_sent_once() -> None:
    hand, device = hand_of(0, 0.0), Written()
    driver = LedDriver(device, [None, hand])  # type: ignore[arg-type]
    s, params = AxisState(valid=True), bench_params()
    hand.decide(s, params, 0, leads=True)
    for _ in range(30):
        hand.want(0.3)
        hand.decide(s, params, 0, leads=True)
    effort = hand.effort
    plain = [AxisCommand(0.1, 0.0), AxisCommand(0.1, 0.0)]
    driver.write(plain)
    assert [one.effort for one in device.sent] == [0.1, 0.1 + effort]
    driver.write(plain)
    assert [one.effort for one in device.sent] == [0.1, 0.1], "not decided anew"
    hand.decide(s, params, 0, leads=True)
    driver.write([SAFE_COMMAND, SAFE_COMMAND])
    assert device.sent == [SAFE_COMMAND, SAFE_COMMAND]
    assert hand.effort == 0.0


def test_a_spent_hand_lets_go_of_the_rig_and_another_engagement_has_its_own() -> None:
    hand = hand_of(0, 0.0)
    masters = LedMasters([hand.axis], "policy")
    (hand,) = masters.hands
    s, params = AxisState(valid=True), bench_params()
    masters.decide([s], [params], 0, engaged=True)
    assert masters.held()
    hand.given = hand.axis.hand.allowance
    assert not masters.held()
    masters.decide([s], [params], 0, engaged=False)
    assert masters.held(), "not engaged, it gives nothing"
    masters.decide([s], [params], 0, engaged=True)
    assert masters.held()


# -- rig files ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["master.axes.lever.velocity_limit=null"], "needs its velocity_limit"),
        (
            [
                "simulation.hand.lever.reference={type: policy, velocity_limit: 1, "
                "effort_limit: 0.3}"
            ],
            "led by a policy already",
        ),
        (["operate.policy.leader=nobody"], "leader"),
        (["operate.policy.velocity_share=0.95"], "0.9"),
    ],
)
def test_what_cannot_be_led_is_said(changes: list[str], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        load_rig(BENCH, ["operate={policy: {}}", *changes])


def test_check_states_what_the_hand_may_do_and_a_plugin_keeps_the_master() -> None:
    rig = load_rig(BENCH, ["operate={policy: {}}"])
    (found,) = policy_elements(rig, {"master.lever": CommandDelay(0, 0.0)})
    assert found.numbers["effort_limit"] == pytest.approx(0.55)
    assert "take_over" in found.sentences[0]
    assert found.passive.state == "conditional"
    kept = led_by_policy(rig, 50.0)
    assert kept.master == rig.master
    assert kept.operate is not None
    assert kept.operate.policy is not None
    assert kept.operate.policy.fps == 50.0
