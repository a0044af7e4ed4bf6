"""The data for the figures of one pair, read from the recording column by column and decimated.

Nothing is drawn here, and no full column is kept, so an hour of rows stays small.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tautwave.columns import ACCOUNT
from tautwave.report.figures.envelope import Floats, Trace, trace
from tautwave.report.run.contacts import Contact, find_contacts
from tautwave.report.run.rebuild import Balance, element_books
from tautwave.report.run.rundir import (
    SIDES,
    Run,
    axis_kind,
    block,
    delay_of,
    law_wording,
    offset_per_effort,
    pair_settings,
)
from tautwave.report.run.stop import Stop, stop_of
from tautwave.report.units import axis_units, number
from tautwave.wording import CouplingMessages

RESISTING = ("port_effort", "wall_effort")
"""Columns of resisting efforts, positive against the position; figures show them along it."""
FLAT = 1e-4
"""Share of an axis' limits below which a line is flat: it is named instead of drawn."""


@dataclass
class PairView:
    """One pair, ready to draw.

    `lines` holds traces by name; positions, `error` and `expected` are in master units, everything
    of one axis in that axis' units. `contacts` and `phase` are by their cause: `environment`,
    `wall_slave`, `wall_master`. `held` means that the environment is a spring, always attached,
    which is not a contact. `to_slave` turns what the master pushes back with into the slave's units
    and sign; `wording` is that of the coupling's law. `limits` are effort limits by side, `least`
    the smallest range drawn, by side and quantity; lines that stay within it are listed in `flat`.
    `stop` is where the run was stopped.
    """

    name: str
    units: dict[str, tuple[str, str]]
    lines: dict[str, Trace] = field(default_factory=dict)
    contacts: dict[str, list[Contact]] = field(default_factory=dict)
    phase: dict[str, list[tuple[Floats, Floats]]] = field(default_factory=dict)
    zoom: dict[str, Trace] = field(default_factory=dict)
    limits: dict[str, float] = field(default_factory=dict)
    delay_s: float = 0.0
    held: bool = False
    to_slave: float = 1.0
    wording: CouplingMessages = field(default_factory=CouplingMessages)
    least: dict[str, float] = field(default_factory=dict)
    flat: list[str] = field(default_factory=list)
    stop: Stop | None = None

    @property
    def cause(self) -> str:
        """The kind of contact to show first, empty when there was none."""
        for cause in ("environment", "wall_slave", "wall_master"):
            if self.contacts.get(cause):
                return cause
        return ""


@dataclass
class EnergyView:
    """Energy accounts of one pair [J]: `account[kind][element]`, and the balance of all of them."""

    elements: list[str]
    account: dict[str, dict[str, Trace]]
    balance: Trace | None
    gross_flow: float
    least: float = 0.0
    flat: list[str] = field(default_factory=list)


def view_pair(run: Run, pair: str) -> PairView:
    """The view of `pair`, without its energies."""
    settings = pair_settings(run, pair)
    view = PairView(pair, {side: axis_units(axis_kind(run, side, pair)) for side in SIDES})
    view.delay_s = delay_of(run, pair)
    view.wording = law_wording(run)
    for side in SIDES:
        _bounds(view, side, block(run.rig, side, "axes", pair))
    view.stop = stop_of(run)
    if run.rows == 0 or "time_s" not in run.columns:
        return view
    time = run.read("time_s")["time_s"]
    _positions(run, view, settings, time)
    _efforts(run, view, settings, time)
    _keep(run, view, time, {f"{side}.{pair}.velocity": f"{side}.velocity" for side in SIDES})
    waves = [(side, way) for side in SIDES for way in ("wave_in", "wave_out")]
    _keep(run, view, time, {f"{side}.{pair}.{way}": f"{side}.{way}" for side, way in waves})
    _touch(run, view, settings, time)
    return view


