"""The control plane of two sites: TLS 1.3 with certificates of both, one line of JSON a message.

Nothing here is on the loop's path. The site that serves draws session and secret; both are sure of
each other's name before anything else is sent. A refusal gives a message on both sides.
"""

from __future__ import annotations

import datetime
import json
import secrets
import socket
import ssl
import time
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

from tautwave.config.guard import parse_json
from tautwave.errors import LinkError
from tautwave.sites.certificates import Identity
from tautwave.sites.seal import SECRET_BYTES, SESSION_BYTES

PROTOCOL = 1
"""Version of messages and datagrams; both sites must have the same."""

MAX_BYTES = 65536
PATIENCE_S = 5.0
"""Time for a handshake with all its answers, or for one message later [s]."""
AGAIN_S = 0.25
"""Time between two attempts to dial [s]."""
CROWDED = (
    "ended the handshake without a reason: too many connections at its port, or another program "
    "there"
)


class Session(NamedTuple):
    """What both sites agreed on.

    `peer` is the other's name; `facts` what it stated, such as its data port.
    """

    id: bytes
    secret: bytes
    peer: str
    facts: Mapping[str, Any]


def differences(here: Mapping[str, Any], there: Mapping[str, Any]) -> Iterator[str]:
    """Yield a phrase for each key of two tables of JSON that is not the same on both sides."""
    for key in sorted({*here, *there}):
        one, two = here.get(key), there.get(key)
        if isinstance(one, Mapping) and isinstance(two, Mapping):
            yield from (f"{key}.{text}" for text in differences(one, two))
        elif one != two:
            yield f"{key}: {_shown(one)} here, {_shown(two)} there"


def _shown(value: Any) -> str:
    return "nothing" if value is None else json.dumps(value)


def server_context(files: Identity) -> ssl.SSLContext:
    """Return what a serving site speaks: TLS 1.3, and the other one's certificate is required."""
    context = _context(ssl.PROTOCOL_TLS_SERVER, files)
    # No tickets: with one the other site would get in without its certificate, also when that is
    # over. Each session draws its keys anew, so there is nothing to save.
    context.num_tickets = 0
    context.options |= ssl.OP_NO_TICKET
    return context


def client_context(files: Identity) -> ssl.SSLContext:
    """Return what a dialling site speaks: TLS 1.3, the other one's name is checked."""
    return _context(ssl.PROTOCOL_TLS_CLIENT, files)


def _context(protocol: int, files: Identity) -> ssl.SSLContext:
    context = ssl.SSLContext(protocol)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    try:
        context.load_cert_chain(files.certificate, files.key)
        context.load_verify_locations(files.authority)
    except (ssl.SSLError, OSError) as err:
        raise LinkError(
            f"{files.certificate}, {files.key} and {files.authority} do not match ({err}); create "
            "new ones with: tautwave keys init DIR"
        ) from err
    context.verify_mode = ssl.CERT_REQUIRED
    return context


class Wish(NamedTuple):
    """What a `Meeting` waits for: its socket readable, or `writing`.

    `leaving`: it has failed, and only lets the other side read why.
    """

    writing: bool = False
    leaving: bool = False


class RefusedError(LinkError):
    """The other site is there and refuses a session, or is another one; trying again is useless."""


class DroppedError(LinkError):
    """The other end closed the connection without a reason; trying again may help."""


class _Broken(Exception):
    """Nothing more can come on a connection."""


