"""Hands that the pointer of a run's page leads: what may have them, and how it comes to them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from tautwave.config import Rig
from tautwave.errors import ConfigError
from tautwave.rig import Assembly
from tautwave.rig.led import pointed_hands
from tautwave.rig.ways import BusWay, Way
from tautwave.runtime.operate.commands import LEAD
from tautwave.runtime.operate.lead import Leads, Pointed
from tautwave.runtime.operate.mailbox import Mailbox


def refuse_pointers(rig: Rig, ways: Mapping[str, BusWay], clock: str) -> None:
    """Refuse a pointer where something else than a simulated device in this run would move.

    Raises
    ------
    ConfigError
        A bus of the rig is not simulated in memory, or the clock is the fake one.
    """
    names = pointed_hands(rig)
    if not names:
        return
    key = f"simulation.hand.{names[0]}.reference"
    for name, bus_way in ways.items():
        if bus_way.way is not Way.MEMORY:
            raise ConfigError(
                f"{key}: a pointer moves nothing but devices that are simulated in the run itself; "
                f"bus {name} is {bus_way.way.value}; use driver loopback, or another hand"
            )
    if clock != "real":
        raise ConfigError(f"{key}: a pointer needs the real clock; leave out --clock fake")


@contextmanager
def pointers_of(assembly: Assembly) -> Iterator[dict[str, Any] | None]:
    """Let pages lead hands; give what a viewer has to know, None where there are none."""
    axes = [axis for world in assembly.simulators for axis in getattr(world, "axes", ())]
    hands = {
        axis.name.partition(".")[2]: axis.lead
        for axis in axes
        if isinstance(getattr(axis, "lead", None), Pointed)
    }
    if not hands:
        yield None
        return
    leads = Leads(hands)
    with Mailbox() as mailbox:

        def look() -> None:
            for order in mailbox.source.take(0):
                if order.word == LEAD:
                    leads.obey(order.argument)
                else:
                    for hand in hands.values():
                        hand.let_go()

        for hand in hands.values():
            hand.look = look
        yield {
            "mailbox": mailbox.address,
            "ranges": {name: list(hand.range) for name, hand in hands.items()},
        }
