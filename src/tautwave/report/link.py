"""What the network of a run was like at each side, and what its receivers gave; from the recording.

Energies of receivers and network are whole multiples of `laws.counters.ENERGY_QUANTUM`, so whether
one gave more than it got is a comparison of integers.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from tautwave.laws.counters import ENERGY_QUANTUM
from tautwave.report.figures.envelope import Floats
from tautwave.report.run.rundir import SIDES, Run, axis_kind, block
from tautwave.report.units import axis_units, number, quantity, ratio
from tautwave.summary.model import LinkEnd, Side

ALWAYS = ("delay", "silence", "lost")
COLUMNS = (*ALWAYS, "depth", "backlog", "cut")


class Kept(NamedTuple):
    """What a receiver or the network held at its least [J], and what it may: nothing, or less."""

    element: str
    least: float
    reserve: float

    @property
    def passed(self) -> bool:
        """Whether no quantum more came out than went in and the reserve; NaN is more."""
        quanta = round(self.least / ENERGY_QUANTUM) if np.isfinite(self.least) else -(1 << 52)
        return quanta >= -math.floor(self.reserve / ENERGY_QUANTUM)

    @property
    def sentence(self) -> str:
        """A receiver that gave too much in a sentence; empty for any other."""
        if self.passed:
            return ""
        much, may = quantity(-self.least, "J", 3), quantity(self.reserve, "J", 3)
        return f"{self.element}: supplied {much} more than was sent to it; its reserve is {may}."


def kept_of(run: Run) -> Iterator[Kept]:
    """Yield receivers and networks of all pairs, as far as they are recorded."""
    for pair in run.pairs:
        reserve = run.result_of(pair).receiver_j or 0.0
        names = {f"receiver of {side}.{pair}": f"{pair}.receiver_{side}" for side in SIDES}
        if run.site is None:  # what came to one site is what left the other
            names[f"network of {pair}"] = f"{pair}.network"
        for name, element in names.items():
            for _, stored in run.each([f"{element}.stored"]):
                own = 0.0 if name.startswith("network") else reserve
                yield Kept(name, float(stored.min()), own)


def link_figures(run: Run, pair: str) -> dict[str, dict[str, float]]:
    """Return by side what came there: shares of packets and cycles, times [s], backlog [rad, m].

    `link_s` and `play_out_s` are medians of the parts of the delay, `held_s` how long no packet had
    come for longer than the rig's `silence_s`, `holds` how often. Empty without a network.
    """
    limit = number(block(run.rig, "link").get("silence_s"))
    figures: dict[str, dict[str, float]] = {}
    for side in SIDES:
        read = run.read(*(f"{side}.{pair}.link_{name}" for name in COLUMNS), "skipped_slots")
        if not all(f"{side}.{pair}.link_{name}" in read for name in ALWAYS):
            continue
        skipped = read["skipped_slots"]
        delay, silence, lost, depth, backlog, cut = (
            # a law that takes the newest word plays nothing out, and owes nothing
            read.get(f"{side}.{pair}.link_{name}", np.zeros_like(skipped))
            for name in COLUMNS
        )
        slots = 1.0 + np.nan_to_num(skipped)
        begun = delay > 0.0
        passed = float(np.sum(slots[np.argmax(begun) :])) if begun.any() else 0.0
        silent = silence > (np.inf if limit is None else limit)
        figures[side] = {
            "loss": float(lost[-1]) / max(passed, 1.0),
            "cut": float(cut[-1]) / max(passed, 1.0),
            "backlog": float(np.abs(backlog).max()),
            "held_s": float(np.sum(slots[silent])) / run.rate_hz,
            "holds": int(np.count_nonzero(np.diff(silent.astype(int)) > 0)),
            **_times(delay[begun & ~silent], depth[begun & ~silent]),
        }
    return figures


def _times(delay: Floats, depth: Floats) -> dict[str, float]:
    if not len(delay):
        return {}
    median, late = np.percentile(delay, (50.0, 99.0))
    return {
        "delay_p50_s": float(median),
        "delay_p99_s": float(late),
        "link_s": float(np.median(delay - depth)),
        "play_out_s": float(np.median(depth)),
    }


def link_sentences(run: Run) -> list[str]:
    """Return what the network did to each side, and the delays."""
    sentences = []
    for pair in run.pairs:
        sides = run.result_of(pair).link
        position, _ = axis_units(axis_kind(run, "master", pair))
        for side, figures in sides.items():
            text = f"{side}.{pair}: {ratio(100.0 * (figures.loss or 0.0))} % of the packets lost"
            if figures.delay_p50_s is not None:
                text += (
                    f", waves {quantity(figures.delay_p50_s, 's')} old at the median, "
                    f"{quantity(figures.delay_p99_s, 's')} at p99"
                )
            text += f"; up to {quantity(figures.backlog, position)} owed"
            if figures.cut:
                text += f", energy short in {ratio(100.0 * figures.cut)} % of the cycles"
            if figures.holds:
                text += f"; held {figures.holds} x, {quantity(figures.held_s, 's')} in all"
            sentences.append(f"{text}.")
        budget = _budget(run, pair, sides)
        sentences += [budget] if budget else []
    return sentences


def _budget(run: Run, pair: str, sides: Mapping[Side, LinkEnd]) -> str:
    """Return the one-way delay as `check` expects it and as it was, part by part."""
    expected = {part: one or 0.0 for part, one in run.result_of(pair).delay_budget_s.items()}
    known = [figures for figures in sides.values() if figures.link_s is not None]
    if not expected or not known:
        return ""
    measured = dict(expected)
    measured["link"] = sum(figures.link_s or 0.0 for figures in known) / len(known)
    measured["play_out"] = sum(figures.play_out_s or 0.0 for figures in known) / len(known)
    period = run.result.period_us.p50
    measured["sensing"] = expected["sensing"] if period is None else 1e-6 * period
    parts = ", ".join(
        f"{part.replace('_', '-')} {1e3 * measured[part]:.4g} ({1e3 * value:.4g})"
        for part, value in expected.items()
    )
    compute = run.result.compute_us.p99
    inside = (
        "" if compute is None else f"; computing accounted for {1e-3 * compute:.3g} of it at p99"
    )
    return (
        f"{pair}: {1e3 * sum(measured.values()):.4g} ms one way at the median, "
        f"{1e3 * sum(expected.values()):.4g} expected: {parts} ms{inside}."
    )
