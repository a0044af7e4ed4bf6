"""Drawn rigs: in an account no law gives more than its certificate states; bare ones do."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.config.keys.simulation import Faults
from tautwave.rig import command_delays
from tautwave.types import CommandDelay
from tests.lab.command import lab
from tests.lab.couplings import drawn
from tests.lab.couplings.long_delays import CASES, SURFACES, claimed, contact_left, long_rig
from tests.lab.couplings.measure import Outcome, run_coupling, stated_bound
from tests.lab.couplings.recorded import likeness, median_ratio
from tests.lab.couplings.rigs import LAWS, bench_rig, drawn_rig, without_account
from tests.lab.couplings.suite import OWN_ACCOUNT
from tests.lab.port.hands import recorded_hands

DATA = Path(__file__).parents[3] / "shared" / "data" / "teleop-1dof"
QUICK = "{type: multisine, ramp_s: 0.01, components: [[2.0, 0.1, 0.0]]}"
BEYOND = (32, 73, 92, 137)
"""Seeds of rigs whose bare law gives more than the bound: the largest of the first 160."""

LAWS_WITHOUT = [law for law in LAWS if law not in OWN_ACCOUNT]


@pytest.mark.parametrize("first", range(0, 40, 10))
def test_in_an_account_no_drawn_rig_gives_more_than_its_bound(first: int) -> None:
    for seed in range(first, first + 10):
        rig = drawn_rig(seed, account=True, seconds=0.08)
        found = run_coupling(rig, bound=stated_bound(rig), engine="python")
        assert found.excess <= 0.0, f"seed {seed}"


def test_many_rigs_go_on_where_they_were_interrupted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[int] = []

    def run(rig: int, *, bound: float, engine: str) -> Outcome:
        ran.append(rig)
        if len(ran) == 5:
            raise KeyboardInterrupt
        made = 0.1 * abs(rig)
        return Outcome(0.0, 0.0, 0.0, 0.0, 0.0, made, made - bound, rig == 3)

    monkeypatch.setattr(drawn, "PIECE", 2)
    monkeypatch.setattr(drawn, "drawn_rig", lambda seed, account: seed)
    monkeypatch.setattr(drawn, "without_account", lambda rig: -rig)
    monkeypatch.setattr(drawn, "stated_bound", lambda rig: 0.45)
    monkeypatch.setattr(drawn, "run_coupling", run)
    monkeypatch.setattr(drawn, "laws_now", lambda: "these")
    said: list[str] = []

    def many() -> list[drawn.Tally]:
        keep = tmp_path / "rigs.jsonl"
        return drawn.run_many(0, 8, "python", jobs=1, keep=keep, tell=said.append)

    with pytest.raises(KeyboardInterrupt):
        many()
    kept, bare = many()
    assert len(ran) == 5 + 12  # of 16, the four of the first piece were kept
    assert (kept.rigs, kept.beyond, kept.early, bare.early) == (8, 3, 1, 0)
    assert kept.made == pytest.approx(0.7)
    assert kept.share == pytest.approx(0.7 / 0.45)
    assert said[-1] == "rigs drawn at random, 1 of 4 pieces left"
    monkeypatch.setattr(drawn, "laws_now", lambda: "others")
    many()
    assert len(ran) == 5 + 12 + 16


@pytest.mark.parametrize("seed", BEYOND)
def test_bare_laws_that_give_more_than_the_bound_do_not_in_an_account(seed: int) -> None:
    rig = drawn_rig(seed, account=True)
    bound = stated_bound(rig)
    bare, kept = (
        run_coupling(it, bound=bound, engine="python") for it in (without_account(rig), rig)
    )
    assert bare.excess > 0.0
    assert kept.excess <= -0.9 * bound


def test_a_law_that_makes_half_a_joule_makes_none_in_an_account() -> None:
    """Position over 20 ms each way: bare, it runs away within half a second."""
    bare, kept = (
        run_coupling(
            bench_rig("position", 0.02, account=it, contact="free", reference=QUICK, seconds=0.6),
            engine="python",
        )
        for it in (False, True)
    )
    assert bare.made > 0.3
    assert kept.made < 1e-3
    assert not kept.stopped


def test_behind_a_long_delay_the_law_is_alone_to_blame() -> None:
    """No sample is missing, no slot late, and both devices take an effort at once."""
    for case in CASES:
        for surface, (at, stiffness) in SURFACES.items():
            rig = long_rig(case, 0.3, surface, 0.1)
            assert (rig.rate_hz, rig.duration_s, rig.coupling.delay_s) == (2000.0, 0.1, 0.3)
            assert rig.simulation is not None
            assert rig.simulation.faults == Faults()
            assert set(command_delays(rig).values()) == {CommandDelay(0, 0.0)}
            contact: Any = rig.simulation.environment["lever"]
            assert contact.type == ("free" if surface == "free" else "wall")
            if surface != "free":
                assert (contact.position, contact.stiffness) == (at, stiffness)


def test_energy_behind_a_long_delay_is_set_over_what_ends_claim_with_what_they_begin_with() -> None:
    small, large = (claimed(long_rig(it, 0.3, "rigid")) for it in list(CASES)[-2:])
    quarter = 0.25 * 0.2
    assert large > small + quarter - 0.01
    assert all(0.0 < claimed(long_rig(it, 0.3, "rigid")) < 0.4 for it in CASES)


def test_what_is_left_of_a_contact_is_measured_once_it_has_settled() -> None:
    """A slave 3 mrad beside the motion that had arrived; a wall of 40 N m/rad at 0.1 rad."""
    period, late, surface = 0.01, 30, 0.1
    time = period * np.arange(1500)
    led = 0.2 * np.sin(2.0 * math.pi * 0.2 * time) + 1e-3 * np.sin(2.0 * math.pi * 20.0 * time)
    hand = np.where(led > surface, 40.0 * (led - surface), 0.02)
    hand[:500] = 7.0  # while it learns, nothing counts
    at = {
        "true.master.lever.position": led,
        "true.slave.lever.position": np.concatenate([np.zeros(late), led[:-late]]) + 3e-3,
        "true.master.lever.hand_effort": hand,
        "plant.master.lever.motor_work": np.linspace(0.0, 0.3, 1500),
        "plant.slave.lever.motor_work": np.linspace(0.0, -0.1, 1500),
    }
    found = contact_left(at, 0.3, surface, period, ended=False)
    assert found.behind == pytest.approx(3e-3, rel=1e-9)
    assert found.drag == pytest.approx(0.02, rel=1e-9)
    assert found.felt == pytest.approx(40.0, rel=1e-9)
    assert found.beyond == pytest.approx(np.max(led[500:]) - surface, rel=1e-12)
    slow, fast = 0.2 * math.sin(0.002 * math.pi), 1e-3 * math.sin(0.2 * math.pi)  # per sample
    assert found.fast == pytest.approx(fast**2 / (fast**2 + slow**2), rel=1e-2)
    assert found.made == pytest.approx(0.2, rel=1e-12)
    assert not found.ended
    short = {name: values[:400] for name, values in at.items()}
    gone = contact_left(short, 0.3, surface, period, ended=True)
    assert all(math.isnan(value) for value in gone[:5])
    assert gone.made == pytest.approx(0.2 * 399 / 1499, rel=1e-12)
    assert gone.ended


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS_WITHOUT)
def test_on_the_bench_an_account_takes_the_energy_and_leaves_the_law(law: str) -> None:
    """It tracks no worse than bare, where that is stable, and makes a millijoule at most."""
    for contact, delay in (("free", 0.0), ("rigid", 0.05)):
        bare, kept = (
            run_coupling(
                bench_rig(law, delay, account=it, contact=contact, seconds=1.5), engine="python"
            )
            for it in (False, True)
        )
        assert kept.made < 1e-3
        assert not kept.stopped
        if law == "pd_damping" or (law, delay) == ("position", 0.0):
            assert bare.made < 1e-5
            assert 0.88 * bare.error < kept.error < 1.03 * bare.error
        else:
            assert bare.made > 3.0 * kept.made


@pytest.mark.slow
def test_the_command_prints_both_tables() -> None:
    result = CliRunner().invoke(lab, ["couplings", "--quick", "--rigs", "2"])
    assert "Rigs drawn at random" in result.output
    assert "four_channel" in result.output
    assert "Traceback" not in result.output


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason="no recordings")
@pytest.mark.nightly
def test_the_laboratorys_gains_make_the_laboratorys_error(tmp_path: Path) -> None:
    hands = [hand for hand in recorded_hands(DATA, 3.0) if hand.name.startswith("m2_a_")]
    found = [likeness(hand, tmp_path, engine="python") for hand in hands]
    assert len(found) == 4
    assert median_ratio(found) == pytest.approx(1.0, abs=0.15)
    springs = [each.ratio for each in found if "spring" in each.name]
    assert springs == pytest.approx([1.0] * len(springs), abs=0.1)
