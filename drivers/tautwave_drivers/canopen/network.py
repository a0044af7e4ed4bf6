"""Configuration through the canopen library, without a thread: it is fed by polling.

canopen's SDO client waits on a queue that a thread fills; the queue here waits on the rig's clock
and reads the port itself, so it also works on a FakeClock.
"""

from __future__ import annotations

import logging
import queue
import struct
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import canopen
from canopen.objectdictionary import ODRecord, ODVariable, datatypes
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from tautwave.contracts import Clock, FramePort
from tautwave.device_settings import DeviceSettings, SettingRefusedError
from tautwave.errors import BusTimeout, DeviceFault, DriverError
from tautwave_drivers.canopen.files.reading import Setting
from tautwave_drivers.cia402 import communication, objects
from tautwave_drivers.cia402.aborts import NO_OBJECT, NOT_NOW, abort_text
from tautwave_drivers.cia402.entry import Entry, pack, unpack
from tautwave_drivers.patience import SPARE, Patience

_RETRIES = 3
_SLOWEST = 4
"""Response time-outs that a slow server may take: after each silence it is given twice as long."""
_BATCH = 256
"""Frames between looks at the clock: a flood never leaves the queue empty."""
_LONGEST = 20
"""Response timeouts that all segments of an object may take together."""
_SENDING_NS = 1_000_000
_NAMING = (2, 3, 4)
"""Command specifiers of responses that name their object: read, written, abort (CiA 301)."""
_UNNAMED = bytes(3)
_TYPES = {
    "BOOL": datatypes.BOOLEAN,
    "I8": datatypes.INTEGER8,
    "U8": datatypes.UNSIGNED8,
    "I16": datatypes.INTEGER16,
    "U16": datatypes.UNSIGNED16,
    "I32": datatypes.INTEGER32,
    "U32": datatypes.UNSIGNED32,
    "I64": datatypes.INTEGER64,
    "U64": datatypes.UNSIGNED64,
    "STR": datatypes.VISIBLE_STRING,
}
Hear = Callable[[int, bytes, int], object]

# Without a handler Python prints the library's warnings on stderr.
logging.getLogger("canopen").addHandler(logging.NullHandler())


class AbortError(SettingRefusedError):
    """A drive refused an object; `code` is the SDO abort code."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class EndlessError(BusTimeout):
    """A drive sends the segments of an object without end."""


class Responses:
    """Replaces the queue of canopen's SDO client.

    `until_ns` is when the transfer under way has to be complete, and `late` whether it was not: the
    library takes segments for as long as they come. `host_late`: this host was late itself when
    its last wait ended. `asked` are the bytes that name its object:
    what comes late for another one is dropped. The library would take its abort for this one's, and
    an object that changes a sign would pass as absent. `twice` counts responses beyond
    the one expected, as two nodes with one id give; none after a `repeated` request, which has two.
    """

    def __init__(self, net: PolledNetwork) -> None:
        self._net = net
        self._items: deque[bytes] = deque()
        self.until_ns = 0
        self.late = False
        self.asked = _UNNAMED
        self.twice = 0
        self.repeated = False
        self.host_late = False
        self._patience = Patience()
        self._due = 0

    def put(self, item: bytes) -> None:
        """Take a response, unless it names another object; some aborts name none."""
        self._due -= 1
        if self._due < 0 and not self.repeated and item[0] >> 5 in _NAMING:
            self.twice += 1
        if item[0] >> 5 not in _NAMING or item[1:4] in (self.asked, _UNNAMED):
            self._items.append(item)

    def empty(self) -> bool:
        """Forget late responses before a new request; always True then."""
        self._items.clear()
        self._due = 1
        return True

    def get(self, block: bool = True, timeout: float = 0.0) -> bytes:
        """Wait for a response on the rig's clock."""
        now = self._net.clock.now_ns()
        if now >= self.until_ns:
            self.late = True
            raise queue.Empty
        timeout_ns = round(timeout * 1e9)
        deadline = now + timeout_ns + self._patience.more_ns
        while not self._items:
            if not self._net.pump(deadline) and not self._items:
                self.host_late = self._patience.note(
                    self._net.clock.now_ns() - deadline, timeout_ns
                )
                raise queue.Empty
        return self._items.popleft()


