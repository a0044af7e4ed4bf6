"""Versions of the files that outlive a run: what they are now, and what is read.

A file without a version is of version 1. A version goes up when what is in a file means something
else than before, or cannot be read by the reader before; a new key with a default does not.
Whoever raises one keeps reading the older, or says here what to do with it.
"""

from __future__ import annotations

RIG = 1
"""Rig files, `rig.yaml` of a run among them: key `format`."""

RECORDING = 1
"""`recording.mcap`: key `format` of the metadata `tautwave`."""


def too_new(kind: str, given: object, known: int) -> str | None:
    """Return why a file of version `given` is not read, with the remedy; None where it is.

    What is no version at all is not looked at here.
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