class Channel:
    """A connection on which both sites are known; not for use by two threads."""

    def __init__(self, connection: ssl.SSLSocket, where: str) -> None:
        self._connection = connection
        self.where = where
        self._waiting = b""

    def fileno(self) -> int:
        """Return the socket's, to wait for it; -1 once closed."""
        return self._connection.fileno()

    def send(self, message: Mapping[str, Any]) -> None:
        """Send a message; raises `LinkError` if the other site is lost."""
        try:
            self._connection.settimeout(PATIENCE_S)
            self._connection.sendall(json.dumps(message).encode() + b"\n")
        except OSError as err:
            raise LinkError(f"{self.where}: {_why(err)}") from err

    def receive(self, timeout_s: float = PATIENCE_S) -> dict[str, Any]:
        """Return the next message; raises `LinkError` where none comes, or what came is not one.

        Only the first leaves the connection open.
        """
        try:
            return self._receive(timeout_s)
        except _Broken as err:
            raise self._gone(err) from err

    def poll(self) -> dict[str, Any] | None:
        """Return the next message if it is there; raises `LinkError` where none can come."""
        try:
            while b"\n" not in self._waiting:
                if not self._more(0.0):
                    return None
            return self._message()
        except _Broken as err:
            raise self._gone(err) from err

    def _gone(self, err: _Broken) -> LinkError:
        self.close()
        refused = _is_refusal(err.__cause__)  # TLS 1.3 says so after the handshake
        return (RefusedError if refused else LinkError)(f"{self.where}: {err}")

    def _receive(self, timeout_s: float) -> dict[str, Any]:
        deadline = time.monotonic() + timeout_s
        while b"\n" not in self._waiting:
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise LinkError(f"{self.where}: no message within {timeout_s:g} s")
            self._more(left)
        return self._message()

    def _more(self, timeout_s: float) -> bool:
        """Read available bytes; return whether there were any."""
        self._connection.settimeout(timeout_s)
        try:
            more = self._connection.recv(4096)
        except (TimeoutError, BlockingIOError, ssl.SSLWantReadError):
            return False
        except OSError as err:
            raise _Broken(_why(err)) from err
        if not more:
            raise _Broken("closed the connection")
        self._waiting += more
        if len(self._waiting) > MAX_BYTES:
            raise _Broken(f"sent a message of over {MAX_BYTES} bytes")
        return True

    def _message(self) -> dict[str, Any]:
        line, _, self._waiting = self._waiting.partition(b"\n")
        try:
            message = parse_json(line.decode(), finite=True)
        except ValueError as err:
            raise _Broken("sent an invalid message") from err
        if not isinstance(message, dict):
            raise _Broken("sent an invalid message")
        return message

    def refuse(self, why: str) -> None:
        """Send the reason of a refusal, and close."""
        with suppress(LinkError):
            self.send(_refusal(why))
        self.close()

    def turn_away(self, theirs: str, ours: str, *, for_now: bool = False) -> Generator[Wish]:
        """Send the reason of a refusal (`for_now`: it may pass); once it is read, raise it."""
        self.send(_refusal(theirs, for_now=for_now))
        yield from _leave(self._connection)
        raise LinkError(f"{self.where}: {ours}")

    @property
    def names(self) -> list[str]:
        """The names in the other side's certificate."""
        certificate = self._connection.getpeercert() or {}
        stated: Any = certificate.get("subjectAltName", ())
        return [value for kind, value in stated if kind == "DNS"]

    def close(self) -> None:
        """Close the connection; never raises."""
        with suppress(OSError):
            self._connection.settimeout(0.2)
            self._connection.unwrap()
        self._connection.close()


Meeting = Generator[Wish, None, tuple[Channel, Session]]
"""A handshake that never blocks: it is resumed when what it yields has come about."""


def meeting(
    connection: socket.socket,
    context: ssl.SSLContext,
    peer: str,
    shared: Mapping[str, Any],
    facts: Mapping[str, Any],
    busy: Callable[[], str] = str,
) -> Meeting:
    """Agree on a session with a site that dialled, without waiting for it.

    Parameters
    ----------
    connection : socket
        As accepted; it is closed if nothing comes of it.
    context : SSLContext
        `server_context`.
    peer : str
        The name that the other site must have.
    shared : mapping
        What must be the same on both sides, JSON.
    facts : mapping
        What the other site has to know of this one, JSON.
    busy : callable
        Returns why there can be no session just now, nothing where there can.

    Raises
    ------
    LinkError
        It is not that site, or something differs; the other one gets a sentence too. A
        `TimeoutError` thrown in ends it as one that took too long.
    """
    try:
        where = "{}:{}".format(*connection.getpeername()[:2])
    except OSError as err:
        connection.close()
        raise LinkError(f"a peer connected and disconnected immediately ({err.strerror})") from err
    try:
        connection.setblocking(False)
        secured = context.wrap_socket(connection, server_side=True, do_handshake_on_connect=False)
    except OSError as err:
        connection.close()
        raise LinkError(f"{where}: {_why(err)}") from err
    try:
        yield from _secure(secured, where)
        return (yield from _agree(Channel(secured, where), peer, shared, facts, busy))
    except TimeoutError as err:
        secured.close()
        raise LinkError(f"{where}: {_why(err)}") from err
    except BaseException:
        secured.close()
        raise


