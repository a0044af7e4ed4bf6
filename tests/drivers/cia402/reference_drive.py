"""A drive's side of CiA 402, written from the standard's diagram and not from the driver's code.

Everything is bit tests on the controlword, as the standard's table of commands has them:

    shutdown            bit 7 = 0, bit 2 = 1, bit 1 = 1, bit 0 = 0
    switch on           bit 7 = 0, bits 2 to 0 = 1, bit 3 = 0
    enable operation    bit 7 = 0, bits 3 to 0 = 1
    disable voltage     bit 7 = 0, bit 1 = 0
    quick stop          bit 7 = 0, bit 2 = 0, bit 1 = 1
    fault reset         rising edge of bit 7
"""

from __future__ import annotations

from dataclasses import dataclass, field

WORDS = {
    "start": 0x0000,
    "disabled": 0x0040,
    "ready": 0x0021,
    "on": 0x0023,
    "enabled": 0x0027,
    "stop": 0x0007,
    "reaction": 0x000F,
    "fault": 0x0008,
}
ARROWS = {
    ("start", "disabled"): 1,
    ("disabled", "ready"): 2,
    ("ready", "on"): 3,
    ("on", "enabled"): 4,
    ("enabled", "on"): 5,
    ("on", "ready"): 6,
    ("ready", "disabled"): 7,
    ("enabled", "ready"): 8,
    ("enabled", "disabled"): 9,
    ("on", "disabled"): 10,
    ("enabled", "stop"): 11,
    ("stop", "disabled"): 12,
    ("reaction", "fault"): 14,
    ("fault", "disabled"): 15,
    ("stop", "enabled"): 16,
}


@dataclass
class Drive:
    """One drive; `cycle(controlword, mode)` is what its own firmware does once per cycle."""

    slowness: int = 1  # cycles that a command has to stand before the drive follows
    boot: int = 3
    mode_delay: int = 2
    stop_time: int = 5
    option: int = 2  # 605Ah
    resets_needed: int = 1
    deaf_to: int = 0  # so many first commands are missed; it acts on changes of the word only
    on_changes: bool = False
    refuses_mode: bool = False
    state: str = "start"
    display: int = 0
    voltage: bool = True
    remote: bool = True
    taken: set[int] = field(default_factory=set)
    enabled_in: list[int] = field(default_factory=list)
    changed_with_torque: list[int] = field(default_factory=list)
    _time: int = 0
    _last: int = 0xFFFF
    _wish: str = ""
    _held: int = 0
    _mode_age: int = 0

    @property
    def statusword(self) -> int:
        word = WORDS[self.state] | (0x10 if self.voltage else 0) | (0x200 if self.remote else 0)
        free = self.state in ("disabled", "fault", "start")  # where bit 5 has no meaning
        return word | (0x20 if free else 0)

    def go(self, state: str) -> None:
        number = 13 if state == "reaction" else ARROWS[self.state, state]
        self.taken.add(number)
        if state == "enabled":
            self.enabled_in.append(self.display)
        self.state = state
        self._time = 0
        self._wish = ""

    def fail(self) -> None:
        if self.state not in ("reaction", "fault", "start"):
            self.go("reaction")

    def drop_power(self) -> None:
        """STO: the drive goes to SWITCH ON DISABLED from wherever the power stage is."""
        if self.state in ("ready", "on", "enabled", "stop"):
            self.go("disabled")

    def restart(self) -> None:
        self.state, self._time, self.display, self._wish = "start", 0, 0, ""

    def cycle(self, word: int, mode: int) -> None:
        self._time += 1
        self._take_mode(mode)
        if self.state == "start" and self._time > self.boot:
            self.go("disabled")
        elif self.state == "reaction" and self._time > 3:
            self.go("fault")
        elif self.state == "fault":
            if word & 0x80 and not self._last & 0x80:
                self.resets_needed -= 1
                if self.resets_needed <= 0:
                    self.go("disabled")
        elif self.state == "stop" and 1 <= self.option <= 4 and self._time > self.stop_time:
            self.go("disabled")
        else:
            self._follow(word, changed=word != self._last)
        self._last = word

    def _take_mode(self, mode: int) -> None:
        self._mode_age = self._mode_age + 1 if mode != self.display else 0
        if self._mode_age > self.mode_delay and mode and not self.refuses_mode:
            if mode != self.display and self.state in ("enabled", "stop"):
                self.changed_with_torque.append(mode)
            self.display = mode

    def _follow(self, word: int, *, changed: bool) -> None:
        wish = self._asked(word)
        if self.on_changes and not changed and wish != self._wish:
            return  # firmware that looks at commands only when the word changes
        if wish and changed and self.deaf_to > 0:
            self.deaf_to -= 1
            return
        self._held = self._held + 1 if wish and wish == self._wish else 1
        self._wish = wish
        if wish and self._held >= self.slowness:
            self.go(wish)

    def _asked(self, word: int) -> str:
        if word & 0x80 or self.state in ("start", "reaction"):
            return ""
        low = [bool(word & (1 << bit)) for bit in range(4)]
        powered = self.state in ("ready", "on", "enabled", "stop")
        if not low[1]:
            return "disabled" if powered else ""
        if not low[2]:
            return {"ready": "disabled", "on": "disabled", "enabled": "stop"}.get(self.state, "")
        if not low[0]:
            return "ready" if self.state in ("disabled", "on", "enabled") else ""
        if not low[3]:
            return {"ready": "on", "enabled": "on"}.get(self.state, "") if self.voltage else ""
        if self.state == "stop":
            return "enabled" if self.option >= 5 else ""
        return {"ready": "on", "on": "enabled"}.get(self.state, "") if self.voltage else ""
