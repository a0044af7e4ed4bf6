"""Checks and settings before torque: the right motor, off, healthy, in MIT mode, watched.

All that is set is in RAM, is written at every start and read back. Nothing is saved in a motor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from tautwave.contracts import AxisSpec, BusSpec
from tautwave.device_settings import DeviceSetting, DeviceSettings
from tautwave.errors import DeviceFault, DriverError
from tautwave_drivers.mit import damiao
from tautwave_drivers.mit.damiao import Feedback, Register
from tautwave_drivers.mit.options import MitOptions, Motor, Scale, scale_of
from tautwave_drivers.mit.registers import Registers
from tautwave_drivers.turns import doubt, turns_back

CLOSE = 1e-3
"""Relative difference of a range that is rounding of a rig file, not another range."""


class Found(NamedTuple):
    """What a motor is and how it was set.

    `scale` has its own ranges and the turns that its position was taken back by; `watchdog_s`, None
    where `unwatched` says what it does instead.
    """

    scale: Scale
    identity: dict[str, str]
    watchdog_s: float | None
    unwatched: str


def timeout_counts(options: MitOptions) -> int:
    """Return the rig's `watchdog_s` in counts of TIMEOUT."""
    return round(options.watchdog_s / damiao.TIMEOUT_S)


class Bringup:
    """Brings the motors of one bus to where torque may be switched on.

    Parameters
    ----------
    registers : Registers
        Transactions with them.
    options : MitOptions
        The bus' options.
    bus : BusSpec
        What is allowed.
    notes : list of str
        Takes what was found and set.
    """

    def __init__(
        self, registers: Registers, options: MitOptions, bus: BusSpec, notes: list[str]
    ) -> None:
        self._registers = registers
        self._options = options
        self._bus = bus
        self._notes = notes

    def run(self, motors: Sequence[Motor]) -> list[Found]:
        """Check and set all motors.

        Raises
        ------
        DeviceFault
            A motor reports an error.
        DriverError
            A motor is missing, not the expected one, twice there, or does not take what is set.
        """
        self._meet(motors)
        return [self._prepare(*pair) for pair in zip(self._bus.axes, motors, strict=True)]

    def _meet(self, motors: Sequence[Motor]) -> None:
        """Read every motor once; name all that do not answer (`DriverError`)."""
        silent: list[str] = []
        heard: list[str] = []
        for axis, motor in zip(self._bus.axes, motors, strict=True):
            number = self._registers.read(motor.id, motor.feedback_id, damiao.ESC_ID)
            who = f"{axis.name} (motor {motor.id})"
            (heard if number is not None else silent).append(who)
            if number is None and self._registers.read(motor.id, 0, damiao.ESC_ID) is not None:
                raise DriverError(
                    f"{self._where(axis, motor)}: answers with id 0, where all new motors do, so "
                    f"none can be distinguished; set its MST_ID (register 7) to "
                    f"{motor.feedback_id:#x} in the maker's tool"
                )
        if silent:
            others = f"; {', '.join(heard)} answered" if heard else ""
            raise DriverError(
                f"bus {self._bus.name}: no answer from {', '.join(silent)}{others}; check power, "
                "cable, termination and bit rate, and the ids with: tautwave scan mit --interface "
                f"{self._options.interface} --channel {self._options.channel}"
            )

    def _prepare(self, axis: AxisSpec, motor: Motor) -> Found:
        where = self._where(axis, motor)
        answers = self._registers.answers(motor.id, None, damiao.ESC_ID)
        if len(answers) > 1:
            ids = ", ".join(f"{answer:#x}" for answer, _ in answers)
            raise DriverError(
                f"{where}: {len(answers)} motors answer to this id (with {ids}), and would follow "
                "the same commands; give each its own (ESC_ID, register 8) with the others' power "
                "off"
            )
        feedback = self._switched_off(where, motor)
        self._same(where, motor)
        scale = self._scale(where, motor)
        turned = self._turned(where, axis, motor, scale, feedback)
        settings = self._settings(where, motor)
        settings.keep(_setting(damiao.CTRL_MODE, damiao.MIT_MODE))
        watchdog_s, unwatched = self._watch(where, motor, settings)
        identity = self._identity(where, motor)
        return Found(turned, identity, watchdog_s, unwatched)

    def _switched_off(self, where: str, motor: Motor) -> Feedback:
        """Switch it off, and see that it says so; clear its error where that is asked for."""
        feedback = self._registers.told(motor.id, motor.feedback_id, damiao.DISABLE)
        if feedback is not None and feedback.state not in (damiao.DISABLED, damiao.ENABLED):
            text = damiao.state_text(feedback.state)
            if feedback.state != damiao.TIMED_OUT and not self._options.clear_errors:
                raise DeviceFault(
                    f"{where}: {text}; remove the cause, then set clear_errors: true in the bus' "
                    "options, or switch its power off and on"
                )
            self._registers.told(motor.id, motor.feedback_id, damiao.CLEAR)
            feedback = self._registers.told(motor.id, motor.feedback_id, damiao.DISABLE)
            self._notes.append(f"{where}: {text}; cleared")
        if feedback is None:
            raise DriverError(
                f"{where}: answers about registers, but does not report its state when it is "
                "switched off; update its firmware"
            )
        if feedback.state != damiao.DISABLED:
            raise DeviceFault(
                f"{where}: {damiao.state_text(feedback.state)}, and disable does not change that; "
                "switch its power off and on"
            )
        return feedback

    def _same(self, where: str, motor: Motor) -> None:
        """Compare the ids that the motor itself has."""
        for register, stated, key in (
            (damiao.ESC_ID, motor.id, "id"),
            (damiao.MST_ID, motor.feedback_id, "feedback_id"),
        ):
            own_id = self._need(motor, register)
            if own_id != stated:
                raise DriverError(
                    f"{where}: {register} reads {own_id:.0f}, but the rig states {key}: {stated}; "
                    "correct options.motors, or set the register in the maker's tool"
                )

    def _scale(self, where: str, motor: Motor) -> Scale:
        """Return the scale by the motor's own ranges; refuse a rig that states others."""
        ranges = {}
        for register, key in (
            (damiao.P_MAX, "p_max"), (damiao.V_MAX, "v_max"), (damiao.T_MAX, "t_max")
        ):  # fmt: skip
            own_range, stated = self._need(motor, register), getattr(motor, key)
            if not abs(own_range - stated) <= CLOSE * stated:
                raise DriverError(
                    f"{where}: {register} reads {own_range:.6g}, but the rig states {key}: "
                    f"{stated:g}; every number would be wrong by that ratio: write {key}: "
                    f"{own_range:.6g} if this is the right motor"
                )
            ranges[key] = own_range
        self._filter(where, motor)
        return scale_of(motor.model_copy(update=ranges))

    def _filter(self, where: str, motor: Motor) -> None:
        """Compare the low-pass behind which the damper in the motor has its velocity."""
        if not motor.damping_code:
            return
        bandwidth, stated = self._need(motor, damiao.V_BANDWIDTH), motor.velocity_filter_hz
        if stated is None or not abs(bandwidth - stated) <= CLOSE * stated:
            raise DriverError(
                f"{where}: {damiao.V_BANDWIDTH} reads {bandwidth:.6g}, but the rig states "
                f"velocity_filter_hz: {stated:g}; the certificate of its damper rests on it: write "
                f"velocity_filter_hz: {bandwidth:.6g}"
            )
        self._notes.append(
            f"{where}: damper of {motor.damping_code * damiao.DAMPING_STEP:.4g} N m s/rad in the "
            f"motor, its velocity behind {damiao.V_BANDWIDTH} = {bandwidth:g}"
        )

    def _turned(
        self, where: str, axis: AxisSpec, motor: Motor, scale: Scale, said: Feedback
    ) -> Scale:
        """Take a position back by whole turns that the motor lost with its power."""
        position = scale.position_of(said.position)
        turns = turns_back(position, axis.position_range)
        low, high = axis.position_range
        if not turns:
            raise DriverError(
                f"{where}: it is at {position:.4g} rad, outside position_range {low:g} to "
                f"{high:g}, and no whole number of turns is inside; move it there by hand, or "
                "correct zero"
            )
        if turns[0] == 0:
            if open_turns := doubt(position, axis.position_range):
                self._notes.append(f"{where}: {open_turns}")
            return scale
        if len(turns) > 1:
            raise DriverError(
                f"{where}: it is at {position:.4g} rad, outside position_range {low:g} to "
                f"{high:g}, which holds it after {' or '.join(str(one) for one in turns)} turns: "
                "move it well inside by hand, then switch its power off and on"
            )
        self._notes.append(
            f"{where}: its encoder counts one turn only; taken for {turns[0]:+d} turns further, "
            f"{position + turns[0] * math.tau:.4g} rad, the only place in position_range"
        )
        shift = turns[0] * math.tau
        return scale._replace(zero=scale.zero - motor.direction * shift)

    def _watch(
        self, where: str, motor: Motor, settings: DeviceSettings
    ) -> tuple[float | None, str]:
        """Set TIMEOUT and read it back; say what happens where that cannot be done."""
        counts = timeout_counts(self._options)
        counts_read = settings.settle(_setting(damiao.TIMEOUT, counts)).after
        if counts_read == counts:
            seconds = counts * damiao.TIMEOUT_S
            self._notes.append(
                f"{where}: switches its torque off after {seconds:g} s without a frame "
                f"({damiao.TIMEOUT} = {counts}, read back; kept until power off)"
            )
            return seconds, ""
        if not self._bus.allow_unwatched:
            raise DriverError(
                f"{where}: {damiao.TIMEOUT} reads {counts_read} after {counts} was written, so it "
                "would keep its last torque if the host stops; update its firmware, or run with "
                "--allow-unwatched"
            )
        return None, (
            f"(motor {motor.id}) keeps its last torque: {damiao.TIMEOUT} reads {counts_read}"
        )

    def _identity(self, where: str, motor: Motor) -> dict[str, str]:
        version = f"{self._need(motor, damiao.SOFTWARE):.0f}"
        gear, rotor = self._need(motor, damiao.GEAR), self._need(motor, damiao.INERTIA)
        volts = self._registers.read(motor.id, motor.feedback_id, damiao.VOLTAGE)
        supply = "" if volts is None else f", {volts:.1f} V"
        self._notes.append(
            f"{where}: firmware {version}, gear {gear:g}, rotor {rotor:.3g} kg m^2{supply}"
        )
        return {
            "firmware": f"{version}.{self._need(motor, damiao.SUB_VERSION):.0f}",
            "hardware": f"{self._need(motor, damiao.HARDWARE):.0f}",
            "serial": f"{self._need(motor, damiao.SERIAL):.0f}",
            "gear_ratio": f"{gear:g}",
            "rotor_inertia": f"{rotor:.4g}",
        }

    def _settings(self, where: str, motor: Motor) -> DeviceSettings:
        """Return the ledger of a motor; frames get lost, so a write is repeated until it shows."""

        def write(register: Register, value: int) -> None:
            self._registers.set(motor.id, motor.feedback_id, register, value)

        return DeviceSettings(
            where,
            lambda register: round(self._need(motor, register)),
            write,
            doubt="update its firmware, or set it in the maker's tool",
            notes=self._notes,
        )

    def _need(self, motor: Motor, register: Register) -> float:
        try:
            return self._registers.need(motor.id, motor.feedback_id, register)
        except DriverError as err:
            raise type(err)(f"bus {self._bus.name}: {err}") from err

    def _where(self, axis: AxisSpec, motor: Motor) -> str:
        return f"bus {self._bus.name}: {axis.name} (motor {motor.id})"


def _setting(register: Register, wanted: int) -> DeviceSetting:
    return DeviceSetting(register, str(register), wanted)
