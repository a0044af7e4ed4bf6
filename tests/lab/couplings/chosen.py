"""`python -m tests.lab chosen`: what `law: auto` leaves on recorded hands, beside what is tuned.

Settings are chosen on some recordings and judged on the others, over all ways of splitting them by
session and controller (`SET_CONTROLLER` of their names): no number is of what it was chosen on.

Imposed: the master moves as it was recorded, and only the slave can be off. A spring without mass,
noise or delay between the levers is set beside it at a rigid wall (`ideal`): no law that presses in
proportion to the gap leaves less for less chatter. Gripped: the hand is a compliant grip whose wish
is the recording. A stiff law then looks good by stopping the hand, and over a delay standing still
does, so the slave is compared with the master (error) and with the wish (task), the one-way delay
taken out of both, over the rms of the wish. Motors above 20 Hz are set over those of the
laboratory's law without a delay in the same simulation.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.config import Rig, load_rig
from tautwave.simulation import simulate
from tests.lab.couplings.frontier import (
    LAWS_OF_LAB,
    SETTINGS,
    Score,
    Setting,
    _wave,
)
from tests.lab.couplings.ideal import ideal_tables
from tests.lab.couplings.recorded import MET, controllers
from tests.lab.port.hands import LEAD_S, PERIOD, Hand, recorded_hands, synthetic_hands
from tests.lab.port.rigs import GRIP
from tests.lab.port.tracking import RELEASED_S, SETTLED_S, chatter, rms

Tell = Callable[[str], None]

BENCH = Path(__file__).parents[3] / "configs" / "bench-1dof-2khz.yaml"
NOISE = 1.5e-5
"""As in the recordings [rad]; imposed motion has its own."""

PLAYED = "lever_arm: 0.075, stiffness: 1.0e5, damping: 300.0"
"""A grip that leaves the lever no choice: 560 N m/rad."""

AUTO = Setting("auto", "law: auto", "{law: auto, pairs: {lever: {}}}")
CURVE = tuple(
    _wave(b, corner) for b in (0.05, 0.1, 0.15, 0.2) for corner in (20.0, 35.0, 50.0, 100.0)
)
"""Waves to choose from, master imposed."""


def _corner(corner: float) -> Setting:
    keys = f"{{wave_filter_hz: {corner}}}"
    return Setting("corner", f"{corner:g} Hz", f"{{law: auto, pairs: {{lever: {keys}}}}}")


CORNERS = tuple(_corner(corner) for corner in (25.0, 35.0, 50.0, 70.0, 100.0))
"""Auto but for the corner of its filter."""


def _mediated(stiffness: float, more: str = "") -> Setting:
    keys = f"stiffness: {stiffness}{more}"
    block = f"{{law: mediated, account: {{}}, pairs: {{lever: {{{keys}}}}}}}"
    return Setting("mediated", f"K {stiffness:g}{more}", block)


TUNED: Mapping[str, Sequence[Setting]] = {
    "wave": tuple(_wave(b, corner) for b in (0.07, 0.1, 0.14) for corner in (35.0, 70.0)),
    "mediated": (
        *(_mediated(stiffness) for stiffness in (8.0, 25.0, 40.0)),
        _mediated(16.0, ", observer_hz: 50"),
        _mediated(16.0, ", damping: 0.11"),
        _mediated(16.0, ", touch: 0.03"),
    ),
}
"""Settings to choose from with a grip, by law."""

WAVES_S = 0.02
"""[s] Up to which waves are run with a grip where auto takes another law."""

TASKS: Mapping[float, float] = {0.005: 0.80, 0.02: 0.80, 0.1: 0.82, 0.3: 0.84}
"""One-way delays [s], and the most that the slave may be off the wish [1]."""
BARS: Mapping[str, float] = {"free": 0.3, "foam": 0.3, "spring": 0.5, "rigid": 0.5}
WORST = 1.0
"""Error over the recorded, master imposed: medians, and the worst of all."""

LOUDEST, QUIET, LOUDEST_HELD = 2.5, 1.5, 1.6
"""Motors above 20 Hz over the laboratory's: master imposed, and with a grip."""

NEAR = 0.03
"""By how much the task may be above that of the best tuned setting."""


class Held(NamedTuple):
    """One hand with a grip: error and task over the wish, motors over the laboratory's [1]."""

    hand: str
    error: float
    task: float
    over_lab: float


def group(hand: str) -> str:
    """Return the session and the controller that a recording is of: its name to the contact."""
    return hand.rpartition("_")[0].removesuffix("_free")