class PolledNetwork(canopen.Network):
    """canopen's network over a frame port; `hear` gets every frame but SDO responses."""

    def __init__(
        self, port: FramePort, clock: Clock, hear: Hear, timeout_s: float, queue: str = ""
    ) -> None:
        super().__init__()
        self._queue_remedy = queue or "check cable, termination, power and bit rate"
        self.port = port
        self.clock = clock
        self._hear = hear
        self._timeout_s = timeout_s
        self.drives: dict[int, RemoteDrive] = {}

    def send_message(self, can_id: int, data: Any, remote: bool = False) -> None:
        """Send a frame; waits a moment where the queue is full."""
        for _ in range(20):
            if self.port.send(can_id, bytes(data)):
                return
            self.clock.sleep_until(self.clock.now_ns() + _SENDING_NS)
        raise DriverError(
            f"the CAN transmit queue stays full: no frame is acknowledged; {self._queue_remedy}"
        )

    def pump(self, deadline_ns: int) -> bool:
        """Wait for frames and pass them on; False when the deadline has passed, as it then may."""
        if not self.clock.wait(self.port, deadline_ns):
            return False
        for _ in range(_BATCH):
            frame = self.port.receive()
            if frame is None:
                break
            can_id, data, arrival_ns = frame
            if can_id & ~0x7F == 0x580 and can_id in self.subscribers:
                if len(data) == 8:  # the library raises on shorter ones
                    self.notify(can_id, bytearray(data), arrival_ns * 1e-9)
            else:
                self._hear(can_id, data, arrival_ns)
        return self.clock.now_ns() < deadline_ns

    def listen(self, until_ns: int, enough: Callable[[], bool] = lambda: False) -> bool:
        """Receive frames until `enough()` or the time; return whether it was enough."""
        while not enough():
            if not self.pump(until_ns):
                return enough()
        return True

    def remote(self, node_id: int, name: str, loans: dict[Entry, int] | None = None) -> RemoteDrive:
        """Return the drive `node_id`, called `name` in messages, and owed `loans`."""
        drive = self.drives[node_id] = RemoteDrive(self, node_id, name, self._timeout_s, loans)
        return drive


def built_in_dictionary() -> canopen.ObjectDictionary:
    """Return the objects of CiA 301 and CiA 402 that a set-up needs, for drives without an EDS."""
    dictionary = canopen.ObjectDictionary()  # type: ignore[no-untyped-call]
    entries = (*communication.COMMUNICATION, *objects.DRIVE)
    grouped = {entry.index for entry in entries if entry.sub}
    for entry in entries:
        variable = ODVariable(entry.name, entry.index, entry.sub)
        variable.data_type = _TYPES[entry.type]
        if entry.index not in grouped:
            dictionary.add_object(variable)
            continue
        if entry.index not in dictionary:
            dictionary.add_object(ODRecord(f"{entry.index:04X}", entry.index))
        record = dictionary[entry.index]
        if isinstance(record, ODRecord):
            record.add_member(variable)
    return dictionary


