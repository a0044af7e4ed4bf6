"""`tautwave bench network`: random patterns and chosen ones, with each receiver."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tautwave.bench.lines.patterns import (
    NOISE,
    QUANTUM,
    RECEIVERS,
    Outcome,
    Pattern,
    draw_pattern,
    run_pattern,
)
from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.models.network import SPIKES, NetworkParams, network_params

Tell = Callable[[str], None]

DELAY = 0.01
WAYS = {
    "clean": network_params(DELAY),
    "jitter 5 ms": network_params(DELAY, jitter=0.005),
    "loss 10 %": network_params(DELAY, loss=0.1),
    "10 % in bursts of 5": network_params(DELAY, loss=0.1, burst=5.0),
    "30 %, jitter, 5 % twice": network_params(DELAY, loss=0.3, jitter=0.005, duplicates=0.05),
    "spikes of 20 ms, 2 %": network_params(DELAY, jitter=0.02, kind=SPIKES),
    "outage 0.5 s": network_params(DELAY, outage_at=1.2, outage=0.5),
}
MADE = 1e-9
"""Energy [J] from which on a receiver counts as having made some."""


def silent(_: str) -> None:
    """Say nothing about progress."""


def chosen_pattern(way: NetworkParams, *, hold: bool = False, offset: float = 0.0) -> Pattern:
    """Return the bench's device with a hand on it for 3 s and still for 3 s.

    With `hold` the hand pushes against a stiff wall instead, for a minute.
    """
    return Pattern(
        periods=(0.5e-3, 0.5e-3),
        offset=offset,
        ways=(way, way),
        impedance=0.1,
        depth=0.006,
        repeated=3,
        corner=200.0,
        level=1e-3,
        wall=200.0 if hold else 0.0,
        wall_at=0.02,
        coulomb=0.0,
        noise=NOISE,
        quantum=QUANTUM,
        push=0.1 if hold else 0.0,
        rest=3.0,
        end=60.0 if hold else 6.0,
        seed=1,
    )


def network(
    *, patterns: int = 1000, first: int = 0, hour: bool = False, tell: Tell = silent
) -> Suite:
    """Run pairs over random networks and over chosen ones.

    Parameters
    ----------
    patterns : int
        Random patterns for each receiver.
    first : int
        Seed of the first one.
    hour : bool
        Move a pair for an hour, too.
    tell : callable
        Called with the name of each measurement as it starts.
    """
    found: dict[str, list[Outcome]] = {}
    drawn = [draw_pattern(seed) for seed in range(first, first + patterns)]
    for name in RECEIVERS:
        tell(f"{patterns} random patterns: {name}")
        found[name] = [run_pattern(x, name)[0] for x in drawn]
    tell("chosen patterns")
    chosen = {
        name: {title: run_pattern(chosen_pattern(way), name)[0] for title, way in WAYS.items()}
        for name in RECEIVERS
    }
    tell("a force held for a minute")
    held = [_held_row(offset) for offset in (0.0, 100e-6, -100e-6)]
    after: list[list[Value]] = []
    if hour:
        tell("an hour")
        after = [_hour_row(noisy) for noisy in (False, True)]
    lossy, clean = (chosen["play-out"][title] for title in ("30 %, jitter, 5 % twice", "clean"))
    roughness, makers = lossy.chatter / clean.chatter, _makers(found["hold-last"])
    worst = max(o.rest for o in chosen["play-out"].values())
    return Suite(
        "network",
        [
            _random_table(found, drawn),
            *(
                _chosen_table(title, {name: chosen[name][title] for name in RECEIVERS})
                for title in WAYS
            ),
            Table(
                "A force held for a minute",
                "play-out, clean line of 10 ms, the slave's clock slower by the offset; effort at "
                "the master in the last 0.2 s of the 3rd and of the 60th second",
                ("offset_ppm", "force_3_s", "force_60_s", "violations"),
                held,
            ),
            *([_hour_table(after)] if hour else []),
        ],
        [
            Goal("ticks on which more came out than in", 0.0, "", _violations(found["play-out"])),
            Goal("chatter at 30 % loss and jitter over clean", 1.15, "", roughness),
            Goal("error 3 s after the hand rests, worst", 0.05, "mrad", 1e3 * worst),
            Goal("hold-last makes energy, share", 0.5, "", makers, at_least=True),
        ],
    )


def _violations(found: list[Outcome]) -> float:
    return float(sum(o.violations for o in found))


def _makers(found: list[Outcome]) -> float:
    return float(np.mean([o.excess > MADE for o in found]))


def _random_table(found: dict[str, list[Outcome]], drawn: list[Pattern]) -> Table:
    free = [x.wall == 0.0 and x.coulomb == 0.0 for x in drawn]
    rows: list[list[Value]] = []
    for name, outcomes in found.items():
        rest = [1e3 * o.rest for o, counts in zip(outcomes, free, strict=True) if counts] or [0.0]
        rows.append(
            [
                name,
                len(outcomes),
                int(_violations(outcomes)),
                _makers(outcomes),
                max(o.excess for o in outcomes),
                max(o.made for o in outcomes),
                *(float(value) for value in np.quantile(rest, (0.5, 0.99))),
            ]
        )
    return Table(
        "Random patterns",
        "delay to 100 ms, jitter to 50 ms (even, exponential, spikes), loss to 50 % in bursts to "
        "20, duplicates, outages to 0.4 s, clocks to 200 ppm apart, 2 kHz and 500 Hz, b 0.02 to "
        "0.1, free, wall or spring, with noise and without, depth to 50 ms, to 7 slots repeated. "
        "excess_j: most that came out of a receiver beyond what was sent and its reserve; made_j: "
        "most that both ports gave the devices, out of reserves of up to 0.1 J; rest: "
        "error 2 s after the hand rests, free and without Coulomb friction",
        ("receiver", "patterns", "violations", "makers", "excess_j", "made_j", "rest_mrad_p50",
         "rest_mrad_p99"),
        rows,
    )  # fmt: skip


def _chosen_table(title: str, outcomes: dict[str, Outcome]) -> Table:
    return Table(
        f"Tracking: {title}",
        "free device, b 0.1, 10 ms each way and the impairment, depth 6 ms, 3 slots repeated: "
        "error while the hand moves (rms) and 3 s after it rests, standard deviation of the "
        "change of effort, greatest effort (limit 0.5 N m)",
        ("receiver", "rms_mrad", "rest_mrad", "chatter_mNm", "peak_Nm", "excess_j"),
        [
            [name, 1e3 * o.rms, 1e3 * o.rest, 1e3 * o.chatter, o.peak, o.excess]
            for name, o in outcomes.items()
        ],
    )


def _hour_row(noisy: bool) -> list[Value]:
    way = network_params(DELAY, jitter=0.02, loss=0.05)
    x = chosen_pattern(way, offset=50e-6)._replace(
        depth=0.025, noise=NOISE * noisy, quantum=QUANTUM * noisy, rest=3590.0, end=3600.0
    )
    result, _ = run_pattern(x)
    return [1e6 * x.noise, 1e3 * result.rms, 1e3 * result.rest, result.violations]


def _hour_table(rows: list[list[Value]]) -> Table:
    return Table(
        "An hour of motion",
        "play-out with a depth of 25 ms, 5 % loss, 20 ms of jitter, clocks 50 ppm apart; error "
        "while the hand moves, and at the end of 10 s of rest",
        ("noise_urad", "rms_mrad", "rest_mrad", "violations"),
        rows,
    )


def _held_row(offset: float) -> list[Value]:
    result, rows = run_pattern(chosen_pattern(WAYS["clean"], hold=True, offset=offset))
    early = rows[(rows_at := round(2.8 / 0.5e-3)) : rows_at + 400, 2]
    return [1e6 * offset, float(np.mean(early)), result.force, result.violations]
