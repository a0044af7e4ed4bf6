"""The SDO server of one device: expedited and segmented transfers (CiA 301 v4.2.0, 7.2.4)."""

from __future__ import annotations

import struct

from tautwave_sim.canopen.dictionary import (
    COMMAND,
    TOGGLE,
    TOO_LONG,
    TOO_SHORT,
    ObjectDictionary,
    SdoAbort,
)

_HEAD = struct.Struct("<BHB")
MAX_DOWNLOAD = 4096
"""Bytes; no object here is longer."""


class SdoServer:
    """Responds to one request at a time; block transfer is refused.

    Parameters
    ----------
    objects : ObjectDictionary
        What it serves.
    """

    def __init__(self, objects: ObjectDictionary) -> None:
        self._objects = objects
        self.reset()

    def reset(self) -> None:
        """Forget a transfer that is under way."""
        self._at = (0, 0)
        self._sending: bytes | None = None
        self._receiving: bytearray | None = None
        self._announced = 0
        self._toggle = 0

    def respond(self, request: bytes) -> bytes | None:
        """Return the response to a request; None where there is none to give."""
        if len(request) != 8:
            return None  # an SDO always has 8 bytes
        specifier = request[0] >> 5
        try:
            if specifier == 0:
                return self._download_segment(request)
            if specifier == 1:
                return self._begin_download(request)
            if specifier == 2:
                return self._begin_upload(request)
            if specifier == 3:
                return self._upload_segment(request)
            if specifier == 4:
                self.reset()
                return None
            return self._refuse(request)
        except SdoAbort as refusal:
            index, sub = self._at
            self.reset()
            return _HEAD.pack(0x80, index, sub) + refusal.code.to_bytes(4, "little")

    def _refuse(self, request: bytes) -> bytes:
        _, index, sub = _HEAD.unpack_from(request)
        self._at = (index, sub)
        raise SdoAbort(COMMAND)  # block transfer, or nothing that there is

    def _begin_upload(self, request: bytes) -> bytes:
        _, index, sub = _HEAD.unpack_from(request)
        self.reset()
        self._at = (index, sub)
        data = self._objects.upload(index, sub)
        if 0 < len(data) <= 4:
            command = 0x43 | (4 - len(data)) << 2
            return _HEAD.pack(command, index, sub) + data.ljust(4, b"\0")
        self._sending = data
        return _HEAD.pack(0x41, index, sub) + len(data).to_bytes(4, "little")

    def _upload_segment(self, request: bytes) -> bytes:
        if self._sending is None:
            raise SdoAbort(COMMAND)
        self._check_toggle(request[0])
        part, self._sending = self._sending[:7], self._sending[7:]
        command = self._toggle << 4 | 7 - len(part) << 1
        self._toggle ^= 1
        if not self._sending:
            command |= 1
            self._sending = None
        return bytes([command]) + part.ljust(7, b"\0")

    def _begin_download(self, request: bytes) -> bytes:
        command, index, sub = _HEAD.unpack_from(request)
        self.reset()
        self._at = (index, sub)
        entry = self._objects.entry(index, sub)
        if command & 2:
            size = 4 - (command >> 2 & 3) if command & 1 else entry.size or 4
            self._objects.download(index, sub, request[4 : 4 + size])
        else:
            self._announced = int.from_bytes(request[4:], "little") if command & 1 else 0
            if self._announced > MAX_DOWNLOAD:
                raise SdoAbort(TOO_LONG)
            self._receiving = bytearray()
        return _HEAD.pack(0x60, index, sub) + bytes(4)

    def _download_segment(self, request: bytes) -> bytes:
        if self._receiving is None:
            raise SdoAbort(COMMAND)
        self._check_toggle(request[0])
        self._receiving += request[1 : 8 - (request[0] >> 1 & 7)]
        if len(self._receiving) > (self._announced or MAX_DOWNLOAD):
            raise SdoAbort(TOO_LONG)
        if request[0] & 1:
            if self._announced and len(self._receiving) < self._announced:
                raise SdoAbort(TOO_SHORT)
            self._objects.download(*self._at, bytes(self._receiving))
            self._receiving = None
        response = bytes([0x20 | self._toggle << 4]) + bytes(7)
        self._toggle ^= 1
        return response

    def _check_toggle(self, command: int) -> None:
        if command >> 4 & 1 != self._toggle:
            raise SdoAbort(TOGGLE)
