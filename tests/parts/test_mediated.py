"""Law mediated: what is touched is found, rendered, paid for, and given back."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave.certificate import certify
from tautwave.certificate.belief import declared_delays
from tautwave.config import Rig
from tautwave.config.load import parse_rig
from tautwave.session.facts import pair_facts
from tautwave.simulation import simulate
from tests.lab.couplings.measure import run_coupling, stated_bound
from tests.lab.couplings.rigs import BENCH, RIG, _between, drawn_rig
from tests.rigs.holds import Hold

WALL = 0.03
DELAY = 0.06
CALM = BENCH._replace(coulomb=0.0, noise=1.5e-5)


def rig(account: str = "{tank: 0.1}", seconds: float = 1.2, **keys: Any) -> Rig:
    """A hand at 1 kHz that presses into a wall twice, 60 ms each way; the slave turned round."""
    keys = {"sign": -1, **keys}
    pair = ", ".join(f"{key}: {value}" for key, value in keys.items())
    text = RIG.format(
        name="mediated", rate=1000.0, seconds=seconds, seed=2, late=0.0,
        master=CALM.axis, slave=CALM.axis, true_master=CALM.truth, true_slave=CALM.truth,
        delay=DELAY, account=account, law=f"law: mediated, pairs: {{lever: {{{pair}",
        reference="{type: multisine, ramp_s: 0.1, components: [[1.25, 0.08, 0.0]]}",
        contact=f"{{type: wall, position: {-WALL}, stiffness: 150, side: below}}",
        missing=0.0, overrun=0.0,
    )  # fmt: skip
    return parse_rig(text, Path("mediated.yaml"))


@cache
def ran() -> dict[str, np.ndarray[Any, Any]]:
    run = simulate(rig(), engine="python")
    assert run.error is None
    return {name: run.data[:, at] for at, name in enumerate(run.columns)}


def test_the_slave_finds_the_wall_and_the_master_feels_it_where_it_is() -> None:
    at = ran()
    found, wide = at["slave.lever.model_stiffness"][-1], at["slave.lever.model_interval"][-1]
    assert abs(-found - 150.0) < 15.0  # below, for the slave
    assert wide < 10.0
    assert at["slave.lever.model_position"][-1] == pytest.approx(-WALL, abs=1e-3)
    believed = at["master.lever.model_position"][-1]
    assert believed == pytest.approx(WALL, abs=1e-3)
    rendered = at["master.lever.model_stiffness"][-1]
    assert rendered == pytest.approx(min(-found, 1.1e-3 / 49e-6), rel=0.05)
    again = at["time_s"] > 0.8  # the second time it is known
    assert np.max(at["true.master.lever.position"][~again]) > 0.05
    assert np.max(at["true.master.lever.position"][again]) < 0.04
    assert np.max(at["master.lever.port_effort"][again]) > 0.12


def test_what_the_model_holds_is_always_covered_and_in_the_books() -> None:
    at = ran()
    held = at["lever.model_master.stored"]
    assert np.max(held) > 1e-4
    assert np.min(held) == 0.0
    funds = at["lever.account_master.stored"] + held  # and the reserve
    assert np.all(held <= funds + 0.025 + 1e-12)
    elements = ("account_master", "account_slave", "credits", "model_master")
    absorbed = sum(at[f"lever.{name}.absorbed"] for name in elements)
    ports = at["master.lever.port_energy"] + at["slave.lever.port_energy"]
    assert np.max(np.abs(absorbed - ports)) < 1e-12
    for name in elements:
        parts = (at[f"lever.{name}.{it}"] for it in ("absorbed", "stored", "dissipated"))
        whole, stored, lost = parts
        assert np.max(np.abs(whole - stored - lost)) < 1e-12
    assert np.max(at["master.lever.model_paid"]) > 1e-4  # it was pressed when it was sent


def test_it_passes_by_account_and_not_without() -> None:
    with_account = certify(rig()).as_dict()
    assert with_account["passed"]
    assert [it["numbers"].get("holds") for it in with_account["elements"][:2]] == ["by account"] * 2
    bare = certify(rig(account="null")).as_dict()
    assert not bare["passed"]
    assert "in contact generates energy" in bare["sentences"][0]


def drawn_mediated(draw: np.random.Generator) -> str:
    """Return law mediated with keys drawn at random: models that are not sure, and too stiff."""
    keys = f"stiffness: {_between(draw, 0.5, 100.0)!r}, damping: {_between(draw, 0.005, 0.5)!r}"
    keys += f", force_gain: {_between(draw, 0.1, 3.0)!r}, sure: {_between(draw, 0.1, 1.0)!r}"
    keys += f", observer_hz: {_between(draw, 20.0, 200.0)!r}, touch: {_between(draw, 0.01, 0.1)!r}"
    keys += f", adopt_s: {_between(draw, 1e-3, 0.1)!r}, stiffest: {_between(draw, 5.0, 500.0)!r}"
    if draw.random() < 0.3:
        keys += f", position_scale: {_between(draw, 0.3, 3.0)!r}, sign: {draw.choice((1, -1))}"
    return f"law: mediated, pairs: {{lever: {{{keys}"


def test_no_drawn_rig_gives_more_than_its_bound() -> None:
    for seed in range(6):
        drawn = drawn_rig(seed, account=True, seconds=0.08, law=drawn_mediated)
        found = run_coupling(drawn, bound=stated_bound(drawn), engine="python")
        assert found.excess <= 0.0, f"seed {seed}"


@pytest.mark.parametrize(
    ("keys", "offset"),
    [
        ({"stiffness": 80.0, "force_gain": 0.0}, 1.0 / 80.0),
        ({"stiffness": 80.0, "force_gain": 0.5}, 0.0),  # the slave presses by itself
        ({"stiffness": 0.0, "force_gain": 0.0}, 0.0),  # and nothing holds it to the master
    ],
)
def test_the_pair_stands_apart_by_the_slaves_spring(keys: dict[str, Any], offset: float) -> None:
    made = rig(**keys)
    facts = pair_facts(made, "lever", declared_delays(made))
    assert facts.offset_per_effort == pytest.approx(offset)


PRESSED, AVERAGED = 0.1, 200
"""[N m] More than friction; periods of a tenth of a second."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wall", "delay", "encoder"),
    [
        ("stiff", 0.0, "1.5e-5"),
        ("stiff", 0.1, "1.5e-5"),
        ("soft", 0.02, "1.5e-5"),
        ("stiff", 0.02, "coarse"),
    ],
)
def test_a_first_slow_press_is_felt_as_it_is_pressed(wall: str, delay: float, encoder: str) -> None:
    """No fit has been sure by then; without the line it was ten times too soft, and let go."""
    run = simulate(
        Hold("mediated account", wall, delay, encoder).rig.model_copy(update={"duration_s": 4.0}),
        engine="python",
    )
    assert run.error is None
    felt, pressed = (
        np.abs(run[f"{side}.lever.commanded"].reshape(-1, AVERAGED).mean(axis=1))
        for side in ("master", "slave")
    )
    counts = pressed > PRESSED
    assert counts[-5:].all()
    assert np.max(pressed[counts] / felt[counts]) < 3.0
    assert pressed[-1] / felt[-1] < 2.5
