"""`python -m tests.lab couplings`: laws bare and in an account, and rigs drawn at random."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tautwave.bench.result import Goal, Suite, Table, Value
from tests.lab.couplings.drawn import Tally, run_many
from tests.lab.couplings.measure import Outcome, run_coupling, stated_bound
from tests.lab.couplings.recorded import likenesses, median_ratio
from tests.lab.couplings.rigs import (
    CONTACTS,
    HAND,
    LAWS,
    bench_rig,
)

Tell = Callable[[str], None]

DELAYS = (0.0, 0.01, 0.05)
SECONDS = 5.0
SHORT_S = 0.6
OWN_ACCOUNT = ("wave", "wave_augmented")
"""Have accounts of their own, and stand in the table once."""


def silent(_: str) -> None:
    """Say nothing about progress."""


def couplings(
    *,
    rigs: int = 1000,
    first: int = 0,
    hand: Path | None = None,
    recordings: Path | None = None,
    quick: bool = False,
    jobs: int = 1,
    keep: Path | None = None,
    tell: Tell = silent,
) -> Suite:
    """Run every law on the laboratory's bench, and laws, rigs and delays drawn at random.

    Parameters
    ----------
    rigs : int
        How many are drawn, each bare and in an account.
    first : int
        Seed of the first one.
    hand : Path, optional
        CSV file with the column hand_reference [rad]; default: a multisine.
    recordings : Path, optional
        Folder of recorded hands, as for `python -m tests.lab port`: adds how credible the bench is.
    quick : bool
        One delay, 0.6 s each, nothing compiled.
    jobs : int
        Processes for the rigs that are drawn.
    keep : Path, optional
        File of those that are done, from which an interrupted run goes on.
    tell : callable
        Called with the name of each measurement as it starts.
    """
    reference = HAND
    if hand is not None:
        reference = f"{{type: recording, file: {hand.resolve()}, column: hand_reference}}"
    rows: list[list[Value]] = []
    share = 0.0
    engine = "python" if quick else "compiled"
    seconds = SHORT_S if quick else SECONDS
    for name in LAWS:
        for account in (False,) if name in OWN_ACCOUNT else (False, True):
            tell(f"{name}{', account' if account else ''}")
            for delay in DELAYS[1:2] if quick else DELAYS:
                for contact in CONTACTS:
                    rig = bench_rig(
                        name,
                        delay,
                        account=account,
                        contact=contact,
                        reference=reference,
                        seconds=seconds,
                    )
                    found = run_coupling(rig, engine=engine)
                    if account:
                        share = max(share, found.made / stated_bound(rig))
                    rows.append(
                        [name, "account" if account else "bare", *_cells(delay, contact, found)]
                    )
    drawn = _drawn_rows(run_many(first, rigs, engine, jobs=jobs, keep=keep, tell=tell))
    more, goals = _credible(recordings, tell)
    return Suite(
        "couplings",
        [
            Table(
                "Couplings on the bench",
                "The 1-DoF bench at 2 kHz with noise of 9e-5 rad, a hand for "
                f"{seconds:g} s. Tracking rms, "
                "standard deviation of the master's effort, rms of hand and contact together (0: "
                "the hand feels the contact alone), share of motion power above 8 Hz (worse "
                "side), and the most energy that both motors had given, in truth.",
                ("law", "as", "delay_ms", "contact", "error_mrad", "effort_mNm", "apart_mNm",
                 "above 8 Hz", "made_mJ", "ended"),
                rows,
            ),
            Table(
                "Rigs drawn at random",
                "Laws, gains, devices, limits, delays to 100 ms, command delays, noise, lost "
                "samples, skipped slots, hands and contacts; half a second each. The bound is what "
                "the certificate of the rig with an account states.",
                ("as", "rigs", "beyond the bound", "made_mJ", "share of the bound", "ended early"),
                drawn,
            ),
            *more,
        ],
        [
            Goal("rigs in an account beyond their bound", 0.0, "", float(drawn[0][2] or 0)),
            Goal("bare rigs beyond it", 1.0, "", float(drawn[1][2] or 0), at_least=True),
            Goal("energy made in an account, bench", 1.0, "of its bound", share),
            *goals,
        ],
    )  # fmt: skip


def _credible(recordings: Path | None, tell: Tell) -> tuple[list[Table], list[Goal]]:
    """Return the table of the laboratory's law on its own hands, and its goal."""
    if recordings is None:
        return [], []
    tell("the laboratory's law on its recorded hands")
    found = likenesses(recordings)
    table = Table(
        "The laboratory's law, recorded and simulated",
        "The gains of its controllers (a to f) in our law position, the master's motion imposed, "
        "no noise, friction and spring as torque balance finds them in the recordings.",
        ("recording", "recorded_mrad", "ours_mrad", "ratio"),
        [[it.name, 1e3 * it.recorded, 1e3 * it.ours, it.ratio] for it in found],
    )
    off = abs(median_ratio(found) - 1.0)
    return [table], [Goal("median error off the recorded one", 0.15, "", off)]


def _cells(delay: float, contact: str, found: Outcome) -> list[Value]:
    return [
        1e3 * delay,
        contact,
        1e3 * found.error,
        1e3 * found.effort,
        1e3 * found.apart,
        f"{found.fast:.0%}",
        1e3 * found.made,
        "early" if found.stopped else "",
    ]


def _drawn_rows(found: list[Tally]) -> list[list[Value]]:
    return [
        [name, one.rigs, one.beyond, 1e3 * one.made, one.share, one.early]
        for name, one in zip(("in an account", "bare"), found, strict=True)
    ]
