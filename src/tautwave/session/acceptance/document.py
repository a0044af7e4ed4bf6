"""What an acceptance leaves: every number, SHA-256 of its recordings, and who signed it."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.config.guard import parse_json
from tautwave.errors import ConfigError
from tautwave.files import write_text

FILE = "acceptance.json"


class Check(NamedTuple):
    """One thing that was measured: its stage, the axis (or bus), numbers, whether it is good."""

    stage: str
    what: str
    measured: dict[str, float | str]
    expected: str
    good: bool


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def content_digest(content: dict[str, Any]) -> str:
    """Return the SHA-256 of everything but the signature."""
    body = {key: value for key, value in content.items() if key != "signature"}
    return hashlib.sha256(json.dumps(body, sort_keys=True).encode()).hexdigest()


def write_signed(out: Path, content: dict[str, Any], by: str, signed_utc: str) -> Path:
    """Write the acceptance, with the digests of all recordings below `out`, signed by a person."""
    content["files"] = {
        str(path.relative_to(out)): file_digest(path)
        for path in sorted(out.rglob("*"))
        if path.suffix in (".mcap", ".yaml")
    }
    signature = {"by": by, "signed_utc": signed_utc, "sha256": content_digest(content)}
    path = out / FILE
    write_text(path, json.dumps({**content, "signature": signature}, indent=2) + "\n")
    return path


def verify(path: Path) -> list[str]:
    """Return what is not as it was signed; nothing is good.

    Raises
    ------
    ConfigError
        It is no acceptance.
    """
    try:
        content = parse_json(path.read_text(encoding="utf-8"))
        signed = content["signature"]["sha256"]
        files = content["files"]
    except (OSError, ValueError, KeyError, TypeError) as err:
        raise ConfigError(f"{path}: is no acceptance: {err}") from err
    wrong = []
    if content_digest(content) != signed:
        wrong.append(f"{path}: was changed after it was signed")
    for name, digest in files.items():
        there = path.parent / name
        if not there.exists():
            wrong.append(f"{there}: is gone")
        elif file_digest(there) != digest:
            wrong.append(f"{there}: is not the file that was signed")
    return wrong
