"""A stranger who sends hostile datagrams to both ends of `tautwave bench link`, in its turns.

`python -m tautwave.bench.sites.stranger SESSION DURATION PORT PORT` prints how many it sent. It
knows the session's id, as everybody on the way does, and not its keys.
"""

from __future__ import annotations

import random
import secrets
import socket
import sys

from tautwave.bench.sites.order import HOST, HOSTILE, turn_of
from tautwave.clock import MonotonicClock
from tautwave.sites.seal import OVERHEAD, SECRET_BYTES, SESSION_BYTES, Sealer

EACH = 5
"""Datagrams to each end in a millisecond."""
POOL = 2000


def hostile_datagrams(session: bytes) -> list[bytes]:
    """Return datagrams that nobody may accept: of other keys, of other sessions, changed, cut."""
    source = random.Random(1)
    forger = Sealer(secrets.token_bytes(SECRET_BYTES), session, "master")
    old = Sealer(secrets.token_bytes(SECRET_BYTES), secrets.token_bytes(SESSION_BYTES), "master")
    datagrams = []
    for k in range(POOL):
        datagram = (old if k % 4 == 0 else forger).seal(source.randbytes(145 - OVERHEAD))
        if k % 4 == 1:
            datagram = datagram[: source.randrange(len(datagram))]
        elif k % 4 == 2:
            datagram = source.randbytes(len(datagram))
        datagrams.append(datagram)
    return datagrams


def main() -> int:
    """Send in every turn that is a stranger's, and print how many were sent."""
    session, duration_s, *ports = sys.argv[1:]
    pool = hostile_datagrams(bytes.fromhex(session))
    ends = [(HOST, int(port)) for port in ports]
    sent = 0
    clock = MonotonicClock()
    now = clock.now_ns()
    end = now + round(1e9 * float(duration_s))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        while now < end:
            if turn_of(now) == HOSTILE:
                for where in ends:
                    for _ in range(EACH):
                        sock.sendto(pool[sent % POOL], where)
                        sent += 1
            clock.sleep_until(now + 1_000_000)
            now = clock.now_ns()
    sys.stdout.write(str(sent))
    return 0


if __name__ == "__main__":
    sys.exit(main())
