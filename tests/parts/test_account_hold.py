"""An account that is empty lets go of what its law presses with: the run ends, and says so."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from tautwave.certificate.belief import declared_delays
from tautwave.config import Rig
from tautwave.contracts import Row
from tautwave.controller.records import AxisState
from tautwave.couplings.account.certificate import held_facts
from tautwave.couplings.account.steps import ACCOUNT_ASTRAY, AccountEnd, watch_debt
from tautwave.errors import SafetyStop
from tautwave.laws.account import APART_S, CALM_SHARE, AccountParams, is_apart, lets_go
from tautwave.rig import Assembly, build_rig
from tautwave.runtime.control import Control
from tautwave.runtime.loop import Loop
from tautwave.runtime.operate import states as st
from tautwave.runtime.operate.commands import Script
from tautwave.runtime.operate.operated import OperatedControl
from tautwave.session.operating import with_operation
from tautwave.simulation import stepper
from tests.rigs.running import ListSink, Run, Tree, rig_of, tree
from tests.session.sites import Pair

EMPTIED = 120
"""Slot from which the follower's account is emptied in every cycle."""

LAWS: dict[str, Tree] = {
    "position": {"stiffness": 400.0, "damping": 5.0},
    "four_channel": {"stiffness": 400.0, "damping": 5.0},
    "position_force": {"stiffness": 400.0, "damping": 5.0},
    "mediated": {"stiffness": 400.0, "damping": 20.0, "touch": 5.0, "stiffest": 400.0},
}
EMPTY = "its energy account is empty and it let go"
P = AccountParams(*(0.0,) * 7, share=1.0, level_damping=0.0, edge=0.0, window=100, felt=0.5)


LATER: Tree = {
    "duration_s": 5.3,
    "simulation.hand.a.reference.waypoints": [[1.02, 0.0], [1.2, 0.1]],
}
"""An operated rig engages first."""


class Drain:
    """A row source without columns: it takes from an account what is in it, as noise would."""

    columns: tuple[str, ...] = ()

    def __init__(self, control: Control, which: int, after: int, left: float) -> None:
        self.control, self.which, self.after, self.left = control, which, after, left

    def fill(self, row: Row, at: int) -> None:
        """Leave so much in it, once the axis presses."""
        self.after -= 1
        if self.after <= 0:
            self.control.axes[self.which].end.account.funds = self.left


def drained(
    rig: Rig, built: Assembly, after: int = EMPTIED, side: str = "slave", left: float = 0.0
) -> Run:
    """Run what was built while the account of a side is drained, to what is `left` [J]."""
    which = list(rig.axes).index(f"{side}.a")
    sources = (*built.sources, Drain(built.control, which, after, left))
    sink = ListSink(len(built.columns))
    result = Loop(built.clock, built.buses, built.control, sources, sink).run()
    return Run(list(built.columns), np.array(sink.rows), result, built, None)  # type: ignore[arg-type]


def pressing(law: str = "position", *changes: Tree) -> Tree:
    """Return a hand that goes to 0.1 m in 0.2 s and rests, and a spring that holds the slave."""
    data = tree(
        {
            "duration_s": 4.3,
            "rate_hz": 200.0,
            "simulation.hand.a": {
                "reference": {"type": "minimum_jerk", "waypoints": [[0.02, 0.0], [0.2, 0.1]]}
            },
            "simulation.environment.a": {"type": "spring", "stiffness": 400.0, "position": 0.0},
        },
        *changes,
    )
    for side in ("master", "slave"):
        data[side]["axes"]["a"]["effort_rate_limit"] = 1e5
    data["coupling"].update(law=law, account={})
    data["coupling"]["pairs"] = {"a": LAWS[law]}
    return data


def test_a_second_that_lets_through_a_quarter_of_a_press_is_lost() -> None:
    assert lets_go(P, 100 * 2.0, 100 * 0.49)
    assert not lets_go(P, 100 * 2.0, 100 * 0.51)
    assert not lets_go(P, 100 * 0.49, 0.0)  # nobody felt that


SHORT = "position_force"
SLOW = [pytest.param(law, marks=pytest.mark.slow) for law in LAWS if law != SHORT]


@pytest.mark.parametrize("law", [SHORT, *SLOW])
def test_an_axis_that_let_go_ends_the_run(law: str) -> None:
    rig = rig_of(pressing(law))
    run = drained(rig, build_rig(rig, clock="fake"))
    assert isinstance(run.result.error, SafetyStop)
    assert run.result.stop is not None
    assert (run.result.stop.axis, run.result.stop.reason) == ("slave.a", "account_empty")
    assert 2.9 < run.result.stop.at_s < 4.1  # whole seconds after that in which it was emptied
    assert f": {EMPTY}" in str(run.result.error)
    pressed = np.abs(run["slave.a.commanded"][60:EMPTIED]).mean()
    said = float(str(run.result.error).partition("requests is sent, ")[2].split()[0])
    assert said == pytest.approx(pressed, rel=0.6)


def test_what_stands_apart_is_cut_steadily() -> None:
    assert is_apart(P, 100 * 2.0, 100 * 0.7)
    assert is_apart(P, -100 * 2.0, -100 * 0.7)
    assert not is_apart(P, 100 * 2.0, 100 * 0.9)
    assert not is_apart(P, 100 * 0.1, -100 * 0.3)  # nobody felt that
    assert is_apart(P, 100 * 0.1, -100 * 0.5)


