"""The laboratory bench at 2 kHz, moved by real operators: recordings beside the checkout.

Origin of the recordings: Ohara124c41/Haptics-Bilateral_Teleoperation-1DOF_Experiments (MIT), TU/e
robotics lab. They are not part of the project; without them these tests are skipped.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tautwave import load_rig, simulate

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "teleop-1dof"
RIG = ROOT / "configs" / "bench-1dof-2khz.yaml"
FREE = "simulation.environment.lever={type: free}"

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"no recordings in {DATA}")


def play(name: str, column: str, *more: str) -> np.ndarray:
    """Return master less slave position [rad] of a 4.5 s run on a recorded motion."""
    reference = f"{{type: recording, file: {DATA / name}, column: {column}}}"
    rig = load_rig(RIG, [f"simulation.hand.lever.reference={reference}", *more])
    run = simulate(rig, duration_s=4.5, engine="python")
    assert run.error is None
    return run["lever.position_error"]


def rms(values: np.ndarray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def test_the_recorded_hand_is_followed() -> None:
    assert rms(play("hand_reference.csv", "hand_reference", FREE)) < 0.02


@pytest.mark.parametrize("name", ["m1_a_free_motion", "m1_d_free_motion", "m2_a_free_motion"])
def test_free_motion_tracks_about_as_well_as_the_laboratory_did(name: str) -> None:
    recorded = np.genfromtxt(DATA / f"{name}.csv", delimiter=",", names=True)
    theirs = rms(recorded["master_position_rad"] - recorded["slave_position_rad"])
    ours = rms(play(f"{name}.csv", "master_position_rad", FREE))
    assert ours < 2.0 * theirs


@pytest.mark.parametrize("name", ["m1_a_spring", "m1_a_foam", "m1_a_rigid"])
def test_recorded_contacts_run_against_a_contact(name: str) -> None:
    contact = {
        "m1_a_spring": "{type: spring, stiffness: 1.0, position: 0.0}",
        "m1_a_foam": "{type: foam, stiffness: 8.0, loss: 0.5, position: 0.05}",
        "m1_a_rigid": "{type: wall, stiffness: 20.0, damping: 0.005, position: 0.05}",
    }[name]
    error = play(f"{name}.csv", "master_position_rad", f"simulation.environment.lever={contact}")
    assert rms(error) < 0.06
