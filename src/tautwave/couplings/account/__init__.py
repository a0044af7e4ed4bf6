"""`coupling.account`: any law that joins axes that take effort, made passive by an energy account.

The law is not touched. Its efforts pass a gate, what they did is booked, and what one end takes the
other may give: see `tautwave.laws.account`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from tautwave.config.keys.coupling import Account
from tautwave.contracts import CoupledAxis, CouplingPlugin
from tautwave.controller.answer import sample_gain
from tautwave.controller.steps import Law, NoParams, SiteLaw
from tautwave.controller.wrapping import params_with
from tautwave.couplings.account.law import GUARDS, law_with_account
from tautwave.couplings.account.steps import account_params, model_reserve
from tautwave.couplings.over_link import linked_law, site_laws
from tautwave.registry import load_named
from tautwave.types import CommandDelay
from tautwave.wording import CouplingMessages, PlanLine

_CERTIFICATE = "tautwave.couplings.account.certificate"


def sites_with_account(bare: Law) -> dict[str, SiteLaw]:
    """Return a law in an account at either of two sites; an overdrawn one ends their session."""
    return {
        side: site._replace(law=law_with_account(site.law, side), debts=frozenset(GUARDS))
        for side, site in site_laws(bare).items()
    }


def messages_with_account(law: CouplingMessages) -> CouplingMessages:
    """Return a law's messages with the account in them."""

    def coupling(rig: Any) -> str:
        return f"{law.coupling(rig)}, in an energy account"

    def pair_plan(rig: Any, name: str) -> Iterator[PlanLine]:
        yield from law.pair_plan(rig, name)
        yield PlanLine(f"account of {name}", True, f"led by the {rig.coupling.account.leader}")

    def facts(rig: Any, delays: Mapping[str, CommandDelay]) -> Iterator[tuple[str, str]]:
        yield from law.facts(rig, delays)
        yield from load_named(f"{_CERTIFICATE}:held_facts")(rig, delays)

    return law._replace(coupling=coupling, pair_plan=pair_plan, facts=facts)


def with_account(plugin: CouplingPlugin, keys: Account) -> CouplingPlugin:
    """Return a law's declaration with an account around it.

    Raises
    ------
    ConfigError
        The law keeps accounts of its own.
    """
    bare = load_named(plugin.law)
    make = load_named(plugin.end_constants)
    whole = law_with_account(bare)
    seen = bare.spring is not None
    over_link = law_with_account(linked_law(bare), "link") if seen else ""
    at_sites = sites_with_account(bare) if seen else ""

    def end_constants(pair: Any, side: str, axis: CoupledAxis) -> Any:
        """Return the constants of one end: the law's, and `account`."""
        given = make(pair, side, axis)
        assert axis.inertia is not None
        known = bare, given, NoParams(), axis.period, axis.gain, axis.inertia
        gain = sample_gain(*known)
        mine, alone = keys, bare.holding is None and sample_gain(*known, still=True) == 0.0
        if bare.holding is not None:
            gain = max(gain, bare.holding.gain(given, axis.gain, axis.period))
            alone = True  # a damper in the place of friction would be most of the noise
            if side == "master":
                mine = model_reserve(mine, axis)
        return params_with(given, "account", account_params(mine, side, axis, gain, alone=alone))

    return plugin._replace(
        law=whole,
        over_link=over_link,
        linked="tautwave.couplings.over_link:linked",
        at_sites=at_sites,
        end_constants=end_constants,
        causalities=("impedance",),
        divisors=False,
        verdict=f"{_CERTIFICATE}:verdict",
        claim=f"{_CERTIFICATE}:claimed_joules",
        claim_terms=f"{_CERTIFICATE}:claim_of",
        messages=messages_with_account(load_named(plugin.messages or CouplingMessages())),
    )
