"""Random days of an operated rig: `python -m tests.runtime.sequences 1000 [linked]`."""

from __future__ import annotations

import itertools
import random
import sys
from typing import NamedTuple

import numpy as np

from tautwave.config import load_rig
from tautwave.rig.ways import command_delays
from tautwave.runtime.operate import states as st
from tautwave.runtime.operate.commands import WORDS
from tautwave.runtime.operate.operated import OperatedControl
from tautwave.session.facts import port_claims
from tautwave.session.scales import greatest, scales_of
from tests.runtime.operating import BARE, BENCH, Operated, bench, operate

NETWORK = BENCH.with_name("network-loopback.yaml")
SECONDS = 2.0
COMMANDS = 10
ALIGNED = (
    "coupling.pairs.lever.offset=0.2", "coupling.pairs.lever.engage_tolerance=0.01",
    "slave.axes.lever.coulomb={value: 4e-3, lower: 3e-3, source: identified}",
    "simulation.axes.slave.lever.coulomb=4e-3",
)  # fmt: skip
STALLS = ("simulation.faults.overrun_probability=0.004", "simulation.faults.overrun_slots=8")
LOSSES = ("simulation.faults.missing_probability=0.25", "loop.missing_limit=5")
COUNTS = ("rate_hz=250", "loop.overrun_limit=6", "coupling.pairs.lever.wave_filter_hz=25")


class Day(NamedTuple):
    """What one sequence came to."""

    done: Operated
    residual: float
    flow: float
    given: float
    granted: float
    effort: float
    allowed: float


def random_day(seed: int, *, linked: bool = False) -> Day:
    """Run one seeded sequence: with or without alignment, stalls of the host, lost samples.

    `linked`: over a simulated network that delays, loses and repeats, and is silent for a while.
    """
    draw = random.Random(seed)
    times = sorted(draw.uniform(0.0, SECONDS) for _ in range(COMMANDS))
    words = ("engage", *WORDS[:4], "scale 0.5", "scale 1")
    script = "\n".join(f"{at:.3f} {draw.choice(words)}" for at in times)
    hand = f"[[0, 0], [1, 0], [1.5, {draw.uniform(-0.6, 0.6):.3f}], [2, 0]]"
    keys = [f"simulation.hand.lever.reference={{type: minimum_jerk, waypoints: {hand}}}"]
    delay_s = draw.choice((0.0, 0.02, 0.04))
    line = [f"coupling.delay_s={delay_s}", "operate.scales=[0.5]"]
    if linked:
        silence = f"outage_at_s: {draw.uniform(0.0, 0.5):.3f}, outage_s: 0.2, lost_s: 1"
        way = f"delay_s: {delay_s}, jitter_s: 0.02, loss: 0.2, duplicate: 0.05, depth_s: 0.02"
        line = [f"link={{{way}, {silence}}}", "operate={}"]
    keys += [*BARE, *COUNTS, *line]
    for faults in (ALIGNED, STALLS, LOSSES):
        keys += faults if draw.random() < 0.4 else ()
    share = f"hold_effort_share={draw.choice((0, 0.1, 0.5))}"
    keys += [f"sites.{share}" if linked else f"operate.{share}"]
    keys += [f"seed={seed}", f"duration_s={SECONDS}"]
    rig = load_rig(NETWORK, keys) if linked else bench(*keys)
    done = operate(rig, script, SECONDS)
    state = done.columns["operation.state"]
    aligning = state == float(st.STATES.index(st.ALIGNING))
    control: OperatedControl = done.control
    delays = command_delays(rig)
    claims = greatest([port_claims(one, "lever", delays) for one in (rig, *scales_of(rig))])
    claimed = sum(claims["claim_j"].values())
    budget = control.alignment.granted + control.granted + control.holds.granted_to_all()
    budget += control.journal.engagements * claimed
    taken = done.columns["master.lever.port_energy"] + done.columns["slave.lever.port_energy"]
    pulls = [params.law.effort for params in control.operation.pulls.values()]
    return Day(
        done,
        float(np.abs(done.residual()).max()),
        float(done.columns["master.lever.gross_flow"][-1]),
        float(-taken.min()),
        budget,
        float(np.abs(done.columns["slave.lever.commanded"][aligning]).max(initial=0.0)),
        max(pulls, default=0.0),
    )


def judge(day: Day, *, linked: bool = False) -> None:
    """Books closed, nothing given beyond what was granted, no way outside the table.

    `linked`: to the quanta of a network's counters.
    """
    assert day.done.result.error is None, day.done.result.error
    assert day.residual <= (1e-9 if linked else 1e-11 * (day.flow + 1e-3)), day.residual
    assert day.given <= day.granted, (day.given, day.granted)
    ways = {(a, b) for (a, _), b in st.TRANSITIONS.items()} | {(s, s) for s in st.STATES}
    codes = [st.STATES[int(code)] for code in day.done.columns["operation.state"]]
    twice = {(a, c) for a, b in ways for b2, c in ways if b == b2}
    assert set(itertools.pairwise(codes)) <= twice


def main(count: int, *, linked: bool = False) -> None:
    """Run many, and print what they came to."""
    residual = given = 0.0
    engaged = faults = 0
    for seed in range(count):
        day = random_day(seed, linked=linked)
        judge(day, linked=linked)
        residual = max(residual, day.residual)
        given = max(given, day.given / day.granted)
        journal = day.done.control.journal
        engaged += journal.engagements
        faults += sum(entry.word == "fault" for entry in journal.entries)
    print(
        f"{count} sequences, {engaged} engagements, {faults} faults: residual at most "
        f"{residual:.2g} J, given out at most {given:.2g} of what was granted"
    )


if __name__ == "__main__":
    main(int(sys.argv[1]), linked="linked" in sys.argv)
