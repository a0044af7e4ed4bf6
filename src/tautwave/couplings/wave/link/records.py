"""Constants and state of a wave pair's link: what leaves and what comes at each end."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from tautwave.couplings.wave.records import WaveEnd
from tautwave.laws.receiver import ReceiverParams
from tautwave.link.network import Network
from tautwave.link.receiver import Receiver, Sender
from tautwave.models.network import NetworkParams


class LinkEndParams(NamedTuple):
    """Constants of one end of a link.

    `network` brings packets here, drawn for this `direction`. Places in the table: `seed`; `ring`
    with `places` slots received; `post` with `days` slots that the other end sent, and what of them
    is under way (`link.network`); `last`: the last slot of those. A packet repeats `repeated`
    slots. `silence` and `lost`: slots without a packet until the end holds, and stops; `position`:
    master's rad or m per quantum of the wave integral.
    """

    receiver: ReceiverParams
    network: NetworkParams
    seed: int
    direction: int
    ring: int
    places: int
    post: int
    days: int
    last: int
    repeated: int
    silence: int
    lost: int
    position: float


class LinkParams(NamedTuple):
    """Constants of a pair's link, in slots of `period_ns`."""

    period_ns: int
    master: LinkEndParams
    slave: LinkEndParams


@dataclass(slots=True)
class LinkEnd:
    """State of one end of a link, and its books.

    `slot` counts exchanges, `silent` those since a packet came. `heard` is the newest energy
    counter that came, `credited` the newest credit. Books [J]: `left` and, as credit, `returned`
    entered the network here, `taken` came out of it, `given` went into the port. `afloat` is what
    entered the network here less what came out of it, in whole energy quanta: its sum over both
    ends is under way. `cut` counts ticks on which energy was short.
    """

    slot: int = 0
    silent: int = 0
    heard: int = 0
    credited: int = 0
    afloat: int = 0
    cut: int = 0
    left: float = 0.0
    returned: float = 0.0
    taken: float = 0.0
    given: float = 0.0
    sender: Sender = field(default_factory=Sender)
    receiver: Receiver = field(default_factory=Receiver)
    network: Network = field(default_factory=Network)


@dataclass(slots=True)
class LinkPair:
    """State of a pair's link; `used`: something has crossed since its tables were cleared."""

    used: bool = False
    master: LinkEnd = field(default_factory=LinkEnd)
    slave: LinkEnd = field(default_factory=LinkEnd)


@dataclass(slots=True)
class LinkedEnd(WaveEnd):
    """State of a port behind a receiver, and how that stands: its columns.

    `delay` [s] of the wave played out, `depth` [s] of it waiting for that, `backlog` [rad or m,
    master] that is owed, `silence` [s] since a packet came, packets `lost`, ticks `cut` for want of
    energy.
    """

    delay: float = 0.0
    depth: float = 0.0
    backlog: float = 0.0
    silence: float = 0.0
    lost: float = 0.0
    cut: float = 0.0