def splits(hands: Sequence[Hand]) -> Iterator[tuple[set[str], set[str]]]:
    """Yield all ways of choosing on some groups of recordings, and judging on the others."""
    groups = sorted({group(hand.name) for hand in hands})
    for count in range(1, len(groups)):
        for some in combinations(groups, count):
            yield set(some), set(groups) - set(some)


def lab_of(hand: Hand) -> Setting:
    """Return the laboratory's law that a recording is of, its first for other hands."""
    return LAWS_OF_LAB.get(controllers(hand.name), SETTINGS[0])


def bench(
    block: str, hand: Hand, folder: Path, grip: str, master_noise: float, delay: float = 0.0
) -> Rig:
    """Return the bench with true friction, moved by a hand through a grip."""
    reference = f"{{type: recording, file: {hand.write(folder)}, column: hand, repeat: false}}"
    changes = [
        f"coupling={block}",
        f"coupling.delay_s={delay!r}",
        f"duration_s={hand.seconds!r}",
        f"simulation.hand.lever={{{grip}, reference: {reference}}}",
        f"simulation.environment.lever={MET[hand.contact]}",
    ]
    for side, viscous, noise in (("master", 0.012, master_noise), ("slave", 0.015, NOISE)):
        changes += [
            f"{side}.axes.lever.position_noise={NOISE!r}",
            f"simulation.axes.{side}.lever={{inertia: 1.584e-3, damping: {viscous}, "
            f"coulomb: 0.025, position_noise: {noise!r}}}",
        ]
    return load_rig(BENCH, changes)


def play(block: str, hand: Hand, folder: Path, engine: str) -> tuple[float, float]:
    """Return error [rad] and motors above 20 Hz [N m], the master's motion imposed."""
    run = simulate(bench(block, hand, folder, PLAYED, 0.0), engine=engine)
    lead, first, last = (round(it / PERIOD) for it in (LEAD_S, SETTLED_S, RELEASED_S))
    part = slice(lead + first, lead + len(hand.positions) - last)
    if len(run.data) < part.stop:
        return math.nan, math.nan
    efforts = [chatter(run[f"{side}.lever.commanded"][part]) for side in ("master", "slave")]
    return rms(run["lever.position_error"][part]), rms(np.array(efforts))


def hold(
    block: str, hand: Hand, delay: float, folder: Path, engine: str
) -> tuple[float, float, float]:
    """Return error and task over the wish [1], and motors above 20 Hz [N m]; nan if it ended."""
    run = simulate(bench(block, hand, folder, GRIP, NOISE, delay), engine=engine)
    lead, first, last = (round(it / PERIOD) for it in (LEAD_S, SETTLED_S, RELEASED_S))
    late, stop = round(delay / PERIOD), lead + len(hand.positions) - last
    if len(run.data) < stop:
        return math.nan, math.nan, math.nan
    begin = max(lead + first, late)
    now, before = slice(begin, stop), slice(begin - late, stop - late)
    wish = np.loadtxt(hand.write(folder), delimiter=",", skiprows=1)[:, 1]
    size = rms(wish[now])
    slave = run["true.slave.lever.position"][now]
    error = rms(run["true.master.lever.position"][before] - slave) / size
    task = rms(wish[before] - slave) / size
    efforts = [chatter(run[f"{side}.lever.commanded"][now]) for side in ("master", "slave")]
    return error, task, rms(np.array(efforts))


def middle(values: Sequence[float]) -> float:
    """Return the median."""
    return statistics.median(values)


def mean(values: Sequence[float]) -> float:
    """Return the geometric mean."""
    return math.exp(statistics.fmean(math.log(value) for value in values))


Imposed = Mapping[Setting, Mapping[str, Sequence[Score]]]


def imposed_runs(
    hands: Sequence[Hand], others: Sequence[Setting], engine: str, tell: Tell
) -> Imposed:
    """Return the scores of auto and other settings, by contact, the master's motion imposed."""
    settings = (*LAWS_OF_LAB.values(), AUTO, *others)
    runs: dict[Setting, dict[str, tuple[float, float]]] = {}
    with TemporaryDirectory() as name:
        for setting in settings:
            tell(f"master imposed, {setting.name}")
            runs[setting] = {
                hand.name: play(setting.block, hand, Path(name), engine) for hand in hands
            }
    first, last = (round(it / PERIOD) for it in (SETTLED_S, RELEASED_S))
    found: dict[Setting, dict[str, list[Score]]] = {}
    for setting in settings:
        found[setting] = {}
        for hand in hands:
            error, effort = runs[setting][hand.name]
            simulated, by = runs[lab_of(hand)][hand.name]
            known = simulated
            if hand.recorded is not None:
                known = rms(hand.recorded[first : len(hand.positions) - last])
            scores = found[setting].setdefault(hand.contact, [])
            ratios = error / known, effort / by
            scores.append(
                Score(hand.name, known, simulated, error, effort, *ratios, math.isnan(error))
            )
    return found


