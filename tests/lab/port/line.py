"""What a line of 20 ms costs on the README's rig, by its impedance: offset, inertia, effort."""

from __future__ import annotations

import numpy as np

from tautwave.bench.result import Table, Value
from tautwave.bench.rigs import ONE_PAIR
from tautwave.laws.wave_filter import filter_gain
from tautwave.simulation import simulate
from tests.lab.port.rigs import WAVE
from tests.lab.port.tracking import rms

IMPEDANCES = (0.02, 0.05, 0.1)
DELAY_S, CORNER_HZ = 0.02, 100.0
SETTLED = 0.1
"""Share of the run left out at the start, and half as much at the end."""


def line_table() -> Table:
    """Return error, its part F tau / b, effort and the line's own inertia, by impedance."""
    rows: list[list[Value]] = []
    for impedance in IMPEDANCES:
        keys = f"wave_impedance: {impedance}, wave_filter_hz: {CORNER_HZ:g}"
        rig = ONE_PAIR.load(
            [f"coupling={{law: {WAVE}, delay_s: {DELAY_S}, pairs: {{lever: {{{keys}}}}}}}"]
        )
        period = 1.0 / rig.rate_hz
        gain = filter_gain(CORNER_HZ, period)
        delay = DELAY_S + period + period * (1.0 - gain) / gain
        run = simulate(rig, engine="python")
        count = len(run["lever.position_error"])
        part = slice(int(SETTLED * count), int((1.0 - 0.5 * SETTLED) * count))
        error = run["lever.position_error"][part]
        effort = 0.5 * (
            run["master.lever.port_effort"][part] - run["slave.lever.port_effort"][part]
        )
        offset = effort * delay / impedance
        rows.append(
            [
                impedance,
                1e3 * rms(error),
                1e3 * rms(offset),
                1e3 * rms(error - offset),
                1e3 * rms(np.asarray(effort)),
                1e6 * impedance * DELAY_S,
            ]
        )
    return Table(
        "The README's rig, a line of 20 ms, by its impedance; no local walls",
        "rms of the error; of F tau / b, tau with a period and the filter's lag; of what is left; "
        "of the effort; inertia b tau of the line in free motion (the levers: 1584, 2100 mg m2)",
        ("b", "error_mrad", "offset_mrad", "left_mrad", "effort_mNm", "line_mg_m2"),
        rows,
    )
