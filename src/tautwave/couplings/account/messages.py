"""What `check` and the report say of a law in an account."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from tautwave.couplings.account.claim import held_facts
from tautwave.types import CommandDelay
from tautwave.wording import CouplingMessages, PlanLine


def messages_with_account(law: CouplingMessages) -> CouplingMessages:
    """Return a law's messages with the account in them."""

    def coupling(rig: Any) -> str:
        return f"{law.coupling(rig)}, in an energy account"

    def pair_plan(rig: Any, name: str) -> Iterator[PlanLine]:
        yield from law.pair_plan(rig, name)
        yield PlanLine(f"account of {name}", True, f"led by the {rig.coupling.account.leader}")

    def facts(rig: Any, delays: Mapping[str, CommandDelay]) -> Iterator[tuple[str, str]]:
        yield from law.facts(rig, delays)
        yield from held_facts(rig, delays)

    return law._replace(coupling=coupling, pair_plan=pair_plan, facts=facts)
