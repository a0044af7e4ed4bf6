"""The same transactions by dynamixel-sdk, over our port and our clock.

The SDK's `PacketHandler` gets bytes and the time from a port object. With ours it works in
memory too, waits in the kernel instead of spinning, and cannot be fooled by a wall clock that
jumps. It does not stuff what it sends, so it serves for registers before the loop, not in it.
"""

from __future__ import annotations

import importlib
from typing import Any

from tautwave.contracts import BytePort, Clock
from tautwave.errors import ConfigError
from tautwave_drivers.dynamixel.line.transactions import RESPONSE_S, TRIES, Response


class SdkPort:
    """Stands in for the SDK's `PortHandler`."""

    def __init__(self, port: BytePort, clock: Clock, baud: int, latency_s: float) -> None:
        self._port = port
        self._clock = clock
        self._byte_ns = round(1e10 / baud)
        self._timeout_ns = round(1e9 * (latency_s + RESPONSE_S))
        self._buffer = bytearray()
        self._until_ns = 0
        self.is_using = False

    # The SDK calls these by its own names.

    def clearPort(self) -> None:  # noqa: N802
        """Discard what was received."""
        self._port.read()
        self._buffer.clear()

    def writePort(self, packet: Any) -> int:  # noqa: N802
        """Send a packet, a list of numbers."""
        self._port.write(bytes(packet))
        return len(packet)

    def readPort(self, length: int) -> bytes:  # noqa: N802
        """Return at most `length` bytes; waits for the first of them."""
        if not self._buffer:
            self._clock.wait(self._port, self._until_ns)
        self._buffer += self._port.read()
        data = bytes(self._buffer[:length])
        del self._buffer[:length]
        return data

    def setPacketTimeout(self, length: int) -> None:  # noqa: N802
        """Begin to wait for a response of `length` bytes."""
        # Twice: the request's own bytes are still on the wire.
        wire_ns = 2 * (length + 14) * self._byte_ns
        self._until_ns = self._clock.now_ns() + wire_ns + self._timeout_ns

    def setPacketTimeoutMillis(self, milliseconds: float) -> None:  # noqa: N802
        """Begin to wait for a response."""
        self._until_ns = self._clock.now_ns() + round(milliseconds * 1e6)

    def isPacketTimeout(self) -> bool:  # noqa: N802
        """Return whether the response is overdue."""
        return self._clock.now_ns() >= self._until_ns


class SdkLine:
    """Transactions by dynamixel-sdk.

    Raises
    ------
    ConfigError
        It is not installed.
    """

    def __init__(self, port: BytePort, clock: Clock, baud: int, latency_s: float = 0.0) -> None:
        try:
            sdk: Any = importlib.import_module("dynamixel_sdk")  # it has no types
        except ImportError as err:
            raise ConfigError(
                "transport: sdk needs dynamixel-sdk; pip install 'tautwave[dynamixel]', or omit "
                "transport"
            ) from err
        self._success = sdk.COMM_SUCCESS
        self._handler = sdk.PacketHandler(2.0)
        self._port = SdkPort(port, clock, baud, latency_s)

    def ping(self, device_id: int) -> Response | None:
        """Return model number and firmware."""
        response = self.read(device_id, 0, 7)
        return (
            None
            if response is None
            else Response(response.error, response.data[:2] + response.data[6:7])
        )

    def read(self, device_id: int, address: int, size: int) -> Response | None:
        """Return `size` bytes at `address`."""
        for _ in range(TRIES):
            data, result, error = self._handler.readTxRx(self._port, device_id, address, size)
            self._port.is_using = False
            if result == self._success and len(data) >= size:
                return Response(error, bytes(data[:size]))
        return None

    def write(self, device_id: int, address: int, data: bytes) -> Response | None:
        """Write `data` at `address`."""
        for _ in range(TRIES):
            result, error = self._handler.writeTxRx(
                self._port, device_id, address, len(data), list(data)
            )
            self._port.is_using = False
            if result == self._success:
                return Response(error, b"")
        return None

    def reboot(self, device_id: int) -> Response | None:
        """Start the servo again."""
        result, error = self._handler.reboot(self._port, device_id)
        self._port.is_using = False
        return Response(error, b"") if result == self._success else None
