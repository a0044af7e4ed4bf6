"""One exchange with one drive: requests in a row, and their responses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tautwave.contracts import BytePort
    from tautwave_drivers.modbus.protocol.frames import Request

Opener = Callable[[], "BytePort"]
"""Opens a line or begins to connect; raises `DriverError` where that fails at once."""


class Transaction:
    """Requests to one drive; each is sent once the response to the one before is in.

    Attributes
    ----------
    responses : list of bytes
        One PDU per request so far; an exception response where it was refused.
    pending : bool
        Neither complete nor given up.
    sent_ns : list of int
        When each request was sent.
    """

    __slots__ = ("pending", "received_ns", "requests", "responses", "sent_ns", "unit")

    def __init__(self, unit: int) -> None:
        self.unit = unit
        self.requests: Sequence[Request] = ()
        self.responses: list[bytes] = []
        self.sent_ns: list[int] = []
        self.received_ns = 0
        self.pending = False

    def begin(self, requests: Sequence[Request]) -> None:
        """Start over with these."""
        self.requests = requests
        self.responses = []
        self.sent_ns = []
        self.pending = bool(requests)

    @property
    def request(self) -> Request:
        """The request to send next, or whose response is pending."""
        return self.requests[len(self.responses)]

    @property
    def complete(self) -> bool:
        """Whether every request has its response."""
        return len(self.responses) == len(self.requests)

    def take(self, pdu: bytes, now_ns: int) -> None:
        """Take the response to the current request."""
        self.responses.append(pdu)
        self.received_ns = now_ns
        if len(self.responses) == len(self.requests):
            self.pending = False

    def give_up(self) -> None:
        """End it without a response."""
        self.pending = False
