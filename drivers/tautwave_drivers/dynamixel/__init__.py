"""Dynamixel servos on a serial line: X series over protocol 2.0; AX and MX are found by `scan`.

    options.py    the `options` block of a bus, and what a rig's axes need of it
    packet.py     protocol 2.0 as bytes; fast.py its fast sync read; packet1.py protocol 1.0
    registers.py  control tables as data; models.py units and stall slopes per model
    units.py      counts of one servo and SI of its axis
    port.py       a serial device; ftdi.py the latency timer of its adapter
    line.py       one transaction at a time: ping, read, write, reboot; sdk.py: by the vendor
    bringup.py    what is checked and set before torque
    exchange.py   one sync write and one sync read a cycle
    driver.py     the driver the loop sees; enabling.py, indirect.py, watching.py parts of it
    budget.py     bus time; scan.py finding servos; measure.py the host's cost

Nothing here imports the vendor library but `sdk.py`, and only when `transport: sdk` asks for it.
"""

from tautwave_drivers.dynamixel.plugin import plugin

__all__ = ["plugin"]
