"""The laboratory's bench as identified, with each law: the same devices, hand and contacts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tautwave.config import Rig
from tautwave.config.load import parse_rig
from tautwave.simulation.run import is_compiled

HERE = Path(__file__).parent / "laws"
WAVE = "wave"
IMPEDANCE, POLE, FILTER_HZ = 0.06, 0.5, 200.0
"""One setting of the law for everything [N m s/rad, 1, Hz]."""

SETTING = f"after: b {IMPEDANCE:g} N m s/rad, pole {POLE:g}, wave filter {FILTER_HZ:g} Hz"

LAWS: Mapping[str, str] = {
    "before": f"{{part: {HERE / 'account_port.py'}, pairs: {{lever: {{wave_impedance: 0.02, "
    "wave_filter_hz: 200, velocity_filter_s: 0.002}}}",
    "after": f"{{law: {WAVE}, pairs: {{lever: {{wave_impedance: {IMPEDANCE}, wave_filter_hz: "
    f"{FILTER_HZ}, pole_master: {POLE}, pole_slave: {POLE}}}}}}}",
    "lab": f"{{part: {HERE / 'derivative.py'}, pairs: {{lever: {{stiffness: 25.4, "
    "damping: 0.121, derivative_filter_s: 0.0025}}}",
}
"""Before: as bench-1dof-2khz was shipped. Lab: controller c of the recordings, by regression."""

CONTACTS: Mapping[str, str] = {
    "free": "{type: free}",
    "foam": "{type: foam, stiffness: 5.5, loss: 0.5, position: -0.03}",
    "spring": "{type: spring, stiffness: 4.7, position: 0.0}",
    "rigid": "{type: wall, stiffness: 250.0, damping: 0.02, position: 0.0}",
}
GRIP = "lever_arm: 0.075"
IMPOSED = "lever_arm: 0.075, stiffness: 2.0e6, damping: 400.0, mass: 0.01"
"""A grip that leaves the lever no choice: 11 kN m/rad."""

COULOMB, VISCOUS = 0.025, 0.01

BENCH = """
name: port-bench
rate_hz: 2000
duration_s: {seconds!r}
seed: 2
buses: {{bench: {{driver: loopback}}}}
master: {{axes: {{lever: {{bus: bench, id: 1, {axis}}}}}}}
slave: {{axes: {{lever: {{bus: bench, id: 2, {axis}}}}}}}
coupling: {law}
simulation:
  axes:
    master.lever: {device}
    slave.lever: {device}
  hand: {{lever: {{{grip}, reference: {reference}}}}}
  environment: {{lever: {contact}}}
"""
AXIS = (
    "kind: rotary, inertia: {value: 1.584e-3, lower: 1.1e-3, source: 1/631.36 by the laboratory}, "
    "damping: {value: 2.0e-3, lower: 1.0e-3, source: estimated}, effort_limit: 1.125, "
    "effort_rate_limit: 1000, velocity_limit: 20, position_range: [-0.7, 0.7], "
    "encoder_quantum: 2.094e-5"
)


def bench_rig(
    law: str,
    reference: str,
    contact: str,
    *,
    noise: float,
    seconds: float,
    grip: str = GRIP,
    coulomb: float = COULOMB,
    viscous: float = VISCOUS,
) -> Rig:
    """Return the bench with a law of `LAWS`.

    Parameters
    ----------
    law, reference, contact : str
        Name of the law, or its block; hand's reference and slave's environment, as in a rig file.
    noise : float
        Standard deviation of the position noise [rad].
    seconds : float
        Duration [s].
    grip : str
        Keys of the hand.
    coulomb, viscous : float
        Friction of the devices [N m, N m s/rad].
    """
    text = BENCH.format(
        seconds=seconds,
        axis=f"{AXIS}, position_noise: {noise!r}",
        law=LAWS.get(law, law),
        device=f"{{inertia: 1.584e-3, damping: {viscous!r}, coulomb: {coulomb!r}}}",
        grip=grip,
        reference=reference,
        contact=contact,
    )
    return parse_rig(text, Path("port-bench.yaml"))


def fastest(rig: Rig) -> str:
    """Return the engine of least time; rows are the same to the bit, and nothing is compiled."""
    return "compiled" if is_compiled(rig) else "python"
