"""Format versions of the files that outlive a run. A file without a version is of version 1.

Raise a version when the meaning of a file's content changes, or when the previous reader cannot
read it; a new key with a default does not need it. Keep reading older versions, or say here what to
do with them.
"""

from __future__ import annotations

RIG = 1
"""Rig files, `rig.yaml` of a run among them: key `format`."""

RECORDING = 1
"""`recording.mcap`: key `format` of the metadata `tautwave`."""


def too_new(kind: str, given: object, known: int) -> str | None:
    """Return why a file of version `given` cannot be read, with the remedy; None if it can.

    A value that is not a version is not checked here.
    """
    text = str(given)
    if isinstance(given, bool) or not text.isdecimal():
        return None
    if len(text) < 10 and int(text) <= known:
        return None
    return (
        f"{given} is newer than the {kind} format {known} that this tautwave reads; "
        "pip install --upgrade tautwave"
    )
