"""Configuration through the canopen library, without a thread: it is fed by polling.

canopen's SDO client waits on a queue that somebody else has to fill; the queue here waits through
the rig's clock and takes frames from the port itself, so it also works on a FakeClock.
"""

from __future__ import annotations

import logging
import queue
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import canopen
from canopen.objectdictionary import ODRecord, ODVariable, datatypes
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from tautwave.contracts import Clock
from tautwave.errors import BusTimeout, DeviceFault, DriverError
from tautwave_drivers.canopen.frames import Port
from tautwave_drivers.cia402 import communication, objects
from tautwave_drivers.cia402.aborts import abort_words
from tautwave_drivers.cia402.entry import Entry, pack, unpack

_RETRIES = 3
_SENDING_NS = 1_000_000
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

# Without a handler Python prints a library's warnings on stderr; ours are in sentences.
logging.getLogger("canopen").addHandler(logging.NullHandler())


class AbortError(DeviceFault):
    """A drive refused an object; `code` is the SDO abort code."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class Responses:
    """Stands where canopen's SDO client has its queue."""

    def __init__(self, net: PolledNetwork) -> None:
        self._net = net
        self._items: deque[bytes] = deque()

    def put(self, item: bytes) -> None:
        """Take a response."""
        self._items.append(item)

    def empty(self) -> bool:
        """Forget late responses before a new request; always True then."""
        self._items.clear()
        return True

    def get(self, block: bool = True, timeout: float = 0.0) -> bytes:
        """Wait for a response on the rig's clock."""
        deadline = self._net.clock.now_ns() + round(timeout * 1e9)
        while not self._items:
            if not self._net.pump(deadline):
                raise queue.Empty
        return self._items.popleft()


class PolledNetwork(canopen.Network):
    """canopen's network over a frame port; `hear` gets every frame that is no SDO response."""

    def __init__(self, port: Port, clock: Clock, hear: Hear, timeout_s: float) -> None:
        super().__init__()
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
            "the CAN transmit queue stays full: nothing takes our frames; look at cable, "
            "termination, power and bit rate"
        )

    def pump(self, deadline_ns: int) -> bool:
        """Wait for a frame and pass it on; False when the deadline passed without one."""
        if not self.clock.wait(self.port, deadline_ns):
            return False
        while (frame := self.port.receive()) is not None:
            can_id, data, arrival_ns = frame
            if can_id & ~0x7F == 0x580 and can_id in self.subscribers:
                if len(data) == 8:  # shorter ones are noise, and the library would raise
                    self.notify(can_id, bytearray(data), arrival_ns * 1e-9)
            else:
                self._hear(can_id, data, arrival_ns)
        return True

    def listen(self, until_ns: int, enough: Callable[[], bool] = lambda: False) -> bool:
        """Hear frames until `enough()` or the time; return which: True for enough."""
        while not enough():
            if not self.pump(until_ns):
                return enough()
        return True

    def remote(self, node_id: int, name: str, eds: str | None = None) -> RemoteDrive:
        """Return the drive `node_id`, called `name` in sentences."""
        drive = self.drives[node_id] = RemoteDrive(self, node_id, name, eds, self._timeout_s)
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
    """One drive's objects over SDO, with sentences for what it refuses.

    Raises
    ------
    DriverError
        Its EDS cannot be read.
    """

    def __init__(
        self, net: PolledNetwork, node_id: int, name: str, eds: str | None, timeout_s: float
    ) -> None:
        self.node_id = node_id
        self.name = name
        try:
            dictionary = built_in_dictionary() if eds is None else canopen.import_od(eds, node_id)
        except Exception as err:
            raise DriverError(
                f"{name}: cannot read {eds} ({err}); give an EDS or DCF file"
            ) from err
        self.dictionary = dictionary
        self._net = net
        self._node = net.add_node(canopen.RemoteNode(node_id, dictionary))
        client = self._node.sdo
        client.RESPONSE_TIMEOUT = timeout_s
        client.responses = Responses(net)

    def nmt(self, command: int) -> None:
        """Send an NMT command to this node (CiA 301, 7.2.8.3.1)."""
        self._net.send_message(0, bytes((command, self.node_id)))

    def read(self, entry: Entry) -> int | str:
        """Return an object's value.

        Raises
        ------
        AbortError
            The drive refuses; the code is in words.
        BusTimeout
            It does not answer.
        """
        with self._sentences("read", entry):
            data = self._again(lambda: self._node.sdo.upload(entry.index, entry.sub))
        value = unpack(entry, data)
        if value is None:
            raise DeviceFault(
                f"{self.name}: {entry.address} {entry.name} came with {len(data)} bytes, too few "
                f"for {entry.type}; compare with the drive's EDS"
            )
        return value

    def number(self, entry: Entry) -> int:
        """Return an object's value, which is a number."""
        value = self.read(entry)
        return value if isinstance(value, int) else 0

    def find(self, entry: Entry) -> int | None:
        """Return an object's value, None where the drive does not have it."""
        try:
            return self.number(entry)
        except AbortError:
            return None

    def write(self, entry: Entry, value: int) -> None:
        """Write an object; raises as `read` does."""
        data = pack(entry, value)
        with self._sentences(f"take {value} (0x{data[::-1].hex()}) in", entry):
            self._again(lambda: self._node.sdo.download(entry.index, entry.sub, data))

    def write_bytes(self, index: int, sub: int, data: bytes) -> None:
        """Write an object of the drive's own dictionary and read it back; raises as `read` does."""
        entry = Entry("(DCF)", index, sub, "STR", "", "", "its DCF")
        with self._sentences(f"take 0x{data[::-1].hex()} in", entry):
            self._again(lambda: self._node.sdo.download(index, sub, data))
            found = self._again(lambda: self._node.sdo.upload(index, sub))
        if found[: len(data)] != data:
            raise DeviceFault(
                f"{self.name} holds 0x{found[::-1].hex()} in {entry.address} after "
                f"0x{data[::-1].hex()} of its DCF was written"
            )

    def _again(self, transfer: Callable[[], Any]) -> Any:
        """Repeat a transfer that got no answer, or somebody else's: frames are lost."""
        for left in range(_RETRIES - 1, -1, -1):
            try:
                return transfer()
            except SdoCommunicationError:
                if not left:
                    raise
        return None

    @contextmanager
    def _sentences(self, what: str, entry: Entry) -> Iterator[None]:
        try:
            yield
        except SdoAbortedError as err:
            raise AbortError(
                f"{self.name} does not {what} {entry.address} {entry.name}: "
                f"{abort_words(err.code)}",
                err.code,
            ) from err
        except SdoCommunicationError as err:
            raise BusTimeout(
                f"{self.name} does not answer ({what} {entry.address} {entry.name}, "
                f"{_RETRIES} times: {err}); check its power, node id, bit rate and termination"
            ) from err
