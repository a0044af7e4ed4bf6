"""`tautwave bench link`: sealed packets against bare datagrams in two loops, and two runs."""

from __future__ import annotations

import json
import secrets
import subprocess
import sys
from collections.abc import Callable
from typing import Any

from tautwave.bench.result import Goal, Suite, Table
from tautwave.bench.sites.order import Order, free_port
from tautwave.bench.sites.runs import SIDES, grown, run_sites
from tautwave.bench.suites import silent

FIGURES = ("p50", "p99", "p999", "max")
ROWS = {
    "sealed packet, one way": "sealed",
    "bare datagram, one way": "bare",
    "write, seal and send": "sealing",
    "send bare": "sending",
    "late, with network": "late_with",
    "late, without": "late_without",
    "late, with a stranger's, too": "late_hostile",
}


def link(
    *, duration_s: float = 20.0, rate_hz: float = 1000.0, tell: Callable[[str], None] = silent
) -> Suite:
    """Run two loops in two processes, compare what they exchange, and run a rig's two sites.

    Parameters
    ----------
    duration_s, rate_hz : float
        For how long [s] each, and of all loops [Hz].
    tell : callable
        Called with what is being measured.

    Raises
    ------
    LinkError
        A run of a site did not end as it should.
    """
    tell(f"two loops at {rate_hz:g} Hz for {duration_s:g} s")
    ports = [(free_port(), free_port()), (free_port(), free_port())]
    session, secret = secrets.token_hex(8), secrets.token_hex(32)
    orders = [
        Order(side, ports[side], ports[1 - side], session, secret, rate_hz, duration_s)
        for side in (0, 1)
    ]
    children = [
        subprocess.Popen(
            [sys.executable, "-m", "tautwave.bench.sites.ends"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        for _ in orders
    ]
    for child, order in zip(children, orders, strict=True):
        assert child.stdin is not None
        child.stdin.write(json.dumps(order._asdict()).encode())
        child.stdin.close()
        child.stdin = None
    stranger = subprocess.Popen(
        [sys.executable, "-m", "tautwave.bench.sites.stranger", session, str(duration_s),
         *(str(own[0]) for own in ports)],
        stdout=subprocess.PIPE,
    )  # fmt: skip
    ends: list[dict[str, Any]] = [json.loads(child.communicate()[0]) for child in children]
    hostile = int(stranger.communicate()[0])
    tables = [
        Table(
            f"{name}'s loop [us]",
            "Both kinds are sent and asked for in the same cycles, in turn first; a way includes "
            "opening, and the wait until the other loop looks, at any moment of a slot alike. "
            "Lateness without network, with it, and with a stranger's datagrams as well in turn, "
            f"0.2 s each. The stranger sent {hostile:,}; {end['refused']:,} were refused here. "
            f"{'; '.join(end['realtime'])}.",
            ("", *FIGURES),
            [(row, *(end[key][figure] for figure in FIGURES)) for row, key in ROWS.items()],
        )
        for name, end in zip(("one", "other"), ends, strict=True)
    ]

    tell(f"two sites at {rate_hz:g} Hz for {duration_s:g} s")
    runs = run_sites(duration_s, rate_hz)
    tables += [
        Table(
            f"The {side}'s run [us]",
            "`tautwave run --site` of the example network-loopback, recording and all. One way is "
            "by clocks that are known to half a round trip. "
            f"{run['sessions']} session, {run['silences']} silences, {run['dropped']} rows lost, "
            f"{max(run['memory'], default=0) / 1e6:.0f} MB resident.",
            ("", *FIGURES),
            [
                ("late", *(run["late"][figure] for figure in FIGURES)),
                ("packets, one way", *(run["delay"][figure] for figure in FIGURES)),
            ],
        )
        for side, run in zip(SIDES, runs, strict=True)
    ]

    def worst(above: str, below: str, figure: str) -> float:
        return max(float(end[above][figure]) / float(end[below][figure]) for end in ends)

    def together(above: str, below: str, figure: str) -> float:
        """Return the ratio of both loops' means: a host's stalls hit one of them, now and then."""
        over, under = (sum(float(end[key][figure]) for end in ends) for key in (above, below))
        return over / under

    accepted = sum(
        max(0, one["accepted"] - other["sent"]) for one, other in zip(ends, ends[::-1], strict=True)
    )
    more = max(end["memory"][-1] - end["memory"][min(1, len(end["memory"]) - 2)] for end in ends)
    goals = [
        Goal("sealed against bare, one way, p50", 1.5, "", worst("sealed", "bare", "p50")),
        Goal("sealed against bare, one way, p99", 1.5, "", worst("sealed", "bare", "p99")),
        Goal("lateness with network against without, p99", 1.1, "",
             together("late_with", "late_without", "p99")),
        Goal("lateness with a stranger's against without, p99", 1.1, "",
             together("late_hostile", "late_without", "p99")),
        Goal("hostile datagrams accepted", 0.0, "", float(accepted)),
        Goal("loops: resident memory grown", 0.1, "MB", more / 1e6),
        Goal("runs: resident memory grown", 1.0, "MB", max(grown(run["memory"]) for run in runs)),
        Goal("runs: rows lost", 0.0, "", float(sum(run["dropped"] for run in runs))),
    ]  # fmt: skip
    return Suite("link", tables, goals)
