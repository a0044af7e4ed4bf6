"""Simulated Feetech servos (STS, HLS, SCS): packets, tables and motors, on a wire with a speed.

For the driver and for anybody else's client. What a driver may rely on: an exchange is packets of
the host closer together than 0.1 ms; it belongs to the slot nearest to its first byte, a goal in it
acts from that slot on, and samples in it are of that slot. So a command staged for the next
exchange has a delay of one period. In a sync read a servo behind a missing one waits as long as the
missing answer would have taken.

Assumed, where no document says: writes at the EEPROM's addresses act at once, locked or not, and
are kept only unlocked; the RAM's goals are zero after power-up and the position goal is where it
stands; torque off clears overload and over-current; a broadcast ping is answered in turns by id; a
wrong checksum gets no answer; PWM 0 brakes as the back-EMF does.
"""

from __future__ import annotations

from tautwave.contracts import SimulatorPlugin
from tautwave_sim.feetech.options import FeetechBench, SimulatedFeetechOptions
from tautwave_sim.feetech.world import bench, serve, simulate
from tautwave_sim.wire.serial_world import is_served

simulator = SimulatorPlugin(
    options=SimulatedFeetechOptions,
    make=simulate,
    summary="Feetech servos on a pseudo-terminal",
    served=is_served,
    serve=serve,
    bench_options=FeetechBench,
    bench=bench,
    instead=lambda options: {"port": "sim"},
    arms=True,
    loops=True,
)