def _secure(secured: ssl.SSLSocket, where: str) -> Generator[Wish]:
    """Shake hands by TLS."""
    while True:
        try:
            secured.do_handshake()
        except ssl.SSLWantReadError:
            yield Wish()
        except ssl.SSLWantWriteError:
            yield Wish(writing=True)
        except OSError as err:
            yield from _leave(secured)
            raise LinkError(f"{where}: {_why(err)}") from err
        else:
            return


def _agree(
    channel: Channel,
    peer: str,
    shared: Mapping[str, Any],
    facts: Mapping[str, Any],
    busy: Callable[[], str],
) -> Meeting:
    """Draw a session, if it is the right site and nothing differs."""
    names = channel.names
    if names != [peer]:
        listed = ", ".join(names) or "nobody"
        yield from channel.turn_away(
            f"your certificate belongs to {listed}, but {peer} is expected here",
            f"its certificate belongs to {listed}, not to {peer}",
        )
    while (hello := channel.poll()) is None:
        yield Wish()
    _heed(hello, channel.where)
    objection = _objection(hello, shared)
    if objection:
        yield from channel.turn_away(*objection)
    why = busy()
    if why:
        yield from channel.turn_away(why, f"refused: {why}", for_now=True)
    session = Session(
        secrets.token_bytes(SESSION_BYTES),
        secrets.token_bytes(SECRET_BYTES),
        peer,
        _table(hello, "facts"),
    )
    channel.send(
        {
            "protocol": PROTOCOL, "shared": shared, "facts": facts,
            "session": session.id.hex(), "secret": session.secret.hex(),
        }
    )  # fmt: skip
    return channel, session


def _leave(secured: ssl.SSLSocket) -> Generator[Wish]:
    """Let the other side read the reason: closing with its bytes unread would discard it."""
    with suppress(OSError):  # and with it a TimeoutError thrown in: that was all the time there is
        secured.shutdown(socket.SHUT_WR)  # from here on it reads what comes, not TLS
        while True:
            try:
                if not secured.recv(4096):
                    return
            except BlockingIOError:
                yield Wish(leaving=True)


def dial(
    address: tuple[str, int],
    context: ssl.SSLContext,
    peer: str,
    shared: Mapping[str, Any],
    facts: Mapping[str, Any],
) -> tuple[Channel, Session]:
    """Agree on a session with a site that serves, within `PATIENCE_S`; arguments as `meeting`.

    Raises
    ------
    LinkError
        It is not there, or does not answer.
    DroppedError
        It ended the connection without a reason.
    RefusedError
        It refuses, or is not that site.
    """
    where = f"{peer} at {address[0]}:{address[1]}"
    deadline = time.monotonic() + PATIENCE_S
    try:
        connection = socket.create_connection(address, timeout=PATIENCE_S)
    except OSError as err:
        raise LinkError(f"{where}: {_why(err)}") from err
    try:
        connection.settimeout(max(1e-3, deadline - time.monotonic()))
        secured = context.wrap_socket(connection, server_hostname=peer)
    except OSError as err:
        connection.close()
        if _is_refusal(err):
            raise RefusedError(f"{where}: {_why(err)}") from err
        if isinstance(err, ConnectionError | ssl.SSLError):
            raise DroppedError(f"{where}: {CROWDED}") from err
        raise LinkError(f"{where}: {_why(err)}") from err
    channel = Channel(secured, where)
    try:
        channel.send({"protocol": PROTOCOL, "shared": shared, "facts": facts})
        answer = channel.receive(max(1e-3, deadline - time.monotonic()))
        _heed(answer, where)
    except LinkError as err:
        channel.close()
        if isinstance(err.__cause__, _Broken | OSError) and not isinstance(err, RefusedError):
            raise DroppedError(f"{where}: {CROWDED}") from err
        raise
    theirs, ours = _objection(answer, shared) or ("", "")
    if ours:
        channel.refuse(theirs)
        raise RefusedError(f"{where}: {ours}")
    session = _bytes(answer, "session", SESSION_BYTES)
    secret = _bytes(answer, "secret", SECRET_BYTES)
    if session is None or secret is None:
        channel.refuse("your session lacks an id or secret")
        raise LinkError(f"{where}: sent no session")
    return channel, Session(session, secret, peer, _table(answer, "facts"))


