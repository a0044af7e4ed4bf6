"""What README.md says of its rig, and of the same levers over 20 ms."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.certificate import certify
from tautwave.config import Rig, load_rig
from tautwave.simulation import Simulation, simulate
from tests.certificate.rigs import CONFIGS
from tests.lab.couplings.frontier import LAWS_OF_LAB
from tests.lab.port.tracking import ABOVE_HZ, rms

ROOM = CONFIGS / "bench-room-loopback.yaml"


def room(*settings: str) -> Rig:
    return load_rig(ROOM, settings)


def loud(run: Simulation, period: float) -> float:
    """Return both motors' efforts above 20 Hz [N m]."""
    found = []
    for side in ("master", "slave"):
        values = run[f"{side}.lever.commanded"]
        parts = np.fft.rfft(values - np.mean(values))
        parts[np.fft.rfftfreq(len(values), period) < ABOVE_HZ] = 0.0
        found.append(rms(np.fft.irfft(parts, len(values))))
    return rms(np.array(found))


@pytest.mark.slow
def test_two_levers_in_a_room_are_close_and_quiet() -> None:
    rig = room()
    assert rig.coupling.law == "wave"
    assert certify(rig).passed
    run = simulate(rig, engine="python")
    assert run.error is None
    assert rms(run["lever.position_error"]) < 12e-3
    assert np.max(np.abs(run["lever.position_error"])) < 20e-3
    walls = rig.coupling.pairs["lever"]
    inner = ", ".join(
        f"{key}: {{position: {wall.position}, stiffness: {wall.stiffness}, "
        f"damping: {wall.damping}, side: {wall.side}}}"
        for key, wall in (("wall_master", walls.wall_master), ("wall_slave", walls.wall_slave))
        if wall is not None
    )
    block = LAWS_OF_LAB["cf"].block.replace("lever: {", f"lever: {{{inner}, ")
    lab = simulate(room(f"coupling={block}"), engine="python")
    assert loud(run, rig.period_s) < 1.5 * loud(lab, rig.period_s)


@pytest.mark.slow
def test_over_twenty_milliseconds_it_is_a_rendered_model() -> None:
    rig = room("coupling.delay_s=0.02")
    assert rig.coupling.law == "mediated"
    assert certify(rig).passed
    run = simulate(rig, engine="python")
    assert run.error is None
    error = rms(run["lever.position_error"])
    assert error < 14e-3
    line = simulate(room("coupling.delay_s=0.02", "coupling.law=wave"), engine="python")
    assert 2.0 * error < rms(line["lever.position_error"])
