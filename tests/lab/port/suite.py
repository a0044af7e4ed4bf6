"""`python -m tests.lab port`: a table "before, after, lab"; ratios are those of one run."""

from __future__ import annotations

import math
import statistics
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from tautwave import canvas
from tautwave.bench.result import Goal, Suite, Table, Value
from tests.lab.port.cost import port_costs
from tests.lab.port.figure import held_figure
from tests.lab.port.hands import CONTACTS, SYNTHETIC_S, Hand, recorded_hands, synthetic_hands
from tests.lab.port.hold import RESTING_S, Held, hold
from tests.lab.port.line import line_table
from tests.lab.port.rigs import LAWS, SETTING
from tests.lab.port.tracking import Score, gripped, imposed

Tell = Callable[[str], None]

NOISES = (9e-5, 1.5e-5)
HOLD_S, SHORT_S = 60.0, 10.0
QUICK_S = 2.5
WORSE = {"free": 0.5, "foam": 0.5, "spring": 0.75, "rigid": 0.75}
"""Goals for the median error over that of the laboratory's recording."""

SYNTHETIC = "synthetic hands, multisines: give --recordings DIR for recorded ones"
PICTURE = "held-force"


def silent(_: str) -> None:
    """Say nothing about progress."""


def port(
    *,
    recordings: Path | None = None,
    quick: bool = False,
    cost: bool = False,
    out: Path | None = None,
    tell: Tell = silent,
) -> Suite:
    """Compare the wave port with the one before it and with a laboratory's PD.

    Parameters
    ----------
    recordings : Path, optional
        Folder of recorded hands; synthetic ones if not given.
    quick : bool
        One hand per contact, one noise, 10 s of holding; synthetic hands move for 2.5 s.
    cost : bool
        Measure CPU time as well.
    out : Path, optional
        Directory for the picture of the held force.
    tell : callable
        Called with the name of each measurement as it starts.

    Raises
    ------
    ConfigError
        The folder has no recordings.
    """
    seconds = QUICK_S if quick else SYNTHETIC_S
    hands = synthetic_hands(seconds) if recordings is None else recorded_hands(recordings)
    if quick:
        hands = [next(h for h in hands if h.contact == c) for c in CONTACTS
                 if any(h.contact == c for h in hands)]  # fmt: skip
    whose = SYNTHETIC if recordings is None else f"hands recorded in {recordings}"
    noises = NOISES[:1] if quick else NOISES
    tables, goals = [], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for noise in noises:
            scores = gripped(hands, noise, folder, tell)
            tables.append(_gripped_table(scores, noise, whose))
            if noise == NOISES[0]:
                goals += _gripped_goals(scores)
        moved = imposed(hands, folder, tell)
        tables.append(_imposed_table(moved, hands, whose))
        goals += imposed_goals(moved, hands)
    seconds = SHORT_S if quick else HOLD_S
    held = {}
    for noise in noises:
        tell(f"{seconds:g} s of a held force, noise {noise:g} rad")
        held[noise] = {name: hold(name, noise, seconds) for name in LAWS}
    tell("a hand that rests before a wall")
    resting = {name: hold(name, NOISES[0], RESTING_S, resting=True) for name in LAWS}
    tell("a line of 20 ms")
    tables += [_held_table(held, seconds), _resting_table(resting), line_table()]
    goals += _held_goals(held, resting)
    if cost:
        table, more = port_costs(20 if quick else 40, tell)
        tables.append(table)
        goals += more
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        drawn = held_figure(*(held[NOISES[0]][name] for name in ("before", "after", "lab")))
        text = canvas.alone(canvas.svg(drawn, PICTURE, "A held force over time, before and after"))
        (out / f"{PICTURE}.svg").write_text(text, encoding="utf-8")
    return Suite("port", tables, goals)


def _gripped_table(scores: Mapping[str, Mapping[str, Score]], noise: float, whose: str) -> Table:
    rows: list[list[Value]] = []
    for contact, by in scores.items():
        row: list[Value] = [contact]
        for name in LAWS:
            row += [1e3 * by[name].error, 1e3 * by[name].chatter]
        after, lab = by["after"], by["lab"]
        rows.append([*row, after.error / lab.error, after.chatter / lab.chatter])
    columns = ["contact"]
    for name in LAWS:
        columns += [f"{name}_mrad", f"{name}_mNm"]
    return Table(
        f"A hand of 3 N m/rad follows a path, encoder noise {noise:g} rad",
        f"rms of master minus slave, and of the motors above 20 Hz; {whose}; {SETTING}; before: "
        "the port with an account; lab: K 25.4, D 0.121, derivative filter 2.5 ms; over the lab's",
        (*columns, "error_over_lab", "chatter_over_lab"),
        rows,
    )


