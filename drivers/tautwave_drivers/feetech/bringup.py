"""Checks and settings before torque: the right servo, alone, healthy, off, limited, in its mode.

What is set is gone with the power: the lock of the EEPROM is closed first, and what is written to
its addresses then stays in RAM. Only what shifts or changes the meaning of positions is compared,
and written for good where `configure` allows it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

from tautwave.contracts import BusSpec
from tautwave.device_settings import DeviceSetting, DeviceSettings, Lasts, refuse_differences
from tautwave.errors import DeviceFault, DriverError
from tautwave_drivers.feetech import tables
from tautwave_drivers.feetech.line import ServoLine
from tautwave_drivers.feetech.models import model_name
from tautwave_drivers.feetech.options import FeetechOptions, Servo
from tautwave_drivers.feetech.tables import Identity, Register, identity_of, status_text

AGAIN = (
    "it was switched off and on, or another program wrote to it; check its supply, then enable it"
)
MARGIN = 1.2
"""Of the current of `effort_limit`, above which a servo cuts it."""
SUPPLY_OFF = 0.2
"""Share by which a supply may differ from the stated one."""
LASTING = ("offset", "phase")
"""Registers that are written for good."""
FASTEST = 3400
"""[steps/s] Goal speed where the axis has no lower limit."""


class Found(NamedTuple):
    """What a servo is, and what it holds: what shows in every cycle that it has forgotten.

    `limit` is its torque limit(48), `speed` one count of its speed [steps/s], `volts` its supply.
    """

    identity: Identity
    limit: int
    speed: int
    volts: float


class Bringup:
    """Brings the servos of one bus to where torque may be switched on.

    Parameters
    ----------
    line : ServoLine
        Transactions with them.
    options : FeetechOptions
        The bus' options.
    bus : BusSpec
        What is allowed.
    notes : list of str
        Takes what was found and set.
    """

    def __init__(
        self, line: ServoLine, options: FeetechOptions, bus: BusSpec, notes: list[str]
    ) -> None:
        self._line = line
        self._options = options
        self._bus = bus
        self._settings: dict[int, DeviceSettings] = {}
        self.notes = notes
        self.identities: dict[str, dict[str, str]] = {}
        self.unwatched: dict[str, str] = {}

    def run(self, servos: Sequence[Servo], everyone: Sequence[int]) -> list[Found]:
        """Check and set all servos.

        Parameters
        ----------
        servos : sequence of Servo
            In the order of the axes.
        everyone : sequence of int
            Ids that answered on the line, as often as they did.

        Raises
        ------
        DeviceFault
            A servo reports an error.
        DriverError
            A servo is missing, twice there, not the expected one, or lasting settings differ.
        """
        identities = [self._identify(servo, everyone) for servo in servos]
        self._reached_twice(servos, everyone)
        self._settings = {servo.options.id: self._settings_of(servo) for servo in servos}
        for servo in servos:
            self._put(servo, tables.TORQUE, tables.OFF)
        for servo in servos:
            self._healthy(servo)
        for servo in servos:
            self._set(servo, tables.LOCK, tables.LOCKED, "so that nothing is written for good")
            self._lasting(servo)
        refuse_differences(self._bus, self._settings.values())
        return [
            self._prepare(servo, identity)
            for servo, identity in zip(servos, identities, strict=True)
        ]

    def verify(self, servos: Sequence[Servo]) -> None:
        """Read once more what was set: a servo may have been switched off and on meanwhile.

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

    # -- one servo ------------------------------------------------------------------------

    def _identify(self, servo: Servo, everyone: Sequence[int]) -> Identity:
        where, number = self._where(servo), servo.options.id
        answers = self._line.answers(number, tables.IDENTITY)
        if len(answers) > 1 or everyone.count(number) > 1:
            raise DriverError(
                f"{where}: two servos answer as id {number}, so its goals would move both; give "
                "one of them another id, alone on the line"
            )
        garbled = self._line.garbled
        response = self._line.read(number, tables.IDENTITY)
        if response is None:
            garbled |= self._line.garbled
            why = (
                "its answers are garbled, as of two servos with one id, of a wrong baud rate or a "
                "bad cable; connect it alone"
                if garbled
                else f"no answer at {self._options.baud} baud; check its power and cable"
            )
            raise DriverError(
                f"{where}: {why}, and look with: tautwave scan feetech --port {self._options.port}"
            )
        identity = identity_of(response.data)
        name = model_name(identity.model)
        if identity.table is None:
            what = "an SCS servo" if identity.series == "SCS" else "a servo of unknown table"
            raise DriverError(
                f"{where}: {name}, firmware {identity.firmware}, is {what}: no axis runs on it; "
                "`tautwave scan feetech` reads its identity"
            )
        if identity.model != servo.model.number:
            raise DriverError(
                f"{where}: reports {name} (model {identity.model}), but the rig states "
                f"{servo.model.name}; correct options.servos, or replace the servo"
            )
        if (identity.table is tables.HLS) != (servo.table is tables.HLS):
            raise DriverError(
                f"{where}: its firmware {identity.firmware} has the table of {identity.series}, "
                f"but the rig states {servo.table.name}; write series: {identity.series[:3]} for "
                "this servo"
            )
        if self._options.power_cut.strip().startswith("TODO"):
            raise DriverError(
                f"bus {self._bus.name}: power_cut still says TODO; write how a person cuts the "
                "servos' power, within reach: they have no watchdog"
            )
        if not self._bus.allow_unwatched:
            raise DriverError(
                f"{where}: has no watchdog: it goes on with its last goal if the host stops or its "
                "cable is pulled; run with --allow-unwatched, with a hand on its power"
            )
        return identity

    def _reached_twice(self, servos: Sequence[Servo], everyone: Sequence[int]) -> None:
        """Refuse a line on which another servo obeys a goal of this rig, by its second id."""
        axes = {servo.options.id: servo.axis.name for servo in servos}
        for number in sorted({*everyone, *axes}):
            response = self._line.read(number, tables.IDENTITY)
            if response is None or identity_of(response.data).table is not tables.HLS:
                continue
            assert tables.HLS.second_id is not None
            second = self._line.read(number, tables.HLS.second_id)
            if second is None or second.data[0] == number or second.data[0] not in axes:
                continue
            obeyed = second.data[0]
            raise DriverError(
                f"{axes[obeyed]} (bus {self._bus.name}): servo {number} obeys id {obeyed} too "
                "(its second id(7)), so it would move unseen; give it none in the maker's tool"
            )

    def _healthy(self, servo: Servo) -> None:
        status = self._get(servo, tables.STATUS)
        if status:
            raise DeviceFault(
                f"{self._where(servo)}: {status_text(status)} (status {status:#04x}) with its "
                "torque off; remove the cause, then switch its power off and on"
            )

    def _lasting(self, servo: Servo) -> None:
        """Compare what shifts positions or changes what they mean."""
        self._settings[servo.options.id].keep(
            _setting(
                servo.table.offset,
                servo.options.offset,
                "as offset of the rig; its positions, and zero_counts, are counted with it",
                Lasts.WRITTEN,
            )
        )
        phase = _setting(tables.PHASE, 0, "positions of one turn", Lasts.WRITTEN)
        self._settings[servo.options.id].keep(phase._replace(mask=tables.MANY_TURNS))

    def _prepare(self, servo: Servo, identity: Identity) -> Found:
        """Set what is gone with the power; the goal is the last thing, and says nothing yet."""
        where, options = self._where(servo), self._options
        if servo.table.return_delay is not None:
            delay = round(options.return_delay_s / tables.DELAY_UNIT_S)
            self._set(servo, servo.table.return_delay, delay, "as return_delay_s of the rig")
        self._set(servo, tables.LEVEL, 1, "so that it answers what is written, too")
        self._set(servo, tables.MODE, servo.mode)
        volts = tables.VOLT * self._get(servo, tables.VOLTAGE)
        degrees = self._get(servo, tables.TEMPERATURE)
        self._supply(servo, volts)
        scale = servo.scale(volts)
        current = servo.axis.effort_limit / scale.current if scale.current else math.inf
        if math.isfinite(current):
            counts = max(1, math.ceil(MARGIN * current))
            self._set(servo, tables.PROTECTION_CURRENT, counts)
            time = max(1, round(options.protection_s / tables.PROTECTION_UNIT_S))
            self._set(servo, tables.PROTECTION_TIME, time)
        limit = self._limit(servo)
        self._put(servo, tables.TORQUE_LIMIT, limit)
        if servo.impedance:
            # It is compared in every cycle; that it can be read back shows here, with torque off.
            self._put(servo, servo.table.goal, 1)
            self._put(servo, servo.table.goal, 0)
        else:
            self._follower(servo)
        phase = self._get(servo, tables.PHASE)
        self.notes.append(
            f"{where}: {servo.model.name}, firmware {identity.firmware} ({identity.series}), "
            f"{volts:.1f} V, {degrees} degC; {servo.table.modes[servo.mode]} mode, torque limit "
            f"{limit / 10:g} %; torque off, goal 0 (written and read back)"
        )
        most = (
            f", with at most {limit / 10:g} % of its torque" if limit < tables.FULL_TORQUE else ""
        )
        self.unwatched[servo.axis.name] = (
            f"(servo {servo.options.id}) goes on with its last goal, since it has no watchdog"
            f"{most}; cut its power by hand: {options.power_cut.strip()}"
        )
        self.identities[servo.axis.name] = {
            "model": servo.model.name,
            "firmware": identity.firmware,
            "series": identity.series,
            "offset": str(servo.options.offset),
            "phase": f"{phase:#04x}",
        }
        fine = bool(phase & tables.FINE_SPEED)
        return Found(identity, limit, 1 if fine else tables.COARSE, volts)

    def _supply(self, servo: Servo, volts: float) -> None:
        """Refuse a supply by which efforts would be off."""
        stated = servo.supply_v
        if servo.by_voltage and abs(volts - stated) > SUPPLY_OFF * stated:
            raise DriverError(
                f"{self._where(servo)}: its supply reads {volts:.1f} V, but the rig is for "
                f"{stated:g} V; every effort goes with it: write supply_v: {volts:.1f} in the bus' "
                "options, or mend the supply"
            )

    def _limit(self, servo: Servo) -> int:
        """Return the torque limit(48) that lets an axis reach its effort_limit, and little more."""
        most = self._get(servo, tables.MAX_TORQUE)
        if servo.by_voltage:
            lowest = servo.scale((1.0 - SUPPLY_OFF) * servo.supply_v).effort
            share = servo.axis.effort_limit / lowest
        elif servo.table is tables.HLS or not servo.torque_constant * servo.resistance:
            share = math.inf  # a current limits it, or its torque is not known
        else:
            stall = servo.torque_constant * servo.options.gear_ratio * servo.supply_v
            share = tables.FULL_TORQUE * servo.axis.effort_limit / (stall / servo.resistance)
        limit = min(math.ceil(min(share, tables.FULL_TORQUE)), most or tables.FULL_TORQUE)
        if math.isfinite(share) and limit < math.floor(min(share, tables.FULL_TORQUE)):
            raise DriverError(
                f"{self._where(servo)}: effort_limit {servo.axis.effort_limit:g} needs a torque "
                f"limit of {share / 10:.3g} %, but its max torque(16) is {most / 10:g} %; lower "
                "effort_limit, or raise that in the maker's tool"
            )
        return limit

    def _follower(self, servo: Servo) -> None:
        """Set what a servo that takes positions does with them; it holds where it stands."""
        scale = servo.scale(servo.supply_v or 1.0)
        low, high = self._get(servo, tables.MIN_ANGLE), self._get(servo, tables.MAX_ANGLE)
        ends = sorted(
            scale.counts_of(end) for end in servo.axis.position_range if math.isfinite(end)
        )
        if (low or high) and ends and (ends[0] < low or ends[-1] > high):
            raise DriverError(
                f"{self._where(servo)}: position_range is {ends[0]} to {ends[-1]} counts, beyond "
                f"its angles(9, 11) {low} to {high}; narrow position_range, or widen the servo's "
                "in the maker's tool"
            )
        self._put(servo, tables.ACCELERATION, 0)
        fastest = servo.axis.velocity_limit / scale.position
        self._put(servo, tables.GOAL_SPEED, math.ceil(min(fastest, FASTEST)))
        if servo.table is tables.HLS:  # there register 44 is the current it may use
            most = servo.axis.effort_limit / scale.current if scale.current else math.inf
            self._put(servo, servo.table.goal, max(1, math.floor(min(most, servo.table.most))))
        self._put(servo, tables.GOAL_POSITION, self._get(servo, tables.POSITION))

    # -- registers --------------------------------------------------------------------------

    def _get(self, servo: Servo, register: Register) -> int:
        answer = self._line.read(servo.options.id, register)
        if answer is None:
            raise DriverError(
                f"{self._where(servo)}: no answer when reading {register}; check its power and "
                "cable"
            )
        return register.decode(answer.data)

    def _put(self, servo: Servo, register: Register, value: int) -> None:
        """Write a register, whatever it holds, and read it back."""
        self._settings[servo.options.id].put(_setting(register, value))

    def _set(self, servo: Servo, register: Register, value: int, why: str = "") -> None:
        """Write a register until power is off, where it holds something else, and read it back."""
        setting = _setting(register, value, why)
        settings = self._settings[servo.options.id]
        settings.keep(setting)
        settings.hold(setting)

    def _write(self, servo: Servo, register: Register, value: int) -> None:
        # No answer is not yet a failure: it is read back.
        number = servo.options.id
        lasts = register.name in LASTING
        if lasts:
            self._line.write(number, tables.LOCK, tables.UNLOCKED)
        self._line.write(number, register, value)
        if lasts:
            self._line.write(number, tables.LOCK, tables.LOCKED)

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


def _setting(
    register: Register, wanted: int, why: str = "", lasts: Lasts = Lasts.POWER
) -> DeviceSetting:
    """Return what a register has to hold."""
    return DeviceSetting(register, str(register), wanted, lasts, why)
