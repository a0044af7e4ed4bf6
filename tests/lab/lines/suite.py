"""`python -m tests.lab network`: random patterns and chosen ones, with each receiver."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.models.network import SPIKES, NetworkParams, network_params
from tests.lab.lines.many import CLEAN, OURS, Tally, run_many
from tests.lab.lines.patterns import (
    NOISE,
    QUANTUM,
    RECEIVERS,
    Outcome,
    Pattern,
    run_pattern,
)

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
HELD = {
    "30 %, jitter, 5 % twice": WAYS["30 %, jitter, 5 % twice"],
    "outage 0.5 s": network_params(DELAY, outage_at=5.0, outage=0.5),
}
"""Networks on which a force is held, beside a clean one."""
FEWEST_FREE = 50
"""Patterns that are free, for a median of their errors."""
AT_REST = 5e-5
"""Error [rad] to which both devices shall agree at rest, with noise."""
COULOMB = 1e-3
"""Dry friction of either device [N m], where there is some."""
MAKERS = {"hold-last": 0.5, "null packets": 0.02, "fixed buffer": 0.02}
"""Least share of patterns in which another receiver makes energy: so the test can fail."""


def silent(_: str) -> None:
    """Say nothing about progress."""


def chosen_pattern(way: NetworkParams, *, hold: bool = False, offset: float = 0.0) -> Pattern:
    """Return the bench's device with a hand on it for 3 s and still for 3 s.

    With `hold` the hand pushes against a stiff wall instead, for two minutes.
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
        end=120.0 if hold else 6.0,
        seed=1,
    )


def network(
    *,
    patterns: int = 1000,
    first: int = 0,
    hour: bool = False,
    jobs: int = 1,
    keep: Path | None = None,
    tell: Tell = silent,
) -> Suite:
    """Run pairs over random networks and over chosen ones.

    Parameters
    ----------
    patterns : int
        Random patterns for each receiver of ours; of the others `many.MOST` will do.
    first : int
        Seed of the first one.
    hour : bool
        Move a pair for an hour, too.
    jobs : int
        Processes for the random patterns.
    keep : Path, optional
        File of what is done of them.
    tell : callable
        Called with the name of each measurement as it starts.

    Raises
    ------
    ConfigError
        `keep` is another file, or cannot be written.
    """
    found = run_many(first, patterns, jobs=jobs, keep=keep, tell=tell)
    tell("chosen patterns")
    chosen = {
        name: {title: run_pattern(chosen_pattern(way), name)[0] for title, way in WAYS.items()}
        for name in RECEIVERS
    }
    dry = [chosen_pattern(way)._replace(coulomb=COULOMB) for way in WAYS.values()]
    stuck = max(run_pattern(x)[0].rest / _allowed(x) for x in dry)
    tell("a force held for two minutes")
    held = [_held_row("clean", offset) for offset in (0.0, 100e-6, -100e-6)]
    held += [_held_row(title) for title in HELD]
    after: list[list[Value]] = []
    if hour:
        tell("an hour")
        after = [_hour_row(*of) for of in ((False, 0.0), (True, 0.0), (True, COULOMB))]
    lossy, clean = (chosen["play-out"][title] for title in ("30 %, jitter, 5 % twice", "clean"))
    roughness = lossy.chatter / clean.chatter
    worst = max(o.rest for o in chosen["play-out"].values())
    return Suite(
        "network",
        [
            _random_table(found),
            *(
                _chosen_table(title, {name: chosen[name][title] for name in RECEIVERS})
                for title in WAYS
            ),
            Table(
                "A force held for two minutes",
                "play-out, 10 ms and what is named, the slave's clock slower by the offset; effort "
                "at the master in the last 0.2 s of the 3rd and of the 120th second. Silence lets "
                "both devices go, and what they lose on the way nobody gives back: both ends owe "
                "motion until the hand gives way",
                ("network", "offset_ppm", "force_3_s", "force_120_s", "violations"),
                held,
            ),
            *([_hour_table(after)] if hour else []),
        ],
        [
            Goal(
                "ticks on which more came out than in",
                0.0,
                "",
                float(sum(found[name].violations for name in OURS)),
            ),
            Goal("chatter at 30 % loss and jitter over clean", 1.15, "", roughness),
            Goal("error 3 s after the hand rests, worst", 1e3 * AT_REST, "mrad", 1e3 * worst),
            Goal("and with dry friction, over c tau / b and an encoder step", 1.0, "", stuck),
            *(
                Goal(f"{name} makes energy, share", least, "", _makers(found[name]), at_least=True)
                for name, least in MAKERS.items()
            ),
            Goal(
                "error at rest over that of clean lines, median",
                1.0,
                "",
                _settled(found),
                why_not=f"fewer than {FEWEST_FREE} patterns are free: take 1,000",
            ),
        ],
    )


