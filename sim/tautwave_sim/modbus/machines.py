"""How the drives of each family are switched on and off, fail, and are reset."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol

from tautwave_sim.cia402 import State, StateMachine
from tautwave_sim.modbus.options import Quirks
from tautwave_sim.modbus.registers import RegisterBank
from tautwave_sim.modbus.table import Table

INPUTS_OPEN = 0x1FF
"""Levels of the inputs of a drive to which nothing is wired."""
SERVO_ON = 1
"""FunIN.1 of the DSY-RS."""


class Machine(Protocol):
    """From registers to whether a drive is on."""

    @property
    def state(self) -> str:
        """`off`, `on` or `fault`."""
        ...

    def on_write(self, fresh: set[str], now_ns: int) -> None:
        """Note registers that were just written."""
        ...

    def fail(self, code: int) -> None:
        """Go into fault, with a code."""
        ...

    def next_ns(self) -> int | None:
        """Return when it changes by itself [ns]."""
        ...

    def run(self, now_ns: int) -> None:
        """Let happen what is due."""
        ...


class PlainMachine(ABC):
    """Off, on after a while, fault; a reset is accepted only while the drive is commanded off.

    Parameters
    ----------
    bank : RegisterBank
        Its registers.
    table : Table
        Its family.
    quirks : Quirks
        How it differs.
    """

    def __init__(self, bank: RegisterBank, table: Table, quirks: Quirks) -> None:
        self._bank = bank
        self._status = table.roles["status"]
        self._fault = table.roles.get("fault", "")
        self._states = table.states
        self._enable_ns = round(quirks.enable_s * 1e9)
        self._refuses = quirks.refuses_to_enable
        self._resets = quirks.resets
        self._edges = 0
        self._due_ns: int | None = None
        self._state = "off"
        bank.readers[self._status] = self.status

    @property
    def state(self) -> str:
        """`off`, `on` or `fault`."""
        return self._state

    def status(self) -> int:
        """Return the word that the status register shows."""
        return self._states[self._state]

    def commanded_on(self) -> bool:
        """Return whether the registers command it on."""
        return bool(self._bank.values["control"] & 1)

    @abstractmethod
    def reset_requested(self, fresh: set[str]) -> bool:
        """Return whether a fault reset was just requested."""

    def on_write(self, fresh: set[str], now_ns: int) -> None:
        """Note registers that were just written."""
        reset = self.reset_requested(fresh)
        if self.state == "fault":
            if reset and not self.commanded_on():
                self._edges += 1
                if self._edges >= self._resets:
                    self._state, self._edges = "off", 0
                    if self._fault:
                        self._bank.store(self._fault, 0)
            return
        if not self.commanded_on():
            self._state, self._due_ns = "off", None
        elif self.state == "off" and self._due_ns is None and not self._refuses:
            self._due_ns = now_ns + self._enable_ns
            self.run(now_ns)

    def fail(self, code: int) -> None:
        """Go into fault, with a code."""
        if self.state != "fault":
            self._state, self._due_ns = "fault", None
            if self._fault:
                self._bank.store(self._fault, code)

    def next_ns(self) -> int | None:
        """Return when it comes on [ns]."""
        return self._due_ns

    def run(self, now_ns: int) -> None:
        """Come on when it is time."""
        if self._due_ns is not None and now_ns >= self._due_ns:
            self._due_ns = None
            self._state = "on"


class GenericMachine(PlainMachine):
    """Bit 0 of `control` enables, a rising bit 1 resets."""

    _before = 0

    def reset_requested(self, fresh: set[str]) -> bool:
        """Return whether bit 1 rose."""
        word = self._bank.values["control"]
        rose = bool(word & 2 and not self._before & 2)
        self._before = word
        return rose


class DsyMachine(PlainMachine):
    """Input function 1 enables, P11.01 resets (DSY-RS manual, chapter 7, P02, P10 and P11).

    Nothing is wired to the inputs: they are high unless P11.10 and P11.11 force them.
    """

    def commanded_on(self) -> bool:
        """Return whether servo-on is active and no emergency stop is set."""
        values = self._bank.values
        levels = values["forced_inputs"] if values["forced_io"] & 1 else INPUTS_OPEN
        on = assigned = False
        for number in (1, 2, 3):
            if values[f"di{number}_function"] == SERVO_ON:
                assigned = True
                high = bool(levels >> number - 1 & 1)
                on = on or high == (values[f"di{number}_logic"] == 1)
        if not assigned:
            on = bool(values["unassigned_low"] & 1)
        return on and not values["emergency_stop"]

    def reset_requested(self, fresh: set[str]) -> bool:
        """Return whether 1 was written to P11.01, which falls back to 0."""
        if "fault_reset" not in fresh or not self._bank.values["fault_reset"]:
            return False
        self._bank.store("fault_reset", 0)
        return True


class StepsMachine(PlainMachine):
    """What a third party's profile says: on while the values of its enable sequence hold."""

    def __init__(self, bank: RegisterBank, table: Table, quirks: Quirks) -> None:
        assert table.sequences is not None
        self._sequences = table.sequences
        super().__init__(bank, table, quirks)

    def commanded_on(self) -> bool:
        """Return whether all that enabling writes is there."""
        values = self._bank.values
        return all(values[name] == value for name, value in self._sequences.on.items())

    def reset_requested(self, fresh: set[str]) -> bool:
        """Return whether the write that resets was just made."""
        values = self._bank.values
        return any(name in fresh and values[name] == to for name, to in self._sequences.resets)


