"""All drives on one RTU line: frames by their silences, one response at a time.

A frame ends with 3.5 characters of silence; what follows sooner, be it the master's or a drive's,
belongs to the same frame, which is then invalid and dropped. A drive does not hear itself: to the
one that responded last a request may follow at once, unless it is `strict` about its silence. The
guide's states are; FreeMODBUS is not, and masters such as pymodbus and mbpoll rely on it. Drives
listen at their own baud rate. Source: MODBUS over Serial Line V1.02, 2.5.1.1.
"""

from __future__ import annotations

from tautwave_sim.modbus.bus import BROADCAST, DriveBus
from tautwave_sim.modbus.faults import corrupt
from tautwave_sim.modbus.options import SimulatedModbusOptions
from tautwave_sim.modbus.wire.framing import open_rtu, rtu_frame, silent_ns
from tautwave_sim.wire.serial import SerialLine, Transmission


class RtuStation:
    """The stations on the line.

    Parameters
    ----------
    line : SerialLine
        The line; it becomes this station's.
    bus : DriveBus
        The drives.
    options : SimulatedModbusOptions
        Baud rate and character.
    """

    def __init__(self, line: SerialLine, bus: DriveBus, options: SimulatedModbusOptions) -> None:
        self._line = line
        self._bus = bus
        self._baud = options.baud
        silent_s = options.simulator.silent_s
        standard_ns = silent_ns(options.baud, options.bits)
        self.silent_ns = standard_ns if silent_s is None else round(silent_s * 1e9)
        self._strict = options.simulator.strict
        self._parts: list[Transmission] = []
        self._speaker: tuple[Transmission, int] | None = None
        """The last response, and its unit."""
        self._end_ns = -self.silent_ns
        self.dropped = 0
        """Frames that were none."""
        line.listener = self

    def hear(self, sent: Transmission) -> None:
        """Note what the host sends; called when its first byte leaves."""
        self._fail_link(sent.start_ns)
        if sent.start_ns - self._end_ns >= self.silent_ns or self._follows(sent):
            self._parts.clear()
        self._parts.append(sent)
        self._end_ns = max(self._end_ns, sent.end_ns)
        end_ns = self._end_ns
        if len(self._parts) == 1 and sent.baud == self._baud:
            frame = open_rtu(sent.data)
            if frame is not None:
                self._bus.latch(*frame, sent.start_ns)
        self._line.call_at(end_ns + self.silent_ns, lambda: self._over(end_ns))

    def _follows(self, sent: Transmission) -> bool:
        """Return whether this is for the drive that responded last."""
        if self._strict or self._speaker is None or not sent.data:
            return False
        response, unit = self._speaker
        return (
            self._parts == [response] and sent.start_ns >= response.end_ns and sent.data[0] == unit
        )

    def _over(self, end_ns: int) -> None:
        """Take a frame as complete if nothing came in the silence."""
        if end_ns != self._end_ns or not self._parts or not self._line.plugged:
            return
        heard = b"".join(bytes(part.data) for part in self._parts)
        right = all(part.baud == self._baud for part in self._parts)
        self._parts.clear()
        opened = open_rtu(heard) if right else None
        if opened is None:
            self.dropped += 1
            return
        unit, pdu = opened
        now_ns = end_ns + self.silent_ns
        response, outcome = self._bus.handle(unit, pdu, now_ns)
        if outcome.link is not None:
            self._unplug(now_ns, outcome.link.span_ns)
            return
        if response is None or unit == BROADCAST:
            return
        sender = unit % 247 + 1 if outcome.wrong_unit else unit
        frame = corrupt(rtu_frame(sender, response), outcome)
        if not frame:
            return
        at_ns = now_ns + self._bus.response_ns(unit)
        sent = self._line.respond(frame, at_ns, self._baud, outcome.late_ns)
        self._line.call_at(at_ns, lambda: self._speak(sent, unit))

    def _speak(self, response: Transmission, unit: int) -> None:
        """Note that a drive sends: what follows too soon collides with its response."""
        if not response.cancelled:
            self._speaker = (response, unit)
            self._parts.append(response)
            self._end_ns = max(self._end_ns, response.end_ns)

    def _fail_link(self, now_ns: int) -> None:
        for failure in self._bus.plan.link_failures(self._bus.elapsed_ns(now_ns)):
            self._unplug(now_ns, failure.span_ns)

    def _unplug(self, now_ns: int, span_ns: int) -> None:
        self._line.unplug()
        self._parts.clear()
        if span_ns:
            self._line.call_at(now_ns + span_ns, self._plug)

    def _plug(self) -> None:
        self._line.plugged = True
