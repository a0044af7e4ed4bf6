"""Who may see a run's page, and who may do something: addresses, hosts, origins, a token.

A page of another origin can make a browser ask any address that the browser reaches. So the host
that is asked for has to be one of ours (else a name that was pointed here would do), and what opens
a socket has to come from our own page.
"""

from __future__ import annotations

import ipaddress
import secrets
import ssl
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import NamedTuple

from tautwave.errors import ConfigError

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Of every response: nothing from elsewhere is loaded, and nothing is kept."""

PAGE_SOCKET, FOXGLOVE_SOCKET = "/live", "/foxglove"


class Door(NamedTuple):
    """Where viewers come in: `address` and `port`, TLS or not, and the token that allows more."""

    address: str
    port: int
    tls: ssl.SSLContext | None
    token: str

    @property
    def local(self) -> bool:
        """Whether only this machine reaches it."""
        return ipaddress.ip_address(self.address).is_loopback

    @property
    def hosts(self) -> frozenset[str]:
        """What a request may name as its host."""
        shown = f"[{self.address}]" if ":" in self.address else self.address
        names = {shown, "localhost"} if self.local else {shown}
        default = {443 if self.tls else 80} == {self.port}
        with_port = {f"{name}:{self.port}" for name in names}
        return frozenset(with_port | names if default else with_port)

    @property
    def origins(self) -> frozenset[str]:
        """Where the page that opens a socket may come from."""
        scheme = "http" if self.tls is None else "https"
        return frozenset(f"{scheme}://{host}" for host in self.hosts)

    @property
    def url(self) -> str:
        """The page's address, with the token where no server sees it."""
        scheme = "http" if self.tls is None else "https"
        shown = f"[{self.address}]" if ":" in self.address else self.address
        return f"{scheme}://{shown}:{self.port}/#{self.token}"

    def knows(self, token: object) -> bool:
        """Return whether that is the token; takes the same time for any that is wrong."""
        return isinstance(token, str) and secrets.compare_digest(
            token.encode(), self.token.encode()
        )


def open_door(address: str, port: int, certificate: Path | None, key: Path | None) -> Door:
    """Return where viewers come in, with a new token.

    Raises
    ------
    ConfigError
        The address is not numeric, or others reach it and there is no TLS; the certificate
        cannot be used.
    """
    try:
        given = ipaddress.ip_address(address)
    except ValueError as error:
        raise ConfigError(f"--address: give a numeric address (got {address[:80]!r})") from error
    local = given.is_loopback
    if given.is_unspecified:  # what requests name as their host could be anything
        raise ConfigError(
            f"--address {address}: give the one address that viewers open, such as 192.0.2.7"
        )
    if (certificate is None) != (key is None):
        raise ConfigError("--tls-cert and --tls-key belong together")
    if certificate is None and not local:
        raise ConfigError(
            f"--address {address}: reachable from other machines, so it needs --tls-cert and "
            "--tls-key; without them use 127.0.0.1"
        )
    return Door(address, port, _tls(certificate, key), secrets.token_urlsafe(24))


def _tls(certificate: Path | None, key: Path | None) -> ssl.SSLContext | None:
    if certificate is None:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        context.load_cert_chain(certificate, key)
    except (OSError, ssl.SSLError) as error:
        raise ConfigError(f"{certificate}, {key}: unusable for TLS ({error})") from error
    return context


def refused(
    path: str,
    hosts: Sequence[str],
    origins: Sequence[str],
    door: Door,
    others: Collection[str] = (),
) -> str:
    """Return why a request is refused, '' if it is not.

    Parameters
    ----------
    path : str
        Of the request.
    hosts, origins : sequence of str
        The `Host` and `Origin` headers that it has.
    door : Door
        Where it came in.
    others : collection of str
        More origins that may use Foxglove's protocol.
    """
    if len(hosts) != 1 or hosts[0].lower() not in door.hosts:
        return "this host is not served here"
    if len(origins) > 1:
        return "more than one origin"
    allowed = door.origins
    if path == FOXGLOVE_SOCKET:
        # Programs have no origin; they have to bring the token.
        return "" if not origins or origins[0] in {*allowed, *others} else "foreign origin"
    if path == PAGE_SOCKET and not origins:
        return "a web socket request needs an Origin header"
    return "" if not origins or origins[0] in allowed else "foreign origin"
