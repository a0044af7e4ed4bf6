"""An authority and a certificate per site: who may be the other end of a session.

Keys are Ed25519, certificates X.509 v3 with the site's name as DNS name, as the standard library's
TLS checks it.
"""

from __future__ import annotations

import datetime
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.errors import ConfigError
from tautwave.files import MODE, make_directory, writing

AUTHORITY = "authority"
NAME = re.compile(r"[a-z0-9]([a-z0-9-]{0,40}[a-z0-9])?")
DAYS = 825
"""Validity of a certificate [days]."""


class Identity(NamedTuple):
    """Files that a site needs: its certificate, its key, and the authority both trust."""

    certificate: Path
    key: Path
    authority: Path


def identity_files(directory: Path, site: str) -> Identity:
    """Return where the files of a site are in a directory of `make_authority`.

    Raises
    ------
    ConfigError
        One of them is missing.
    """
    identity = Identity(
        directory / f"{site}.pem", directory / f"{site}.key", directory / f"{AUTHORITY}.pem"
    )
    missing = [str(path) for path in identity if not path.is_file()]
    if missing:
        raise ConfigError(
            f"{', '.join(missing)}: missing; make them with: tautwave keys init DIR, and copy to "
            f"site {site} its own certificate and key, and {AUTHORITY}.pem"
        )
    return identity


def make_authority(directory: Path, sites: Sequence[str], days: int = DAYS) -> list[Path]:
    """Write an authority and a certificate for each site into a new or empty directory.

    The authority's key is used once and not kept: for another site make all anew.

    Raises
    ------
    ConfigError
        A name is not one, or stands twice, the directory is not empty, or the library is missing.
    WritingError
        A file cannot be written.
    """
    for site in sites:
        if not NAME.fullmatch(site) or site == AUTHORITY:
            raise ConfigError(
                f"{site!r} is not a valid site name: use lower-case letters, digits and hyphens, "
                f"not {AUTHORITY!r}"
            )
    if len(set(sites)) < 2 or len(set(sites)) < len(sites):
        raise ConfigError(f"a session joins two sites of different names (got {', '.join(sites)})")
    make_directory(directory)
    if any(directory.iterdir()):
        raise ConfigError(f"{directory}: not empty; give a new directory")
    authority_key, authority = _authority(days)
    written = [_write(directory / f"{AUTHORITY}.pem", _pem(authority))]
    for site in sites:
        key, certificate = _certificate(site, authority_key, authority, days)
        written.append(_write(directory / f"{site}.pem", _pem(certificate)))
        written.append(_write(directory / f"{site}.key", _key_pem(key), secret=True))
    return written


def load_library() -> Any:
    """Return `cryptography.x509`.

    Raises
    ------
    ConfigError
        It is not installed.
    """
    try:
        from cryptography import x509
    except ImportError as err:
        raise ConfigError("keys need the extra network: pip install 'tautwave[network]'") from err
    return x509


def _builder(subject: str, issuer: Any, public_key: Any, days: int) -> Any:
    x509 = load_library()
    from cryptography.x509.oid import NameOID

    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, subject)])
    now = datetime.datetime.now(datetime.UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name if issuer is None else issuer)
        .public_key(public_key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(minutes=5))  # clocks of two machines differ
        .not_valid_after(now + datetime.timedelta(days=days))
    )


def _authority(days: int) -> tuple[Any, Any]:
    x509 = load_library()
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    key = Ed25519PrivateKey.generate()
    usage = x509.KeyUsage(
        digital_signature=False, content_commitment=False, key_encipherment=False,
        data_encipherment=False, key_agreement=False, key_cert_sign=True, crl_sign=True,
        encipher_only=False, decipher_only=False,
    )  # fmt: skip
    builder = (
        _builder("tautwave authority", None, key.public_key(), days)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )
    return key, builder.sign(key, None)


def _certificate(site: str, authority_key: Any, authority: Any, days: int) -> tuple[Any, Any]:
    x509 = load_library()
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    key = Ed25519PrivateKey.generate()
    issuer = x509.AuthorityKeyIdentifier.from_issuer_public_key(authority_key.public_key())
    builder = (
        _builder(site, authority.subject, key.public_key(), days)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.SubjectAlternativeName([x509.DNSName(site)]), critical=False)
        .add_extension(issuer, critical=False)
    )
    return key, builder.sign(authority_key, None)


def _pem(certificate: Any) -> bytes:
    from cryptography.hazmat.primitives.serialization import Encoding

    return bytes(certificate.public_bytes(Encoding.PEM))


def _key_pem(key: Any) -> bytes:
    from cryptography.hazmat.primitives import serialization

    return bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )


def _write(path: Path, data: bytes, *, secret: bool = False) -> Path:
    # A key is its site's alone: stricter than the umask, as every program does with keys.
    with writing(path):
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
        with os.fdopen(os.open(path, flags, 0o600 if secret else MODE), "wb") as file:
            file.write(data)
    return path
