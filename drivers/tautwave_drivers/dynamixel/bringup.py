"""Checks and settings before torque: the right servo, healthy, in the right mode, watched.

Lasting registers (EEPROM) are compared, and written only where `configure` allows it; they wear
out and survive the run. Everything else is RAM and is set on every start. Sources: e-manual, X
series, "Operating Mode(11)", "Return Delay Time(9)", "Status Return Level(68)", "Bus Watchdog(98)".
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

from tautwave.contracts import BusSpec
from tautwave.device_settings import DeviceSetting, DeviceSettings, Lasts, refuse_differences
from tautwave.errors import DeviceFault, DriverError
from tautwave_drivers.dynamixel.line.transactions import Line, Response
from tautwave_drivers.dynamixel.options import LAST_ID, DynamixelOptions, Servo
from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.indirect import status_addresses
from tautwave_drivers.dynamixel.protocol.messages import hardware_text, status_text
from tautwave_drivers.dynamixel.protocol.models import CAVEAT, VELOCITY_UNIT, model_name
from tautwave_drivers.dynamixel.protocol.registers import Register
from tautwave_drivers.dynamixel.protocol.units import Scale
from tautwave_drivers.dynamixel.state import AGAIN, INDIRECT, Errors, Remembered, remembered_blocks

REVERSED = 0x01
PROFILE_BY_TIME = 0x04
TORQUE_BY_GOAL = 0x08
"""Bits of Drive Mode(10): turns the other way; profiles in ms; a goal alone switches torque on."""

NO_ID = 255
"""Secondary ID(12) of a servo that has none."""

REBOOT_PINGS = 20
"""Each waits 0.1 s for a servo that is still starting."""


class Limits(NamedTuple):
    """Greatest goals a servo takes without an error [counts]."""

    current: int
    velocity: int


class Bringup:
    """Brings the servos of one bus to where torque may be switched on.

    Parameters
    ----------
    line : Line
        Transactions with them.
    options : DynamixelOptions
        The bus' options.
    bus : BusSpec
        What is allowed.
    notes : list of str
        Takes what was found and set.
    everyone : sequence, optional
        Id and response of all servos on the line, of which some may obey a goal of this rig beside
        those it is meant for.
    """

    def __init__(
        self,
        line: Line,
        options: DynamixelOptions,
        bus: BusSpec,
        notes: list[str],
        everyone: Sequence[tuple[int, Response]] = (),
    ) -> None:
        self._line = line
        self._everyone = everyone
        self._options = options
        self._bus = bus
        self._settings: dict[int, DeviceSettings] = {}
        self.unwatched: dict[str, str] = {}
        self.watchdog_s: dict[str, float] = {}
        self.marked: set[int] = set()
        """Ids of servos whose LED shows that they were not switched off and on; see `mark`."""
        self.errors: dict[int, Errors] = {}
        self.notes = notes
        self.identities: dict[str, dict[str, str]] = {}

    def run(self, servos: Sequence[Servo], scales: Sequence[Scale]) -> list[Limits]:
        """Check and set all servos, shadows behind those they obey; return the greatest goals.

        Raises
        ------
        DeviceFault
            A servo reports a hardware error.
        DriverError
            A servo is missing or not the expected model, or lasting settings differ.
        """
        self._settings = {servo.options.id: self._settings_of(servo) for servo in servos}
        self._reached_twice(servos)
        for servo in servos:
            self._identify(servo)
        for servo in servos:
            self._put(servo, reg.TORQUE_ENABLE, 0)
        for servo in servos:
            self._lasting(servo)
        refuse_differences(self._bus, self._settings.values())
        return [self._prepare(*pair) for pair in zip(servos, scales, strict=True)]

    # -- one servo ------------------------------------------------------------------------

    def _identify(self, servo: Servo) -> None:
        where = self._where(servo)
        response = self._line.ping(servo.options.id)
        if response is None:
            raise DriverError(
                f"{where}: no answer at {self._options.baud} baud; check its power and cable, and "
                f"its id and baud rate with: tautwave scan dynamixel --port "
                f"{self._options.port}"
            )
        self._have_it_answer(servo)
        number = reg.MODEL_NUMBER.decode(response.data)
        firmware = response.data[2]
        if number != servo.model.number:
            raise DriverError(
                f"{where}: is a {model_name(number)} (model number {number}), but the rig states "
                f"{servo.model.name}; correct options.servos, or replace the servo"
            )
        self._healthy(servo)
        watched = servo.model.always_watched or firmware >= reg.WATCHDOG_FIRMWARE
        if not watched and not self._bus.allow_unwatched:
            raise DriverError(
                f"{where}: firmware {firmware} has no bus watchdog (from "
                f"{reg.WATCHDOG_FIRMWARE} on), so it would keep moving if the host stops; update "
                "it, or run with --allow-unwatched"
            )
        volts = 0.1 * self._get(servo, reg.PRESENT_VOLTAGE)
        degrees = self._get(servo, reg.PRESENT_TEMPERATURE)
        self.notes.append(
            f"{where}: {servo.model.name}, firmware {firmware}, {volts:.1f} V, {degrees} degC"
        )
        shadow = "" if servo.obeys is None else "shadow_"
        self.identities.setdefault(servo.axis.name, {}).update(
            {
                f"{shadow}model": servo.model.name,
                f"{shadow}firmware": str(firmware),
                f"{shadow}homing_offset": str(self._get(servo, reg.HOMING_OFFSET)),
            }
        )
        if not watched:
            self.unwatched[servo.axis.name] = (
                f"(servo {servo.options.id}) keeps following its last command: its firmware "
                f"{firmware} has no bus watchdog"
            )
            return
        if self._get(servo, reg.BUS_WATCHDOG) == reg.WATCHDOG_TRIPPED:
            self.notes.append(f"{where}: its bus watchdog had tripped; armed again")
        # Off while no packets reach it; a tripped one locks the goals until 0 is written.
        self._put(servo, reg.BUS_WATCHDOG, 0)

    def _reached_twice(self, servos: Sequence[Servo]) -> None:
        """Refuse a line on which a goal of this rig also reaches a servo that it is not meant for.

        Such a servo answers no goal: it moves unseen.
        """
        axes = {servo.options.id: servo.axis.name for servo in servos}
        answered = [device_id for device_id, _ in self._everyone]
        for device_id in sorted(set(answered)):
            if device_id in axes:
                if answered.count(device_id) > 1:
                    raise DriverError(
                        f"{axes[device_id]} (bus {self._bus.name}): two servos answer as id "
                        f"{device_id}, so its goals would move both; give one of them another id"
                    )
                continue
            second = self._line.read(device_id, reg.SECONDARY_ID.address, 1)
            if second is None or not second.data or second.data[0] not in axes:
                continue
            obeyed = second.data[0]
            raise DriverError(
                f"{axes[obeyed]} (bus {self._bus.name}): servo {device_id} obeys id {obeyed} too "
                f"(secondary id(12) = {obeyed}), so it would move unseen; state it as shadow: "
                f"{{id: {device_id}}} of that servo, or set its secondary id to {NO_ID} with the "
                "vendor's wizard"
            )

    def _healthy(self, servo: Servo) -> None:
        """Refuse a servo with a hardware error; reboot it first where the options ask for that."""
        shutdown = self._get(servo, reg.SHUTDOWN)
        tolerated = self._options.tolerated & ~shutdown
        if tolerated != self._options.tolerated:
            off = hardware_text(self._options.tolerated & shutdown)
            self.notes.append(
                f"{self._where(servo)}: tolerated_errors is without effect for {off}: its "
                f"shutdown(63) {shutdown:#04x} switches torque off then"
            )
        self.errors[servo.options.id] = Errors(tolerated, shutdown)
        error = self._get(servo, reg.HARDWARE_ERROR)
        if error and not error & ~tolerated:
            self.notes.append(f"{self._where(servo)}: {hardware_text(error, shutdown)}; tolerated")
        if not error & ~tolerated:
            return
        fault = hardware_text(error, shutdown)
        if self._options.reboot:
            self._line.reboot(servo.options.id)
            for _ in range(REBOOT_PINGS):
                if self._line.ping(servo.options.id) is not None:
                    break
            self._have_it_answer(servo)
            self.notes.append(f"{self._where(servo)}: {fault}; rebooted")
            if not self._get(servo, reg.HARDWARE_ERROR) & ~tolerated:
                return
            fault += ", even after a reboot"
        raise DeviceFault(
            f"{self._where(servo)}: {fault}; remove the cause, then switch the servo's power off "
            "and on, or set reboot: true in the bus' options"
            + ("" if error & shutdown else ", or tolerate it (tolerated_errors)")
        )

    def _lasting(self, servo: Servo) -> None:
        """Compare the EEPROM with what the rig needs; write it where that is allowed."""
        delay = round(self._options.return_delay_s / reg.RETURN_DELAY_UNIT_S)
        if servo.obeys is not None:
            self._keep(servo, reg.SECONDARY_ID, servo.obeys, "it has to follow that id's goals")
        elif self._get(servo, reg.SECONDARY_ID) <= LAST_ID:
            self._keep(servo, reg.SECONDARY_ID, NO_ID, "until then it obeys that id's goals too")
        self._keep(servo, reg.OPERATING_MODE, servo.mode)
        self._keep(servo, reg.RETURN_DELAY, delay)
        given = servo.options.current_limit
        if given is not None and servo.model.current_unit > 0.0:
            self._keep(servo, reg.CURRENT_LIMIT, round(given / servo.model.current_unit))
        if servo.obeys is None:
            self._voltage(servo)
        else:
            self._like_the_first(servo)
        self._keep(
            servo, reg.HOMING_OFFSET, servo.options.homing_offset, "as homing_offset of the rig; "
            "its positions, and zero_counts, are counted with it",
        )  # fmt: skip
        if self._find(servo, reg.STARTUP):
            self._keep(
                servo, reg.STARTUP, 0, "else torque or old goals come back by themselves after a "
                "power dip",
            )  # fmt: skip
        if servo.axis.name in self.unwatched:
            return  # firmware that old has no drive mode either
        drive_mode = self._get(servo, reg.DRIVE_MODE)
        unwanted = TORQUE_BY_GOAL if servo.impedance else TORQUE_BY_GOAL | PROFILE_BY_TIME
        turned = REVERSED if servo.options.reverse_mode else 0
        reasons = []
        if (drive_mode ^ turned) & REVERSED:
            which = "opposite" if servo.obeys is not None else "reverse_mode"
            reasons.append(f"it turns the other way than {which} of the rig says")
        if drive_mode & unwanted:
            reasons.append("no torque by a goal alone, no profile by time")
        if reasons:
            wanted = drive_mode & ~(unwanted | REVERSED) | turned
            self._keep(servo, reg.DRIVE_MODE, wanted, "; ".join(reasons))

    def _voltage(self, servo: Servo) -> None:
        """See that what its motor may get lets it follow its goals."""
        limit = self._get(servo, reg.PWM_LIMIT)
        if limit == 0:
            self._keep(servo, reg.PWM_LIMIT, reg.FULL_PWM, "its motor gets no voltage at all")
        elif limit < reg.FULL_PWM:
            self.notes.append(
                f"{self._where(servo)}: pwm limit(36) is {limit} of {reg.FULL_PWM}: its motor gets "
                f"at most {100 * limit / reg.FULL_PWM:.0f} % of the supply"
            )

    def _like_the_first(self, shadow: Servo) -> None:
        """See that a shadow has the limits of the servo whose goals it follows."""
        first = shadow._replace(
            options=shadow.options.model_copy(update={"id": shadow.obeys}), obeys=None
        )
        limits = [reg.PWM_LIMIT]
        if shadow.model.current_unit > 0.0:
            limits.append(reg.CURRENT_LIMIT)
        if not shadow.impedance:
            limits += [reg.VELOCITY_LIMIT, reg.MAX_POSITION, reg.MIN_POSITION]
        for register in limits:
            wanted = self._get(first, register)
            self._keep(shadow, register, wanted, f"as servo {shadow.obeys}, whose goals it follows")

    def _keep(self, servo: Servo, register: Register, wanted: int, why: str = "") -> None:
        """Compare a lasting register; write it where that is allowed."""
        self._settings[servo.options.id].keep(_setting(register, wanted, why))

    def _prepare(self, servo: Servo, scale: Scale) -> Limits:
        """Set the RAM; return the largest goals."""
        self._put(servo, reg.STATUS_RETURN_LEVEL, 2)
        # It caps the output in every mode, and another program may have left it low.
        self._put(servo, reg.GOAL_PWM, self._get(servo, reg.PWM_LIMIT))
        if servo.impedance:
            limits = self._current_limit(servo, scale)
            self._put(servo, reg.GOAL_CURRENT, 0)
        elif servo.axis.takes_position:
            limits = self._held_current(servo, scale)
            self._put(servo, reg.PROFILE_ACCELERATION, 0)
            self._put(servo, reg.PROFILE_VELOCITY, 0)
        else:
            limits = self._velocity_limit(servo, scale)
            self._put(servo, reg.PROFILE_ACCELERATION, 0)
            self._put(servo, reg.GOAL_VELOCITY, 0)
        self._note_limits(servo, limits)
        if servo.options.torque_constant is None:
            self.notes.append(
                f"{self._where(servo)}: torque constant {servo.torque_constant:.3g} N m/A is "
                f"{CAVEAT} ({servo.model.page})"
            )
        return limits

    def _held_current(self, servo: Servo, scale: Scale) -> Limits:
        """Let a servo that takes positions use no more than the axis' effort, where it can."""
        if servo.mode == reg.CURRENT_POSITION_MODE:
            limits = self._current_limit(servo, scale)
            self._put(servo, reg.GOAL_CURRENT, limits.current)
            return limits
        low, high = self._get(servo, reg.MIN_POSITION), self._get(servo, reg.MAX_POSITION)
        ends = sorted(scale.position_counts(end) for end in servo.axis.position_range)
        if ends[0] < low or ends[1] > high:
            raise DriverError(
                f"{self._where(servo)}: position_range is {ends[0]} to {ends[1]} counts, beyond "
                f"its position limits(52, 48) {low} to {high}; narrow position_range, move "
                "zero_counts, or widen the servo's with the vendor's wizard"
            )
        self.notes.append(
            f"{self._where(servo)}: a {servo.model.name} cannot limit its torque while it holds a "
            "position; nothing but its own overload protection does"
        )
        return Limits(0, 0)

    def _note_limits(self, servo: Servo, limits: Limits) -> None:
        if servo.mode == reg.POSITION_MODE:
            return
        if servo.impedance or servo.axis.takes_position:
            mode, register, unit = servo.mode, reg.CURRENT_LIMIT, servo.model.current_unit
            used, name = limits.current * unit, "A"
        else:
            mode, register, unit = reg.VELOCITY_MODE, reg.VELOCITY_LIMIT, VELOCITY_UNIT
            used, name = limits.velocity * unit, "rad/s"
        self.notes.append(
            f"{self._where(servo)}: {reg.MODES[mode]} mode, return delay "
            f"{self._options.return_delay_s * 1e6:g} us, {register.name}({register.address}) "
            f"{self._get(servo, register) * unit:.4g} {name}, of which the rig uses {used:.4g} "
            f"(read); torque off, {'goal current' if servo.axis.takes_position else 'goal 0'}, "
            "status return level 2 (written and read back)"
        )

    def verify(self, servos: Sequence[Servo]) -> None:
        """Read once more what was set in RAM: a servo may have been switched off and on meanwhile.

        Raises
        ------
        DeviceFault
            One has forgotten.
        """
        for servo in servos:
            for setting, value in self._settings[servo.options.id].forgotten():
                raise DeviceFault(
                    f"{self._where(servo)}: {setting.name} reads {setting.show(value)} instead of "
                    f"{setting.show(setting.wanted)}: {AGAIN}"
                )

    def map_status(self, servo: Servo) -> None:
        """Write the indirect addresses of the status block and read them back.

        Raises
        ------
        DriverError
            The servo rejects them.
        """
        data = b"".join(address.to_bytes(2, "little") for address in status_addresses())
        try:
            self._put(servo, INDIRECT, INDIRECT.decode(data))
        except DriverError as err:
            raise DriverError(
                f"{self._where(servo)}: rejects the indirect addresses of status_block; omit "
                "status_block"
            ) from err

    def remember(self, servo: Servo, *, mapped: bool) -> Remembered:
        """Return what a servo holds now, to compare with once it may have forgotten.

        `mapped`: its indirect addresses as well.
        """
        held = {}
        for block in remembered_blocks(mapped=mapped):
            response = self._line.read(servo.options.id, block.address, block.size)
            if response is not None and not response.number and len(response.data) == block.size:
                held[block] = response.data  # older firmware lacks some
        return held

    def mark(self, servo: Servo) -> None:
        """Switch on the LED of a servo without a bus watchdog: one that restarts has it off.

        Else nothing would tell until torque is on, with a goal that is its greatest current.
        """
        if servo.axis.name in self.unwatched and self._find(servo, reg.LED) is not None:
            self._put(servo, reg.LED, 1)
            self.marked.add(servo.options.id)

    def arm(self, servo: Servo) -> None:
        """Write the bus watchdog and read it back; it runs once torque is on."""
        if servo.axis.name in self.unwatched:
            return
        units = watchdog_units(self._options)
        self._put(servo, reg.BUS_WATCHDOG, units)
        self.watchdog_s[servo.axis.name] = units * reg.WATCHDOG_UNIT_S
        self.notes.append(
            f"{self._where(servo)}: stops after {units * reg.WATCHDOG_UNIT_S:g} s without a packet "
            f"(bus watchdog(98) = {units}, written and read back)"
        )

    def _current_limit(self, servo: Servo, scale: Scale) -> Limits:
        """Return the rig's limit in counts; the servo's own has to allow it."""
        limit = self._get(servo, reg.CURRENT_LIMIT)
        # The loop commands whole counts, never beyond its limit.
        need = math.floor(servo.axis.effort_limit / scale.effort + 1e-9)
        if need > limit:
            unit, most = servo.model.current_unit, limit * scale.effort
            raise DriverError(
                f"{self._where(servo)}: effort_limit {servo.axis.effort_limit:g} needs "
                f"{need * unit:.3g} A, but its current limit(38) is {limit * unit:.3g} A; lower "
                f"effort_limit to {most:.3g}, or set current_limit: {need * unit:.5g} in "
                "options.servos"
            )
        return Limits(need, 0)

    def _velocity_limit(self, servo: Servo, scale: Scale) -> Limits:
        limit = self._get(servo, reg.VELOCITY_LIMIT)
        if servo.axis.velocity_limit > (limit + 0.5) * scale.velocity:
            raise DriverError(
                f"{self._where(servo)}: velocity_limit {servo.axis.velocity_limit:g} exceeds "
                f"its velocity limit(44), {limit} = {limit * scale.velocity:.4g}; lower "
                "velocity_limit, or raise the servo's with the vendor's wizard"
            )
        return Limits(0, min(limit, math.ceil(servo.axis.velocity_limit / scale.velocity)))

    # -- registers --------------------------------------------------------------------------

    def _get(self, servo: Servo, register: Register) -> int:
        response = self._line.read(servo.options.id, register.address, register.size)
        if response is None:
            raise DriverError(f"{self._where(servo)}: no response when reading {register.name}")
        if response.number or len(response.data) < register.size:
            raise DriverError(
                f"{self._where(servo)}: {register.name}({register.address}) cannot be read: "
                f"{status_text(response.error)}"
            )
        return register.decode(response.data)

    def _find(self, servo: Servo, register: Register) -> int | None:
        """Return what a register holds that older firmware does not have; None without it."""
        response = self._line.read(servo.options.id, register.address, register.size)
        if response is None or response.number or len(response.data) < register.size:
            return None
        return register.decode(response.data)

    def _put(self, servo: Servo, register: Register, value: int) -> None:
        """Write a register and read it back."""
        self._settings[servo.options.id].put(_setting(register, value))

    def _have_it_answer(self, servo: Servo) -> None:
        """Set the status return level: below 2 a servo answers no read, this one's own included.

        `_prepare` reads it back.
        """
        setting = _setting(reg.STATUS_RETURN_LEVEL, 2)._replace(readable=False)
        self._settings[servo.options.id].put(setting)

    def _write(self, servo: Servo, register: Register, value: int) -> None:
        # No response is not yet a failure: below status return level 2 writes have none.
        response = self._line.write(servo.options.id, register.address, register.encode(value))
        if response is not None and response.number:
            raise DriverError(
                f"{self._where(servo)}: {register.name}({register.address}) rejects "
                f"{value}: {status_text(response.error)}"
            )

    def _settings_of(self, servo: Servo) -> DeviceSettings:
        return DeviceSettings(
            self._where(servo),
            partial(self._get, servo),
            partial(self._write, servo),
            configure=self._bus.configure,
            notes=self.notes,
        )

    def _where(self, servo: Servo) -> str:
        return f"{servo.axis.name} (bus {self._bus.name}, servo {servo.options.id})"


def watchdog_units(options: DynamixelOptions) -> int:
    """Return the bus watchdog of an options block, in steps of the register."""
    return max(1, math.ceil(options.watchdog_s / reg.WATCHDOG_UNIT_S - 1e-9))


def _setting(register: Register, wanted: int, why: str = "") -> DeviceSetting:
    """Return what a register has to hold."""
    name = f"{register.name}({register.address})"
    lasts = Lasts.WRITTEN if register.eeprom else Lasts.POWER
    return DeviceSetting(register, name, wanted, lasts, why, show=partial(_shown, register))


def _shown(register: Register, value: int) -> str:
    if register is reg.OPERATING_MODE:
        return f"{value} ({reg.MODES.get(value, 'unknown')})"
    if register is INDIRECT:
        return register.encode(value).hex()
    if register is reg.RETURN_DELAY:
        return f"{value} ({value * 2} us)"
    return str(value)
