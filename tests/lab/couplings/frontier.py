"""How much error a coupling leaves for how much noise of its motors, on recorded hands.

The master moves as it was recorded, whatever it feels, and its encoder adds no noise; the slave's
does. Error is set over what the laboratory recorded between its levers, or, for a hand that is no
recording, over what its law leaves in the same simulation; motor effort above 20 Hz is set over
what the laboratory's law commands in the same simulation.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from tautwave.config import Rig
from tautwave.simulation import simulate
from tests.lab.couplings.recorded import COULOMB, GAINS, MET, VISCOUS, controllers
from tests.lab.port.hands import CONTACTS, LEAD_S, PERIOD, Hand
from tests.lab.port.rigs import HERE, IMPOSED, bench_rig
from tests.lab.port.tracking import RELEASED_S, SETTLED_S, chatter, rms

Tell = Callable[[str], None]

LAB = "laboratory"


class Setting(NamedTuple):
    """One point of a family: its block in a rig, and the axes' velocity filter [s]."""

    family: str
    name: str
    block: str
    filter_s: float = 0.0


def _lab(pair: str) -> Setting:
    (stiffness, damping), name = GAINS[pair], ", ".join(pair)
    part = HERE / "derivative.py"
    keys = f"stiffness: {stiffness}, damping: {damping}, derivative_filter_s: 0.001"
    return Setting(LAB, name, f"{{part: {part}, pairs: {{lever: {{{keys}}}}}}}")


def _wave(impedance: float, corner: float) -> Setting:
    keys = f"wave_impedance: {impedance}, wave_filter_hz: {corner}, pole_master: 0.5, "
    keys += "pole_slave: 0.5"
    name = f"b {impedance:g}, filter {corner:g} Hz"
    return Setting("wave", name, f"{{law: wave, pairs: {{lever: {{{keys}}}}}}}")


KEPT = "{kept: 0.05}"
"""A spring at the slave is given back at the master: the slave's tank gives, too."""


def _account(
    law: str, stiffness: float, damping: float, filter_s: float, more: str = ""
) -> Setting:
    keys = f"stiffness: {stiffness}, damping: {damping}{more}"
    block = f"{{law: {law}, account: {KEPT}, pairs: {{lever: {{{keys}}}}}}}"
    return Setting(f"{law}, account", f"K {stiffness:g}", block, filter_s)


BEST = _account(
    "four_channel", 13, 0.1, 1e-3, ", observer_hz: 30, rejection: 0.7, force_gain: 0.2"
)._replace(family="four_channel, rejection 0.7", name="K 13")
"""One certified setting for all hands and contacts."""

LAWS_OF_LAB = {pair: _lab(pair) for pair in GAINS}
"""Controllers of the recordings, by regression of their commands; derivative filter as well."""

SETTINGS = (
    *LAWS_OF_LAB.values(),
    *(_wave(b, 50.0) for b in (0.03, 0.05, 0.07, 0.1, 0.15)),
    *(_account("position", k, d, 1e-3) for k, d in ((10, 0.08), (20, 0.1), (40, 0.15))),
    *(
        _account("four_channel", k, d, 1e-3, ", observer_hz: 30")
        for k, d in ((5, 0.06), (10, 0.08), (20, 0.1))
    ),
    BEST,
)
"""Few points on each curve: each is run on every hand."""


class Score(NamedTuple):
    """One hand: error [rad], motors above 20 Hz, master and slave together [N m], and how it ended.

    known: error that was recorded, or that of the laboratory's law; lab: that of its law, simulated
    [rad]; share, over_lab: error over the known, effort over that of the laboratory's law [1].
    """

    hand: str
    known: float
    lab: float
    error: float
    effort: float
    share: float
    over_lab: float
    ended: bool


class Point(NamedTuple):
    """Medians over the hands of a contact."""

    setting: Setting
    error: float
    effort: float
    share: float
    over_lab: float
    ended: int
    scores: tuple[Score, ...] = ()


