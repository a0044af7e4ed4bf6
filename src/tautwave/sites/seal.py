"""The seal of a datagram: encrypted, authenticated, never accepted twice. Bytes in, bytes out.

    kind 1 B | session 8 B | sequence 8 B | encrypted payload | tag 16 B       (big-endian)

The head is authenticated as it stands. The nonce is the sequence, which only rises; a key belongs
to one direction of one session, whose secret is drawn anew for each: so no nonce is used twice with
a key, whatever restarts. What was authentic once is refused later by a window over the sequence.

Source: RFC 8439 (ChaCha20-Poly1305), RFC 5869 (keys from the secret), RFC 6479 (window).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

from tautwave.errors import ConfigError

KIND = 0x54
"""First byte of every datagram of this layout; another layout takes another."""

SECRET_BYTES = 32
SESSION_BYTES = 8
HEAD = struct.Struct(">B8sQ")
TAG_BYTES = 16
OVERHEAD = HEAD.size + TAG_BYTES
"""What sealing adds to a payload [bytes]."""

WINDOW = 1024
"""Datagrams by which one may be late: a second at 1 kHz."""

LAST = 2**64 - 1

NONCE_HEAD = bytes(4)
FOREIGN, OLD_SESSION, LATE = "foreign", "old_session", "late"
REPEATED, FORGED = "repeated", "forged"
REFUSALS = (FOREIGN, OLD_SESSION, LATE, REPEATED, FORGED)
"""Why a datagram is refused: not of ours, of another session, older than the window, accepted
before, or not sealed with this key."""


def load_cryptography() -> Any:
    """Import the authenticated encryption.

    Raises
    ------
    ConfigError
        It is not installed.
    """
    try:
        from cryptography.hazmat.primitives.ciphers import aead
    except ImportError as err:
        raise ConfigError(
            "two sites need the extra network: pip install 'tautwave[network]'"
        ) from err
    return aead


def direction_key(secret: bytes, session: bytes, sender: str) -> bytes:
    """Return the key of what `sender` seals in a session.

    Parameters
    ----------
    secret : bytes
        Drawn anew for each session, 32 bytes; known to both sites only.
    session : bytes
        Its id, 8 bytes.
    sender : str
        Name of the site.
    """
    from cryptography.hazmat.primitives.hashes import SHA256
    from cryptography.hazmat.primitives.kdf.hkdf import HKDF

    if len(secret) != SECRET_BYTES or len(session) != SESSION_BYTES:
        raise ValueError("a secret has 32 bytes and a session id 8")
    info = b"tautwave data plane 1 " + sender.encode()
    return HKDF(algorithm=SHA256(), length=32, salt=session, info=info).derive(secret)


class Sealer:
    """Seals one direction of one session."""

    def __init__(self, secret: bytes, session: bytes, sender: str) -> None:
        self._cipher = load_cryptography().ChaCha20Poly1305(direction_key(secret, session, sender))
        self._session = session
        self._sequence = 0

    def seal(self, payload: bytes) -> bytes:
        """Return the datagram of a payload.

        Raises
        ------
        OverflowError
            All sequence numbers are used: the session ends.
        """
        if self._sequence == LAST:
            raise OverflowError("the session has no sequence number left")
        self._sequence += 1
        head = HEAD.pack(KIND, self._session, self._sequence)
        return head + bytes(self._cipher.encrypt(NONCE_HEAD + head[9:], payload, head))


@dataclass(slots=True)
class Window:
    """The sequence numbers accepted so far: all up to `top`, bit by bit for the last `WINDOW`."""

    top: int = 0
    seen: int = 0

    def refusal(self, sequence: int) -> str | None:
        """Return why a number is refused, None if it is not."""
        if sequence > self.top:
            return None
        behind = self.top - sequence
        if behind >= WINDOW or sequence == 0:
            return LATE
        return REPEATED if self.seen >> behind & 1 else None

    def accept(self, sequence: int) -> None:
        """Mark a number as accepted."""
        if sequence > self.top:
            rise = sequence - self.top
            self.seen = (self.seen << rise | 1) & ((1 << WINDOW) - 1) if rise < WINDOW else 1
            self.top = sequence
        else:
            self.seen |= 1 << self.top - sequence


class Opener:
    """Opens what the other site sealed in one session; anything else is counted and dropped.

    `accepted` is how many were opened, `refused` how many not, by reason.
    """

    def __init__(self, secret: bytes, session: bytes, sender: str) -> None:
        cipher = load_cryptography().ChaCha20Poly1305(direction_key(secret, session, sender))
        from cryptography.exceptions import InvalidTag

        self._cipher, self._invalid = cipher, InvalidTag
        self._session = session
        self._window = Window()
        self.accepted = 0
        self.refused = dict.fromkeys(REFUSALS, 0)

    @property
    def newest(self) -> int:
        """Return the greatest sequence number that was opened, 0 before the first."""
        return self._window.top

    def open(self, datagram: bytes) -> bytes | None:
        """Return the payload of a datagram, None if it is refused; never raises."""
        if len(datagram) < OVERHEAD or datagram[0] != KIND:
            return self._refuse(FOREIGN)
        _, session, sequence = HEAD.unpack_from(datagram)
        if session != self._session:
            return self._refuse(OLD_SESSION)
        why = self._window.refusal(sequence)
        if why is not None:
            return self._refuse(why)
        head = datagram[: HEAD.size]
        try:
            payload = self._cipher.decrypt(NONCE_HEAD + head[9:], datagram[HEAD.size :], head)
        except self._invalid:
            return self._refuse(FORGED)
        self._window.accept(sequence)  # only what is authentic moves the window
        self.accepted += 1
        return bytes(payload)

    def _refuse(self, why: str) -> bytes | None:
        self.refused[why] += 1
        return None
