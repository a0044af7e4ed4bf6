"""Modbus drives over TCP and RTU: a map of registers given as data, at the rate the line carries.

    options.py    the `options` block of a bus, and what a rig's axes need of it
    profile.py    families of drives as data; profiles/ those that are shipped
    registers.py  types and word order; blocks of adjacent registers
    frames.py     requests and answers as bytes, by pymodbus
    words.py      exceptions in words
    errand.py     what one drive is asked in one exchange
    transaction_tcp.py, transaction_rtu.py   how it gets there, bounded in time
    ports.py      TCP connections and serial devices
    sequence.py   the steps that enable a drive; machine402.py by CiA 402
    station.py    one drive in the cycle: what it is asked, what that means
    asking.py, bringup.py   what is asked and set before enabling
    links.py      all links of a bus as one; enabling.py from off to on, a step at a time
    driver.py     the driver the loop sees
    budget.py     bus time; scan.py finding drives; measure.py the host's cost

Only `frames.py` imports pymodbus, with the first frame, and only `ports.py` pyserial.
"""

from tautwave_drivers.modbus.plugin import plugin

__all__ = ["plugin"]