def of_groups(scores: Sequence[Score], groups: set[str]) -> list[Score]:
    """Return the scores of the recordings of some groups."""
    return [it for it in scores if group(it.hand) in groups]


def chosen_on(
    found: Imposed, curve: Sequence[Setting], groups: set[str], loudest: float = LOUDEST
) -> Setting:
    """Return the setting of least error that is not too loud at any contact, on some groups."""

    def judged(setting: Setting) -> tuple[bool, float]:
        known = [of_groups(each, groups) for each in found[setting].values()]
        loud = max(middle([it.over_lab for it in each]) for each in known if each)
        return loud > loudest, sum(middle([it.share for it in each]) for each in known if each)

    return min(curve, key=judged)


def imposed_tables(hands: Sequence[Hand], found: Imposed) -> list[Table]:
    """Return the curve of every contact with auto in it, and both by splits."""
    curve, at_corners = ([it for it in found if it.family == name] for name in ("wave", "corner"))
    rows: list[list[Value]] = []
    for setting, contacts in found.items():
        for contact, scores in contacts.items():
            share, loud = ([getattr(it, key) for it in scores] for key in ("share", "over_lab"))
            rows.append([contact, setting.name, middle(share), max(share), middle(loud), max(loud)])
    rows.sort(key=lambda row: list(BARS).index(str(row[0])))
    whole = Table(
        "Master imposed: error and chatter, all recordings",
        "Error over the recorded, motors above 20 Hz over the laboratory's: medians and worst.",
        ("contact", "setting", "error", "worst", "chatter", "worst chatter"),
        rows,
    )
    split: list[list[Value]] = []
    judged: dict[tuple[str, str], list[tuple[float, float]]] = {}
    corners: list[str] = []
    for some, others in splits(hands):
        corner = chosen_on(found, at_corners, some)
        corners.append(corner.name)
        for name, setting in (
            ("auto", AUTO),
            ("auto, corner chosen", corner),
            (f"waves, {LOUDEST:g}", chosen_on(found, curve, some)),
            (f"waves, {QUIET:g}", chosen_on(found, curve, some, QUIET)),
        ):
            for contact, scores in found[setting].items():
                known = of_groups(scores, others)
                if known:
                    judged.setdefault((contact, name), []).append(
                        (middle([it.share for it in known]), middle([it.over_lab for it in known]))
                    )
    for (contact, name), each in judged.items():
        errors, louds = zip(*each, strict=True)
        split.append([contact, name, middle(errors), max(errors), middle(louds), max(louds)])
    by_splits = Table(
        "Master imposed, by splits",
        "Auto, and what was chosen on some recordings (least error at a chatter of "
        f"{LOUDEST:g} or {QUIET:g} at most), on the others: median and worst over all "
        f"{len(corners)} ways of splitting. Corners chosen: "
        + ", ".join(f"{it} {corners.count(it)}" for it in sorted(set(corners))),
        ("contact", "setting", "error", "worst", "chatter", "worst chatter"),
        split,
    )
    return [whole, by_splits]


def imposed_goals(found: Imposed) -> list[Goal]:
    """Return what auto has to reach, on all recordings: it is chosen on none."""
    goals = []
    for contact, scores in found[AUTO].items():
        shares, louds = [it.share for it in scores], [it.over_lab for it in scores]
        goals += [
            Goal(f"error over the recorded, {contact}", BARS[contact], "times", middle(shares)),
            Goal(f"worst error over the recorded, {contact}", WORST, "times", max(shares)),
            Goal(f"effort above 20 Hz over lab's, {contact}", LOUDEST, "times", middle(louds)),
        ]
    return goals


def law_at(delay: float) -> str:
    """Return the law that auto takes on the bench."""
    changes = [f"coupling={AUTO.block}", f"coupling.delay_s={delay!r}"]
    return str(load_rig(BENCH, changes).coupling.law)


def tuned_at(delay: float) -> tuple[Setting, ...]:
    """Return auto and what it is set beside at a delay: its own law tuned, waves on short lines."""
    law = law_at(delay)
    waves = TUNED["wave"] if law == "wave" or delay <= WAVES_S else ()
    return AUTO, *waves, *(() if law == "wave" else TUNED[law])


