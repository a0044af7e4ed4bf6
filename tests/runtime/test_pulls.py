"""A pull on an axis, and what an operated rig sends while it aligns, lets go, stops."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tautwave.controller.records import AxisState
from tautwave.rig import build_rig
from tautwave.runtime.operate import states as st
from tautwave.runtime.operate.commands import Order
from tautwave.runtime.operate.rest.axis import send_resting
from tautwave.runtime.operate.rest.pull import Pull, PullParams
from tests.runtime.operating import BARE, FREE, STILL, Operated, bench, operate
from tests.runtime.test_aligning import LAW

PARAMS = PullParams(LAW, 0.0, 0.0, 1e-3, 0.01, -9.0, 9.0)
NEAR = ("coupling.pairs.lever.offset=0.1", "coupling.pairs.lever.engage_tolerance=0.01")


def test_a_device_that_does_not_move_is_pushed_with_the_effort_and_nothing_winds_up() -> None:
    s = AxisState(end=None)
    pull = Pull(PARAMS, 0.0, -0.5, 1.0)
    efforts = [pull.effort(s) for _ in range(4000)]
    assert pull.reference == -LAW.effort / LAW.stiffness
    assert pull.push == -LAW.effort
    assert max(efforts) == efforts[-1] == min(LAW.effort, LAW.brake * LAW.speed)


def test_what_has_gone_in_is_what_the_axis_books() -> None:
    for way in (1.0, -1.0):
        s = AxisState(end=None)
        pull = Pull(PARAMS, 0.0, 0.5, 3.0 * LAW.reserve)
        s.velocity = -0.05
        assert pull.effort(s) < 0.0  # resisting, positive along the way back
        s.port_energy = -way * 2.5 * LAW.reserve
        assert (pull.effort(s) == 0.0) is (way > 0.0)
        assert pull.spent(s) is (way > 0.0)


def test_a_device_that_its_target_comes_to_is_there_once_the_reference_is() -> None:
    s = AxisState(end=None)
    pull = Pull(PARAMS, 0.0, 0.02, 1.0)
    s.position = 0.02
    assert not pull.there(s)
    for _ in range(1000):
        pull.effort(s)
    assert pull.there(s)
    s.position = 0.0301
    assert not pull.there(s)


def test_what_is_sent_at_rest_has_the_limits_of_the_axis() -> None:
    control: Any = build_rig(bench("slave.axes.lever.effort_rate_limit=50"), clock="fake").control
    s, p = control.axes[1], control.params[1]
    for asked, sent in ((9.0, 0.05), (9.0, 0.1), (-9.0, 0.05), (math.nan, 0.0)):
        send_resting(s, p, asked, p.ceiling)
        assert s.total == pytest.approx(sent)
    for _ in range(99):
        send_resting(s, p, 9.0, p.ceiling)
    assert s.total == p.ceiling == -s.command


def test_a_device_in_fault_is_sent_nothing_at_rest_and_at_once() -> None:
    """Whatever holds or aligns it: not even what the rate limit would leave of the last effort."""
    control: Any = build_rig(bench("slave.axes.lever.effort_rate_limit=50"), clock="fake").control
    s, p = control.axes[1], control.params[1]
    for pushes in (False, True):
        s.dead = False
        for _ in range(9):
            send_resting(s, p, 9.0, p.ceiling, pushes=True)
        assert s.total > 0.4
        s.dead = True
        send_resting(s, p, 9.0, p.ceiling, pushes=pushes)
        assert (s.total, s.port_effort, s.command) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("pushes", [False, True])
def test_a_push_that_ends_unseen_has_gone_its_way_only_since(pushes: bool) -> None:
    """The rate limit counts skipped slots of a ramp to 0, not those in which a push rose."""
    control: Any = build_rig(bench("slave.axes.lever.effort_rate_limit=50"), clock="fake").control
    s, p = control.axes[1], control.params[1]
    s.total, s.valid, s.count, s.ramped = 0.9, False, 6, 5
    send_resting(s, p, 0.95, p.ceiling, pushes=pushes)
    assert s.total == pytest.approx(0.95)
    s.count = 7
    send_resting(s, p, 0.0, p.ceiling, pushes=pushes)
    assert s.total == pytest.approx(0.9)


def test_nothing_is_looked_at_before_every_axis_has_been_measured() -> None:
    control: Any = operate(bench(STILL, *NEAR), "", 0.01).control
    control._obey(Order(st.ENGAGE, "", "key"))
    for m in control.samples:
        m.valid = False
    control.step(10, 0)
    assert control.standing.state == st.ALIGNING
    assert control.alignment._limit == 0


def aligned(*keys: str, script: str = "0.05 engage", duration_s: float = 1.2) -> Operated:
    return operate(bench(STILL, FREE, *BARE, *NEAR, *keys), script, duration_s)


def rows_of(done: Operated, state: str) -> Any:
    return done.columns["operation.state"] == float(st.STATES.index(state))


def test_an_axis_without_a_sample_gets_nothing() -> None:
    lost = ("simulation.faults.missing_probability=0.2", "loop.missing_limit=9")
    done = aligned(*lost, duration_s=0.4)
    sent = done.columns["slave.lever.commanded"][rows_of(done, st.ALIGNING)]
    valid = done.columns["slave.lever.valid"][rows_of(done, st.ALIGNING)] > 0.0
    assert np.count_nonzero(sent[valid]) > 20
    assert not sent[~valid].any()


def test_they_engage_at_rest_once_every_command_of_before_has_acted() -> None:
    slow = "slave.axes.lever.effort_rate_limit=1"  # so that letting go takes a while
    wide = "coupling.pairs.lever.engage_tolerance=0.08"
    late = "buses.arm.options={command_delay_s: 0.005}"
    for keys in ((slow, late), (wide, "operate.align_speed=0.2")):
        done = aligned(*keys)
        assert done.words()[-1] == ("aligned", "engaged")
        at = int(np.argmax(rows_of(done, st.ENGAGED)))
        sent, place = (done.columns[f"slave.lever.{what}"] for what in ("commanded", "position"))
        delay = done.control.params[1].delay
        assert not sent[at - delay - 1 : at].any()
        assert abs(place[at] - place[at - 40]) < 0.05 * 0.04


def test_a_stop_pulls_no_more() -> None:
    done = aligned(script="0.05 engage\n0.2 stop", duration_s=0.5)
    stopping = rows_of(done, st.STOPPING)
    sent, speed = (
        done.columns[f"slave.lever.{what}"][stopping] for what in ("commanded", "velocity")
    )
    assert np.abs(speed[:20]).max() > 0.05
    assert (sent * speed).max() <= 0.0
