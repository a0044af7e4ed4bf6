"""Signatures with the keys of `tautwave keys init`: who vouches for a document."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import NamedTuple

from tautwave.errors import ConfigError
from tautwave.reading import read_file
from tautwave.sites.certificates import AUTHORITY, identity_files, load_library

LARGEST = 65536
"""Bytes of a key or certificate."""


class Signature(NamedTuple):
    """An Ed25519 signature, and the certificate of the site whose key made it (PEM)."""

    signature: bytes
    certificate: bytes


def sign(directory: Path, site: str, data: bytes) -> Signature:
    """Sign with the key of a site.

    Raises
    ------
    ConfigError
        A file is missing or is none of `make_authority`, or the library is missing.
    """
    load_library()
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    files = identity_files(directory, site)
    try:
        key = load_pem_private_key(read_file(files.key, LARGEST), None)
        certificate = read_file(files.certificate, LARGEST)
    except (OSError, ValueError, TypeError) as err:
        raise ConfigError(f"{files.key}: cannot be read as a key ({err})") from err
    if not isinstance(key, Ed25519PrivateKey):
        raise ConfigError(f"{files.key}: is not an Ed25519 key; create one with tautwave keys init")
    return Signature(key.sign(data), certificate)


def signer_of(signature: Signature, data: bytes, signed: datetime.datetime, directory: Path) -> str:
    """Return the name of the site that signed, by the authority in a directory.

    Raises
    ------
    ConfigError
        It is not its signature, the authority does not vouch for it, or not for that time.
    """
    x509 = load_library()
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
    from cryptography.x509.oid import NameOID

    path = directory / f"{AUTHORITY}.pem"
    try:
        authority = x509.load_pem_x509_certificate(read_file(path, LARGEST))
    except (OSError, ValueError) as err:
        raise ConfigError(f"{path}: is not an authority's certificate ({err})") from err
    try:
        certificate = x509.load_pem_x509_certificate(signature.certificate)
        certificate.verify_directly_issued_by(authority)
    except (ValueError, TypeError, InvalidSignature) as err:
        raise ConfigError(f"the signer's certificate was not issued by {path}") from err
    key = certificate.public_key()
    try:
        assert isinstance(key, Ed25519PublicKey)
        key.verify(signature.signature, data)
    except (AssertionError, InvalidSignature) as err:
        raise ConfigError("the signature does not match the certificate's key") from err
    if not certificate.not_valid_before_utc <= signed <= certificate.not_valid_after_utc:
        raise ConfigError(f"signed on {signed:%Y-%m-%d}, when its certificate was not valid")
    (name,) = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(name.value)