def _bytes(message: Mapping[str, Any], key: str, size: int) -> bytes | None:
    try:
        decoded = bytes.fromhex(message[key])
    except (KeyError, TypeError, ValueError):
        return None
    return decoded if len(decoded) == size else None


def _heed(message: Mapping[str, Any], where: str) -> None:
    """Raise the reason that a refusal gives."""
    if "refused" in message:
        kind = LinkError if message.get("for_now") is True else RefusedError
        raise kind(f"{where}: refused: {message['refused']}")


def _refusal(why: str, *, for_now: bool = False) -> dict[str, Any]:
    return {"refused": why, "for_now": for_now}


def _objection(message: Mapping[str, Any], shared: Mapping[str, Any]) -> tuple[str, str] | None:
    """Return why a first message is refused, worded for the other side and for this one."""
    version = message.get("protocol")
    if version != PROTOCOL:
        return (
            f"protocol {PROTOCOL} here, {version} there; use the same version of both",
            f"protocol {version} there, {PROTOCOL} here; use the same version",
        )
    theirs = _table(message, "shared")
    difference = _listed(shared, theirs)
    if difference:
        return f"the rigs differ: {_listed(theirs, shared)}", f"the rigs differ: {difference}"
    return None


def _listed(here: Mapping[str, Any], there: Mapping[str, Any]) -> str:
    sentences = list(differences(here, there))
    return "; ".join(sentences[:8]) + (" ..." if len(sentences) > 8 else "")


def _table(message: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    block = message.get(key)
    return block if isinstance(block, dict) else {}


def _is_refusal(err: BaseException | None) -> bool:
    """Return whether an error of TLS is a refusal, not a connection that only ended."""
    ended = (ssl.SSLEOFError, ssl.SSLZeroReturnError, ssl.SSLSyscallError)
    return isinstance(err, ssl.SSLError) and not isinstance(err, ended)


ALERTS = {
    "UNKNOWN_CA": "it does not trust the authority of our certificate; both need the same "
    "authority.pem",
    "CERTIFICATE_EXPIRED": "it reports that our certificate has expired; create new keys",
    "CERTIFICATE_REQUIRED": "it requires a certificate and received none",
    "BAD_CERTIFICATE": "it refused our certificate: another name than it expects, or by its clock "
    "not valid yet",
    "PEER_DID_NOT_RETURN_A_CERTIFICATE": "it has no certificate",
    "WRONG_VERSION_NUMBER": "it does not speak TLS",
    "HTTP_REQUEST": "it speaks HTTP instead of TLS 1.3",
    "UNSUPPORTED_PROTOCOL": "it does not speak TLS 1.3",
    "UNEXPECTED_EOF": "closed the connection during the handshake",
}
"""What the last word of a TLS error means."""


NOT_YET_VALID = 9
"""OpenSSL's X509_V_ERR_CERT_NOT_YET_VALID."""
HOSTNAME_MISMATCH = 62
"""OpenSSL's X509_V_ERR_HOSTNAME_MISMATCH."""


def _why(err: OSError) -> str:
    """Return what a failed connection means, with the remedy where there is one."""
    if isinstance(err, ssl.SSLCertVerificationError):
        if "expired" in err.verify_message:
            return "its certificate has expired; create new keys"
        if err.verify_code == NOT_YET_VALID:
            now = datetime.datetime.now(datetime.UTC)
            return (
                "its certificate is not valid yet; compare the clocks of the machines and the one "
                f"on which the keys were made (here it is {now:%Y-%m-%d %H:%M} UTC)"
            )
        if err.verify_code == HOSTNAME_MISMATCH:
            return "its certificate belongs to another site"
        return f"its certificate was not issued by our authority ({err.verify_message})"
    if isinstance(err, ssl.SSLError):
        word = err.reason or str(err)
        for key, sentence in ALERTS.items():
            if key in word.upper().replace(" ", "_"):
                return sentence
        return f"TLS failed ({word})"
    if isinstance(err, ConnectionRefusedError):
        return "connection refused; start the other site first, and check address and port"
    if isinstance(err, socket.gaierror):
        return "unknown host name; check the address"
    if isinstance(err, TimeoutError):
        return f"no response within {PATIENCE_S:g} s; check address, port and firewall"
    return f"connection lost ({err.strerror or err})"
