"""Columns on what joins two sites: what a site writes after its half of the pairs, and laws."""

from __future__ import annotations

from tautwave.columns import Column

LINK_COLUMNS = (
    Column("link.session", "", "number of the session, from 1 on"),
    Column("link.slot", "", "own slot of the session, from 0 on; -1: not engaged"),
    Column("link.silence_s", "s", "since a packet from the other site arrived"),
    Column("link.holding", "0, 1", "whether it holds, for lack of the other site"),
    Column("link.delay_s", "s", "one way of the newest packet, to half a round trip"),
    Column("link.aligning", "0, 1", "whether slaves are brought into place, or wait there"),
)

DELAY = Column("link_delay", "s", "over a network: age of what was played out or heard last")
SILENCE = Column("link_silence", "s", "over a network: since the last packet arrived")
LOST = Column("link_lost", "", "over a network: packets lost on the way here, so far")
"""What every law records of an axis over a network."""

ALIGNED = {"master": "hold_master", "slave": "align_slave"}
"""Elements of the books: a side's motor while no coupling holds it."""

ACCOUNTS = {
    "hold_master": "the master's motor while it is held",
    "align_slave": "the slave's motor while it is moved into position or held",
}
"""What these are."""
