"""The drive profile CiA 402 without a bus: for CANopen drives and Modbus drives that speak it.

    machine = Machine("slave.wrist (node 5)", Habits(patience=Patience.at_rate(500.0)))
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

from tautwave_drivers.cia402.aborts import abort_words
from tautwave_drivers.cia402.emergency import (
    Emergency,
    decode_emergency,
    error_words,
    register_words,
)
from tautwave_drivers.cia402.entry import Entry, pack, unpack
from tautwave_drivers.cia402.machine import Machine
from tautwave_drivers.cia402.modes import (
    Homing,
    Mode,
    SetPoint,
    mode_name,
    supported_modes,
    supports,
)
from tautwave_drivers.cia402.reactions import acts_on_loss, reaction_words
from tautwave_drivers.cia402.states import State, command_words, decode, status_words
from tautwave_drivers.cia402.terms import Event, Goal, Habits, Patience, Way
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
    "Emergency",
    "Entry",
    "Event",
    "Goal",
    "Habits",
    "Homing",
    "Machine",
    "Mode",
    "Patience",
    "SetPoint",
    "State",
    "Transmission",
    "Way",
    "abort_words",
    "acts_on_loss",
    "axis_scale",
    "command_words",
    "decode",
    "decode_emergency",
    "error_words",
    "limit_counts",
    "mode_name",
    "pack",
    "reaction_words",
    "register_words",
    "status_words",
    "supported_modes",
    "supports",
    "unpack",
]