def _bounds(view: PairView, side: str, axis: dict[str, Any]) -> None:
    """Set the limits of an axis, and from them the ranges that count as no motion."""
    effort, velocity = number(axis.get("effort_limit")), number(axis.get("velocity_limit"))
    if effort is not None:
        view.limits[side] = effort
        view.least[f"{side}.effort"] = FLAT * effort
    if velocity is not None:
        view.limits[f"{side}.velocity"] = velocity
    ends = axis.get("position_range")
    span = 0.0
    if isinstance(ends, list) and len(ends) == 2:
        span = (number(ends[1]) or 0.0) - (number(ends[0]) or 0.0)
    step = number(axis.get("encoder_quantum")) or 0.0
    view.least[f"{side}.position"] = max(FLAT * span, 2.0 * step)
    view.least["energy"] = max(view.least.get("energy", 0.0), FLAT * FLAT * span * (effort or 0.0))
    view.least["wave"] = FLAT * math.sqrt((effort or 0.0) * (velocity or 0.0))


def view_energy(run: Run, pair: str) -> EnergyView:
    """Energy accounts of `pair`, empty where the recording holds none."""
    account: dict[str, dict[str, Trace]] = {kind: {} for kind in ACCOUNT}
    view = EnergyView([], account, None, 0.0)
    if run.rows == 0 or "time_s" not in run.columns:
        return view
    time = run.read("time_s")["time_s"]
    balance = Balance(run, pair)
    for element in run.elements(pair):
        books = element_books(run, pair, element)
        if books is None:
            continue
        balance.add(*books)
        for kind, values in zip(ACCOUNT, books, strict=True):
            account[kind][element] = trace(time, values)
        view.elements.append(element)
        del books  # before the next element's are read
    if view.elements:
        view.gross_flow = balance.gross_flow
        view.balance = trace(time, np.abs(balance.total))
    return view


def _keep(run: Run, view: PairView, time: Floats, columns: dict[str, str]) -> None:
    """Keep traces of `columns` (by column, the trace's name); efforts become acting ones."""
    for column, values in run.each(columns):
        if np.isfinite(values).any():
            line = trace(time, values)
            if column.endswith(RESISTING):
                line = line.times(-1.0)
            view.lines[columns[column]] = line


def _positions(run: Run, view: PairView, settings: dict[str, Any], time: Floats) -> None:
    pair = view.name
    master, slave = f"master.{pair}.position", f"slave.{pair}.position"
    error = f"{pair}.position_error"
    read = run.read(master, slave, error)
    if master in read:
        view.lines["master.position"] = trace(time, read[master])
    if error in read:
        view.lines["error"] = trace(time, read[error])
    if master in read and error in read:
        # The loop's own error already includes scale, sign and the offset taken when engaging.
        view.lines["slave.position"] = trace(time, read[master] - read[error])
    elif slave in read:
        scale = number(settings.get("position_scale")) or 1.0
        sign = number(settings.get("sign")) or 1.0
        mapped = sign * read[slave] / scale
        shift = read[master][0] - mapped[0] if master in read else 0.0
        view.lines["slave.position"] = trace(time, mapped + shift)
    del read
    _keep(run, view, time, {f"true.master.{pair}.reference": "reference"})


def _efforts(run: Run, view: PairView, settings: dict[str, Any], time: Floats) -> None:
    pair = view.name
    columns: dict[str, str] = {}
    for side in SIDES:
        names = ["port_effort", "wall_effort", "measured_effort"]
        if block(run.rig, side, "axes", pair).get("causality", "impedance") == "impedance":
            names.append("commanded")
        columns |= {f"{side}.{pair}.{name}": f"{side}.{name}" for name in names}
        for name in ("hand_effort", "environment_effort"):
            columns[f"true.{side}.{pair}.{name}"] = f"{side}.{name}"
    _keep(run, view, time, columns)
    scale = number(settings.get("position_scale")) or 1.0
    force_scale = number(settings.get("force_scale")) or 1.0 / scale
    sign = number(settings.get("sign")) or 1.0
    view.to_slave = sign * force_scale
    for side in SIDES:
        measured = view.lines.get(f"{side}.measured_effort")
        if measured is not None:
            # An admittance port carries the measured effort and responds with a velocity.
            view.lines[f"{side}.port_effort"] = measured.times(-1.0)
    for side, factor in (("master", -1.0), ("slave", 1.0 / view.to_slave)):
        line = view.lines.get(f"{side}.port_effort")
        if line is not None:
            view.lines[f"{side}.transmitted"] = line.times(factor)
    felt = view.lines.get("master.transmitted")
    each = offset_per_effort(run, pair)
    if felt is not None and each is not None:
        view.lines["expected"] = felt.times(each)


