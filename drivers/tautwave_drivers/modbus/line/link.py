"""What a serial line and a TCP connection have in common: drives in a queue, and being lost."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Iterable, Sequence
from typing import ClassVar

from tautwave.contracts import BytePort, Clock
from tautwave.errors import DriverError
from tautwave_drivers.causes import Cause, wrong_text
from tautwave_drivers.modbus.protocol.transaction import Opener, Transaction

SLACK_NS = 2_000_000
"""What host and network may add before a drive counts as silent and the next one is asked."""


class Link(ABC):
    """One line or connection and the drives behind it.

    Parameters
    ----------
    opener : callable
        Opens the line, or begins to connect.
    clock : Clock
        Time.

    Attributes
    ----------
    lost : str
        Why it cannot be used, else ''.
    late, unexpected : int
        Responses to requests given up before, and bytes or frames that respond to nothing.
    wrong : dict
        By unit, what came instead of its responses since the last right one, by cause.
    """

    retry_ns: ClassVar[int]
    """[ns] Between two attempts to get it back."""

    def __init__(self, opener: Opener, clock: Clock) -> None:
        self._open = opener
        self._clock = clock
        self._port: BytePort | None = None
        self._queue: deque[Transaction] = deque()
        self._buffer = bytearray()
        self._silent: set[int] = set()
        self._retry_at_ns = 0
        self.lost = "not open yet"
        self.late = 0
        self.unexpected = 0
        self.wrong: dict[int, Counter[Cause]] = {}

    def note_wrong(self, units: Iterable[int], cause: Cause) -> None:
        """Count something that is not a response while one of these units has to respond."""
        for unit in units:
            self.wrong.setdefault(unit, Counter())[cause] += 1

    def misses(self, unit: int) -> str:
        """Return what came instead of a unit's responses, as text; '' if nothing did."""
        return wrong_text(self.wrong.get(unit, {}))

    @property
    def port(self) -> BytePort | None:
        """What to wait on, once it is open."""
        return None if self.lost else self._port

    @property
    @abstractmethod
    def busy(self) -> bool:
        """Whether a response is waited for, or a transaction waits for its turn."""

    @property
    @abstractmethod
    def wake_ns(self) -> int | None:
        """When `pump` has something to do although nothing comes [ns]; None if never."""

    @abstractmethod
    def connect(self) -> bool:
        """Open it, or go on connecting, without waiting; return whether it is open.

        Raises
        ------
        DriverError
            It cannot be opened.
        """

    def retry(self) -> bool:
        """Try to open it again, every `retry_ns` at most; return whether it is open."""
        if not self.lost or self._clock.now_ns() < self._retry_at_ns:
            return not self.lost
        try:
            return self.connect()
        except DriverError as err:
            self.drop(str(err))
            return False

    def start(self, transactions: Sequence[Transaction]) -> None:
        """Send what may be sent now, queue the rest; `lost` says whether that failed."""
        if self.lost:
            for transaction in transactions:
                transaction.give_up()
            return
        if self._silent:  # drives that were silent last time come last and delay no other
            transactions = sorted(transactions, key=lambda one: one.unit in self._silent)
        self._begin(transactions)

    @abstractmethod
    def _begin(self, transactions: Sequence[Transaction]) -> None: ...

    @abstractmethod
    def pump(self) -> None:
        """Take in what has come, and send what follows from it; never waits."""

    @abstractmethod
    def watch(self) -> None:
        """Drop a connection that nothing answers on."""

    @abstractmethod
    def _abandon_pending(self) -> None: ...

    def abandon(self) -> None:
        """Stop waiting; a response that still arrives is ignored."""
        self._abandon_pending()
        for transaction in self._queue:
            transaction.give_up()
        self._queue.clear()

    def drop(self, why: str) -> None:
        """Close it; `lost` is `why`."""
        self.abandon()
        self.lost = why
        self._retry_at_ns = self._clock.now_ns() + self.retry_ns
        self.close()

    def close(self) -> None:
        """Release it; idempotent."""
        port, self._port = self._port, None
        self.lost = self.lost or "closed"
        if port is not None:
            port.close()