def rig_of(setting: Setting, hand: Hand, noise: float, folder: Path) -> Rig:
    """Return the bench as identified, moved by a hand; `noise` [rad] is the slave's."""
    reference = f"{{type: recording, file: {hand.write(folder)}, column: hand, repeat: false}}"
    rig = bench_rig(
        setting.block,
        reference,
        MET[hand.contact],
        noise=noise,
        seconds=hand.seconds,
        grip=IMPOSED,
        coulomb=COULOMB,
        viscous=VISCOUS,
    )
    assert rig.simulation is not None
    quiet = {"position_noise": 0.0}
    axes = dict(rig.simulation.axes)
    axes["master.lever"] = axes["master.lever"].model_copy(update=quiet)
    simulation = rig.simulation.model_copy(update={"axes": axes})
    sides = {}
    for name in ("master", "slave"):
        side = getattr(rig, name)
        lever = side.axes["lever"].model_copy(update={"velocity_filter_s": setting.filter_s})
        sides[name] = side.model_copy(update={"axes": {"lever": lever}})
    return rig.model_copy(update={"simulation": simulation, **sides})


def run_hand(
    setting: Setting, hand: Hand, noise: float, folder: Path, engine: str
) -> tuple[float, float, bool]:
    """Return error [rad], effort above 20 Hz [N m], and whether the run ended early."""
    run = simulate(rig_of(setting, hand, noise, folder), engine=engine)
    lead, first, last = (round(it / PERIOD) for it in (LEAD_S, SETTLED_S, RELEASED_S))
    part = slice(lead + first, lead + len(hand.positions) - last)
    if len(run.data) < part.stop:
        return float("nan"), float("nan"), True
    efforts = [chatter(run[f"{side}.lever.commanded"][part]) for side in ("master", "slave")]
    return rms(run["lever.position_error"][part]), rms(np.array(efforts)), False


def frontier(
    hands: Sequence[Hand],
    noise: float,
    *,
    settings: Sequence[Setting] = SETTINGS,
    engine: str = "compiled",
    tell: Tell,
) -> dict[str, list[Point]]:
    """Return the points of every contact, in the order of the settings.

    Parameters
    ----------
    hands : sequence of Hand
        Recorded ones, or others.
    noise : float
        Of the slave's encoder [rad].
    settings : sequence of Setting
        The first is the laboratory's own: what a hand is measured by, unless its name says that
        another of the laboratory's laws moved it, which is among them.
    engine : str
        Of the simulation.
    tell : callable
        Called with the name of each setting as it starts.
    """
    first, last = (round(it / PERIOD) for it in (SETTLED_S, RELEASED_S))
    met = {hand.contact for hand in hands}
    found: dict[str, list[Point]] = {contact: [] for contact in CONTACTS if contact in met}
    runs: dict[Setting, Mapping[str, tuple[float, float, bool]]] = {}
    with TemporaryDirectory() as name:
        for setting in settings:
            tell(f"{setting.family}, {setting.name}, noise {noise:g} rad")
            runs[setting] = {
                hand.name: run_hand(setting, hand, noise, Path(name), engine) for hand in hands
            }
    for setting in settings:
        for contact, points in found.items():
            scores = []
            for hand in hands:
                if hand.contact != contact:
                    continue
                error, effort, ended = runs[setting][hand.name]
                lab = LAWS_OF_LAB.get(controllers(hand.name), settings[0])
                simulated, by, _ = runs[lab if lab in runs else settings[0]][hand.name]
                known = simulated
                if hand.recorded is not None:
                    known = rms(hand.recorded[first : len(hand.positions) - last])
                ratios = error / known, effort / by
                scores.append(Score(hand.name, known, simulated, error, effort, *ratios, ended))
            points.append(_median(setting, scores))
    return found


def _median(setting: Setting, scores: Sequence[Score]) -> Point:
    def middle(values: Sequence[float]) -> float:
        return statistics.median(values)

    return Point(
        setting,
        middle([it.error for it in scores]),
        middle([it.effort for it in scores]),
        middle([it.share for it in scores]),
        middle([it.over_lab for it in scores]),
        sum(it.ended for it in scores),
        tuple(scores),
    )
