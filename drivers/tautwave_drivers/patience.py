"""How long a response is waited for on a host that comes late itself, as it was measured to.

The answer may come from a program on the same host, a simulated device or a gateway, which is
scheduled twice where this one is scheduled once. A device that is not there is still not waited for
indefinitely.
"""

from __future__ import annotations

from tautwave.contracts import BytePort, Clock

LATER = 4
"""A host waits this many times its own lateness for a response, beyond the time-out."""
SLOWEST_NS = 500_000_000
"""Whatever the host's lateness."""
SPARE = 5
"""More tries, of those in which this host came late: they do not count against the device."""


class Patience:
    """What the waits of one line have shown of this host."""

    def __init__(self) -> None:
        self._late_ns = 0

    @property
    def more_ns(self) -> int:
        """How much longer than its time-out a response is waited for [ns]."""
        return min(LATER * self._late_ns, SLOWEST_NS)

    def note(self, late_ns: int, timeout_ns: int) -> bool:
        """Take by how much this host was late when a wait ended; return whether that is much."""
        self._late_ns = max(self._late_ns, late_ns)
        return 2 * late_ns > timeout_ns


def let_pass(port: BytePort, clock: Clock, span_ns: int) -> None:
    """Drop the answers that still come to a request that was sent more than once.

    The one that came may be the first request's. That of the last one would look like an answer to
    a read of another register.

    Parameters
    ----------
    port : BytePort
        The line; raises what it does.
    clock : Clock
        What waits.
    span_ns : int
        [ns] From the first request to the last, and what a response may vary by.
    """
    until_ns = clock.now_ns() + span_ns
    while clock.wait(port, until_ns):
        port.read()
