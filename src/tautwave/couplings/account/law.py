"""Any law in an account: its steps inside those of the account, its state beside the account's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from tautwave.controller.steps import Guard, Holding, Law, Steps, ignore_acted
from tautwave.controller.wrapping import bound, record_with
from tautwave.couplings.account import steps as own
from tautwave.couplings.account.steps import AccountEnd, AccountLink
from tautwave.errors import ConfigError

GUARDS = {
    own.ACCOUNT_OVERDRAWN: Guard(
        "account_overdrawn",
        "supplied more energy than its account allows",
        "it is {found:.3g} J in debt (limit {allowed:.3g} J); check position_noise, "
        "inertia.lower, and whether effort_rate_limit holds an effort too long",
    ),
    own.ACCOUNT_EMPTY: Guard(
        "account_empty",
        "lost its coupling",
        "its energy account is empty and it let go: less than a quarter of the {allowed:.3g} "
        "{effort} that its law requests is sent, {found:.3g} at best over a second; motion of "
        "the hand refills the account, and law wave holds a force without one",
    ),
    own.ACCOUNT_ASTRAY: Guard(
        "account_astray",
        "left its pair apart",
        "for ten seconds its energy account has let {found:.3g} % pass of the {allowed:.3g} "
        "{effort} that its law requests to bring the pair together; motion of the hand refills the "
        "account, a larger reserve holds more, and law wave holds a force without one",
    ),
}

ACCOUNTS = {
    "account_SIDE": "an account: work of its law, credit received minus sent",
    "credits": "credit in transit between accounts",
    "model_master": "the spring that is rendered",
}
"""What the elements of a pair are."""

EXCHANGES = {
    "": own.exchange,
    "link": own.exchange_over_link,
    "master": own.exchange_at_master,
    "slave": own.exchange_at_slave,
}
"""By what is between the sides: a line, a simulated network, or a real one, seen from one side."""


def law_with_account(law: Law, over: str = "") -> Law:
    """Return a law in an account; `over`, of `EXCHANGES`: it is one of `couplings.over_link`.

    Raises
    ------
    ConfigError
        It books by the slot, as a law with an account of its own does.
    """
    if law.steps.on_acted is not ignore_acted:
        raise ConfigError(
            f"coupling.account: law {law.name} keeps its own accounts; remove the block"
        )
    steps, elements = _steps(law.steps, law.rings, law.holding, over)
    return Law(
        name=f"{law.name} with account",
        steps=steps,
        end=record_with(law.end, "account", AccountEnd),
        link=record_with(law.link, "account", AccountLink),
        signals=law.signals,
        elements=elements,
        accounts=ACCOUNTS,
        guards={**law.guards, **GUARDS},
        rings=0 if over else law.rings + own.RINGS,
        holding=law.holding,
    )


def _steps(
    inner: Steps, rings: int, holding: Holding | None, over: str
) -> tuple[Steps, Callable[..., Sequence[str]]]:
    """Return the account's steps around a law's, and its elements."""
    passing = inner.exchange
    if over:
        own_steps = {"law_credit": own.credit, "law_level": own.level, "law_hear": own.hear}
        passing = bound(inner.exchange, own_steps)
    law: dict[str, Any] = {
        "law_start": inner.start,
        "law_engage": inner.engage,
        "law_close": inner.close,
        "law_exchange": passing,
        "law_effort": inner.compute_effort,
        "law_brake": inner.brake,
        "law_rings": rings,
    }
    if holding is not None:
        law |= {
            "law_holds": 1,
            "law_cover": holding.cover,
            "law_held": holding.held,
            "law_whole": holding.whole,
        }
    names = own.element_names_over_link if over else own.element_names
    fill = own.fill_elements_over_link if over else own.fill_elements
    steps = inner._replace(
        start=bound(own.start, law),
        engage=bound(own.engage, law),
        close=bound(own.close, law),
        exchange=bound(EXCHANGES[over], law),
        compute_effort=bound(own.compute_effort, law),
        brake=bound(own.brake, law),
        fill_elements=bound(fill, law),
    )
    return steps, bound(names, law)
