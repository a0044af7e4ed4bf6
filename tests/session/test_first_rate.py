"""The rate that `tautwave new` writes: what its buses have time for, with some to spare."""

from __future__ import annotations

from pathlib import Path

import pytest

import tautwave_drivers.modbus
from tautwave.config import load_rig
from tautwave.contracts import Budget
from tautwave.errors import ConfigError
from tautwave.session.new import fitting
from tautwave.session.new.choosing import select
from tautwave.session.new.draft import Draft
from tautwave.session.new.surveying import described

PROFILE = Path(tautwave_drivers.modbus.__file__).with_name("profiles") / "generic.yaml"


@pytest.fixture
def draft() -> Draft:
    found = [described("profile", PROFILE, [1, 2])]
    hand, task = select("1", found, "--master"), select("2", found, "--slave")
    return Draft("bench", hand, task, ["lever"], 0.0)


def sustain(monkeypatch: pytest.MonkeyPatch, rate_hz: float) -> None:
    budget = Budget(1.0 / rate_hz, rate_hz, "")
    monkeypatch.setattr(fitting, "bus_budgets", lambda rig: {"drives": budget, "more": budget})
    monkeypatch.setattr(fitting, "over_budget", lambda rig, budgets: [])


FITTING = (15, 30, 45, 60, 75, 120, 150, 220, 290, 360, 430, 580, 750, 1200, 1500)


@pytest.mark.parametrize("most_hz", [*FITTING, 9000])
def test_it_is_a_round_one_and_leaves_a_third_but_not_much_more(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, draft: Draft, most_hz: int
) -> None:
    sustain(monkeypatch, most_hz)
    path = tmp_path / "rig.yaml"
    path.write_text(fitting.fitted_text(draft, path))
    rate_hz = load_rig(path, choose=False).rate_hz
    if most_hz == 9000:
        assert rate_hz == 1000.0  # as fast as a first rig has to be
        return
    assert rate_hz % 10 == 0
    assert 0.65 * most_hz < rate_hz <= 0.7 * most_hz


def test_buses_that_are_too_slow_for_any_are_a_sentence(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, draft: Draft
) -> None:
    sustain(monkeypatch, 14.0)
    with pytest.raises(ConfigError, match="new: the buses cannot sustain even 10 Hz"):
        fitting.fitted_text(draft, tmp_path / "rig.yaml")
