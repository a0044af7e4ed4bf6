"""What every law does with a press of a minute, as a table: `python -m tests.rigs.holds [LAW ...]`.

With `--hour` the press lasts for an hour, and means of seconds stand for those of quarters.

The hand goes to 0.15 rad in a second and rests; the wall is at 0.05 rad. Shown are the efforts of
master and slave [mN m], means of a quarter of a second at 3, 6, 14, 30 and 60 s, and how it ended.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tautwave.config import Rig, load_rig
from tautwave.simulation import Simulation, simulate, simulate_pieces

BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-2khz.yaml"
AUTO = "wave_impedance: auto, wave_filter_hz: auto, pole_master: auto, pole_slave: auto"
LAWS = {
    "wave": ("wave", AUTO, False),
    "position": ("position", "stiffness: 20, damping: 0.07", False),
    "position account": ("position", "stiffness: 20, damping: 0.07", True),
    **{name: (name, "", False) for name in
       ("pd_damping", "position_force", "four_channel", "mediated")},
    **{f"{name} account": (name, "", True) for name in
       ("pd_damping", "position_force", "four_channel", "mediated")},
}  # fmt: skip
"""Law, keys of its pair, whether in an account; gains that are not named are `auto`."""
WALLS = {"soft": 5.0, "stiff": 250.0}
DELAYS = (0.0, 0.02, 0.1)
ENCODERS = {"1.5e-5": (1.5e-5, 2.094e-5), "9e-5": (9e-5, 2.094e-5), "coarse": (0.0, 1.534e-3)}
"""Noise, declared and true, and encoder step [rad]."""
TIMES = (3.0, 6.0, 14.0, 30.0, 60.0)
SWINGS_S = 4.0
"""[s] Longer than a swing of a pair that swings."""
FELT = 0.025
"""[N m] Coulomb friction: less is no press."""
HOUR_S, PIECE_ROWS = 3600.0, 200_000
FIRST_S, LAST_S = 5.0, 2.0
"""[s] From 5 to 10 s a press counts as begun, and over the last 2 s as ended."""
SIDES = ("master", "slave")


class Hold(NamedTuple):
    """One case."""

    law: str
    wall: str
    delay: float
    encoder: str

    @property
    def rig(self) -> Rig:
        """Its rig."""
        law, keys, account = LAWS[self.law]
        noise, quantum = ENCODERS[self.encoder]
        books = "account: {}, " if account else ""
        changes = [
            f"coupling={{law: {law}, delay_s: {self.delay}, {books}pairs: {{lever: {{{keys}}}}}}}",
            "simulation.hand.lever={lever_arm: 0.075, reference: {type: minimum_jerk, "
            "waypoints: [[0.5, 0.0], [1.5, 0.15]]}}",
            f"simulation.environment.lever={{type: wall, position: 0.05, stiffness: "
            f"{WALLS[self.wall]}, damping: 5.0e-3}}",
            f"duration_s={TIMES[-1]}",
        ]
        for side in ("master", "slave"):
            changes += [
                f"{side}.axes.lever.position_noise={noise}",
                f"simulation.axes.{side}.lever.position_noise={noise}",
                f"{side}.axes.lever.encoder_quantum={quantum}",
            ]
        return load_rig(BENCH, changes)


def efforts(run: Simulation, side: str) -> list[float]:
    """Return the mean effort of a side before each of the times [N m]; NaN after the end."""
    time, sent = run["time_s"], run[f"{side}.lever.commanded"]
    found = []
    for at in TIMES:
        known = (time > at - 0.3) & (time <= at - 0.05)
        found.append(float(np.mean(sent[known])) if known.any() else float("nan"))
    return found


def lets_go_unsaid(run: Simulation) -> bool:
    """Return whether a side pressed after 3 s, and at the end does so with less than a quarter.

    Sizes over four seconds count: one that swings, as laws do with a long delay and a coarse
    encoder, is felt to.
    """
    if run.error is not None:
        return False
    time = run["time_s"]
    for side in ("master", "slave"):
        size = np.abs(run[f"{side}.lever.commanded"])
        first = float(np.mean(size[(time > TIMES[0]) & (time <= TIMES[0] + SWINGS_S)]))
        last = float(np.mean(size[time > TIMES[-1] - SWINGS_S]))
        if first > 2.0 * FELT and last < 0.25 * first:
            return True
    return False


class Lasted(NamedTuple):
    """A press of an hour: what each side did, how long it ran [s], and what ended it.

    first, last: mean size of its effort [N m]; given: the most that it had given at any time [J].
    """

    first: dict[str, float]
    last: dict[str, float]
    given: dict[str, float]
    seconds: float
    error: str | None

    @property
    def lets_go_unsaid(self) -> bool:
        """Whether a side pressed at first, and at last with less than a quarter, and it ran on."""
        return self.error is None and any(
            self.first[side] > 2.0 * FELT and self.last[side] < 0.25 * self.first[side]
            for side in SIDES
        )


def lasted(case: Hold, seconds: float = HOUR_S) -> Lasted:
    """Press for so long [s], compiled, in pieces none of which is kept."""
    rig = case.rig.model_copy(update={"duration_s": seconds})
    first, last, given = (dict.fromkeys(SIDES, 0.0) for _ in range(3))
    error, end = None, 0.0
    for piece in simulate_pieces(rig, PIECE_ROWS):
        time, error = piece["time_s"], piece.error
        begins, ends = (time > FIRST_S) & (time < 2.0 * FIRST_S), time > time[-1] - LAST_S
        for side in SIDES:
            sizes = np.abs(piece[f"{side}.lever.commanded"])
            given[side] = max(given[side], float(np.max(-piece[f"{side}.lever.port_energy"])))
            first[side] = float(np.mean(sizes[begins])) if begins.any() else first[side]
            last[side] = float(np.mean(sizes[ends]))
        end = float(time[-1]) + rig.period_s
    return Lasted(first, last, given, end, None if error is None else str(error))


def cases(laws: list[str]) -> Iterator[Hold]:
    """Yield the cases of some laws."""
    for law in laws:
        for wall in WALLS:
            for delay in DELAYS:
                for encoder in ENCODERS:
                    yield Hold(law, wall, delay, encoder)


def minute_row(case: Hold) -> str:
    """Return a line of the table of minutes."""
    run = simulate(case.rig, engine="compiled")
    one, two = efforts(run, "master"), efforts(run, "slave")
    row = " ".join(f"{1e3 * a:5.0f}/{1e3 * b:5.0f}" for a, b in zip(one, two, strict=True))
    return f"{row}  {run.error or ''}"


def hour_row(case: Hold) -> str:
    """Return a line of the table of hours."""
    found = lasted(case)
    row = " ".join(
        "/".join(f"{1e3 * each[side]:5.0f}" for side in SIDES) for each in (found.first, found.last)
    )
    unsaid = "LETS GO UNSAID " if found.lets_go_unsaid else ""
    return f"{row} {found.seconds:7.1f} s  {unsaid}{found.error or ''}"


if __name__ == "__main__":
    named = [it for it in sys.argv[1:] if it != "--hour"]
    row_of = hour_row if "--hour" in sys.argv else minute_row
    for case in cases(named or list(LAWS)):
        name = f"{case.law:22s} {case.wall:5s} {1e3 * case.delay:3.0f} ms {case.encoder:6s}"
        print(f"{name} {row_of(case)}"[:200], flush=True)