def _gripped_goals(scores: Mapping[str, Mapping[str, Score]]) -> list[Goal]:
    goals = []
    for contact, by in scores.items():
        after, lab = by["after"], by["lab"]
        goals += [
            Goal(f"error over the lab's, {contact}", 0.6, "times", after.error / lab.error),
            Goal(f"chatter over the lab's, {contact}", 1.6, "times", after.chatter / lab.chatter),
        ]
    return goals


def _imposed_table(
    moved: Mapping[str, Mapping[str, Score]], hands: Sequence[Hand], whose: str
) -> Table:
    rows: list[list[Value]] = []
    for hand in hands:
        by = moved[hand.name]
        share = by["after"].share
        rows.append(
            [
                hand.name,
                hand.contact,
                *(1e3 * by[name].error for name in LAWS),
                None if math.isnan(share) else share,
            ]
        )
    return Table(
        "The master is moved as recorded, whatever it feels; no noise",
        f"rms of master minus slave [mrad], and after over what the laboratory recorded; {whose}; "
        f"{SETTING}",
        ("hand", "contact", *(f"{name}_mrad" for name in LAWS), "after_over_recorded"),
        rows,
    )


def imposed_goals(moved: Mapping[str, Mapping[str, Score]], hands: Sequence[Hand]) -> list[Goal]:
    """Return the goals of law `after` against what the laboratory recorded."""
    shares: dict[str, list[float]] = {}
    for hand in hands:
        if hand.recorded is not None:
            shares.setdefault(hand.contact, []).append(moved[hand.name]["after"].share)
    if not shares:
        return []
    goals = [
        Goal(f"median error over the recorded, {contact}", WORSE[contact], "times",
             statistics.median(found))
        for contact, found in shares.items()
    ]  # fmt: skip
    worst = max(max(found) for found in shares.values())
    return [*goals, Goal("greatest error over the recorded", 1.0, "times", worst)]


def _held_table(held: Mapping[float, Mapping[str, Held]], seconds: float) -> Table:
    rows: list[list[Value]] = [
        [
            name,
            noise,
            -1e3 * found.effort,
            _known(found.share),
            1e3 * found.drift,
            _known(found.cut),
            1e3 * found.chatter,
        ]
        for noise, by in held.items()
        for name, found in by.items()
    ]
    return Table(
        f"0.3 N m pressed against 250 N m/rad for {seconds:g} s, devices without dry friction",
        "effort of the slave at the end; motor over line effort; drift of the error; share of "
        "periods whose wave could not be paid for; slave's motor above 20 Hz",
        ("law", "noise_rad", "effort_mNm", "motor_over_line", "drift_mrad", "cut", "chatter_mNm"),
        rows,
    )


def _known(value: float) -> Value:
    return None if math.isnan(value) else value


def _resting_table(resting: Mapping[str, Held]) -> Table:
    return Table(
        f"A hand rests at 0.1 rad, a wall of 250 N m/rad is at 0.05 rad; {RESTING_S:g} s",
        "rms of master minus slave over the whole run, and effort of the slave at the end",
        ("law", "error_mrad", "effort_mNm"),
        [[name, 1e3 * found.error, -1e3 * found.effort] for name, found in resting.items()],
    )


def _held_goals(
    held: Mapping[float, Mapping[str, Held]], resting: Mapping[str, Held]
) -> list[Goal]:
    goals = []
    for noise, limit in zip(NOISES, (15.0, 5.0), strict=True):
        if noise in held:
            found = held[noise]["after"]
            goals.append(
                Goal(f"chatter of a held force at {noise:g} rad", limit, "mN m",
                     1e3 * found.chatter)
            )  # fmt: skip
    found = held[NOISES[0]]["after"]
    return [
        *goals,
        Goal("motor over line effort, off by", 0.005, "of 1", abs(found.share - 1.0)),
        Goal("drift of a held force", 0.1, "mrad", 1e3 * abs(found.drift)),
        Goal("waves cut while holding", 0.0, "of all", found.cut),
        Goal("error of a resting hand", 3.0, "mrad", 1e3 * resting["after"].error),
    ]