class Cia402Machine:
    """The state machine of CiA 402, commanded by 6040h; stops are at once."""

    _STATUS = 0x1010
    """Bits 4 (voltage) and 12 (it follows the command) besides those of the state."""

    def __init__(self, bank: RegisterBank, table: Table, quirks: Quirks) -> None:
        self._bank = bank
        self._modes = table.modes
        self._refuses = quirks.refuses_to_enable
        self._machine = StateMachine(round(quirks.enable_s * 1e9), quirks.resets)
        self._roles = table.roles
        bank.readers[table.roles["status"]] = self.status
        bank.readers[table.roles["mode_display"]] = self.mode

    @property
    def state(self) -> str:
        """`off`, `on` or `fault`."""
        if self._machine.state in (State.FAULT, State.FAULT_REACTION):
            return "fault"
        return "on" if self._machine.state is State.ENABLED else "off"

    def status(self) -> int:
        """Return 6041h."""
        bits = 0x0200 | (self._STATUS if self.state == "on" else 0x0010)
        return int(self._machine.state) | bits

    def mode(self) -> int:
        """Return 6061h."""
        mode = self._bank.values[self._roles["mode"]]
        return mode if mode in self._modes else 0

    def on_write(self, fresh: set[str], now_ns: int) -> None:
        """Take a controlword."""
        if self._roles["control"] not in fresh:
            return
        word = self._bank.values[self._roles["control"]]
        if self._refuses and word & 0x8F == 0x0F:
            word &= ~0x08
        before = self.state
        self._machine.control(word, now_ns)
        self._come_to_rest()
        if before == "fault" and self.state != "fault":
            self._note(0)

    def fail(self, code: int) -> None:
        """Go into fault (transitions 13 and 14)."""
        if self.state != "fault":
            self._machine.fault(0)
            self._note(code)

    def _note(self, code: int) -> None:
        if "fault" in self._roles:
            self._bank.store(self._roles["fault"], code)

    def next_ns(self) -> int | None:
        """Return when a slow transition is over [ns]."""
        return self._machine.next_event_ns()

    def run(self, now_ns: int) -> None:
        """Let a slow transition end."""
        self._machine.run(now_ns)
        self._come_to_rest()

    def _come_to_rest(self) -> None:
        if self._machine.braking:
            self._machine.come_to_rest()


def make_machine(bank: RegisterBank, table: Table, quirks: Quirks) -> Machine:
    """Return the machine of a family."""
    if table.family == "cia402":
        return Cia402Machine(bank, table, quirks)
    if table.family == "dsy-rs":
        return DsyMachine(bank, table, quirks)
    if table.sequences is not None:
        return StepsMachine(bank, table, quirks)
    return GenericMachine(bank, table, quirks)