def held_runs(
    hands: Sequence[Hand],
    settings: Mapping[float, Sequence[Setting]],
    engine: str,
    tell: Tell,
) -> dict[float, dict[Setting, list[Held]]]:
    """Return the scores of the settings of each delay with a grip."""
    found: dict[float, dict[Setting, list[Held]]] = {}
    with TemporaryDirectory() as name:
        folder = Path(name)
        labs = {hand.name: hold(lab_of(hand).block, hand, 0.0, folder, engine)[2] for hand in hands}
        for delay, each in settings.items():
            found[delay] = {}
            for setting in each:
                tell(f"with a grip, {1e3 * delay:g} ms, {setting.name}")
                scores = []
                for hand in hands:
                    error, task, loud = hold(setting.block, hand, delay, folder, engine)
                    scores.append(Held(hand.name, error, task, loud / labs[hand.name]))
                found[delay][setting] = scores
    return found


def held_tables(
    hands: Sequence[Hand], found: Mapping[float, Mapping[Setting, Sequence[Held]]]
) -> list[Table]:
    """Return all settings with a grip, and auto beside what is chosen on other recordings."""
    rows: list[list[Value]] = [
        [1e3 * delay, it.name, mean([s.error for s in each]), mean([s.task for s in each]),
         middle([s.over_lab for s in each]), max(s.over_lab for s in each)]
        for delay, settings in found.items()
        for it, each in settings.items()
    ]  # fmt: skip
    split: list[list[Value]] = []
    for delay, settings in found.items():
        beside, law = [], law_at(delay)
        for some, others in splits(hands):
            on = {it: [s for s in each if group(s.hand) in some] for it, each in settings.items()}
            quiet = [
                it
                for it, each in on.items()
                if it.family == law and middle([s.over_lab for s in each]) <= LOUDEST_HELD
            ] or [it for it in on if it.family == law]
            best = min(quiet, key=lambda it: mean([s.task for s in on[it]]))
            mine, tuned = (
                mean([s.task for s in settings[it] if group(s.hand) in others])
                for it in (AUTO, best)
            )
            beside.append((mine, tuned, mine - tuned))
        ours, best_ones, more = zip(*beside, strict=True)
        row = [1e3 * delay, middle(ours), max(ours), middle(best_ones), middle(more), max(more)]
        split.append([*row])
    return [
        Table(
            "With a grip, all recordings",
            "Error and task over the wish (geometric means), motors above 20 Hz over the "
            "laboratory's without a delay (median, worst).",
            ("delay_ms", "setting", "error", "task", "chatter", "worst chatter"),
            rows,
        ),
        Table(
            "With a grip, by splits",
            "Task of auto, and of the setting of its law of least task on the other recordings "
            f"(chatter {LOUDEST_HELD:g} at most); auto less this: median and worst of all splits.",
            ("delay_ms", "auto", "worst", "tuned", "auto - tuned", "worst difference"),
            split,
        ),
    ]


def chosen(*, recordings: Path | None, quick: bool = False, tell: Tell) -> Suite:
    """Run auto and the settings to choose from on every hand.

    Parameters
    ----------
    recordings : Path, optional
        Folder of recorded hands; synthetic ones if not given.
    quick : bool
        One hand per contact, two settings, master imposed, without compiling.
    tell : callable
        Called with what starts.

    Raises
    ------
    ConfigError
        The folder has no recordings.
    """
    hands = synthetic_hands() if recordings is None else recorded_hands(recordings)
    others = (*CORNERS, *CURVE)
    if quick:
        hands, others = (
            list({hand.contact: hand for hand in hands}.values()),
            (CORNERS[0], CURVE[0]),
        )
    imposed = imposed_runs(hands, others, "python" if quick else "compiled", tell)
    tables = imposed_tables(hands, imposed)
    goals = imposed_goals(imposed)
    if not quick:
        labs = {it.hand: it.effort / it.over_lab for each in imposed[AUTO].values() for it in each}
        tables += ideal_tables([hand for hand in hands if hand.contact == "rigid"], labs)
        settings = {delay: tuned_at(delay) for delay in TASKS}
        tables += held_tables(hands, held_runs(hands, settings, "compiled", tell))
        for row in tables[-1].rows:
            delay, task, more = (float(row[at] or 0.0) for at in (0, 1, 4))
            goals += [
                Goal(f"task, {delay:g} ms", TASKS[1e-3 * delay], "", task),
                Goal(f"task over tuned, {delay:g} ms", NEAR, "", more),
            ]
        for row in tables[-2].rows:
            if row[1] == AUTO.name:
                name = f"effort above 20 Hz over lab's, grip, {row[0]:g} ms"
                goals.append(Goal(name, LOUDEST_HELD, "times", float(row[4] or 0.0)))
    return Suite("chosen", tables, goals)
