"""The laboratory bench at 2 kHz, moved by real operators: recordings beside the checkout.

Origin of the recordings: Ohara124c41/Haptics-Bilateral_Teleoperation-1DOF_Experiments (MIT), TU/e
robotics lab. They are not part of the project; without them these tests are skipped.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave import load_rig, simulate

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "teleop-1dof"
RIG = ROOT / "configs" / "bench-1dof-2khz.yaml"
CUT = "coupling.pairs.lever.wave_impedance=1e-6"  # nothing holds the slave to the master
FREE = "{type: free}"
CASES = {
    "hand_reference": FREE,
    "m1_a_free_motion": FREE,
    "m1_d_free_motion": FREE,
    "m2_a_free_motion": FREE,
    "m1_a_spring": "{type: spring, stiffness: 1.0, position: 0.0}",
    "m1_a_foam": "{type: foam, stiffness: 8.0, loss: 0.5, position: 0.05}",
    "m1_a_rigid": "{type: wall, stiffness: 20.0, damping: 0.005, position: 0.05}",
}
"""What the slave meets while a recording moves the master."""

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"no recordings in {DATA}")


def recorded(name: str) -> Any:
    """Return the columns of a recording."""
    return np.genfromtxt(DATA / f"{name}.csv", delimiter=",", names=True)


def rms(values: Any) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def missed(name: str, *more: str) -> str:
    """Run 4.5 s of a case; return how it falls short, "" if the slave follows the hand.

    That is to 0.3 of the master's motion, and in free motion to twice what the laboratory
    measured between its levers.
    """
    column = "hand_reference" if name == "hand_reference" else "master_position_rad"
    reference = f"{{type: recording, file: {DATA / name}.csv, column: {column}}}"
    keys = [
        f"simulation.hand.lever.reference={reference}",
        f"simulation.environment.lever={CASES[name]}",
        *more,
    ]
    run = simulate(load_rig(RIG, keys), duration_s=4.5, engine="python")
    assert run.error is None
    ours = rms(run["lever.position_error"])
    motion = rms(run["true.master.lever.position"])
    found = []
    if not ours < 0.3 * motion:
        found.append(f"{ours:.3g} rad rms of a motion of {motion:.3g}")
    if name.endswith("free_motion"):
        lines = recorded(name)
        theirs = rms(lines["master_position_rad"] - lines["slave_position_rad"])
        if not ours < 2.0 * theirs:
            found.append(f"{ours:.3g} rad rms where the laboratory had {theirs:.3g}")
    return "; ".join(found)


@pytest.mark.sparse(8)
@pytest.mark.parametrize("name", CASES)
def test_the_slave_follows_a_recorded_hand(name: str) -> None:
    assert not missed(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_with_the_coupling_cut_it_does_not(name: str) -> None:
    how = missed(name, CUT)
    assert "rad rms of a motion" in how
    assert ("where the laboratory had" in how) == name.endswith("free_motion")
