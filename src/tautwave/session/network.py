"""What `check` reports on the network between both sides: its faults, its receivers, its delays."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from tautwave.config import Link, Rig
from tautwave.config.keys.common import AUTO
from tautwave.laws.receiver import RESERVE
from tautwave.rig import coupling_part, line_delay
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]


def link_of(rig: Rig) -> Link:
    """Return the link of a rig that has one."""
    assert rig.link is not None
    return rig.link


def network_words(rig: Rig) -> str:
    """Say what a network does to packets: at a site, what the rig takes the real one to be."""
    words = _simulated(link_of(rig))
    return words if rig.site is None else f"the real network; delays assumed as in: {words}"


def _simulated(link: Link) -> str:
    if link.trace is not None:
        return f"as recorded in {Path(link.trace).name}, again and again"
    words = [f"{1e3 * link.delay_s:.4g} ms each way"]
    if link.jitter_s:
        words.append(f"{link.jitter} jitter of {1e3 * link.jitter_s:.4g} ms")
    if link.loss:
        burst = f" in bursts of {link.burst:g}" if link.burst > 1.0 else ""
        words.append(f"{link.loss:.3g} lost{burst}")
    if link.duplicate:
        words.append(f"{link.duplicate:.3g} twice")
    if link.outage_s:
        every = f" every {link.outage_every_s:g} s" if link.outage_every_s else ""
        words.append(f"an outage of {link.outage_s:g} s after {link.outage_at_s:g} s{every}")
    return ", ".join(words)


def receiver_words(rig: Rig) -> str:
    """Say how waves are played out, and what happens where none come."""
    link = link_of(rig)
    if coupling_part(rig).carries != "waves":
        words = "the newest state of the other side is used"
    elif link.play_out == "newest":
        words = "the newest packet is played out"
    elif link.depth_s == AUTO:
        words = f"played out as deep as 99 % of the delays need, up to {1e3 * link.deepest_s:g} ms"
    else:
        words = f"played out {1e3 * float(link.depth_s):g} ms behind the earliest arrival"
    return (
        f"{words}; hold after {link.silence_s:g} s without a packet, stop after {link.lost_s:g} s"
    )


def network_facts(rig: Rig, delays: Delays) -> Iterator[tuple[str, str]]:
    """Yield what `check` says of a network: what it does, its receivers, where the delays go."""
    yield "network", network_words(rig)
    yield "receivers", receiver_words(rig)
    for name in rig.coupling.pairs:
        parts = delay_budget(rig, name, delays)
        each = " + ".join(
            f"{1e3 * part:.4g} {what.replace('_', '-')}" for what, part in parts.items()
        )
        yield f"delay of {name}", f"{1e3 * sum(parts.values()):.4g} ms each way = {each}"


def link_claims(rig: Rig, name: str, delays: Delays) -> dict[str, Any]:
    """Return for the summary the reserve of each receiver [J], and where the delay goes [s]."""
    if rig.link is None:
        return {}
    return {"receiver_j": RESERVE, "delay_budget_s": delay_budget(rig, name, delays)}


def delay_budget(rig: Rig, name: str, delays: Delays) -> dict[str, float]:
    """Return the parts [s] of `tautwave.rig.one_way_delay`, means of both sides.

    sensing: a wave describes the period before; bus: samples wait for a slow one's slot; link and
    play_out: as expected of the network; command: until one acts. What a cycle computes fits into
    its period: the next one begins on time or is counted as late.
    """
    period, line = rig.period_s, line_delay(rig)
    bus = command = 0.0
    for side in ("master", "slave"):
        axis_name = f"{side}.{name}"
        late = delays[axis_name]
        bus += (rig.axis_divisor(axis_name) - 1) * period
        command += 0.5 * (late.periods * rig.axis_period_s(axis_name) + late.remainder_s)
    return {
        "sensing": period,
        "bus": bus,
        "link": line.way * period,
        "play_out": line.play_out * period,
        "command": command,
    }
