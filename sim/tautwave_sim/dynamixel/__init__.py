"""Simulated Dynamixel servos: their own packets, control tables and motors, on a wire with a speed.

What a driver may rely on
-------------------------
**Exchange and slot.** Packets of the host closer together than 0.1 ms are one exchange; its time is
that of its first byte. A servo latches at the slot round((time - origin) / period) of the exchange,
whatever time the wire takes afterwards: it moves up to that slot under its old command, then a sync
write in the exchange acts at once, then a sync read in it reports the sample of that slot. So the
goal sent with the exchange of slot k acts from slot k on, and a command that is staged until the
next exchange has a delay of exactly one period.

**Beginning.** An axis is held until the first sync or bulk read (fast or not) whose servos all
have their torque on; that exchange is slot 0. A plain read (0x02) is not one. Once the host has
switched all torque off the axes are held again, until the next such exchange. `tautwave sim
dynamixel` has no rig, and its servos move from the beginning on.

**Units.** Position [rad] = direction (counts - zero) 2 pi / 4096 / gear, zero 2048 by default;
effort [N m] = direction current_unit torque_constant gear counts, the torque constant by default
stall torque over stall current of the e-manual; velocity 0.229 rev/min / gear. An admittance axis
reports as Present Current the torque that holds the external effort: minus that effort.

**Missing servos.** In a sync read the servo behind a missing one waits as long as the missing
response would have taken. A fast sync read ends before the first silent servo, because every
checksum covers all bytes before it; it is never stuffed, as the e-manual says.

**Before.** Unless `simulator.factory` is set, servos come as the bus options and axes want them:
baud rate, return delay, current limit, current mode for impedance and velocity mode for admittance
axes. Goal Current begins at Current Limit, as on real servos: set it before torque on.

Assumed
-------
Where the e-manual is silent: a servo refuses Torque Enable after a shutdown with Result Fail; an
error that Shutdown(63) leaves out still sets Hardware Error Status and the alert bit; a wrong
checksum gets a response at status return level 2 only; the response to a change of id, baud rate
or protocol is the old way; a reboot takes 0.2 s; only instructions to a servo, or to all, feed its
watchdog. A read may cross addresses that hold nothing. Velocity and position are small
loops, not ROBOTIS' PID. Factory reset (0x06) is refused with Result Fail while the torque is on,
ends in a reboot, and to all servos at once it is ignored where it would reset the id. Control
Table Backup (0x20) is unknown.
"""

from __future__ import annotations

from tautwave.contracts import SimulatorPlugin
from tautwave_sim.dynamixel.options import BenchOptions, DynamixelOptions
from tautwave_sim.dynamixel.world import bench, serve, simulate
from tautwave_sim.wire.serial_world import is_served

simulator = SimulatorPlugin(
    options=DynamixelOptions,
    make=simulate,
    summary="Dynamixel servos on a pseudo-terminal",
    served=is_served,
    serve=serve,
    bench_options=BenchOptions,
    bench=bench,
    instead=lambda options: {"port": "sim"},
)
