"""A simulated drive: registers in front, machine, watchdog and motor behind them."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.errors import ConfigError
from tautwave.truth import AxisModel
from tautwave_sim.modbus.families import load_table
from tautwave_sim.modbus.machines import Machine, make_machine
from tautwave_sim.modbus.motor import Motor
from tautwave_sim.modbus.options import DeviceKeys, Quirks
from tautwave_sim.modbus.registers import (
    DEVICE_BUSY,
    DEVICE_FAILURE,
    TABLES,
    Refusal,
    RegisterBank,
)
from tautwave_sim.modbus.table import Table
from tautwave_sim.modbus.units import drive_scale
from tautwave_sim.modbus.wire.protocol import TABLE_OF, Request

COMMANDS = ("command_effort", "command_velocity", "command_position")
OVERCURRENT = 0x2310
"""A code for scripted faults that name none (CiA 402-2: continuous over current)."""
LINE_LOST = 0x7500
"""Code of a lost line where a table names none (CiA 402-2: communication)."""


class Drive:
    """One drive on the line.

    Parameters
    ----------
    device : DeviceKeys
        Its options.
    quirks : Quirks
        How it differs.
    name : str
        Of its axis.
    kind : str
        `rotary` or `linear`.
    truth : AxisModel
        Its physics.
    """

    def __init__(
        self, device: DeviceKeys, quirks: Quirks, name: str, kind: str, truth: AxisModel
    ) -> None:
        self.unit = device.unit
        self.table: Table = load_table(device.profile)
        self.functions = device.function_codes or self.table.functions
        self.bank = RegisterBank(self.table.registers)
        self.bank.gaps_read_zero = TABLES if quirks.gaps_read_zero else self.table.gaps_read_zero
        self.bank.objects, self.bank.most = self.table.objects, self.table.most
        self._quirks = quirks
        self._prime(device)
        rated = self._rated(device)
        scale = drive_scale(device, self.table, rated, kind, truth)
        self.motor = Motor(name, truth, scale)
        self._first = dict(self.bank.values)
        self.machine: Machine = make_machine(self.bank, self.table, quirks)
        for role, read in (
            ("position", lambda: self.motor.position_counts),
            ("velocity", lambda: self.motor.velocity_counts),
            ("effort", lambda: self.motor.torque_counts),
        ):
            if role in self.table.roles:
                self.bank.readers[self.table.roles[role]] = read
        sensor = device.effort_sensor
        if sensor is not None and sensor.register_name in self.bank.values:
            self.bank.readers[sensor.register_name] = lambda: self.motor.sensor_counts(
                sensor.effort, sensor.zero
            )
        self.origin_ns: int | None = None
        """First exchange since it is on; from then on its slots follow time."""
        self.base = 0
        """Slot of the bus at that time."""
        self.reported_ns = 0
        """Last command."""
        self.reported_slot = 0
        self.now_ns = 0
        self.wear: dict[str, int] = {}
        """Writes to EEPROM by register."""
        self._heard_ns = 0
        self._busy_ns = 0
        self._was_on = False
        self._positioning = False
        self._goal = 0
        self.limited = False
        if quirks.starts_in_fault:
            self.machine.fail(self.fault_code(None))

    def _rated(self, device: DeviceKeys) -> float:
        name = self.table.roles.get("rated_torque")
        if device.rated_torque is not None:
            return device.rated_torque
        if name is None or not self.bank.values[name]:
            return 1.0
        return self.bank.values[name] * float(self.table.scale["rated_torque"])

    def _prime(self, device: DeviceKeys) -> None:
        roles, scale = self.table.roles, self.table.scale
        if device.rated_torque is not None and "rated_torque" in roles:
            counts = round(device.rated_torque / scale["rated_torque"])
            self.bank.store(roles["rated_torque"], counts)
        if device.counts_per_revolution is not None and "counts" in roles:
            self.bank.store(roles["counts"], round(device.counts_per_revolution))
        for name, value in self._quirks.registers.items():
            if name not in self.bank:
                known = ", ".join(self.bank.registers)
                raise ConfigError(
                    f"modbus unit {device.unit}: simulator names a register {name!r}, which "
                    f"{self.table.family} does not have; it has {known}"
                )
            self.bank.store(name, value)

    # ---------------------------------------------------------------------------- state

    @property
    def on(self) -> bool:
        """Whether its motor follows commands."""
        return self.machine.state == "on"

    def fault_code(self, code: int | None) -> int:
        """Return the code of a scripted fault."""
        if code is not None:
            return code
        return self.table.faults.get("overcurrent", OVERCURRENT)

    def inject(self, kind: str, code: int | None) -> None:
        """Have something scripted happen to it."""
        if kind == "power_cycle":
            self.bank.values.update(self._first)
            self.machine = make_machine(self.bank, self.table, self._quirks)
        else:
            self.machine.fail(self.fault_code(code))
        self._follow()

    def timeout_ns(self) -> int:
        """Return after what silence it fails [ns]; 0 is never."""
        role = self.table.roles.get("comm_timeout")
        if role is None:
            return 0
        return round(self.bank.values[role] * float(self.table.scale["comm_timeout"]) * 1e9)

    def settle(self, now_ns: int) -> None:
        """Let happen what is due by `now_ns`: slow transitions, and the watchdog of the line."""
        while True:
            due_ns = self.machine.next_ns()
            limit_ns = self.timeout_ns() if self.on else 0
            end_ns = self._heard_ns + limit_ns
            if due_ns is not None and due_ns <= now_ns and not (limit_ns and end_ns < due_ns):
                self.machine.run(due_ns)
            elif limit_ns and end_ns < now_ns:
                self.machine.fail(self.table.faults.get("comm_loss", LINE_LOST))
            else:
                break
            self._follow()
        self.now_ns = max(self.now_ns, now_ns)

    def hear(self, now_ns: int) -> None:
        """Note that a request to it has come."""
        self.settle(now_ns)
        self._heard_ns = now_ns

    def commanded_by(self, request: Request) -> bool:
        """Return whether a request writes a command."""
        roles, count = self.table.roles, len(request.words)
        table = TABLE_OF.get(request.function, "holding")
        return any(
            role in roles and self.bank.holds(roles[role], request.write_address, count, table)
            for role in COMMANDS
        )

    def shows_position(self, request: Request) -> bool:
        """Return whether a request reads the position."""
        name = self.table.roles["position"]
        table = TABLE_OF.get(request.function, "holding")
        return self.bank.holds(name, request.read_address, request.read_count, table)

    # --------------------------------------------------------------------------- requests

    def read(self, address: int, count: int, table: str = "holding") -> list[int]:
        """Return words; raises `Refusal`."""
        if self.now_ns < self._busy_ns:
            raise Refusal(DEVICE_BUSY)
        words = self.bank.read(address, count, table)
        bit = self.table.limit_bit
        status = self.bank.registers[self.table.roles["status"]].address
        if bit and self.limited and address <= status < address + count:
            words[status - address] |= bit
        return words

    def write(self, address: int, words: Sequence[int], table: str = "holding") -> None:
        """Take words, all or none; raises `Refusal`."""
        if self.now_ns < self._busy_ns:
            raise Refusal(DEVICE_BUSY)
        fresh = self.bank.check(address, words, table)
        stored = [name for name in fresh if self.bank.registers[name].eeprom]
        if stored and self._stores():
            life = self._quirks.eeprom_life
            if life is not None and sum(self.wear.values()) >= life:
                raise Refusal(DEVICE_FAILURE)
            for name in stored:
                self.wear[name] = self.wear.get(name, 0) + 1
                self._first[name] = fresh[name]
            self._busy_ns = self.now_ns + round(self._quirks.busy_after_write_s * 1e9)
        if self._quirks.keeps_comm_timeout:
            fresh.pop(self.table.roles.get("comm_timeout", ""), None)
        for name, value in fresh.items():
            self.bank.store(name, value)
        self.machine.on_write(set(fresh), self.now_ns)
        self._follow()

    def _stores(self) -> bool:
        name = self.table.roles.get("eeprom")
        return name is None or self.bank.values[name] != self.table.eeprom_off

    # ----------------------------------------------------------------------------- motor

    def _follow(self) -> None:
        """Pass on to the motor what registers and state command."""
        on = self.on
        if on and not self._was_on:
            self.origin_ns = None  # held until the first exchange that finds it on
        self._was_on = on
        counts, how = self._command() if on else (0, "")
        self._positioning = how == "position" and self.motor.servo
        self._goal = counts
        if self._positioning:
            return
        if how == ("velocity" if self.motor.servo else "effort"):
            self.motor.command(counts)
        else:
            self.motor.command(0)

    def _command(self) -> tuple[int, str]:
        roles, values = self.table.roles, self.bank.values
        if "mode" in roles:
            how = self.table.modes.get(values[roles["mode"]], "")
        else:
            how = "effort" if "command_effort" in roles else "velocity"
        name = roles.get(f"command_{how}")
        self.limited = False
        if name is None:
            return 0, ""
        counts = values[name]
        if how == "position":
            return self._between(counts, "position_low", "position_high", 1), how
        held = self._between(counts, f"{how}_limit_backward", f"{how}_limit_forward", -1)
        low, high = roles.get("position_low"), roles.get("position_high")
        if low is not None and held < 0 and self.motor.position_counts <= values[low]:
            held, self.limited = 0, True
        if high is not None and held > 0 and self.motor.position_counts >= values[high]:
            held, self.limited = 0, True
        return held, how

    def _between(self, counts: int, low: str, high: str, sign: int) -> int:
        roles, values = self.table.roles, self.bank.values
        held = counts
        if high in roles:
            held = min(held, values[roles[high]])
        if low in roles:
            held = max(held, sign * values[roles[low]])
        self.limited = self.limited or held != counts
        return held

    def pass_slot(self) -> None:
        """Have the motor move by one slot."""
        if self._positioning:
            self.motor.approach(self._goal)
        self.motor.pass_slot()

    def latch(self) -> None:
        """Sample a slot; limits may have changed with it."""
        self.motor.latch()
        self._follow()
