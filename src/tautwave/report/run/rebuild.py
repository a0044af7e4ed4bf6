"""Rebuild a summary as far as the recording allows (after a crash or a kill)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tautwave.columns import ACCOUNT
from tautwave.report.figures.envelope import Floats
from tautwave.report.hooks import report_hooks
from tautwave.report.link import link_figures
from tautwave.report.motors import given_energy, motor_energy, worst_moment
from tautwave.report.run.rundir import (
    Run,
    block,
    delay_of,
    engaged_rows,
    kind_of,
    offset_per_effort,
    served_rows,
)
from tautwave.report.units import number

_PERCENTILES = {"p50": 50.0, "p99": 99.0, "p999": 99.9}


def rebuild_summary(run: Run) -> dict[str, Any]:
    """Summary of `run` from its recording; unrecorded values are absent.

    Returns
    -------
    dict[str, Any]
        The keys of summary.json. Energies in J, times in us where the key says so.
    """
    summary: dict[str, Any] = {
        "rig": run.name,
        "outcome": {"kind": "unknown", "sentence": "How the run ended is not recorded."},
        "cycles": run.rows,
        "certificate": {"passed": None, "verdicts": {}},
        "rebuilt": True,
    }
    rate = run.rate_hz
    if np.isfinite(rate):
        summary["rate_hz"] = rate
    if run.rows == 0:
        return summary
    if run.time is not None and run.rows > 1:
        summary["duration_s"] = float(run.time[-1] - run.time[0])
        summary["period_us"] = spread(periods_us(run.time, run.read("lateness_us"), rate))
    for name, values in run.each(("lateness_us", "compute_us")):
        summary[name] = spread(values)
    for _, values in run.each(("skipped_slots",)):
        summary["missed_cycles"] = int(np.nansum(values))
    pairs = {pair: _pair(run, pair) for pair in run.pairs}
    summary["pairs"] = pairs
    books = [p.pop("_books") for p in pairs.values()]
    summary["energy_j"] = {
        "gross_flow": sum(b[0] for b in books),
        "residual": _known(sum(b[1] for b in books)),
        "generated": sum(
            float(e["generated"]) for p in pairs.values() for e in p["elements"].values()
        ),
    }
    if run.ports:
        summary["energy_j"] = report_hooks().books(run)
    summary["energy_j"].update(_motors(run, pairs))
    summary["axes"] = _axes(run)
    return summary


def _motors(run: Run, pairs: dict[str, Any]) -> dict[str, float]:
    """Return the energy all motors delivered, net and at worst, and their allowed debt [J]."""
    axes = [f"{side}.{pair}" for pair in pairs for side in run.sides]
    axes += [f"master.{port}" for port in run.ports]
    supplied = given_energy(run, axes) if axes else None
    if supplied is None or not np.isfinite(supplied).all():
        return {}
    moment = worst_moment(run, supplied)
    energies = {f"motors_{key}": moment[key] for key in ("net", "worst")}
    motors = [block(pair, "motors") for pair in pairs.values()]
    if motors and all("stated_debt" in each for each in motors):
        energies["stated_debt"] = sum(float(each["stated_debt"]) for each in motors)
    return energies


def _known(value: float) -> float | None:
    """None for NaN, which JSON lacks; the books then count as not closed."""
    return value if np.isfinite(value) else None


def spread(values: Floats) -> dict[str, float]:
    """Percentiles 50, 99, 99.9 and maximum, in the unit of `values`; empty if none is finite."""
    known = values[np.isfinite(values)]
    if known.size == 0:
        return {}
    # `known` is already a copy; sorting it in place saves another one.
    values_at = np.percentile(known, list(_PERCENTILES.values()), overwrite_input=True)
    percentiles = dict(zip(_PERCENTILES, values_at.tolist(), strict=True))
    return {**percentiles, "max": float(known.max())}


def periods_us(time: Floats, read: dict[str, Floats], rate_hz: float) -> Floats:
    """Time between the starts of neighbouring cycles [us], shape (n - 1,).

    Where `time` [s] is the slot on the rate's grid, the lateness in `read` is added to it.
    """
    late = read.get("lateness_us")
    if late is not None and np.isfinite(rate_hz) and len(time):
        slots = (time[:1000] - time[0]) * rate_hz
        if float(np.abs(slots - np.round(slots)).max()) < 1e-3:
            return 1e6 * np.diff(time) + np.diff(late)
    return 1e6 * np.diff(time)


def element_books(run: Run, pair: str, element: str) -> tuple[Floats, Floats, Floats] | None:
    """Absorbed, stored and dissipated [J] of one element, or None when not all were recorded."""
    names = [f"{pair}.{element}.{kind}" for kind in ACCOUNT]
    books = run.read(*names)
    if len(books) < 3:
        return None
    return books[names[0]], books[names[1]], books[names[2]]


class Balance:
    """Energy that entered a pair's elements minus what they stored and dissipated [J].

    Add one element at a time, so that an hour of recording stays small in memory. The input is the
    energy the motors took out of the devices (`port_energy`) if recorded, which also reveals a loss
    between elements; else the energy the elements report as absorbed.
    """

    def __init__(self, run: Run, pair: str) -> None:
        self.total = np.zeros(run.rows)
        self.gross_flow = 0.0
        ports = [f"{side}.{pair}.port_energy" for side in run.sides]
        self.by_ports = all(port in run.columns for port in ports)
        if self.by_ports:
            for _, entered in run.each(ports):
                self.total += entered - entered[0]
            for _, flow in run.each(f"{side}.{pair}.gross_flow" for side in run.sides):
                self.gross_flow += float(flow[-1])
        self._by_flow = self.gross_flow > 0.0

    def add(self, absorbed: Floats, stored: Floats, dissipated: Floats) -> None:
        """Book one element."""
        if not self.by_ports:
            self.total += absorbed - absorbed[0]
        self.total -= stored - stored[0]
        self.total -= dissipated - dissipated[0]
        if not self._by_flow:
            self.gross_flow += float(np.nansum(np.abs(np.diff(absorbed))))


def _pair(run: Run, pair: str) -> dict[str, Any]:
    summary: dict[str, Any] = {"kind": kind_of(run, pair), "elements": {}}
    engaged = engaged_rows(run)
    for key in ("position_error", "effort_error"):
        values = run.read(f"{pair}.{key}").get(f"{pair}.{key}")
        if values is not None and engaged is not None:
            values = values[engaged]  # what is not coupled is no error
        if values is not None and np.isfinite(values).any():
            summary[key] = _size(values)
    late = _delayed_error(run, pair)
    if late is not None:
        summary["delayed_error"] = _size(late)
    offset = _expected_offset(run, pair)
    if offset is not None:
        summary["expected_offset"] = offset
    balance = Balance(run, pair)
    for element in run.elements(pair):
        account = _element(run, pair, element, balance)
        if account:
            summary["elements"][element] = account
    link = link_figures(run, pair)
    if link:
        summary["link"] = link
    motors = motor_energy(run, pair)
    if motors:
        summary["motors"] = motors
    summary["_books"] = (balance.gross_flow, float(np.max(np.abs(balance.total))))
    return summary


def _size(values: Floats) -> dict[str, float]:
    known = values[np.isfinite(values)]
    return {
        "rms": math.sqrt(float(np.dot(known, known)) / len(known)),
        "max": float(max(known.max(), -known.min())),
    }


def _delayed_error(run: Run, pair: str) -> Floats | None:
    """Return the error against where the master was a line's delay ago [master units].

    What the line itself causes is left out of it. None without a delay.
    """
    delay = number(block(run.rig, "coupling").get("delay_s")) or 0.0
    late = round(delay * run.rate_hz) if np.isfinite(run.rate_hz) else 0
    read = run.read(f"{pair}.position_error", f"master.{pair}.position")
    if len(read) < 2 or not 0 < late < run.rows:
        return None
    error, master = read.values()
    delayed = error[late:] - master[late:] + master[:-late]
    engaged = engaged_rows(run)
    if engaged is not None:
        delayed = delayed[engaged[late:]]
    return delayed if np.isfinite(delayed).any() else None


def _expected_offset(run: Run, pair: str) -> float | None:
    """Offset of the line [master units] at the greatest effort, averaged over the delay and 20 ms.

    Shorter efforts are shocks and noise, over before an offset has built up.
    """
    each = offset_per_effort(run, pair)
    names = [f"master.{pair}.measured_effort", f"master.{pair}.port_effort"]
    effort = next((read for name in names for read in run.read(name).values()), None)
    if each is None or effort is None or not np.isfinite(run.rate_hz):
        return None
    size = min(len(effort), max(1, round((0.02 + delay_of(run, pair)) * run.rate_hz)))
    sustained = effort[: len(effort) // size * size].reshape(-1, size).mean(axis=1)
    sustained = np.abs(sustained[np.isfinite(sustained)])
    return each * float(sustained.max()) if sustained.size else None


def _element(run: Run, pair: str, element: str, balance: Balance) -> dict[str, float]:
    books = element_books(run, pair, element)
    if books is None:
        return {}
    balance.add(*books)
    absorbed, stored, dissipated = books
    return {
        "absorbed": float(absorbed[-1]),
        "stored": float(stored[-1]),
        "dissipated": float(dissipated[-1]),
        "generated": max(0.0, -float(np.nanmin(absorbed))),
        "held": float(np.nanmax(np.abs(stored))),
    }


def _axes(run: Run) -> dict[str, Any]:
    lost: dict[str, Any] = {}
    for column, valid in run.each(c for c in run.columns if c.endswith(".valid")):
        axis = column.removesuffix(".valid")
        lost[axis] = {"lost": int(np.sum(valid[served_rows(run, axis)] == 0.0))}
    return lost
