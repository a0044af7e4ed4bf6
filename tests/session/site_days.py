"""Random days of two operated sites: `python -m tests.session.site_days 1000`."""

from __future__ import annotations

import random
import sys
from typing import NamedTuple

from tautwave.rig.ways import command_delays
from tautwave.runtime.operate import states as st
from tautwave.session.facts import port_claims
from tautwave.session.sites.agreed import with_sessions
from tautwave.summary import checked
from tautwave.summary.model import Pair as Ends
from tautwave.summary.model import Session, Site
from tests.session.sites import Half, Pair

SLOTS = 450
WORDS = ("engage", "engage", "engage", "clutch", "hold", "rest")
COUNTS = ("rate_hz=250", "loop.overrun_limit=6", "coupling.pairs.lever.wave_filter_hz=25",
          "link.silence_s=0.1", "sites.wait_s=1", "operate={}")  # fmt: skip
PLACES = ("coupling.pairs.lever.offset=0.1", "coupling.pairs.lever.engage_tolerance=0.01",
          "sites.align_speed=0.5", "sites.align_acceleration=3")  # fmt: skip
FREE = "simulation.environment.lever={type: free}"


class Day(NamedTuple):
    """What one sequence came to at both sites."""

    two: Pair
    residual: float
    given: float
    commands: int


def random_day(seed: int, slots: int = SLOTS) -> Day:
    """Run one: both persons command, packets and messages are late or lost, hosts stall."""
    draw = random.Random(seed)
    way = f"[[0, 0], [0.6, 0], [1.2, {draw.uniform(-0.4, 0.4):.3f}], [2, 0]]"
    hand = f"simulation.hand.lever.reference={{type: minimum_jerk, waypoints: {way}}}"
    keys = [*COUNTS, f"seed={seed}", hand]
    keys += PLACES if draw.random() < 0.4 else ()
    keys += [FREE] if draw.random() < 0.5 else ()
    keys += [f"sites.hold_effort_share={draw.choice((0, 0.1, 0.5))}"]
    two = Pair(*keys)
    most = draw.choice((0, 2, 30))
    two.lag = lambda: draw.randrange(most + 1)
    cut, commands = 0, 0
    two.master.ask("engage")
    for _ in range(slots):
        for half in (two.master, two.slave):
            if draw.random() < 0.015:
                half.ask(draw.choice(WORDS))
                commands += 1
        if draw.random() < 0.002:
            cut = draw.choice((10, 60))
        if draw.random() < 0.001:
            two.renew("the connection was lost")
        if draw.random() < 0.003:
            half = draw.choice((two.master, two.slave))
            two.run(draw.choice((3, 12)), two.slave if half is two.master else two.master)
        cut -= 1
        two.run(1, cut=cut > 0)
    # Every word arrives, and is repeated where it was lost; an alignment may end in a hold, too.
    two.until(lambda: two.master.control._accord == two.slave.control._accord, 300)
    residual = max(half.residual() for half in (two.master, two.slave))
    given = max(_given(half) for half in (two.master, two.slave))
    two.close()
    return Day(two, residual, given, commands)


def _given(half: Half) -> float:
    """Return what a site gave out, as a share of what it claims with all that was granted."""
    claims = port_claims(half.rig, "lever", command_delays(half.rig))
    claimed = of_all_sessions(half, claims["claim_j"][half.side])
    taken = half[f"{half.side}.lever.port_energy"]
    return float(-taken.min()) / claimed


def of_all_sessions(half: Half, claim: float) -> float:
    """Return what an end claims over all sessions of a site [J], with what was granted."""
    done = half.control.summary()
    site = Site(
        site=half.side,
        sessions=tuple(checked(Session, session) for session in done["sessions"]),
        granted_j=done["granted_j"],
    )
    pairs = with_sessions({"lever": Ends(claim_j={half.side: claim})}, site)
    found = pairs["lever"].claim_j[half.side]
    assert found is not None
    return found


def judge(day: Day) -> None:
    """Books closed, nothing given beyond what was granted, no way outside the table, one accord."""
    two = day.two
    assert day.residual < 1e-9, day.residual
    assert day.given <= 1.0, day.given
    one, other = (half.control._accord for half in (two.master, two.slave))
    assert one == other, (one, other)
    for half in (two.master, two.slave):
        assert half.control.error() is None, half.control.error()
        at = half.control.columns.index("link.slot")
        state = half.control.columns.index("operation.state")
        engaged = {row[state] for row in half.rows if row[at] >= 0}
        assert engaged <= {float(st.STATES.index(st.ENGAGED))}


def main(count: int, first: int = 0) -> None:
    """Run many, and print what they came to."""
    residual = given = 0.0
    engaged = commands = lost = faults = 0
    for seed in range(first, first + count):
        day = random_day(seed)
        try:
            judge(day)
        except AssertionError:
            print("seed", seed)
            raise
        residual, given = max(residual, day.residual), max(given, day.given)
        commands += day.commands
        for half in (day.two.master, day.two.slave):
            journal = half.control.journal
            engaged += journal.engagements
            lost += sum(entry.word == "lost" for entry in journal.entries)
            faults += sum(entry.word == "fault" for entry in journal.entries)
    print(
        f"{count} sequences, {commands} commands, {engaged} engagements, {lost} losses, "
        f"{faults} faults: residual at most {residual:.2g} J, given out at most {given:.2g} of "
        "what was granted"
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
