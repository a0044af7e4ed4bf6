"""Sequences of a profile, step by step without waiting: writes, and waits for a value."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from tautwave.contracts import Clock
from tautwave.errors import BusTimeout, DeviceFault
from tautwave_drivers.modbus.profile import BITS, READERS, Profile, Step
from tautwave_drivers.modbus.protocol import frames
from tautwave_drivers.modbus.protocol.frames import Request
from tautwave_drivers.modbus.protocol.messages import (
    BEHIND_A_GATEWAY,
    exception_text,
    function_text,
)
from tautwave_drivers.modbus.protocol.registers import Block, from_words, to_words

CHECK = "check"
"""The sequence of steps that only compare: what differs has been forgotten."""


class Procedure(Protocol):
    """Something that takes transaction after transaction until it is done."""

    @property
    def done(self) -> bool:
        """Whether there is nothing left to do."""
        ...

    def requests(self) -> Sequence[Request]:
        """Return the next requests."""
        ...

    def take(self, responses: Sequence[bytes]) -> None:
        """Take the responses; raises `DeviceFault` or `BusTimeout`."""
        ...


class RegisterCodec:
    """Makes the requests that read and write the registers of one drive, and decodes responses.

    Parameters
    ----------
    profile : Profile
        Its registers.
    functions : sequence of int
        Function codes it accepts.
    """

    def __init__(self, profile: Profile, functions: Sequence[int]) -> None:
        self.profile = profile
        self._functions = functions
        self.several = 16 in functions
        self.both = 23 in functions and self.several and 3 in functions

    def read(self, name: str) -> Request:
        """Return the request that reads one register."""
        register = self.profile.registers[name]
        table = self.profile.table_of(register)
        return self.read_block(Block(register.address, register.words, (name,), table))

    def read_block(self, block: Block) -> Request:
        """Return the request that reads adjacent registers."""
        function = READERS[block.table]
        if block.table in BITS:
            return frames.read_bit(function, block.address)
        if function == 3 and 3 not in self._functions:
            function = 4  # a drive of which it is said that it takes no other
        return frames.read(function, block.address, block.words)

    def write(self, name: str, value: int) -> Request:
        """Return the request that writes one register."""
        register = self.profile.registers[name]
        if self.profile.table_of(register) == "coil":
            several = 5 not in self._functions
            return frames.write_coil(register.address, value, several=several)
        words = to_words(value, register.type, self.profile.low_first(register))
        if self.several:
            return frames.write(register.address, words)
        return frames.write_one(register.address, words[0])

    def decode(self, name: str, pdu: bytes) -> int:
        """Return the value in a response."""
        register = self.profile.registers[name]
        if self.profile.table_of(register) in BITS:
            return pdu[2] & 1
        words = frames.words_of(pdu)
        return from_words(words, register.type, self.profile.low_first(register))


def refusal(pdu: bytes) -> str:
    """Return the exception in a PDU as text, '' if it has none."""
    if pdu[0] & frames.REFUSED:
        return f"{exception_text(pdu[1])} to {function_text(pdu[0] & ~frames.REFUSED)}"
    return ""


def behind_gateway(pdu: bytes) -> str:
    """Return what to check where a gateway answered instead of the drive, '' where it did not."""
    if pdu[0] & frames.REFUSED and pdu[1] in BEHIND_A_GATEWAY:
        return (
            "; the gateway was reached, but not the drive: check its unit id, its supply and "
            "cable, and the gateway's serial settings (baud, parity, stop bits)"
        )
    return ""


def is_busy(pdu: bytes) -> bool:
    """Return whether a drive only needs more time: acknowledge (05) or busy (06)."""
    return bool(pdu[0] & frames.REFUSED) and pdu[1] in (5, 6)


class Steps:
    """Runs a sequence of a profile.

    Parameters
    ----------
    label : str
        Of the drive, for messages.
    what : str
        Of the sequence: `enable`.
    codec : RegisterCodec
        Makes the requests.
    steps : sequence of Step
        What to do.
    clock : Clock
        For the timeouts.
    """

    def __init__(
        self, label: str, what: str, codec: RegisterCodec, steps: Sequence[Step], clock: Clock
    ) -> None:
        self._label = label
        self._what = what
        self._codec = codec
        self._steps = list(steps)
        self._clock = clock
        self._at = 0
        self._since_ns: int | None = None
        self._failed = ""

    @property
    def done(self) -> bool:
        """Whether every step is done."""
        return self._at == len(self._steps)

    def requests(self) -> Sequence[Request]:
        """Return the write of this step, or the read of what it waits for."""
        if self.done:
            return ()
        if self._failed:
            return (self._codec.read(self._codec.profile.roles["fault"]),)
        step = self._steps[self._at]
        if self._since_ns is None:
            self._since_ns = self._clock.now_ns()
        if step.write is not None:
            return (self._codec.write(step.write, step.value),)
        return (self._codec.read(step.register_name),)

    def take(self, responses: Sequence[bytes]) -> None:
        """Go to the next step if this one is done.

        Raises
        ------
        DeviceFault
            The drive refuses, or goes into fault instead.
        BusTimeout
            The awaited value does not come.
        """
        if not responses or self.done:
            return
        if self._failed:
            raise DeviceFault(f"{self._failed}: {self._fault_text(responses[0])}")
        step = self._steps[self._at]
        name = step.register_name
        where = f"{self._label}: {self._what}, step {self._at + 1} ({name})"
        refused = refusal(responses[0])
        if refused and not (is_busy(responses[0]) and not self._expired(step)):
            raise DeviceFault(f"{where}: {refused}{behind_gateway(responses[0])}")
        if refused:
            return
        if step.write is None:
            value = self._codec.decode(name, responses[0])
            if value & step.mask != step.value & step.mask:
                self._wait(step, value, where)
                return
        self._at += 1
        self._since_ns = None

    def _expired(self, step: Step) -> bool:
        since = self._since_ns
        return since is not None and self._clock.now_ns() - since > step.timeout_s * 1e9

    def _wait(self, step: Step, found: int, where: str) -> None:
        if self._what == CHECK:
            raise DeviceFault(f"{self._label}: {forgot_text(step, found)}")
        profile = self._codec.profile
        states = profile.states if step.wait == profile.roles["status"] else None
        if self._what == "enable" and states is not None and states.fault.fits(found):
            self._failed = f"{where}: went into fault instead (status {found:#x})"
            if "fault" not in profile.roles:
                raise DeviceFault(f"{self._failed}; check the drive's display")
            return
        if self._expired(step):
            raise BusTimeout(
                f"{where}: still {found:#x} after {step.timeout_s:g} s, expected {step.value:#x} "
                f"in the bits {step.mask & 0xFFFF:#x}; check the drive's supply and display"
            )

    def _fault_text(self, pdu: bytes) -> str:
        if refusal(pdu):
            return refusal(pdu)
        code = self._codec.decode(self._codec.profile.roles["fault"], pdu)
        return fault_text(self._codec.profile, code)


def forgot_text(step: Step, found: int) -> str:
    """Return that a register no longer holds what was set, as text."""
    return (
        f"{step.register_name} reads {found} instead of {step.value}: it was switched off and on, "
        "or another program wrote to it; check its supply"
    )


def fault_text(profile: Profile, code: int | None) -> str:
    """Return a fault's code as text; None is an unknown code."""
    if code is None:
        return "this drive does not report which; check its display"
    meaning = profile.faults.get(code, "not in the profile; look it up in the drive's manual")
    return f"{meaning} (code {code:#x})"
