"""The one long status packet of a fast sync read, taken apart servo by servo as it comes.

Every servo appends error, its id, its data and a CRC-16 over all bytes since the header (e-manual,
"Fast Sync Read"; dynamixel-sdk checks the last CRC only). The length is that of all servos
and is sent by the first of them, so nothing is stuffed. A servo's data counts as soon as its own
CRC is right, and all do when the last one is: servos that compute the ones between otherwise are
then accepted too.
"""

from __future__ import annotations

from tautwave_drivers.dynamixel.protocol.packet import BROADCAST, HEADER, STATUS, crc16

Sample = tuple[int, int, bytes, int]
"""Id, error byte, data, and its place in the request."""


class FastStatus:
    """Takes the response to a fast sync read apart.

    Parameters
    ----------
    count : int
        Servos read.
    size : int
        Bytes read of each.
    """

    def __init__(self, count: int, size: int) -> None:
        self._block = size + 4
        length = count * self._block + 1
        self._head = HEADER + bytes((BROADCAST, length & 0xFF, length >> 8, STATUS))
        self._start_crc = crc16(self._head)
        self._end = 8 + count * self._block
        self.restart()

    def restart(self) -> None:
        """Discard what was received: a new response is expected."""
        self._at = 0
        self._crc = 0
        self._doubtful: list[Sample] = []

    def take(self, buffer: bytearray) -> list[Sample]:
        """Return the servos whose valid data has come since the last call.

        `buffer` holds the response from its first byte on; noise before it is removed.
        """
        if self._at == 0 and not self._begin(buffer):
            return []
        samples: list[Sample] = []
        block = self._block
        while len(buffer) >= self._at + block <= self._end:
            at = self._at
            body = bytes(buffer[at : at + block - 2])
            crc = crc16(body, self._crc)
            sample = (body[1], body[0], body[2:], (at - len(self._head)) // block)
            received_crc = buffer[at + block - 2] | buffer[at + block - 1] << 8
            self._at = at + block
            self._crc = crc16(buffer[at + block - 2 : at + block], crc)
            if received_crc == crc:
                samples.append(sample)
                if self._at == self._end:
                    samples.extend(self._doubtful)
                    self._doubtful = []
            else:
                self._doubtful.append(sample)
        return samples

    def _begin(self, buffer: bytearray) -> bool:
        start = buffer.find(self._head)
        if start < 0:
            del buffer[: max(0, len(buffer) - len(self._head) + 1)]
            return False
        del buffer[:start]
        self._at = len(self._head)
        self._crc = self._start_crc
        return True
