"""Simulated Modbus servo drives, on TCP or on an RTU line.

Registers, machines and limits by family (`tables/`); wire time by the baud rate; the motors move in
slots of the bus' period. Slot 0 of a drive is the first request that finds it on and writes a
command register (FC 6, 16 or 23): that request's sample is slot 0's, its command acts from slot 0
on. A later command belongs to the slot that its first byte's time since then is nearest to; what
only reads belongs to the slot of the last command, unless whole periods have passed. The first
request in a new slot, to whichever drive, lets all drives pass it and sample. So every drive may be
polled at a phase of its own, command first; host lateness below half a period moves nothing; and
what a loop writes in cycle k acts from slot k + 1 on: a command delay of one period of the bus.
Until slot 0 an axis is held where it is; switched off and on again it is held again.
"""

from tautwave_sim.modbus.plugin import simulator

__all__ = ["simulator"]
