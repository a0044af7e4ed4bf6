"""What held efforts create: the account of a scene, and the stop of a run."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tautwave import simulate
from tautwave.certificate import certify
from tautwave.config import load_rig
from tautwave.errors import SafetyStop
from tautwave.rig import build_rig
from tautwave.types import CommandDelay
from tautwave_scenes.networks.ledger import Ledger
from tautwave_scenes.rig.network import HOLD_J, hold_claim, hold_limit
from tautwave_scenes.runtime.hold import HoldAccount

CONFIGS = Path(__file__).parents[2] / "configs"
PERIOD = 1e-3
STIFFNESS = 2000.0
NOTHING = Ledger(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def account(damping: float, delay: tuple[int, float] = (0, 0.0), **more: Any) -> Any:
    site = SimpleNamespace(position=0.0, valid=True, end=SimpleNamespace(absorbed=0.0))
    made = HoldAccount([site], [delay], [damping], PERIOD, 1e-3, **more)  # type: ignore[list-item]
    return made, site


def swing(made: Any, site: Any, delay: int = 0, late: float = 0.0, missing: int = 0) -> float:
    """Move a port that a plain spring holds; return what the hold created [J], by definition."""
    asked = [0.0] * (delay + 2)
    reported, created, before, given = NOTHING, 0.0, 0.0, 0.0
    efforts: list[float] = []
    for slot, x in enumerate(0.01 * np.sin(np.arange(200) * 0.1)):
        acting = late * asked[-2 - delay] if late else 0.0
        acting += (1.0 - late) * asked[-1 - delay]
        efforts.append(acting)
        site.valid = not missing or slot % missing == 0
        if site.valid:
            site.position = float(x)
            given += float(np.mean(efforts)) * (site.position - before)
            site.end.absorbed = given
            before = site.position
            efforts = []
            reported = NOTHING._replace(port_work=0.5 * STIFFNESS * before * before)
        created = reported.port_work - given
        made.overdrawn([asked[-1]], 1, reported)
        asked.append(STIFFNESS * site.position)
    return created


@pytest.mark.parametrize(
    ("delay", "late", "missing"), [(0, 0.0, 0), (2, 0.0, 0), (1, 0.3, 0), (0, 0.0, 3)]
)
def test_without_damping_the_debt_is_what_was_created(
    delay: int, late: float, missing: int
) -> None:
    made, site = account(0.0, (delay, late))
    created = swing(made, site, delay, late, missing)
    assert created > 1e-4
    assert made.state.debt == pytest.approx(created, rel=1e-9)


def test_a_sampled_spring_owes_nothing_where_colgate_s_condition_holds() -> None:
    """A spring k, held for T, creates k dx**2 / 2 a step: b >= k T / 2 takes it."""
    enough = 0.5 * STIFFNESS * PERIOD
    made, site = account(1.0001 * enough)
    swing(made, site)
    assert made.state.debt < 1e-12
    made, site = account(0.9 * enough)
    created = swing(made, site)
    assert made.state.debt == pytest.approx(0.1 * created, rel=1e-6)


def test_calm_times_earn_no_credit() -> None:
    made, site = account(10.0)
    for x in np.linspace(0.0, 1.0, 50):  # free, and damped: nothing is owed
        site.position = float(x)
        assert not made.overdrawn([0.0], 1, NOTHING)
    assert made.state.debt == 0.0
    assert made.overdrawn([0.0], 1, NOTHING._replace(port_work=2e-3))
    assert made.state.debt == pytest.approx(2e-3)


def test_what_the_scene_loses_is_taken_off_and_what_its_scheme_makes_is_put_on() -> None:
    made, _ = account(0.0)
    assert not made.overdrawn([0.0], 1, NOTHING._replace(port_work=3e-3, lost=2.5e-3))
    assert made.state.debt == pytest.approx(5e-4)
    assert made.overdrawn([0.0], 1, NOTHING._replace(port_work=3e-3, lost=2.5e-3, numeric=1e-3))


def test_a_scheme_that_holds_forces_may_swing_with_its_energy() -> None:
    reported = NOTHING._replace(numeric=2e-3, kinetic=8e-3)
    assert account(0.0)[0].overdrawn([0.0], 1, reported)
    assert not account(0.0, holds_forces=True)[0].overdrawn([0.0], 1, reported)


def test_what_a_limit_clips_is_owed_once_the_network_no_longer_holds_it() -> None:
    """Pushed in for nothing, it stores 5 mJ; given back by the effort that was asked for."""
    made, site = account(0.0)
    site.position = 1e-3
    inside = NOTHING._replace(port_work=5e-3, stored=5e-3)
    assert not made.overdrawn([5.0], 1, inside)
    assert made.state.clipped_debt == pytest.approx(5e-3)
    site.position, site.end.absorbed = 0.0, -5e-3
    assert made.overdrawn([5.0], 1, NOTHING)
    assert made.state.debt == 0.0


def test_a_limit_is_the_rig_s_or_that_of_its_devices_at_a_tenth_of_their_speed() -> None:
    path = CONFIGS / "scene-resonator.yaml"
    assert hold_limit(load_rig(path), ["stylus"]) == pytest.approx(0.5 * 0.04 * 0.5**2)
    for speed in ("null", "50"):
        rig = load_rig(path, [f"master.axes.stylus.velocity_limit={speed}"])
        assert hold_limit(rig, ["stylus"]) == HOLD_J
    assert hold_limit(load_rig(path, ["scene.hold_limit_j=0.002"]), ["stylus"]) == 0.002


def test_a_claim_counts_what_acts_until_a_run_has_stopped() -> None:
    """20 N at 5 m/s for a period and two of delay, and for half of what a rate limit takes."""
    rate = "master.axes.stylus.effort_rate_limit=4000"
    delays = {"master.stylus": CommandDelay(2, 0.0)}
    for more, wanted in (([], 0.03), ([rate], 0.03 + 0.25)):
        rig = load_rig(CONFIGS / "scene-resonator.yaml", more)
        assert hold_claim(rig, ["stylus"], delays) == pytest.approx(0.005 + wanted)


STIFF = "{type: contact, between: [stick, ring1], stiffness: 1.0e9, exponent: 1.5}"
DOWN = "simulation.hand.stick.reference.waypoints=[[0.0, 0.0], [0.06, -0.02], [0.12, 0.01]]"


def test_a_run_that_is_forced_stops_at_its_limit() -> None:
    """A contact too stiff for its rate is refused, and stops a run that is forced."""
    path = CONFIGS / "scene-drum.yaml"
    rig = load_rig(path, [DOWN, f"scene.links.felt={STIFF}", "duration_s=0.15"])
    assert not certify(rig).passed
    rows = simulate(rig, engine="python")
    assert isinstance(rows.error, SafetyStop)
    assert "drew more energy from its scene than it put in at" in str(rows.error)
    built = build_rig(rig, clock="fake")
    assert built.control.scene is not None
    assert built.control.scene.account is not None
    # At the stop it was overdrawn by one sample's creation, not by the whole contact's 1.5 J.
    assert -rows["scene.hold"].min() < 4.0 * built.control.scene.account.allowance
    late = rows["master.stick.commanded"][-5:]
    assert np.abs(late).max() < 1.0  # ramped down, not stopped dead


def test_an_instrument_that_feeds_has_no_account() -> None:
    path = CONFIGS / "scene-resonator.yaml"
    link = "scene.links.feed={type: negative_damper, between: [object, ground], damping: 0.01}"
    rig = load_rig(path, [link, "scene.scheme=discrete_gradient"])
    built = build_rig(rig, clock="fake")
    assert built.control.scene is not None
    assert built.control.scene.account is None