def _makers(found: Tally) -> float:
    return found.makers / found.patterns


def _settled(found: dict[str, Tally]) -> float | None:
    own, clean = found["play-out"].rest, found[CLEAN].rest
    if len(clean) < FEWEST_FREE:
        return None
    return float(np.median(own[: len(clean)]) / np.median(clean))


def _random_table(found: dict[str, Tally]) -> Table:
    rows: list[list[Value]] = []
    for name, tally in found.items():
        if not tally.patterns:
            continue
        rest = (1e3 * float(error) for error in np.quantile(tally.rest or (0.0,), (0.5, 0.99)))
        ours = name != CLEAN
        rows.append(
            [
                name,
                tally.patterns,
                *((tally.violations, _makers(tally)) if ours else (None, None)),
                *((tally.excess, tally.made) if ours else (None, None)),
                *rest,
            ]
        )
    return Table(
        "Random patterns",
        "delay to 100 ms, jitter to 50 ms (even, exponential, spikes), loss to 50 % in bursts to "
        "20, duplicates, outages to 0.4 s, clocks to 200 ppm apart, 2 kHz and 500 Hz, b 0.02 to "
        "0.1, free, wall or spring, with noise and without, depth to 50 ms, to 7 slots repeated. "
        "excess_j: most that came out of a receiver beyond what was sent and its reserve; made_j: "
        "most that both ports gave the devices, out of reserves of up to 0.1 J; rest: "
        "error 10 s after the hand rests, free and without Coulomb friction; clean lines have the "
        "mean delay of each such network, and nothing else of it",
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


def _allowed(x: Pattern) -> float:
    """Return the error at rest [rad] that friction c explains, and a step of the encoder.

    It holds an effort up to c, which stands on a line of delay tau by c tau / b.
    """
    return QUANTUM + x.coulomb * (DELAY + x.depth + x.periods[0]) / x.impedance


def _hour_row(noisy: bool, coulomb: float) -> list[Value]:
    way, depth = network_params(DELAY, jitter=0.02, loss=0.05), 0.025
    x = chosen_pattern(way, offset=50e-6)._replace(
        depth=depth,
        noise=NOISE * noisy,
        quantum=QUANTUM * noisy,
        coulomb=coulomb,
        rest=3590.0,
        end=3600.0,
    )
    result, _ = run_pattern(x)
    allowed = AT_REST if noisy and not coulomb else _allowed(x)
    found = 1e3 * result.rms, 1e3 * result.rest, 1e3 * allowed, result.violations
    return [1e6 * x.noise, 1e3 * coulomb, *found]


def _hour_table(rows: list[list[Value]]) -> Table:
    return Table(
        "An hour of motion",
        "play-out with a depth of 25 ms, 5 % loss, 20 ms of jitter, clocks 50 ppm apart; error "
        "while the hand moves, and at the end of 10 s of rest; allowed is an encoder step, with "
        "noise 0.05 mrad, and c tau / b more with dry friction c",
        ("noise_urad", "coulomb_mNm", "rms_mrad", "rest_mrad", "allowed_mrad", "violations"),
        rows,
    )


def _held_row(title: str, offset: float = 0.0) -> list[Value]:
    way = HELD.get(title, WAYS["clean"])
    result, rows = run_pattern(chosen_pattern(way, hold=True, offset=offset))
    early = rows[(rows_at := round(2.8 / 0.5e-3)) : rows_at + 400, 2]
    return [title, 1e6 * offset, float(np.mean(early)), result.force, result.violations]