@pytest.mark.parametrize(("passed", "said"), [(60.0, 30.0), (0.0, 0.0), (-100.0, 0.0)])
def test_what_passes_of_a_steady_effort_is_never_said_to_be_less_than_nothing(
    passed: float, said: float
) -> None:
    end = AccountEnd(pull=200.0, cut=200.0 - passed)
    axis = AxisState(end=SimpleNamespace(account=end))
    for _ in range(APART_S + 1):
        assert axis.alarm == 0
        watch_debt(axis, P)
    assert axis.alarm == ACCOUNT_ASTRAY
    assert axis.found == pytest.approx(said)
    assert axis.allowed == pytest.approx(2.0)


@pytest.mark.slow
@pytest.mark.parametrize("left", [0.0, 0.45, 0.8])
def test_a_pair_that_stands_apart_for_its_account_ends_the_run(left: float) -> None:
    """With what less than half of it needs; with four fifths it stays, with nothing it is limp."""
    rig = rig_of(pressing("position", {"duration_s": 14.0}))
    built = build_rig(rig, clock="fake")
    account = built.control.params[list(rig.axes).index("slave.a")].end.account
    site = built.control.params[list(rig.axes).index("slave.a")].site
    # What holds F at rest, see `laws.account`.
    whole = drained(rig, build_rig(rig, clock="fake"), 10**9)
    force = float(np.abs(whole["slave.a.commanded"][-100:]).mean())
    needs = 2.0 * (left * force) ** 2 * site.half_mobility * site.period
    run = drained(rig, built, left=needs / (CALM_SHARE * account.share))
    if left == 0.8:
        assert run.result.error is None
        return
    assert run.result.stop is not None
    reason = "account_astray" if left else "account_empty"
    assert (run.result.stop.axis, run.result.stop.reason) == ("slave.a", reason)
    if left:
        assert 10.0 < run.result.stop.at_s < 13.0
        said = float(str(run.result.error).partition("account has let ")[2].split()[0])
        assert said == pytest.approx(100.0 * left, rel=0.35)


@pytest.mark.slow
def test_a_rendered_surface_that_nothing_covers_ends_the_run() -> None:
    """The law renders what its account covers: it asks for less and less, and never lets go."""
    rig = rig_of(pressing("mediated"))
    run = drained(rig, build_rig(rig, clock="fake"), 2 * EMPTIED, "master")
    assert run.result.stop is not None
    assert (run.result.stop.axis, run.result.stop.reason) == ("master.a", "account_empty")
    assert np.abs(run["master.a.commanded"][200 : 2 * EMPTIED]).min() > 10.0
    assert np.abs(run["master.a.commanded"][-200:]).max() < 0.01


@pytest.mark.slow
def test_an_operated_rig_holds_and_says_so() -> None:
    rig = rig_of(pressing("position", {"operate": {"start": "engaged"}, **LATER}))
    built = with_operation(rig, build_rig(rig, clock="fake"), [Script(())], [])
    run = drained(rig, built, EMPTIED + 200)
    assert run.result.error is None
    control = built.control
    assert isinstance(control, OperatedControl)
    assert control.standing == st.Standing(st.HOLDING, True)
    assert EMPTY in control.journal.entries[-1].text


@pytest.mark.slow
@pytest.mark.nightly
def test_a_site_whose_account_is_empty_ends_with_that_reason() -> None:
    two = Pair(
        "coupling={law: position, account: {}, pairs: {lever: {stiffness: 8, damping: 0.05}}}",
        "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0.3, 0], [0.6, 0.2]]}",
    )
    try:
        (which,) = two.slave.control._own
        while two.slot < 5000 and two.slave.control.end > two.slot:
            two.run(1)
            if two.slot > 1000:
                two.slave.control.axes[which].end.account.funds = 0.0
        assert EMPTY in str(two.slave.control.error())
        assert two.slave.control.stopped
    finally:
        two.close()


@pytest.mark.parametrize("delay", [0.0, 0.5, 1.0, 2.0])
def test_what_a_reserve_is_said_to_hold_at_rest_is_sent(
    delay: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Axes that something holds apart, with exactly the reserve; `delay` in periods."""
    late = {"options": {"command_delay_s": delay / 200.0}} if delay else {}
    buses: Tree = {bus: {"driver": "loopback", **late} for bus in ("hand", "arm")}
    data = pressing("position", {"simulation": {}, "buses": buses})
    data["coupling"]["account"] = {"reserve": 2.0}
    rig = rig_of(data)
    known = declared_delays(rig)
    said = [float(text.split("holds ")[1].split()[0]) for _, text in held_facts(rig, known)]
    built = build_rig(rig, clock="fake", duration_s=1.0)
    monkeypatch.setattr(stepper, "build_rig", lambda *_, **__: built)
    with stepper.Stepper(rig, outside=("master", "slave")) as steps:
        for k in range(150):
            apart = 0.2 * min(1.0, k / 50.0)
            sent = steps.step({"master.a": apart, "slave.a": -apart})
            if k == 60:
                for axis in built.control.axes:
                    axis.end.account.funds = 2.0
    assert [abs(sent["master.a"]), abs(sent["slave.a"])] == pytest.approx(said, rel=0.01)
