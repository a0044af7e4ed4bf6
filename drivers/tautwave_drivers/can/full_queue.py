"""A transmit queue that is full: nothing is added to what is stale, until it drains or is dead."""

from __future__ import annotations

from typing import Any

from tautwave.contracts import FramePort
from tautwave_drivers.can.keys import CanKeys

DEAD_CYCLES = 5
"""Cycles with a full queue and nothing received that mean a dead bus."""
CHECK = "check cable, termination, power and bit rate"


def queue_remedy(options: CanKeys) -> str:
    """Return what to do about a transmit queue that is full."""
    check = f"{CHECK} (here {options.bitrate})"
    if options.interface != "socketcan" or options.channel.startswith(("vcan", "vxcan")):
        return check
    where = options.channel
    return (
        f"{check}, and that it has room: ip link set {where} txqueuelen 100 (ip -details link show "
        f"{where} has length and rate; ip link set {where} type can bitrate {options.bitrate})"
    )


class FullQueue:
    """Counts the cycles in which the queue of one bus takes no frame.

    Parameters
    ----------
    remedy : str
        What to do about it.
    dead_cycles : int
        Cycles with nothing received after which the bus is dead.

    Attributes
    ----------
    cycles : int
        Cycles since it was full; 0: it takes frames.
    dead : str
        That the bus is dead, and what to do about it; '' while it is not.
    """

    def __init__(self, remedy: str = CHECK, dead_cycles: int = DEAD_CYCLES) -> None:
        self._remedy = remedy
        self._dead_cycles = dead_cycles
        self.reset()

    def reset(self) -> None:
        """Reset all counts."""
        self.cycles = 0
        self.dead = ""
        self._received_then = 0

    def refused(self, received: int) -> None:
        """Note that it took no frame; `received`: frames received so far."""
        if not self.cycles:
            self.cycles = 1
            self._received_then = received

    def drained(self, port: FramePort, received: int) -> bool:
        """Return whether frames may be sent in this cycle; called once a cycle while it is full.

        Congested: other nodes are heard, so the bus works and the queue will drain. Dead: none is.
        """
        self.cycles += 1
        if received == self._received_then and self.cycles > self._dead_cycles:
            self.dead = (
                f"CAN: dead bus: the transmit queue has been full for {self.cycles} cycles and "
                f"nothing is received; {self._remedy}"
            )
            return False
        purge: Any = getattr(port, "purge", None)
        if purge is not None:
            purge()
        pending: Any = getattr(port, "pending", None)
        return pending is None or pending() == 0

    def kept_away(self) -> str:
        """Return how a full queue prevented samples, '' where it takes frames."""
        if not self.cycles:
            return ""
        return f"the CAN transmit queue was full for {self.cycles} cycles; {self._remedy}"

    def accepts_again(self) -> str:
        """Begin anew; return how long it was full."""
        cycles, self.cycles = self.cycles, 0
        return (
            f"CAN: congested: the transmit queue was full for {cycles} cycles; commands were "
            "dropped meanwhile"
        )
