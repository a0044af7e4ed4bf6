"""The steps of an observed wave coupling: line and rate converters are those of law wave."""

from __future__ import annotations

from collections.abc import MutableSequence

from tautwave.contracts import Row
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairState
from tautwave.controller.rows import fill_element
from tautwave.controller.steps import Guard, Law, Steps
from tautwave.couplings.tracked.port import waiting_energy
from tautwave.couplings.tracked.records import WaveLink
from tautwave.couplings.tracked.steps import (
    element_names,
    engage,
    exchange,
    fill_converter,
    fill_signals,
    has_damper,
)
from tautwave.couplings.wave.port import (
    LIMP,
    PORT_OVERDRAWN,
    act,
    close,
    miss,
    start_end,
    think,
)
from tautwave.couplings.wave.records import ObservedEnd


def start(
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    gap: float,
    table: MutableSequence[float],
) -> None:
    """Begin with nothing on its way; the slave's port mends the `gap` [rad or m]."""
    start_end(one, p1, 0.0)
    start_end(two, p2, gap)


def fill_tank(out: Row, at: int, s: AxisState, p: AxisParams, table: MutableSequence[float]) -> int:
    """Write the accounts of a port with its tank, and of its series damper."""
    e = s.end
    weight = p.weight
    waiting = waiting_energy(s, p, table)
    at = fill_element(
        out,
        at,
        weight * (e.port_absorbed + waiting),
        weight * (e.stored + waiting),
        weight * (e.spilled - e.leaked),
    )
    if has_damper(p):
        lost = weight * e.damper_dissipated
        at = fill_element(out, at, lost, 0.0, lost)
    return at


def fill_elements(
    out: Row,
    at: int,
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    table: MutableSequence[float],
) -> int:
    """Write the accounts of ports, converters and line."""
    at = fill_tank(out, at, one, p1, table)
    at = fill_tank(out, at, two, p2, table)
    at = fill_converter(out, at, one, p1)
    at = fill_converter(out, at, two, p2)
    if q.samples > 0:
        at = fill_element(out, at, c.link.line_energy, c.link.line_energy, 0.0)
    return at


law = Law(
    name="observed_wave",
    steps=Steps(
        start=start,
        engage=engage,
        act=act,
        close=close,
        miss=miss,
        exchange=exchange,
        think=think,
        fill_signals=fill_signals,
        fill_elements=fill_elements,
    ),
    end=ObservedEnd,
    link=WaveLink,
    signals=("wave_in", "wave_out"),
    elements=element_names,
    guards={
        PORT_OVERDRAWN: Guard("port_overdrawn", "drew more energy than its port had in reserve"),
        LIMP: Guard(
            "limp",
            "has lost its coupling: its port could not pay for its waves. Its noise is larger than "
            "position_noise and encoder_quantum say, or its port is plain and is moved hard",
        ),
    },
    rings=2,
)
