"""The drive profile CiA 402 without a bus: for CANopen drives and Modbus drives that speak it.

    machine = Machine("slave.wrist (node 5)", Quirks(timeouts=Timeouts.at_rate(500.0)))
    machine.enable(Mode.CST)
    scale = axis_scale(Transmission(gear_motor=23), 4096, rated_torque=533 * MILLI)
    # every cycle, one machine per drive:
    controlword = machine.step(statusword, mode_display, now_cycle)  # None where nothing came
    target = scale.effort_counts(effort) if machine.commanding else 0
    send(controlword, machine.mode_wanted, target)
    for event in machine.take_events():
        report(event.text, event.fatal)

Nothing here knows a bus or a vendor's library. `objects` and `communication` hold the dictionary,
`states`, `modes` and `reactions` the words, `emergency` and `aborts` the errors.
"""

from tautwave_drivers.cia402.aborts import abort_text
from tautwave_drivers.cia402.emergency import (
    Emergency,
    decode_emergency,
    error_text,
    register_text,
)
from tautwave_drivers.cia402.entry import Entry, pack, unpack
from tautwave_drivers.cia402.machine import Machine
from tautwave_drivers.cia402.modes import (
    Homing,
    Mode,
    mode_name,
    supported_modes,
    supports,
)
from tautwave_drivers.cia402.reactions import acts_on_loss, reaction_text
from tautwave_drivers.cia402.states import State, command_text, decode, status_text
from tautwave_drivers.cia402.terms import DisableMethod, Event, Goal, Quirks, Timeouts
from tautwave_drivers.cia402.units import (
    MICRO,
    MILLI,
    AxisScale,
    Transmission,
    axis_scale,
    limit_counts,
)

__all__ = [
    "MICRO",
    "MILLI",
    "AxisScale",
    "DisableMethod",
    "Emergency",
    "Entry",
    "Event",
    "Goal",
    "Homing",
    "Machine",
    "Mode",
    "Quirks",
    "State",
    "Timeouts",
    "Transmission",
    "abort_text",
    "acts_on_loss",
    "axis_scale",
    "command_text",
    "decode",
    "decode_emergency",
    "error_text",
    "limit_counts",
    "mode_name",
    "pack",
    "reaction_text",
    "register_text",
    "status_text",
    "supported_modes",
    "supports",
    "unpack",
]
