"""Two operated sites whose devices are moved by who wants their energy.

Each site has the certificate of the rig, and a world of its own (`tests.certificate.worlds`) at
its driver: the persons command at random, words and packets are late or lost, hosts stall. What
both motors gave together, in the master's units, is set against what both ends claim over all
their sessions.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Callable
from typing import NamedTuple

from tautwave.certificate import certify
from tautwave.rig import pair_scale
from tautwave.rig.ways import command_delays
from tautwave.session.facts import stated_claims
from tests.certificate.adversaries import Draw
from tests.certificate.foes import mass_of
from tests.certificate.worlds import Mover, World
from tests.session.site_days import of_all_sessions
from tests.session.sites import Half, Pair

WORDS = ("engage", "engage", "engage", "clutch", "hold", "rest")
STILL = ("aligning", "idle", "clutched")
"""States in which the devices come to rest: a pair engages at rest."""


class Got(NamedTuple):
    """The most that both motors gave in all, what is stated for it [J], and how often engaged."""

    given: float
    claimed: float
    engaged: int

    @property
    def share(self) -> float:
        return self.given / self.claimed


def keys_of(seed: int) -> list[str]:
    """Return changes of the rig, as unlike as its ends may be."""
    draw = Draw(seed)
    pair, keys = "coupling.pairs.lever", ["rate_hz=500", "loop.overrun_limit=6", "operate={}"]
    keys += ["link.silence_s=0.1", "sites.wait_s=1", "coupling.release_ramp_s=0.05"]
    keys += [
        f"{pair}.wave_impedance={draw.magnitude(0.005, 0.3)}",
        f"{pair}.wave_filter_hz={draw.magnitude(8.0, 60.0)}",
        f"coupling.engage_ramp_s={draw.among(0.0, 0.05, 0.2)}",
        f"sites.hold_effort_share={draw.among(0.0, 0.1, 0.5)}",
    ]
    if draw.among(True, False):
        keys += [f"{pair}.position_scale={draw.magnitude(0.3, 3.0)}"]
        keys += [f"{pair}.force_scale={draw.magnitude(0.3, 3.0)}"]
    for side in ("master", "slave"):
        keys += [
            f"{pair}.pole_{side}={draw.among('plain', 0.3, 0.5)}",
            f"{side}.axes.lever.position_noise=0",
            f"{side}.axes.lever.velocity_limit={draw.magnitude(3.0, 30.0)}",
            f"{side}.axes.lever.effort_limit={draw.magnitude(0.3, 3.0)}",
        ]
    return keys


def meet(seed: int, slots: int, *, faults: bool, reserve: float = 1.0) -> Got | None:
    """Attack one pair; None if it is not certified. `reserve`: times what the tanks hold."""
    two = Pair(*keys_of(seed))
    try:
        passed = [certify(half.rig, brief=True).verdicts["passive"].passed for half in sites(two)]
        return _attack(two, seed, slots, faults, reserve) if all(passed) else None
    finally:
        two.close()


def sites(two: Pair) -> tuple[Half, Half]:
    return two.master, two.slave


def _resting(half: Half, mover: Mover) -> Callable[..., None]:
    """Return a slot's motion that knows what the operator's state asks for."""
    move = mover.pass_slot

    def pass_slot(*, calm: bool) -> None:
        move(calm=calm or not half.rows or half.state in STILL)

    return pass_slot


def _attack(two: Pair, seed: int, slots: int, faults: bool, reserve: float) -> Got:
    draw = random.Random(seed)
    late, cut = draw.choice((0, 2, 30)) if faults else 0, 0
    two.lag = lambda: draw.randrange(late + 1)
    power = pair_scale(two.master.rig.coupling.pairs["lever"]).power
    ends: list[tuple[Half, Mover, float]] = []
    for half, weight in zip(sites(two), (1.0, 1.0 / power), strict=True):
        for which, p in enumerate(half.control.params):
            port = p.end.port._replace(reserve=reserve * p.end.port.reserve)
            half.control.retune(which, p._replace(end=p.end._replace(port=port)))
        name = f"{half.side}.lever"
        devices = {name: mass_of(half.rig, name)}
        mover = World(half.rig, half.built, devices, Draw(2 * seed + len(ends))).movers[name]
        mover.pass_slot = _resting(half, mover)  # type: ignore[method-assign]
        ends.append((half, mover, weight))
    most = 0.0
    two.master.ask("engage")
    for _ in range(slots):
        for half, _, _ in ends:
            if draw.random() < 0.006:
                half.ask(draw.choice(WORDS))
            if half.rows and half.state in ("idle", "holding") and draw.random() < 0.05:
                half.ask("engage")
        if faults and draw.random() < 0.003:
            cut = draw.choice((10, 60))
        if faults and draw.random() < 0.001:
            two.renew("the connection was lost")
        if faults and draw.random() < 0.003:
            two.run(draw.choice((3, 6)), draw.choice(sites(two)))
        cut -= 1
        two.run(1, cut=cut > 0)
        most = max(most, sum(weight * mover.given for _, mover, weight in ends))
    claimed = 0.0
    for half, _, weight in ends:
        claims = stated_claims(half.rig, "lever", command_delays(half.rig), {})
        stated = claims[f"{half.side}.lever"][0]
        claim = stated.claim_j if faults else stated.prompt_j
        claimed += weight * of_all_sessions(half, claim)
    return Got(most, claimed, min(half.control.journal.engagements for half in sites(two)))


if __name__ == "__main__":
    for number in range(*map(int, sys.argv[1:3])):
        found = meet(number, 800, faults=number % 2 == 1)
        if found is not None:
            print(number, f"{found.share:.3g}", found, flush=True)
