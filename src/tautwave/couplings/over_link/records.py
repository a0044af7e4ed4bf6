"""Constants and state of what two sides say of themselves over a network."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from tautwave.link.network import Network
from tautwave.models.network import NetworkParams


class NewsEndParams(NamedTuple):
    """Constants of one end.

    `network` brings packets here, drawn for this `direction`. Places in the table: `seed`; `post`
    with `days` slots that the other end sent, and what of them is under way (`link.network`);
    `last`: the last slot of those. A packet repeats no slots: `repeated` is 0. `silence` and
    `lost`: slots without a packet until the far side counts as standing, and until the run stops.
    `position`: master units of what is said to it.
    """

    network: NetworkParams
    seed: int
    direction: int
    post: int
    days: int
    last: int
    repeated: int
    silence: int
    lost: int
    position: float = 1.0


class NewsParams(NamedTuple):
    """Constants of a pair's link, in slots of `period_ns`."""

    period_ns: int
    master: NewsEndParams
    slave: NewsEndParams


@dataclass(slots=True)
class NewsEnd:
    """One end: exchanges so far, those since a packet came, the newest slot and credit heard."""

    slot: int = 0
    silent: int = 0
    heard: int = -1
    credit: int = 0
    network: Network = field(default_factory=Network)


@dataclass(slots=True)
class News:
    """Both ends; `cleared`: nothing has crossed since they were."""

    cleared: bool = False
    master: NewsEnd = field(default_factory=NewsEnd)
    slave: NewsEnd = field(default_factory=NewsEnd)


@dataclass(slots=True)
class Heard:
    """How the network stands, as recorded: age of the newest word, silence [s], packets lost."""

    delay: float = 0.0
    silence: float = 0.0
    lost: float = 0.0
