"""Sequences of a profile, step by step without waiting: writes, and waits for a value."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from tautwave.contracts import Clock
from tautwave.errors import BusTimeout, DeviceFault
from tautwave_drivers.modbus import frames
from tautwave_drivers.modbus.frames import Question
from tautwave_drivers.modbus.profile import Profile, Step
from tautwave_drivers.modbus.registers import from_words, to_words
from tautwave_drivers.modbus.words import exception_words, function_words


class Walk(Protocol):
    """Something that goes on with every errand until it is done."""

    @property
    def done(self) -> bool:
        """Whether there is nothing left to do."""
        ...

    def questions(self) -> Sequence[Question]:
        """Return what is to be asked next."""
        ...

    def take(self, answers: Sequence[bytes]) -> None:
        """Take the answers; raises `DeviceFault` or `BusTimeout`."""
        ...


class Speech:
    """How registers of one drive are asked for and set.

    Parameters
    ----------
    profile : Profile
        Its registers.
    functions : sequence of int
        Function codes it accepts.
    """

    def __init__(self, profile: Profile, functions: Sequence[int]) -> None:
        self.profile = profile
        self.reading = 3 if 3 in functions else 4
        self.several = 16 in functions
        self.both = 23 in functions and self.several and self.reading == 3

    def read(self, name: str) -> Question:
        """Return the question for one register."""
        register = self.profile.registers[name]
        return frames.read(self.reading, register.address, register.words)

    def write(self, name: str, value: int) -> Question:
        """Return the question that sets one register."""
        register = self.profile.registers[name]
        words = to_words(value, register.type, self.profile.low_first(register))
        if self.several:
            return frames.write(register.address, words)
        return frames.write_one(register.address, words[0])

    def decode(self, name: str, pdu: bytes) -> int:
        """Return the value in an answer."""
        register = self.profile.registers[name]
        words = frames.words_of(pdu)
        return from_words(words, register.type, self.profile.low_first(register))


def refusal(pdu: bytes) -> str:
    """Return the exception in a PDU in words, '' if it is none."""
    if pdu[0] & frames.REFUSED:
        return f"{exception_words(pdu[1])} to {function_words(pdu[0] & ~frames.REFUSED)}"
    return ""


def is_busy(pdu: bytes) -> bool:
    """Return whether a drive only asks for patience: acknowledge (05) or busy (06)."""
    return bool(pdu[0] & frames.REFUSED) and pdu[1] in (5, 6)


class Steps:
    """The walk through a sequence.

    Parameters
    ----------
    label : str
        Of the drive, for sentences.
    what : str
        Of the sequence: `enable`.
    speech : Speech
        How the drive is spoken to.
    steps : sequence of Step
        What to do.
    clock : Clock
        For the timeouts.
    """

    def __init__(
        self, label: str, what: str, speech: Speech, steps: Sequence[Step], clock: Clock
    ) -> None:
        self._label = label
        self._what = what
        self._speech = speech
        self._steps = list(steps)
        self._clock = clock
        self._at = 0
        self._since_ns: int | None = None
        self._failed = ""

    @property
    def done(self) -> bool:
        """Whether every step is done."""
        return self._at == len(self._steps)

    def questions(self) -> Sequence[Question]:
        """Return the write of this step, or the read of what it waits for."""
        if self.done:
            return ()
        if self._failed:
            return (self._speech.read(self._speech.profile.roles["fault"]),)
        step = self._steps[self._at]
        if self._since_ns is None:
            self._since_ns = self._clock.now_ns()
        if step.write is not None:
            return (self._speech.write(step.write, step.value),)
        return (self._speech.read(step.register_name),)

    def take(self, answers: Sequence[bytes]) -> None:
        """Go on if the step is done.

        Raises
        ------
        DeviceFault
            The drive refuses, or goes into fault instead.
        BusTimeout
            What is waited for does not come.
        """
        if not answers or self.done:
            return
        if self._failed:
            raise DeviceFault(f"{self._failed}: {self._fault_words(answers[0])}")
        step = self._steps[self._at]
        name = step.register_name
        where = f"{self._label}: {self._what}, step {self._at + 1} ({name})"
        refused = refusal(answers[0])
        if refused and not (is_busy(answers[0]) and not self._expired(step)):
            raise DeviceFault(f"{where}: {refused}")
        if refused:
            return
        if step.write is None:
            found = self._speech.decode(name, answers[0])
            if found & step.mask != step.value & step.mask:
                self._wait(step, found, where)
                return
        self._at += 1
        self._since_ns = None

    def _expired(self, step: Step) -> bool:
        since = self._since_ns
        return since is not None and self._clock.now_ns() - since > step.timeout_s * 1e9

    def _wait(self, step: Step, found: int, where: str) -> None:
        profile = self._speech.profile
        states = profile.states if step.wait == profile.roles["status"] else None
        if self._what == "enable" and states is not None and states.fault.fits(found):
            self._failed = f"{where}: it goes into fault instead (status {found:#x})"
            if "fault" not in profile.roles:
                raise DeviceFault(f"{self._failed}; look at the drive's display")
            return
        if self._expired(step):
            raise BusTimeout(
                f"{where}: still reads {found:#x} after {step.timeout_s:g} s, expected "
                f"{step.value:#x} in the bits {step.mask & 0xFFFF:#x}; look at the drive's supply "
                "and display"
            )

    def _fault_words(self, pdu: bytes) -> str:
        if refusal(pdu):
            return refusal(pdu)
        code = self._speech.decode(self._speech.profile.roles["fault"], pdu)
        return fault_words(self._speech.profile, code)


def fault_words(profile: Profile, code: int | None) -> str:
    """Return a fault's code in words, None where the drive does not tell it."""
    if code is None:
        return "this drive does not tell which; look at its display"
    told = profile.faults.get(code, "no table knows this code; look at its manual")
    return f"{told} (code {code:#x})"
