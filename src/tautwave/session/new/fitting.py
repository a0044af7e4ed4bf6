"""The rate of a first rig, a round one that its buses have time for, and how long it may stall."""

from __future__ import annotations

from pathlib import Path

from tautwave.config import Rig, parse_rig
from tautwave.errors import ConfigError
from tautwave.rig import command_delays, longest_overrun
from tautwave.session.checking import bus_budgets, over_budget
from tautwave.session.new.draft import Draft, draft_text
from tautwave.types import Setting

RATES_HZ = (1000, 800, 500, 400, 300, 250, 200, 150, 100, 80, 50, 40, 30, 20, 10)
SHARE = 0.7
"""Of the fastest rate that the buses allow: a host that is busy needs some of the rest."""


def fitted_text(draft: Draft, path: Path) -> str:
    """Return the text of a draft at the fastest rate with time to spare; `path` is where it goes.

    Raises
    ------
    ConfigError
        The devices do not make a rig; the sentences name the lines of the draft.
    """
    for rate_hz in RATES_HZ:
        text = draft_text(draft._replace(rate_hz=rate_hz))
        try:
            rig = parse_rig(text, path, choose=False)
        except ConfigError as err:
            refusal = err
            continue  # an encoder count may read as too fast at this rate
        budgets = bus_budgets(rig)
        fastest = min(cost.greatest_rate_hz for cost in budgets.values())
        if rate_hz <= SHARE * fastest and not over_budget(rig, budgets):
            return draft_text(_patient(draft._replace(rate_hz=rate_hz), rig))
        refusal = ConfigError(f"new: the buses cannot sustain even {RATES_HZ[-1]} Hz")
    raise refusal


def _patient(draft: Draft, rig: Rig) -> Draft:
    """Return a draft with the longest stall that costs no effort, where devices determine it."""
    limit = longest_overrun(rig, command_delays(rig))
    if limit is None:
        return draft
    return draft._replace(
        overrun_limit=Setting(limit, "the longest stall that leaves all effort at rest")
    )
