"""What an acceptance leaves: every number, SHA-256 of its recordings, and its seal."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.config.guard import parse_json
from tautwave.errors import ConfigError
from tautwave.files import write_text
from tautwave.reading import digest_of, read_file

FILE = "acceptance.json"
TRAFFIC = "traffic.txt"
LARGEST = 16 * 1024 * 1024
"""Bytes of a document."""


class Check(NamedTuple):
    """One thing that was measured: its stage, the axis (or bus), numbers, whether it is good."""

    stage: str
    what: str
    measured: dict[str, float | str]
    expected: str
    good: bool


def content_digest(content: Mapping[str, Any]) -> str:
    """Return the SHA-256 of everything but the seal."""
    body = {key: value for key, value in content.items() if key != "seal"}
    return hashlib.sha256(json.dumps(body, sort_keys=True).encode()).hexdigest()


def write_sealed(out: Path, content: dict[str, Any], keys: Path | None, site: str) -> Path:
    """Write the acceptance, with the digests of all recordings below `out`, and its seal.

    The seal is its SHA-256; with `keys`, a folder of `tautwave keys init`, it is also signed with
    the key of a site.

    Raises
    ------
    ConfigError
        There is no such key.
    """
    content["files"] = {
        str(path.relative_to(out)): digest_of(path)
        for path in sorted(out.rglob("*"))
        if path.suffix in (".mcap", ".yaml") or path.name == TRAFFIC
    }
    digest = content_digest(content)
    seal: dict[str, Any] = {"sha256": digest}
    if keys is not None:
        from tautwave.sites.signing import sign

        made = sign(keys, site, digest.encode())
        seal["signature"] = base64.b64encode(made.signature).decode()
        seal["certificate"] = made.certificate.decode()
    path = out / FILE
    write_text(path, json.dumps({**content, "seal": seal}, indent=2) + "\n")
    return path


class Verified(NamedTuple):
    """Faults of an acceptance, empty if it is sound; and who signed it, '' if nobody."""

    wrong: list[str]
    signer: str


def verify(path: Path, keys: Path | None = None) -> Verified:
    """Compare an acceptance with its seal and files; with `keys` its signature, too.

    Raises
    ------
    ConfigError
        It is no acceptance.
    """
    try:
        content = parse_json(read_file(path, LARGEST).decode())
        seal, files = content["seal"], content["files"]
        sealed = seal["sha256"]
        named = {str(name): str(digest) for name, digest in files.items()}
    except OSError as err:
        raise ConfigError(f"{path}: cannot be read: {err.strerror}") from err
    except (ValueError, KeyError, TypeError, AttributeError) as err:
        raise ConfigError(
            f"{path}: is not an acceptance.json written by `tautwave accept`, or is damaged"
        ) from err
    wrong = []
    digest = content_digest(content)
    if digest != sealed:
        wrong.append(f"{path}: was changed after it was sealed")
    for name, expected in named.items():
        there = path.parent / name
        if not there.exists():
            wrong.append(f"{there}: is gone")
        elif digest_of(there) != expected:
            wrong.append(f"{there}: differs from the file that was sealed")
    signer = ""
    if keys is not None:
        try:
            signer = _signer(seal, content, digest, keys)
        except ConfigError as err:
            wrong.append(f"{path}: {err}")
    return Verified(wrong, signer)


def _signer(seal: Mapping[str, Any], content: Mapping[str, Any], digest: str, keys: Path) -> str:
    if "signature" not in seal:
        raise ConfigError("sealed, but not signed")
    from tautwave.sites.signing import Signature, signer_of

    try:
        signature = Signature(base64.b64decode(seal["signature"]), seal["certificate"].encode())
        sealed = datetime.fromisoformat(content["sealed_utc"]).astimezone(UTC)
    except (ValueError, KeyError, TypeError, AttributeError) as err:
        raise ConfigError("its signature cannot be read") from err
    return signer_of(signature, digest.encode(), sealed, keys)
