"""Dynamixel servos on a serial line: X series over protocol 2.0; AX and MX are found by `scan`.

    options.py    the `options` block of a bus, and what a rig's axes need of it
    protocol/     packets of protocol 2.0 and 1.0, control tables, models, units; no I/O
    line/         one transaction at a time: ping, read, write, reboot; the adapter's latency timer
    bringup.py    checks and settings before torque
    exchange.py   one sync write and one sync read a cycle; fast_path.py for complete responses
    driver.py     the driver the loop sees; enabling.py and watching.py parts of it
    budget.py     bus time; scan.py finding servos; measure.py the host's cost

Only `line/sdk.py` imports the vendor library, and only for `transport: sdk`.
"""

from tautwave_drivers.dynamixel.plugin import plugin

__all__ = ["plugin"]