class RemoteDrive:
    """One drive's objects over SDO, with a message for what it refuses."""

    def __init__(
        self,
        net: PolledNetwork,
        node_id: int,
        name: str,
        timeout_s: float,
        loans: dict[Entry, int] | None = None,
    ) -> None:
        self.node_id = node_id
        self.name = name
        self.silences = 0
        """Requests that got no response and were repeated."""
        self._absent: int | None = None
        self.settings = DeviceSettings(name, self.number, self.write, loans=loans)
        self._net = net
        self._node = net.add_node(canopen.RemoteNode(node_id, built_in_dictionary()))
        client = self._node.sdo
        client.RESPONSE_TIMEOUT = self._timeout_s = timeout_s
        client.responses = self._responses = Responses(net)
        self._longest_ns = round(_LONGEST * timeout_s * 1e9)

    @property
    def answered_twice(self) -> int:
        """Requests that got two responses."""
        return self._responses.twice

    @property
    def slow_s(self) -> float | None:
        """How long it may take to respond [s], where it took more than `sdo_timeout_s`."""
        timeout_s: float = self._node.sdo.RESPONSE_TIMEOUT
        return timeout_s if timeout_s > self._timeout_s else None

    def lacks(self, entry: Entry) -> bool:
        """Return whether the drive says that it does not have an object."""
        try:
            self.read(entry)
        except AbortError as err:
            return err.code in NO_OBJECT
        return False

    @property
    def clock(self) -> Clock:
        """The clock of the bus."""
        return self._net.clock

    def nmt(self, command: int) -> None:
        """Send an NMT command to this node (CiA 301, 7.2.8.3.1)."""
        self._net.send_message(0, bytes((command, self.node_id)))

    def read(self, entry: Entry) -> int | str:
        """Return an object's value.

        Raises
        ------
        AbortError
            The drive refuses; the message explains the code.
        EndlessError
            Its response has no end.
        BusTimeout
            It does not respond.
        """
        with self._sentences("read", entry):
            data = self._upload(entry)
        value = unpack(entry, data)
        if value is None:
            raise DeviceFault(
                f"{self.name}: {entry.address} {entry.name} has only {len(data)} bytes, too few "
                f"for {entry.type}; compare with the drive's EDS"
            )
        return value

    def number(self, entry: Entry) -> int:
        """Return the value of a numeric object."""
        value = self.read(entry)
        return value if isinstance(value, int) else 0

    def find(self, entry: Entry, *, surely: bool = False) -> int | None:
        """Return an object's value, None where the drive does not have it.

        `surely`: where it aborts in other words than that it has no such object, it may have it. It
        is absent all the same if it says the same of one that no drive has.

        Raises
        ------
        AbortError
            The drive does not tell at present whether it has it, or its value.
        """
        try:
            return self.number(entry)
        except AbortError as err:
            if err.code in NOT_NOW:
                raise
            if surely and err.code not in NO_OBJECT and err.code != self._absence():
                raise AbortError(
                    f"{err}; what it holds there changes what is sent or read, and cannot be "
                    "compared; use firmware that lets it be read, or lacks it",
                    err.code,
                ) from err
            return None

    def _absence(self) -> int | None:
        """Return the code with which the drive aborts a read of what no drive has."""
        if self._absent is None:
            try:
                self.number(communication.RESERVED)
            except AbortError as err:
                self._absent = err.code
        return self._absent

    def find_text(self, entry: Entry) -> str | None:
        """Return a text object's value, None where the drive does not have it or has no end."""
        try:
            return str(self.read(entry))
        except (AbortError, EndlessError):
            return None

    def write(self, entry: Entry, value: int) -> None:
        """Write an object; raises as `read` does."""
        data = pack(entry, value)
        with self._sentences(f"take {value} (0x{data[::-1].hex()}) in", entry):
            self._again(entry, lambda: self._node.sdo.download(entry.index, entry.sub, data))

    def write_setting(self, setting: Setting) -> bool:
        """Write a parameter value of a DCF and read it back; raises as `read` does.

        Returns False where the drive holds it already: what it keeps in flash wears out.
        """
        one, data = setting.object, setting.data
        entry = Entry(one.name, one.index, one.sub, "STR", "", "", "its DCF")
        written = f"0x{data[::-1].hex()} of line {setting.line} of its DCF"
        with self._sentences(f"take {written} in", entry):
            readable = one.access != "wo"
            if readable and setting.equals(self._upload(entry)):
                return False
            self._again(entry, lambda: self._node.sdo.download(entry.index, entry.sub, data))
            held = self._upload(entry) if readable else data
        if not setting.equals(held):
            raise DeviceFault(
                f"{self.name} reads 0x{held[::-1].hex()} at {entry.address} {entry.name} after "
                f"{written} was written"
            )
        self.settings.changed.append(entry)
        return True

    def _upload(self, entry: Entry) -> bytes:
        return bytes(self._again(entry, lambda: self._node.sdo.upload(entry.index, entry.sub)))

    def _again(self, entry: Entry, transfer: Callable[[], Any]) -> Any:
        """Repeat a transfer without a response, or with one to another request: frames get lost."""
        self._responses.until_ns = self._net.clock.now_ns() + self._longest_ns
        self._responses.late = False
        self._responses.asked = struct.pack("<HB", entry.index, entry.sub)
        tries, spare = _RETRIES, SPARE
        while tries:
            self._responses.host_late = False
            try:
                return transfer()
            except SdoCommunicationError:
                if self._responses.host_late and spare:
                    spare -= 1
                    self._responses.until_ns = self._net.clock.now_ns() + self._longest_ns
                else:
                    tries -= 1
                if not tries or self._responses.late:
                    self._node.sdo.RESPONSE_TIMEOUT = self._timeout_s
                    raise
                self._responses.repeated = True
                self.silences += 1
                client = self._node.sdo
                most = _SLOWEST * self._timeout_s
                client.RESPONSE_TIMEOUT = min(2.0 * client.RESPONSE_TIMEOUT, most)
        return None

    @contextmanager
    def _sentences(self, what: str, entry: Entry) -> Iterator[None]:
        try:
            yield
        except SdoAbortedError as err:
            raise AbortError(
                f"{self.name} does not {what} {entry.address} {entry.name}: {abort_text(err.code)}",
                err.code,
            ) from err
        except SdoCommunicationError as err:
            if self._responses.late:
                raise EndlessError(
                    f"{self.name} still sends {entry.address} {entry.name} after "
                    f"{self._longest_ns * 1e-9:g} s; the response never ends"
                ) from err
            raise BusTimeout(
                f"{self.name} does not respond ({what} {entry.address} {entry.name}, "
                f"{_RETRIES} times: {err}); check its power, node id (some wait for one by LSS), "
                f"bit rate and termination, or raise sdo_timeout_s (now {self._timeout_s:g}) for a "
                "drive that responds slowly"
            ) from err