def _touch(run: Run, view: PairView, settings: dict[str, Any], time: Floats) -> None:
    pair = view.name
    environment = block(run.rig, "simulation", "environment", pair)
    view.held = environment.get("type") == "spring"
    if not view.held:
        column = f"true.slave.{pair}.environment_effort"
        _touch_one(run, view, time, "environment", column, "slave", environment)
    for side in ("slave", "master"):
        column = f"{side}.{pair}.wall_effort"
        wall = block(settings, f"wall_{side}")
        _touch_one(run, view, time, f"wall_{side}", column, side, wall)
    _zoom(run, view, time)
    if view.stop is not None and view.stop.pair in ("", pair):
        _around_stop(run, view, time, view.stop.at_s)


def _around_stop(run: Run, view: PairView, time: Floats, at_s: float) -> None:
    """Keep the velocities within a quarter of a second of a stop."""
    window = slice(*np.searchsorted(time, (at_s - 0.25, at_s + 0.25)).tolist())
    names = {f"{side}.{view.name}.velocity": f"stop.{side}" for side in SIDES}
    for column, values in run.read(*names, rows=window).items():
        if len(values) > 1:
            view.zoom[names[column]] = trace(time[window], values)


def _touch_one(
    run: Run, view: PairView, time: Floats, cause: str, column: str, side: str, wall: dict[str, Any]
) -> None:
    axis = f"{side}.{view.name}"
    place = f"true.{axis}.position" if cause == "environment" else f"{axis}.position"
    if column not in run.columns:
        return
    read = run.read(column, place)
    effort, position = read[column], read.get(place)
    if column.endswith(RESISTING):
        effort = -effort
    edge = number(wall.get("position"))
    below = wall.get("side") in ("below", -1, "-1")
    depth = None
    if position is not None and edge is not None:
        depth = edge - position if below else position - edge
    contacts = find_contacts(time, effort, depth)
    view.contacts[cause] = contacts
    strongest = sorted(contacts, key=lambda c: -c.peak_effort)[:6]
    across = depth if depth is not None else position
    if across is None:
        return
    view.phase[cause] = []
    for contact in sorted(strongest):
        inside = slice(contact.first, contact.last + 1)
        loop = trace(across[inside], effort[inside], 400)
        view.phase[cause].append((loop.time.copy(), (loop.value if below else -loop.value).copy()))


def _zoom(run: Run, view: PairView, time: Floats) -> None:
    """Keep a short window about the hardest contact, or else the steepest wave."""
    if view.cause:
        centre = max(view.contacts[view.cause], key=lambda c: c.peak_effort).start_s
    elif "master.wave_out" in view.lines:
        line = view.lines["master.wave_out"]
        at, wave = line.time, line.value
        if line.middle_time is not None and line.middle is not None:
            at, wave = line.middle_time, line.middle
        steepest = np.abs(np.diff(wave, prepend=wave[:1]))
        centre = float(at[int(np.argmax(np.nan_to_num(steepest)))])
    else:
        return
    low, high = centre - max(0.03, 1.5 * view.delay_s), centre + max(0.25, 6.0 * view.delay_s)
    first, last = np.searchsorted(time, (low, high)).tolist()
    if last - first < 2:
        return
    columns = {"environment": f"true.slave.{view.name}.environment_effort"}
    for side in SIDES:
        for name in ("port_effort", "measured_effort", "wall_effort", "wave_in", "wave_out"):
            columns[f"{side}.{name}"] = f"{side}.{view.name}.{name}"
    window = slice(first, last)
    read = run.read(*columns.values(), rows=window)
    for name, column in columns.items():
        if column in read:
            line = trace(time[window], read[column])
            sense = -1.0 if column.endswith(RESISTING) else 1.0
            view.zoom[name] = Trace(line.time.copy(), sense * line.value)
    for side in SIDES:
        if f"{side}.measured_effort" in view.zoom:
            view.zoom[f"{side}.port_effort"] = view.zoom[f"{side}.measured_effort"].times(-1.0)
