"""One direction of a line on a simulated network, as plain Python; books in unbounded integers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from tautwave.laws.counters import ENERGY_QUANTUM, WAVE_QUANTUM, apart
from tautwave.laws.receiver import ReceiverParams
from tautwave.link.network import Network, deliver, network_places, post, start_network
from tautwave.link.receiver import (
    PLACE,
    Receiver,
    Sender,
    funds_of,
    ring_size,
    send,
    start_receiver,
    start_sender,
    tick,
)
from tautwave.models.network import NetworkParams

DAYS = 1024


@dataclass
class Run:
    """What was sent and given out, and the books of both ends: quanta, not on a circle."""

    sender: Sender
    receiver: Receiver
    network: Network
    sent: list[float] = field(default_factory=list)
    given: list[float] = field(default_factory=list)
    income: int = 0
    spent: int = 0
    least: int = 0

    @property
    def backlog(self) -> float:
        """Return what has not come out [W**0.5 s]."""
        return apart(self.sender.integral, self.receiver.given) * WAVE_QUANTUM

    @property
    def funds(self) -> float:
        """Return what the receiver could still spend beyond its reserve [J]."""
        return apart(self.receiver.paid, self.receiver.spent) * ENERGY_QUANTUM


def run_line(
    p: ReceiverParams,
    way: NetworkParams,
    waves: Sequence[float],
    *,
    ticks: int,
    repeated: int = 3,
    seed: int = 0,
    begin: int = 0,
    stretch: float = 0.0,
    look: Callable[[Run], None] = lambda run: None,
) -> Run:
    """Send waves, then none; `begin`: where the counters start on their circle.

    The receiver's clock is slow by `stretch`.
    """
    places = ring_size(p)
    ring, table = [0.0] * (PLACE * places), [0.0] * network_places(DAYS)
    run = Run(Sender(), Receiver(), Network())
    s, r = run.sender, run.receiver
    start_sender(s)
    start_receiver(r, ring, 0, places)
    start_network(run.network, table, 0, DAYS, seed, 0)
    s.integral = s.energy = r.played = r.paid = r.given = r.spent = begin
    period_ns = round(p.period * (1.0 + stretch) * 1e9)
    slot = p.period * p.up / p.down
    slot_ns = round(slot * 1e9)
    left = 0
    for now in range(ticks):
        while left * slot_ns <= now * period_ns:
            wave = waves[left] if left < len(waves) else 0.0
            before = s.energy
            send(s, slot, wave)
            post(
                run.network, way, table, 0, DAYS, s, Receiver(), left * slot_ns, slot_ns, now,
                period_ns,
            )  # fmt: skip
            run.sent.append(wave)
            run.income += apart(s.energy, before)
            left += 1
        deliver(run.network, table, 0, DAYS, now, r, p, ring, 0, places, repeated)
        before = r.spent
        run.given.append(tick(r, p, ring, 0, places))
        run.spent += apart(r.spent, before)
        run.least = min(run.least, funds_of(r, p), run.income - run.spent + p.reserve)
        look(run)
    return run
