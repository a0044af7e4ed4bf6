"""What `tautwave new` writes: a rate that its buses have time for, a stall that costs no effort."""

from __future__ import annotations

from pathlib import Path

import pytest

import tautwave_drivers.modbus
from tautwave.config import load_rig
from tautwave.contracts import Budget
from tautwave.errors import ConfigError
from tautwave.rig import command_delays
from tautwave.rig.claims import stall_of
from tautwave.session.new import fitting
from tautwave.session.new.choosing import select
from tautwave.session.new.draft import Draft
from tautwave.session.new.surveying import described
from tautwave.types import Setting

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


def with_axes(draft: Draft, **keys: object) -> Draft:
    """Return a draft whose axes say other things."""
    sides = []
    for side in (draft.master, draft.slave):
        found = []
        for one in side:
            axis = {key: value for key, value in one.device.axis.items() if key not in keys}
            axis |= {key: Setting(value) for key, value in keys.items()}
            found.append(one._replace(device=one.device._replace(axis=axis)))
        sides.append(found)
    return draft._replace(master=sides[0], slave=sides[1])


def limit_of(draft: Draft, path: Path) -> int:
    path.write_text(fitting.fitted_text(draft, path))
    return load_rig(path, choose=False).overrun_limit


@pytest.mark.parametrize("effort", [0.05, 0.4, 0.5])
def test_it_may_stall_for_as_long_as_that_costs_no_effort(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, draft: Draft, effort: float
) -> None:
    """One slot more, and a bound for stalls would leave less than the whole effort at rest."""
    sustain(monkeypatch, 9000)
    heavy = {"value": 6e-4, "lower": 4e-4, "source": "test"}
    keys = {"inertia": heavy, "velocity_limit": 10.0, "effort_rate_limit": 200.0}
    path = tmp_path / "rig.yaml"
    limit = limit_of(with_axes(draft, effort_limit=effort, **keys), path)
    found = {}
    for trial in (limit, limit + 1):
        rig = load_rig(path, [f"loop.overrun_limit={trial}"], choose=False)
        delays = command_delays(rig)
        found[trial] = [stall_of(rig, name, delays[name]) is not None for name in rig.axes]
    assert all(found[limit])
    assert limit == 20 or not any(found[limit + 1])
    assert (effort == 0.05) == (limit == 20)


def test_where_none_would_do_it_is_a_few_slots(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, draft: Draft
) -> None:
    sustain(monkeypatch, 9000)
    light = {"value": 1e-6, "lower": 1e-6, "source": "test"}
    assert limit_of(with_axes(draft, inertia=light), tmp_path / "rig.yaml") == 5
