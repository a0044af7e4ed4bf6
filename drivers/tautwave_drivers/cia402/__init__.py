"""The drive profile CiA 402 without a bus: for CANopen drives and Modbus drives that speak it.

    machine = Machine("slave.wrist (node 5)", Quirks(timeouts=Timeouts.at_rate(500.0)))
    machine.enable(Mode.CST)
    scale = axis_scale(Transmission(gear_motor=23), 4096, rated_torque=533 * MILLI)
    # every cycle, one machine per drive:
    controlword = machine.step(statusword, mode_display, now_cycle)  # None where nothing came
    target = to_counts(effort, scale.effort_quantum, most) if machine.commanding else 0
    send(controlword, machine.mode_wanted, target)
    for event in machine.take_events():
        report(event.text, event.fatal)

Nothing here knows a bus or a vendor's library. `objects` and `communication` hold the dictionary,
`states`, `modes` and `reactions` the words, `emergency` and `aborts` the errors, `units` what a
count is.
"""
