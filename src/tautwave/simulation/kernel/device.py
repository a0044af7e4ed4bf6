"""A simulated device: `tautwave_sim`'s axis and its three physics as functions over records."""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence

from tautwave.controller.records import Sample
from tautwave.models.encoder import quantise
from tautwave.models.foam import foam_forces, foam_stored
from tautwave.models.integrators.schemes import integrate_step
from tautwave.models.plant import plant_forces, plant_step, plant_stored
from tautwave.models.sensors.effort import follow_effort, sensor_reading
from tautwave.models.servo import servo_forces, servo_step, servo_stored
from tautwave.simulation.kernel.records import FOAM, HELD, PLANT, SERVO, DeviceParams, DeviceState


def command_device(b: DeviceState, d: DeviceParams, value: float) -> None:
    """Take an effort (impedance) or a velocity (admittance) for the slots to come."""
    quantum = d.effort_quantum
    if d.kind == SERVO:
        quantum = d.velocity_quantum
    if quantum > 0.0:
        value = quantise(value, quantum)
    if d.kind != SERVO:
        if value > d.effort_limit:
            value = d.effort_limit
        elif value < -d.effort_limit:
            value = -d.effort_limit
    b.command = value


def aim_hand(b: DeviceState, d: DeviceParams, table: Sequence[float]) -> None:
    """Note the hand's reference [rad or m] at this slot, its rate until the next, and the push."""
    b.reference = 0.0
    b.rate = 0.0
    if b.slot < d.last:
        here = table[d.reference + b.slot]
        b.reference = here
        b.rate = (table[d.reference + b.slot + 1] - here) / d.period
    elif d.last >= 0:
        b.reference = table[d.reference + d.last]
    if d.pushes > 0:
        b.push = table[d.push + min(b.slot, d.pushes - 1)]


def move_device(
    b: DeviceState, d: DeviceParams, command: float, reference: float, rate: float, h: float
) -> None:
    """Move by `h` under a constant command and a hand reference of constant rate."""
    before = b.x
    if d.kind == HELD:
        b.x = reference + rate * h
        b.v = rate
        b.held = command
        b.motor_work += command * (b.x - before)
        b.hand_work -= command * (b.x - before)
        return
    total = command
    if d.pushes > 0:
        total = command + b.push
    if d.kind == PLANT:
        x, v, mode, work, grip, viscous, coulomb, environment = plant_step(
            d.plant, d.cache, before, b.v, b.mode, total, reference, rate, h
        )
        b.mode = mode
        b.motor_work += total * (x - before)
        b.viscous_loss += viscous
        b.coulomb_loss += coulomb
    elif d.kind == FOAM:
        x, v, work, grip, viscous, coulomb, environment = integrate_step(
            d.plant, d.foam, before, b.v, total, reference, rate, h
        )
        b.motor_work += total * (x - before)
        b.viscous_loss += viscous
        b.coulomb_loss += coulomb
    else:
        b.held = command
        x, v, work, grip, environment, outside = servo_step(
            d.servo, before, b.v, command, reference, rate, h
        )
        b.motor_work -= outside
    if d.pushes > 0:
        b.pushed += b.push * (x - before)
    b.x = x
    b.v = v
    b.hand_work += work
    b.grip_loss += grip
    b.environment_loss += environment


def device_forces(
    b: DeviceState, d: DeviceParams, reference: float, rate: float
) -> tuple[float, float]:
    """Return the efforts of hand and environment on the device [N m or N]."""
    if d.kind == HELD:
        return -b.held, 0.0
    if d.kind == PLANT:
        hand, environment = plant_forces(d.plant, b.x, b.v, reference, rate)
    elif d.kind == FOAM:
        hand, environment = foam_forces(d.plant, d.foam, b.x, b.v, reference, rate)
    else:
        hand, environment = servo_forces(d.servo, b.x, b.v, b.held, reference, rate)
    if d.pushes > 0:
        environment = environment + b.push
    return hand, environment


def device_stored(b: DeviceState, d: DeviceParams, reference: float) -> tuple[float, float, float]:
    """Return kinetic, grip and environment energy [J]."""
    if d.kind == HELD:
        return 0.0, 0.0, 0.0
    if d.kind == PLANT:
        return plant_stored(d.plant, b.x, b.v, reference)
    if d.kind == FOAM:
        return foam_stored(d.plant, d.foam, b.x, b.v, reference)
    return servo_stored(d.servo, b.x, b.v, reference)


def pass_device(b: DeviceState, d: DeviceParams, table: MutableSequence[float]) -> None:
    """Move by one slot of the loop's grid."""
    reference = b.reference
    command = b.command
    if d.delay > 0:
        at = d.pipe + b.head
        command = table[at]
        table[at] = b.command
        b.head += 1
        if b.head == d.delay:
            b.head = 0
    acting = command
    span = d.period
    parts = 1
    if d.late > 0.0:
        acting = b.acting
        span = d.late * d.period
        parts = 2
    for _ in range(parts):
        move_device(b, d, acting, reference, b.rate, span)
        reference = reference + b.rate * span
        span = d.period - span
        acting = command
    b.acting = command
    b.slot += 1
    aim_hand(b, d, table)
    if d.senses:
        follow_outside(b, d, table)


def begin_sensor(b: DeviceState, d: DeviceParams, table: MutableSequence[float]) -> None:
    """Show what acts on a device at rest, before the first slot."""
    if not d.senses:
        return
    hand, environment = device_forces(b, d, b.reference, b.rate)
    b.felt = hand + environment
    b.shown = b.felt
    for i in range(d.sensor.delay):
        table[d.sensed + i] = b.felt


def follow_outside(b: DeviceState, d: DeviceParams, table: MutableSequence[float]) -> None:
    """Let the effort sensor follow a slot; a mass beyond it takes its share."""
    hand, environment = device_forces(b, d, b.reference, b.rate)
    outside = hand + environment - d.sensor.mass * (b.v - b.speed) / d.period
    b.speed = b.v
    b.felt = follow_effort(d.sensor, b.felt, outside)
    b.shown = b.felt
    if d.sensor.delay > 0:
        at = d.sensed + b.shown_at
        b.shown = table[at]
        table[at] = b.felt
        b.shown_at += 1
        if b.shown_at == d.sensor.delay:
            b.shown_at = 0


def measure_device(
    m: Sample, b: DeviceState, d: DeviceParams, noise: float, missing: bool, loud: float
) -> None:
    """Report what the drive measures at this slot; both kinds of noise are of unit deviation."""
    position = b.x
    if d.position_noise > 0.0:
        position = position + d.position_noise * noise
    if d.encoder_quantum > 0.0:
        position = quantise(position, d.encoder_quantum)
    m.position = position
    m.valid = not missing
    m.effort = math.nan
    if d.kind == SERVO:
        hand, environment = device_forces(b, d, b.reference, b.rate)
        m.effort = hand + environment
        if d.effort_quantum > 0.0:
            m.effort = quantise(m.effort, d.effort_quantum)
    elif d.senses:
        m.effort = sensor_reading(d.sensor, b.shown, loud)
