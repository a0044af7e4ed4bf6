"""Modbus drives over TCP and RTU: a map of registers given as data, at the rate the line carries.

    options.py    the `options` block of a bus, and what a rig's axes need of it
    profile.py    families of drives as data; profiles/ those that are shipped
    protocol/     requests and responses as bytes, register types, exception texts; no I/O
    line/         links (TCP, RTU), ports, and the client that waits for a response
    sequence.py   enabling and disabling step by step; machine402.py by CiA 402
    station.py    one drive in the cycle: what is requested of it, what its responses mean
    bringup.py    checks and settings before enabling; enabling.py from off to on, step by step
    driver.py     the driver the loop sees
    budget.py     bus time; scan.py finding drives; measure.py the host's cost

Only `protocol/frames.py` imports pymodbus, with the first frame.
"""

from tautwave_drivers.modbus.plugin import plugin

__all__ = ["plugin"]
